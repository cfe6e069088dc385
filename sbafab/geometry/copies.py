"""Contours that are copies of each other: what holds for the shape of one holds for all."""

from __future__ import annotations

from collections import defaultdict
from operator import sub

from sbafab.geometry.edges import Arc, Point
from sbafab.geometry.region import Contour

COPIED = 1e-8
"""mm: ten times what the numbers of a file are rounded by; far below what tells edges apart."""


class Copies:
    """Contours, each found to be a copy of an earlier one that lies elsewhere, or the first."""

    def __init__(self) -> None:
        self._known: dict[tuple[int, ...], list[tuple[list[float], Contour]]] = defaultdict(list)
        self._firsts: dict[int, tuple[Contour, Contour]] = {}

    def first(self, contour: Contour) -> Contour:
        """The first contour that this one is a copy of, edge by edge, moved: itself if none is.

        Ends, centres and radii agree within ``COPIED``.
        """
        if id(contour) not in self._firsts:
            self._firsts[id(contour)] = contour, self._found(contour)
        return self._firsts[id(contour)][1]

    def _found(self, contour: Contour) -> Contour:
        ox, oy = contour.edges[0].start
        numbers: list[float] = []
        for edge in contour.edges:
            x, y = edge.start
            numbers += (x - ox, y - oy)
            if isinstance(edge, Arc):
                (x, y), radius = edge.centre, edge.radius
                numbers += (x - ox, y - oy, radius if edge.ccw else -radius)
        left, low, right, high = contour.bounds
        # What copies nearly always agree in tells most others apart.
        sizes = round(100 * (right - left)), round(100 * (high - low))
        filed = self._known[len(contour.edges), len(numbers), *sizes]
        for others, first in filed:
            if max(map(abs, map(sub, numbers, others))) < COPIED:
                return first
        filed.append((numbers, contour))
        return contour

    def lying(self, contour: Contour) -> tuple[int, Point]:
        """A number of the contour's shape, and where it lies: its centre, or where it starts."""
        if contour.circle is not None:
            centre, radius = contour.circle
            return -round(radius / COPIED), centre
        return id(self.first(contour)), contour.edges[0].start


def between(a: Point, b: Point) -> tuple[int, int]:
    """How the second of two points lies to the first, in ``COPIED``."""
    return round((b[0] - a[0]) / COPIED), round((b[1] - a[1]) / COPIED)
