"""Edges of one region that run on another's boundary, and how far off the next edge lies."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from typing import Final, NamedTuple

from sbafab.geometry.arrangement import DIGIT, Piece, by_owner, overlay
from sbafab.geometry.boolean import ChainGroup, chains_of, grouped
from sbafab.geometry.cache import cached
from sbafab.geometry.contour import Contour
from sbafab.geometry.edges import EPSILON, Arc, Bounds, Edge, Line, Point, left_normal, line_circle
from sbafab.geometry.nearby import EdgeIndex, widened
from sbafab.geometry.region import Region, disc, divided, union
from sbafab.laminate.laminate import LOOSE, Interface, Laminate, Layer
from sbafab.rules.limits import TOLERANCE

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


@cached
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


# Films that face each other past films that end between them: every pair, found in one sweep.
#
# Seen from above, a stack of films is a patchwork: at each place the highest film so far. A film
# laid on top faces the film just below it over most of its area, which is their interface, and
# lower ones where those in between have ended or are open.


class Facing(NamedTuple):
    """Two films with no film between them over some area outside pins' openings.

    ``gap`` holds both, the masks it takes to cover that area from above, and as its unbonded
    region what they cover; its index is that of the interface just below the upper film. ``bare``
    is what no mask covers.
    """

    gap: Interface
    bare: Region


class _Seen(NamedTuple):
    """The part of a film that no film covers yet, and outlines that it lies outside of."""

    film: Layer
    region: Region
    outlines: tuple[Contour, ...] = ()


def facing_films(laminate: Laminate) -> tuple[Facing, ...]:
    """Every pair of films, not next to each other, that face each other but in pins' openings.

    Lowest upper film first. Equal shapes are laid on each other once.
    """
    found: list[Facing] = []
    seen: list[_Seen] = []
    shapes = _Shapes(laminate)
    films = laminate.tpe_layers
    for index, film in enumerate(films):
        left: list[_Seen] = []
        for one in seen:
            below, region, outlines = one
            if below is films[index - 1]:
                rest = shapes.left_by_next(index, below, film)
                if rest.contours:
                    left.append(_Seen(below, rest, _outlines_of(film.profile, rest)))
                continue
            if _fits_in(film.profile, outlines):
                left.append(one)
                continue
            shared, rest = shapes.laid(region, film.profile)
            if rest.contours:
                left.append(_Seen(below, rest, _outlines_of(film.profile, rest)))
            if shared.contours:
                faced = shapes.kept_apart(shared, index, below, film)
                if faced is not None:
                    found.append(faced)
        seen = [*left, _Seen(film, film.profile)]
    return tuple(found)


def _outlines_of(film: Region, rest: Region) -> tuple[Contour, ...]:
    """The outlines of a film, if what it leaves of another lies outside them, and not in holes."""
    for hole in film.holes:
        left, low, right, high = widened(hole.bounds, TOLERANCE)
        for outer in rest.outers:
            box = outer.bounds
            if box[0] >= left and box[1] >= low and box[2] <= right and box[3] <= high:
                return ()
    return film.outers


def _fits_in(film: Region, outlines: tuple[Contour, ...]) -> bool:
    """Whether a film's outlines are among these."""
    return bool(outlines) and all(
        any(own is other or own.edges == other.edges for other in outlines) for own in film.outers
    )


class _Shapes:
    """Regions laid on each other, each pair of shapes once."""

    def __init__(self, laminate: Laminate) -> None:
        self.laminate = laminate
        self.openings = pin_openings(laminate)
        # Not methods of its own, or it would hold itself until rings are searched for.
        self.laid = cache(_laid)
        self.minus = cache(_minus)
        self.both = cache(Region.__and__)
        self.union = cache(_union)

    def left_by_next(self, index: int, below: Layer, above: Layer) -> Region:
        """What the film next to it leaves of a film; their contact is known."""
        if below.pattern == above.pattern:
            return Region()
        contact = without_slivers(self.laminate.interfaces[index - 1].contact)
        if not contact.contours:
            return below.profile
        # Interfaces have asked for it as well.
        return without_slivers(divided(below.profile, above.profile)[0])

    def kept_apart(self, region: Region, index: int, below: Layer, above: Layer) -> Facing | None:
        """Two films that face each other over a region; None where it is all pins' openings."""
        facing = bare = self.minus(region, self.openings)
        masks: dict[Region, Layer] = {}
        for layer in reversed(self.laminate.layers[below.index : above.index - 1]):
            if bare.is_empty:
                break
            if layer.is_mask and layer.profile not in masks:
                left = self.minus(bare, layer.profile)
                if left != bare:
                    masks[layer.profile] = layer
                bare = left
        if not masks and bare.is_empty:
            return None
        mask = self.union(tuple(masks))
        unbonded = self.minus(facing, bare) if bare.contours else facing
        contact = self.both(below.profile, above.profile)
        used = tuple(reversed(masks.values()))
        gap = Interface(index, "separator", below, above, used, mask, contact, Region(), unbonded)
        return Facing(gap, bare)


def _laid(seen: Region, film: Region) -> tuple[Region, Region]:
    """What a film covers of a region, and what it leaves."""
    rest, shared = map(without_slivers, divided(seen, film))
    return shared, rest if shared.contours else seen


def _minus(region: Region, other: Region) -> Region:
    return without_slivers(region - other)


def _union(regions: tuple[Region, ...]) -> Region:
    return union(regions)


def pin_openings(laminate: Laminate) -> Region:
    """Where bores, lumen and tooling holes are open, as wide as holes that are still a pin's."""
    places = [(bore.centre, bore.diameter) for bore in laminate.bores]
    places += [(pin.centre, pin.hole) for pin in laminate.pins]
    if laminate.lumen is not None:
        places.append(((0.0, 0.0), laminate.lumen))
    return union(disc(centre, (width + LOOSE) / 2) for centre, width in dict.fromkeys(places))


def without_slivers(region: Region) -> Region:
    """The region without pieces that are on average no wider than TOLERANCE."""
    if region.is_empty:
        return region
    pieces = [piece for piece in region.pieces if _is_wide(piece)]
    if len(pieces) == len(region.outers):
        return region
    return Region(tuple(contour for piece in pieces for contour in piece.contours))


def _is_wide(piece: Region) -> bool:
    return 2 * piece.area > TOLERANCE * sum([contour.length for contour in piece.contours], 0.0)
