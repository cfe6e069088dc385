"""What a drawing of a profile gives the size of, measured on the profile itself."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from sbafab.geometry.edges import Arc, Point
from sbafab.geometry.region import Contour, Region
from sbafab.geometry.section import section
from sbafab.laminate.laminate import Inlet, Laminate, Layer
from sbafab.reports.drawing import TIMES

SAME = 1e-4
MOST_RADII = 3


@dataclass(frozen=True)
class Circle:
    """A circle or arc to point at, and the words for all of its kind.

    ``centre`` and ``radius`` are mm, like ``toward``, the point of an arc to point at; a
    ``phantom`` is not an edge of the profile.
    """

    words: str
    centre: Point
    radius: float
    toward: Point | None = None
    phantom: bool = False


@dataclass(frozen=True)
class WidthDimension:
    """A width to draw across, from ``start`` to ``end`` in mm, and its words."""

    words: str
    start: Point
    end: Point


Dimension = Circle | WidthDimension


def dimensions(laminate: Laminate, layer: Layer) -> list[Dimension]:
    """All that a drawing of a layer gives the size of, beside its overall width and height."""
    profile = layer.profile
    around = circumscribed(profile)
    widths = inlet_width(laminate, layer), piece_width(profile)
    return [
        *circles(laminate, layer),
        *radii(profile),
        *([around] if around is not None else []),
        *(width for width in widths if width is not None),
    ]


def balloons(laminate: Laminate) -> str:
    """How many balloons there are: 15 balloons, or 3 stacks of 1 balloon side by side."""
    high = f"{laminate.balloons} balloon{'s' if laminate.balloons > 1 else ''}"
    stacks = sum(len(chamber.centres) for chamber in laminate.chambers)
    on_sheet = any(layer.role == "sheet" for layer in laminate.layers)
    return f"{stacks} stacks of {high}" if on_sheet and stacks > 1 else high


def length(value: float) -> str:
    """Millimetres as drawings give them: 6.50."""
    return f"{value:.2f}"


def circles(laminate: Laminate, layer: Layer) -> list[Circle]:
    """The full circles of a profile, equal ones together, named after what they are.

    Not the outline of a single disc: its overall width says it.
    """
    groups: dict[tuple[str, float], list[Contour]] = {}
    for contour in layer.profile.contours:
        if contour.circle is not None and not is_disc(layer.profile, contour):
            name = _circle_name(laminate, layer, contour)
            groups.setdefault((name, round(contour.circle[1], 4)), []).append(contour)
    found = []
    for (name, radius), contours in groups.items():
        centre = max((c.circle[0] for c in contours if c.circle), key=lambda p: (p[0], p[1]))
        words = f"{name} ⌀{length(2 * radius)}".strip()
        found.append(Circle(_counted(len(contours), words), centre, radius))
    return found


def is_disc(profile: Region, outer: Contour) -> bool:
    """Whether a contour is the round outline of a profile of one piece."""
    return outer.circle is not None and profile.outers == (outer,)


def _circle_name(laminate: Laminate, layer: Layer, contour: Contour) -> str:
    assert contour.circle is not None
    centre = contour.circle[0]
    if not contour.is_hole:
        return ""
    if any(math.dist(centre, bore.centre) < SAME for bore in laminate.bores):
        return "neck ring" if layer.role == "separator-mask" else "bore"
    if laminate.lumen and math.hypot(*centre) < SAME:
        return "lumen"
    held = any(math.dist(centre, pin.centre) < SAME for pin in laminate.pins)
    tooling = "tail" if layer.role == "chamber-mask" else "ear"
    return tooling if held else ""


def radii(profile: Region) -> list[Circle]:
    """The arcs of edges that are not full circles, equal radii together, largest first."""
    groups: dict[float, list[Arc]] = {}
    for contour in profile.contours:
        if contour.circle is None:
            for edge in contour.edges:
                if isinstance(edge, Arc):
                    groups.setdefault(round(edge.radius, 3), []).append(edge)
    found = []
    for radius in sorted(groups, reverse=True)[:MOST_RADII]:
        arcs = groups[radius]
        pointed = max(arcs, key=lambda arc: round(arc.at(0.5)[0] + arc.at(0.5)[1], 6))
        words = _counted(len(_distinct(arc.centre for arc in arcs)), f"R{length(radius)}")
        found.append(Circle(words, pointed.centre, pointed.radius, pointed.at(0.5)))
    return found


def circumscribed(profile: Region) -> Circle | None:
    """The circle about the axis that a lobed profile fits, inlet tabs and strips aside."""
    axis = (0.0, 0.0)
    reaches: dict[Point, float] = {}
    for contour in profile.outers:
        for edge in contour.edges:
            if isinstance(edge, Arc) and edge.ccw and math.dist(edge.centre, axis) > SAME:
                centre = _rounded(edge.centre)
                reaches[centre] = math.dist(edge.centre, axis) + edge.radius
    if len(reaches) < 2 or max(reaches.values()) - min(reaches.values()) > SAME:
        return None
    radius = max(reaches.values())
    return Circle(f"fits ⌀{length(2 * radius)}", axis, radius, phantom=True)


def piece_width(profile: Region) -> WidthDimension | None:
    """The width of one of several equal pieces that are not discs (oblong chambers)."""
    boxes = [outer.bounds for outer in profile.outers]
    sizes = {(round(b[2] - b[0], 4), round(b[3] - b[1], 4)) for b in boxes}
    if len(boxes) < 2 or len(sizes) != 1 or profile.outers[0].circle is not None:
        return None
    low_x, low_y, high_x, high_y = max(boxes)
    y = low_y + 0.3 * (high_y - low_y)
    words = _counted(len(boxes), f"{length(high_x - low_x)} wide")
    return WidthDimension(words, (low_x, y), (high_x, y))


def inlet_width(laminate: Laminate, layer: Layer) -> WidthDimension | None:
    """The width of the inlet strip or tab, if any, at the inlet farthest right."""
    if layer.role == "separator-mask":
        return None
    found = [(inlet, span) for inlet in laminate.inlets if (span := _across(layer, inlet))]
    if not found:
        return None
    inlet, (start, end) = max(found, key=lambda item: (item[0].mouth[0], item[0].mouth[1]))
    name = "strip" if layer.is_mask else "tab"
    (x, y), (u, v) = _station(inlet), inlet.direction
    ends = sorted(((x - s * v, y + s * u) for s in (start, end)), key=lambda p: (p[1], p[0]))
    words = _counted(len(found), f"{name} {length(end - start)} wide")
    return WidthDimension(words, ends[0], ends[1])


def _across(layer: Layer, inlet: Inlet) -> tuple[float, float] | None:
    u, v = inlet.direction
    for start, end in section(layer.profile, _station(inlet), (-v, u)):
        if start < 0 < end:
            return start, end
    return None


def _station(inlet: Inlet) -> Point:
    """On the tab, clear of the fillets at its root."""
    (x, y), (u, v) = inlet.mouth, inlet.direction
    back = min(0.3 * inlet.length, 1.0)
    return x - back * u, y - back * v


def layer_numbers(indices: Sequence[int]) -> str:
    """Layer numbers with even steps shortened: ``3, 7, 11 ... 59``; ``2 to 5`` for neighbours."""
    runs: list[list[int]] = []
    for index in indices:
        run = runs[-1] if runs else []
        if len(run) == 1 or (len(run) > 1 and index - run[-1] == run[1] - run[0]):
            run.append(index)
        else:
            runs.append([index])
    return ", ".join(map(_run_words, runs))


def _run_words(run: list[int]) -> str:
    if len(run) < 4:
        return ", ".join(map(str, run))
    if run[1] - run[0] == 1:
        return f"{run[0]} to {run[-1]}"
    return f"{run[0]}, {run[1]}, {run[2]} … {run[-1]}"


def _counted(count: int, words: str) -> str:
    return words if count == 1 else f"{count}{TIMES} {words}"


def _distinct(points: Iterable[Point]) -> set[Point]:
    return {_rounded(p) for p in points}


def _rounded(p: Point) -> Point:
    return round(p[0], 3) + 0.0, round(p[1], 3) + 0.0
