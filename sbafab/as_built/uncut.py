"""The kerf undone: the part that a beam leaves which is led along a path."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from sbafab.as_built.chords import with_arcs
from sbafab.cutting.chaining import check_clear
from sbafab.errors import OutputError
from sbafab.geometry.beam import Kerf, widths
from sbafab.geometry.edges import EPSILON, Arc, Edge, Line, Point
from sbafab.geometry.offset import shrink
from sbafab.geometry.region import Contour, Region
from sbafab.geometry.tidy import tidy
from sbafab.geometry.tracks import rim

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
