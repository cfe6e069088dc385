"""The least width of a region, and of the gaps in it, between edges that face each other.

A width is the length of a segment inside the material that stands square on the edge at both of
its ends (a reflex corner counts as an edge turned into a point). Offsets would miss what lies
between corners; these are exact for lines and arcs.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Final, NamedTuple

from sbafab.geometry.boundary_side import BoundarySide, Foot
from sbafab.geometry.corners import Corner, corners_of, pinch
from sbafab.geometry.edges import Arc, Bounds, Edge, Line, Point, left_normal
from sbafab.geometry.ends import tapered_ends
from sbafab.geometry.intersect import meeting_points
from sbafab.geometry.kept import kept
from sbafab.geometry.nearby import EdgeIndex, widened
from sbafab.geometry.region import Contour, Region
from sbafab.geometry.remembered import remembered
from sbafab.geometry.rings import across_a_ring, bound_a_ring
from sbafab.geometry.width_bounds import may_be_narrower, widest_least

if TYPE_CHECKING:
    from sbafab.geometry.side_table import SideTable

ALONGSIDE: Final = 1e-3
"""Lines at a smaller angle (radians), or arcs with nearer centres (mm), run alongside."""
SHORTER: Final = 1e-9
"""mm by which a segment must be shorter than another to be the narrowest."""
ROUNDING: Final = 1e-12
"""mm: more than what distances are rounded by."""
TOUCH: Final = 1e-6
"""mm within which two points are one."""
ASIDE: Final = math.acos(0.9)
"""Radians (25 degrees) that the normals of samples which still face each other may turn aside."""
SQUARE: Final = 0.05
"""The same for edges square on each other: room for rounding, and for those alongside."""
MANY_SIDES: Final = 100
"""From which on looking at all pairs in arrays is worth it."""


class Width(NamedTuple):
    """A least distance in mm and the two facing points it lies between."""

    value: float
    start: Point
    end: Point

    @property
    def middle(self) -> Point:
        return (self.start[0] + self.end[0]) / 2, (self.start[1] + self.end[1]) / 2


@remembered
def least_width(region: Region, sharp: float = 90.0, below: float = math.inf) -> Width | None:
    """The narrowest place of the material, if under ``below`` mm; None if no edge faces another.

    A corner with an interior angle below ``sharp`` degrees has width 0.
    """
    near = may_be_narrower(region.contours, below)
    if len(near) < len(region.contours):
        return least_of(Boundary(near, sharp), below)
    return least_of(boundary_of(region, sharp), below)


@remembered
def least_gap(region: Region, sharp: float = 90.0, below: float = math.inf) -> Width | None:
    """The narrowest slot, hole or gap between pieces, likewise."""
    outside = [kept(one, "from_outside", Contour.reversed) for one in region.contours]
    return least_of(Boundary(may_be_narrower(outside, below), sharp), below)


class Boundary:
    """Contours with the material on their left, made ready for the search."""

    def __init__(self, contours: Sequence[Contour], sharp: float) -> None:
        self.sides = [side for one in contours for side in kept(one, "sides", _sides)]
        self.corners = [corner for one in contours for corner in kept(one, "corners", _corners)]
        """What corner each side starts at, if any."""
        self.ends = [
            ends
            for one in contours
            for ends in kept(one, f"ends{sharp}", lambda c: list(tapered_ends(c, sharp)))
        ]
        self.pinch = pinch(contours, self.corners, sharp)
        self.widest_least = widest_least(contours)
        self.index = EdgeIndex(
            [side.edge for side in self.sides], [side.box for side in self.sides]
        )
        self.known_clear: dict[tuple[Point, Point], bool] = {}
        """Of segments that were asked: whether no edge crosses them."""
        self._table: SideTable | None = None

    @property
    def table(self) -> SideTable:
        """The sides in arrays."""
        from sbafab.geometry.side_table import SideTable

        if self._table is None:
            self._table = SideTable(self.sides)
        return self._table


def _made_ready(region: Region, sharp: float) -> Boundary:
    return Boundary(region.contours, sharp)


boundary_of = remembered(_made_ready, most=16)


class _Narrowest:
    """Keeps the shortest segment offered, if below a length, that no edge crosses."""

    def __init__(self, boundary: Boundary, below: float) -> None:
        self.boundary = boundary
        self.best: Width | None = None
        self.value = below

    @property
    def most(self) -> float:
        """Longer ones are not kept, mm."""
        return self.value - SHORTER

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

    def near(
        self,
        a: BoundarySide | Corner,
        aside: float,
        after: int = -1,
        among: Sequence[int] | None = None,
    ) -> list[tuple[int, BoundarySide]]:
        """Numbered sides that a segment shorter than the best could join to ``a``.

        Their normals are opposed somewhere, to within ``aside`` radians, and their numbers come
        ``after`` this one. ``among``: no others come into question.
        """
        nx, ny = a.normal
        turn = a.half_turn + aside
        sides, index = self.boundary.sides, self.boundary.index
        straight = -math.cos(turn)
        box = widened(a.box, self.value)
        found = []
        for number in index.among(box, index.about(box, after) if among is None else among):
            if number <= after:
                continue
            side = sides[number]
            mx, my = side.normal
            room = turn + side.half_turn
            if room > math.pi or nx * mx + ny * my < (
                -math.cos(room) if side.half_turn else straight
            ):
                found.append(number)
        return [(number, sides[number]) for number in index.in_order(box, found)]

    def corners_near(self, a: Corner, after: int) -> Iterator[Corner]:
        """Yield later corners, numbered above ``after``, that a shorter segment may reach."""
        index, corners = self.boundary.index, self.boundary.corners
        box = widened(a.box, self.value)
        for number in index.in_order(box, index.among(box, index.about(box, after))):
            corner = corners[number] if number > after else None
            if corner is not None:
                yield corner

    def is_clear(self, p: Point, q: Point) -> bool:
        known = self.boundary.known_clear
        if (p, q) not in known:
            known[p, q] = self._is_clear(p, q)
        return known[p, q]

    def _is_clear(self, p: Point, q: Point) -> bool:
        segment = Line(p, q)
        box = segment.bounds
        for edge in self.boundary.index.touching(widened(box, 10 * TOUCH)):
            for m in meeting_points(segment, edge):
                if math.dist(m, p) > 10 * TOUCH and math.dist(m, q) > 10 * TOUCH:
                    return False
        return True


class Gathered(_Narrowest):
    """Keeps the ends of every segment offered that is short enough, whatever crosses it."""

    def __init__(self, boundary: Boundary, below: float) -> None:
        super().__init__(boundary, below)
        self.offered: list[tuple[Point, Point]] = []

    @property
    def most(self) -> float:
        return self.value

    def offer(self, p: Point, q: Point) -> None:
        if math.dist(p, q) <= self.value:
            self.offered.append((p, q))


def least_of(boundary: Boundary, below: float) -> Width | None:
    if boundary.pinch is not None:
        return Width(0.0, boundary.pinch, boundary.pinch)
    # Most edges lie far apart: those are looked at only where no near ones face.
    reach = min(boundary.index.cell, boundary.widest_least + 2 * SHORTER)
    farthest = min(below, 2 * boundary.index.across)
    while True:
        narrowest = _Narrowest(boundary, min(reach, farthest))
        search(narrowest)
        if narrowest.best is not None or reach >= farthest:
            return narrowest.best
        reach *= 4


def search(narrowest: _Narrowest) -> None:
    """Offers every place where edges or corners face each other."""
    boundary = narrowest.boundary
    later: Sequence[Sequence[int] | None] = [None] * len(boundary.sides)
    if len(boundary.sides) >= MANY_SIDES:
        later = boundary.table.later(SQUARE, narrowest.value)
    for i, (a, among) in enumerate(zip(boundary.sides, later, strict=True)):
        if among == []:
            continue
        for _, b in narrowest.near(a, SQUARE, i, among):
            if a.may_hold_feet(b, narrowest.value) or b.may_hold_feet(a, narrowest.value):
                _between_edges(a, b, narrowest)
    _at_corners(boundary.corners, narrowest)
    for p, q in boundary.ends:
        narrowest.offer(p, q)


def _sides(contour: Contour) -> list[BoundarySide]:
    return [_side(edge, box) for edge, box in zip(contour.edges, contour.boxes, strict=True)]


def _corners(contour: Contour) -> list[Corner | None]:
    return list(corners_of(contour))


def _side(edge: Edge, box: Bounds) -> BoundarySide:
    if isinstance(edge, Arc):
        # As ``at`` says, which would work out the sweep once more.
        sweep = edge.sweep
        middle, half_turn = edge.on_circle(edge.start_angle + 0.5 * sweep), abs(sweep) / 2
    else:
        middle, half_turn = edge.at(0.5), 0.0
    half = max(math.dist(middle, edge.start), math.dist(middle, edge.end))
    return BoundarySide(edge, box, middle, half_turn, half)


def _between_edges(a: BoundarySide, b: BoundarySide, narrowest: _Narrowest) -> None:
    if _lie_farther(a.edge, b.edge, narrowest.most):
        return
    if isinstance(a.edge, Arc):
        if _alongside(a.edge, b.edge) and _may_face(a.edge, b.edge, narrowest.value):
            _along_each_other(a, b, narrowest)
        # The centre line of a line and an arc, or of two arcs, is square on both.
        origin = b.edge.centre if isinstance(b.edge, Arc) else None
        if origin is None:
            (cx, cy) = a.edge.centre
            for foot in b.feet(a.edge.centre):
                (nx, ny) = foot.normal
                for other in a.feet((cx + nx, cy + ny)):
                    narrowest.offer_facing(foot, other)
        elif math.dist(origin, a.edge.centre) > 1e-9:
            for foot in a.feet(origin):
                for other in b.feet(a.edge.centre):
                    narrowest.offer_facing(foot, other)
    elif isinstance(b.edge, Arc):
        _between_edges(b, a, narrowest)
    elif _alongside(a.edge, b.edge):
        _along_each_other(a, b, narrowest)


def _lie_farther(a: Edge, b: Edge, than: float) -> bool:
    """Whether two arcs surely lie farther apart than so many mm, for their circles do."""
    if not (isinstance(a, Arc) and isinstance(b, Arc)):
        return False
    gap, r, s = math.dist(a.centre, b.centre), a.radius, b.radius
    apart = max(gap - r - s, abs(r - s) - gap)
    if apart <= than:
        return False
    off = [abs(math.dist(p, e.centre) - e.radius) for e in (a, b) for p in (e.start, e.end)]
    return apart - sum(off) - ROUNDING > than


def _alongside(a: Edge, b: Edge) -> bool:
    if isinstance(a, Arc) and isinstance(b, Arc):
        return math.dist(a.centre, b.centre) < ALONGSIDE
    if isinstance(a, Line) and isinstance(b, Line):
        u, v = a.direction(a.start), b.direction(b.start)
        return _dot(u, v) < 0 and abs(u[0] * v[1] - u[1] * v[0]) < ALONGSIDE
    return False


def _may_face(a: Arc, b: Edge, within: float) -> bool:
    """Whether two arcs of nearly one centre may face each other no farther off than ``within``.

    Material lies across a disc or in a ring, and nowhere between the edges of two holes.
    """
    room = 2 * ALONGSIDE
    if not isinstance(b, Arc) or min(a.radius, b.radius) < 10 * ALONGSIDE:
        return True
    if a.ccw and b.ccw:
        return a.radius + b.radius <= within + room
    if a.ccw or b.ccw:
        ring = a.radius - b.radius if a.ccw else b.radius - a.radius
        return -room <= ring <= within + room
    return False


def _along_each_other(a: BoundarySide, b: BoundarySide, narrowest: _Narrowest) -> None:
    if bound_a_ring(a.edge, b.edge):
        for p, q in across_a_ring(a, b):
            narrowest.offer(p, q)
        return
    for one, other in ((a, b), (b, a)):
        for p in (one.middle, one.edge.start, one.edge.end):
            here = Foot(p, left_normal(one.edge, p))
            for foot in other.feet(p):
                narrowest.offer_facing(here, foot)


def _at_corners(corners: Sequence[Corner | None], narrowest: _Narrowest) -> None:
    for i, corner in enumerate(corners):
        if corner is None:
            continue
        # What a convex corner faces may be square on neither of its edges.
        aside = SQUARE if corner.turn < 0 else math.pi / 2
        for _, side in narrowest.near(corner, aside):
            for foot in side.feet(corner.point):
                _corner_to_edge(corner, side, foot, narrowest)
        if corner.turn < 0:
            # The edges of a corner that faces another one need not face it.
            for other in narrowest.corners_near(corner, i):
                if other.turn < 0:
                    _between_corners(corner, other, narrowest)


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
