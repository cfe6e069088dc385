"""Closed forms of pockets whose films keep their length, each as its source has it: the paper's
Eq. 4 as printed, its Eqs. 1 to 3 solved numerically (Sec. 3.1), a lens of two arcs for oblong
pockets, its cylinder; and the constant curvature of parallel chambers.

Each pocket is a family of shapes by one parameter, from 0 (flat) to its fullest state. Lengths mm,
volumes ul, rates dv/dh in mm2.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from sbafab.errors import DesignError
from sbafab.models.film_elements import Array

BISECTIONS = 60
ROUNDING = 1e-9
"""Relative rounding error by which a value may lie past the end of its range."""
SHALLOW = 1e-3
"""Half angle of arcs below which volume is proportional to height, to 1e-6."""


def within(values: ArrayLike, most: float, quantity: str, unit: str, model: str) -> Array:
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


def inverse(rising: Callable[[Array], Array], targets: Array, most: float) -> Array:
    """Return the arguments from 0 to ``most`` at which a rising function has the target values."""
    low = np.zeros_like(targets)
    high = np.full_like(targets, most)
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        is_low = rising(middle) < targets
        low, high = np.where(is_low, middle, low), np.where(is_low, high, middle)
    return np.where(targets == 0, 0.0, high)


def last_positive(falling: Callable[[float], float], low: float, high: float) -> float:
    """Return the argument at which a function falls to 0."""
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        low, high = (middle, high) if falling(middle) > 0 else (low, middle)
    return low


@dataclass(frozen=True)
class PocketModel:
    """One pocket from flat to its fullest state: ``shape`` gives height, volume and dv/dh by a
    parameter from 0 to ``fullest``.
    """

    name: str
    fullest: float
    shape: Callable[[Array], tuple[Array, Array, Array]]

    @property
    def largest_stroke(self) -> float:
        """The height in mm of the fullest pocket."""
        return float(self.shape(np.asarray(self.fullest))[0])

    @property
    def largest_volume(self) -> float:
        """The volume in ul of the fullest pocket."""
        return float(self.shape(np.asarray(self.fullest))[1])

    def stroke(self, v: ArrayLike) -> Array:
        """Return the height (mm) at ``v`` ul. Raises DesignError out of range."""
        volumes = within(v, self.largest_volume, "volume of a balloon", "ul", self.name)
        return self.shape(inverse(lambda at: self.shape(at)[1], volumes, self.fullest))[0]

    def volume(self, h: ArrayLike) -> Array:
        """Return ul at a height of ``h`` mm. Raises DesignError out of range."""
        return self._shape_at(h)[1]

    def rate(self, h: ArrayLike) -> Array:
        """Return dv/dh in mm2 at a height of ``h`` mm. Raises DesignError out of range."""
        return self._shape_at(h)[2]

    def _shape_at(self, h: ArrayLike) -> tuple[Array, Array, Array]:
        heights = within(h, self.largest_stroke, "stroke of a balloon", "mm", self.name)
        return self.shape(inverse(lambda at: self.shape(at)[0], heights, self.fullest))


@cache
def eq_4(length: float) -> PocketModel:
    """Return Eq. 4 as printed, of a round pocket with this radius: v = pi (32 h^5 - 24 h^3 l^2 + 18
    h l^4) / (27 l^2).

    It begins 4/3 as steep as the Eqs. 1 to 3 that it is derived from (docs/prediction.md). It rises
    for every h, but means something only up to the height at which one half by those holds most:
    1.328 mm and 13.30 ul at l = 2.5.
    """
    scale = math.pi / (27 * length**2)

    def shape(h: Array) -> tuple[Array, Array, Array]:
        volume = 32 * h**5 - 24 * h**3 * length**2 + 18 * h * length**4
        rate = 160 * h**4 - 72 * h**2 * length**2 + 18 * length**4
        return h, scale * volume, scale * rate

    return PocketModel("Eq. 4", eqs_1_to_3(length).largest_stroke / 2, shape)


@cache
def eqs_1_to_3(length: float) -> PocketModel:
    """Return two halves by Eqs. 1 to 3, of a round pocket with this radius: 16.947 ul at most at
    l = 2.5, each half 1.33 mm high.

    The meridian of a half is the parabola y = h - a x^2 down to y = 0 at x = rho; its arc keeps the
    length l of the flat pocket's radius. Eq. 1 prints an upper limit of infinity where rho is
    meant, Eq. 3 a rho under the root where x is meant. Everything follows from the slope k = 2 a
    rho at the edge. With s = sqrt(1 + k^2), q = asinh(k) / k:

        rho = 2 l / (s + q)       h = k rho / 2
        v = pi rho^2 h / 2        dv/dh = pi rho^2 (2 q - s) / 2 q

    A half holds most where s = 2 q.
    """

    def shape(k: Array) -> tuple[Array, Array, Array]:
        safe = np.where(k > 0, k, 1.0)
        s, q = np.sqrt(1 + k**2), np.where(k > 0, np.arcsinh(safe) / safe, 1.0)
        rho = 2 * length / (s + q)
        height = k * rho
        return height, math.pi * rho**2 * height / 2, math.pi * rho**2 * (2 * q - s) / (2 * q)

    steepest = last_positive(lambda k: 2 * math.asinh(k) / k - math.hypot(1, k), 1.0, 10.0)
    return PocketModel("Eqs. 1-3", steepest, shape)


def paraboloid_radius(volume: float, height: float) -> float:
    """Return the radius rho (mm) by Eq. 1, v = pi rho^2 h / 2, of a half or of two."""
    return math.sqrt(2 * volume / (math.pi * height))


@cache
def lens(width: float, run: float) -> PocketModel:
    """Return the lens of an oblong pocket: a slot ``width`` wide, with a straight ``run`` and half
    discs at its ends.

    Two films of equal half angle b: each arc is R = width / 2b in radius and keeps its length. The
    straight run is then a prism of that lens, and the ends together one body of revolution with the
    same meridian: two spherical caps. At b = pi/2 the run is a cylinder (``cylinder_height``); with
    its ends a balloon holds most a little earlier, and no air drives it farther.
    """

    def shape(b: Array) -> tuple[Array, Array, Array]:
        safe = np.maximum(b, SHALLOW)
        radius, cap = width / (2 * safe), 2 * np.sin(safe / 2) ** 2
        caps = 2 * math.pi / 3 * cap**2 * (3 - cap)
        # 2 sin^2(b/2) is 1 - cos b without its cancellation.
        height = np.where(b > 0, 2 * width * np.sin(b / 2) ** 2 / np.where(b > 0, b, 1.0), 0.0)
        content = radius**2 * (2 * safe - np.sin(2 * safe)) * run + radius**3 * caps
        # Derivatives by b, in which R falls by R / b.
        rise = 2 * radius * (np.sin(safe) - cap / safe)
        prism = radius**2 * (2 - 2 * np.cos(2 * safe) - 2 * (2 * safe - np.sin(2 * safe)) / safe)
        ends = radius**3 * (2 * math.pi * np.sin(safe) ** 3 - 3 * caps / safe)
        return height, content * np.minimum(b / SHALLOW, 1.0), (prism * run + ends) / rise

    fullest = last_positive(lambda b: float(shape(np.asarray(b))[2]), SHALLOW, math.pi / 2)
    return PocketModel("the lens of two arcs", fullest, shape)


def cylinder_height(width: float) -> float:
    """Return the height in mm of a slot whose films became a full cylinder, its ends not holding it
    back: what the paper's "about 28" answers to (Sec. 2.1).
    """
    return 2 * width / math.pi


class Bend(NamedTuple):
    """Angle of the top (radians), direction in which it leans (radians from x), length of the axis
    (mm), tip (..., 3) in mm, from the middle of the base.
    """

    angle: Array
    towards: Array
    length: Array
    tip: Array


def bend(lengths: ArrayLike, axes: ArrayLike) -> Bend:
    """Return the bend of chambers with ``lengths`` (..., n) mm at ``axes`` (n, 2) mm, n >= 2.

    Constant curvature: a plane through the chambers' ends, fitted if there are more than three,
    gives the length on the axis and the gradient across it; the axis is then an arc. Valid to about
    half a turn: past pi the tip would come down through the base.
    """
    places = np.asarray(axes, dtype=float)
    to_plane = np.linalg.pinv(np.column_stack([np.ones(len(places)), places]))
    plane = np.asarray(lengths, dtype=float) @ to_plane.T
    length, across = plane[..., 0], plane[..., 1:]
    angle = np.hypot(across[..., 0], across[..., 1])
    # It leans away from the long side.
    towards = np.arctan2(-across[..., 1], -across[..., 0])
    safe = np.where(angle > 0, angle, 1.0)
    aside = np.where(angle > 0, length * 2 * np.sin(safe / 2) ** 2 / safe, 0.0)
    up = np.where(angle > 0, length * np.sin(safe) / safe, length)
    tip = np.stack([aside * np.cos(towards), aside * np.sin(towards), up], axis=-1)
    return Bend(angle, towards, length, tip)
