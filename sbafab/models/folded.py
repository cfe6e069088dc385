"""Diameter of a folded actuator (paper, Sec. 2: three lobes pass a channel of 9.25 mm)."""

from __future__ import annotations

import math

LOBES = 3


def folded_diameter(width: float, thickness: float) -> float:
    """Circle (mm) round three lobes folded into a triangle, their outer corners on it.

    Each lobe is a bar ``width`` long and ``thickness`` deep, a chord of the circle; their inner
    faces are the triangle's sides.
    """
    inside = width / (2 * math.tan(math.pi / LOBES))
    return 2 * math.hypot(inside + thickness, width / 2)
