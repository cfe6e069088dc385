"""Growing and shrinking regions by a distance, arcs staying arcs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise

from sbafab.geometry.apart import FAR, alone, meets_itself
from sbafab.geometry.boolean import enclosed
from sbafab.geometry.edges import EPSILON, Arc, Edge, Line, Point, left_turn
from sbafab.geometry.region import Contour, Region
from sbafab.geometry.remembered import remembered
from sbafab.geometry.shapes import circle

CUSP = 3.0
"""Radians: a path that turns by more is taken to turn back on itself."""


def grow(region: Region, distance: float) -> Region:
    """All points within ``distance`` of the region (round at its corners); shrinks if negative."""
    if distance < 0:
        return shrink(region, -distance)
    if distance < EPSILON or region.is_empty:
        return region
    return _grown(region, distance)


@remembered
def _grown(region: Region, distance: float) -> Region:
    chains = [_chain(contour, distance) for contour in region.contours]
    return enclosed([chain for chain in chains if chain.edges])


def shrink(region: Region, distance: float) -> Region:
    """The points at least ``distance`` inside the region."""
    if distance < 0:
        return grow(region, -distance)
    if distance < EPSILON or region.is_empty:
        return region
    return _shrunk(region, distance)


@remembered
def _shrunk(region: Region, distance: float) -> Region:
    # What is outside grows: the chains wind round it 0 times, or more; round what is left, -1.
    outside = [contour.reversed() for contour in region.contours]
    chains = [_chain(contour, distance) for contour in outside]
    return enclosed([chain.reversed() for chain in chains if chain.edges])


def fillet(region: Region, radius: float) -> Region:
    """The region with every concave corner rounded to ``radius``, gaps narrower filled."""
    return shrink(grow(region, radius), radius)


def _chain(contour: Contour, distance: float) -> Contour:
    """A closed chain that winds round what the contour does, and the bands beside its edges."""
    if contour.circle is not None and alone(contour):
        centre, radius = contour.circle
        radius += -distance if contour.is_hole else distance
        if radius > FAR:
            return circle(centre, radius).reversed() if contour.is_hole else circle(centre, radius)
    moved = list(_moved(contour, distance))
    chain = Contour(tuple(_joined_up(moved)))
    corners = {edge.start for edge in contour.edges}
    # Where it goes by way of a corner, it meets itself.
    return meets_itself(chain) if any(edge.end in corners for edge in moved) else chain


def _joined_up(edges: Sequence[Edge]) -> Iterator[Edge]:
    """The edges, those that follow each other but for a rounding by way of one point."""
    starts = [edge.start for edge in edges]
    for i, start in enumerate(starts):
        end = edges[i - 1].end
        if end < start and math.dist(end, start) < EPSILON:
            starts[i] = end
    for edge, start, following in zip(edges, starts, (*starts[1:], *starts[:1]), strict=True):
        end = following if math.dist(edge.end, following) < EPSILON else edge.end
        yield edge if start == edge.start and end == edge.end else edge.part(start, end)


def _moved(contour: Contour, distance: float) -> Iterator[Edge]:
    """The edges of such a chain.

    The band of an edge reaches ``distance`` to its right. Bands that overlap at a corner are walked
    round one by one, by way of the corner, or straight on where both cover the difference.
    """
    edges = contour.edges
    moved = [edge.offset(distance) for edge in edges]
    for i, edge in enumerate(edges):
        before, after = moved[i - 1], moved[i]
        start = before.end if before is not None else _centre(edges[i - 1])
        end = after.start if after is not None else _centre(edge)
        corner = edge.start
        arcs = list(_corner_arcs(edges[i - 1], edge, distance))
        way: list[Edge] = list(arcs)
        if arcs:
            stops = [start, arcs[0].start], [arcs[-1].end, end]
            way = [*_lines(stops[0]), *arcs, *_lines(stops[1])]
        elif math.dist(start, end) >= EPSILON:
            way = _lines(
                [start, end] if _both_cover(edges[i - 1], edge, distance) else [start, corner, end]
            )
        yield from way
        if after is not None:
            yield after


def _both_cover(before: Edge, after: Edge, distance: float) -> bool:
    """Whether the bands of two lines both hold the triangle of a corner and the ends beside it."""
    if not (isinstance(before, Line) and isinstance(after, Line)):
        return False
    turn = left_turn(before, after)
    return turn > -1 and min(before.length, after.length) > -distance * math.sin(turn)


def _centre(edge: Edge) -> Point:
    assert isinstance(edge, Arc)
    return edge.centre


def _lines(stops: Sequence[Point]) -> list[Edge]:
    return [Line(a, b) for a, b in pairwise(stops) if math.dist(a, b) > EPSILON]


def _corner_arcs(before: Edge, after: Edge, distance: float) -> Iterator[Arc]:
    """The arcs round a convex corner; none where the path is smooth or turns the other way.

    At the tip of a cusp rounding decides whether the path turns left or right, so there it gets
    its arcs either way: round the end of a notch they lie in the material, and fall away.
    """
    turn = left_turn(before, after)
    if -CUSP < turn < EPSILON / distance:
        return
    x, y = after.start
    ux, uy = before.direction(after.start)
    heading, sweep = math.atan2(-ux, uy), turn % math.tau
    count = 2 if sweep > CUSP else 1
    vx, vy = after.direction(after.start)
    between = [heading + sweep * k / count for k in range(1, count)]
    stops = [(uy, -ux), *((math.cos(t), math.sin(t)) for t in between), (vy, -vx)]
    points = [(x + nx * distance, y + ny * distance) for nx, ny in stops]
    for start, end in pairwise(points):
        yield Arc(start, end, (x, y), distance, True)
