"""Closed formulas: bend of parallel chambers, range of pressures, folded diameter, force by virtual
work, inlet tubes, tip stiffness, and overall sizes.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sbafab.design.records import Design, Discs, Form, Slots, Wrap
from sbafab.errors import BeyondError, DesignError
from sbafab.geometry.region import Region, centroid
from sbafab.laminate.burst import RADIUS, burst
from sbafab.laminate.laminate import (
    Laminate,
    beyond_the_outline,
    outline_diameter,
    overall_diameter,
)
from sbafab.models.figures import USUAL_PRESSURES, Factors
from sbafab.models.intervals import factors_of
from sbafab.models.lens import fullest
from sbafab.models.paper import BALLOONS, counterpart
from sbafab.models.quantity import ANYWHERE, ModelId, Quantity


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
    # 2 sin^2(x/2) is 1 - cos x without its cancellation.
    aside = np.where(angle > 0, length * 2 * np.sin(safe / 2) ** 2 / safe, 0.0)
    up = np.where(angle > 0, length * np.sin(safe) / safe, length)
    tip = np.stack([aside * np.cos(towards), aside * np.sin(towards), up], axis=-1)
    return Bend(angle, towards, length, tip)


# Pressures: gauge pressures in kPa, a vacuum below 0.


MOST_PRESSURE = 1000.0
"""kPa, nearly three times what burst the paper's actuators."""
ATMOSPHERE = 101.325
"""kPa, the largest vacuum."""


def usual_pressures(form: Form) -> tuple[float, ...]:
    """Return the pressures in kPa of a design's prediction; negative if it works under a vacuum."""
    return tuple(-kpa if form.works_under_vacuum else kpa for kpa in USUAL_PRESSURES)


def refuse_pressure(kpa: ArrayLike, is_vacuum: bool = False) -> None:
    """Raise DesignError for a pressure in kPa that no model takes: pressures of inflated pockets
    are from 0 up, pressures of pockets that work under a vacuum from 0 down.
    """
    low, high = (-ATMOSPHERE, 0.0) if is_vacuum else (0.0, MOST_PRESSURE)
    for each in np.atleast_1d(np.asarray(kpa, dtype=float)).tolist():
        if low <= each <= high:
            continue
        hint = f"; a vacuum is negative: write {-each:g}" if is_vacuum and each > 0 else ""
        hint = "; it is inflated, and a vacuum does nothing" if not is_vacuum and each < 0 else hint
        raise DesignError(
            f"pressure = {each:g} kPa is out of range; give {low:g} to {high:g} kPa, as a gauge "
            f"shows it{hint}"
        )


def refuse_beyond_burst(laminate: Laminate, kpa: float) -> None:
    """Raise BeyondError for a pressure in kPa past the estimated burst pressure of a laminate."""
    estimate = burst(laminate)
    if estimate is not None and kpa > estimate.kpa:
        raise BeyondError(
            f"{kpa:g} kPa is past the estimated burst pressure, {estimate.kpa:.3g} kPa; give less "
            "pressure, or take narrower pockets or thicker film",
            kpa / estimate.kpa - 1,
        )


def is_near_burst(laminate: Laminate, kpa: float) -> bool:
    """Return True for a pressure in kPa above half of the estimated burst pressure."""
    estimate = burst(laminate)
    return estimate is not None and kpa > estimate.kpa / 2


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
    """Return N from kPa and dv/dh in mm2. Raises DesignError for a pressure out of range."""
    refuse_pressure(pressure_kpa)
    return np.asarray(np.asarray(pressure_kpa, dtype=float) * np.asarray(rate, dtype=float) / 1000)


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


def is_the_papers_3dof(form: Form, laminate: Laminate) -> bool:
    """Return True for the actuator whose heights and bends the paper measured."""
    return (
        form.wrap is None
        and form.stacks == LOBES
        and form.pockets == Discs((2 * RADIUS,) * BALLOONS)
        and all(layer.film.is_the_papers for layer in laminate.tpe_layers)
    )


def sizes(design: Design, laminate: Laminate, factors: Factors | None = None) -> dict[str, float]:
    """Return sizes in mm by name: of the flat laminate and, for radial designs, round the tube.

    Width, length and overall diameter include masks, inlet tabs and ears. The outline diameter is
    measured on the films without tabs and ears. The thickness is the sum of the films as bought,
    the folded height the sum after the press, which diameters round the tube contain twice. The
    default ``factors`` come from the design's calibration. Raises DesignError if it is unknown.
    """
    height = (factors or factors_of(design)).folded(laminate).height
    low_x, low_y, high_x, high_y = laminate.bounds
    sizes_mm = {
        "thickness": laminate.thickness,
        "folded_height": height,
        "width": high_x - low_x,
        "length": high_y - low_y,
    }
    form = design.form
    if form.wrap is not None:
        sizes_mm["pitch"] = form.wrap.pitch
        sizes_mm["deflated_diameter"] = deflated_diameter(form.wrap, height)
        reached = reached_diameter(form, laminate.balloons, height)
        inflated = inflated_diameter(form, laminate.balloons, height)
        if reached is not None and inflated is not None:
            sizes_mm |= {"reached_diameter": reached, "inflated_diameter": inflated}
    else:
        if not laminate.outline.is_empty:
            sizes_mm["outline_diameter"] = outline_diameter(laminate)
        sizes_mm["overall_diameter"] = overall_diameter(laminate)
    return sizes_mm


def deflated_diameter(wrap: Wrap, height: float) -> float:
    """Return the diameter in mm of tube and flat laminate of a height in mm; with the films as
    bought the paper's is 15.33 (Sec. 2.1).
    """
    return wrap.tube_diameter + 2 * height


def reached_diameter(form: Form, balloons: int, height: float) -> float | None:
    """Return the diameter in mm of the tube with SBAs at their largest volume, their flat laminate
    of a height in mm: the reach to rely on.

    None without a tube, or for pockets of another shape. Balloons are lenses of two arcs
    (``models.lens``); the paper's, its films as bought, reach 27.29, about 28 (Sec. 2.1).
    """
    if not isinstance(form.pockets, Slots) or form.wrap is None:
        return None
    rise = fullest(form.pockets.width, form.pockets.run).stroke
    return deflated_diameter(form.wrap, height) + 2 * balloons * rise


def inflated_diameter(form: Form, balloons: int, height: float) -> float | None:
    """Return the diameter in mm of the tube with SBAs as wide as can be: the clearance to provide.

    None without a tube, or for pockets of another shape. A flat pocket of width w whose films do
    not stretch becomes a cylinder of diameter 2 w / pi where its ends do not hold it back: 28.06
    for the paper's, its films as bought, about 28 (Sec. 2.1).
    """
    if not isinstance(form.pockets, Slots) or form.wrap is None:
        return None
    rise = 2 * form.pockets.width / math.pi
    return deflated_diameter(form.wrap, height) + 2 * balloons * rise


def size_phrases(
    design: Design, laminate: Laminate, factors: Factors | None = None
) -> tuple[str, ...]:
    """Return the size in phrases: overall diameter, outline diameter, flat extent, and height;
    ``factors`` as in ``sizes``. For the paper's actuator the measured height follows the sum of the
    films.
    """
    factors = factors or factors_of(design)
    sizes_mm = sizes(design, laminate, factors)
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
    folded = factors.folded(laminate)
    height = f"folded height {folded.height:.3f} mm"
    row = None
    if factors.press_factor == 1 and is_the_papers_3dof(form, laminate):
        height_of = Quantity.FOLDED_HEIGHT, ANYWHERE, ModelId.FILMS
        row = counterpart(form, *height_of, of_papers=True)
    remark = row.brief if row else f"({folded.remark})" if folded.remark else ""
    return (*phrases, f"{height} {remark}".rstrip())
