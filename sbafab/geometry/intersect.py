"""Meeting points of two edges: crossings, touches, and the ends of a shared stretch."""

from __future__ import annotations

import math

from sbafab.geometry.edges import EPSILON, Arc, Bounds, Edge, Line, Point, distance_to

EVERYWHERE: Bounds = (-math.inf, -math.inf, math.inf, math.inf)


def meeting_points(
    a: Edge,
    b: Edge,
    tolerance: float = EPSILON,
    boxes: tuple[Bounds, Bounds] = (EVERYWHERE, EVERYWHERE),
) -> list[Point]:
    """Return the points that lie on both edges, to within the tolerance.

    Edges that run along each other give the ends of the shared stretch. ``boxes`` hold all points
    within the tolerance of each edge, if computed already; no point outside them is returned.
    """
    near_a, near_b = boxes
    low_x, low_y = max(near_a[0], near_b[0]), max(near_a[1], near_b[1])
    high_x, high_y = min(near_a[2], near_b[2]), min(near_a[3], near_b[3])
    a0, a1, b0, b1 = a.start, a.end, b.start, b.end
    points: list[Point] = []
    if a0 in (b0, b1) or (
        low_x <= a0[0] <= high_x and low_y <= a0[1] <= high_y and distance_to(b, a0) < tolerance
    ):
        points.append(a0)
    if a1 in (b0, b1) or (
        low_x <= a1[0] <= high_x and low_y <= a1[1] <= high_y and distance_to(b, a1) < tolerance
    ):
        points.append(a1)
    for p in (b0, b1):
        within = low_x <= p[0] <= high_x and low_y <= p[1] <= high_y
        if within and p not in (a0, a1) and distance_to(a, p) < tolerance:
            points.append(p)
    if points and _holds(points[0], 2 * tolerance, low_x, low_y, high_x, high_y):
        return points
    for p in _support_crossings(a, b, tolerance):
        if not (low_x <= p[0] <= high_x and low_y <= p[1] <= high_y):
            continue
        # A known end wins over a computed point: at a touch the computed one is less exact.
        if any(math.dist(p, q) <= 2 * tolerance for q in points):
            continue
        if distance_to(a, p) < tolerance and distance_to(b, p) < tolerance:
            points.append(p)
    return points


def _holds(
    p: Point, reach: float, low_x: float, low_y: float, high_x: float, high_y: float
) -> bool:
    """Return True if a whole box lies within ``reach`` of a point."""
    return math.hypot(max(high_x - p[0], p[0] - low_x), max(high_y - p[1], p[1] - low_y)) <= reach


def _support_crossings(a: Edge, b: Edge, tolerance: float) -> list[Point]:
    if isinstance(a, Line):
        if isinstance(b, Line):
            return _line_line(a, b)
        return line_circle(a.start, a.direction(a.start), b.centre, b.radius, tolerance)
    if isinstance(b, Line):
        return line_circle(b.start, b.direction(b.start), a.centre, a.radius, tolerance)
    return _circle_circle(a, b, tolerance)


def _line_line(a: Line, b: Line) -> list[Point]:
    ax, ay = a.start
    bx, by = b.start
    ux, uy = a.direction(a.start)
    vx, vy = b.direction(b.start)
    cross = ux * vy - uy * vx
    if abs(cross) < 1e-12:
        return []
    t = ((bx - ax) * vy - (by - ay) * vx) / cross
    return [(ax + t * ux, ay + t * uy)]


def line_circle(
    origin: Point, unit: Point, centre: Point, radius: float, tolerance: float = EPSILON
) -> list[Point]:
    """The crossings of the infinite line through ``origin`` with a circle; a touch counts once."""
    ox, oy = origin
    ux, uy = unit
    cx, cy = centre
    along = (cx - ox) * ux + (cy - oy) * uy
    across = (cx - ox) * uy - (cy - oy) * ux
    foot = (ox + along * ux, oy + along * uy)
    room = radius - abs(across)
    if room < -tolerance:
        return []
    half = math.sqrt(max(0.0, room * (radius + abs(across))))
    if half < tolerance:
        return [foot]
    points = [
        (foot[0] - half * ux, foot[1] - half * uy),
        (foot[0] + half * ux, foot[1] + half * uy),
    ]
    return [foot, *points] if room < tolerance else points


def _circle_circle(a: Arc, b: Arc, tolerance: float) -> list[Point]:
    ax, ay = a.centre
    bx, by = b.centre
    gap = math.hypot(bx - ax, by - ay)
    if gap < 1e-12:
        return []
    outside = a.radius + b.radius - gap
    inside = gap - abs(a.radius - b.radius)
    if outside < -tolerance or inside < -tolerance:
        return []
    ux, uy = (bx - ax) / gap, (by - ay) / gap
    along = (gap * gap + (a.radius - b.radius) * (a.radius + b.radius)) / (2 * gap)
    # The product form keeps its digits where the circles all but touch (Heron).
    rest = outside * inside * (gap + a.radius + b.radius) * (gap + abs(a.radius - b.radius))
    half = math.sqrt(max(0.0, rest)) / (2 * gap)
    if outside < tolerance or inside < tolerance:
        side = 1.0 if along > 0 else -1.0
        touch = (ax + side * a.radius * ux, ay + side * a.radius * uy)
        if half < tolerance:
            return [touch]
    foot = (ax + along * ux, ay + along * uy)
    return [
        (foot[0] - half * uy, foot[1] + half * ux),
        (foot[0] + half * uy, foot[1] - half * ux),
    ]
