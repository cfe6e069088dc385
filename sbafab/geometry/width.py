"""The least width of a region, and of the gaps in it, between edges that face each other.

A width is the length of a segment inside the material that is square on the edge at both ends (a
reflex corner counts as an edge shrunk to a point). Offsets would miss widths between corners;
these are exact for lines and arcs.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property, partial
from typing import NamedTuple

from sbafab.geometry.cache import cached, stored
from sbafab.geometry.contour import Contour, run_sweep
from sbafab.geometry.edge_table import ALONGSIDE, BoundarySide, Foot, SideTable
from sbafab.geometry.edges import (
    Arc,
    Bounds,
    Edge,
    Line,
    Point,
    box_round,
    left_normal,
    left_turn,
    meeting_points,
)
from sbafab.geometry.lazy_numpy import np
from sbafab.geometry.offset import Kerf, Lost, shrink, widths
from sbafab.geometry.region import Region, centroid
from sbafab.geometry.spatial_index import EdgeIndex, widened

SHORTER = 1e-9
"""mm by which a segment must be shorter than another to be the narrowest."""
TOUCH = 1e-6
"""mm within which two points are one."""
ASIDE = math.acos(0.9)
"""Radians (25 degrees) by which normals of facing samples may deviate."""
SQUARE = 0.05
"""Like ASIDE, for edges square on each other: an allowance for rounding and parallel edges."""
NOTCH = 15.0
"""Degrees: notches sharper than this do not count as slots."""


class Width(NamedTuple):
    """A least distance in mm and the two facing points it lies between."""

    value: float
    start: Point
    end: Point

    @property
    def middle(self) -> Point:
        return (self.start[0] + self.end[0]) / 2, (self.start[1] + self.end[1]) / 2


@cached
def least_width(region: Region, sharp: float = 90.0, below: float = math.inf) -> Width | None:
    """Return the narrowest place of the material below ``below`` mm; None if no edge faces another.

    A corner with an interior angle below ``sharp`` degrees has width 0.
    """
    return least_of(boundary_of(region, sharp), below)


@cached
def least_gap(region: Region, sharp: float = 90.0, below: float = math.inf) -> Width | None:
    """Return the narrowest slot, hole or gap between pieces; arguments as in ``least_width``."""
    outside = [stored(contour, "from_outside", Contour.reversed) for contour in region.contours]
    return least_of(Boundary(outside, sharp), below)


def place_of(region: Region, lost: Lost, kerf: Kerf) -> Point:
    """Return the place at which a beam's path loses a contour: the closing slot, or its middle."""
    if lost.fate != "vanishes":
        slot = least_gap(region, NOTCH, max(widths(kerf)))
        if slot is not None:
            return slot.middle
    low_x, low_y, high_x, high_y = lost.contour.bounds
    return (low_x + high_x) / 2, (low_y + high_y) / 2


class Boundary:
    """Contours with the material on their left, prepared for the search."""

    def __init__(self, contours: Sequence[Contour], sharp: float) -> None:
        self.sides = [side for contour in contours for side in stored(contour, "sides", _sides)]
        self.corners = [
            corner for contour in contours for corner in stored(contour, "corners", _corners)
        ]
        """The corner that each side starts at, if any."""
        self.ends = [
            ends
            for contour in contours
            for ends in stored(contour, f"ends{sharp}", lambda c: list(tapered_ends(c, sharp)))
        ]
        self.pinch = pinch(contours, self.corners, sharp)
        self.index = EdgeIndex(
            [side.edge for side in self.sides], [side.box for side in self.sides]
        )

    @cached_property
    def table(self) -> SideTable:
        """The sides in arrays."""
        return SideTable(self.sides)


@partial(cached, most=16)
def boundary_of(region: Region, sharp: float) -> Boundary:
    return Boundary(region.contours, sharp)


class _Narrowest:
    """The shortest segment offered, if below a length, that no edge crosses."""

    def __init__(self, boundary: Boundary, below: float) -> None:
        self.boundary = boundary
        self.best: Width | None = None
        self.value = below

    def offer(self, p: Point, q: Point) -> None:
        value = math.dist(p, q)
        if value < self.value - SHORTER and self.is_clear(p, q):
            self.value, self.best = value, Width(value, p, q)

    def offer_facing(self, a: Foot, b: Foot) -> None:
        px, py = a.point
        nx, ny = a.normal
        qx, qy = b.point
        mx, my = b.normal
        dx, dy = qx - px, qy - py
        if dx * nx + dy * ny > TOUCH and dx * mx + dy * my < -TOUCH:
            self.offer((px, py), (qx, qy))

    def is_clear(self, p: Point, q: Point) -> bool:
        segment = Line(p, q)
        box = segment.bounds
        for edge in self.boundary.index.touching(widened(box, 10 * TOUCH)):
            for m in meeting_points(segment, edge):
                if math.dist(m, p) > 10 * TOUCH and math.dist(m, q) > 10 * TOUCH:
                    return False
        return True


class Gathered(_Narrowest):
    """The ends of every segment offered that is short enough, crossed by edges or not."""

    def __init__(self, boundary: Boundary, below: float) -> None:
        super().__init__(boundary, below)
        self.offered: list[tuple[Point, Point]] = []

    def offer(self, p: Point, q: Point) -> None:
        if math.dist(p, q) <= self.value:
            self.offered.append((p, q))


def least_of(boundary: Boundary, below: float) -> Width | None:
    if boundary.pinch is not None:
        return Width(0.0, boundary.pinch, boundary.pinch)
    if not boundary.sides:
        return None
    # Most edges lie far apart: search far pairs only if no near ones face.
    low_x, low_y, high_x, high_y = box_round([side.box for side in boundary.sides])
    across = max(high_x - low_x, high_y - low_y)
    reach = across / math.sqrt(len(boundary.sides))
    farthest = min(below, 2 * across)
    while True:
        narrowest = _Narrowest(boundary, min(reach, farthest))
        search(narrowest)
        if narrowest.best is not None or reach >= farthest:
            return narrowest.best
        reach *= 4


def search(narrowest: _Narrowest) -> None:
    """Offer every place where edges or corners face each other."""
    boundary = narrowest.boundary
    sides = boundary.sides
    a, b = boundary.table.pairs(SQUARE, narrowest.value)
    pairs = zip(np.minimum(a, b).tolist(), np.maximum(a, b).tolist(), strict=True)
    for i, j in sorted(set(pairs)):
        _between_edges(sides[i], sides[j], narrowest)
    _at_corners(boundary.corners, narrowest)
    for p, q in boundary.ends:
        narrowest.offer(p, q)


def _sides(contour: Contour) -> list[BoundarySide]:
    return [_side(edge, box) for edge, box in zip(contour.edges, contour.boxes, strict=True)]


def _corners(contour: Contour) -> list[Corner | None]:
    return list(corners_of(contour))


def _side(edge: Edge, box: Bounds) -> BoundarySide:
    middle, half_turn = edge.at(0.5), abs(edge.sweep) / 2 if isinstance(edge, Arc) else 0.0
    half = max(math.dist(middle, edge.start), math.dist(middle, edge.end))
    return BoundarySide(edge, box, middle, half_turn, half)


def _between_edges(a: BoundarySide, b: BoundarySide, narrowest: _Narrowest) -> None:
    if isinstance(a.edge, Arc):
        if _alongside(a.edge, b.edge):
            _along_each_other(a, b, narrowest)
        # The centre line of a line and an arc, or of two arcs, is square on both.
        origin = b.edge.centre if isinstance(b.edge, Arc) else None
        if origin is None:
            (cx, cy) = a.edge.centre
            for foot in b.feet(a.edge.centre):
                (nx, ny) = foot.normal
                for opposite in a.feet((cx + nx, cy + ny)):
                    narrowest.offer_facing(foot, opposite)
        elif math.dist(origin, a.edge.centre) > 1e-9:
            for foot in a.feet(origin):
                for opposite in b.feet(a.edge.centre):
                    narrowest.offer_facing(foot, opposite)
    elif isinstance(b.edge, Arc):
        _between_edges(b, a, narrowest)
    elif _alongside(a.edge, b.edge):
        _along_each_other(a, b, narrowest)


def _alongside(a: Edge, b: Edge) -> bool:
    if isinstance(a, Arc) and isinstance(b, Arc):
        return math.dist(a.centre, b.centre) < ALONGSIDE
    if isinstance(a, Line) and isinstance(b, Line):
        u, v = a.direction(a.start), b.direction(b.start)
        return _dot(u, v) < 0 and abs(u[0] * v[1] - u[1] * v[0]) < ALONGSIDE
    return False


def _along_each_other(a: BoundarySide, b: BoundarySide, narrowest: _Narrowest) -> None:
    for near, far in ((a, b), (b, a)):
        for p in (near.middle, near.edge.start, near.edge.end):
            here = Foot(p, left_normal(near.edge, p))
            for foot in far.feet(p):
                narrowest.offer_facing(here, foot)


def _at_corners(corners: Sequence[Corner | None], narrowest: _Narrowest) -> None:
    boundary = narrowest.boundary
    for i, corner in enumerate(corners):
        if corner is None:
            continue
        near = boundary.index.numbers(widened((*corner.point, *corner.point), narrowest.value))
        for number in near:
            side = boundary.sides[number]
            if corner.may_face(side):
                for foot in side.feet(corner.point):
                    _corner_to_edge(corner, side, foot, narrowest)
            # A corner may face another one although its edges do not.
            facing = corners[number] if number > i and corner.turn < 0 else None
            if facing is not None and facing.turn < 0:
                _between_corners(corner, facing, narrowest)


def _between_corners(a: Corner, b: Corner, narrowest: _Narrowest) -> None:
    d = (b.point[0] - a.point[0], b.point[1] - a.point[1])
    if a.squarely(d) and b.squarely((-d[0], -d[1])):
        narrowest.offer(a.point, b.point)


def _corner_to_edge(corner: Corner, side: BoundarySide, foot: Foot, narrowest: _Narrowest) -> None:
    d = (foot.point[0] - corner.point[0], foot.point[1] - corner.point[1])
    if _dot(d, foot.normal) > -TOUCH:
        return
    if corner.turn < 0:
        if corner.squarely(d):
            narrowest.offer(corner.point, foot.point)
        return
    ends = math.dist(foot.point, side.edge.start), math.dist(foot.point, side.edge.end)
    if min(ends) > 10 * TOUCH and any(
        _dot(normal, foot.normal) < 0 < _dot(normal, d) for normal in corner.normals()
    ):
        narrowest.offer(corner.point, foot.point)


def _dot(a: Point, b: Point) -> float:
    return a[0] * b[0] + a[1] * b[1]


# Corners of contours.


class Corner:
    """A vertex with the directions of travel into and out of it; ``turn`` > 0 is convex.

    ``normal`` is the unit vector halfway between the normals of the two edges.
    """

    __slots__ = ("arriving", "leaving", "normal", "point", "turn")

    def __init__(self, point: Point, arriving: Point, leaving: Point, turn: float) -> None:
        self.point = point
        self.arriving = arriving
        self.leaving = leaving
        self.turn = turn
        ux, uy = arriving
        half = turn / 2
        c, s = math.cos(half), math.sin(half)
        self.normal = (-ux * s - uy * c, ux * c - uy * s)

    def may_face(self, side: BoundarySide) -> bool:
        """Return True if the normals of a side are somewhere opposed to the corner's.

        An edge facing a convex corner may be square on neither of its edges.
        """
        room = side.half_turn + abs(self.turn) / 2 + (SQUARE if self.turn < 0 else math.pi / 2)
        return room > math.pi or _dot(self.normal, side.normal) < -math.cos(room)

    def squarely(self, d: Point) -> bool:
        """True if a reflex corner is nearer than its neighbourhood to the end of ``d``."""
        room = 1e-9 * math.hypot(*d)
        return _dot(d, self.arriving) >= -room and _dot(d, self.leaving) <= room

    def normals(self) -> tuple[Point, Point]:
        return _turned_left(self.arriving), _turned_left(self.leaving)


def corners_of(contour: Contour) -> Iterator[Corner | None]:
    """Yield the corner that each edge starts at; None if the path is smooth there."""
    edges = contour.edges
    for before, after in zip((edges[-1], *edges), edges, strict=False):
        u, v = before.direction(after.start), after.direction(after.start)
        turn = math.atan2(u[0] * v[1] - u[1] * v[0], _dot(u, v))
        if abs(turn) > math.pi - SMOOTH:
            # At a cusp the curvatures decide the side of the material.
            turn = math.pi if _curvature(before) + _curvature(after) < 0 else -math.pi
        yield Corner(after.start, u, v, turn) if abs(turn) > SMOOTH else None


def pinch(
    contours: Iterable[Contour], corners: Iterable[Corner | None], sharp: float
) -> Point | None:
    """Return a corner sharper than allowed, or a point where the boundary meets itself, if any."""
    for corner in corners:
        if corner is not None and math.degrees(math.pi - corner.turn) < sharp - ROUNDED:
            return corner.point
    starts: set[Point] = set()
    for contour in contours:
        for edge in contour.edges:
            if edge.start in starts:
                return edge.start
            starts.add(edge.start)
    return None


def _curvature(edge: Edge) -> float:
    if isinstance(edge, Line):
        return 0.0
    return (1.0 if edge.ccw else -1.0) / edge.radius


def _turned_left(u: Point) -> Point:
    return -u[1], u[0]


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


class _Run:
    """Consecutive edges on one line or circle, and their turn (radians, left positive)."""

    __slots__ = ("first", "last", "radius", "sweep")

    def __init__(self, first: Edge, last: Edge, sweep: float) -> None:
        self.first = first
        self.last = last
        self.sweep = sweep
        self.radius = first.radius if isinstance(first, Arc) else math.inf

    def corner(self, after: _Run) -> float:
        """Return the turn of the path from this run to the next."""
        return left_turn(self.last, after.first)

    def is_fillet(self, bottom: _Run) -> bool:
        """Return True if it rounds a corner of the run beside it, which turns less tightly."""
        return self.sweep > 0 and (bottom.sweep <= 0 or self.radius < bottom.radius)


def tapered_ends(contour: Contour, sharp: float) -> Iterator[tuple[Point, Point]]:
    """Yield the ends of the flanks of every tapered end in a contour with the arm on its left.

    A rounded corner is an end if the sharp corner would have less than ``sharp`` degrees.
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

    ``corners``: the turn into each run.
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
    """Return the largest disc within a region that is not empty: exact for a circle, otherwise
    within 1e-4 of its radius, taken from the centre of the region's last nonempty offset.
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
        left = shrink(region, middle)
        low, high, core = (low, middle, core) if left.is_empty else (middle, high, left)
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
