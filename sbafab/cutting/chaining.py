"""From drawn edges to a region: loose edges chained, contours kept apart, nesting checked."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence

from sbafab.cutting.cut_layers import CUT_INNER, CUT_OUTER
from sbafab.errors import OutputError
from sbafab.geometry.boolean import LEAST_AREA, PointPool, tidy
from sbafab.geometry.edges import EPSILON, Edge, Point
from sbafab.geometry.intersect import meeting_points
from sbafab.geometry.nearby import close_pairs
from sbafab.geometry.region import Contour, Region, same_support


def closed_loops(edges: Sequence[Edge]) -> list[Contour]:
    """Contours from loose edges in any order and sense.

    Raises OutputError at an end that has not exactly one other to go on with.
    """
    pool = PointPool()
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
        steps = (place_a - place_b) % len(contours[owner_a].edges)
        neighbours = owner_a == owner_b and steps in (1, len(contours[owner_a].edges) - 1)
        along = same_support(a, b) or same_support(a, b.reversed())
        # Neighbours meet at their common end; where they run along each other is what matters.
        if neighbours and not along:
            continue
        points = meeting_points(a, b)
        if not points:
            continue
        x, y = points[0]
        if along and max(math.dist(points[0], p) for p in points) > 2 * EPSILON:
            raise OutputError(f"edge drawn twice at x {x:.3f}, y {y:.3f}; remove one.")
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
    """How many of the others hold each contour."""
    count = len(contours)
    places = [contour.edges[0].at(0.5) for contour in contours]
    depths = [0] * count
    boxes = [*(contour.bounds for contour in contours), *((*p, *p) for p in places)]
    for pair in close_pairs(boxes, 0.0):
        holder, held = min(pair), max(pair) - count
        if holder < count and held >= 0 and held != holder:
            depths[held] += contours[holder].winding(places[held]) != 0
    return depths
