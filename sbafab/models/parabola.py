"""The paper's geometric model, Eqs. 1 to 3 solved numerically (Sec. 3.1), with the range check and
the inverse that the other formulas share.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sbafab.errors import DesignError

BISECTIONS = 60
ROUNDING = 1e-9
"""Relative rounding error by which a value may lie past the end of its range."""


def within(
    values: ArrayLike, most: float, quantity: str, unit: str, model: str
) -> NDArray[np.float64]:
    """Return the values as an array, if each lies from 0 to ``most``.

    Raises DesignError with the first that does not and the range; its upper end is rounded down,
    so that it is itself allowed.
    """
    checked = np.asarray(values, dtype=float)
    good = (checked >= 0) & (checked <= most * (1 + ROUNDING))
    if not good.all():
        worst = float(checked[~good].flat[0])
        digits = max(0, 3 - math.floor(math.log10(most)))
        shown = math.floor(most * 10**digits) / 10**digits
        raise DesignError(
            f"{quantity} = {worst:g} {unit} is outside the range of {model}; "
            f"give 0 to {shown:.{digits}f} {unit}"
        )
    return np.asarray(np.minimum(checked, most))


def inverse(
    rising: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    targets: NDArray[np.float64],
    most: float,
) -> NDArray[np.float64]:
    """Return the arguments from 0 to ``most`` at which a rising function has the target values."""
    low = np.zeros_like(targets)
    high = np.full_like(targets, most)
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        is_low = rising(middle) < targets
        low, high = np.where(is_low, middle, low), np.where(is_low, high, middle)
    return np.where(targets == 0, 0.0, high)


# The meridian of one half of a balloon is the parabola y = h - a x^2 down to y = 0 at x = rho; its
# arc keeps the length l of the flat pocket's radius. Eq. 1 prints an upper limit of infinity where
# rho is meant, Eq. 3 a rho under the root where x is meant. Lengths mm, volumes ul.
#
# Everything follows from the slope k = 2 a rho at the edge. With s = sqrt(1 + k^2), q = asinh(k) /
# k:
#
#     rho = 2 l / (s + q)    h = k rho / 2    v = pi rho^2 h / 2    dv/dh = pi rho^2 (2 q - s) / 2 q
#
# A half holds most where s = 2 q. A whole balloon is two halves, and twice as high:
# ``balloon_...``.


MODEL = "Eqs. 1-3"


class FullestHalf(NamedTuple):
    """One half at its largest volume: slope of the edge, height, radius (mm), volume (ul)."""

    slope: float
    height: float
    radius: float
    volume: float


@cache
def fullest(length: float) -> FullestHalf:
    """Return the fullest half: at l = 2.5 mm 8.47 ul, 1.33 mm high (both: 16.947 ul)."""
    low, high = 1.0, 10.0
    for _ in range(BISECTIONS):
        k = (low + high) / 2
        low, high = (k, high) if math.hypot(1, k) < 2 * math.asinh(k) / k else (low, k)
    radius = 2 * length / (math.hypot(1, high) + math.asinh(high) / high)
    height = high * radius / 2
    return FullestHalf(high, height, radius, math.pi * radius**2 * height / 2)


def radius(h: ArrayLike, length: float) -> NDArray[np.float64]:
    """Return the radius rho (mm) of a half ``h`` mm high; Eq. 2 then gives a = h / rho^2."""
    s, q = _terms(_slope(h, length))
    return 2 * length / (s + q)


def volume(h: ArrayLike, length: float) -> NDArray[np.float64]:
    """Return ul of a half ``h`` mm high: Eq. 1. Raises DesignError past the fullest one."""
    k = _slope(h, length)
    return _volume(k, length)


def height(v: ArrayLike, length: float) -> NDArray[np.float64]:
    """Return mm of a half that holds ``v`` ul. Raises DesignError past the fullest one."""
    most = fullest(length)
    volumes = within(v, most.volume, "volume of half a balloon", "ul", MODEL)
    k = inverse(lambda slope: _volume(slope, length), volumes, most.slope)
    return _height(k, length)


def rate(h: ArrayLike, length: float) -> NDArray[np.float64]:
    """Return dv/dh in mm2 at a half's height ``h``; equal for two halves and their whole height."""
    s, q = _terms(_slope(h, length))
    return math.pi * (2 * length / (s + q)) ** 2 * (2 * q - s) / (2 * q)


def balloon_volume(stroke: ArrayLike, length: float) -> NDArray[np.float64]:
    """Return the volume (ul) of two halves, together ``stroke`` mm high."""
    return 2 * volume(np.asarray(stroke, dtype=float) / 2, length)


def balloon_stroke(v: ArrayLike, length: float) -> NDArray[np.float64]:
    """Return the height (mm) of two halves that together hold ``v`` ul."""
    most = 2 * fullest(length).volume
    return 2 * height(within(v, most, "volume of a balloon", "ul", MODEL) / 2, length)


def balloon_rate(stroke: ArrayLike, length: float) -> NDArray[np.float64]:
    """Return dv/dh in mm2 of two halves, together ``stroke`` mm high."""
    return rate(np.asarray(stroke, dtype=float) / 2, length)


def _slope(h: ArrayLike, length: float) -> NDArray[np.float64]:
    most = fullest(length)
    heights = within(h, most.height, "height of half a balloon", "mm", MODEL)
    return inverse(lambda slope: _height(slope, length), heights, most.slope)


def _height(k: NDArray[np.float64], length: float) -> NDArray[np.float64]:
    s, q = _terms(k)
    return length * k / (s + q)


def _volume(k: NDArray[np.float64], length: float) -> NDArray[np.float64]:
    s, q = _terms(k)
    return 2 * math.pi * length**3 * k / (s + q) ** 3


def _terms(k: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the s and q of the formulas above; q is 1 at k = 0."""
    safe = np.where(k > 0, k, 1.0)
    return np.sqrt(1 + k**2), np.where(k > 0, np.arcsinh(safe) / safe, 1.0)
