"""The footprint returned by a family, and the laminate built from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from sbafab.actuators.ears import Ear, Holder, Ray, placed, tails
from sbafab.actuators.stacking import (
    BalloonShape,
    BalloonStack,
    bonded,
    stacked,
    tab_and_strip,
)
from sbafab.design.records import Design
from sbafab.errors import DesignError
from sbafab.geometry.edges import Point, unit
from sbafab.geometry.offset import fillet, grow
from sbafab.geometry.region import Region, union
from sbafab.geometry.spatial_index import boxes_meet
from sbafab.laminate.laminate import Chamber, Inlet, Laminate

EARS: tuple[tuple[str, Holder], ...] = (
    ("film1", "film"),
    ("film2", "film"),
    ("mask1", "mask"),
    ("mask2", "mask"),
)


@dataclass(frozen=True)
class Footprint:
    """Balloons in one piece seen from above, mm.

    ``pockets`` holds one pocket per chamber for each distinct balloon, and ``shape_of`` the index
    of each balloon's own, bottom to top. Chambers have ``axes``, and inlets that run from these
    along unit ``directions``; without its tab the film ends ``edge`` mm from the axis. ``hub``
    joins the lobes of several chambers. ``lumen`` and ``lumen_pin`` are diameters. ``ears`` are
    start and angle (degrees) of two film ears and two mask ears.
    """

    pockets: Sequence[Sequence[Region]]
    shape_of: tuple[int, ...]
    axes: tuple[Point, ...]
    directions: Sequence[Point]
    edge: float
    ears: Sequence[tuple[Point, float]]
    hub: Region | None = None
    lumen: float | None = None
    lumen_pin: float = 0.0
    notes: tuple[str, ...] = ()


def build_footprint(design: Design, footprint: Footprint) -> Laminate:
    """Return the laminate of a footprint. Raises DesignError if parts do not fit."""
    chambers = [Chamber(f"chamber{n}", (axis,)) for n, axis in enumerate(footprint.axes, start=1)]
    shapes = tuple(_plate(design, footprint.hub, pockets) for pockets in footprint.pockets)
    first = footprint.pockets[footprint.shape_of[0]]
    outlines = [bonded(pocket, design.bond.width) for pocket in first]
    feeds = [
        tab_and_strip(design, chamber.name, pocket, axis, direction, footprint.edge)
        for chamber, pocket, axis, direction in zip(
            chambers, first, footprint.axes, footprint.directions, strict=True
        )
    ]
    _check_tabs(design, outlines, feeds)
    hub = () if footprint.hub is None else (footprint.hub,)
    bottom = BalloonShape(
        fillet(union([*hub, *outlines, *(tab for tab, _, _ in feeds)]), design.fillet.radius),
        union([*first, *(strip for _, strip, _ in feeds)]),
        1,
        len(chambers),
    )
    inlets = tuple(inlet for _, _, inlet in feeds)
    plates = union(shape.outline for shape in shapes)
    ears: tuple[Ear, ...] = ()
    body = plates
    if design.registration.method == "ears":
        body = bottom.outline | plates
        ears = placed(_rays(footprint, design), body, plates, design)
    stack = BalloonStack(
        bottom,
        shapes,
        footprint.shape_of,
        footprint.axes,
        footprint.lumen,
        footprint.lumen_pin,
        ears,
        tails(inlets, body, ears, design),
    )
    laminate = stacked(design, stack, chambers, inlets)
    return replace(laminate, notes=(*footprint.notes, *laminate.notes), outline=plates)


def _plate(design: Design, hub: Region | None, pockets: Sequence[Region]) -> BalloonShape:
    """A balloon without its inlets; lobes are joined by the hub, their corners filleted."""
    lobes = [bonded(pocket, design.bond.width) for pocket in pockets]
    if hub is None:
        return BalloonShape(lobes[0], pockets[0], 1, 1)
    outline = fillet(union([hub, *lobes]), design.fillet.radius)
    return BalloonShape(Region(outline.outers), union(pockets), 1, len(pockets))


def _rays(footprint: Footprint, design: Design) -> list[Ray]:
    """Rays of the ears; a single balloon has no separator mask to hold."""
    return [
        Ray(name, holder, start, unit(angle), name.endswith("2"))
        for (name, holder), (start, angle) in zip(EARS, footprint.ears, strict=True)
        if holder == "film" or design.stack.balloons > 1
    ]


def _check_tabs(
    design: Design, outlines: Sequence[Region], feeds: Sequence[tuple[Region, Region, Inlet]]
) -> None:
    """Raises DesignError if a tab is nearer than one overhang to another lobe or tab."""
    room = design.mask.overhang
    for i, (tab, _, inlet) in enumerate(feeds):
        aside = [
            j
            for j, outline in enumerate(outlines)
            if j != i
            and not all(_lies_ahead(tab, part, inlet, room) for part in (outline, feeds[j][0]))
        ]
        if not aside:
            continue
        free = grow(tab - outlines[i], room)
        for j in aside:
            if _overlap(free, outlines[j]) or _overlap(free, feeds[j][0]):
                raise DesignError(
                    f"the inlet tab of {inlet.chamber} ({inlet.width + 2 * design.bond.width:g} "
                    f"wide) meets the lobe or tab of {feeds[j][2].chamber}; make inlet.width "
                    "smaller, chamber.axis_radius larger or chamber.count smaller"
                )


def _lies_ahead(tab: Region, part: Region, inlet: Inlet, room: float) -> bool:
    """True if all of a tab is farther out along its inlet than another part, by a margin."""
    (x, y), centre = inlet.direction, (0.0, 0.0)
    nearest = -max(edge.farthest_along(centre, (-x, -y)) for edge in tab.edges)
    return nearest - max(edge.farthest_along(centre, (x, y)) for edge in part.edges) > room


def _overlap(a: Region, b: Region) -> bool:
    return boxes_meet(a.bounds, b.bounds) and not (a & b).is_empty
