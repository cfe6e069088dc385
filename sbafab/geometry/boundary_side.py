"""An edge of a boundary, with what a search for places that face each other asks of it."""

from __future__ import annotations

import math
from typing import Final, final

from sbafab.geometry.edges import Bounds, Edge, Line, Point, left_normal

BESIDE: Final = 1e-5
"""mm that an edge may miss another's normals by, for rounding."""


@final
class Foot:
    """A point of an edge, and the unit normal into the material there."""

    __slots__ = ("normal", "point")

    def __init__(self, point: Point, normal: Point) -> None:
        self.point: Final[Point] = point
        self.normal: Final[Point] = normal


@final
class BoundarySide:
    """An edge with what the search asks of it again and again.

    ``half`` is how far its ends lie from its middle, ``lean`` the sine of its half turn.
    """

    __slots__ = ("box", "edge", "half", "half_turn", "lean", "middle", "normal")

    def __init__(
        self, edge: Edge, box: Bounds, middle: Point, half_turn: float, half: float
    ) -> None:
        self.edge: Final[Edge] = edge
        self.box: Final[Bounds] = box
        self.middle: Final[Point] = middle
        self.normal: Final[Point] = left_normal(edge, middle)
        self.half_turn: Final[float] = half_turn
        self.half: Final[float] = half
        self.lean: Final[float] = math.sin(min(half_turn, math.pi / 2))

    def may_hold_feet(self, other: BoundarySide, within: float) -> bool:
        """Whether a normal of this edge may meet the other no farther off than ``within``."""
        x, y = self.middle
        nx, ny = self.normal
        aside = abs((other.middle[0] - x) * ny - (other.middle[1] - y) * nx)
        return aside <= self.half + other.half + within * self.lean + BESIDE

    def feet(self, p: Point) -> list[Foot]:
        """Points of the edge where its normal passes through ``p``."""
        edge = self.edge
        if isinstance(edge, Line):
            x0, y0 = edge.start
            x1, y1 = edge.end
            dx, dy = x1 - x0, y1 - y0
            square = dx * dx + dy * dy
            t = ((p[0] - x0) * dx + (p[1] - y0) * dy) / square
            if not -1e-9 <= t <= 1 + 1e-9:
                return []
            length = math.sqrt(square)
            return [Foot((x0 + t * dx, y0 + t * dy), (-dy / length, dx / length))]
        cx, cy = edge.centre
        r = edge.radius
        ux, uy = p[0] - cx, p[1] - cy
        distance = math.hypot(ux, uy)
        if distance < 1e-12:
            return [Foot(self.middle, left_normal(edge, self.middle))]
        inward = -1.0 if edge.ccw else 1.0
        mx, my = self.middle[0] - cx, self.middle[1] - cy
        least = r * (math.cos(self.half_turn) - 1e-9)
        found = []
        for sign in (1.0, -1.0):
            vx, vy = sign * ux / distance, sign * uy / distance
            if vx * mx + vy * my >= least:
                found.append(Foot((cx + r * vx, cy + r * vy), (inward * vx, inward * vy)))
        return found
