"""Edges cut at their intersections, and the winding numbers on both sides of each piece."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Container, Iterable, Iterator, Sequence
from functools import cmp_to_key
from itertools import pairwise
from typing import NamedTuple

from sbafab.errors import InconsistentError
from sbafab.geometry.edges import (
    BENT,
    EPSILON,
    SAME,
    Arc,
    Bounds,
    Edge,
    Point,
    distance_to,
    from_end_to_end,
    left_normal,
    meeting_points,
    turns_round,
)
from sbafab.geometry.spatial_index import EdgeIndex, close_pairs, widened

ASLANT = 0.7548776662466927
"""Slope of a line on which few points of a drawing share a projection."""


class PointPool:
    """Clusters of points linked by steps shorter than ``same``, independent of their order.

    A cluster is represented by its first point (least x, then least y) among ``ends``, or among
    ``inner`` if it holds no end.
    """

    def __init__(
        self, ends: Iterable[Point], inner: Iterable[Point] = (), same: float = SAME
    ) -> None:
        self._ends = set(ends)
        points = self._ends.union(inner)
        self._leader = dict(zip(points, points, strict=True))
        reach = 1.01 * math.hypot(1, ASLANT) * same
        along = sorted([(p[0] + ASLANT * p[1], p) for p in points])
        for i, ((t, p), (following, _)) in enumerate(pairwise(along)):
            if following - t < reach:
                for u, q in along[i + 1 :]:
                    if u - t >= reach:
                        break
                    if math.dist(p, q) < same:
                        self._unite(self.snapped(p), self.snapped(q))

    def snapped(self, p: Point) -> Point:
        """Return the representative of a pooled point."""
        leader = self._leader[p]
        while leader != p:
            p, leader = leader, self._leader[leader]
        return leader

    def _unite(self, p: Point, q: Point) -> None:
        first, second = sorted((p, q), key=lambda point: (point not in self._ends, point))
        self._leader[second] = first


# Overlays: edges cut where they meet; coincident edges become one piece.


_Entry = tuple[float, int, Edge, int]
"""Offset of an edge's middle from its chord, the edge's number, the edge, its turns."""
DIGIT = 16
"""Bits per owner in the integer that packs the winding numbers of several owners."""
ROUNDS = 4
"""Maximum number of passes in which bent edges are cut again."""


class Piece(NamedTuple):
    """An edge that meets others only at its ends, with the winding number on its left minus that on
    its right.

    ``by_owner`` separates the digits of several owners.
    """

    edge: Edge
    turns: int


Overlay = tuple[list[Piece], bool]
"""Pieces, and True if some were bent and may therefore cross uncut."""


def overlaid(owners: Sequence[Iterable[Edge]], tolerance: float = EPSILON) -> Overlay:
    """Return the edges of all owners without duplicates, cut at their intersections.

    An edge that was bent to meet another is cut again, because it may now meet a third.
    """
    entries = [(edge, 1 << DIGIT * i) for i, edges in enumerate(owners) for edge in edges]
    return overlay(entries, tolerance)


def overlay(
    entries: Sequence[tuple[Edge, int]],
    tolerance: float = EPSILON,
    chain: Sequence[int] | None = None,
) -> Overlay:
    """Return edges, each with its number of turns, without duplicates, cut at their intersections.

    ``chain`` holds, for each edge, the number of its closed chain if that does not meet itself,
    otherwise a negative number.
    """
    bent = True
    for _ in range(ROUNDS):
        split, bent = split_edges([edge for edge, _ in entries], tolerance, chain)
        chain = None
        entries = [
            (part, entry[1]) for parts, entry in zip(split, entries, strict=True) for part in parts
        ]
        if not bent:
            break
    return _merged(entries, tolerance), bent


def by_owner(turns: int, owners: int) -> list[int]:
    """Return the winding number of each owner's edges from their combined number."""
    half = 1 << DIGIT - 1
    raised = turns + sum(half << DIGIT * i for i in range(owners))
    return [(raised >> DIGIT * i) % (2 * half) - half for i in range(owners)]


Split = tuple[list[list[Edge]], bool]
"""The parts of each edge, and True if one was bent to meet another."""


def split_edges(
    edges: Sequence[Edge], tolerance: float = EPSILON, chain: Sequence[int] | None = None
) -> Split:
    """Return each edge cut at its intersections; points closer than 2 ``tolerance`` are merged.

    The order of the edges does not change the cuts. Intersections of an arc are computed on its
    circle, so a previously bent arc is replaced by one through both ends.
    """
    whole, edges = edges, [from_end_to_end(edge) for edge in edges]
    cuts: list[list[Point]] = [[] for _ in edges]
    meeting: list[tuple[int, int]] = []
    bounds = [edge.bounds for edge in edges]
    for i, j in close_pairs(bounds, tolerance):
        if chain is not None and chain[i] == chain[j] >= 0:
            continue
        points = meeting_points(edges[i], edges[j], tolerance)
        if points:
            cuts[i] += points
            cuts[j] += points
            meeting.append((i, j))
    _share(edges, cuts, meeting, bounds, tolerance)
    ends = [p for edge in edges for p in (edge.start, edge.end)]
    pool = PointPool(ends, [p for points in cuts for p in points], 2 * tolerance)
    stops = [_stops(edge, points, pool) for edge, points in zip(edges, cuts, strict=True)]
    parts: list[list[Edge]] = []
    bent = False
    for edge, on_circle, (start, *inner, end) in zip(whole, edges, stops, strict=True):
        if not inner and start == edge.start and end == edge.end:
            parts.append([edge] if start != end else [])
            continue
        parts.append([edge.part(a, b) for a, b in pairwise([start, *inner, end]) if a != b])
        bent = bent or any(abs(on_circle.to_left(p)) > BENT for p in (start, *inner, end))
    return parts, bent


def _share(
    edges: Sequence[Edge],
    cuts: Sequence[list[Point]],
    meeting: Sequence[tuple[int, int]],
    bounds: Sequence[Bounds],
    tolerance: float,
) -> None:
    """Add the cuts of each edge to the edges that coincide with it, until there are no new ones."""
    partners: dict[int, list[int]] = defaultdict(list)
    for i, j in meeting:
        partners[i].append(j)
        partners[j].append(i)
    new = {i: points for i, points in enumerate(cuts) if points}
    # Edges of a grid of channels run along hundreds of others.
    points_on = {i: set(points) for i, points in new.items()}
    while new:
        shared: dict[int, list[Point]] = defaultdict(list)
        for i, points in new.items():
            for j in partners[i]:
                low_x, low_y, high_x, high_y = widened(bounds[j], tolerance)
                for p in points:
                    if not (low_x <= p[0] <= high_x and low_y <= p[1] <= high_y):
                        continue
                    if p not in points_on[j] and distance_to(edges[j], p) < tolerance:
                        points_on[j].add(p)
                        cuts[j].append(p)
                        shared[j].append(p)
        new = shared


def _stops(edge: Edge, points: Sequence[Point], pool: PointPool) -> list[Point]:
    """Return the points where the parts of an edge start and end, in its direction."""
    start, end = pool.snapped(edge.start), pool.snapped(edge.end)
    if not points:
        return [start, end]
    inner = dict.fromkeys(map(pool.snapped, points))
    inner.pop(start, None)
    inner.pop(end, None)
    if not inner:
        return [start, end]
    along = {stop: edge.parameter(stop) for stop in inner}
    within = [stop for stop, t in along.items() if 0 < t < 1]
    return [start, *sorted(within, key=along.__getitem__), end]


def _merged(edges: Iterable[tuple[Edge, int]], tolerance: float) -> list[Piece]:
    """Merge coincident cut edges; drop those with the same winding number on both sides."""
    between: dict[tuple[Point, Point], list[tuple[int, Edge, int]]] = defaultdict(list)
    for number, entry in enumerate(edges):
        edge, turns = entry
        a, b = edge.start, edge.end
        between[(a, b) if a < b else (b, a)].append((number, edge, turns))
    pieces: list[Piece] = []
    for ends, parallel in between.items():
        if len(parallel) == 1:
            _, edge, turns = parallel[0]
            pieces.append(Piece(edge, turns))
        else:
            a, b = ends
            entries = [
                (_offset(edge, a, b), number, edge, turns if edge.start == a else -turns)
                for number, edge, turns in parallel
            ]
            pieces += _united(entries, 4 * tolerance)
    return pieces


def _offset(edge: Edge, a: Point, b: Point) -> float:
    """Return the distance of an edge's middle to the left of the chord from ``a`` to ``b``, mm."""
    if not isinstance(edge, Arc):
        return 0.0
    x, y = edge.at(0.5)
    dx, dy = (b[0] - a[0], b[1] - a[1])
    return (dx * (y - a[1]) - dy * (x - a[0])) / math.hypot(dx, dy)


def _united(entries: list[_Entry], same: float) -> Iterator[Piece]:
    """Return one piece for each group of edges with common ends and nearly equal midpoints."""
    entries.sort()
    start = 0
    for stop in range(1, len(entries) + 1):
        if stop < len(entries) and entries[stop][0] - entries[stop - 1][0] < same:
            continue
        group, start = entries[start:stop], stop
        turns = sum(turns for *_, turns in group)
        if turns:
            edge = min(group, key=_plainest)[2]
            yield Piece(edge, turns if edge.start < edge.end else -turns)


def _plainest(entry: _Entry) -> tuple[float, Point, int]:
    """Return a sort key: lines first, then arcs by radius, so that the choice is independent of
    order.

    Among edges that differ only in direction, the first is chosen.
    """
    _, number, edge, _ = entry
    if isinstance(edge, Arc):
        return edge.radius, edge.centre, number
    return 0.0, (0.0, 0.0), number


# Winding numbers of closed chains laid over each other.
#
# The winding number beside one piece of each connected group is computed, then carried from face to
# face round common points. Two paths to one face must agree, so the result is consistent or an
# error.


NEAR = 0.05
"""Radians: edges that leave a point at a smaller angle are compared farther along."""


class _Leaving(NamedTuple):
    """A piece that leaves a point: its direction there, its chord, its curvature and its end."""

    half: int
    edge: Edge
    end: Point
    heading: float
    chord: float
    bend: float

    def to_left(self, p: Point) -> float:
        """Return the distance of ``p`` to the left of the piece's line or circle, mm."""
        distance = self.edge.to_left(p)
        return -distance if self.half & 1 else distance

    def towards(self, reach: float) -> float:
        """Return the angle from the point to the place on the piece at the distance ``reach``."""
        return self.heading + math.asin(max(-1.0, min(1.0, self.bend * reach / 2)))


def _leaving(half: int, edge: Edge) -> _Leaving:
    start, end = (edge.end, edge.start) if half & 1 else (edge.start, edge.end)
    x0, y0 = start
    x1, y1 = end
    chord = math.hypot(x1 - x0, y1 - y0)
    straight = math.atan2(y1 - y0, x1 - x0)
    if not isinstance(edge, Arc):
        return _Leaving(half, edge, end, straight, chord, 0.0)
    lean = (-edge.sweep if half & 1 else edge.sweep) / 2
    heading = math.remainder(straight - lean, math.tau)
    return _Leaving(half, edge, end, heading, chord, 2 * math.sin(lean) / chord)


class Arrangement:
    """Pieces with two halves each: 2 i along piece i, 2 i + 1 against it."""

    def __init__(self, overlay: Overlay) -> None:
        self.pieces, bent = overlay
        self._drawn = [from_end_to_end(edge) for edge, _ in self.pieces]
        self.origin = [p for edge, _ in self.pieces for p in (edge.start, edge.end)]
        rings: dict[Point, list[int]] = defaultdict(list)
        for half, p in enumerate(self.origin):
            rings[p].append(half)
        self._by_place: EdgeIndex | None = None
        self.tangled: set[Point] = set()
        """Points where pieces leave in nearly one direction, so that rounding could order them
        wrongly; all points if pieces were bent and may cross between their ends.
        """
        # Two halves need no sorting.
        self.rings = {
            p: self._in_order(halves) if len(halves) > 2 else halves for p, halves in rings.items()
        }
        """The halves that leave each point, counter-clockwise."""
        if bent:
            self.tangled.update(self.rings)
        self.left = self._wound()
        """Winding number of the chains to the left of each half."""
        if self.tangled:
            self._verify()

    def turns(self, half: int) -> int:
        turns = self.pieces[half >> 1].turns
        return -turns if half & 1 else turns

    def _in_order(self, halves: Sequence[int]) -> list[int]:
        """Return the halves that leave one point, counter-clockwise; the widest gap comes last."""
        leaving = sorted(
            (_leaving(half, self._drawn[half >> 1]) for half in halves),
            key=lambda piece: piece.heading,
        )
        count = len(leaving)
        gaps = [leaving[i].heading - leaving[i - 1].heading for i in range(count)]
        gaps[0] += math.tau
        first = max(range(count), key=gaps.__getitem__)
        leaving = [*leaving[first:], *leaving[:first]]
        gaps = [*gaps[first:], *gaps[:first]]
        ring: list[int] = []
        start = 0
        for stop in range(1, count + 1):
            if stop == count or gaps[stop] > NEAR:
                bundle = leaving[start:stop]
                if len(bundle) > 1:
                    bundle.sort(key=cmp_to_key(_by_side))
                    if count > 2:
                        self.tangled.add(self.origin[halves[0]])
                ring += [piece.half for piece in bundle]
                start = stop
        return ring

    @property
    def _index(self) -> EdgeIndex:
        if self._by_place is None:
            self._by_place = EdgeIndex(self._drawn)
        return self._by_place

    def _around(self, p: Point, winding: Sequence[int | None]) -> int:
        """Return the winding number around a point of the pieces with a number in ``winding``."""
        x, y = p
        return sum(
            self.pieces[number].turns * turns_round(self._drawn[number], p)
            for number in self._index.numbers((x, y, math.inf, y))
            if winding[2 * number] is not None
        )

    def _wound(self) -> list[int]:
        winding: list[int | None] = [None] * len(self.origin)
        low_x = [edge.bounds[0] for edge in self._drawn]
        has_group = False
        for number in sorted(range(len(low_x)), key=low_x.__getitem__):
            if winding[2 * number] is not None:
                continue
            # Nothing of this group lies farther left, and no other group that is still to come
            # reaches round it.
            half, p = self._leftmost(number, low_x[number])
            self._carry(half, self._around(p, winding) if has_group else 0, winding)
            has_group = True
        return [turns for turns in winding if turns is not None]

    def _verify(self) -> None:
        """Check the winding number beside one piece of each part connected by clear points.

        Raises InconsistentError if it differs from the propagated number.
        """
        visited: set[int] = set()
        for first in range(len(self.pieces)):
            if first in visited:
                continue
            part, waiting = [first], [first]
            visited.add(first)
            while waiting:
                number = waiting.pop()
                for p in self.origin[2 * number : 2 * number + 2]:
                    if p in self.tangled:
                        continue
                    more = {half >> 1 for half in self.rings[p]} - visited
                    visited |= more
                    part += more
                    waiting += more
            half = 2 * max(part, key=lambda number: self._drawn[number].length)
            beside = self._beside(half)
            if beside is not None and self._around(beside, self.left) != self.left[half]:
                raise InconsistentError(self._drawn[half >> 1].at(0.5))

    def _beside(self, half: int) -> Point | None:
        """A point to the left of a half, nearer to it than to any other half; None without room."""
        edge = self._drawn[half >> 1]
        x, y = edge.at(0.5)
        room = reach = edge.length / 16
        for number in self._index.numbers(widened((x, y, x, y), reach)):
            if number != half >> 1:
                room = min(room, distance_to(self._index.edges[number], (x, y)))
        if room < 16 * EPSILON:
            return None
        nx, ny = left_normal(edge, (x, y))
        return x + nx * room / 2, y + ny * room / 2

    def _leftmost(self, number: int, x: float) -> tuple[int, Point]:
        """Return a half with the plane outside its group on its left, and its leftmost point."""
        edge = self._drawn[number]
        p = min(edge.start, edge.end)
        # If an arc bulges by a rounding only, a piece at its end may lie farther left.
        if isinstance(edge, Arc) and x < p[0] - 2 * EPSILON:
            return 2 * number + int(edge.ccw), (x, edge.centre[1])
        # All leave to the right, so take the last of the steepest.
        halves = self.rings[p] if len(self.rings[p]) > 2 else self._in_order(self.rings[p])
        ring = [_leaving(half, self._drawn[half >> 1]) for half in halves]
        upward = max(leaving.heading for leaving in ring) - NEAR
        return [leaving.half for leaving in ring if leaving.heading > upward][-1], p

    def _carry(self, half: int, turns: int, winding: list[int | None]) -> None:
        """Propagate the winding numbers of a group from the number to the left of one half."""
        winding[half] = turns
        waiting = [half]
        done: set[Point] = set()
        while waiting:
            half = waiting.pop()
            here = self.origin[half]
            if here in done:
                continue
            done.add(here)
            ring = self.rings[here]
            place = ring.index(half)
            at = winding[half]
            assert at is not None
            for leaving in (*ring[place + 1 :], *ring[: place + 1]):
                back = leaving ^ 1
                if winding[back] is None:
                    winding[back] = at
                    waiting.append(back)
                elif winding[back] != at:
                    raise InconsistentError(here)
                at += self.turns(leaving)
                if winding[leaving] is None:
                    winding[leaving] = at
                elif winding[leaving] != at:
                    raise InconsistentError(here)

    def edging(self, inside: Container[int]) -> list[int]:
        """Return the halves that have a winding number of ``inside`` on their left only."""
        winding = self.left
        return [
            half
            for half, turns in enumerate(winding)
            if turns in inside and winding[half ^ 1] not in inside
        ]

    def loops(self, halves: Sequence[int]) -> Iterator[list[Edge]]:
        """Yield closed loops through all halves; loops that touch at a point stay separate."""
        free = dict.fromkeys(halves)
        for first in halves:
            if first not in free:
                continue
            del free[first]
            path, place = [first], {self.origin[first]: 0}
            while path:
                here = self.origin[path[-1] ^ 1]
                back = place.get(here)
                if back is not None:
                    yield [self.edge(half) for half in path[back:]]
                    for half in path[back:]:
                        del place[self.origin[half]]
                    del path[back:]
                    continue
                follower = self._leftmost_turn(path[-1], free)
                del free[follower]
                place[here] = len(path)
                path.append(follower)

    def edge(self, half: int) -> Edge:
        edge = self.pieces[half >> 1].edge
        return edge.reversed() if half & 1 else edge

    def _leftmost_turn(self, half: int, free: dict[int, None]) -> int:
        ring = self.rings[self.origin[half ^ 1]]
        place = ring.index(half ^ 1)
        for leaving in (*reversed(ring[:place]), *reversed(ring[place + 1 :])):
            if leaving in free:
                return leaving
        raise InconsistentError(self.origin[half ^ 1])


def _by_side(a: _Leaving, b: _Leaving) -> int:
    """Compare by side: negative if ``b`` runs to the left of ``a``.

    The shorter one ends clear of the other, otherwise it would have been cut there. If both end in
    one point they are compared at midway: the difference at the start and the distance at the end
    differ in sign only by rounding.
    """
    short, long = (a, b) if a.chord <= b.chord else (b, a)
    offset = long.to_left(short.end)
    if short.end != long.end and abs(offset) > EPSILON / 2:
        return 1 if (offset > 0) == (short is a) else -1
    reach = short.chord / 2
    apart = math.remainder(a.towards(reach) - b.towards(reach), math.tau)
    return (apart > 0) - (apart < 0)
