"""The section through one chamber: which layers it shows and where each is cut."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from sbafab.geometry.edges import Point
from sbafab.geometry.section import Interval, section
from sbafab.laminate.interfaces import Interface
from sbafab.laminate.laminate import Inlet, Laminate, Layer
from sbafab.reports.stack_pins import Rod, rods

MOST_BALLOONS = 4
"""Up to so many balloons are shown in full."""
BEYOND_LUMEN = 3.25


@dataclass(frozen=True)
class SectionSlab:
    """A layer cut by the plane: where along it there is film."""

    layer: Layer
    spans: tuple[Interval, ...]


@dataclass(frozen=True)
class Joint:
    """An interface cut by the plane: where along it the gap is filled with TPE."""

    interface: Interface
    spans: tuple[Interval, ...]


@dataclass(frozen=True)
class StackSection:
    """The cut, in mm along the plane from the chamber's axis, positive toward its inlet.

    ``hidden`` balloons are left out above the layer ``break_above`` (an index; 0 for none).
    ``lumen`` is the axis of the actuator along the plane, where there is a lumen. ``cropped``
    says that what lies beyond ``low`` is not shown. ``tab`` runs from the outline to its mouth.
    """

    chamber: str
    slabs: tuple[SectionSlab, ...]
    joints: tuple[Joint, ...]
    low: float
    high: float
    cropped: bool
    lumen: float | None
    tab: Interval | None
    hidden: int
    break_above: int
    rods: tuple[Rod, ...]


def chamber_section(laminate: Laminate) -> StackSection:
    """The section in the plane of the first chamber's axis and its inlet."""
    chamber = laminate.chambers[0]
    origin = next(
        (bore.centre for bore in laminate.bores if bore.chamber == chamber.name),
        chamber.centres[0],
    )
    inlet = next((found for found in laminate.inlets if found.chamber == chamber.name), None)
    direction = inlet.direction if inlet else (1.0, 0.0)
    layers, hidden, break_above = _shown(laminate)
    lumen = -(origin[0] * direction[0] + origin[1] * direction[1]) if laminate.lumen else None
    patterns = {layer.pattern: layer.profile for layer in layers}
    cuts = {name: section(region, origin, direction) for name, region in patterns.items()}
    ends = [end for spans in cuts.values() for span in spans for end in span]
    low, high = min(ends), max(ends)
    crop = low if lumen is None else max(low, lumen - (laminate.lumen or 0) / 2 - BEYOND_LUMEN)
    shown = {layer.index for layer in layers}
    joints = [
        Joint(interface, _clipped(section(interface.bond, origin, direction), crop))
        for interface in laminate.interfaces
        if interface.masks and shown.issuperset(mask.index for mask in interface.masks)
    ]
    slabs = [SectionSlab(layer, _clipped(cuts[layer.pattern], crop)) for layer in layers]
    return StackSection(
        chamber.name,
        tuple(slabs),
        tuple(joints),
        crop,
        high,
        crop > low,
        lumen,
        _tab(inlet, origin) if inlet else None,
        hidden,
        break_above,
        tuple(rod for rod in rods(laminate, origin, direction) if rod.span[0] > crop),
    )


def _tab(inlet: Inlet, origin: Point) -> Interval:
    (x, y), (u, v) = inlet.mouth, inlet.direction
    mouth = (x - origin[0]) * u + (y - origin[1]) * v
    return mouth - inlet.length, mouth


def _shown(laminate: Laminate) -> tuple[tuple[Layer, ...], int, int]:
    """Layers to show, how many balloons are left out, and above which layer."""
    count = laminate.balloons
    if count <= MOST_BALLOONS:
        return laminate.layers, 0, 0
    bottom = [layer for layer in laminate.layers if layer.balloon is None or layer.balloon <= 2]
    top = [
        layer
        for layer in laminate.layers
        if layer.balloon == count or (layer.balloon == count - 1 and layer.role == "separator-mask")
    ]
    return (*bottom, *top), count - 3, bottom[-1].index


def _clipped(spans: Sequence[Interval], low: float) -> tuple[Interval, ...]:
    return tuple((max(start, low), end) for start, end in spans if end > low)


def opening(spans: Sequence[Interval], at: float) -> Interval | None:
    """The opening between two spans that holds ``at``; None where ``at`` is covered or outside."""
    before = [end for _, end in spans if end <= at]
    after = [start for start, _ in spans if start >= at]
    if not before or not after or any(start < at < end for start, end in spans):
        return None
    return max(before), min(after)
