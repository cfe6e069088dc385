"""Sides and corners of contours with the material on their left, for a search for widths.

They are worked out once a contour: bores and outlines bound several regions.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from sbafab.geometry.edges import Arc, Bounds, Edge, Line, Point, left_normal
from sbafab.geometry.ends import SMOOTH, tapered_ends
from sbafab.geometry.region import Contour

BESIDE = 1e-5
"""mm that an edge may miss another's normals by, for rounding."""
ROUNDING = 1e-12
"""mm: more than what distances are rounded by."""


class Foot(NamedTuple):
    point: Point
    normal: Point


class BoundarySide(NamedTuple):
    """An edge with what the search asks of it again and again.

    ``half`` is how far its ends lie from its middle, ``lean`` the sine of its half turn, ``off``
    how far its ends may be off its circle.
    """

    edge: Edge
    box: Bounds
    middle: Point
    normal: Point
    half_turn: float
    half: float
    lean: float
    off: float

    def lies_farther(self, other: BoundarySide, than: float) -> bool:
        """Whether two arcs surely lie farther apart than so many mm, for their circles do."""
        a, b = self.edge, other.edge
        if not (isinstance(a, Arc) and isinstance(b, Arc)):
            return False
        gap, r, s = math.dist(a.centre, b.centre), a.radius, b.radius
        return max(gap - r - s, abs(r - s) - gap) - self.off - other.off > than

    def may_hold_feet(self, other: BoundarySide, within: float) -> bool:
        """Whether a normal of this edge may meet the other no farther off than ``within``."""
        (x, y), (nx, ny) = self.middle, self.normal
        aside = abs((other.middle[0] - x) * ny - (other.middle[1] - y) * nx)
        return aside <= self.half + other.half + within * self.lean + BESIDE

    def feet(self, p: Point) -> list[Foot]:
        """Points of the edge where its normal passes through ``p``."""
        edge = self.edge
        if isinstance(edge, Line):
            (x0, y0), (x1, y1) = edge
            dx, dy = x1 - x0, y1 - y0
            square = dx * dx + dy * dy
            t = ((p[0] - x0) * dx + (p[1] - y0) * dy) / square
            if not -1e-9 <= t <= 1 + 1e-9:
                return []
            length = math.sqrt(square)
            return [Foot((x0 + t * dx, y0 + t * dy), (-dy / length, dx / length))]
        (cx, cy), r = edge.centre, edge.radius
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


class Corner(NamedTuple):
    """A vertex with the directions of travel into and out of it; ``turn`` > 0 is convex."""

    point: Point
    arriving: Point
    leaving: Point
    turn: float

    @property
    def box(self) -> Bounds:
        return (*self.point, *self.point)

    @property
    def normal(self) -> Point:
        """The unit vector halfway between the normals of the two edges."""
        (ux, uy), half = self.arriving, self.turn / 2
        return -ux * math.sin(half) - uy * math.cos(half), ux * math.cos(half) - uy * math.sin(half)

    @property
    def half_turn(self) -> float:
        return abs(self.turn) / 2

    def squarely(self, d: Point) -> bool:
        """Whether a reflex corner lies nearest, among its neighbours, to what ``d`` points at."""
        room = 1e-9 * math.hypot(*d)
        return dot(d, self.arriving) >= -room and dot(d, self.leaving) <= room

    def normals(self) -> tuple[Point, Point]:
        return left_of(self.arriving), left_of(self.leaving)


def sides_of(contour: Contour) -> list[BoundarySide]:
    """The sides of a contour, which several regions may have: bores, outlines."""
    known = contour.__dict__
    if "sides" not in known:
        known["sides"] = [side_of(edge) for edge in contour.edges]
    found: list[BoundarySide] = known["sides"]
    return found


def side_of(edge: Edge) -> BoundarySide:
    middle = edge.at(0.5)
    half_turn = abs(edge.sweep) / 2 if isinstance(edge, Arc) else 0.0
    half = max(math.dist(middle, edge.start), math.dist(middle, edge.end))
    lean = math.sin(min(half_turn, math.pi / 2))
    off = ROUNDING
    if isinstance(edge, Arc):
        off += max(abs(math.dist(p, edge.centre) - edge.radius) for p in (edge.start, edge.end))
    return BoundarySide(
        edge, edge.bounds, middle, left_normal(edge, middle), half_turn, half, lean, off
    )


def corners_of(contour: Contour) -> list[Corner | None]:
    """The corner that each edge starts at; None where the path is smooth."""
    known = contour.__dict__
    if "corners" not in known:
        known["corners"] = list(_looked_at(contour.edges))
    found: list[Corner | None] = known["corners"]
    return found


def ends_of(contour: Contour, sharp: float) -> list[tuple[Point, Point]]:
    """Where the flanks of every end of an arm stop (``tapered_ends``)."""
    known: dict[float, list[tuple[Point, Point]]] = contour.__dict__.setdefault("ends", {})
    if sharp not in known:
        known[sharp] = list(tapered_ends(contour, sharp))
    return known[sharp]


def _looked_at(edges: Sequence[Edge]) -> Iterator[Corner | None]:
    for before, after in zip((edges[-1], *edges), edges, strict=False):
        u, v = before.direction(after.start), after.direction(after.start)
        turn = math.atan2(u[0] * v[1] - u[1] * v[0], dot(u, v))
        if abs(turn) > math.pi - SMOOTH:
            # At a cusp only the curvatures tell which side the material is on.
            turn = math.pi if _curvature(before) + _curvature(after) < 0 else -math.pi
        yield Corner(after.start, u, v, turn) if abs(turn) > SMOOTH else None


def _curvature(edge: Edge) -> float:
    if isinstance(edge, Line):
        return 0.0
    return (1.0 if edge.ccw else -1.0) / edge.radius


def from_outside(contour: Contour) -> Contour:
    """The contour the other way round, with what it bounds on its right."""
    known = contour.__dict__
    if "from_outside" not in known:
        known["from_outside"] = contour.reversed()
    found: Contour = known["from_outside"]
    return found


def dot(a: Point, b: Point) -> float:
    return a[0] * b[0] + a[1] * b[1]


def left_of(u: Point) -> Point:
    return -u[1], u[0]
