"""Adjacent edges of regions: shared stretches, distance to the next edge, and films that face each
other.

This includes pairs of films that face each other beyond films that end between them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Final, NamedTuple

from sbafab.geometry.arrangement import DIGIT, Piece, by_owner, overlay
from sbafab.geometry.boolean import chains_of, grouped
from sbafab.geometry.cache import cached
from sbafab.geometry.edges import EPSILON, Arc, Bounds, Edge, Line, Point, left_normal, line_circle
from sbafab.geometry.region import Region, disc, union
from sbafab.geometry.spatial_index import EdgeIndex, widened
from sbafab.laminate.laminate import LOOSE, Interface, Laminate, Layer
from sbafab.rules.limits import TOLERANCE

END_ROOM: Final = 1e-5
"""mm skipped at both ends of an edge: a feature that starts at a corner is not beside the edge."""
LEANING: Final = 4e-3
"""mm from its ends, beside which an edge that leaves the corner along the normal may lean in: both
are read from files, whose coordinates are off by up to 1 um."""
STEEP: Final = 0.01
"""Sine of the angle to the normal up to which an edge runs along it."""

NEARER: Final = 1e-9
"""mm by which a place must be nearer than the nearest so far."""


@cached
def edges_along(region: Region, boundary: Region) -> tuple[Edge, ...]:
    """Return the stretches of ``region``'s edges on ``boundary``'s edges, in the same direction."""
    along = []
    contours, boundary_contours = (
        ((c, 1) for c in region.contours),
        ((c, 1 << DIGIT) for c in boundary.contours),
    )
    for group in grouped(chains_of([*contours, *boundary_contours])):
        pieces = [Piece(edge, turns) for edge, turns in group.edges]
        if not group.is_alone:
            pieces, _ = overlay(group.edges, EPSILON, group.clear)
        for edge, turns in pieces:
            turn, boundary_turn = by_owner(turns, 2)
            if turn * boundary_turn > 0:
                along.append(edge if turn > 0 else edge.reversed())
    return tuple(along)


def beside(edge: Edge, distance: float) -> Point:
    """Return the point ``distance`` to the left of the edge's midpoint (right if negative)."""
    middle = edge.at(0.5)
    nx, ny = left_normal(edge, middle)
    return middle[0] + nx * distance, middle[1] + ny * distance


def middle(region: Region) -> Point:
    """Return the centre of the bounding box of a region."""
    low_x, low_y, high_x, high_y = region.bounds
    return (low_x + high_x) / 2, (low_y + high_y) / 2


class Reach(NamedTuple):
    """Distance along an edge's right-hand normal to the nearest other edge, and the point there."""

    value: float
    at: Point


def outward_reach(edge: Edge, targets: EdgeIndex) -> Reach | None:
    """Return the least distance from ``edge``, along its right-hand normal, to any of ``targets``.

    The search covers the band that the edge sweeps along its normals; None if the band is empty.
    """
    if edge.length < END_ROOM:
        return None
    band = _Band.of(edge)
    margin = 1.0
    while True:
        moved = edge.offset(margin)
        best = _nearest(band, _across(edge, moved, targets.touching(_swept(edge, moved))))
        if best is not None and best.value <= margin:
            return best
        if targets.all_within(widened(edge.bounds, margin)):
            return _nearest(band, targets.edges)
        margin *= 4


def _swept(edge: Edge, moved: Edge | None) -> Bounds:
    """Return a box around the area that the edge sweeps along its right-hand normal.

    An arc that shrinks to a point sweeps the area between it and its centre.
    """
    box = edge.bounds
    if moved is None:
        assert isinstance(edge, Arc)
        moved_box = (*edge.centre, *edge.centre)
    else:
        moved_box = moved.bounds
    low = min(box[0], moved_box[0]), min(box[1], moved_box[1])
    return widened((*low, max(box[2], moved_box[2]), max(box[3], moved_box[3])), END_ROOM)


def _across(edge: Edge, moved: Edge | None, targets: Iterable[Edge]) -> Iterable[Edge]:
    """Return the targets that may lie in the band beside an edge; all targets for a large arc."""
    if moved is None or (isinstance(edge, Arc) and abs(edge.sweep) > 1.0):
        return targets
    ux, uy = edge.direction(edge.at(0.5))
    ends = [ux * x + uy * y for x, y in (edge.start, edge.end, moved.start, moved.end)]
    low, high = min(ends) - END_ROOM, max(ends) + END_ROOM

    def may_lie_in(target: Edge) -> bool:
        x0, y0 = target.start
        x1, y1 = target.end
        start, end = ux * x0 + uy * y0, ux * x1 + uy * y1
        # An arc of at most half a turn reaches past its ends by half its chord at most.
        room = math.dist((x0, y0), (x1, y1)) / 2 if isinstance(target, Arc) else 0.0
        return max(start, end) >= low - room and min(start, end) <= high + room

    return (target for target in targets if may_lie_in(target))


def _nearest(within: _Band, targets: Iterable[Edge]) -> Reach | None:
    best: Reach | None = None
    nearer = math.inf
    for target in targets:
        for p in within.nearest_candidates(target):
            height = within.height(p)
            if (
                -EPSILON < height < nearer
                and within.holds(p)
                and not within.is_passed_by(target, p)
            ):
                best = Reach(max(0.0, height), p)
                nearer = best.value - NEARER
    return best


class _Band(NamedTuple):
    """The band beside an edge: its two side rays, and the edge itself."""

    edge: Edge
    rays: tuple[tuple[Point, Point], ...]

    @staticmethod
    def of(edge: Edge) -> _Band:
        room = END_ROOM / edge.length
        ends = edge.at(room), edge.at(1 - room)
        if isinstance(edge, Line):
            ux, uy = edge.direction(edge.start)
            return _Band(edge, tuple((p, (uy, -ux)) for p in ends))
        (cx, cy), r = edge.centre, edge.radius
        return _Band(edge, tuple((edge.centre, ((x - cx) / r, (y - cy) / r)) for x, y in ends))

    def holds(self, p: Point) -> bool:
        """Return True if ``p`` lies in the band or behind the edge, but not to one side."""
        room = 0.5 * END_ROOM / self.edge.length
        return room <= self.edge.parameter(p) <= 1 - room

    def height(self, p: Point) -> float:
        """Return the distance of ``p`` from the edge along the normal."""
        edge = self.edge
        if isinstance(edge, Arc):
            outward = math.dist(p, edge.centre) - edge.radius
            return outward if edge.ccw else -outward
        nx, ny = left_normal(edge, p)
        return -((p[0] - edge.start[0]) * nx + (p[1] - edge.start[1]) * ny)

    def is_passed_by(self, target: Edge, p: Point) -> bool:
        """Return True if ``target`` runs along the band's side at ``p`` without crossing it."""
        along = self.edge.parameter(p) * self.edge.length
        at_side = min(along, self.edge.length - along) < LEANING
        (ux, uy), (nx, ny) = target.direction(p), left_normal(self.edge, p)
        return at_side and abs(ux * ny - uy * nx) < STEEP

    def nearest_candidates(self, target: Edge) -> Iterator[Point]:
        """Return candidate points of ``other``, among them the nearest point within the band."""
        yield target.start
        yield target.end
        yield from _extremes(self.edge, target)
        for origin, unit in self.rays:
            yield from _on_ray(origin, unit, target)


def _extremes(edge: Edge, target: Edge) -> Sequence[Point]:
    """Return the points of ``target`` at which it is parallel to ``edge``: extremes of distance."""
    if isinstance(target, Line):
        if isinstance(edge, Line):
            return ()
        foot = target.nearest(edge.centre)
        return (foot,)
    if isinstance(edge, Line):
        nx, ny = left_normal(edge, edge.start)
    else:
        dx, dy = edge.centre[0] - target.centre[0], edge.centre[1] - target.centre[1]
        gap = math.hypot(dx, dy)
        if gap < EPSILON:
            return ()
        nx, ny = dx / gap, dy / gap
    cx, cy = target.centre
    r = target.radius
    feet = ((cx + r * nx, cy + r * ny), (cx - r * nx, cy - r * ny))
    return [foot for foot in feet if 0 <= target.parameter(foot) <= 1]


def _on_ray(origin: Point, unit: Point, edge: Edge) -> list[Point]:
    """Return the points at which the line through ``origin`` crosses the edge."""
    if isinstance(edge, Arc):
        points = line_circle(origin, unit, edge.centre, edge.radius)
    else:
        ux, uy = edge.direction(edge.start)
        cross = unit[0] * uy - unit[1] * ux
        if abs(cross) < 1e-12:
            return []
        x, y = edge.start
        ox, oy = origin
        t = ((x - ox) * uy - (y - oy) * ux) / cross
        points = [(ox + t * unit[0], oy + t * unit[1])]
    return [p for p in points if -1e-12 <= edge.parameter(p) <= 1 + 1e-12]


# Films that face each other past films that end between them, found in one sweep.
#
# Seen from above, a stack of films is a patchwork of the highest film at each place. A film laid on
# top faces the film just below over most of its area, which is their interface, and lower films
# where those between have ended or are open.


class Facing(NamedTuple):
    """Two films with no film between them over some area outside the pin openings.

    ``gap`` holds both films, the masks that cover that area from above, and the covered area as its
    unbonded region; its index is that of the interface just below the upper film. ``bare`` is the
    area that no mask covers.
    """

    gap: Interface
    bare: Region


def facing_films(laminate: Laminate) -> tuple[Facing, ...]:
    """Return every pair of non-adjacent films that face each other outside the pin openings.

    The lowest upper film comes first. Equal shapes are overlaid once.
    """
    pairs: list[Facing] = []
    visible: list[tuple[Layer, Region]] = []
    """The parts of films that no film covers yet."""
    openings, films = pin_openings(laminate), laminate.tpe_layers
    for index, film in enumerate(films):
        remaining: list[tuple[Layer, Region]] = []
        for below, region in visible:
            if below is films[index - 1]:
                gap, shared, rest = laminate.interfaces[index - 1], Region(), below.profile
                if below.pattern == film.pattern:
                    rest = shared
                elif not without_slivers(gap.contact).is_empty:
                    rest = _minus(rest, film.profile)
            else:
                shared, rest = _laid(region, film.profile)
            if rest.contours:
                remaining.append((below, rest))
            if shared.contours:
                between = laminate.layers[below.index : film.index - 1]
                facing = _minus(shared, openings)
                pairs += _kept_apart(facing, index, below, between, film)
        visible = [*remaining, (film, film.profile)]
    return tuple(pairs)


def _kept_apart(
    facing: Region, index: int, below: Layer, between: Sequence[Layer], above: Layer
) -> Iterator[Facing]:
    """Yield two films that face each other over a region, unless pin openings fill it."""
    bare = facing
    masks: dict[Region, Layer] = {}
    for layer in reversed(between):
        if layer.is_mask and not bare.is_empty and layer.profile not in masks:
            uncovered = _minus(bare, layer.profile)
            if uncovered != bare:
                masks[layer.profile] = layer
            bare = uncovered
    if masks or not bare.is_empty:
        unbonded = _minus(facing, bare) if bare.contours else facing
        mask, contact = union(masks), below.profile & above.profile
        used = tuple(reversed(masks.values()))
        gap = Interface(index, "separator", below, above, used, mask, contact, Region(), unbonded)
        yield Facing(gap, bare)


@cached
def _laid(region: Region, film: Region) -> tuple[Region, Region]:
    """Return the part of a region that a film covers, and the rest."""
    rest, shared = without_slivers(region - film), without_slivers(region & film)
    return shared, rest if shared.contours else region


@cached
def _minus(region: Region, cut: Region) -> Region:
    return without_slivers(region - cut)


def pin_openings(laminate: Laminate) -> Region:
    """Return the openings of bores, lumen and tooling holes, as wide as their pins allow.

    If the design has nets, no pin stands in a bore.
    """
    bores = laminate.bores if not laminate.nets else ()
    places = [(bore.centre, bore.diameter) for bore in bores]
    places += [(pin.centre, pin.hole) for pin in laminate.pins]
    if laminate.lumen is not None:
        places.append(((0.0, 0.0), laminate.lumen))
    return union(disc(centre, (width + LOOSE) / 2) for centre, width in dict.fromkeys(places))


def without_slivers(region: Region) -> Region:
    """Return the region without pieces whose mean width is at most TOLERANCE."""
    if region.is_empty:
        return region
    pieces = [
        piece
        for piece in region.pieces
        if 2 * piece.area > TOLERANCE * sum([contour.length for contour in piece.contours], 0.0)
    ]
    if len(pieces) == len(region.outers):
        return region
    return Region(tuple(contour for piece in pieces for contour in piece.contours))
