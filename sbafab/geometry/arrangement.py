"""Points that lie too near each other to be told apart, made one."""

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
    turns_round,
)
from sbafab.geometry.intersect import meeting_points
from sbafab.geometry.nearby import EdgeIndex, close_pairs, widened

CELLS = 16
"""Cells of the grid are so many times as wide as points are pooled: most points touch one only."""


ASLANT = 0.7548776662466927
"""Slope of a line along which points of drawings hardly ever lie side by side."""


class PointPool:
    """One point for all that hang together by steps shorter than ``same``, in any order.

    A group is called after its first point (least x, then least y) among ``ends``; after its first
    among ``others`` where it holds no end.
    """

    def __init__(
        self, ends: Iterable[Point], others: Iterable[Point] = (), same: float = SAME
    ) -> None:
        self._same = same
        self._rank: dict[Point, int] = {}
        self._cells: dict[tuple[int, int], list[Point]] = {}
        first = set(ends)
        rest = set(others) - first
        every = [*first, *rest]
        near = self._maybe_near(every)
        self._leader = dict(zip(every, every, strict=True))
        if not near:
            return
        for p in (*sorted(first & near), *sorted(rest & near)):
            self._add(p)

    def _maybe_near(self, points: Sequence[Point]) -> set[Point]:
        """Those that may lie nearer to another than is told apart, and some more.

        They are told by how far they lie along a line at an angle that drawings hardly have.
        """
        reach = 1.01 * math.hypot(1, ASLANT) * self._same
        near: set[Point] = set()
        along = [p[0] + ASLANT * p[1] for p in points]
        # Mostly there is none.
        if all(u - t >= reach for t, u in pairwise(sorted(along))):
            return near
        for one, other in pairwise(sorted(zip(along, points, strict=True))):
            if other[0] - one[0] < reach:
                near.add(one[1])
                near.add(other[1])
        return near

    def snapped(self, p: Point) -> Point:
        """The point that stands for ``p``, one of those that were pooled."""
        leader = self._leader[p]
        while leader != p:
            p, leader = leader, self._leader[leader]
        return leader

    def _add(self, p: Point) -> None:
        self._rank[p] = len(self._rank)
        self._leader[p] = p
        width, margin = CELLS * self._same, 1.01 / CELLS
        u, v = p[0] / width, p[1] / width
        for column in range(math.floor(u - margin), math.floor(u + margin) + 1):
            for row in range(math.floor(v - margin), math.floor(v + margin) + 1):
                for q in self._cells.get((column, row), ()):
                    if math.dist(p, q) < self._same:
                        self._unite(self.snapped(p), self.snapped(q))
        self._cells.setdefault((math.floor(u), math.floor(v)), []).append(p)

    def _unite(self, p: Point, q: Point) -> None:
        first, second = (p, q) if self._rank[p] <= self._rank[q] else (q, p)
        self._leader[second] = first


# Edges laid over each other: cut where they meet, and those that coincide made one piece.


_Entry = tuple[float, int, Edge, int]
"""How far the middle of an edge is off its chord, the edge's number, the edge, its turns."""
DIGIT = 16
"""Bits: how often the edges of several owners wind stands in one whole number, a digit an owner."""
ROUNDS = 4
"""Most times that edges are cut over again."""


class Piece(NamedTuple):
    """An edge that meets others at its ends only; the chains wind ``turns`` times more on its left
    than on its right. Those of several owners are told apart by ``by_owner``.
    """

    edge: Edge
    turns: int


class Overlay(NamedTuple):
    """Pieces, and whether some were bent: then they may cross where none was cut."""

    pieces: list[Piece]
    bent: bool


def overlaid(owners: Sequence[Iterable[Edge]], tolerance: float = EPSILON) -> Overlay:
    """The edges of all owners, each place once, cut where they meet.

    What was bent to meet another edge is cut over again, for it may have come to meet a third.
    """
    entries = [(edge, 1 << DIGIT * i) for i, edges in enumerate(owners) for edge in edges]
    return overlay(entries, tolerance)


def overlay(
    entries: Sequence[tuple[Edge, int]],
    tolerance: float = EPSILON,
    chain: Sequence[int] | None = None,
) -> Overlay:
    """The same for edges that each count so many turns.

    ``chain`` numbers the closed chain of each edge where it is known to stay clear of itself; of
    others it is negative.
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
    return Overlay(_merged(entries, tolerance), bent)


def by_owner(turns: int, owners: int) -> list[int]:
    """How often the edges of each owner wind, from what the edges of all do."""
    half = 1 << DIGIT - 1
    raised = turns + sum(half << DIGIT * i for i in range(owners))
    return [(raised >> DIGIT * i) % (2 * half) - half for i in range(owners)]


class Split(NamedTuple):
    """The parts of each edge, and whether one was bent to meet another."""

    parts: list[list[Edge]]
    bent: bool


def split_edges(
    edges: Sequence[Edge], tolerance: float = EPSILON, chain: Sequence[int] | None = None
) -> Split:
    """Each edge cut where it meets another; points nearer than 2 ``tolerance`` become one.

    The order of the edges has no part in where they are cut. What meets an arc is looked for along
    its circle, so one that was bent before is taken from end to end.
    """
    whole, edges = edges, [from_end_to_end(edge) for edge in edges]
    cuts: list[list[Point]] = [[] for _ in edges]
    meeting: list[tuple[int, int]] = []
    bounds = [edge.bounds for edge in edges]
    # An arc may leave the box of its ends by as much as these are off its circle.
    near = [widened(box, tolerance + BENT) for box in bounds]
    for i, j in close_pairs(bounds, tolerance):
        if chain is not None and chain[i] == chain[j] >= 0:
            continue
        if _stay_apart(edges[i], edges[j], tolerance) or _only_follows(
            edges[i], edges[j], near[i], near[j], 2 * tolerance
        ):
            continue
        points = meeting_points(edges[i], edges[j], tolerance, (near[i], near[j]))
        if points:
            cuts[i] += points
            cuts[j] += points
            meeting.append((i, j))
    _share(edges, cuts, meeting, bounds, tolerance)
    ends = [p for edge in edges for p in (edge.start, edge.end)]
    pool = PointPool(ends, [p for points in cuts for p in points], 2 * tolerance)
    stops = [_stops(edge, points, pool) for edge, points in zip(edges, cuts, strict=True)]
    return Split(
        [
            [edge]
            if len(own) == 2 and own[0] == edge.start and own[1] == edge.end and own[0] != own[1]
            else [edge.part(a, b) for a, b in pairwise(own) if a != b]
            for edge, own in zip(whole, stops, strict=True)
        ],
        any(
            abs(edge.to_left(p)) > BENT
            for edge, own in zip(edges, stops, strict=True)
            if len(own) > 2 or own[0] != edge.start or own[-1] != edge.end
            for p in own
        ),
    )


def _stay_apart(a: Edge, b: Edge, tolerance: float) -> bool:
    """Whether two arcs lie on circles that come nowhere near each other."""
    if not (isinstance(a, Arc) and isinstance(b, Arc)):
        return False
    gap, r, s = math.dist(a.centre, b.centre), a.radius, b.radius
    # Their ends may be as much as BENT off their circles.
    return max(gap - r - s, abs(r - s) - gap) > tolerance + 2 * BENT


def _only_follows(a: Edge, b: Edge, near_a: Bounds, near_b: Bounds, same: float) -> bool:
    """Whether one edge starts where the other ends, and what else is near both is one with it.

    Then neither is cut by the other.
    """
    if a.end == b.start:
        x, y = a.end
    elif a.start == b.end:
        x, y = a.start
    else:
        return False
    left, low, right, high = near_a
    left_b, low_b, right_b, high_b = near_b
    aside = max(min(right, right_b) - x, x - max(left, left_b))
    above = max(min(high, high_b) - y, y - max(low, low_b))
    return aside * aside + above * above < same * same


def _share(
    edges: Sequence[Edge],
    cuts: Sequence[list[Point]],
    meeting: Sequence[tuple[int, int]],
    bounds: Sequence[Bounds],
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
                low_x, low_y, high_x, high_y = widened(bounds[j], tolerance)
                for p in points:
                    if not (low_x <= p[0] <= high_x and low_y <= p[1] <= high_y):
                        continue
                    if p not in cuts[j] and distance_to(edges[j], p) < tolerance:
                        cuts[j].append(p)
                        found[j].append(p)
        new = found


def _stops(edge: Edge, points: Sequence[Point], pool: PointPool) -> list[Point]:
    """Where the parts of an edge end, from its start to its end."""
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
    """Cut edges, those that coincide as one; none where the chains wind alike on both sides."""
    between: dict[tuple[Point, Point], list[tuple[int, Edge, int]]] = defaultdict(list)
    for number, entry in enumerate(edges):
        edge, turns = entry
        a, b = edge.start, edge.end
        between[(a, b) if a < b else (b, a)].append((number, edge, turns))
    pieces: list[Piece] = []
    for ends, own in between.items():
        if len(own) == 1:
            _, edge, turns = own[0]
            pieces.append(Piece(edge, turns))
        else:
            a, b = ends
            entries = [
                (_offset(edge, a, b), number, edge, turns if edge.start == a else -turns)
                for number, edge, turns in own
            ]
            pieces += _united(entries, 4 * tolerance)
    return pieces


def _offset(edge: Edge, a: Point, b: Point) -> float:
    """How far the middle of an edge lies to the left of the chord from ``a`` to ``b``."""
    if not isinstance(edge, Arc):
        return 0.0
    x, y = edge.at(0.5)
    dx, dy = (b[0] - a[0], b[1] - a[1])
    return (dx * (y - a[1]) - dy * (x - a[0])) / math.hypot(dx, dy)


def _united(entries: list[_Entry], same: float) -> Iterator[Piece]:
    """One piece for each group of edges with common ends whose middles are near each other."""
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
    """Lines first, then arcs by radius: the same choice in any order, and along a whole circle.

    Of edges that are equal but for their direction, the first.
    """
    _, number, edge, _ = entry
    if isinstance(edge, Arc):
        return edge.radius, edge.centre, number
    return 0.0, (0.0, 0.0), number


# Closed chains of edges laid over each other, and how often they wind round what.
#
# How often the chains wind round the faces on both sides of a piece is told once for each connected
# group of pieces and then carried round their common points, from face to face: wherever two ways
# lead to a face they must agree, so what comes out is consistent or it is not returned.


NEAR = 0.05
"""Radians: edges that leave a point at less than this angle are compared farther on."""


class _Leaving:
    """A piece as it leaves a point: its direction there, its chord, how it bends, where it ends."""

    __slots__ = ("bend", "chord", "edge", "end", "half", "heading")

    def __init__(self, half: int, edge: Edge, heading: float, chord: float, bend: float) -> None:
        self.half = half
        self.edge = edge
        self.heading = heading
        self.chord = chord
        self.bend = bend
        self.end = edge.start if half & 1 else edge.end

    def to_left(self, p: Point) -> float:
        """How far ``p`` lies to the left of the line or circle the piece is a part of."""
        left = self.edge.to_left(p)
        return -left if self.half & 1 else left

    def towards(self, reach: float) -> float:
        """Angle from the point to where the piece is ``reach`` away."""
        return self.heading + math.asin(max(-1.0, min(1.0, self.bend * reach / 2)))


def _leaving(half: int, edge: Edge) -> _Leaving:
    start, end = (edge.end, edge.start) if half & 1 else (edge.start, edge.end)
    x0, y0 = start
    x1, y1 = end
    chord = math.hypot(x1 - x0, y1 - y0)
    straight = math.atan2(y1 - y0, x1 - x0)
    if not isinstance(edge, Arc):
        return _Leaving(half, edge, straight, chord, 0.0)
    lean = (-edge.sweep if half & 1 else edge.sweep) / 2
    heading = math.remainder(straight - lean, math.tau)
    return _Leaving(half, edge, heading, chord, 2 * math.sin(lean) / chord)


class Arrangement:
    """Pieces, each of them two halves: 2 i along piece i, 2 i + 1 against it."""

    def __init__(self, overlay: Overlay) -> None:
        self.pieces = overlay.pieces
        self._drawn = [from_end_to_end(edge) for edge, _ in self.pieces]
        self.origin = [p for edge, _ in self.pieces for p in (edge.start, edge.end)]
        rings: dict[Point, list[int]] = defaultdict(list)
        for half, p in enumerate(self.origin):
            rings[p].append(half)
        self._by_place: EdgeIndex | None = None
        self.tangled: set[Point] = set()
        """Where pieces leave in nearly one direction, so that rounding could order them wrongly;
        every point, where pieces were bent and may cross between their ends.
        """
        # Two follow each other either way.
        self.rings = {
            p: self._in_order(halves) if len(halves) > 2 else halves for p, halves in rings.items()
        }
        """The halves that leave each point, counter-clockwise."""
        if overlay.bent:
            self.tangled.update(self.rings)
        self.left = self._wound()
        """How often the chains wind round what is to the left of each half."""
        if self.tangled:
            self._verify()

    def turns(self, half: int) -> int:
        turns = self.pieces[half >> 1].turns
        return -turns if half & 1 else turns

    def _in_order(self, halves: Sequence[int]) -> list[int]:
        """Halves that leave one point, counter-clockwise; the widest gap comes last."""
        found = sorted(
            (_leaving(half, self._drawn[half >> 1]) for half in halves),
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

    @property
    def _index(self) -> EdgeIndex:
        if self._by_place is None:
            self._by_place = EdgeIndex(self._drawn)
        return self._by_place

    def _around(self, p: Point, left: Sequence[int | None]) -> int:
        """How often the pieces that are told in ``left`` wind round a point."""
        x, y = p
        return sum(
            self.pieces[number].turns * turns_round(self._drawn[number], p)
            for number in self._index.numbers((x, y, self._index.right, y))
            if left[2 * number] is not None
        )

    def _wound(self) -> list[int]:
        left: list[int | None] = [None] * len(self.origin)
        edges = [edge.bounds[0] for edge in self._drawn]
        told = False
        for number in sorted(range(len(edges)), key=edges.__getitem__):
            if left[2 * number] is not None:
                continue
            # Nothing of this group lies farther left, and no other group that is still to come
            # reaches round it.
            half, p = self._leftmost(number, edges[number])
            self._carry(half, self._around(p, left) if told else 0, left)
            told = True
        return [turns for turns in left if turns is not None]

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
            half = 2 * max(part, key=lambda number: self._drawn[number].length)
            beside = self._beside(half)
            if beside is not None and self._around(beside, self.left) != self.left[half]:
                raise InconsistentError(self._drawn[half >> 1].at(0.5))

    def _beside(self, half: int) -> Point | None:
        """A point to the left of a half, nearer to it than to any other; None if there is hardly
        room.
        """
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
        """A half with the plane outside its group on its left, and its leftmost point."""
        edge = self._drawn[number]
        p = min(edge.start, edge.end)
        # Where an arc bulges by a rounding only, what it meets at its end may lie farther left.
        if isinstance(edge, Arc) and x < p[0] - 2 * EPSILON:
            return 2 * number + int(edge.ccw), (x, edge.centre[1])
        # All leave to the right of it, so the last of those that leave upwards most.
        halves = self.rings[p] if len(self.rings[p]) > 2 else self._in_order(self.rings[p])
        ring = [_leaving(half, self._drawn[half >> 1]) for half in halves]
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
            if turns > above >= turns - self.turns(half)
        ]

    def edging(self, wanted: Container[int]) -> list[int]:
        """The halves round whose left the chains wind as wanted, and round whose right not so."""
        left = self.left
        return [
            half
            for half, turns in enumerate(left)
            if turns in wanted and left[half ^ 1] not in wanted
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
