"""Ranges of pressures, folded diameter, force by virtual work, inlet tubes, tip stiffness, and
overall sizes.
"""

from __future__ import annotations

import math

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
from sbafab.models.closed_forms import cylinder_height, lens
from sbafab.models.figures import USUAL_PRESSURES, Factors
from sbafab.models.intervals import factors_of
from sbafab.models.paper import BALLOONS, counterpart
from sbafab.models.quantity import ANYWHERE, ModelId, Quantity

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

    Of oblong pockets round a tube, the reached diameter is that of lenses at their largest volume,
    to rely on, and the inflated one that of cylinders, the clearance to provide: 27.29 and 28.06
    for the paper's, its films as bought, which says about 28 (Sec. 2.1).
    """
    height = (factors or factors_of(design)).folded(laminate).height
    low_x, low_y, high_x, high_y = laminate.bounds
    sizes_mm = {
        "thickness": laminate.thickness,
        "folded_height": height,
        "width": high_x - low_x,
        "length": high_y - low_y,
    }
    wrap, pockets = design.form.wrap, design.form.pockets
    if wrap is None:
        if not laminate.outline.is_empty:
            sizes_mm["outline_diameter"] = outline_diameter(laminate)
        sizes_mm["overall_diameter"] = overall_diameter(laminate)
        return sizes_mm
    flat = deflated_diameter(wrap, height)
    sizes_mm |= {"pitch": wrap.pitch, "deflated_diameter": flat}
    if isinstance(pockets, Slots):
        reached = lens(pockets.width, pockets.run).largest_stroke
        sizes_mm["reached_diameter"] = flat + 2 * laminate.balloons * reached
        sizes_mm["inflated_diameter"] = flat + 2 * laminate.balloons * cylinder_height(
            pockets.width
        )
    return sizes_mm


def deflated_diameter(wrap: Wrap, height: float) -> float:
    """Return the diameter in mm of tube and flat laminate of a height in mm; with the films as
    bought the paper's is 15.33 (Sec. 2.1).
    """
    return wrap.tube_diameter + 2 * height


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
