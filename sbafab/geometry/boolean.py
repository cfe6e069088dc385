"""Boolean operations on regions of lines and arcs, exact but for points that are made one (SAME).

The edges of all regions are laid over each other; a piece stays if what is asked for lies on one
side of it only; the pieces that stay are chained into contours. Nothing is flattened on the way.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache
from typing import TypeVar

from sbafab.errors import SbafabError
from sbafab.geometry.arrangement import Arrangement, InconsistentError
from sbafab.geometry.edges import (
    EPSILON,
    SAME,
    Arc,
    Edge,
    Line,
    Point,
    distance_to,
    left_normal,
    quarter_arcs,
)
from sbafab.geometry.facets import run_sweep
from sbafab.geometry.nearby import close_pairs
from sbafab.geometry.pieces import by_owner, overlaid
from sbafab.geometry.region import Contour, Region
from sbafab.geometry.remembered import MOST
from sbafab.geometry.shapes import circle

Found = TypeVar("Found")

LEAST_AREA = 1e-7
"""Contours that enclose less, in mm2, are rounding dust; so are those thinner than 4 EPSILON, as
they are on average where no place in them is ROOM wide.
"""
ROOM = 50 * EPSILON
"""mm: a tenth of a micrometre."""
QUARTER = math.pi / 2
WAYS = (1, 4, 16, 64)
"""With how many EPSILON edges are cut where they meet, tried in turn; by the last, points within a
quarter of a micrometre are one.
"""


class GeometryError(SbafabError, ArithmeticError):
    """An operation on regions came out inconsistent; the message says where."""


def union(regions: Iterable[Region]) -> Region:
    solid = [region for region in regions if not region.is_empty]
    if len(solid) < 2:
        return solid[0] if solid else Region()
    if _are_separate_discs(solid):
        return _region([contour.edges for region in solid for contour in region.contours])
    return wound([edge for region in solid for edge in region.edges], 0)


def _are_separate_discs(regions: Sequence[Region]) -> bool:
    """Whether each is one whole circle, apart from all others: then nothing is to be cut."""
    for region in regions:
        if len(region.contours) > 1 or region.contours[0].circle is None or region.area <= 0:
            return False
        # Arcs that were read from a file may differ in their last digits.
        if len({(edge.centre, edge.radius) for edge in region.edges if isinstance(edge, Arc)}) > 1:
            return False
    boxes = [region.bounds for region in regions]
    return next(close_pairs(boxes, 2 * SAME), None) is None


def intersection(a: Region, b: Region) -> Region:
    if a.is_empty or b.is_empty:
        return Region()
    return wound([*a.edges, *b.edges], 1)


def difference(a: Region, b: Region) -> Region:
    if a.is_empty or b.is_empty:
        return a
    return wound([*a.edges, *(edge.reversed() for edge in b.edges)], 0)


def divided(region: Region, by: Region) -> tuple[Region, Region]:
    """What of a region lies outside another, and what inside: ``region - by`` and ``region & by``.

    Both come of one arrangement.
    """
    if region.is_empty or by.is_empty:
        return region, Region()
    return _divided(tuple(region.edges), tuple(by.edges))


@lru_cache(maxsize=MOST)
def _divided(edges: tuple[Edge, ...], by: tuple[Edge, ...]) -> tuple[Region, Region]:
    def contours(found: Arrangement) -> tuple[Region, Region]:
        winds = {turns: by_owner(turns, 2) for turns in set(found.left)}
        outside = {turns for turns, (own, other) in winds.items() if own > 0 >= other}
        inside = {turns for turns, (own, other) in winds.items() if own > 0 and other > 0}
        return _enclosed(found, found.edging(outside)), _enclosed(found, found.edging(inside))

    return arranged([edges, by], contours)


def wound(edges: Sequence[Edge], above: int) -> Region:
    """The points that closed chains of edges wind round more than ``above`` times.

    Raises GeometryError where no way to cut the edges where they meet gives one answer.
    """
    return _wound(tuple(edges), above)


@lru_cache(maxsize=MOST)
def _wound(edges: tuple[Edge, ...], above: int) -> Region:
    return arranged([edges], lambda found: _enclosed(found, found.borders(above)))


def _enclosed(found: Arrangement, borders: Sequence[int]) -> Region:
    return _region(found.loops(borders))


def _region(loops: Iterable[Sequence[Edge]]) -> Region:
    """The region inside closed chains that meet nowhere."""
    contours = [contour for contour in map(tidy, loops) if contour is not None]
    return Region(tuple(sorted(contours, key=_reading_order)))


def arranged(owners: Sequence[Iterable[Edge]], read: Callable[[Arrangement], Found]) -> Found:
    """What is read from the closed chains of edges of all owners, laid over each other.

    Raises GeometryError where no way to cut the edges where they meet gives one answer.
    """
    place: Point | None = None
    for coarser in WAYS:
        try:
            return read(Arrangement(overlaid(owners, coarser * EPSILON)))
        except InconsistentError as fault:
            place = place or fault.args[0]
    x, y = place or (0.0, 0.0)
    raise GeometryError(
        f"edges that nearly meet at x {x:.6f}, y {y:.6f} cannot be told apart; change a size "
        "there by 0.001 mm"
    )


def _reading_order(contour: Contour) -> tuple[bool, float, float, float]:
    low_x, low_y, high_x, _ = contour.bounds
    return contour.is_hole, round(low_x, 6), round(low_y, 6), round(high_x, 6)


def tidy(loop: Sequence[Edge]) -> Contour | None:
    """One contour with edges of one support joined and arcs of at most a quarter turn."""
    contour = Contour(tuple(loop))
    if abs(contour.area) < LEAST_AREA:
        return None
    if abs(contour.area) < 2 * EPSILON * contour.length and not _has_room(contour):
        return None
    if contour.circle is not None:
        whole = circle(*contour.circle)
        return whole if contour.area > 0 else whole.reversed()
    edges = [edge for run in contour.runs for edge in _joined(run)]
    first = min(range(len(edges)), key=lambda i: _rounded(edges[i].start))
    return Contour((*edges[first:], *edges[:first]))


def _has_room(contour: Contour) -> bool:
    """Whether there is a place in a contour of hardly any width, beside an edge, that is ROOM wide.

    A long sliver would hide it in its average.
    """
    into = -ROOM / 2 if contour.area < 0 else ROOM / 2
    for edge in contour.edges:
        if edge.length < ROOM:
            continue
        for share in (0.25, 0.5, 0.75):
            x, y = edge.at(share)
            nx, ny = left_normal(edge, (x, y))
            p = (x + into * nx, y + into * ny)
            if contour.winding(p) and all(
                distance_to(other, p) > 0.99 * ROOM / 2 for other in contour.edges
            ):
                return True
    return False


def _rounded(p: Point) -> Point:
    return round(p[0], 6), round(p[1], 6)


def _joined(run: Sequence[Edge]) -> Sequence[Edge]:
    head, end = run[0], run[-1].end
    if isinstance(head, Line):
        return [Line(head.start, end)]
    if len(run) == 1 and 0 < (head.sweep if head.ccw else -head.sweep) < QUARTER:
        return run
    return quarter_arcs(head.start, end, head.centre, head.radius, run_sweep(run))
