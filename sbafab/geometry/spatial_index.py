"""Search for nearby boxes and edges without comparing all pairs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from sbafab.geometry.edges import Bounds, Edge, Point, distance_to
from sbafab.geometry.lazy_numpy import np


def widened(box: Bounds, margin: float) -> Bounds:
    """Return the box with ``margin`` added on every side."""
    return box[0] - margin, box[1] - margin, box[2] + margin, box[3] + margin


def boxes_meet(a: Bounds, b: Bounds) -> bool:
    """Return True if two boxes overlap by more than an edge."""
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def close_pairs(boxes: Sequence[Bounds], reach: float) -> list[tuple[int, int]]:
    """Return the numbers of boxes that come within ``reach`` of each other, by a sweep along x."""
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


class EdgeIndex:
    """Edges with their bounding boxes in arrays."""

    def __init__(self, edges: Sequence[Edge], boxes: Sequence[Bounds] | None = None) -> None:
        """``boxes``: the bounds of the edges, if computed already."""
        self.edges = edges
        rows = boxes if boxes is not None else [edge.bounds for edge in edges]
        self._boxes = np.array(rows, dtype=float).reshape(-1, 4).T.copy()

    def touching(self, box: Bounds) -> Iterator[Edge]:
        """Yield edges whose bounding boxes meet a box."""
        return (self.edges[number] for number in self.numbers(box))

    def numbers(self, box: Bounds) -> list[int]:
        """Return the numbers of edges whose bounding boxes meet a box."""
        low_x, low_y, high_x, high_y = self._boxes
        meets = (low_x <= box[2]) & (high_x >= box[0]) & (low_y <= box[3]) & (high_y >= box[1])
        numbers: list[int] = meets.nonzero()[0].tolist()
        return numbers

    def all_within(self, box: Bounds) -> bool:
        """Return True if no edge extends beyond the box."""
        low_x, low_y, high_x, high_y = self._boxes
        meets = (low_x >= box[0]) & (high_x <= box[2]) & (low_y >= box[1]) & (high_y <= box[3])
        return bool(meets.all())

    def distance(self, p: Point) -> float:
        """Least distance from ``p`` to any edge."""
        low_x, low_y, high_x, high_y = self._boxes
        across = np.maximum(np.maximum(low_x - p[0], p[0] - high_x), 0.0)
        along = np.maximum(np.maximum(low_y - p[1], p[1] - high_y), 0.0)
        least, off = math.inf, np.hypot(across, along)
        for number in off.argsort(kind="stable").tolist():
            if off[number] > least:
                break
            least = min(least, distance_to(self.edges[number], p))
        return least
