"""Growing and shrinking regions by a distance, arcs staying arcs."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Sequence

from sbafab.geometry.boolean import PointPool, chain, split_edges
from sbafab.geometry.edges import EPSILON, Arc, Edge, Point
from sbafab.geometry.region import Contour, Region


def grow(region: Region, distance: float) -> Region:
    """All points within ``distance`` of the region (round at its corners); shrinks if negative."""
    if distance < 0:
        return shrink(region, -distance)
    if distance < EPSILON or region.is_empty:
        return region
    return chain(_offset_pieces(region.contours, distance, region.contains))


def shrink(region: Region, distance: float) -> Region:
    """The points at least ``distance`` inside the region."""
    if distance < 0:
        return grow(region, -distance)
    if distance < EPSILON or region.is_empty:
        return region
    outside = [contour.reversed() for contour in region.contours]
    pieces = _offset_pieces(outside, distance, lambda p: not region.contains(p))
    return chain([piece.reversed() for piece in pieces])


def fillet(region: Region, radius: float) -> Region:
    """The region with every concave corner rounded to ``radius``, gaps narrower filled."""
    return shrink(grow(region, radius), radius)


def _offset_pieces(
    contours: Sequence[Contour], distance: float, covers: Callable[[Point], bool]
) -> list[Edge]:
    """Pieces of the curve at exactly ``distance`` outside the side that ``covers`` knows."""
    originals = [edge for contour in contours for edge in contour.edges]
    raw: list[Edge] = []
    for contour in contours:
        for before, edge in zip((contour.edges[-1], *contour.edges), contour.edges, strict=False):
            corner = _corner_arc(before, edge, distance)
            if corner is not None:
                raw.append(corner)
            moved = edge.offset(distance)
            if moved is not None:
                raw.append(moved)
    pool = PointPool()
    kept: dict[tuple[Point, Point], list[Edge]] = defaultdict(list)
    for pieces in split_edges(raw, pool):
        for piece in pieces:
            middle = piece.at(0.5)
            # In a touch of two pieces the inside, too, can be as far as this from every edge.
            if all(_clear(edge, middle, distance) for edge in originals) and not covers(middle):
                _add(kept, piece)
    return [piece for pieces in kept.values() for piece in pieces]


def _corner_arc(before: Edge, after: Edge, distance: float) -> Arc | None:
    """The arc round a convex corner; none where the path is smooth or turns the other way."""
    corner = after.start
    ux, uy = before.direction(corner)
    vx, vy = after.direction(corner)
    turn = math.atan2(ux * vy - uy * vx, ux * vx + uy * vy)
    if turn * distance < EPSILON:
        return None
    x, y = corner
    return Arc(
        (x + uy * distance, y - ux * distance),
        (x + vy * distance, y - vx * distance),
        corner,
        distance,
        True,
    )


def _clear(edge: Edge, p: Point, distance: float) -> bool:
    low_x, low_y, high_x, high_y = edge.bounds
    if (
        p[0] < low_x - distance
        or p[0] > high_x + distance
        or p[1] < low_y - distance
        or p[1] > high_y + distance
    ):
        return True
    return math.dist(p, edge.nearest(p)) > distance - 2 * EPSILON


def _add(kept: dict[tuple[Point, Point], list[Edge]], piece: Edge) -> None:
    """Keeps one of equal pieces, and neither of two that run opposite ways (a closed gap)."""
    middle = piece.at(0.5)
    for same in kept[piece.start, piece.end]:
        if math.dist(middle, same.at(0.5)) < 4 * EPSILON:
            return
    opposite = kept[piece.end, piece.start]
    for other in opposite:
        if math.dist(middle, other.at(0.5)) < 4 * EPSILON:
            opposite.remove(other)
            return
    kept[piece.start, piece.end].append(piece)
