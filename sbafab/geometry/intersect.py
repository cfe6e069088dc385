"""Where two edges meet: crossings, touches, and the ends of a shared stretch."""

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
    """Points that both edges hold, to within the tolerance.

    Edges that run along each other give the ends of the shared stretch. ``boxes`` hold all that
    lies within the tolerance of either edge, where such are known: nothing is found outside them.
    """
    one, two = boxes
    left, low = max(one[0], two[0]), max(one[1], two[1])
    right, high = min(one[2], two[2]), min(one[3], two[3])
    a0, a1, b0, b1 = a.start, a.end, b.start, b.end
    found: list[Point] = []
    if a0 in (b0, b1) or (
        left <= a0[0] <= right and low <= a0[1] <= high and distance_to(b, a0) < tolerance
    ):
        found.append(a0)
    if a1 in (b0, b1) or (
        left <= a1[0] <= right and low <= a1[1] <= high and distance_to(b, a1) < tolerance
    ):
        found.append(a1)
    for p in (b0, b1):
        within = left <= p[0] <= right and low <= p[1] <= high
        if within and p not in (a0, a1) and distance_to(a, p) < tolerance:
            found.append(p)
    if found and _holds(found[0], 2 * tolerance, left, low, right, high):
        return found
    for p in _support_crossings(a, b, tolerance):
        if not (left <= p[0] <= right and low <= p[1] <= high):
            continue
        # A known end wins over a computed point: at a touch the computed one is less exact.
        if any(math.dist(p, known) <= 2 * tolerance for known in found):
            continue
        if distance_to(a, p) < tolerance and distance_to(b, p) < tolerance:
            found.append(p)
    return found


def _holds(p: Point, reach: float, left: float, low: float, right: float, high: float) -> bool:
    """Whether a whole box lies within ``reach`` of a point."""
    return math.hypot(max(right - p[0], p[0] - left), max(high - p[1], p[1] - low)) <= reach


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
    """Crossings of the infinite line through ``origin`` with a circle; a touch counts once."""
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
