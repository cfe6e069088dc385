"""Where a straight line runs inside a region."""

from __future__ import annotations

import math
from itertools import pairwise

from sbafab.geometry.edges import EPSILON, Bounds, Line, Point
from sbafab.geometry.intersect import meeting_points
from sbafab.geometry.region import Region

Interval = tuple[float, float]
NEAR = 1e-3
"""mm: far more than the tolerance within which a line touches an edge."""


def section(region: Region, origin: Point, direction: Point) -> list[Interval]:
    """The stretches of a line inside the region, as distances in mm from ``origin``.

    ``direction`` is a unit vector. The line may touch an edge but must not run along one.
    """
    if region.is_empty:
        return []
    (ox, oy), (ux, uy) = origin, direction
    low_x, low_y, high_x, high_y = region.bounds
    reach = max(math.dist(origin, (x, y)) for x in (low_x, high_x) for y in (low_y, high_y)) + 1.0
    line = Line((ox - reach * ux, oy - reach * uy), (ox + reach * ux, oy + reach * uy))
    stops = sorted(
        (x - ox) * ux + (y - oy) * uy
        for contour in region.contours
        for edge, box in zip(contour.edges, contour.boxes, strict=True)
        if _may_meet(box, origin, direction)
        for x, y in meeting_points(edge, line)
    )
    inside: list[Interval] = []
    for start, end in pairwise(stops):
        middle = (start + end) / 2
        if end - start < 2 * EPSILON:
            continue
        if not region.contains((ox + middle * ux, oy + middle * uy)):
            continue
        if inside and start - inside[-1][1] < 2 * EPSILON:
            inside[-1] = (inside[-1][0], end)
        else:
            inside.append((start, end))
    return inside


def _may_meet(box: Bounds, origin: Point, direction: Point) -> bool:
    """Whether a line comes into a box, or so near that it could touch what is in it."""
    (ox, oy), (ux, uy) = origin, direction
    left, low, right, high = box
    off = ux * ((low + high) / 2 - oy) - uy * ((left + right) / 2 - ox)
    return abs(off) <= (abs(ux) * (high - low) + abs(uy) * (right - left)) / 2 + NEAR
