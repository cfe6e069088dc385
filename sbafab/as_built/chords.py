"""Runs of chords that are meant as an arc: found where none should be, and made one again."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

from sbafab.geometry.edges import Arc, Edge, Point
from sbafab.geometry.region import Contour, Region
from sbafab.geometry.shapes import circle

ON_CIRCLE = 1e-5
"""mm by which the ends of chords may miss their circle."""
LEAST_CHORDS = 5
WIDEST_STEP = math.radians(20)
"""So many chords, each turning less than this on one circle, are meant as an arc."""


class ChordRun(NamedTuple):
    """Consecutive chords of one circle: their ends, and the circle."""

    points: tuple[Point, ...]
    centre: Point
    radius: float


def chorded_place(region: Region) -> Point | None:
    """Where a run of chords stands in for an arc; None if there is none."""
    for contour in region.contours:
        for run in _runs(_ends(contour)):
            if len(run.points) > LEAST_CHORDS:
                return run.points[0]
    return None


def with_arcs(contour: Contour) -> Contour:
    """The contour of lines with arcs through every run of chords that are meant as one."""
    points = _ends(contour)
    if len(points) != len(contour.edges):
        return contour
    runs = list(_runs(points))
    if len(runs) == 1 and len(runs[0].points) == len(points) + 1:
        whole = circle(runs[0].centre, runs[0].radius)
        return whole.reversed() if contour.is_hole else whole
    edges: dict[Point, tuple[Edge, ...]] = {run.points[0]: _arcs(run) for run in runs}
    inside = {point for run in runs for point in run.points[1:-1]}
    rebuilt: list[Edge] = []
    for edge in contour.edges:
        if edge.start in edges:
            rebuilt += edges[edge.start]
        elif edge.start not in inside:
            rebuilt.append(edge)
    return Contour(tuple(rebuilt))


def _ends(contour: Contour) -> list[Point]:
    """Where the contour's lines start; arcs leave a point that lies on no circle."""
    points: list[Point] = []
    for edge in contour.edges:
        points.append(edge.start)
        if isinstance(edge, Arc):
            points.append((math.nan, math.nan))
    return points


def _arcs(run: ChordRun) -> tuple[Edge, ...]:
    """The run as arcs of at most a quarter turn."""
    stops, swept = [run.points[0]], 0.0
    for a, b in pairwise(run.points):
        step = 2 * math.asin(min(1.0, math.dist(a, b) / (2 * run.radius)))
        if swept + step > math.pi / 2 + 1e-6:
            stops.append(a)
            swept = 0.0
        swept += step
    stops.append(run.points[-1])
    ccw = _turn(*run.points[:3]) > 0
    return tuple(Arc(a, b, run.centre, run.radius, ccw) for a, b in pairwise(stops))


def _runs(points: list[Point]) -> Iterator[ChordRun]:
    """Longest runs of at least three short chords on one circle, turning one way."""
    count = len(points)
    if count < 4:
        return
    first = next((i for i in range(count) if not _is_run(points, i - 1)), None)
    if first is None:
        found = _circle(points[0], points[count // 3], points[2 * count // 3])
        if found is not None:
            yield ChordRun((*points, points[0]), *found)
        return
    # No run reaches over both ends of this ring, whose first chord comes again as its last.
    ring = [points[(first + i) % count] for i in range(count + 2)]
    start, last = 0, count + 1
    while start + 2 <= last:
        end = start + 2
        while end + 1 <= last and _is_run(ring, end - 2):
            end += 1
        run = tuple(ring[start : end + 1])
        found = _circle(run[0], run[len(run) // 2], run[-1])
        if found is None or len(run) < 4:
            start += 1
            continue
        if start == 0:
            last -= 1
        yield ChordRun(run, *found)
        start = end


def _is_run(points: list[Point], first: int) -> bool:
    """Whether four points from ``first`` on lie on one circle, near each other, turning one way."""
    a, b, c, d = (points[(first + i) % len(points)] for i in range(4))
    found = _circle(a, b, c)
    if found is None or _turn(a, b, c) * _turn(b, c, d) <= 0:
        return False
    centre, radius = found
    longest = max(math.dist(a, b), math.dist(b, c), math.dist(c, d))
    return abs(math.dist(d, centre) - radius) < ON_CIRCLE and _narrow(longest, radius)


def _narrow(length: float, radius: float) -> bool:
    """Whether a chord is short enough, beside its circle, to stand for an arc."""
    return length < 2 * math.sin(WIDEST_STEP / 2) * radius


def _turn(a: Point, b: Point, c: Point) -> float:
    return (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])


def _circle(a: Point, b: Point, c: Point) -> tuple[Point, float] | None:
    """Centre and radius of the circle through three points; None if they lie on a line."""
    ux, uy, vx, vy = b[0] - a[0], b[1] - a[1], c[0] - a[0], c[1] - a[1]
    cross = 2 * (ux * vy - uy * vx)
    if abs(cross) < 1e-9:
        return None
    uu, vv = ux * ux + uy * uy, vx * vx + vy * vy
    x, y = (vy * uu - uy * vv) / cross, (ux * vv - vx * uu) / cross
    return (a[0] + x, a[1] + y), math.hypot(x, y)
