"""Growing and shrinking regions by a distance, arcs staying arcs."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise

from sbafab.geometry.boolean import PointPool, chain, left_turn, split_edges
from sbafab.geometry.edges import EPSILON, Arc, Edge, Point, distance_to
from sbafab.geometry.nearby import EdgeIndex, widened
from sbafab.geometry.region import Contour, Region

CUSP = 3.0
"""Radians: a path that turns by more is taken to turn back on itself."""


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
            raw += _corner_arcs(before, edge, distance)
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


def _corner_arcs(before: Edge, after: Edge, distance: float) -> Iterator[Arc]:
    """The arcs round a convex corner; none where the path is smooth or turns the other way.

    At the tip of a cusp rounding decides whether the path turns left or right, so there it gets
    its arcs either way: round the end of a notch they lie in the material, and fall away.
    """
    turn = left_turn(before, after)
    if -CUSP < turn < EPSILON / distance:
        return
    (x, y), (ux, uy) = after.start, before.direction(after.start)
    heading, sweep = math.atan2(-ux, uy), turn % math.tau
    count = 2 if sweep > CUSP else 1
    vx, vy = after.direction(after.start)
    between = [heading + sweep * k / count for k in range(1, count)]
    stops = [(uy, -ux), *((math.cos(t), math.sin(t)) for t in between), (vy, -vx)]
    points = [(x + nx * distance, y + ny * distance) for nx, ny in stops]
    for start, end in pairwise(points):
        yield Arc(start, end, (x, y), distance, True)


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
