"""Points that lie too near each other to be told apart, made one."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Final

from sbafab.geometry.edges import SAME, Point

CELLS: Final = 16
"""Cells of the grid are so many times as wide as points are pooled: most points touch one only."""


ASLANT: Final = 0.7548776662466927
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
