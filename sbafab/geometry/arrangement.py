"""Closed chains of edges laid over each other: where they meet, and how often they wind round what.

Every edge is cut where it meets another, and pieces that coincide become one. How often the chains
wind round the faces on both sides of a piece is told once for each connected group of pieces and
then carried round their common points, from face to face: wherever two ways lead to a face they
must agree, so what comes out is consistent or it is not returned.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property, cmp_to_key
from itertools import pairwise
from typing import NamedTuple

from sbafab.geometry.edges import EPSILON, Arc, Edge, Point, distance_to, left_normal
from sbafab.geometry.intersect import meeting_points
from sbafab.geometry.nearby import EdgeIndex, close_pairs, widened
from sbafab.geometry.pool import PointPool
from sbafab.geometry.region import turns_round

NEAR = 0.05
"""Radians: edges that leave a point at less than this angle are compared farther on."""


class InconsistentError(ArithmeticError):
    """Two ways to a face do not agree; the argument is the point where they meet."""


class Piece(NamedTuple):
    """An edge that meets others at its ends only; the chains wind ``turns`` times more on its left
    than on its right.
    """

    edge: Edge
    turns: int


def split_edges(edges: Sequence[Edge], tolerance: float = EPSILON) -> list[list[Edge]]:
    """Each edge cut where it meets another; points nearer than 2 ``tolerance`` become one.

    The order of the edges has no part in where they are cut.
    """
    cuts: list[list[Point]] = [[] for _ in edges]
    meeting: list[tuple[int, int]] = []
    for i, j in close_pairs([edge.bounds for edge in edges], tolerance):
        points = meeting_points(edges[i], edges[j], tolerance)
        if points:
            cuts[i] += points
            cuts[j] += points
            meeting.append((i, j))
    _share(edges, cuts, meeting, tolerance)
    ends = [p for edge in edges for p in (edge.start, edge.end)]
    pool = PointPool(ends, [p for points in cuts for p in points], 2 * tolerance)
    return [_cut(edge, points, pool) for edge, points in zip(edges, cuts, strict=True)]


def _share(
    edges: Sequence[Edge],
    cuts: Sequence[list[Point]],
    meeting: Sequence[tuple[int, int]],
    tolerance: float,
) -> None:
    """Cuts edges that run along each other at the same points, those with a third edge too."""
    partners: dict[int, list[int]] = defaultdict(list)
    for i, j in meeting:
        partners[i].append(j)
        partners[j].append(i)
    new = {i: points for i, points in enumerate(cuts) if points}
    while new:
        found: dict[int, list[Point]] = defaultdict(list)
        for i, points in new.items():
            for j in partners[i]:
                low_x, low_y, high_x, high_y = widened(edges[j].bounds, tolerance)
                for p in points:
                    if not (low_x <= p[0] <= high_x and low_y <= p[1] <= high_y):
                        continue
                    if p not in cuts[j] and distance_to(edges[j], p) < tolerance:
                        cuts[j].append(p)
                        found[j].append(p)
        new = found


def _cut(edge: Edge, points: Sequence[Point], pool: PointPool) -> list[Edge]:
    start, end = pool.snapped(edge.start), pool.snapped(edge.end)
    if not points:
        return [edge.part(start, end)] if start != end else []
    along = {stop: edge.parameter(stop) for stop in map(pool.snapped, points)}
    inner = [stop for stop, t in along.items() if stop not in (start, end) and 0 < t < 1]
    corners = [start, *sorted(inner, key=along.__getitem__), end]
    return [edge.part(a, b) for a, b in pairwise(corners) if a != b]


def merged(edges: Iterable[Edge], tolerance: float = EPSILON) -> list[Piece]:
    """Cut edges, those that coincide as one; none where the chains wind alike on both sides."""
    between: dict[tuple[Point, Point], list[tuple[float, Edge, int]]] = defaultdict(list)
    for edge in edges:
        forward = edge.start < edge.end
        a, b = (edge.start, edge.end) if forward else (edge.end, edge.start)
        between[a, b].append((_offset(edge, a, b), edge, 1 if forward else -1))
    return [piece for entries in between.values() for piece in _united(entries, 4 * tolerance)]


def _offset(edge: Edge, a: Point, b: Point) -> float:
    """How far the middle of an edge lies to the left of the chord from ``a`` to ``b``."""
    if not isinstance(edge, Arc):
        return 0.0
    (x, y), (dx, dy) = edge.at(0.5), (b[0] - a[0], b[1] - a[1])
    return (dx * (y - a[1]) - dy * (x - a[0])) / math.hypot(dx, dy)


def _united(entries: list[tuple[float, Edge, int]], same: float) -> Iterator[Piece]:
    """One piece for each group of edges with common ends whose middles are near each other."""
    if len(entries) > 1:
        entries.sort(key=lambda entry: entry[0])
    group: list[tuple[float, Edge, int]] = []
    for entry in entries:
        if group and entry[0] - group[-1][0] >= same:
            yield from _one_of(group)
            group = []
        group.append(entry)
    yield from _one_of(group)


def _one_of(group: Sequence[tuple[float, Edge, int]]) -> Iterator[Piece]:
    turns = sum(way for _, _, way in group)
    if turns:
        _, edge, way = min(group, key=_plainest) if len(group) > 1 else group[0]
        yield Piece(edge, turns * way)


def _plainest(entry: tuple[float, Edge, int]) -> tuple[float, Point]:
    """Lines first, then arcs by radius: the same choice in any order, and along a whole circle."""
    edge = entry[1]
    return (edge.radius, edge.centre) if isinstance(edge, Arc) else (0.0, (0.0, 0.0))


class _Leaving(NamedTuple):
    """A piece as it leaves a point: its direction there, its chord, how it bends, where it ends."""

    half: int
    edge: Edge
    heading: float
    chord: float
    bend: float

    @property
    def end(self) -> Point:
        return self.edge.start if self.half & 1 else self.edge.end

    def to_left(self, p: Point) -> float:
        """How far ``p`` lies to the left of the line or circle the piece is a part of."""
        if isinstance(self.edge, Arc):
            inside = self.edge.radius - math.dist(p, self.edge.centre)
            left = inside if self.edge.ccw else -inside
        else:
            (x, y), (ux, uy) = self.edge.start, self.edge.direction(self.edge.start)
            left = ux * (p[1] - y) - uy * (p[0] - x)
        return -left if self.half & 1 else left

    def towards(self, reach: float) -> float:
        """Angle from the point to where the piece is ``reach`` away."""
        return self.heading + math.asin(max(-1.0, min(1.0, self.bend * reach / 2)))


def _leaving(half: int, edge: Edge) -> _Leaving:
    (x0, y0), (x1, y1) = (edge.end, edge.start) if half & 1 else (edge.start, edge.end)
    chord = math.hypot(x1 - x0, y1 - y0)
    straight = math.atan2(y1 - y0, x1 - x0)
    if not isinstance(edge, Arc):
        return _Leaving(half, edge, straight, chord, 0.0)
    lean = (-edge.sweep if half & 1 else edge.sweep) / 2
    heading = math.remainder(straight - lean, math.tau)
    return _Leaving(half, edge, heading, chord, 2 * math.sin(lean) / chord)


class Arrangement:
    """Pieces, each of them two halves: 2 i along piece i, 2 i + 1 against it."""

    def __init__(self, pieces: Sequence[Piece]) -> None:
        self.pieces = pieces
        self.origin = [p for edge, _ in pieces for p in (edge.start, edge.end)]
        rings: dict[Point, list[int]] = defaultdict(list)
        for half, p in enumerate(self.origin):
            rings[p].append(half)
        self.tangled: set[Point] = set()
        """Where pieces leave in nearly one direction, so that rounding could order them wrongly."""
        self.rings = {p: self._in_order(halves) for p, halves in rings.items()}
        """The halves that leave each point, counter-clockwise; the widest gap comes last."""
        self.left = self._wound()
        """How often the chains wind round what is to the left of each half."""
        if self.tangled:
            self._verify()

    def turns(self, half: int) -> int:
        turns = self.pieces[half >> 1].turns
        return -turns if half & 1 else turns

    def _in_order(self, halves: list[int]) -> list[int]:
        found = sorted(
            (_leaving(half, self.pieces[half >> 1].edge) for half in halves),
            key=lambda leaving: leaving.heading,
        )
        count = len(found)
        gaps = [found[i].heading - found[i - 1].heading for i in range(count)]
        gaps[0] += math.tau
        first = max(range(count), key=gaps.__getitem__)
        found = [*found[first:], *found[:first]]
        gaps = [*gaps[first:], *gaps[:first]]
        ring: list[int] = []
        start = 0
        for stop in range(1, count + 1):
            if stop == count or gaps[stop] > NEAR:
                bundle = found[start:stop]
                if len(bundle) > 1:
                    bundle.sort(key=cmp_to_key(_by_side))
                    if count > 2:
                        self.tangled.add(self.origin[halves[0]])
                ring += [leaving.half for leaving in bundle]
                start = stop
        return ring

    @cached_property
    def _index(self) -> EdgeIndex:
        return EdgeIndex([edge for edge, _ in self.pieces])

    def _around(self, p: Point, left: Sequence[int | None]) -> int:
        """How often the pieces that are told in ``left`` wind round a point."""
        x, y = p
        return sum(
            self.pieces[number].turns * turns_round(self.pieces[number].edge, p)
            for number in self._index.numbers((x, y, self._index.right, y))
            if left[2 * number] is not None
        )

    def _wound(self) -> list[int | None]:
        left: list[int | None] = [None] * len(self.origin)
        edges = [edge.bounds[0] for edge, _ in self.pieces]
        told = False
        for number in sorted(range(len(edges)), key=edges.__getitem__):
            if left[2 * number] is not None:
                continue
            # Nothing of this group lies farther left, and no other group that is still to come
            # reaches round it.
            half, p = self._leftmost(number, edges[number])
            self._carry(half, self._around(p, left) if told else 0, left)
            told = True
        return left

    def _verify(self) -> None:
        """Asks beside one piece of every part that hangs together by points that leave no doubt.

        Raises InconsistentError where what was carried there is not what winds round that place.
        """
        seen: set[int] = set()
        for first in range(len(self.pieces)):
            if first in seen:
                continue
            part, waiting = [first], [first]
            seen.add(first)
            while waiting:
                number = waiting.pop()
                for p in self.origin[2 * number : 2 * number + 2]:
                    if p in self.tangled:
                        continue
                    more = {half >> 1 for half in self.rings[p]} - seen
                    seen |= more
                    part += more
                    waiting += more
            half = 2 * max(part, key=lambda number: self.pieces[number].edge.length)
            beside = self._beside(half)
            if beside is not None and self._around(beside, self.left) != self.left[half]:
                raise InconsistentError(self.pieces[half >> 1].edge.at(0.5))

    def _beside(self, half: int) -> Point | None:
        """A point to the left of a half, nearer to it than to any other; None if there is hardly
        room.
        """
        edge = self.pieces[half >> 1].edge
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
        """A half with the plane outside its group on its left, and its leftmost point."""
        edge = self.pieces[number].edge
        p = min(edge.start, edge.end)
        if isinstance(edge, Arc) and x < p[0]:
            return 2 * number + int(edge.ccw), (x, edge.centre[1])
        # All leave to the right of it, so the last of those that leave upwards most.
        ring = [_leaving(half, self.pieces[half >> 1].edge) for half in self.rings[p]]
        upward = max(leaving.heading for leaving in ring) - NEAR
        return [leaving.half for leaving in ring if leaving.heading > upward][-1], p

    def _carry(self, half: int, turns: int, left: list[int | None]) -> None:
        """Tells all of a group how often the chains wind, from what is left of one half."""
        left[half] = turns
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
            at = left[half]
            assert at is not None
            for other in (*ring[place + 1 :], *ring[: place + 1]):
                back = other ^ 1
                if left[back] is None:
                    left[back] = at
                    waiting.append(back)
                elif left[back] != at:
                    raise InconsistentError(here)
                at += self.turns(other)
                if left[other] is None:
                    left[other] = at
                elif left[other] != at:
                    raise InconsistentError(here)

    def borders(self, above: int) -> list[int]:
        """The halves on whose left alone the chains wind more than ``above`` times."""
        return [
            half
            for half, turns in enumerate(self.left)
            if turns is not None and turns > above >= turns - self.turns(half)
        ]

    def loops(self, halves: Sequence[int]) -> Iterator[list[Edge]]:
        """Closed loops through all of the borders; those that touch at a point stay apart."""
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
        for other in (*reversed(ring[:place]), *reversed(ring[place + 1 :])):
            if other in free:
                return other
        raise InconsistentError(self.origin[half ^ 1])


def _by_side(a: _Leaving, b: _Leaving) -> int:
    """Negative where ``b`` runs to the left of ``a``.

    Where the shorter ends it is clear of the other, or it would have been cut there. Where both
    end in one point they are compared half way: there neither what they part by at the start nor
    what they are apart by at the end has the other sign but by rounding.
    """
    short, other = (a, b) if a.chord <= b.chord else (b, a)
    left = other.to_left(short.end)
    if short.end != other.end and abs(left) > EPSILON / 2:
        return 1 if (left > 0) == (short is a) else -1
    reach = short.chord / 2
    apart = math.remainder(a.towards(reach) - b.towards(reach), math.tau)
    return (apart > 0) - (apart < 0)
