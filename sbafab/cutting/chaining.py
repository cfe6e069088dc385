"""From drawn edges to a region: loose edges chained, contours kept apart, nesting checked."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence

from sbafab.cutting.cut_layers import CUT_INNER, CUT_OUTER
from sbafab.errors import OutputError
from sbafab.geometry.boolean import LEAST_AREA, tidy
from sbafab.geometry.edges import EPSILON, Edge, Point
from sbafab.geometry.intersect import meeting_points
from sbafab.geometry.nearby import close_pairs
from sbafab.geometry.pool import PointPool
from sbafab.geometry.region import Contour, Region, same_support


def closed_loops(edges: Sequence[Edge]) -> list[Contour]:
    """Contours from loose edges in any order and sense.

    Raises OutputError at an end that has not exactly one other to go on with.
    """
    pool = PointPool(p for edge in edges for p in (edge.start, edge.end))
    snapped = [edge.part(pool.snapped(edge.start), pool.snapped(edge.end)) for edge in edges]
    at: dict[Point, list[int]] = defaultdict(list)
    for index, edge in enumerate(snapped):
        at[edge.start].append(index)
        at[edge.end].append(index)
    for (x, y), ends in at.items():
        if len(ends) == 1:
            raise OutputError(f"contour open at x {x:.3f}, y {y:.3f}; close it.")
        if len(ends) > 2:
            raise OutputError(
                f"{len(ends)} edges end at x {x:.3f}, y {y:.3f}, where a contour has two; "
                "remove what is drawn twice."
            )
    left = set(range(len(snapped)))
    contours = []
    for index, edge in enumerate(snapped):
        if index not in left:
            continue
        left.remove(index)
        loop = [edge]
        while loop[-1].end != edge.start:
            here = loop[-1].end
            follower = next(i for i in at[here] if i in left)
            left.remove(follower)
            step = snapped[follower]
            loop.append(step if step.start == here else step.reversed())
        contours.append(Contour(tuple(loop)))
    return contours


def check_clear(contours: Sequence[Contour]) -> None:
    """Raises OutputError where an edge is drawn twice or contours touch or cross."""
    owned = [
        (edge, number, place)
        for number, contour in enumerate(contours)
        for place, edge in enumerate(contour.edges)
    ]
    for i, j in close_pairs([edge.bounds for edge, *_ in owned], EPSILON):
        (a, owner_a, place_a), (b, owner_b, place_b) = owned[i], owned[j]
        points = meeting_points(a, b)
        if not points:
            continue
        x, y = points[0]
        along = same_support(a, b) or same_support(a, b.reversed())
        if along and max(math.dist(points[0], p) for p in points) > 2 * EPSILON:
            raise OutputError(f"edge drawn twice at x {x:.3f}, y {y:.3f}; remove one.")
        steps = (place_a - place_b) % len(contours[owner_a].edges)
        neighbours = owner_a == owner_b and steps in (1, len(contours[owner_a].edges) - 1)
        if not neighbours:
            raise OutputError(f"contours touch or cross at x {x:.3f}, y {y:.3f}; part them.")


def nested_region(inner: Sequence[Contour], outer: Sequence[Contour]) -> Region:
    """The region with these holes and outlines, in whichever sense they were drawn.

    Raises OutputError for a contour whose nesting is not what its layer says.
    """
    drawn = [*inner, *outer]
    turned = []
    for index, (contour, depth) in enumerate(zip(drawn, _depths(drawn), strict=True)):
        is_hole = index < len(inner)
        x, y = contour.edges[0].start
        if (depth % 2 == 1) != is_hole:
            found, layer = ("an outline", CUT_INNER) if is_hole else ("a hole", CUT_OUTER)
            raise OutputError(
                f"contour at x {x:.3f}, y {y:.3f} is {found} but on {layer}; move it to "
                f"{CUT_OUTER if is_hole else CUT_INNER}."
            )
        if abs(contour.area) < LEAST_AREA:
            raise OutputError(f"contour at x {x:.3f}, y {y:.3f} encloses nothing; remove it.")
        right = contour if contour.is_hole == is_hole else contour.reversed()
        turned.append(tidy(right.edges) or right)
    return Region(tuple(turned))


def _depths(contours: Sequence[Contour]) -> list[int]:
    """How many of the others hold each contour, by a sweep along x."""
    places = [contour.edges[0].at(0.5) for contour in contours]
    coming = sorted(range(len(contours)), key=lambda i: contours[i].bounds[0], reverse=True)
    depths = [0] * len(contours)
    active: list[int] = []
    for here in sorted(range(len(contours)), key=lambda i: places[i][0]):
        p = places[here]
        while coming and contours[coming[-1]].bounds[0] <= p[0]:
            active.append(coming.pop())
        active = [i for i in active if contours[i].bounds[2] >= p[0]]
        depths[here] = sum(_holds(contours[i], p) for i in active if i != here)
    return depths


def _holds(contour: Contour, p: Point) -> bool:
    low_x, low_y, high_x, high_y = contour.bounds
    return low_x <= p[0] <= high_x and low_y <= p[1] <= high_y and contour.winding(p) != 0
