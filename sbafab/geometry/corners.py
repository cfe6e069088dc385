"""The corners of contours, and what a segment that ends at one has to be."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Final, final

from sbafab.geometry.edges import Bounds, Edge, Line, Point
from sbafab.geometry.ends import ROUNDED, SMOOTH
from sbafab.geometry.region import Contour


@final
class Corner:
    """A vertex with the directions of travel into and out of it; ``turn`` > 0 is convex.

    ``normal`` is the unit vector halfway between the normals of the two edges.
    """

    __slots__ = ("arriving", "box", "half_turn", "leaving", "normal", "point", "turn")

    def __init__(self, point: Point, arriving: Point, leaving: Point, turn: float) -> None:
        self.point: Final[Point] = point
        self.arriving: Final[Point] = arriving
        self.leaving: Final[Point] = leaving
        self.turn: Final[float] = turn
        self.half_turn: Final[float] = abs(turn) / 2
        self.box: Final[Bounds] = (point[0], point[1], point[0], point[1])
        ux, uy = arriving
        half = turn / 2
        c, s = math.cos(half), math.sin(half)
        self.normal: Final[Point] = (-ux * s - uy * c, ux * c - uy * s)

    def squarely(self, d: Point) -> bool:
        """Whether a reflex corner lies nearest, among its neighbours, to what ``d`` points at."""
        room = 1e-9 * math.hypot(*d)
        return _dot(d, self.arriving) >= -room and _dot(d, self.leaving) <= room

    def normals(self) -> tuple[Point, Point]:
        return _left(self.arriving), _left(self.leaving)


def corners_of(contour: Contour) -> Iterator[Corner | None]:
    """The corner that each edge starts at; None where the path is smooth."""
    edges = contour.edges
    for before, after in zip((edges[-1], *edges), edges, strict=False):
        u, v = before.direction(after.start), after.direction(after.start)
        turn = math.atan2(u[0] * v[1] - u[1] * v[0], _dot(u, v))
        if abs(turn) > math.pi - SMOOTH:
            # At a cusp only the curvatures tell which side the material is on.
            turn = math.pi if _curvature(before) + _curvature(after) < 0 else -math.pi
        yield Corner(after.start, u, v, turn) if abs(turn) > SMOOTH else None


def pinch(
    contours: Iterable[Contour], corners: Iterable[Corner | None], sharp: float
) -> Point | None:
    """A corner sharper than allowed, or a point where the boundary meets itself."""
    for corner in corners:
        if corner is not None and math.degrees(math.pi - corner.turn) < sharp - ROUNDED:
            return corner.point
    seen: set[Point] = set()
    for contour in contours:
        for edge in contour.edges:
            if edge.start in seen:
                return edge.start
            seen.add(edge.start)
    return None


def _curvature(edge: Edge) -> float:
    if isinstance(edge, Line):
        return 0.0
    return (1.0 if edge.ccw else -1.0) / edge.radius


def _dot(a: Point, b: Point) -> float:
    return a[0] * b[0] + a[1] * b[1]


def _left(u: Point) -> Point:
    return -u[1], u[0]
