"""The kerf undone: the part that a beam leaves which is led along a path."""

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
"""Radians: arcs along one curve turn less where they join, corners of a path more."""
STEP = math.radians(5)
"""Most that a chord turns round a corner."""
SHARPEST = math.radians(88)
"""Half the turn of the sharpest corner whose rounding is reckoned with."""
STILL = 0.15
"""Share of its way on the path that the part's edge covers less of, where it has a corner."""


class UncutPart(NamedTuple):
    """What is left, and the most area that corners lose or gain because the beam rounds them."""

    region: Region
    corner_room: float


def uncut(path: Region, kerf: Kerf) -> UncutPart:
    """The part inside a path; empty or OutputError where such a beam cannot have left one."""
    a, b = (width / 2 for width in widths(kerf))
    if a == b:
        region = shrink(path, a)
        rounded = sum(
            isinstance(e, Arc) and not e.ccw and abs(e.radius - a) < 5e-5 for e in region.edges
        )
        return UncutPart(region, rounded * a * a)
    region = Region(tuple(_inside(contour, a, b) for contour in path.contours))
    check_clear(region.contours)
    joints = [joint for contour in path.contours for joint in _joints(contour)]
    return UncutPart(region, sum(_corner_room(*joint, a, b) for joint in joints))


class _Spot(NamedTuple):
    """A point of the path and of the part; whether a straight edge ends there, or starts."""

    path: Point
    part: Point
    is_straight: bool
    goes_straight: bool


def _inside(contour: Contour, a: float, b: float) -> Contour:
    """The contour of the part: each vertex of the path lies on the exact curve."""
    kept: list[_Spot] = []
    for spot in (spot for joint in _joints(contour) for spot in _spots(*joint, a, b)):
        if kept and _at_one_corner(kept[-1], spot):
            # The ends of straight edges tell the corner best.
            best = spot if spot.is_straight else kept[-1]
            kept[-1] = best._replace(path=spot.path, goes_straight=spot.goes_straight)
        else:
            kept.append(spot)
    if len(kept) > 1 and _at_one_corner(kept[-1], kept[0]):
        kept.pop() if kept[0].is_straight else kept.pop(0)
    inside = tidy(with_arcs(_chords(kept)).edges) if _is_sound(kept) else None
    if inside is None or inside.is_hole != contour.is_hole:
        x, y = contour.edges[0].start
        raise OutputError(f"the contour at x {x:.3f}, y {y:.3f} is lost in its kerf")
    return inside


def _chords(spots: Sequence[_Spot]) -> Contour:
    """Lines from spot to spot; a straight edge is two, so that it is no chord of any circle."""
    points: list[Point] = []
    for spot, after in zip(spots, (*spots[1:], spots[0]), strict=True):
        (x, y), (u, v) = spot.part, after.part
        points += [(x, y), ((x + u) / 2, (y + v) / 2)] if spot.goes_straight else [(x, y)]
    return Contour(tuple(map(Line, points, (*points[1:], points[0]))))


def _is_sound(spots: Sequence[_Spot]) -> bool:
    """Whether the part's edge runs the way its path does."""
    return len(spots) > 2 and all(
        (q.part[0] - p.part[0]) * (q.path[0] - p.path[0])
        + (q.part[1] - p.part[1]) * (q.path[1] - p.path[1])
        > -EPSILON
        for p, q in zip(spots, (*spots[1:], spots[0]), strict=True)
    )


def _at_one_corner(one: _Spot, other: _Spot) -> bool:
    return math.dist(one.part, other.part) < STILL * math.dist(one.path, other.path)


def _joints(contour: Contour) -> Iterator[tuple[Edge, Edge]]:
    return zip((contour.edges[-1], *contour.edges), contour.edges, strict=False)


def _turn(before: Edge, after: Edge) -> float:
    (ux, uy), (vx, vy) = before.direction(after.start), after.direction(after.start)
    return math.atan2(ux * vy - uy * vx, ux * vx + uy * vy)


def _corner_room(before: Edge, after: Edge, a: float, b: float) -> float:
    """The area between a corner to the right and its rounding; it grows as the corner closes."""
    if _turn(before, after) > -KINK:
        return 0.0
    (ux, uy), (vx, vy) = before.direction(after.start), after.direction(after.start)
    turn = math.atan2((ux * vy - uy * vx) * a * b, ux * vx * b * b + uy * vy * a * a)
    return a * b * math.tan(min(abs(turn) / 2, SHARPEST))


def _spots(before: Edge, after: Edge, a: float, b: float) -> Iterator[_Spot]:
    """A vertex of the path; a corner to the right is rounded by the beam, and makes many spots."""
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
        yield _Spot(q, (q[0] - x, q[1] - y), straight, last)


# Runs of chords that are meant as an arc: found where none should be, and made one again.


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
    ccw = _angle_between(*run.points[:3]) > 0
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
    if found is None or _angle_between(a, b, c) * _angle_between(b, c, d) <= 0:
        return False
    centre, radius = found
    longest = max(math.dist(a, b), math.dist(b, c), math.dist(c, d))
    return abs(math.dist(d, centre) - radius) < ON_CIRCLE and _narrow(longest, radius)


def _narrow(length: float, radius: float) -> bool:
    """Whether a chord is short enough, beside its circle, to stand for an arc."""
    return length < 2 * math.sin(WIDEST_STEP / 2) * radius


def _angle_between(a: Point, b: Point, c: Point) -> float:
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
