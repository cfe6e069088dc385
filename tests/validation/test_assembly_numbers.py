"""The paper's assemblies (Sec. 2.1 and 5): 15.33 deflated, about 28 inflated, 120 degrees apart."""

from __future__ import annotations

import math

import numpy as np
import pytest

import sbafab
from sbafab.assemblies.build import assemble
from sbafab.assemblies.checks import run_checks
from sbafab.assemblies.files import load_assembly
from sbafab.models.calibration import factors_of
from sbafab.models.figures import Factors
from sbafab.models.sizes import sizes


def measured(template: str, rule: str) -> tuple[float | None, float | None, str]:
    (found,) = [f for f in run_checks(assemble(load_assembly(template))) if f.rule == rule]
    return found.measured, found.limit, found.verdict


def test_the_brace_passes_the_lumen_deflated_and_holds_in_it_inflated() -> None:
    deflated, lumen, verdict = measured("brace", "lumen-pass")
    assert lumen == 25.4
    # Tabs folded back over the tube: two films, the strip and the supply tube, on both sides.
    assert deflated == pytest.approx(15 + 2 * (2 * 0.038 + 0.025 + 1.016), abs=1e-6)
    grip = assemble(load_assembly("brace"))["grip"].made
    assert grip is not None
    bought = sizes(grip.design, grip.laminate, Factors())
    assert bought["deflated_diameter"] == pytest.approx(15.33, abs=0.005)
    assert verdict == "pass"
    inflated, lumen, verdict = measured("brace", "lumen-brace")
    assert lumen == 25.4
    # Two arcs 10 mm long that hold the most, on both sides, and the films as the press leaves them.
    films = factors_of(grip.design).folded(grip.laminate).height
    assert inflated == pytest.approx(15 + 2 * (fullest_rise(10, 8.5) + films), abs=1e-4)
    # Sec. 2.1: about 28; with films as bought 27.29.
    assert inflated == pytest.approx(28, rel=0.035)
    assert verdict == "pass"


def test_a_short_balloon_that_only_a_cylinder_would_bring_to_the_wall_fails() -> None:
    """Of 9.5 x 9.5: 25.51 mm as full cylinders, but no air drives it beyond 23.94, with films as
    bought.
    """
    assembly = load_assembly("brace", ["parts.grip.set.chamber={width = 9.5, length = 9.5}"])
    (found,) = (one for one in run_checks(assemble(assembly)) if one.rule == "lumen-brace")
    assert found.verdict == "fail"
    flown = 2 * 3 * 0.038 * (1 - factors_of(sbafab.load("radial-15mm")).press_factor)
    assert found.measured == pytest.approx(15.328 - flown + 2 * fullest_rise(8, 0), abs=1e-4)
    assert 15.328 + 4 * 8 / math.pi > 25.4


def fullest_rise(width: float, run: float) -> float:
    """Height of the lens that holds most, from areas and caps of closed formulas."""
    half = np.linspace(0.5, math.pi / 2, 200_001)
    radius = width / (2 * half)
    rise = radius * (1 - np.cos(half))
    area = radius**2 * (2 * half - np.sin(2 * half))
    held = area * run + 2 * math.pi / 3 * rise**2 * (3 * radius - rise)
    return float(2 * rise[np.argmax(held)])


def test_the_balloons_of_the_brace_lie_120_degrees_apart_on_the_tube() -> None:
    made = assemble(load_assembly("brace"))
    grip = made["grip"]
    assert grip.made is not None
    chambers = grip.made.laminate.chambers
    places = [grip.at((*centre, 0.0)) for chamber in chambers for centre in chamber.centres]
    assert [math.hypot(x, y) for x, y, _ in places] == pytest.approx([7.5] * 3)
    angles = sorted(math.degrees(math.atan2(y, x)) % 360 for x, y, _ in places)
    assert [b - a for a, b in zip(angles, angles[1:], strict=False)] == pytest.approx([120, 120])


def test_the_aperture_lies_between_the_two_predictions() -> None:
    nominal, hole, verdict = measured("aperture", "aperture")
    assert hole == 9.25
    # Lobes 6.5 wide as chords of a circle round a triangle, 1.865 thick.
    assert nominal == pytest.approx(2 * math.hypot(6.5 / (2 * math.sqrt(3)) + 1.865, 3.25))
    assert verdict == "warn"


def test_three_actuators_of_one_design_stand() -> None:
    made = assemble(load_assembly("standing"))
    assert [one.design.order.copies for one in made.designs] == [3]
    assert made["left"].radius == made["right"].radius == 7.5
    legs = [made[name].at((0, 0, 0)) for name in ("left", "right")]
    angles = [math.degrees(math.atan2(y, -z)) for _, y, z in legs]
    assert abs(angles[0] - angles[1]) == pytest.approx(120)
    assert made["head"].at((0, 0, 0)) == pytest.approx((60, 0, 0))
