"""Smooth curves fitted by biarcs: two circular arcs with a common tangent where they join.

A curve is a function that maps a parameter to a point and the derivative there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise

from sbafab.geometry.edges import (
    EPSILON,
    Edge,
    Line,
    Point,
    distance_to,
    edge_from_bulge,
    quarter_arcs,
)

Curve = Callable[[float], tuple[Point, Point]]

TOLERANCE = 0.0005
"""Farthest a fitted arc may lie from its curve, in mm."""
SAMPLES = 24
"""Points of a span at which its two arcs are checked."""
STRAIGHT = 1e-6
"""An arc that bulges less than this, in mm, is written as a line."""
LEAST_TURN = 1e-7
"""Radians: an arc that turns less is written as a line; no offset of it differs from a line's."""
MOST_ARCS = 2000
MOST_TRIALS = 40
"""Doublings and halvings of one span, more than any curve needs."""
LARGEST_TURN = math.radians(80)
"""Farthest the tangent may turn along one arc."""


class FitError(ArithmeticError):
    """A curve that cannot be fitted by arcs; the message gives the location."""


def bezier(controls: Sequence[Point]) -> Curve:
    """Return the Bézier curve of three or four control points, for parameters 0 to 1."""

    def between(a: Point, b: Point, t: float) -> Point:
        return a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])

    def curve(t: float) -> tuple[Point, Point]:
        points = list(controls)
        while len(points) > 2:
            points = [between(a, b, t) for a, b in pairwise(points)]
        a, b = points
        return between(a, b, t), (b[0] - a[0], b[1] - a[1])

    return curve


def ellipse(centre: Point, major: Point, minor: Point) -> Curve:
    """The ellipse centre + major cos t + minor sin t, from half axes (or conjugate vectors)."""

    def curve(t: float) -> tuple[Point, Point]:
        c, s = math.cos(t), math.sin(t)
        return (
            (centre[0] + c * major[0] + s * minor[0], centre[1] + c * major[1] + s * minor[1]),
            (c * minor[0] - s * major[0], c * minor[1] - s * major[1]),
        )

    return curve


def elliptical_arc(
    centre: Point, major: Point, minor: Point, first: float, last: float
) -> tuple[Edge, ...]:
    """Return edges along centre + major cos t + minor sin t; exact for a circle."""
    if last < first:
        forward = elliptical_arc(centre, major, minor, last, first)
        return tuple(edge.reversed() for edge in reversed(forward))
    curve = ellipse(centre, major, minor)
    radius = math.hypot(*major)
    skew = major[0] * minor[0] + major[1] * minor[1]
    if abs(radius - math.hypot(*minor)) > EPSILON or abs(skew) > EPSILON * radius:
        return fit_arcs(curve, first, last)
    start = curve(first)[0]
    end = start if last - first > math.tau - 1e-9 else curve(last)[0]
    ccw = major[0] * minor[1] > major[1] * minor[0]
    return tuple(quarter_arcs(start, end, centre, radius, (last - first) * (1 if ccw else -1)))


def fit_arcs(
    curve: Curve, first: float, last: float, tolerance: float = TOLERANCE
) -> tuple[Edge, ...]:
    """Return arcs and lines within ``tolerance`` mm of the curve from parameter ``first`` to
    ``last``.

    Neighbours share a tangent, and each biarc extends as far as the tolerance allows. Raises
    FitError if the curve has a cusp, or is far too long or rugged.
    """
    edges: list[Edge] = []
    at, step = first, (last - first) / 4
    while at < last:
        reach, fitted = _longest_span(curve, at, last, step, tolerance)
        if reach < last and last - reach < (reach - at) / 2:
            # Split evenly, to avoid a sliver at the end.
            middle = (at + last) / 2
            even = _biarc(curve, at, middle, tolerance)
            reach, fitted = (middle, even) if even else (reach, fitted)
        edges += fitted
        at, step = reach, reach - at
        if len(edges) > MOST_ARCS:
            (x, y), _ = curve(at)
            raise FitError(f"curve that {MOST_ARCS} arcs cannot follow beyond x {x:.4f}, y {y:.4f}")
    return tuple(edge for edge in edges if edge.length > EPSILON)


def _longest_span(
    curve: Curve, at: float, last: float, step: float, tolerance: float
) -> tuple[float, list[Edge]]:
    """The largest parameter that one biarc from ``at`` reaches, by doubling, then bisection."""
    good, bad, end = at, math.inf, min(last, at + step)
    fitted: list[Edge] = []
    for _ in range(MOST_TRIALS):
        edges = _biarc(curve, at, end, tolerance)
        if edges:
            good, fitted = end, edges
        else:
            bad = end
        if good == last or bad - good < 0.02 * (good - at):
            return good, fitted
        end = min(last, 2 * end - at) if bad == math.inf else (good + bad) / 2
    (x, y), _ = curve(at)
    raise FitError(f"cusp near x {x:.4f}, y {y:.4f}")


def _biarc(curve: Curve, first: float, last: float, tolerance: float) -> list[Edge]:
    """Two edges tangent to the curve at both parameters; empty if they deviate too far between."""
    start, u = curve(first)[0], _unit_tangent(curve, first, last)
    end, v = curve(last)[0], _unit_tangent(curve, last, first)
    edges = biarc(start, u, end, v)
    if not edges:
        return []
    for k in range(1, SAMPLES):
        p = curve(first + (last - first) * k / SAMPLES)[0]
        if min(distance_to(edge, p) for edge in edges) > 0.99 * tolerance:
            return []
    return edges


def biarc(start: Point, u: Point, end: Point, v: Point, straight: float = STRAIGHT) -> list[Edge]:
    """Return two edges from start along ``u`` to end along ``v``; empty if the turn is too large.

    An arc with a height below ``straight`` mm becomes a line, which leaves a kink at its ends.
    """
    # One tangent length d on both sides: |end - start - d (u + v)| = 2 d, solved so that it
    # keeps its digits where the tangents are parallel.
    chord = end[0] - start[0], end[1] - start[1]
    along = chord[0] * (u[0] + v[0]) + chord[1] * (u[1] + v[1])
    square = chord[0] ** 2 + chord[1] ** 2
    if along <= 0 or square < EPSILON**2:
        return []
    open_angle = 2 * (1 - u[0] * v[0] - u[1] * v[1])
    d = square / (along + math.sqrt(along**2 + open_angle * square))
    joint = (
        (start[0] + end[0] + d * (u[0] - v[0])) / 2,
        (start[1] + end[1] + d * (u[1] - v[1])) / 2,
    )
    if min(math.dist(start, joint), math.dist(joint, end)) ** 2 < square / 100:
        return []
    first_turn = _angle(u, (joint[0] - start[0], joint[1] - start[1]))
    second_turn = _angle((end[0] - joint[0], end[1] - joint[1]), v)
    if max(abs(first_turn), abs(second_turn)) > LARGEST_TURN / 2:
        return []
    return [_edge(start, joint, first_turn, straight), _edge(joint, end, second_turn, straight)]


def _edge(start: Point, end: Point, turn: float, straight: float) -> Edge:
    """The arc from start to end whose tangent at the start is ``turn`` right of the chord."""
    bulge = math.tan(turn / 2)
    if abs(bulge) * math.dist(start, end) / 2 < straight or abs(turn) < LEAST_TURN:
        return Line(start, end)
    return edge_from_bulge(start, end, bulge)


def edge_through(start: Point, middle: Point, end: Point) -> Edge:
    """Return the arc from start to end through a point half way; a line if it is straight."""
    half = _angle(
        (middle[0] - start[0], middle[1] - start[1]), (end[0] - middle[0], end[1] - middle[1])
    )
    if abs(half) * math.dist(start, end) < EPSILON / 10:
        return Line(start, end)
    return edge_from_bulge(start, end, math.tan(half / 2))


def _unit_tangent(curve: Curve, at: float, towards: float) -> Point:
    """Return the unit derivative at a parameter, or just beside it if it vanishes."""
    for nudge in (0.0, 1e-6, 1e-4):
        dx, dy = curve(at + nudge * (towards - at))[1]
        size = math.hypot(dx, dy)
        if size > 1e-9:
            return dx / size, dy / size
    (x, y), _ = curve(at)
    raise FitError(f"cusp near x {x:.4f}, y {y:.4f}")


def _angle(u: Point, v: Point) -> float:
    """Return the angle from u to v, counter-clockwise positive."""
    return math.atan2(u[0] * v[1] - u[1] * v[0], u[0] * v[0] + u[1] * v[1])
