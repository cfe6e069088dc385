"""Parts computed from beam paths by removing the kerf, and chords replaced by arcs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

from sbafab.cutting.chaining import check_clear
from sbafab.errors import OutputError
from sbafab.geometry.contour import Contour, circle, tidy
from sbafab.geometry.edges import EPSILON, Arc, Edge, Line, Point
from sbafab.geometry.offset import Kerf, rim, shrink, widths
from sbafab.geometry.region import Region

KINK = 0.05
"""Smallest turn of a corner, radians; arcs along one curve turn less where they join."""
STEP = math.radians(5)
"""Largest turn of a chord round a corner."""
CORNER_SHARE = 0.15
"""At a corner, the part's edge is shorter than this share of the path's."""


def remove_kerf(path: Region, kerf: Kerf) -> Region:
    """Return the part inside a path; raises OutputError, or is empty, if no such part exists."""
    a, b = (width / 2 for width in widths(kerf))
    if a == b:
        return shrink(path, a)
    region = Region(tuple(_part_contour(contour, a, b) for contour in path.contours))
    check_clear(region.contours)
    return region


class _Vertex(NamedTuple):
    """A point of the path and of the part; True if a straight edge ends, or starts, there."""

    path: Point
    part: Point
    is_straight: bool
    goes_straight: bool


def _part_contour(contour: Contour, a: float, b: float) -> Contour:
    """Return the contour of the part: each vertex of the path lies on the exact curve."""
    vertices: list[_Vertex] = []
    for vertex in (vertex for joint in _joints(contour) for vertex in _vertices(*joint, a, b)):
        if vertices and _share_corner(vertices[-1], vertex):
            # The ends of straight edges tell the corner best.
            best = vertex if vertex.is_straight else vertices[-1]
            vertices[-1] = best._replace(path=vertex.path, goes_straight=vertex.goes_straight)
        else:
            vertices.append(vertex)
    if len(vertices) > 1 and _share_corner(vertices[-1], vertices[0]):
        vertices.pop() if vertices[0].is_straight else vertices.pop(0)
    part = tidy(with_arcs(_chords(vertices)).edges) if _is_sound(vertices) else None
    if part is None or part.is_hole != contour.is_hole:
        x, y = contour.edges[0].start
        raise OutputError(f"the contour at x {x:.3f}, y {y:.3f} is lost in its kerf")
    return part


def _chords(vertices: Sequence[_Vertex]) -> Contour:
    """Return lines between the vertices; a straight edge is two, and so no chord of a circle."""
    points: list[Point] = []
    for spot, after in zip(vertices, (*vertices[1:], vertices[0]), strict=True):
        (x, y), (u, v) = spot.part, after.part
        points += [(x, y), ((x + u) / 2, (y + v) / 2)] if spot.goes_straight else [(x, y)]
    return Contour(tuple(map(Line, points, (*points[1:], points[0]))))


def _is_sound(vertices: Sequence[_Vertex]) -> bool:
    """Return True if the part's edges run in the directions of its path."""
    return len(vertices) > 2 and all(
        (q.part[0] - p.part[0]) * (q.path[0] - p.path[0])
        + (q.part[1] - p.part[1]) * (q.path[1] - p.path[1])
        > -EPSILON
        for p, q in zip(vertices, (*vertices[1:], vertices[0]), strict=True)
    )


def _share_corner(vertex: _Vertex, following: _Vertex) -> bool:
    return math.dist(vertex.part, following.part) < CORNER_SHARE * math.dist(
        vertex.path, following.path
    )


def _joints(contour: Contour) -> Iterator[tuple[Edge, Edge]]:
    return zip((contour.edges[-1], *contour.edges), contour.edges, strict=False)


def _turn(before: Edge, after: Edge) -> float:
    (ux, uy), (vx, vy) = before.direction(after.start), after.direction(after.start)
    return math.atan2(ux * vy - uy * vx, ux * vx + uy * vy)


def _vertices(before: Edge, after: Edge, a: float, b: float) -> Iterator[_Vertex]:
    """Yield the vertices of a joint; a corner to the right is rounded by the beam and has many."""
    q, turn = after.start, _turn(before, after)
    if turn > KINK:
        raise OutputError(
            f"the corner at x {q[0]:.3f}, y {q[1]:.3f} is sharp, where the path round a part is "
            "rounded by its kerf; regenerate it"
        )
    ux, uy = before.direction(q)
    first = math.atan2(-ux, uy)
    straight = isinstance(before, Line) or isinstance(after, Line)
    if turn < -KINK:
        count = math.ceil(-turn / STEP)
        turns = [turn * k / count for k in range(count + 1)]
    elif straight:
        turns = [0.0 if isinstance(before, Line) else turn]
    else:
        turns = [turn / 2]
    for more in turns:
        x, y = rim(a, b, first + more)
        last = more == turns[-1] and isinstance(after, Line)
        yield _Vertex(q, (q[0] - x, q[1] - y), straight, last)


# Runs of chords that stand for an arc: detected where chords are not permitted, and replaced.


ON_CIRCLE = 1e-5
"""Largest distance of the ends of chords from their circle, mm."""
MIN_CHORDS = 5
MAX_STEP = math.radians(20)
"""MIN_CHORDS or more chords on one circle, each turning less than this, replace an arc."""


class ChordRun(NamedTuple):
    """Consecutive chords of one circle: their ends, and the circle."""

    points: tuple[Point, ...]
    centre: Point
    radius: float


def chords_for_arc(region: Region) -> Point | None:
    """Return the start of a run of chords that replaces an arc, or None."""
    for contour in region.contours:
        for run in _runs(_line_starts(contour)):
            if len(run.points) > MIN_CHORDS:
                return run.points[0]
    return None


def with_arcs(contour: Contour) -> Contour:
    """Return a contour of lines with arcs through every run of chords."""
    points = _line_starts(contour)
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


def _line_starts(contour: Contour) -> list[Point]:
    """Return the starts of the contour's lines; an arc adds a point that lies on no circle."""
    points: list[Point] = []
    for edge in contour.edges:
        points.append(edge.start)
        if isinstance(edge, Arc):
            points.append((math.nan, math.nan))
    return points


def _arcs(run: ChordRun) -> tuple[Edge, ...]:
    """Return the run as arcs of at most a quarter turn."""
    stops, swept = [run.points[0]], 0.0
    for a, b in pairwise(run.points):
        step = 2 * math.asin(min(1.0, math.dist(a, b) / (2 * run.radius)))
        if swept + step > math.pi / 2 + 1e-6:
            stops.append(a)
            swept = 0.0
        swept += step
    stops.append(run.points[-1])
    ccw = _angle_between(*run.points[:3]) > 0
    return tuple(Arc(a, b, run.centre, run.radius, ccw) for a, b in pairwise(stops))


def _runs(points: list[Point]) -> Iterator[ChordRun]:
    """Yield the longest runs of at least three short chords on one circle, turning one way."""
    count = len(points)
    if count < 4:
        return
    first = next((i for i in range(count) if not _on_one_circle(points, i - 1)), None)
    if first is None:
        fitted = _circle(points[0], points[count // 3], points[2 * count // 3])
        if fitted is not None:
            yield ChordRun((*points, points[0]), *fitted)
        return
    # No run reaches over both ends of this ring, whose first chord comes again as its last.
    ring = [points[(first + i) % count] for i in range(count + 2)]
    start, last = 0, count + 1
    while start + 2 <= last:
        end = start + 2
        while end + 1 <= last and _on_one_circle(ring, end - 2):
            end += 1
        run = tuple(ring[start : end + 1])
        fitted = _circle(run[0], run[len(run) // 2], run[-1])
        if fitted is None or len(run) < 4:
            start += 1
            continue
        if start == 0:
            last -= 1
        yield ChordRun(run, *fitted)
        start = end


def _on_one_circle(points: list[Point], first: int) -> bool:
    """Return True if four points from ``first`` on are ends of short chords of one circle."""
    a, b, c, d = (points[(first + i) % len(points)] for i in range(4))
    fitted = _circle(a, b, c)
    if fitted is None or _angle_between(a, b, c) * _angle_between(b, c, d) <= 0:
        return False
    centre, radius = fitted
    longest = max(math.dist(a, b), math.dist(b, c), math.dist(c, d))
    return abs(math.dist(d, centre) - radius) < ON_CIRCLE and _is_short(longest, radius)


def _is_short(length: float, radius: float) -> bool:
    """Return True if a chord is short enough on its circle to replace an arc."""
    return length < 2 * math.sin(MAX_STEP / 2) * radius


def _angle_between(a: Point, b: Point, c: Point) -> float:
    return (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])


def _circle(a: Point, b: Point, c: Point) -> tuple[Point, float] | None:
    """Return centre and radius of the circle through three points; None if they lie on a line."""
    ux, uy, vx, vy = b[0] - a[0], b[1] - a[1], c[0] - a[0], c[1] - a[1]
    cross = 2 * (ux * vy - uy * vx)
    if abs(cross) < 1e-9:
        return None
    uu, vv = ux * ux + uy * uy, vx * vx + vy * vy
    x, y = (vy * uu - uy * vv) / cross, (ux * vv - vx * uu) / cross
    return (a[0] + x, a[1] + y), math.hypot(x, y)
