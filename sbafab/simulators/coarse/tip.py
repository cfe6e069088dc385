"""Where the tip is and how it leans, from the nodes that mark it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from sbafab.meshing.surface import Vector


@dataclass(frozen=True)
class Tip:
    """The tip at a time in s: its place in mm, and how far it leans off the axis in degrees."""

    time: float
    place: Vector
    tilt: float


def tip_at(time: float, points: Sequence[Vector]) -> Tip:
    """The mean of points that go round it, and the lean of their polygon's normal."""
    x, y, z = (sum(values) / len(points) for values in zip(*points, strict=True))
    nx = ny = nz = 0.0
    for (ax, ay, az), (bx, by, bz) in zip(points, [*points[1:], points[0]], strict=True):
        nx += ay * bz - az * by
        ny += az * bx - ax * bz
        nz += ax * by - ay * bx
    return Tip(time, (x, y, z), math.degrees(math.atan2(math.hypot(nx, ny), nz)))
