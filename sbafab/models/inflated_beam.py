"""A tube of film that pressure alone makes stiff, bent as a cantilever.

Wrinkles start where the pressure's tension along the tube is used up, at a moment of pi p r^3 / 2,
and it collapses at twice that: Comer and Levy, AIAA Journal 1 (1963) 1652, doi 10.2514/3.1873. A
flat tube of width w opens to r = w / pi. Lengths mm, pressures kPa, moments N mm.
"""

from __future__ import annotations

import math

MODEL = "inflated beam"
SLENDER = 5.0
"""Least ratio of length to diameter for a beam; ours."""


def radius(width: float) -> float:
    """Return the radius in mm that a flat tube of this width opens to."""
    return width / math.pi


def wrinkling_moment(pressure: float, width: float) -> float:
    """Return the moment in N mm at which its inner side goes slack."""
    return math.pi * pressure / 1000 * radius(width) ** 3 / 2


def collapse_moment(pressure: float, width: float) -> float:
    """Return the moment in N mm at which the slack goes all round."""
    return 2 * wrinkling_moment(pressure, width)


def hoop_tension(pressure: float, width: float) -> float:
    """Return the tension in N/mm round the tube, twice that along it."""
    return pressure / 1000 * radius(width)
