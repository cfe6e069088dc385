"""Closed chains of edges laid over each other, and how often they wind round what.

How often the chains wind round the faces on both sides of a piece is told once for each connected
group of pieces and then carried round their common points, from face to face: wherever two ways
lead to a face they must agree, so what comes out is consistent or it is not returned.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Container, Iterator, Sequence
from functools import cmp_to_key
from typing import Final, final

from sbafab.geometry.edges import (
    EPSILON,
    Arc,
    Edge,
    Point,
    distance_to,
    from_end_to_end,
    left_normal,
    turns_round,
)
from sbafab.geometry.inconsistent import InconsistentError
from sbafab.geometry.nearby import EdgeIndex, widened
from sbafab.geometry.pieces import Overlay

NEAR: Final = 0.05
"""Radians: edges that leave a point at less than this angle are compared farther on."""


@final
class _Leaving:
    """A piece as it leaves a point: its direction there, its chord, how it bends, where it ends."""

    __slots__ = ("bend", "chord", "edge", "end", "half", "heading")

    def __init__(self, half: int, edge: Edge, heading: float, chord: float, bend: float) -> None:
        self.half: Final[int] = half
        self.edge: Final[Edge] = edge
        self.heading: Final[float] = heading
        self.chord: Final[float] = chord
        self.bend: Final[float] = bend
        self.end: Final[Point] = edge.start if half & 1 else edge.end

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
