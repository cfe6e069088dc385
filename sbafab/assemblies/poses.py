"""Rigid poses: a turn and a shift, mm."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from sbafab.meshing.surface import Vector

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

Rows = tuple[Vector, Vector, Vector]


class PartPose(NamedTuple):
    """Takes a point p of a part's frame to ``rows p + shift``."""

    rows: Rows = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    shift: Vector = (0.0, 0.0, 0.0)

    def at(self, p: Vector) -> Vector:
        x, y, z = (
            sum(a * b for a, b in zip(row, p, strict=True)) + s
            for row, s in zip(self.rows, self.shift, strict=True)
        )
        return x, y, z

    def then(self, inner: PartPose) -> PartPose:
        """The pose of a part whose pose in this frame is ``inner``."""
        columns = tuple(zip(*inner.rows, strict=True))
        r0, r1, r2 = (
            tuple(sum(a * b for a, b in zip(row, column, strict=True)) for column in columns)
            for row in self.rows
        )
        return PartPose(((*r0,), (*r1,), (*r2,)), self.at(inner.shift))  # type: ignore[arg-type]

    def points(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """The points (n, 3) moved."""
        import numpy as np

        moved: NDArray[np.float64] = points @ np.array(self.rows).T + np.array(self.shift)
        return moved

    @property
    def axis(self) -> Vector:
        """Where the part's own axis points."""
        return self.rows[0][2], self.rows[1][2], self.rows[2][2]


def shifted(x: float, y: float, z: float) -> PartPose:
    return PartPose(shift=(x, y, z))


def about_axis(degrees: float) -> PartPose:
    """A turn about z; quarter turns are exact."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    if degrees % 90 == 0:
        c, s = float(round(c)), float(round(s))
    return PartPose(((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)))


FLIPPED = PartPose(((-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, -1.0)))
"""Upside down: half a turn about y."""
LYING = PartPose(((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0)))
"""The axis along x, what pointed along x downward."""
OUTWARD = PartPose(((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
"""The axis along x, the part's x along y, its y along z: lying on a cylinder's side."""


def along(direction: Vector, at: Vector) -> PartPose:
    """A pose whose axis points along a unit vector, at a point."""
    z = direction
    least = min(range(3), key=lambda i: abs(z[i]))
    helper: Vector = (float(least == 0), float(least == 1), float(least == 2))
    x = _unit(_cross(helper, z))
    y = _cross(z, x)
    return PartPose(((x[0], y[0], z[0]), (x[1], y[1], z[1]), (x[2], y[2], z[2])), at)


def _cross(a: Vector, b: Vector) -> Vector:
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def _unit(v: Vector) -> Vector:
    size = math.hypot(*v)
    return v[0] / size, v[1] / size, v[2] / size
