"""Points of which the nearest is taken, time after time, without looking at all of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

from sbafab.geometry.edges import Point

SLACK = 1e-5
"""mm by which a measure may fall short of the distance of two points: it may be rounded."""


class PointsLeft:
    """Points filed by the cells of a square grid, which is made again as they grow few."""

    def __init__(self, points: Sequence[Point]) -> None:
        self._points = points
        self._file(range(len(points)))

    def _file(self, numbers: Sequence[int]) -> None:
        """About one point a cell, and of points on a line no more cells than points."""
        points = [self._points[number] for number in numbers] or [(0.0, 0.0)]
        self._low = min(x for x, _ in points), min(y for _, y in points)
        high = max(x for x, _ in points), max(y for _, y in points)
        across, along = high[0] - self._low[0], high[1] - self._low[1]
        longest = max(across, along) / len(points)
        self._cell = max(math.sqrt(across * along / len(points)), longest) or 1.0
        self._last = self._place(high)
        self._cells: dict[tuple[int, int], list[int]] = {}
        for number in numbers:
            self._cells.setdefault(self._place(self._points[number]), []).append(number)
        self._count = self._filed = len(numbers)

    def _place(self, p: Point) -> tuple[int, int]:
        (x, y), (low_x, low_y) = p, self._low
        return math.floor((x - low_x) / self._cell), math.floor((y - low_y) / self._cell)

    def take(self, p: Point, measure: Callable[[int], float]) -> int:
        """Takes the point of the least measure, of equal ones the first, and returns its number.

        ``measure`` of a number is in mm and no less than the point's distance from ``p``.
        """
        if 2 * self._count < self._filed:
            self._file(sorted(number for cell in self._cells.values() for number in cell))
        x, y = self._place(p)
        (last_x, last_y), cell = self._last, self._cell
        ring = max(0, -x, -y, x - last_x, y - last_y)
        best, found, home = math.inf, -1, (0, 0)
        points, cells = self._points, self._cells
        while best > (ring - 1) * cell - SLACK:
            for place in self._ring(x, y, ring):
                for number in cells.get(place, ()):
                    if math.dist(p, points[number]) > best + SLACK:
                        continue
                    value = measure(number)
                    if value < best or (value == best and number < found):
                        best, found, home = value, number, place
            ring += 1
        self._cells[home].remove(found)
        self._count -= 1
        return found

    def _ring(self, x: int, y: int, ring: int) -> Iterator[tuple[int, int]]:
        """The cells a number of cells away, as far as there are any."""
        last_x, last_y = self._last
        if ring == 0:
            yield x, y
            return
        left, right = max(0, x - ring), min(last_x, x + ring)
        for row in {y - ring, y + ring}:
            if 0 <= row <= last_y:
                for column in range(left, right + 1):
                    yield column, row
        bottom, top = max(0, y - ring + 1), min(last_y, y + ring - 1)
        for column in {x - ring, x + ring}:
            if 0 <= column <= last_x:
                for row in range(bottom, top + 1):
                    yield column, row
