"""The centre of area of a region."""

from __future__ import annotations

import math

from sbafab.geometry.edges import Arc, Edge, Point
from sbafab.geometry.region import Region


def centroid(region: Region) -> Point:
    """Centre of area of a region that is not empty."""
    x, y = region.edges[0].start
    mx = my = 0.0
    for edge in region.edges:
        dx, dy = _moment(edge, (x, y))
        mx, my = mx + dx, my + dy
    return x + mx / region.area, y + my / region.area


def _moment(edge: Edge, origin: Point) -> Point:
    """First moment of the triangle from ``origin`` to the edge's chord, and of what lies between
    chord and arc.
    """
    ox, oy = origin
    (x0, y0), (x1, y1) = edge.start, edge.end
    x0, y0, x1, y1 = x0 - ox, y0 - oy, x1 - ox, y1 - oy
    area = (x0 * y1 - x1 * y0) / 2
    mx, my = area * (x0 + x1) / 3, area * (y0 + y1) / 3
    if not isinstance(edge, Arc):
        return mx, my
    # A circular segment: (2/3) r^3 sin^3(sweep/2) from the circle's centre, along its axis.
    (cx, cy), (px, py) = edge.centre, edge.at(0.5)
    lever = 2 / 3 * edge.radius**2 * math.sin(edge.sweep / 2) ** 3
    segment = edge.segment_area
    return (
        mx + segment * (cx - ox) + lever * (px - cx),
        my + segment * (cy - oy) + lever * (py - cy),
    )
