"""A flat laminate bent round its tube: x becomes the circumference, z the radial direction."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sbafab.laminate.laminate import Laminate
from sbafab.meshing.surface import Surface, Vector

SAGITTA = 0.008
"""mm by which a facet of a bent film may deviate from its cylinder; a fifth of a film."""
RAMP = 1.5
"""mm round the tube within which an overlapping end of the sheet climbs onto the other end."""


class TubeWrap(NamedTuple):
    """Placement of a flat body round a tube, whose axis is z.

    ``radius`` is the tube's; lengths ``neutral`` mm above it are kept. An overlapping sheet is
    raised by ``thickness`` at and past x = ``seam``. All mm.
    """

    radius: float
    neutral: float = 0.0
    seam: float = math.inf
    thickness: float = 0.0

    @property
    def step(self) -> float:
        """Distance in mm of the lines along the tube at which facets of a body are cut."""
        return math.sqrt(8 * self.radius * SAGITTA)

    def placed(
        self, points: NDArray[np.float64], middle: float = 0.0, share: ArrayLike = 1.0
    ) -> NDArray[np.float64]:
        """Points (n, 3) of the flat laminate, z from the tube's surface, round the tube.

        A body fixed at x = ``middle`` may be bent by a ``share`` of the tube's curvature: 0 leaves
        it straight, on the tangent.
        """
        x, y, z = points.T
        angle, at = self.angle(x, middle, share), middle / (self.radius + self.neutral)
        bend = np.asarray(share, dtype=float) / self.radius
        safe = np.where(bend > 0, bend, 1.0)
        # 2 sin^2(a/2) / bend is (1 - cos a) / bend without its cancellation.
        sag = np.where(bend > 0, 2 * np.sin(angle / 2) ** 2 / safe, 0.0)
        sine = np.where(bend > 0, np.sin(angle) / safe, x - middle)
        out, aside = self.radius + z * np.cos(angle) - sag, sine + z * np.sin(angle)
        cos, sin = math.cos(at), math.sin(at)
        return np.column_stack([out * cos - aside * sin, out * sin + aside * cos, y])

    def angle(
        self, x: NDArray[np.float64], middle: float = 0.0, share: ArrayLike = 1.0
    ) -> NDArray[np.float64]:
        """Angle in radians by which a body leans at x, relative to its fixed point."""
        bend = np.asarray(share, dtype=float) / self.radius
        angle: NDArray[np.float64] = bend * (x - middle) / (1 + bend * self.neutral)
        return angle

    def raised(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Height in mm by which the sheet is lifted by its overlapping end."""
        return self.thickness * np.clip((x - self.seam) / RAMP + 1, 0, 1)


def tube_wrap(laminate: Laminate) -> TubeWrap | None:
    """Return the placement of a laminate round its tube, or None for one without a tube."""
    if laminate.tube is None:
        return None
    sheet = laminate.tpe_layers[0]
    radius, neutral = laminate.tube / 2, sheet.film.thickness / 2
    low, _, high, _ = sheet.profile.bounds
    # A full turn of the sheet, less the maximum width of a solid's facets.
    seam = low + math.tau * (radius + neutral) - RAMP
    thickness = 2 * (neutral + SAGITTA) if high > seam + RAMP else 0.0
    return TubeWrap(radius, neutral, seam, thickness)


def wrapped(surface: Surface, wrap: TubeWrap) -> Surface:
    """The surface of a flat body, already cut every ``wrap.step``, wrapped round its tube."""
    x, y, z = surface.points.T
    return Surface(wrap.placed(np.column_stack([x, y, z + wrap.raised(x)])), surface.faces)


def bent_point(p: Vector, radius: float) -> Vector:
    """Return where a point of a flat body lies round a tube of this radius about z."""
    x, y, z = TubeWrap(radius).placed(np.array([p]))[0].tolist()
    return x, y, z
