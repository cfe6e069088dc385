"""The least width of a region, and of its gaps, between facing edges.

A width is the length of a segment inside the material that is perpendicular to the edge at both
ends (a reflex corner counts as an edge of length 0). Offsets would miss widths between corners;
these are exact for lines and arcs.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

from sbafab.geometry.cache import cached, stored
from sbafab.geometry.contour import Contour, run_sweep
from sbafab.geometry.edge_table import (
    EdgeTable,
    boxes_round,
    columns_of,
    dot,
    length_of,
    touching,
)
from sbafab.geometry.edges import (
    Arc,
    Edge,
    Line,
    Point,
    box_round,
    left_turn,
    meeting_points,
)
from sbafab.geometry.lazy_numpy import np
from sbafab.geometry.offset import Kerf, Lost, shrink, widths
from sbafab.geometry.region import Region, centroid
from sbafab.geometry.spatial_index import EdgeIndex, widened

if TYPE_CHECKING:
    from sbafab.geometry.edge_table import Bools, Floats, Indices

    Segments = tuple[Floats, Floats]
    Found = tuple[Indices, Floats, Floats]

SHORTER = 1e-9
"""mm by which a segment must be shorter than another to be the narrowest."""
TOUCH = 1e-6
"""mm within which two points are one."""
ASIDE = math.acos(0.9)
"""Radians (25 degrees) by which normals of facing samples may deviate."""
SQUARE = 0.05
"""Like ASIDE, for edges square on each other: an allowance for rounding and parallel edges."""
ALONGSIDE = 1e-3
"""Lines at a smaller angle (radians), or arcs with nearer centres (mm), run alongside."""
BESIDE = 1e-5
"""mm by which an edge may miss another's normals because of rounding."""
FEW = 60
"""Edges that are all compared at once."""
ROOM = 1e-9
"""Exceeds the rounding of the pairwise tests that follow."""
NOTCH = 15.0
"""Degrees: notches sharper than this do not count as slots."""


class Width(NamedTuple):
    """A least distance in mm and its two end points."""

    value: float
    start: Point
    end: Point

    @property
    def middle(self) -> Point:
        return (self.start[0] + self.end[0]) / 2, (self.start[1] + self.end[1]) / 2


@cached
def least_width(region: Region, sharp: float = 90.0, below: float = math.inf) -> Width | None:
    """Return the narrowest place of the material below ``below`` mm; None if no edges face each
    other.
    """
    return least_of(boundary_of(region, sharp), below)


@cached
def least_gap(region: Region, sharp: float = 90.0, below: float = math.inf) -> Width | None:
    """Return the narrowest slot, hole or gap between pieces; arguments as in ``least_width``."""
    outside = [stored(contour, "from_outside", Contour.reversed) for contour in region.contours]
    return least_of(Boundary(outside, sharp), below)


def place_of(region: Region, lost: Lost, kerf: Kerf) -> Point:
    """Return the place where a beam's path loses a contour: the closing slot, or its middle."""
    if lost.fate != "vanishes":
        slot = least_gap(region, NOTCH, max(widths(kerf)))
        if slot is not None:
            return slot.middle
    low_x, low_y, high_x, high_y = lost.contour.bounds
    return (low_x + high_x) / 2, (low_y + high_y) / 2


class Boundary:
    """The edges of contours in arrays, with the material on their left.

    Each edge starts at a corner with directions of travel ``into`` and ``out`` of it, and a
    ``turn``, positive if convex.
    """

    def __init__(self, contours: Sequence[Contour], sharp: float) -> None:
        edges = [edge for contour in contours for edge in contour.edges]
        boxes = [box for contour in contours for box in contour.boxes]
        self.edges, self.index, self.table = (
            edges,
            EdgeIndex(edges, boxes),
            EdgeTable.of(edges, boxes),
        )
        table = self.table
        self.normal = table.normal(table.middle)
        counts = np.array([len(contour.edges) for contour in contours], dtype=np.intp)
        before = np.arange(len(edges)) - 1
        before[counts.cumsum() - counts] = counts.cumsum() - 1
        arriving = table.at(before)
        self.into, self.out = _ahead(arriving, table.start), _ahead(table, table.start)
        turn = np.arctan2(_cross(self.into, self.out), dot(self.into, self.out))
        # At a cusp the curvatures decide the side of the material.
        curved = _curvature(arriving) + _curvature(table)
        cusp = np.where(curved < 0, math.pi, -math.pi)
        self.turn = np.where(np.abs(turn) > math.pi - SMOOTH, cusp, turn)
        self.corners = (np.abs(self.turn) > SMOOTH).nonzero()[0]
        self.ends = [
            ends
            for contour in contours
            for ends in stored(contour, f"ends{sharp}", lambda c: list(tapered_ends(c, sharp)))
        ]
        self.pinch = self._pinch(sharp)

    def _pinch(self, sharp: float) -> Point | None:
        """Return a corner sharper than allowed, or a point where the boundary meets itself."""
        angles = np.degrees(math.pi - self.turn[self.corners])
        for number in self.corners[angles < sharp - ROUNDED].tolist():
            corner: Point = self.edges[number].start
            return corner
        starts: set[Point] = set()
        for edge in self.edges:
            if edge.start in starts:
                return edge.start
            starts.add(edge.start)
        return None

    def pairs(self, aside: float, within: float) -> tuple[Indices, Indices]:
        """Return pairs (a, b) of edges that may face each other within a distance, in order.

        ``aside`` is the angle by which normals may turn. Normals of ``b`` may meet ``a``; a pair
        may occur in both orders.
        """
        table = self.table
        a, b = touching(boxes_round(table.box[:2], table.box[2:], within), table.box)
        room = table.half_turn.take(a) + aside + table.half_turn.take(b)
        facing = dot(self.normal.take(a, axis=1), self.normal.take(b, axis=1))
        off = table.middle.take(a, axis=1) - table.middle.take(b, axis=1)
        missed = np.abs(_cross(off, self.normal.take(b, axis=1)))
        half = np.maximum(
            length_of(table.middle - table.start), length_of(table.middle - table.end)
        )
        lean = np.sin(np.minimum(table.half_turn, math.pi / 2))
        reach = half.take(a) + half.take(b) + within * lean.take(b) + BESIDE
        opposed = (room > math.pi) | (facing < ROOM - np.cos(room))
        chosen = opposed & (missed <= reach) & (a != b)
        return a[chosen], b[chosen]

    def feet(self, p: Floats, numbers: Indices) -> tuple[Floats, Floats, Bools]:
        """Return the points of edges whose normals pass through given points, up to two each, the
        normals into the material there, and which of them exist.
        """
        edges = self.table.at(numbers)
        chord, off = edges.end - edges.start, p - edges.start
        t = dot(chord, off) / dot(chord, chord)
        middle, normal = self.table.middle.take(numbers, axis=1), self.normal.take(numbers, axis=1)
        out = p - edges.centre
        distance = length_of(out)
        central = distance < 1e-12
        unit = out / np.where(central, 1.0, distance)
        least = edges.radius * (np.cos(self.table.half_turn.take(numbers)) - 1e-9)
        ahead = dot(unit, middle - edges.centre)
        line = edges.turn == 0
        feet, normals, there = [], [], []
        for sign in (1.0, -1.0):
            at_middle = central & (sign > 0)
            on_arc = np.where(at_middle, middle, edges.centre + edges.radius * (sign * unit))
            inward = np.where(at_middle, normal, -edges.turn * sign * unit)
            feet.append(np.where(line, edges.start + t * chord, on_arc))
            normals.append(np.where(line, normal, inward))
            is_on_arc = at_middle | (~central & (sign * ahead >= least))
            is_on_line = (t >= -1e-9) & (t <= 1 + 1e-9) & (sign > 0)
            there.append(np.where(line, is_on_line, is_on_arc))
        return np.stack(feet, axis=2), np.stack(normals, axis=2), np.stack(there, axis=1)

    def square(self, within: float) -> Segments:
        """Segments up to a length, perpendicular to edges at both ends or between corners."""
        ahead, count = self.pairs(SQUARE, within), len(self.edges)
        pairs = sorted(set((np.minimum(*ahead) * count + np.maximum(*ahead)).tolist()))
        a, b = np.divmod(np.array(pairs, dtype=np.intp), count)
        point = self.table.start.take(self.corners, axis=1)
        corner, side = touching(boxes_round(point, point, within), self.table.box)
        corner = self.corners.take(corner)
        edges = _in_order(self._alongside(a, b), self._centred(a, b))
        corners = _in_order(self._at_corners(corner, side), self._between_corners(corner, side))
        ends = columns_of([(*p, *q) for p, q in self.ends], 4)
        p, q = joined(edges, corners, (ends[:2], ends[2:]))
        near = length_of(q - p) <= within
        return p[:, near], q[:, near]

    def _centred(self, a: Indices, b: Indices) -> Found:
        """Centre-line segments of a line and an arc, or of two arcs, perpendicular to both."""
        table = self.table
        is_arc = table.turn != 0
        # The first is an arc, if either is.
        a, b = np.where(is_arc.take(b), b, a), np.where(is_arc.take(b), a, b)
        centre, second_centre = table.centre.take(a, axis=1), table.centre.take(b, axis=1)
        both = is_arc.take(b)
        some = is_arc.take(a) & ~(both & (length_of(centre - second_centre) <= 1e-9))
        p, normal, here = self.feet(centre, b)
        target = np.where(both, second_centre, centre + self.normal.take(b, axis=1))
        q, inward, there = self.feet(target, a)
        first, second = [0, 0, 1, 1], [0, 1, 0, 1]
        there = here[:, first] & there[:, second] & some[:, None]
        p, normal, q, inward = (
            p[:, :, first],
            normal[:, :, first],
            q[:, :, second],
            inward[:, :, second],
        )
        return _facing(np.arange(len(a)), p, normal, q, inward, there)

    def _alongside(self, a: Indices, b: Indices) -> Found:
        """Segments from midpoints and ends of edges to parallel lines and concentric arcs."""
        table = self.table
        u, v = self.normal.take(a, axis=1), self.normal.take(b, axis=1)
        parallel = (dot(u, v) < 0) & (np.abs(_cross(u, v)) < ALONGSIDE)
        off = length_of(table.centre.take(a, axis=1) - table.centre.take(b, axis=1))
        arcs = np.abs(table.turn.take(a)) + np.abs(table.turn.take(b))
        pair = np.where(arcs == 0, parallel, (arcs == 2) & (off < ALONGSIDE)).nonzero()[0]
        a, b = a[pair], b[pair]
        near, far = np.concatenate([a, a, a, b, b, b]), np.concatenate([b, b, b, a, a, a])
        ends = table.middle, table.start, table.end
        p = np.concatenate([each.take(some, axis=1) for some in (a, b) for each in ends], axis=1)
        normal = table.at(near).normal(p)
        q, inward, there = self.feet(p, far)
        return _facing(np.tile(pair, 6), p[:, :, None], normal[:, :, None], q, inward, there)

    def _at_corners(self, corner: Indices, side: Indices) -> Found:
        """Return segments from corners to edges."""
        starts = self.table.start
        turn, p = self.turn.take(corner), starts.take(corner, axis=1)
        reflex = turn < 0
        # An edge facing a convex corner may be square on neither of its edges.
        room = self.table.half_turn.take(side) + np.abs(turn) / 2
        room += np.where(reflex, SQUARE, math.pi / 2)
        u, v = _left(self.into.take(corner, axis=1)), _left(self.out.take(corner, axis=1))
        c, s = np.cos(turn / 2), np.sin(turn / 2)
        halfway = np.array([u[0] * c - u[1] * s, u[0] * s + u[1] * c])
        facing = dot(halfway, self.normal.take(side, axis=1))
        may_face = (room > math.pi) | (facing < -np.cos(room))
        q, inward, there = self.feet(p, side)
        p, u, v = p[:, :, None], u[:, :, None], v[:, :, None]
        d, ends = q - p, self.table.at(side)
        clear = np.minimum(
            length_of(q - ends.start[:, :, None]), length_of(q - ends.end[:, :, None])
        )
        beside = (dot(u, inward) < 0) & (dot(u, d) > 0) | (dot(v, inward) < 0) & (dot(v, d) > 0)
        convex = (clear > 10 * TOUCH) & beside
        fits = np.where(reflex[:, None], self._squarely(corner, d), convex)
        some = there & may_face[:, None] & (dot(d, inward) <= -TOUCH) & fits
        return some.nonzero()[0], np.broadcast_to(p, q.shape)[:, some], q[:, some]

    def _between_corners(self, corner: Indices, side: Indices) -> Found:
        """Segments between reflex corners, which may face each other although no edges do."""
        turn = np.maximum(self.turn.take(corner), self.turn.take(side))
        pair = ((side > corner) & (turn < -SMOOTH)).nonzero()[0]
        corner, side = corner[pair], side[pair]
        p, q = (self.table.start.take(numbers, axis=1) for numbers in (corner, side))
        both = self._squarely(corner, q - p) & self._squarely(side, p - q)
        return pair[both], p[:, both], q[:, both]

    def _squarely(self, corner: Indices, d: Floats) -> Bools:
        """Return True if a reflex corner is nearer than its neighbourhood to the end of ``d``."""
        shape = (2, len(corner)) + (1,) * (d.ndim - 2)
        into, out = (ways.take(corner, axis=1).reshape(shape) for ways in (self.into, self.out))
        room = 1e-9 * length_of(d)
        squarely: Bools = (dot(d, into) >= -room) & (dot(d, out) <= room)
        return squarely

    def is_clear(self, p: Point, q: Point) -> bool:
        """Return True if no edge crosses a segment."""
        segment = Line(p, q)
        for edge in self.index.touching(widened(segment.bounds, 10 * TOUCH)):
            for m in meeting_points(segment, edge):
                if math.dist(m, p) > 10 * TOUCH and math.dist(m, q) > 10 * TOUCH:
                    return False
        return True


def joined(*segments: Segments) -> Segments:
    p, q = (np.concatenate(ends, axis=1) for ends in zip(*segments, strict=True))
    return p, q


def _in_order(*parts: Found) -> Segments:
    """Return segments of several kinds, ordered by the numbers of their pairs."""
    pair = np.concatenate([numbers for numbers, _, _ in parts])
    p, q = joined(*((p, q) for _, p, q in parts))
    order = pair.argsort(kind="stable")
    return p.take(order, axis=1), q.take(order, axis=1)


def _facing(
    pair: Indices, p: Floats, normal: Floats, q: Floats, inward: Floats, there: Bools
) -> Found:
    """The segments that lie in the material at both ends, each with the number of its pair."""
    d = q - p
    some = there & (dot(d, normal) > TOUCH) & (dot(d, inward) < -TOUCH)
    return pair[some.nonzero()[0]], np.broadcast_to(p, d.shape)[:, some], q[:, some]


def _ahead(edges: EdgeTable, p: Floats) -> Floats:
    """Return the directions of travel at points of edges."""
    x, y = edges.normal(p)
    return np.array([y, -x])


def _left(u: Floats) -> Floats:
    return np.array([-u[1], u[0]])


def _cross(a: Floats, b: Floats) -> Floats:
    product: Floats = a[0] * b[1] - a[1] * b[0]
    return product


def _curvature(edges: EdgeTable) -> Floats:
    bend: Floats = edges.turn / np.where(edges.turn == 0, 1.0, edges.radius)
    return bend


@partial(cached, most=16)
def boundary_of(region: Region, sharp: float) -> Boundary:
    return Boundary(region.contours, sharp)


def least_of(boundary: Boundary, below: float) -> Width | None:
    if boundary.pinch is not None:
        return Width(0.0, boundary.pinch, boundary.pinch)
    if not boundary.edges:
        return None
    # Most of many edges lie far apart: search far pairs only if no near ones face.
    low_x, low_y, high_x, high_y = box_round([edge.bounds for edge in boundary.edges])
    across = max(high_x - low_x, high_y - low_y)
    farthest, count = min(below, 2 * across), len(boundary.edges)
    reach = farthest if count <= FEW else across / math.sqrt(count)
    while True:
        within = min(reach, farthest)
        p, q = boundary.square(within)
        value = length_of(q - p)
        # Of equal ones the first, however their lengths are rounded.
        for place in np.rint(value / SHORTER).argsort(kind="stable").tolist():
            (px, py), (qx, qy) = p[:, place].tolist(), q[:, place].tolist()
            length = math.dist((px, py), (qx, qy))
            if length < within - SHORTER and boundary.is_clear((px, py), (qx, qy)):
                return Width(length, (px, py), (qx, qy))
        if reach >= farthest:
            return None
        reach *= 4


# Ends of tapered arms: narrow, although no segment is square on both sides there.
#
# An end lies between two converging flanks: a rounded corner, or an edge between two bends, each a
# corner or its fillet. Its width is the distance between the ends of its flanks.


SMOOTH = 1e-4
"""Radians: smaller turns do not count as corners."""
TAPER = 30.0
"""Degrees: flanks at a wider angle form a corner, not an arm."""
LEAST_TURN = math.pi - math.radians(TAPER + 1)
ROUNDED = 0.1
"""Degrees a corner may miss its angle by: coordinates read from a file are rounded."""


class _Run(NamedTuple):
    """Consecutive edges on one line or circle, and their turn (radians, left positive)."""

    first: Edge
    last: Edge
    sweep: float

    @property
    def radius(self) -> float:
        return self.first.radius if isinstance(self.first, Arc) else math.inf

    def corner(self, after: _Run) -> float:
        """Return the turn of the path from this run to the next."""
        return left_turn(self.last, after.first)

    def is_fillet(self, bottom: _Run) -> bool:
        """Return True if it rounds a corner of the adjacent run, which turns less tightly."""
        return self.sweep > 0 and (bottom.sweep <= 0 or self.radius < bottom.radius)


def tapered_ends(contour: Contour, sharp: float) -> Iterator[tuple[Point, Point]]:
    """Yield the flank ends of every tapered end of a contour with the material on its left.

    A rounded corner is tapered if the sharp corner would have less than ``sharp`` degrees.
    """
    runs = [_Run(edges[0], edges[-1], run_sweep(edges)) for edges in contour.runs]
    corners = [runs[i - 1].corner(run) for i, run in enumerate(runs)]
    # Skip if the path cannot turn far enough from the run before to the one after.
    most = [abs(run.sweep) + abs(corner) for run, corner in zip(runs, corners, strict=True)]
    ahead = [*range(1, len(runs)), 0]
    for i, run in enumerate(runs):
        turns = most[i - 1] + most[i] + most[ahead[i]] + abs(corners[ahead[ahead[i]]])
        if turns < LEAST_TURN:
            continue
        before, after = runs[i - 1], runs[(i + 1) % len(runs)]
        into, out = corners[i], corners[(i + 1) % len(runs)]
        # A round end that turns further is wider than its flanks are apart.
        if abs(into) < SMOOTH and abs(out) < SMOOTH and run.sweep < math.pi + SMOOTH:
            yield from _between_flanks(runs, corners, i, i, min(TAPER, sharp) - ROUNDED)
        start = i - 1 if abs(into) < SMOOTH and before.is_fillet(run) else i
        stop = i + 1 if abs(out) < SMOOTH and after.is_fillet(run) else i
        if (start < i or into > SMOOTH) and (stop > i or out > SMOOTH):
            yield from _between_flanks(runs, corners, start, stop, TAPER - ROUNDED)


def _between_flanks(
    runs: Sequence[_Run], corners: Sequence[float], start: int, stop: int, taper: float
) -> Iterator[tuple[Point, Point]]:
    """Yield the ends of the path along runs ``start`` to ``stop``, if it turns back between flanks.

    ``corners`` are the turns into each run.
    """
    if stop - start + 3 > len(runs):
        return
    count = len(runs)
    turn: float = sum([runs[i % count].sweep for i in range(start, stop + 1)])
    turn += sum([corners[i % count] for i in range(start, stop + 2)])
    if abs(turn - math.pi) < math.radians(taper):
        yield runs[start % len(runs)].first.start, runs[stop % len(runs)].last.end


# The widest place of a region.


class InscribedDisc(NamedTuple):
    """The largest disc within a region: its radius in mm and centre."""

    radius: float
    centre: Point


@cached
def inscribed_disc(region: Region) -> InscribedDisc:
    """Return the largest disc in a non-empty region: exact for a circle, else within 1e-4 of its
    radius.

    It is computed from the centre of the region's last non-empty offset.
    """
    if len(region.edges) > MANY_EDGES:
        # Offsets of many edges that meet near one point take minutes: a disc in 75 chords 38 s.
        centre = region.widest_place()
        return InscribedDisc(region.distance_to_edge(centre), centre)
    circles = [None if region.holes else outer.circle for outer in region.outers]
    widest = max((c for c in circles if c), key=lambda c: c[1], default=((0.0, 0.0), 0.0))
    low, high, core = widest[1], 0.0, Region()
    for outer, circle in zip(region.outers, circles, strict=True):
        x, y, u, v = outer.bounds
        high = max(high, 0.0 if circle else min(u - x, v - y) / 2)
    while high > low * (1 + DISC_SHARE):
        middle = (low + high) / 2
        shrunk = shrink(region, middle)
        low, high, core = (low, middle, core) if shrunk.is_empty else (middle, high, shrunk)
    if core.is_empty:
        return InscribedDisc(widest[1], widest[0])
    centre = centroid(max(core.pieces, key=lambda piece: piece.area))
    if not region.contains(centre) or region.distance_to_edge(centre) < low:
        centre = core.contours[0].edges[0].at(0.5)  # The remaining core may surround a hole.
    return InscribedDisc(max(low, region.distance_to_edge(centre)), centre)


DISC_SHARE = 1e-4
"""Relative accuracy of an inscribed disc's radius."""
MANY_EDGES = 40
"""Most edges of a pocket that is drawn with few lines and arcs."""
