"""From drawn edges to a region: chains loose edges, checks clearance and nesting of contours."""

from __future__ import annotations

import math
from collections.abc import Sequence

from sbafab.cutting.cut_settings import CUT_INNER, CUT_OUTER
from sbafab.errors import OutputError
from sbafab.geometry.chaining import LooseEndError, chained, depths
from sbafab.geometry.contour import LEAST_AREA, Contour, circle, tidy
from sbafab.geometry.edges import EPSILON, Edge, Point, meeting_points, same_support
from sbafab.geometry.region import Region
from sbafab.geometry.spatial_index import close_pairs

JOINED = 0.002
"""mm: largest distance of two ends within 1 um of one corner, as cut files promise."""
TANGENT = 0.1
"""mm: so near the joint of two edges they may meet again if they are tangent and rounded."""


def closed_loops(edges: Sequence[Edge]) -> list[Contour]:
    """Return contours from loose edges in any order and direction, whose ends meet within JOINED.

    Raises OutputError at an end that does not meet exactly one other end.
    """
    try:
        return [Contour(tuple(loop)) for loop in chained(edges, JOINED)]
    except LooseEndError as error:
        x, y = error.place
        if error.ends < 2:
            raise OutputError(f"contour open at x {x:.3f}, y {y:.3f}; close it.") from None
        raise OutputError(
            f"{error.ends} edges end at x {x:.3f}, y {y:.3f}, where a contour has two; "
            "remove duplicates."
        ) from None


def check_clear(contours: Sequence[Contour]) -> None:
    """Raise OutputError if an edge is drawn twice or contours touch or cross."""
    places = [(contour, number) for contour in contours for number in range(len(contour.edges))]
    for pair in close_pairs([box for contour in contours for box in contour.boxes], EPSILON):
        (first, i), (second, j) = (places[number] for number in pair)
        a, b, count = first.edges[i], second.edges[j], len(first.edges)
        _check_edges(a, b, first is second and (i - j) % count in (1, count - 1))


def _check_edges(a: Edge, b: Edge, neighbours: bool) -> None:
    goes_on, turns_back = same_support(a, b), same_support(a, b.reversed())
    points = [] if neighbours and goes_on else meeting_points(a, b)
    if neighbours and not turns_back:
        ends = {a.start, a.end} & {b.start, b.end}
        points = [p for p in points if min(math.dist(p, end) for end in ends) > TANGENT]
    if not points:
        return
    x, y = points[0]
    if (goes_on or turns_back) and max(math.dist(points[0], p) for p in points) > 2 * EPSILON:
        raise OutputError(f"edge drawn twice at x {x:.3f}, y {y:.3f}; remove one.")
    if not (neighbours and turns_back):
        raise OutputError(f"contours touch or cross at x {x:.3f}, y {y:.3f}; separate them.")


def nested_region(inner: Sequence[Contour], outer: Sequence[Contour]) -> Region:
    """Return the region with these holes and outlines, drawn in either direction.

    Raises OutputError for a contour whose nesting contradicts its layer.
    """
    drawn = [*inner, *outer]
    turned = []
    for index, (contour, depth) in enumerate(zip(drawn, depths(drawn), strict=True)):
        is_hole = index < len(inner)
        x, y = contour.edges[0].start
        if (depth % 2 == 1) != is_hole:
            role, layer = ("an outline", CUT_INNER) if is_hole else ("a hole", CUT_OUTER)
            raise OutputError(
                f"contour at x {x:.3f}, y {y:.3f} is {role} but on {layer}; move it to "
                f"{CUT_OUTER if is_hole else CUT_INNER}."
            )
        if abs(contour.area) < LEAST_AREA:
            raise OutputError(f"contour at x {x:.3f}, y {y:.3f} encloses nothing; remove it.")
        right = contour if contour.is_hole == is_hole else contour.reversed()
        turned.append(_whole(right, *right.circle) if right.circle else tidy(right.edges) or right)
    return Region(tuple(turned))


def _whole(contour: Contour, centre: Point, radius: float) -> Contour:
    """Return a circle as four quarter arcs from its rightmost point; unchanged if already so."""
    (x, y), is_hole = centre, contour.is_hole
    compass = [(x + radius, y), (x, y + radius), (x - radius, y), (x, y - radius)]
    if is_hole:
        compass[1:] = compass[:0:-1]
    if [edge.start for edge in contour.edges] == compass:
        return contour
    whole = circle(centre, radius)
    return whole.reversed() if is_hole else whole
