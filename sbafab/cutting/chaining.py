"""From drawn edges to a region: loose edges chained, contours kept apart, nesting checked."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

from sbafab.cutting.cut_settings import CUT_INNER, CUT_OUTER
from sbafab.errors import OutputError
from sbafab.geometry.contour import LEAST_AREA, Contour, circle, tidy
from sbafab.geometry.edges import (
    EPSILON,
    Edge,
    Point,
    edge_from_bulge,
    meeting_points,
    same_support,
)
from sbafab.geometry.region import Region
from sbafab.geometry.spatial_index import close_pairs

JOINED = 0.002
"""mm: largest distance of two ends within 1 um of one corner, as cut files promise."""
CELL = 16.0
"""Width of the cells that known ends are kept in, over the distance at which they are joined."""


def closed_loops(edges: Sequence[Edge]) -> list[Contour]:
    """Contours from loose edges in any order and sense, whose ends meet to within JOINED.

    Raises OutputError at an end that does not meet exactly one other end.
    """
    joints = _joints([p for edge in edges for p in (edge.start, edge.end)])
    snapped: list[Edge] = []
    at: dict[Point, list[int]] = {}
    for edge in edges:
        start, end = joints[edge.start], joints[edge.end]
        if start == end and edge.length <= 2 * JOINED:
            # Shorter than ends may lie apart: a part of the corner that others make.
            at.setdefault(start, [])
        else:
            snapped.append(_between(edge, start, end))
    for index, edge in enumerate(snapped):
        at.setdefault(edge.start, []).append(index)
        at.setdefault(edge.end, []).append(index)
    for (x, y), ends in at.items():
        if len(ends) < 2:
            raise OutputError(f"contour open at x {x:.3f}, y {y:.3f}; close it.")
        if len(ends) > 2:
            raise OutputError(
                f"{len(ends)} edges end at x {x:.3f}, y {y:.3f}, where a contour has two; "
                "remove what is drawn twice."
            )
    unused = set(range(len(snapped)))
    contours = []
    for index, edge in enumerate(snapped):
        if index not in unused:
            continue
        unused.remove(index)
        loop = [edge]
        while loop[-1].end != edge.start:
            here = loop[-1].end
            follower = next(i for i in at[here] if i in unused)
            unused.remove(follower)
            step = snapped[follower]
            loop.append(step if step.start == here else step.reversed())
        contours.append(Contour(tuple(loop)))
    return contours


def _joints(ends: Sequence[Point]) -> dict[Point, Point]:
    """Return the joint of each end.

    Two ends that meet exactly stay in place, however near others lie; the remaining ends are joined
    within JOINED.
    """
    joints = _nearest_known(ends, EPSILON)
    meeting = Counter(joints[p] for p in ends)
    apart = [joints[p] for p in ends if meeting[joints[p]] != 2]
    moved = _nearest_known(apart, JOINED)
    return {p: moved.get(joint, joint) for p, joint in joints.items()}


def _nearest_known(points: Sequence[Point], within: float) -> dict[Point, Point]:
    """For each point the nearest one known before it, if that is near enough, or itself."""
    # Cells wide enough that most points are near only to points of the same cell.
    side = CELL * within
    cells: dict[tuple[int, int], list[Point]] = {}
    joints: dict[Point, Point] = {}
    for p in points:
        if p in joints:
            continue
        x, y = p
        near = [
            q
            for i in range(math.floor((x - within) / side), math.floor((x + within) / side) + 1)
            for j in range(math.floor((y - within) / side), math.floor((y + within) / side) + 1)
            for q in cells.get((i, j), ())
        ]
        joint = min(near, key=lambda q: math.dist(p, q), default=p)
        joints[p] = joint if math.dist(p, joint) <= within else p
        if joints[p] is p:
            cells.setdefault((math.floor(x / side), math.floor(y / side)), []).append(p)
    return joints


def _between(edge: Edge, start: Point, end: Point) -> Edge:
    """The edge with its ends moved onto joints; an arc keeps its turn, so that it still fits."""
    moved = max(math.dist(edge.start, start), math.dist(edge.end, end))
    if moved < 2 * EPSILON:
        return edge.part(start, end)
    return edge_from_bulge(start, end, edge.bulge)


def check_clear(contours: Sequence[Contour]) -> None:
    """Raise OutputError if an edge is drawn twice or contours touch or cross."""
    places = [(contour, number) for contour in contours for number in range(len(contour.edges))]
    for pair in close_pairs([box for contour in contours for box in contour.boxes], EPSILON):
        (first, i), (second, j) = (places[number] for number in pair)
        a, b, count = first.edges[i], second.edges[j], len(first.edges)
        neighbours = first is second and (i - j) % count in (1, count - 1)
        # One goes on where the other ends, and neither is more than half a turn: of neighbours,
        # only those that turn back run along each other.
        if not neighbours or same_support(a, b.reversed()):
            _check_edges(a, b, neighbours)


def _check_edges(a: Edge, b: Edge, neighbours: bool) -> None:
    points = meeting_points(a, b)
    if not points:
        return
    x, y = points[0]
    along = same_support(a, b) or same_support(a, b.reversed())
    if along and max(math.dist(points[0], p) for p in points) > 2 * EPSILON:
        raise OutputError(f"edge drawn twice at x {x:.3f}, y {y:.3f}; remove one.")
    if not neighbours:
        raise OutputError(f"contours touch or cross at x {x:.3f}, y {y:.3f}; part them.")


def nested_region(inner: Sequence[Contour], outer: Sequence[Contour]) -> Region:
    """The region with these holes and outlines, drawn in either sense.

    Raises OutputError for a contour whose nesting contradicts its layer.
    """
    drawn = [*inner, *outer]
    turned = []
    for index, (contour, depth) in enumerate(zip(drawn, _depths(drawn), strict=True)):
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
    """A circle as four quarter arcs from its rightmost point on; unchanged if already drawn so."""
    (x, y), is_hole = centre, contour.is_hole
    compass = [(x + radius, y), (x, y + radius), (x - radius, y), (x, y - radius)]
    if is_hole:
        compass[1:] = compass[:0:-1]
    if [edge.start for edge in contour.edges] == compass:
        return contour
    whole = circle(centre, radius)
    return whole.reversed() if is_hole else whole


def _depths(contours: Sequence[Contour]) -> list[int]:
    """Return the number of other contours that enclose each contour."""
    count = len(contours)
    places = [contour.edges[0].at(0.5) for contour in contours]
    depths = [0] * count
    boxes = [*(contour.bounds for contour in contours), *((*p, *p) for p in places)]
    for pair in close_pairs(boxes, 0.0):
        holder, inner = min(pair), max(pair) - count
        if holder < count and inner >= 0 and inner != holder:
            depths[inner] += contours[holder].winding(places[inner]) != 0
    return depths
