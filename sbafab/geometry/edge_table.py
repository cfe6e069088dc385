"""Edges and sides of boundaries in NumPy arrays, for searches over many places at once."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import chain
from operator import mul
from typing import TYPE_CHECKING

from sbafab.geometry.edges import EPSILON, Arc, Bounds, Edge
from sbafab.geometry.nearby import ALONGSIDE, BESIDE, BoundarySide
from sbafab.geometry.on_demand import np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Indices = NDArray[np.intp]
    Bools = NDArray[np.bool_]


FEW = 20_000
"""Pairs of boxes up to which all are compared at once."""
TOGETHER = 64
"""Size of the batches in which more boxes are compared."""


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


class CellOrder:
    """The order in which an ``EdgeIndex`` of the same edges returns the edges that a box touches.

    ``parts`` are the numbers of edges in each of several indices, one after the other.
    """

    def __init__(self, box: Floats, parts: Sequence[int]) -> None:
        count = np.array([part for part in parts if part])
        begins = count.cumsum() - count
        low = np.minimum.reduceat(box[:2], begins, axis=1)
        high = np.maximum.reduceat(box[2:], begins, axis=1)
        cell = (high - low).max(axis=0) / np.sqrt(count)
        self.low = low.repeat(count, axis=1)
        self.cell = np.where(cell == 0, 1.0, cell).repeat(count)
        self.own: Floats = np.floor((box[:2] - self.low) / self.cell)

    def sorted(self, queries: Floats, places: Indices, edges: Indices) -> Indices:
        """Return the order of pairs of places and edges; ``queries`` are the places' boxes."""
        corner = queries[:2].take(places, axis=1) - self.low.take(edges, axis=1)
        cells = np.floor(corner / self.cell.take(edges))
        first = np.maximum(cells, self.own.take(edges, axis=1))
        return np.lexsort((edges, first[1], first[0], places))


def touching(queries: Floats, boxes: Floats) -> tuple[Indices, Indices]:
    """Return pairs of numbers (query, box) of all boxes that meet each query, in order."""
    if queries.shape[1] * boxes.shape[1] <= FEW:
        return _touching(queries, boxes)
    pairs = []
    # Consecutive boxes are usually neighbours.
    for first in range(0, queries.shape[1], TOGETHER):
        batch = queries[:, first : first + TOGETHER]
        near = np.flatnonzero(
            (boxes[0] <= batch[2].max())
            & (boxes[2] >= batch[0].min())
            & (boxes[1] <= batch[3].max())
            & (boxes[3] >= batch[1].min())
        )
        query, box = _touching(batch, boxes[:, near])
        pairs.append((query + first, near[box]))
    return tuple(np.concatenate(numbers) for numbers in zip(*pairs, strict=True))  # type: ignore[return-value]


def touching_in_parts(
    queries: Floats, parts: Sequence[int], boxes: Floats, box_parts: Sequence[int]
) -> tuple[Indices, Indices]:
    """Return these pairs, comparing each part of the queries with its own boxes only."""
    if len(parts) > 1 and sum(map(mul, parts, box_parts)) <= FEW:
        return _touching_in_parts(queries, parts, boxes, box_parts)
    pairs = []
    first = box_first = 0
    for count, box_count in zip(parts, box_parts, strict=True):
        last, box_last = first + count, box_first + box_count
        query, box = touching(queries[:, first:last], boxes[:, box_first:box_last])
        pairs.append((query + first, box + box_first))
        first, box_first = last, box_last
    if len(pairs) == 1:
        return pairs[0]
    query, box = (np.concatenate(numbers) for numbers in zip(*pairs, strict=True))
    return query, box


def _touching_in_parts(
    queries: Floats, parts: Sequence[int], boxes: Floats, box_parts: Sequence[int]
) -> tuple[Indices, Indices]:
    """Return these pairs, comparing all pairs of all parts in one array."""
    each = np.array(box_parts)
    begins = (each.cumsum() - each).repeat(parts)
    each = each.repeat(parts)
    query = np.arange(len(each)).repeat(each)
    box = np.arange(len(query)) - (each.cumsum() - each - begins).repeat(each)
    # The test along x rules out most pairs, so few are compared along y.
    for low, high in ((0, 2), (1, 3)):
        meets = boxes[low].take(box) <= queries[high].take(query)
        meets &= boxes[high].take(box) >= queries[low].take(query)
        (met,) = meets.nonzero()
        query, box = query.take(met), box.take(met)
    return query, box


def _touching(queries: Floats, boxes: Floats) -> tuple[Indices, Indices]:
    """Return these pairs, comparing every query with every box."""
    sides = queries[:, :, None]
    meets = boxes[0] <= sides[2]
    meets &= boxes[2] >= sides[0]
    meets &= boxes[1] <= sides[3]
    meets &= boxes[3] >= sides[1]
    # The few True values are found faster in a flat array.
    query, box = np.divmod(meets.ravel().nonzero()[0], boxes.shape[1] or 1)
    return query, box


def boxes_round(p: Floats, q: Floats, margin: float) -> Floats:
    """Return boxes of the segments from ``p`` to ``q``, with ``margin`` on every side."""
    return np.concatenate([np.minimum(p, q) - margin, np.maximum(p, q) + margin])


def crossings(
    origin: Floats, unit: Floats, edges: EdgeTable, tolerance: float = EPSILON
) -> tuple[Floats, Bools]:
    """Return distances along straight lines to where each meets the line or circle of its own edge.

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


ROOM = 1e-9
"""Exceeds the rounding of the pairwise tests that follow."""


class SideTable:
    """The sides of one boundary, or of several one after the other, in arrays.

    ``parts`` are the numbers of sides in each boundary; sides of different boundaries never face.
    """

    def __init__(self, sides: Sequence[BoundarySide], parts: Sequence[int] = ()) -> None:
        self.parts = parts or [len(sides)]
        self.edges = [side.edge for side in sides]
        self.table = EdgeTable.of(self.edges, [side.box for side in sides])
        rows = [
            (*side.middle, *side.normal, side.half_turn, side.half, side.lean) for side in sides
        ]
        columns = columns_of(rows, 7)
        self.middle, self.normal = columns[0:2], columns[2:4]
        self.half_turn, self.half, self.lean = columns[4:7]

    def pairs(self, aside: float, within: Floats) -> tuple[Indices, Indices]:
        """Pairs of sides that face each other within a distance, in the order of an ``EdgeIndex``.

        ``within`` is that distance for each side, mm; ``aside`` the angle that normals may turn by.
        """
        boxes, a, b = self._near(within)
        far = within.take(a)
        chosen = self._opposed(a, b, aside) & self._may_hold_feet(b, a, far) & (a != b)
        a, b = a[chosen], b[chosen]
        faces = self._may_face(a, b, within.take(a))
        a, b = a[faces], b[faces]
        order = CellOrder(self.table.box, self.parts).sorted(boxes, a, b)
        return a.take(order), b.take(order)

    def later(self, aside: float, within: float) -> list[list[int]]:
        """For each side, the later ones that it may face within a distance (a slight superset)."""
        _, a, b = self._near(within)
        a, b = a[a < b], b[a < b]
        opposed = self._opposed(a, b, aside)
        a, b = a[opposed], b[opposed]
        feet = self._may_hold_feet(a, b, within) | self._may_hold_feet(b, a, within)
        later: list[list[int]] = [[] for _ in self.edges]
        for side, facing in zip(a[feet].tolist(), b[feet].tolist(), strict=True):
            later[side].append(facing)
        return later

    def _near(self, within: float | Floats) -> tuple[Floats, Indices, Indices]:
        """Return the boxes of sides widened by ``within``, and pairs of sides whose boxes meet."""
        boxes, box = self.table.box.copy(), self.table.box
        boxes[:2] -= within
        boxes[2:] += within
        return boxes, *touching_in_parts(boxes, self.parts, box, self.parts)

    def _opposed(self, a: Indices, b: Indices, aside: float) -> Bools:
        """Return True for pairs with normals opposed somewhere, to within ``aside`` radians."""
        room = self.half_turn.take(a) + aside + self.half_turn.take(b)
        facing = dot(self.normal.take(a, axis=1), self.normal.take(b, axis=1))
        opposed = facing < ROOM - np.cos(room)
        may_face: Bools = opposed | (room > math.pi)
        return may_face

    def _may_face(self, a: Indices, b: Indices, within: Floats) -> Bools:
        """False for concentric arcs of one direction that lie too far off to face each other.

        The same test as ``width._may_face`` for arcs with the material on the same side.
        """
        table = self.table
        off = table.centre.take(a, axis=1) - table.centre.take(b, axis=1)
        turn, r, s = table.turn.take(a), table.radius.take(a), table.radius.take(b)
        concentric = (
            (np.hypot(off[0], off[1]) < ALONGSIDE) & (turn == table.turn.take(b)) & (turn != 0)
        )
        concentric &= np.minimum(r, s) >= 10 * ALONGSIDE
        across = (turn > 0) & (r + s <= within + 2 * ALONGSIDE)
        may_face: Bools = ~concentric | across
        return may_face

    def _may_hold_feet(self, a: Indices, b: Indices, within: float | Floats) -> Bools:
        """True for pairs where normals of sides ``a`` may meet sides ``b`` within a distance."""
        off, normal = (
            self.middle.take(b, axis=1) - self.middle.take(a, axis=1),
            self.normal.take(a, axis=1),
        )
        missed = np.abs(off[0] * normal[1] - off[1] * normal[0])
        half = self.half.take(a) + self.half.take(b)
        may: Bools = missed <= half + within * self.lean.take(a) + BESIDE + ROOM
        return may
