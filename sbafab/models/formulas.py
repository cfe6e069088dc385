"""Closed formulas: bend of parallel chambers, burst pressure, folded diameter, force by virtual
work, inlet tubes, tip stiffness, and overall sizes.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.design.records import Design, Discs, Form, Slots, Wrap
from sbafab.errors import DesignError
from sbafab.geometry.region import Region, centroid
from sbafab.laminate.films import PAPER_PRODUCT, PAPER_THICKNESS
from sbafab.laminate.laminate import (
    Laminate,
    beyond_the_outline,
    outline_diameter,
    overall_diameter,
)
from sbafab.models.lens import fullest
from sbafab.models.paper import BURST, FLAT_HEIGHT_OF_FILMS, counterpart

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


class Bend(NamedTuple):
    """Angle of the top (radians), direction in which it leans (radians from x), length of the axis
    (mm), tip (..., 3) in mm, from the middle of the base.
    """

    angle: NDArray[np.float64]
    towards: NDArray[np.float64]
    length: NDArray[np.float64]
    tip: NDArray[np.float64]


def bend(lengths: ArrayLike, axes: ArrayLike) -> Bend:
    """Return the bend of chambers with ``lengths`` (..., n) mm at ``axes`` (n, 2) mm, n >= 2.

    Constant curvature: a plane through the chambers' ends, the nearest one where there are more
    than three, gives the length on the axis and the gradient across it; the axis is then an arc.
    Valid to about half a turn: past pi the tip would come down through the base.
    """
    places = np.asarray(axes, dtype=float)
    to_plane = np.linalg.pinv(np.column_stack([np.ones(len(places)), places]))
    plane = np.asarray(lengths, dtype=float) @ to_plane.T
    length, across = plane[..., 0], plane[..., 1:]
    angle = np.hypot(across[..., 0], across[..., 1])
    # It leans away from its long side.
    towards = np.arctan2(-across[..., 1], -across[..., 0])
    safe = np.where(angle > 0, angle, 1.0)
    # 2 sin^2(x/2) is 1 - cos x without its cancellation.
    aside = np.where(angle > 0, length * 2 * np.sin(safe / 2) ** 2 / safe, 0.0)
    up = np.where(angle > 0, length * np.sin(safe) / safe, length)
    tip = np.stack([aside * np.cos(towards), aside * np.sin(towards), up], axis=-1)
    return Bend(angle, towards, length, tip)


# Burst pressure, scaled from the paper's three actuators: for a proof test, not to design with.
#
# The paper burst three actuators with pockets of 5 mm in its film of 0.038 mm, at 367 +- 18 kPa
# (Sec. 4, 7). A thin film of radius r and thickness t under p carries p r / 2 t where it is a
# sphere's and p r / t where it is a cylinder's. Taken in proportion, nothing else is known.


RADIUS = 2.5
"""mm, of the pockets that burst."""


def burst_pressure(form: Form, laminate: Laminate) -> float | None:
    """Return an estimate in kPa of the pressure at which the widest pocket bursts.

    An oblong pocket of width w becomes a cylinder of radius w / pi, whose film carries twice what
    a sphere's does. None for a film of another product, or a drawn pocket: nothing was measured.
    """
    films = {layer.film for layer in laminate.layers if not layer.is_mask}
    if any(film.product != PAPER_PRODUCT for film in films):
        return None
    if isinstance(form.pockets, Discs):
        radius = max(form.pockets.diameters) / 2
    elif isinstance(form.pockets, Slots):
        radius = 2 * form.pockets.width / math.pi
    else:
        return None
    thickness = min(film.thickness for film in films)
    return BURST.value * RADIUS / radius * thickness / PAPER_THICKNESS


# Diameter of a folded actuator (paper, Sec. 2: three lobes pass a channel of 9.25 mm).


LOBES = 3


def folded_diameter(width: float, thickness: float) -> float:
    """Return the circle (mm) round three lobes folded into a triangle, their outer corners on it.

    Each lobe is a bar ``width`` long and ``thickness`` deep, a chord of the circle; their inner
    faces are the triangle's sides.
    """
    inside = width / (2 * math.tan(math.pi / LOBES))
    return 2 * math.hypot(inside + thickness, width / 2)


# Blocked force of a chamber at a height: virtual work, F dh = p dv (paper, Sec. 4.3).


def force(pressure_kpa: ArrayLike, rate: ArrayLike) -> NDArray[np.float64]:
    """Return N from kPa and dv/dh in mm2. Raises DesignError past the burst pressure."""
    pressure = np.asarray(pressure_kpa, dtype=float)
    good = (pressure >= 0) & (pressure <= BURST.value)
    if not good.all():
        raise DesignError(
            f"pressure = {float(pressure[~good].flat[0]):g} kPa is out of range; give 0 to "
            f"{BURST.value:g} kPa, where the paper's actuators burst"
        )
    return np.asarray(pressure * np.asarray(rate, dtype=float) / 1000)


def work_uj(pressure_kpa: float, volume_ul: float) -> float:
    """Return the work in uJ of air at constant pressure: 1 kPa x 1 ul = 1 uJ.

    An upper bound of the integral of p dv up to that pressure.
    """
    return pressure_kpa * volume_ul


# Tubes of inlet strips.


def largest_tube(width: float, strip: float = 0.0) -> float:
    """Return the outer diameter (mm) of the tube that fills a flat channel ``width`` mm wide.

    The tube and a PTFE strip ``strip`` mm thick along one side of it have half their perimeter
    equal to the channel's width.
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


# Overall sizes, each with the paper's figure.


def sizes(design: Design, laminate: Laminate, press_factor: float = 1.0) -> dict[str, float]:
    """Return sizes in mm by name: of the flat laminate and, for radial designs, round the tube.

    Width, length and overall diameter include masks, inlet tabs and ears. The outline diameter is
    that of the films without tabs and ears. ``press_factor`` is the films' thickness after the
    press over that before; the laminate is in diameters round the tube twice.
    """
    thickness = laminate.thickness * press_factor
    thinner = 2 * (laminate.thickness - thickness)
    low_x, low_y, high_x, high_y = laminate.bounds
    sizes_mm = {
        "thickness": thickness,
        "width": high_x - low_x,
        "length": high_y - low_y,
    }
    form = design.form
    if form.wrap is not None:
        sizes_mm["pitch"] = form.wrap.pitch
        sizes_mm["deflated_diameter"] = deflated_diameter(form.wrap, laminate) - thinner
        reached, inflated = reached_diameter(form, laminate), inflated_diameter(form, laminate)
        if reached is not None and inflated is not None:
            sizes_mm["reached_diameter"] = reached - thinner
            sizes_mm["inflated_diameter"] = inflated - thinner
    else:
        if not laminate.outline.is_empty:
            sizes_mm["outline_diameter"] = outline_diameter(laminate)
        sizes_mm["overall_diameter"] = overall_diameter(laminate)
    return sizes_mm


def deflated_diameter(wrap: Wrap, laminate: Laminate) -> float:
    """Return the diameter in mm of tube and flat laminate; the paper's is 15.33 (Sec. 2.1)."""
    return wrap.tube_diameter + 2 * laminate.thickness


def reached_diameter(form: Form, laminate: Laminate) -> float | None:
    """Return the diameter in mm of the tube with SBAs at their largest volume: the reach to rely
    on.

    None without a tube, or for pockets of another shape. Balloons are lenses of two arcs
    (``models.lens``); the paper's reach 27.29, about 28 (Sec. 2.1).
    """
    if not isinstance(form.pockets, Slots):
        return None
    return _round_the_tube(form, laminate, fullest(form.pockets.width, form.pockets.run).stroke)


def inflated_diameter(form: Form, laminate: Laminate) -> float | None:
    """Return the diameter in mm of the tube with SBAs as wide as can be: the clearance to provide.

    None without a tube, or for pockets of another shape. A flat pocket of width w whose films do
    not stretch becomes a cylinder of diameter 2 w / pi where its ends do not hold it back: 28.06
    for the paper's, about 28 (Sec. 2.1).
    """
    if not isinstance(form.pockets, Slots):
        return None
    return _round_the_tube(form, laminate, 2 * form.pockets.width / math.pi)


def _round_the_tube(form: Form, laminate: Laminate, rise: float) -> float | None:
    """Return the diameter in mm with every balloon ``rise`` mm high."""
    if form.wrap is None:
        return None
    return form.wrap.tube_diameter + 2 * (laminate.balloons * rise + laminate.thickness)


def size_phrases(design: Design, laminate: Laminate, press_factor: float = 1.0) -> tuple[str, ...]:
    """Return the size in phrases: overall diameter, outline diameter, flat extent, and height.

    Films flow in the press: ``press_factor`` is their thickness after it over that before. Beside
    the sum of the films stands the paper's measured height.
    """
    sizes_mm = sizes(design, laminate, press_factor)
    phrases = []
    if "overall_diameter" in sizes_mm:
        over = beyond_the_outline(laminate)
        phrases.append(f"{sizes_mm['overall_diameter']:.2f} mm overall diameter with {over}")
    if "outline_diameter" in sizes_mm:
        phrases.append(f"{sizes_mm['outline_diameter']:.2f} without")
    if "deflated_diameter" in sizes_mm:
        phrases.append(f"{sizes_mm['deflated_diameter']:.2f} mm round its tube")
    form = design.form
    flat = "flat, " if form.wrap is not None else ""
    phrases.append(f"{flat}{sizes_mm['width']:.2f} x {sizes_mm['length']:.2f} mm")
    height = f"folded height {sizes_mm['thickness']:.3f} mm"
    if press_factor == 1:
        row = counterpart(form, "deflated height", FLAT_HEIGHT_OF_FILMS)
        height += f" {row.brief}" if row else ""
    return (*phrases, height)
