"""Growing and shrinking regions by a distance, arcs staying arcs."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Sequence

from sbafab.geometry.boolean import PointPool, chain, left_turn, split_edges
from sbafab.geometry.edges import EPSILON, Arc, Edge, Point, distance_to
from sbafab.geometry.nearby import EdgeIndex, widened
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
    near = EdgeIndex([edge for contour in contours for edge in contour.edges])
    raw: list[Edge] = []
    for contour in contours:
        for before, edge in zip((contour.edges[-1], *contour.edges), contour.edges, strict=False):
            corner = _corner_arc(before, edge, distance)
            if corner is not None:
                raw.append(corner)
            moved = edge.offset(distance)
            if moved is not None:
                raw.append(moved)
    kept: dict[frozenset[Point], list[tuple[float, Edge]]] = defaultdict(list)
    for pieces in split_edges(raw, PointPool()):
        for piece in pieces:
            middle = piece.at(0.5)
            depth = _depth(near, middle, distance)
            # In a touch of two pieces the inside, too, can be as far as this from every edge.
            if depth < 2 * EPSILON and not covers(middle):
                _add(kept[frozenset((piece.start, piece.end))], depth, piece)
    return _balanced([entry for entries in kept.values() for entry in entries])


def _corner_arc(before: Edge, after: Edge, distance: float) -> Arc | None:
    """The arc round a convex corner; none where the path is smooth or turns the other way."""
    corner = after.start
    ux, uy = before.direction(corner)
    vx, vy = after.direction(corner)
    turn = left_turn(before, after)
    if abs(turn) > 3:
        # At the tip of a cusp the curvature tells a spike from a notch.
        reach = min(math.dist(edge.start, edge.end) for edge in (before, after))
        turn = left_turn(before, after, reach)
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


def _depth(near: EdgeIndex, p: Point, distance: float) -> float:
    """How far ``p`` lies within ``distance`` of the edges; negative where it does not.

    The search ends at the first edge that is clearly too near.
    """
    depth = -math.inf
    for edge in near.touching(widened((*p, *p), distance)):
        depth = max(depth, distance - distance_to(edge, p))
        if depth > 2 * EPSILON:
            break
    return depth


def _add(kept: list[tuple[float, Edge]], depth: float, piece: Edge) -> None:
    """Keeps one of equal pieces, and neither of two that run opposite ways (a closed gap).

    All that are ``kept`` have the piece's ends.
    """
    middle = piece.at(0.5)
    for index, (_, other) in enumerate(kept):
        if math.dist(middle, other.at(0.5)) < 4 * EPSILON:
            if other.start != piece.start:
                del kept[index]
            return
    kept.append((depth, piece))


def _balanced(kept: Sequence[tuple[float, Edge]]) -> list[Edge]:
    """The pieces without those, deepest first, that leave a point that too few arrive at.

    Where two curves graze each other within EPSILON, both are kept at first.
    """
    pieces = sorted(kept, key=lambda entry: entry[0])
    while True:
        surplus: dict[Point, int] = defaultdict(int)
        for _, piece in pieces:
            surplus[piece.start] += 1
            surplus[piece.end] -= 1
        doubtful = [
            index
            for index, (depth, piece) in enumerate(pieces)
            if depth > 0 and (surplus[piece.start] > 0 or surplus[piece.end] < 0)
        ]
        if not doubtful:
            return [piece for _, piece in pieces]
        del pieces[doubtful[-1]]
