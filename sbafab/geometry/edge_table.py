"""Edges and sides of boundaries in NumPy arrays, for searches over many places at once."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import chain
from typing import TYPE_CHECKING, NamedTuple

from sbafab.geometry.edges import EPSILON, Arc, Bounds, Edge, Line, Point, left_normal
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


def columns_of(rows: Iterable[Iterable[float]], width: int) -> Floats:
    """Return rows of ``width`` numbers as columns; faster than ``np.array``."""
    return np.fromiter(chain.from_iterable(rows), dtype=float).reshape(-1, width).T


class EdgeTable:
    """Edges in arrays, one column per edge; points and boxes have one row per coordinate.

    ``turn`` is 1 for an arc that runs counter-clockwise, -1 for one that runs clockwise, 0 for a
    line, whose centre is its start. All attributes are rows of ``columns``.
    """

    __slots__ = ("box", "centre", "columns", "end", "radius", "start", "turn")

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
        """Return the table of edges; ``boxes`` are their bounds, if computed already."""
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
        """The edges with these numbers, in their order."""
        return EdgeTable(self.columns.take(numbers, axis=1))

    def normal(self, p: Floats) -> Floats:
        """Unit normals to the left of travel, for each edge at its own point."""
        chord = self.end - self.start
        out = p - self.centre
        x = np.where(self.turn == 0, -chord[1], -self.turn * out[0])
        y = np.where(self.turn == 0, chord[0], -self.turn * out[1])
        length = np.sqrt(x * x + y * y)
        length[length == 0] = 1.0
        return np.array([x / length, y / length])

    def faces(self, p: Floats, room: float = 0.0) -> Bools:
        """Return True for each arc whose own point lies within its sweep, seen from the centre.

        ``room`` is a share of the radius by which the point may lie past an end.
        """
        out, a, b = p - self.centre, self.start - self.centre, self.end - self.centre
        least = -room * self.radius * self.radius
        ahead: Bools = self.turn * (a[0] * out[1] - a[1] * out[0]) >= least
        ahead &= self.turn * (out[0] * b[1] - out[1] * b[0]) >= least
        return ahead

    def distance(self, p: Floats) -> Floats:
        """Least distance of each edge from its own point."""
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
    """Return boxes of the segments from ``p`` to ``q``, with ``margin`` on every side."""
    return np.concatenate([np.minimum(p, q) - margin, np.maximum(p, q) + margin])


def crossings(
    origin: Floats, unit: Floats, edges: EdgeTable, tolerance: float = EPSILON
) -> tuple[Floats, Bools]:
    """Return distances along straight lines to where each meets its edge's line or circle.

    Three rows (the foot of a tangent, and two crossings), and a mask of the ones that exist.
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


# The sides of boundaries, which have the material on their left.


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


ROOM = 1e-9
"""Exceeds the rounding of the pairwise tests that follow."""


class SideTable:
    """The sides of a boundary in arrays."""

    def __init__(self, sides: Sequence[BoundarySide]) -> None:
        self.edges = [side.edge for side in sides]
        self.table = EdgeTable.of(self.edges, [side.box for side in sides])
        rows = [
            (*side.middle, *side.normal, side.half_turn, side.half, side.lean) for side in sides
        ]
        columns = columns_of(rows, 7)
        self.middle, self.normal = columns[0:2], columns[2:4]
        self.half_turn, self.half, self.lean = columns[4:7]

    def pairs(self, aside: float, within: float) -> tuple[Indices, Indices]:
        """Return pairs (a, b) of sides that may face each other within a distance, in order.

        ``aside`` is the angle that normals may turn by. Normals of ``b`` may meet ``a``; a pair may
        come both ways.
        """
        boxes, box = self.table.box.copy(), self.table.box
        boxes[:2] -= within
        boxes[2:] += within
        a, b = touching(boxes, box)
        chosen = self._opposed(a, b, aside) & self._may_hold_feet(b, a, within) & (a != b)
        return a[chosen], b[chosen]

    def _opposed(self, a: Indices, b: Indices, aside: float) -> Bools:
        """Return True for pairs with normals opposed somewhere, to within ``aside`` radians."""
        room = self.half_turn.take(a) + aside + self.half_turn.take(b)
        facing = dot(self.normal.take(a, axis=1), self.normal.take(b, axis=1))
        opposed = facing < ROOM - np.cos(room)
        may_face: Bools = opposed | (room > math.pi)
        return may_face

    def _may_hold_feet(self, a: Indices, b: Indices, within: float) -> Bools:
        """True for pairs where normals of sides ``a`` may meet sides ``b`` within a distance."""
        off, normal = (
            self.middle.take(b, axis=1) - self.middle.take(a, axis=1),
            self.normal.take(a, axis=1),
        )
        missed = np.abs(off[0] * normal[1] - off[1] * normal[0])
        half = self.half.take(a) + self.half.take(b)
        may: Bools = missed <= half + within * self.lean.take(a) + BESIDE + ROOM
        return may
