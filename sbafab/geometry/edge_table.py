"""Edges and sides of boundaries in NumPy arrays, for searches at many points at once."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import cached_property
from itertools import chain
from typing import TYPE_CHECKING

from sbafab.geometry.edges import EPSILON, Arc, Bounds, Edge
from sbafab.geometry.lazy_numpy import np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Indices = NDArray[np.intp]
    Bools = NDArray[np.bool_]


AT_ONCE = 200_000
"""Pairs of boxes compared at once, which bounds the memory."""


def dot(a: Floats, b: Floats) -> Floats:
    """Return the dot products of vectors with one row per coordinate."""
    product: Floats = a[0] * b[0] + a[1] * b[1]
    return product


def length_of(vector: Floats) -> Floats:
    length: Floats = np.sqrt(dot(vector, vector))
    return length


def columns_of(rows: Iterable[Iterable[float]], width: int) -> Floats:
    """Return rows of ``width`` numbers as columns; faster than ``np.array``."""
    return np.fromiter(chain.from_iterable(rows), dtype=float).reshape(-1, width).T


class EdgeTable:
    """Edges in arrays, one column per edge; points and boxes have one row per coordinate.

    ``turn`` is 1 for an arc that runs counter-clockwise, -1 for one that runs clockwise, 0 for a
    line, whose centre is its start. All attributes are rows of ``columns``.
    """

    def __init__(self, columns: Floats) -> None:
        self.columns = columns
        self.start: Floats = columns[0:2]
        self.end: Floats = columns[2:4]
        self.centre: Floats = columns[4:6]
        self.radius: Floats = columns[6]
        self.turn: Floats = columns[7]
        self.box: Floats = columns[8:12]

    @staticmethod
    def of(edges: Sequence[Edge], boxes: Sequence[Bounds] | None = None) -> EdgeTable:
        """Return the table of edges; ``boxes`` are their bounds if already computed."""
        bounds = boxes if boxes is not None else [edge.bounds for edge in edges]
        rows = [
            (*e.start, *e.end, *e.centre, e.radius, 1.0 if e.ccw else -1.0, *box)
            if isinstance(e, Arc)
            else (*e.start, *e.end, *e.start, 0.0, 0.0, *box)
            for e, box in zip(edges, bounds, strict=True)
        ]
        return EdgeTable(columns_of(rows, 12).copy())

    @staticmethod
    def joined(tables: Sequence[EdgeTable]) -> EdgeTable:
        return EdgeTable(np.concatenate([table.columns for table in tables], axis=1))

    def at(self, numbers: Indices) -> EdgeTable:
        """Return the edges with these numbers, in their order."""
        return EdgeTable(self.columns.take(numbers, axis=1))

    def normal(self, p: Floats) -> Floats:
        """Return the unit normals to the left of travel, for each edge at one point."""
        chord = self.end - self.start
        out = p - self.centre
        x = np.where(self.turn == 0, -chord[1], -self.turn * out[0])
        y = np.where(self.turn == 0, chord[0], -self.turn * out[1])
        length = np.sqrt(x * x + y * y)
        length[length == 0] = 1.0
        return np.array([x / length, y / length])

    @cached_property
    def half_turn(self) -> Floats:
        """Half of the sweep of each edge."""
        a, b = self.start - self.centre, self.end - self.centre
        turn = np.arctan2(self.turn * (a[0] * b[1] - a[1] * b[0]), dot(a, b))
        half: Floats = np.where(turn < -1e-9, turn + math.tau, np.maximum(turn, 0.0)) / 2
        return np.where(self.turn == 0, 0.0, half)

    @cached_property
    def middle(self) -> Floats:
        """The midpoints."""
        a, turn = self.start - self.centre, self.turn * self.half_turn
        c, s = np.cos(turn), np.sin(turn)
        on_arc = self.centre + np.array([a[0] * c - a[1] * s, a[0] * s + a[1] * c])
        return np.where(self.turn == 0, (self.start + self.end) / 2, on_arc)

    def faces(self, p: Floats, room: float = 0.0) -> Bools:
        """Return True for each arc whose point, seen from the centre, lies within its sweep.

        ``room`` is a fraction of the radius by which the point may lie beyond an end.
        """
        out, a, b = p - self.centre, self.start - self.centre, self.end - self.centre
        least = -room * self.radius * self.radius
        ahead: Bools = self.turn * (a[0] * out[1] - a[1] * out[0]) >= least
        ahead &= self.turn * (out[0] * b[1] - out[1] * b[0]) >= least
        return ahead

    def distance(self, p: Floats) -> Floats:
        """Return the least distance of each edge from one point."""
        chord, off = self.end - self.start, p - self.start
        square = dot(chord, chord)
        t = dot(chord, off) / np.where(square == 0, 1.0, square)
        t = np.minimum(np.maximum(t, 0.0), 1.0)
        along = off - t * chord
        to_line = np.sqrt(dot(along, along))
        out, beyond = p - self.centre, p - self.end
        to_circle = np.abs(np.sqrt(dot(out, out)) - self.radius)
        to_ends = np.sqrt(np.minimum(dot(off, off), dot(beyond, beyond)))
        to_arc = np.where(self.faces(p), to_circle, to_ends)
        distance: Floats = np.where(self.turn == 0, to_line, to_arc)
        return distance


def touching(queries: Floats, boxes: Floats) -> tuple[Indices, Indices]:
    """Return pairs of numbers (query, box) of all boxes that meet each query, in order."""
    pairs = [(np.zeros(0, np.intp), np.zeros(0, np.intp))]
    step = max(1, AT_ONCE // max(1, boxes.shape[1]))
    for start in range(0, queries.shape[1], step):
        some = queries[:, start : start + step, None]
        meets = boxes[0] <= some[2]
        meets &= boxes[2] >= some[0]
        meets &= boxes[1] <= some[3]
        meets &= boxes[3] >= some[1]
        # The few True values are found faster in a flat array.
        query, box = np.divmod(meets.ravel().nonzero()[0], boxes.shape[1] or 1)
        pairs.append((query + start, box))
    query, box = (np.concatenate(numbers) for numbers in zip(*pairs, strict=True))
    return query, box


def boxes_round(p: Floats, q: Floats, margin: float) -> Floats:
    """Return the boxes around the segments from ``p`` to ``q``, with ``margin`` on every side."""
    return np.concatenate([np.minimum(p, q) - margin, np.maximum(p, q) + margin])


def crossings(
    origin: Floats, unit: Floats, edges: EdgeTable, tolerance: float = EPSILON
) -> tuple[Floats, Bools]:
    """Return distances along straight lines to the intersections with each edge's line or circle.

    Three rows (the foot of a tangent, and two crossings), and a mask of those that exist.
    """
    chord = edges.end - edges.start
    off = edges.start - origin
    cross = unit[0] * chord[1] - unit[1] * chord[0]
    parallel = np.abs(cross) < 1e-12 * np.sqrt(dot(chord, chord))
    t = (off[0] * chord[1] - off[1] * chord[0]) / np.where(parallel, 1.0, cross)
    to_centre = edges.centre - origin
    along = dot(to_centre, unit)
    across = np.abs(to_centre[0] * unit[1] - to_centre[1] * unit[0])
    room = edges.radius - across
    half = np.sqrt(np.maximum(0.0, room * (edges.radius + across)))
    straight = edges.turn == 0
    touches = (room >= -tolerance) & ((half < tolerance) | (room < tolerance))
    both = (room >= -tolerance) & (half >= tolerance)
    distances = np.array([np.where(straight, t, along), along - half, along + half])
    there = np.array([np.where(straight, ~parallel, touches), both & ~straight, both & ~straight])
    return distances, there
