"""The types of arrays that geometry and rules are worked out in; only checks of types read this."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import chain
from operator import mul
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sbafab.geometry.edges import EPSILON, Arc, Bounds, Edge, Line, Point, left_normal

ALONGSIDE = 1e-3
"""Lines at a smaller angle (radians), or arcs with nearer centres (mm), run alongside."""

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]
Bools = NDArray[np.bool_]


# Edges in arrays, a column each, for what is asked of many places at once.


FEW = 20_000
"""Pairs of boxes up to which all are compared at once."""
TOGETHER = 64
"""Boxes that are compared together with those about them, where there are more."""


def dot(a: Floats, b: Floats) -> Floats:
    """The products of vectors with a row a coordinate."""
    found: Floats = a[0] * b[0] + a[1] * b[1]
    return found


def columns_of(rows: Iterable[Iterable[float]], width: int) -> Floats:
    """Rows of so many numbers as columns; one by one is sooner than ``np.array``."""
    return np.fromiter(chain.from_iterable(rows), dtype=float).reshape(-1, width).T


class EdgeTable:
    """Points and boxes have a row a coordinate; the centre of a line is its start.

    ``turn`` is 1 for an arc that runs counter-clockwise, -1 for one that runs clockwise, 0 for a
    line. All of it is rows of ``columns``, a column each.
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
        """``boxes``: the bounds of the edges, where they are known."""
        known = boxes if boxes is not None else [edge.bounds for edge in edges]
        rows = [
            (*e.start, *e.end, *e.centre, e.radius, 1.0 if e.ccw else -1.0, *box)
            if isinstance(e, Arc)
            else (*e.start, *e.end, *e.start, 0.0, 0.0, *box)
            for e, box in zip(edges, known, strict=True)
        ]
        return EdgeTable(columns_of(rows, 12).copy())

    @staticmethod
    def joined(tables: Sequence[EdgeTable]) -> EdgeTable:
        return EdgeTable(np.concatenate([table.columns for table in tables], axis=1))

    def at(self, numbers: Indices) -> EdgeTable:
        """The edges with these numbers, in their order."""
        return EdgeTable(self.columns.take(numbers, axis=1))

    def normal(self, p: Floats) -> Floats:
        """Unit normals to the left of travel, each edge's at its own point."""
        chord = self.end - self.start
        out = p - self.centre
        x = np.where(self.turn == 0, -chord[1], -self.turn * out[0])
        y = np.where(self.turn == 0, chord[0], -self.turn * out[1])
        length = np.sqrt(x * x + y * y)
        length[length == 0] = 1.0
        return np.array([x / length, y / length])

    def faces(self, p: Floats, room: float = 0.0) -> Bools:
        """Whether each arc, seen from its centre, has its own point before it.

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
        found: Floats = np.where(self.turn == 0, to_line, to_arc)
        return found


class CellOrder:
    """In which order an ``EdgeIndex`` of the same edges tells of those that a box touches.

    ``parts`` are the numbers of edges in each of several indices, one after the other.
    """

    def __init__(self, box: Floats, parts: Sequence[int]) -> None:
        count = np.array([own for own in parts if own])
        begins = count.cumsum() - count
        low = np.minimum.reduceat(box[:2], begins, axis=1)
        high = np.maximum.reduceat(box[2:], begins, axis=1)
        cell = (high - low).max(axis=0) / np.sqrt(count)
        self.low = low.repeat(count, axis=1)
        self.cell = np.where(cell == 0, 1.0, cell).repeat(count)
        self.own: Floats = np.floor((box[:2] - self.low) / self.cell)

    def sorted(self, asked: Floats, places: Indices, edges: Indices) -> Indices:
        """Which of the pairs of places and edges comes when; ``asked`` are the places' boxes."""
        corner = asked[:2].take(places, axis=1) - self.low.take(edges, axis=1)
        cells = np.floor(corner / self.cell.take(edges))
        first = np.maximum(cells, self.own.take(edges, axis=1))
        return np.lexsort((edges, first[1], first[0], places))


def touching(asked: Floats, boxes: Floats) -> tuple[Indices, Indices]:
    """Numbers of the boxes asked for and of those that each of them touches, in order."""
    if asked.shape[1] * boxes.shape[1] <= FEW:
        return _touching(asked, boxes)
    found = []
    # Boxes asked for one after the other mostly lie side by side.
    for first in range(0, asked.shape[1], TOGETHER):
        some = asked[:, first : first + TOGETHER]
        near = np.flatnonzero(
            (boxes[0] <= some[2].max())
            & (boxes[2] >= some[0].min())
            & (boxes[1] <= some[3].max())
            & (boxes[3] >= some[1].min())
        )
        own, other = _touching(some, boxes[:, near])
        found.append((own + first, near[other]))
    return tuple(np.concatenate(one) for one in zip(*found, strict=True))  # type: ignore[return-value]


def touching_in_parts(
    asked: Floats, parts: Sequence[int], boxes: Floats, box_parts: Sequence[int]
) -> tuple[Indices, Indices]:
    """The same for so many boxes at a time, each part with its own boxes alone."""
    if len(parts) > 1 and sum(map(mul, parts, box_parts)) <= FEW:
        return _touching_in_parts(asked, parts, boxes, box_parts)
    found = []
    first = box_first = 0
    for count, box_count in zip(parts, box_parts, strict=True):
        last, box_last = first + count, box_first + box_count
        own, other = touching(asked[:, first:last], boxes[:, box_first:box_last])
        found.append((own + first, other + box_first))
        first, box_first = last, box_last
    if len(found) == 1:
        return found[0]
    own, other = (np.concatenate(one) for one in zip(*found, strict=True))
    return own, other


def _touching_in_parts(
    asked: Floats, parts: Sequence[int], boxes: Floats, box_parts: Sequence[int]
) -> tuple[Indices, Indices]:
    """The same, all pairs of all parts one after the other."""
    each = np.array(box_parts)
    begins = (each.cumsum() - each).repeat(parts)
    each = each.repeat(parts)
    own = np.arange(len(each)).repeat(each)
    other = np.arange(len(own)) - (each.cumsum() - each - begins).repeat(each)
    # Side by side most are left out, so that few are compared in height.
    for low, high in ((0, 2), (1, 3)):
        meets = boxes[low].take(other) <= asked[high].take(own)
        meets &= boxes[high].take(other) >= asked[low].take(own)
        (met,) = meets.nonzero()
        own, other = own.take(met), other.take(met)
    return own, other


def _touching(asked: Floats, boxes: Floats) -> tuple[Indices, Indices]:
    """The same, every box with every other."""
    one = asked[:, :, None]
    meets = boxes[0] <= one[2]
    meets &= boxes[2] >= one[0]
    meets &= boxes[1] <= one[3]
    meets &= boxes[3] >= one[1]
    # Of a flat array the few that are true are found sooner.
    own, other = np.divmod(meets.ravel().nonzero()[0], boxes.shape[1] or 1)
    return own, other


def boxes_round(p: Floats, q: Floats, margin: float) -> Floats:
    """Boxes of the segments from ``p`` to ``q``, with ``margin`` on every side."""
    return np.concatenate([np.minimum(p, q) - margin, np.maximum(p, q) + margin])


def crossings(
    origin: Floats, unit: Floats, edges: EdgeTable, tolerance: float = EPSILON
) -> tuple[Floats, Bools]:
    """Distances along straight lines at which each meets the line or circle of its own edge.

    Up to three each (the foot where it touches, and two), with which of them there are.
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
    found = np.array([np.where(straight, t, along), along - half, along + half])
    there = np.array([np.where(straight, ~parallel, touches), both & ~straight, both & ~straight])
    return found, there


# An edge of a boundary, with what a search for places that face each other asks of it.


BESIDE = 1e-5
"""mm that an edge may miss another's normals by, for rounding."""


class Foot(NamedTuple):
    """A point of an edge, and the unit normal into the material there."""

    point: Point
    normal: Point


class BoundarySide:
    """An edge with what the search asks of it again and again.

    ``half`` is how far its ends lie from its middle, ``lean`` the sine of its half turn.
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

    def may_hold_feet(self, other: BoundarySide, within: float) -> bool:
        """Whether a normal of this edge may meet the other no farther off than ``within``."""
        x, y = self.middle
        nx, ny = self.normal
        aside = abs((other.middle[0] - x) * ny - (other.middle[1] - y) * nx)
        return aside <= self.half + other.half + within * self.lean + BESIDE

    def feet(self, p: Point) -> list[Foot]:
        """Points of the edge where its normal passes through ``p``."""
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
        found = []
        for sign in (1.0, -1.0):
            vx, vy = sign * ux / distance, sign * uy / distance
            if vx * mx + vy * my >= least:
                found.append(Foot((cx + r * vx, cy + r * vy), (inward * vx, inward * vy)))
        return found


# The sides of a boundary in arrays: which of them may face each other is asked of all at once.


ROOM = 1e-9
"""More than the rounding of what is asked once more of each pair."""


class SideTable:
    """What the search knows of the sides of a boundary, or of several one after the other.

    ``parts`` are the numbers of sides in each boundary; none faces a side of another.
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
        """Sides and those that their normals may meet no farther off, as ``near`` tells them.

        ``within`` is so many mm for each side.
        """
        asked, a, b = self._near(within)
        far = within.take(a)
        chosen = self._opposed(a, b, aside) & self._may_hold_feet(b, a, far) & (a != b)
        a, b = a[chosen], b[chosen]
        faces = self._may_face(a, b, within.take(a))
        a, b = a[faces], b[faces]
        order = CellOrder(self.table.box, self.parts).sorted(asked, a, b)
        return a.take(order), b.take(order)

    def later(self, aside: float, within: float) -> list[list[int]]:
        """For each side the later ones that it may face square no farther off, and few others."""
        _, a, b = self._near(within)
        a, b = a[a < b], b[a < b]
        opposed = self._opposed(a, b, aside)
        a, b = a[opposed], b[opposed]
        feet = self._may_hold_feet(a, b, within) | self._may_hold_feet(b, a, within)
        found: list[list[int]] = [[] for _ in self.edges]
        for one, other in zip(a[feet].tolist(), b[feet].tolist(), strict=True):
            found[one].append(other)
        return found

    def _near(self, within: float | Floats) -> tuple[Floats, Indices, Indices]:
        """The boxes of sides widened by ``within``, and the sides whose boxes these touch."""
        asked, box = self.table.box.copy(), self.table.box
        asked[:2] -= within
        asked[2:] += within
        return asked, *touching_in_parts(asked, self.parts, box, self.parts)

    def _opposed(self, a: Indices, b: Indices, aside: float) -> Bools:
        """Whether their normals are opposed somewhere, to within ``aside`` radians."""
        room = self.half_turn.take(a) + aside + self.half_turn.take(b)
        facing = dot(self.normal.take(a, axis=1), self.normal.take(b, axis=1))
        opposed = facing < ROOM - np.cos(room)
        found: Bools = opposed | (room > math.pi)
        return found

    def _may_face(self, a: Indices, b: Indices, within: Floats) -> Bools:
        """Whether they may face each other no farther off, as ``width._may_face`` tells of arcs of
        nearly one centre that both have the material inside, or both outside.
        """
        table = self.table
        off = table.centre.take(a, axis=1) - table.centre.take(b, axis=1)
        turn, r, s = table.turn.take(a), table.radius.take(a), table.radius.take(b)
        alike = (np.hypot(off[0], off[1]) < ALONGSIDE) & (turn == table.turn.take(b)) & (turn != 0)
        alike &= np.minimum(r, s) >= 10 * ALONGSIDE
        across = (turn > 0) & (r + s <= within + 2 * ALONGSIDE)
        found: Bools = ~alike | across
        return found

    def _may_hold_feet(self, a: Indices, b: Indices, within: float | Floats) -> Bools:
        """Whether normals of sides ``a`` may meet sides ``b`` no farther off than ``within``."""
        off, normal = (
            self.middle.take(b, axis=1) - self.middle.take(a, axis=1),
            self.normal.take(a, axis=1),
        )
        missed = np.abs(off[0] * normal[1] - off[1] * normal[0])
        half = self.half.take(a) + self.half.take(b)
        may: Bools = missed <= half + within * self.lean.take(a) + BESIDE + ROOM
        return may
