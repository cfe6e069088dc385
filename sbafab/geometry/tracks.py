"""What the middle of a beam follows: tracks known in closed form, their crossings, arcs on them."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

from sbafab.geometry.edges import EPSILON, Edge, Line, Point, distance_to, edge_from_bulge

TOLERANCE = 0.0001
"""Farthest an arc of the path may lie from the exact curve, in mm."""
STEP, CORNER_STEP = math.radians(15), math.radians(30)
"""Most that one arc turns along a curve, and round a corner."""
LEAST_ARCS = 3
"""So many arcs follow every curve: four points tell the circle it was, when the kerf is undone."""
SHORT = 1e-3
SHARES = tuple(0.75**k for k in range(16, 0, -1))
"""Shares of two tracks from whose ends on they are looked at for a crossing."""


def rim(a: float, b: float, angle: float) -> Point:
    """The point of a beam's rim (half widths ``a`` and ``b``) with this angle of its normal."""
    x, y = math.cos(angle), math.sin(angle)
    size = math.hypot(a * x, b * y)
    return a * a * x / size, b * b * y / size


class Track(NamedTuple):
    """What the beam follows: an arc of ``turn`` times ``radius`` (0: a corner), or a straight edge.

    Its points are parameters of the outward normal's angle; of the straight edge's length.
    """

    beam: tuple[float, float]
    centre: Point
    radius: float
    turn: int
    line: Line | None = None

    def at(self, t: float) -> Point:
        if self.line is not None:
            ux, uy = self.line.direction(self.line.start)
            (x, y), (ex, ey) = self.line.start, rim(*self.beam, math.atan2(-ux, uy))
            return x + ex + t * ux, y + ey + t * uy
        (cx, cy), (ex, ey) = self.centre, rim(*self.beam, t)
        r = self.turn * self.radius
        return cx + r * math.cos(t) + ex, cy + r * math.sin(t) + ey

    def bend(self, t: float) -> float:
        """Radius of curvature, positive to the left of the normal's turn: source and rim added."""
        a, b = self.beam
        rim_bend = (a * b) ** 2 / math.hypot(a * math.cos(t), b * math.sin(t)) ** 3
        return self.turn * self.radius + rim_bend

    def rate(self, t: float) -> Point:
        if self.line is not None:
            return self.line.direction(self.line.start)
        bend = self.bend(t)
        return -bend * math.sin(t), bend * math.cos(t)

    def runs_on(self, t: float) -> bool:
        """Whether the beam moves on there; it moves back in a hollow narrower than its rim."""
        return self.turn >= 0 or self.bend(t) < 0


def crossing(
    one: tuple[Track, float, float], other: tuple[Track, float, float]
) -> tuple[float, float]:
    """The parameters at which a track that ends meets one that starts.

    Looked for from there, and where the beam moves back there, from farther away.
    """
    (before, far, end), (after, start, on) = one, other
    if before.runs_on(end) and after.runs_on(start):
        if math.dist(before.at(end), after.at(start)) < 2 * EPSILON:
            return end, start
        return _met(before, end, after, start) or (end, start)
    back, ahead = far - end, on - start
    for share in SHARES:
        reach = share * max(abs(back), abs(ahead))
        met = _met(
            before,
            end + math.copysign(min(reach, abs(back)), back),
            after,
            start + math.copysign(min(reach, abs(ahead)), ahead),
        )
        if met and (met[0] - end) * back >= 0 and (met[1] - start) * ahead >= 0:
            return met
    return end, start


def _met(one: Track, s: float, other: Track, t: float) -> tuple[float, float] | None:
    """The parameters at which two tracks cross, both running on, from near ones by Newton."""
    first = s, t
    for _ in range(8):
        (x, y), (u, v) = one.at(s), other.at(t)
        if max(abs(s - first[0]), abs(t - first[1])) > 0.5:
            return None
        if math.hypot(u - x, v - y) < 1e-10:
            return (s, t) if one.runs_on(s) and other.runs_on(t) else None
        (px, py), (qx, qy) = one.rate(s), other.rate(t)
        det = px * qy - py * qx
        if abs(det) < 1e-3 * math.hypot(px, py) * math.hypot(qx, qy):
            return None
        s += ((u - x) * qy - (v - y) * qx) / det
        t += ((u - x) * py - (v - y) * px) / det
    return None


def arcs_along(track: Track, t0: float, t1: float) -> list[Edge]:
    """Arcs through points of the track, as many as keep within the tolerance."""
    step, tolerance = (STEP, TOLERANCE) if track.radius else (CORNER_STEP, TOLERANCE / 10)
    count = max(1, math.ceil(abs(t1 - t0) / step - 1e-9))
    if track.radius * abs(t1 - t0) > SHORT:
        count = max(LEAST_ARCS, count)
    return through(track.at, t0, t1, count, tolerance)


def through(
    curve: Callable[[float], Point], t0: float, t1: float, count: int, tolerance: float
) -> list[Edge]:
    """Arcs through ``count`` + 1 points of the curve, or through twice as many, and so on."""
    while True:
        stops = [t0 + (t1 - t0) * k / count for k in range(count + 1)]
        points = [curve(t) for t in stops]
        if math.dist(points[0], points[-1]) < EPSILON:
            points[-1] = points[0]
            if count == 1:
                return []
        edges = [
            _through(p, curve((s + t) / 2), q)
            for (s, t), (p, q) in zip(pairwise(stops), pairwise(points), strict=True)
        ]
        off = max(
            distance_to(edge, curve(s + (t - s) * share))
            for edge, (s, t) in zip(edges, pairwise(stops), strict=True)
            for share in (0.2, 0.8)
        )
        if off <= tolerance or count > 1000:
            return [edge for edge in edges if math.dist(edge.start, edge.end) > EPSILON]
        count *= 2


def _through(start: Point, middle: Point, end: Point) -> Edge:
    """The arc from start through a point half way to the end."""
    (ax, ay), (bx, by) = (
        (middle[0] - start[0], middle[1] - start[1]),
        (end[0] - middle[0], end[1] - middle[1]),
    )
    half = math.atan2(ax * by - ay * bx, ax * bx + ay * by)
    if abs(half) * math.dist(start, end) < EPSILON / 10:
        return Line(start, end)
    return edge_from_bulge(start, end, math.tan(half / 2))
