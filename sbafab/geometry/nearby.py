"""Spatial search for near edges and boxes without comparing all pairs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain
from typing import NamedTuple

from sbafab.geometry.edges import EPSILON, Bounds, Edge, Line, Point, distance_to, left_normal

MANY_BOXES = 500
"""Number of boxes above which NumPy is worth loading."""
FEW_BOXES = 100
"""Number of boxes up to which a sweep needs no bands."""
AT_ONCE = 1_000_000
"""Pairs compared at once, which bounds the memory."""


def widened(box: Bounds, margin: float) -> Bounds:
    """The box with ``margin`` added on every side."""
    return box[0] - margin, box[1] - margin, box[2] + margin, box[3] + margin


def boxes_meet(a: Bounds, b: Bounds) -> bool:
    """Return True if two boxes overlap by more than an edge."""
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def close_pairs(boxes: Sequence[Bounds], reach: float) -> Iterable[tuple[int, int]]:
    """Return the numbers of boxes that come within ``reach`` of each other, by a sweep along x.

    The sweep runs in bands along y of the mean height of a box, so its time grows only with the
    number of boxes and pairs. Few boxes need no bands; many are compared in arrays. The order of
    the pairs is the same in each case.
    """
    if len(boxes) >= MANY_BOXES:
        return _close_among_many(boxes, reach)
    if len(boxes) <= FEW_BOXES:
        return _close_among_few(boxes, reach)
    return _close_in_bands(boxes, reach)


def _close_in_bands(boxes: Sequence[Bounds], reach: float) -> Iterator[tuple[int, int]]:
    order = sorted(range(len(boxes)), key=lambda i: boxes[i][0])
    height = reach + sum([box[3] - box[1] for box in boxes]) / max(1, len(boxes)) or 1.0
    active: dict[int, list[tuple[int, int, int]]] = {}
    for rank, i in enumerate(order):
        low_x, low, _, high = boxes[i]
        first, last = math.floor((low - reach) / height), math.floor((high + reach) / height)
        pairs = []
        for band in range(first, last + 1):
            filed = active.get(band)
            if not filed:
                continue
            filed = active[band] = [it for it in filed if boxes[it[1]][2] >= low_x - reach]
            for before, j, bottom in filed:
                # Two boxes may share several bands; they meet in the lowest of them.
                if (
                    band == max(first, bottom)
                    and boxes[j][1] <= high + reach
                    and boxes[j][3] >= low - reach
                ):
                    pairs.append((before, j))
        for _, j in sorted(pairs):
            yield j, i
        bottom, top = math.floor(low / height), math.floor(high / height)
        for band in range(bottom, top + 1):
            active.setdefault(band, []).append((rank, i, bottom))


def _close_among_few(boxes: Sequence[Bounds], reach: float) -> list[tuple[int, int]]:
    pairs: list[tuple[int, int]] = []
    active: list[tuple[float, float, float, int]] = []
    lefts = [box[0] for box in boxes]
    for i in sorted(range(len(boxes)), key=lefts.__getitem__):
        low_x, low, high_x, high = boxes[i]
        first, bottom, top = low_x - reach, low - reach, high + reach
        active = [entry for entry in active if entry[0] >= first]
        for _, other_low, other_high, j in active:
            if other_low <= top and other_high >= bottom:
                pairs.append((j, i))
        active.append((high_x, low, high, i))
    return pairs


def _close_among_many(boxes: Sequence[Bounds], reach: float) -> Iterator[tuple[int, int]]:
    # Loaded for large designs only: reading a drawing must not import NumPy.
    import numpy as np

    sides = np.array(boxes)
    order = np.argsort(sides[:, 0], kind="stable")
    low_x, low, high_x, high = sides[order].T
    # Ranks: each box may meet those after it as far as they start before it ends.
    last = np.searchsorted(low_x - reach, high_x, side="right")
    counts = np.maximum(last - np.arange(1, len(order) + 1), 0)
    until = np.cumsum(counts)
    pairs = []
    first = 0
    while first < len(order):
        done = until[first - 1] if first else 0
        after = max(first + 1, int(np.searchsorted(until, done + AT_ONCE, side="right")))
        repeats = counts[first:after]
        before = np.repeat(np.arange(first, after), repeats)
        ahead = np.arange(len(before)) - np.repeat(np.cumsum(repeats) - repeats, repeats)
        behind = before + 1 + ahead
        meets = (low[before] <= high[behind] + reach) & (high[before] >= low[behind] - reach)
        pairs.append(np.array([behind[meets], before[meets]]))
        first = after
    behind, before = np.concatenate(pairs, axis=1)
    turn = np.lexsort((before, behind))
    yield from zip(order[before[turn]].tolist(), order[behind[turn]].tolist(), strict=True)


FEW_EDGES = 64
"""Number of edges up to which comparing all boxes costs less than indexing them."""


class EdgeIndex:
    """Edges filed by the cells of a square grid that their bounding boxes touch."""

    def __init__(self, edges: Sequence[Edge], boxes: Sequence[Bounds] | None = None) -> None:
        """``boxes``: the bounds of the edges, if computed already."""
        self.edges = edges
        self._boxes = boxes if boxes is not None else [edge.bounds for edge in edges]
        boxes = self._boxes or [(0.0, 0.0, 0.0, 0.0)]
        self._low = min(box[0] for box in boxes), min(box[1] for box in boxes)
        self._high = max(box[2] for box in boxes), max(box[3] for box in boxes)
        self.across = max(self._high[0] - self._low[0], self._high[1] - self._low[1])
        self.cell = self.across / max(1.0, math.sqrt(len(edges))) or 1.0
        self._reach = self._places((*self._low, *self._high))
        self._by_cell: dict[tuple[int, int], list[int]] | None = None
        self._first_cells: list[tuple[int, int]] | None = None

    @property
    def _filed(self) -> dict[tuple[int, int], list[int]]:
        """The numbers of edges in each cell."""
        if self._by_cell is None:
            self._by_cell = self._file()
        return self._by_cell

    def _file(self) -> dict[tuple[int, int], list[int]]:
        filed: dict[tuple[int, int], list[int]] = {}
        for number, box in enumerate(self._boxes):
            x0, y0, x1, y1 = self._places(box)
            if x0 == x1 and y0 == y1:
                filed.setdefault((x0, y0), []).append(number)
                continue
            for x in range(x0, x1 + 1):
                for y in range(y0, y1 + 1):
                    filed.setdefault((x, y), []).append(number)
        return filed

    @property
    def _cells(self) -> list[tuple[int, int]]:
        """The first cell of each edge."""
        if self._first_cells is None:
            x, y = self._low
            cell = self.cell
            self._first_cells = [
                (math.floor((box[0] - x) / cell), math.floor((box[1] - y) / cell))
                for box in self._boxes
            ]
        return self._first_cells

    def _places(self, box: Bounds) -> tuple[int, int, int, int]:
        x, y = self._low
        cell = self.cell
        return (
            math.floor((box[0] - x) / cell),
            math.floor((box[1] - y) / cell),
            math.floor((box[2] - x) / cell),
            math.floor((box[3] - y) / cell),
        )

    def touching(self, box: Bounds) -> Iterator[Edge]:
        """Yield edges whose bounding boxes meet a box."""
        return (self.edges[number] for number in self.numbers(box))

    def numbers(self, box: Bounds) -> list[int]:
        """Return the numbers of edges whose bounding boxes meet a box."""
        numbers = self.among(box, self.about(box))
        return numbers if len(self._boxes) > FEW_EDGES else self.in_order(box, numbers)

    def among(self, box: Bounds, numbers: Iterable[int]) -> list[int]:
        """Return the numbers of the given edges whose bounding boxes meet a box."""
        low_x, low_y, high_x, high_y = box
        boxes = self._boxes
        return [
            number
            for number in numbers
            if (bounds := boxes[number])[0] <= high_x
            and bounds[2] >= low_x
            and bounds[1] <= high_y
            and bounds[3] >= low_y
        ]

    def in_order(self, box: Bounds, numbers: list[int]) -> list[int]:
        """Sort the edges that meet a box by the first cell they share with it."""
        if len(numbers) > 1:
            x, y = self._low
            cell = self.cell
            first = self._cells
            x0, y0 = math.floor((box[0] - x) / cell), math.floor((box[1] - y) / cell)
            numbers.sort(key=lambda n: (max(x0, first[n][0]), max(y0, first[n][1])))
        return numbers

    def about(self, box: Bounds, after: int = -1) -> Iterable[int]:
        """Return the edges in the cells that a box touches, cell by cell, without duplicates.

        A small index returns all edges. Edges up to the number ``after`` may be left out.
        """
        if len(self._boxes) <= FEW_EDGES:
            return range(after + 1, len(self._boxes))
        x0, y0, x1, y1 = self._places(box)
        filed = self._filed
        if x0 == x1 and y0 == y1:
            return filed.get((x0, y0), ())
        low_x, low_y, high_x, high_y = self._reach
        columns = range(max(x0, low_x), min(x1, high_x) + 1)
        rows = range(max(y0, low_y), min(y1, high_y) + 1)
        cells = [filed[x, y] for x in columns for y in rows if (x, y) in filed]
        return dict.fromkeys(chain.from_iterable(cells)) if len(cells) > 1 else chain(*cells)

    @property
    def right(self) -> float:
        """Largest x of any edge."""
        return self._high[0]

    def all_within(self, box: Bounds) -> bool:
        """Return True if no edge reaches out of the box."""
        low_x, low_y = self._low
        high_x, high_y = self._high
        return box[0] <= low_x and box[1] <= low_y and box[2] >= high_x and box[3] >= high_y

    def distance(self, p: Point) -> float:
        """Least distance from ``p`` to any edge."""
        # Many points lie on an edge.
        margin = EPSILON
        while True:
            box = widened((*p, *p), margin)
            least = min((distance_to(edge, p) for edge in self.touching(box)), default=math.inf)
            if least <= margin or self.all_within(box):
                return least
            margin = max(2 * margin, self.cell)


ALONGSIDE = 1e-3
"""Lines at a smaller angle (radians), or arcs with nearer centres (mm), run alongside."""


BESIDE = 1e-5
"""mm by which an edge may miss another's normals because of rounding."""


class Foot(NamedTuple):
    """A point of an edge, and the unit normal into the material there."""

    point: Point
    normal: Point


class BoundarySide:
    """An edge of a boundary with values that the search uses repeatedly.

    ``half`` is the distance of its ends from its middle, ``lean`` the sine of its half turn.
    """

    __slots__ = ("box", "edge", "half", "half_turn", "lean", "middle", "normal")

    def __init__(
        self, edge: Edge, box: Bounds, middle: Point, half_turn: float, half: float
    ) -> None:
        self.edge = edge
        self.box = box
        self.middle = middle
        self.normal = left_normal(edge, middle)
        self.half_turn = half_turn
        self.half = half
        self.lean = math.sin(min(half_turn, math.pi / 2))

    def may_hold_feet(self, side: BoundarySide, within: float) -> bool:
        """Return True if a normal of this edge may meet ``side`` no farther off than ``within``."""
        x, y = self.middle
        nx, ny = self.normal
        aside = abs((side.middle[0] - x) * ny - (side.middle[1] - y) * nx)
        return aside <= self.half + side.half + within * self.lean + BESIDE

    def feet(self, p: Point) -> list[Foot]:
        """Return the points of the edge where its normal passes through ``p``."""
        edge = self.edge
        if isinstance(edge, Line):
            x0, y0 = edge.start
            x1, y1 = edge.end
            dx, dy = x1 - x0, y1 - y0
            square = dx * dx + dy * dy
            t = ((p[0] - x0) * dx + (p[1] - y0) * dy) / square
            if not -1e-9 <= t <= 1 + 1e-9:
                return []
            length = math.sqrt(square)
            return [Foot((x0 + t * dx, y0 + t * dy), (-dy / length, dx / length))]
        cx, cy = edge.centre
        r = edge.radius
        ux, uy = p[0] - cx, p[1] - cy
        distance = math.hypot(ux, uy)
        if distance < 1e-12:
            return [Foot(self.middle, left_normal(edge, self.middle))]
        inward = -1.0 if edge.ccw else 1.0
        mx, my = self.middle[0] - cx, self.middle[1] - cy
        least = r * (math.cos(self.half_turn) - 1e-9)
        feet = []
        for sign in (1.0, -1.0):
            vx, vy = sign * ux / distance, sign * uy / distance
            if vx * mx + vy * my >= least:
                feet.append(Foot((cx + r * vx, cy + r * vy), (inward * vx, inward * vy)))
        return feet
