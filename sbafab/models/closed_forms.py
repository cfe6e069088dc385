"""Closed forms, each as in its source.

For pockets with inextensible films: the paper's Eq. 4 as printed, its Eqs. 1 to 3 solved
numerically (Sec. 3.1), and for oblong pockets a lens of two arcs and its cylinder. For actuators:
constant curvature, folded lobes, tubes, the cantilever.

Lengths mm, volumes ul, rates dv/dh in mm2.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from sbafab.errors import DesignError
from sbafab.geometry.region import Region, centroid
from sbafab.models.figures import Model
from sbafab.models.film_elements import Array
from sbafab.models.paper import FULL_SHARE, VALID, VALID_RADIUS
from sbafab.models.quantity import ModelId

BISECTIONS, SAMPLES = 60, 401
ROUNDING = 1e-9
"""Relative rounding error by which a value may lie past the end of its range."""
SHALLOW = 1e-3
"""Half angle of arcs below which volume is proportional to height, to 1e-6."""


def within(values: ArrayLike, most: float, quantity: str, unit: str, model: str) -> Array:
    """Return the values as an array, if each lies from 0 to ``most``.

    Raises DesignError with the first value out of range and the range; its upper end is rounded
    down, so that it is itself allowed.
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


PocketShape = Callable[[Array], tuple[Array, Array, Array]]
"""Height, volume and dv/dh of a pocket of size 1 by a parameter, from 0 (flat) to its fullest."""


@dataclass(frozen=True)
class ClosedForm:
    """The pockets of one chamber by a closed form: ``shape`` of one up to ``fullest``, and the
    ``sizes`` of all, bottom to top.

    Pockets of different sizes (a tapered stack) are assumed to have equal height over size, so that
    one formula applies to all: strokes add up with the size, volumes with its cube. Volumes are the
    mean of the balloons. Methods raise DesignError out of range.
    """

    model: Model
    fullest: float
    shape: PocketShape
    sizes: tuple[float, ...]

    @cached_property
    def _length(self) -> float:
        return sum(self.sizes)

    @cached_property
    def _cube(self) -> float:
        """The mean cube of the sizes."""
        return sum(size**3 for size in self.sizes) / len(self.sizes)

    @cached_property
    def largest_stroke(self) -> float:
        """The stroke in mm of the fullest pockets."""
        return float(self.shape(np.asarray(self.fullest))[0]) * self._length

    @cached_property
    def largest_volume(self) -> float:
        """The volume in ul per balloon of the fullest pockets."""
        return float(self.shape(np.asarray(self.fullest))[1]) * self._cube

    def stroke(self, volume: ArrayLike) -> Array:
        """Return the stroke in mm at a volume in ul per balloon."""
        name = self.model.name
        volumes = within(volume, self.largest_volume, "volume", "ul a balloon", name) / self._cube
        at = inverse(lambda at: self.shape(at)[1], volumes, self.fullest)
        return np.asarray(self.shape(at)[0] * self._length)

    def volume(self, stroke: ArrayLike) -> Array:
        """Return the volume in ul per balloon at a stroke in mm."""
        return np.asarray(self._shape_at(stroke)[1] * self._cube)

    def rate(self, stroke: ArrayLike) -> Array:
        """Dv/dh in mm2: the derivative of the chamber's whole volume with respect to its stroke."""
        slope = self._shape_at(stroke)[2] * self._cube
        return np.asarray(slope * len(self.sizes) / self._length)

    def push(self, stroke: ArrayLike) -> Array:
        """Return force over pressure in mm2 of the chamber blocked at a stroke, equal for all its
        balloons.

        For different balloons it is at most the value of the smallest when flat; the additional
        force of closed balloons' solid films is not counted. Height over size then differs between
        them.
        """
        if len(set(self.sizes)) == 1:
            return self.rate(stroke)
        return np.asarray(np.interp(self._within(stroke), *self._in_series))

    @cached_property
    def _in_series(self) -> tuple[Array, Array]:
        """Strokes, and force over pressure there, of different balloons under the same force."""
        at = np.linspace(0.0, float(self.shape(np.asarray(self.fullest))[0]), SAMPLES)
        rates = self.shape(inverse(lambda each: self.shape(each)[0], at, self.fullest))[2]
        # A formula may rise again past the full state; a balloon does not.
        falling = np.minimum.accumulate(rates)
        force = np.linspace(0.0, min(self.sizes) ** 2 * falling[0], SAMPLES)
        stroke = sum(r * np.interp(force / r**2, falling[::-1], at[::-1]) for r in self.sizes)
        return np.asarray(stroke)[::-1], force[::-1]

    def _shape_at(self, stroke: ArrayLike) -> tuple[Array, Array, Array]:
        heights = self._within(stroke) / self._length
        return self.shape(inverse(lambda at: self.shape(at)[0], heights, self.fullest))

    def _within(self, stroke: ArrayLike) -> Array:
        return within(stroke, self.largest_stroke, "stroke of the stack", "mm", self.model.name)


@cache
def eq_4(*radii: float) -> ClosedForm:
    """Return Eq. 4 as printed, of round pockets: v = pi (32 h^5 - 24 h^3 l^2 + 18 h l^4) /
    (27 l^2).

    Its initial slope is 4/3 that of Eqs. 1 to 3, from which it is derived (docs/prediction.md). It
    rises for every h, but is meaningful only up to the height at which one half has the largest
    volume by those equations: 1.328 mm and 13.30 ul at l = 2.5.
    """

    def shape(h: Array) -> tuple[Array, Array, Array]:
        volume, rate = 32 * h**5 - 24 * h**3 + 18 * h, 160 * h**4 - 72 * h**2 + 18
        return h, math.pi / 27 * volume, math.pi / 27 * rate

    source = "Sec. 3.1, h the stroke of one balloon"
    model = Model(ModelId.EQ_4, source, _eq_4_trust(max(radii)))
    return ClosedForm(model, eqs_1_to_3(1.0).largest_stroke / 2, shape, radii)


def _eq_4_trust(radius: float) -> str:
    scale = (radius / VALID_RADIUS) ** 3
    limits = [
        f"within {error.value * radius / VALID_RADIUS:.2g} mm a balloon to "
        f"{volume * scale:.3g} ul in {fluid}"
        for fluid, volume, error in VALID
    ]
    origin = "" if radius == VALID_RADIUS else f", scaled from d = {2 * VALID_RADIUS:g}"
    if radius == 2.5:
        origin += "; the regime ends near 0.95 kPa"
    return f"geometric regime only: {', '.join(limits)} (measured{origin})"


@cache
def eqs_1_to_3(*radii: float) -> ClosedForm:
    """Return two halves by Eqs. 1 to 3, of round pockets: at most 16.947 ul at l = 2.5, with halves
    1.33 mm high.

    The meridian of a half is the parabola y = h - a x^2 down to y = 0 at x = rho; its arc keeps the
    length l of the flat pocket's radius. Eq. 1 prints an upper limit of infinity where rho is
    meant, Eq. 3 a rho under the root where x is meant. Everything follows from the slope k = 2 a
    rho at the edge. With s = sqrt(1 + k^2), q = asinh(k) / k:

        rho = 2 l / (s + q)       h = k rho / 2
        v = pi rho^2 h / 2        dv/dh = pi rho^2 (2 q - s) / 2 q

    A half has its largest volume at s = 2 q.
    """

    def shape(k: Array) -> tuple[Array, Array, Array]:
        safe = np.where(k > 0, k, 1.0)
        s, q = np.sqrt(1 + k**2), np.where(k > 0, np.arcsinh(safe) / safe, 1.0)
        rho = 2 / (s + q)
        height = k * rho
        return height, math.pi * rho**2 * height / 2, math.pi * rho**2 * (2 * q - s) / (2 * q)

    steepest = last_positive(lambda k: 2 * math.asinh(k) / k - math.hypot(1, k), 1.0, 10.0)
    trust = (
        "geometric regime only: films that do not stretch, wrinkle or have a neck ring; "
        "3/4 of Eq. 4's volume and force at small strokes"
    )
    model = Model(ModelId.EQS_1_TO_3, "Sec. 3.1, solved for two halves", trust)
    return ClosedForm(model, steepest, shape, radii)


def paraboloid_radius(volume: float, height: float) -> float:
    """Return the radius rho (mm) by Eq. 1, v = pi rho^2 h / 2, of a half or of two."""
    return math.sqrt(2 * volume / (math.pi * height))


@cache
def lens(width: float, run: float, balloons: int = 1) -> ClosedForm:
    """Return the lens of oblong pockets: slots ``width`` wide, with a straight ``run`` and half
    discs at their ends.

    Two films of equal half angle b: each arc has the radius R = width / 2b and keeps its length.
    The straight run is then a prism of that lens, and the ends together form one body of revolution
    with the same meridian: two spherical caps. At b = pi/2 the run is a cylinder
    (``cylinder_height``); with its ends a balloon reaches its largest volume slightly earlier, and
    cannot be inflated farther.
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
    model = Model(
        ModelId.LENS_STROKE,
        "films of constant length, ends as spherical caps",
        "geometric regime only; the paper measured no oblong balloon but the inflated diameter",
    )
    return ClosedForm(model, fullest, shape, (1.0,) * balloons)


def cylinder_height(width: float) -> float:
    """Return the height in mm of a slot whose films form a full cylinder, unrestrained by its ends:
    the paper's "about 28" (Sec. 2.1).
    """
    return 2 * width / math.pi


def scaled_stroke(radii: Sequence[float]) -> float:
    """Return the paper's stroke in mm, scaled with the radii: 17.5 for 15 of 2.5 (Sec. 4.6)."""
    return FULL_SHARE * sum(radii)


class Bend(NamedTuple):
    """Angle of the top (radians), bending direction (radians from x), length of the axis (mm), and
    tip (..., 3) in mm, from the middle of the base.
    """

    angle: Array
    towards: Array
    length: Array
    tip: Array


def bend(lengths: ArrayLike, axes: ArrayLike) -> Bend:
    """Return the bend of chambers with ``lengths`` (..., n) mm at ``axes`` (n, 2) mm, n >= 2.

    Constant curvature: a plane through the chambers' ends, fitted if there are more than three,
    gives the length on the axis and the gradient across it; the axis is then an arc. Valid to about
    half a turn: past pi the tip would pass through the base.
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


# Diameter of a folded actuator (paper, Sec. 2: three lobes pass a channel of 9.25 mm).


LOBES = 3


def folded_diameter(width: float, thickness: float) -> float:
    """Return the circle (mm) around three lobes folded into a triangle, their outer corners on it.

    Each lobe is a bar ``width`` long and ``thickness`` deep, a chord of the circle; their inner
    faces are the triangle's sides.
    """
    inside = width / (2 * math.tan(math.pi / LOBES))
    return 2 * math.hypot(inside + thickness, width / 2)


# Tubes of inlet strips.


def largest_tube(width: float, strip: float = 0.0) -> float:
    """Return the outer diameter (mm) of the tube that fills a flat channel ``width`` mm wide.

    Half the perimeter around the tube and a PTFE strip ``strip`` mm thick along one side equals the
    channel's width.
    """
    return 2 * width / math.pi - strip


# The cantilever formula E = F l^3 / (3 delta I) (paper, Sec. 4.4), and its I.


SAGITTA = 1e-4


def tip_stiffness(modulus_kpa: float, second_moment: float, length: float) -> float:
    """Return F / delta in N/mm of a cantilever, from E (kPa), I (mm4) and length (mm)."""
    return 3 * modulus_kpa * 1e-3 * second_moment / length**3


def modulus(force: float, deflection: float, length: float, second_moment: float) -> float:
    """Return E in kPa, from tip force (N), deflection and length (mm), I (mm4)."""
    return force * length**3 / (3 * deflection * second_moment) * 1e3


def second_moments(region: Region) -> tuple[float, float]:
    """Return the least and largest second moment of area (mm4) of a section about its centre."""
    x0, y0 = centroid(region)
    xx = yy = xy = 0.0
    for piece in region.polygons(SAGITTA):
        for ring in piece:
            for (xa, ya), (xb, yb) in zip(ring, [*ring[1:], ring[0]], strict=True):
                ax, ay, bx, by = xa - x0, ya - y0, xb - x0, yb - y0
                cross = ax * by - bx * ay
                xx += cross * (ay * ay + ay * by + by * by) / 12
                yy += cross * (ax * ax + ax * bx + bx * bx) / 12
                xy += cross * (ax * by + 2 * ax * ay + 2 * bx * by + bx * ay) / 24
    middle, half = (xx + yy) / 2, ((xx - yy) ** 2 / 4 + xy * xy) ** 0.5
    return middle - half, middle + half
