"""The paper's Eq. 4, exactly as printed (Sec. 3.1), and its inverse.

v = pi (32 h^5 - 24 h^3 l^2 + 18 h l^4) / (27 l^2), of one balloon whose stroke is h. It begins 4/3
as steep as the Eqs. 1 to 3 that it is derived from: docs/prediction.md compares them. It rises for
every h, but means something only up to the height at which Eqs. 1 to 3 hold most, 0.531 l.
Lengths mm, volumes ul.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sbafab.models.parabola import fullest, inverse, within

MODEL = "Eq. 4"


def largest_stroke(length: float) -> float:
    """Return the end of its range, mm: 1.328 at l = 2.5."""
    return fullest(length).height


def largest_volume(length: float) -> float:
    """Return the volume there, ul: 13.30 at l = 2.5."""
    return float(_volume(np.asarray(largest_stroke(length)), length))


def volume(h: ArrayLike, length: float) -> NDArray[np.float64]:
    """Return ul of a balloon whose stroke is ``h`` mm. Raises DesignError out of range."""
    return _volume(_stroke(h, length), length)


def stroke(v: ArrayLike, length: float) -> NDArray[np.float64]:
    """Return the stroke (mm) of a balloon that holds ``v`` ul. Raises DesignError out of range."""
    volumes = within(v, largest_volume(length), "volume of a balloon", "ul", MODEL)
    return inverse(lambda h: _volume(h, length), volumes, largest_stroke(length))


def rate(h: ArrayLike, length: float) -> NDArray[np.float64]:
    """Return dv/dh in mm2 of a balloon whose stroke is ``h`` mm."""
    x = _stroke(h, length)
    return math.pi / (27 * length**2) * (160 * x**4 - 72 * x**2 * length**2 + 18 * length**4)


def _stroke(h: ArrayLike, length: float) -> NDArray[np.float64]:
    return within(h, largest_stroke(length), "stroke of a balloon", "mm", MODEL)


def _volume(h: NDArray[np.float64], length: float) -> NDArray[np.float64]:
    terms = 32 * h**5 - 24 * h**3 * length**2 + 18 * h * length**4
    return math.pi / (27 * length**2) * terms
