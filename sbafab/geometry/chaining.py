"""Loose edges chained to closed loops, and how deep loops lie in each other."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

from sbafab.geometry.contour import Contour
from sbafab.geometry.edges import EPSILON, Edge, Point, edge_from_bulge
from sbafab.geometry.spatial_index import close_pairs

CELL = 16.0
"""Width of the cells that known ends are kept in, over the distance at which they are joined."""


class LooseEndError(ArithmeticError):
    """An end that does not meet exactly one other: its place, the number of ends there, and the
    distance to the next loose end, mm.
    """

    def __init__(self, place: Point, ends: int, gap: float = 0.0) -> None:
        super().__init__(f"{ends} ends meet at x {place[0]:.4f}, y {place[1]:.4f}")
        self.place, self.ends, self.gap = place, ends, gap


def chained(edges: Sequence[Edge], within: float) -> list[list[Edge]]:
    """Return closed loops of loose edges in any order and sense, whose ends meet to ``within`` mm.

    Raises LooseEndError.
    """
    joints = _joints([p for edge in edges for p in (edge.start, edge.end)], within)
    snapped: list[Edge] = []
    at: dict[Point, list[int]] = {}
    for edge in edges:
        start, end = joints[edge.start], joints[edge.end]
        if start == end and edge.length <= 2 * within:
            # Shorter than ends may lie apart: a part of the corner that others make.
            at.setdefault(start, [])
        else:
            snapped.append(_between(edge, start, end))
    for index, edge in enumerate(snapped):
        at.setdefault(edge.start, []).append(index)
        at.setdefault(edge.end, []).append(index)
    loose = [place for place, ends in at.items() if len(ends) < 2]
    if loose:
        gap = min((math.dist(loose[0], place) for place in loose[1:]), default=0.0)
        raise LooseEndError(loose[0], len(at[loose[0]]), gap)
    crowded = next((place for place, ends in at.items() if len(ends) > 2), None)
    if crowded is not None:
        raise LooseEndError(crowded, len(at[crowded]))
    unused = set(range(len(snapped)))
    loops = []
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
        loops.append(loop)
    return loops


def _joints(ends: Sequence[Point], within: float) -> dict[Point, Point]:
    """Return the joint of each end.

    Two ends that meet exactly stay in place, however near others lie; the remaining ends are joined
    ``within`` that.
    """
    joints = _nearest_known(ends, EPSILON)
    meeting = Counter(joints[p] for p in ends)
    apart = [joints[p] for p in ends if meeting[joints[p]] != 2]
    moved = _nearest_known(apart, within)
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


def depths(contours: Sequence[Contour]) -> list[int]:
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
