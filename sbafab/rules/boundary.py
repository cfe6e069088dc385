"""Edges of one region that run on another's boundary, and how far off the next edge lies."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Final, NamedTuple

from sbafab.geometry.apart import ChainGroup, chains_of, grouped
from sbafab.geometry.edges import EPSILON, Arc, Bounds, Edge, Line, Point, left_normal
from sbafab.geometry.intersect import line_circle
from sbafab.geometry.nearby import EdgeIndex, widened
from sbafab.geometry.pieces import DIGIT, Piece, by_owner, overlay
from sbafab.geometry.region import Region
from sbafab.geometry.remembered import remembered

END_ROOM: Final = 1e-5
"""mm left out at both ends of an edge: what starts at a corner does not lie beside the edge."""
LEANING: Final = 4e-3
"""mm from its ends, beside which an edge that leaves the corner along the normal may lean in: both
are read from files, whose coordinates are off by up to 1 um."""
STEEP: Final = 0.01
"""Sine of the angle to the normal up to which an edge runs along it."""

NEARER: Final = 1e-9
"""mm by which a place must be nearer than the nearest so far."""
ROUNDING: Final = 1e-12
"""mm: more than what heights are rounded by."""


@remembered
def edges_along(region: Region, other: Region) -> tuple[Edge, ...]:
    """The stretches of ``region``'s edges that run along edges of ``other``, the same way."""
    along = []
    own, others = ((c, 1) for c in region.contours), ((c, 1 << DIGIT) for c in other.contours)
    for group in grouped(chains_of([*own, *others])):
        for edge, turns in _pieces(group):
            one, two = by_owner(turns, 2)
            if one * two > 0:
                along.append(edge if one > 0 else edge.reversed())
    return tuple(along)


def _pieces(group: ChainGroup) -> Iterable[Piece]:
    """What the chains of a group are cut into."""
    if group.is_alone:
        return (Piece(edge, turns) for edge, turns in group.edges)
    return overlay(group.edges, EPSILON, group.clear).pieces


def beside(edge: Edge, distance: float) -> Point:
    """The point ``distance`` to the left of the edge's middle (right where negative)."""
    middle = edge.at(0.5)
    nx, ny = left_normal(edge, middle)
    return middle[0] + nx * distance, middle[1] + ny * distance


class Reach(NamedTuple):
    """Distance along an edge's right-hand normal to the first other edge, and where that is."""

    value: float
    at: Point


def outward_reach(edge: Edge, others: EdgeIndex) -> Reach | None:
    """The least distance from ``edge``, along its right-hand normal, to any of ``others``.

    Measured in the band that the edge sweeps along its normals; None if nothing lies in it.
    """
    if edge.length < END_ROOM:
        return None
    band = _line_band(edge) if isinstance(edge, Line) else _arc_band(edge)
    margin = 1.0
    while True:
        moved = edge.offset(margin)
        best = _nearest(band, _across(edge, moved, others.touching(_swept(edge, moved))))
        if best is not None and best.value <= margin:
            return best
        if others.all_within(widened(edge.bounds, margin)):
            return _nearest(band, others.edges)
        margin *= 4


def _swept(edge: Edge, moved: Edge | None) -> Bounds:
    """A box round what the edge sweeps when it moves along its right-hand normal.

    An arc that shrinks to nothing on its way sweeps what lies between it and its centre.
    """
    one = edge.bounds
    if moved is None:
        assert isinstance(edge, Arc)
        other = (*edge.centre, *edge.centre)
    else:
        other = moved.bounds
    low = min(one[0], other[0]), min(one[1], other[1])
    return widened((*low, max(one[2], other[2]), max(one[3], other[3])), END_ROOM)


def _across(edge: Edge, moved: Edge | None, others: Iterable[Edge]) -> Iterable[Edge]:
    """Those that may lie in the band beside an edge; all where it turns too far to tell quickly."""
    if moved is None or (isinstance(edge, Arc) and abs(edge.sweep) > 1.0):
        return others
    ux, uy = edge.direction(edge.at(0.5))
    ends = [ux * x + uy * y for x, y in (edge.start, edge.end, moved.start, moved.end)]
    low, high = min(ends) - END_ROOM, max(ends) + END_ROOM

    def may_lie_in(other: Edge) -> bool:
        x0, y0 = other.start
        x1, y1 = other.end
        one, two = ux * x0 + uy * y0, ux * x1 + uy * y1
        # An arc of at most half a turn reaches past its ends by half its chord at most.
        room = math.dist((x0, y0), (x1, y1)) / 2 if isinstance(other, Arc) else 0.0
        return max(one, two) >= low - room and min(one, two) <= high + room

    return (other for other in others if may_lie_in(other))


def _nearest(within: _Band, others: Iterable[Edge]) -> Reach | None:
    best: Reach | None = None
    nearer = math.inf
    for other in others:
        least, most = _heights(within.edge, other)
        if most < -EPSILON or least >= nearer:
            continue
        for p in within.nearest_candidates(other):
            height = within.height(p)
            if -EPSILON < height < nearer and within.holds(p) and not within.is_passed_by(other, p):
                best = Reach(max(0.0, height), p)
                nearer = best.value - NEARER
    return best


def _heights(edge: Edge, other: Edge) -> tuple[float, float]:
    """Between how far outward from ``edge``, or its line or circle, all of another edge lies."""
    if isinstance(edge, Arc):
        centre = edge.centre
        far = [math.dist(centre, other.start), math.dist(centre, other.end)]
        if isinstance(other, Arc):
            gap = math.dist(centre, other.centre)
            far += [abs(gap - other.radius), gap + other.radius]
        else:
            far.append(math.dist(centre, other.nearest(centre)))
        least, most = min(far) - edge.radius, max(far) - edge.radius
        if not edge.ccw:
            least, most = -most, -least
    else:
        heights = [-edge.to_left(other.start), -edge.to_left(other.end)]
        if isinstance(other, Arc):
            middle = -edge.to_left(other.centre)
            heights += [middle - other.radius, middle + other.radius]
        least, most = min(heights), max(heights)
    return least - ROUNDING, most + ROUNDING


class _Band(NamedTuple):
    """The band beside an edge: its two side rays, and the edge itself."""

    edge: Edge
    rays: tuple[tuple[Point, Point], tuple[Point, Point]]

    def holds(self, p: Point) -> bool:
        """Whether ``p`` lies in the band or behind the edge, and not beside it."""
        room = 0.5 * END_ROOM / self.edge.length
        return room <= self.edge.parameter(p) <= 1 - room

    def height(self, p: Point) -> float:
        """Distance of ``p`` from the edge along the normal."""
        edge = self.edge
        if isinstance(edge, Arc):
            outward = math.dist(p, edge.centre) - edge.radius
            return outward if edge.ccw else -outward
        nx, ny = left_normal(edge, p)
        return -((p[0] - edge.start[0]) * nx + (p[1] - edge.start[1]) * ny)

    def is_passed_by(self, other: Edge, p: Point) -> bool:
        """Whether ``other`` runs along the band's side at ``p``, and not across the band."""
        along = self.edge.parameter(p) * self.edge.length
        at_side = min(along, self.edge.length - along) < LEANING
        return at_side and _runs_along(other, p, left_normal(self.edge, p))

    def nearest_candidates(self, other: Edge) -> Iterator[Point]:
        """Points of ``other`` of which one is the nearest within the band."""
        yield other.start
        yield other.end
        yield from _extremes(self.edge, other)
        for origin, unit in self.rays:
            yield from _on_ray(origin, unit, other)


def _runs_along(edge: Edge, p: Point, normal: Point) -> bool:
    ux, uy = edge.direction(p)
    return abs(ux * normal[1] - uy * normal[0]) < STEEP


def _line_band(line: Line) -> _Band:
    ux, uy = line.direction(line.start)
    x0, y0 = line.start
    x1, y1 = line.end
    first = (x0 + ux * END_ROOM, y0 + uy * END_ROOM)
    last = (x1 - ux * END_ROOM, y1 - uy * END_ROOM)
    return _Band(line, ((first, (uy, -ux)), (last, (uy, -ux))))


def _arc_band(arc: Arc) -> _Band:
    room = END_ROOM / arc.length
    cx, cy = arc.centre
    first, last = (
        ((p[0] - cx) / arc.radius, (p[1] - cy) / arc.radius)
        for p in (arc.at(room), arc.at(1 - room))
    )
    return _Band(arc, ((arc.centre, first), (arc.centre, last)))


def _extremes(edge: Edge, other: Edge) -> Sequence[Point]:
    """Where ``other`` runs parallel to ``edge``: there its distance has a least value."""
    if isinstance(other, Line):
        if isinstance(edge, Line):
            return ()
        foot = other.nearest(edge.centre)
        return (foot,)
    if isinstance(edge, Line):
        nx, ny = left_normal(edge, edge.start)
    else:
        dx, dy = edge.centre[0] - other.centre[0], edge.centre[1] - other.centre[1]
        gap = math.hypot(dx, dy)
        if gap < EPSILON:
            return ()
        nx, ny = dx / gap, dy / gap
    cx, cy = other.centre
    r = other.radius
    feet = ((cx + r * nx, cy + r * ny), (cx - r * nx, cy - r * ny))
    return [foot for foot in feet if 0 <= other.parameter(foot) <= 1]


def _on_ray(origin: Point, unit: Point, edge: Edge) -> list[Point]:
    """Where the line through ``origin`` crosses the edge."""
    if isinstance(edge, Arc):
        found = line_circle(origin, unit, edge.centre, edge.radius)
    else:
        ux, uy = edge.direction(edge.start)
        cross = unit[0] * uy - unit[1] * ux
        if abs(cross) < 1e-12:
            return []
        x, y = edge.start
        ox, oy = origin
        t = ((x - ox) * uy - (y - oy) * ux) / cross
        found = [(ox + t * unit[0], oy + t * unit[1])]
    return [p for p in found if -1e-12 <= edge.parameter(p) <= 1 + 1e-12]
