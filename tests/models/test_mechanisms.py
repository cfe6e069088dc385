"""Closed forms of drawn mechanisms against quadrature, statics, limits and numbers done by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

import sbafab
from sbafab.errors import DesignError
from sbafab.models import pouch

STEP = 1e-5


def lens(length: float, angle: float) -> float:
    """The section of two arcs of this length, by counting strips below the upper one."""
    radius = length / (2 * angle)
    x = np.linspace(-radius * math.sin(angle), radius * math.sin(angle), 200001)
    y = np.sqrt(np.maximum(radius**2 - x**2, 0)) - radius * math.cos(angle)
    return 2 * float(np.trapezoid(y, x))


@pytest.mark.parametrize("angle", [0.3, 0.9, 1.3, math.pi / 2])
def test_pouch_holds_two_arcs_of_its_length(angle: float) -> None:
    share = float(pouch.contraction(angle))
    assert share == pytest.approx(1 - math.sin(angle) / angle, rel=1e-9)
    assert float(pouch.half_angle(share)) == pytest.approx(angle, rel=1e-6)
    assert float(pouch.volume(share, 30.0, 40.0)) == pytest.approx(40 * lens(30, angle), rel=1e-5)


def test_pouch_ends_as_a_cylinder_36_percent_shorter() -> None:
    """A tube of circumference 2 L: diameter 2 L / pi, section L^2 / pi (Niiyama et al. 2015)."""
    most = pouch.LARGEST_CONTRACTION
    assert most == pytest.approx(0.3634, abs=5e-5)
    assert float(pouch.volume(most, 30.0, 40.0)) == pytest.approx(40 * 900 / math.pi, rel=1e-9)
    assert float(pouch.pull(10.0, most, 30.0, 40.0)) == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("share", [0.02, 0.1, 0.25, 0.35])
def test_pull_is_virtual_work(share: float) -> None:
    length, width, kpa = 30.0, 40.0, 10.0
    rate = float(
        pouch.volume(share + STEP, length, width) - pouch.volume(share - STEP, length, width)
    ) / (2 * STEP * length)
    pull = float(pouch.pull(kpa, share, length, width))
    assert pull == pytest.approx(kpa / 1000 * rate, rel=1e-5)
    # Both films pull at their edges, where they stand at half the arc's angle.
    angle = float(pouch.half_angle(share))
    tension = float(pouch.tension(kpa, angle, length))
    assert pull == pytest.approx(2 * tension * width * math.cos(angle), rel=1e-9)


def test_a_pouch_shortens_by_36_percent_at_most() -> None:
    with pytest.raises(DesignError, match=r"contraction = 0\.4 .* give 0 to 0\.363"):
        pouch.half_angle(0.4)


def hinge_section(bend: float, length: float) -> float:
    """The triangle over the joint and the arc over that."""
    angle = pouch.half_angle(1 - math.cos(bend / 2))
    return length**2 / 8 * math.sin(bend) + length**2 / 4 * float(pouch.section(angle))


@pytest.mark.parametrize("degrees", [5.0, 40.0, 80.0, 94.0])
def test_moment_of_a_hinge_is_virtual_work(degrees: float) -> None:
    """Statics of the plates against the work of the air: two ways that share no line."""
    bend, length, width, kpa = math.radians(degrees), 12.0, 20.0, 10.0
    higher, lower = (hinge_section(bend + s, length) for s in (STEP, -STEP))
    work = kpa / 1000 * width * (higher - lower) / (2 * STEP)
    assert float(pouch.moment(kpa, bend, length, width)) == pytest.approx(work, rel=1e-4, abs=1e-6)


def test_a_straight_hinge_has_half_plus_root_third_of_a_plates_moment() -> None:
    """Series for small bends: t = sqrt 3 a / 2, so sin(t + a / 2) / t is 1 + 1 / sqrt 3."""
    by_hand = 10 / 1000 * 20 * 12**2 / 4 * (0.5 + 1 / math.sqrt(3))
    assert float(pouch.moment(10.0, 0.0, 12.0, 20.0)) == pytest.approx(by_hand, rel=1e-9)
    assert float(pouch.moment(10.0, 1e-3, 12.0, 20.0)) == pytest.approx(by_hand, rel=1e-3)


def test_a_hinge_rests_where_its_section_is_largest() -> None:
    bends = np.linspace(0.5, 1.76, 1261)
    largest = bends[np.argmax([hinge_section(float(bend), 10.0) for bend in bends])]
    assert pouch.free_bend() == pytest.approx(largest, abs=2e-3)
    # More than the 80 deg of real pouches, whose films and joints resist.
    assert 80 < math.degrees(pouch.free_bend()) < 100
    with pytest.raises(DesignError, match="bend of a hinge"):
        pouch.moment(10.0, 2.0, 10.0, 10.0)


def test_a_beam_wrinkles_and_collapses_by_the_pressure_on_its_cap() -> None:
    """The end caps pull p r / 2 along the tube; a beam's stress M / pi r^2 takes all of it. It
    collapses where the pressure on the cap turns about the last taut line.
    """
    kpa, width = 20.0, 31.41592653589793
    r = pouch.tube_radius(width)
    assert r == pytest.approx(10.0)
    # By hand: pi x 0.02 x 1000 / 2 N mm.
    moment = pouch.wrinkling_moment(kpa, width)
    assert moment == pytest.approx(31.4159, rel=1e-5) == math.pi * r**2 * 0.02 * r / 2
    assert pouch.collapse_moment(kpa, width) == pytest.approx(0.02 * math.pi * r**2 * r)
    assert pouch.hoop_tension(kpa, width) == pytest.approx(0.02 * r)


def test_sheets_jam_n_squared_times_as_stiff_and_slip_where_shear_reaches_friction() -> None:
    width, thick, count = 20.0, 0.2, 10
    loose = pouch.loose_stiffness(3000.0, width, thick, count)
    # By hand: 10 x 3000 x 20 x 0.008 / 12.
    assert loose == pytest.approx(400.0)
    assert pouch.jammed_stiffness(3000.0, width, thick, count) == pytest.approx(100 * loose)
    load, depth = pouch.slip_force(80.0, 0.3, width, thick, count), count * thick
    # F S / I b at the middle, with S = b H^2 / 8 and I = b H^3 / 12.
    shear = load * (width * depth**2 / 8) / (width * depth**3 / 12 * width)
    assert shear == pytest.approx(0.3 * 80.0 / 1000)


def test_a_hinge_without_a_stiff_plate_has_no_moment() -> None:
    """Two films of 0.038 mm: no plate, so a sentence in place of a tiny moment."""
    hinge = {"mechanism": {"kind": "hinge", "direction": 0}}
    said = sbafab.predict(sbafab.load("pouch", **hinge), pressures_kpa=[5.0])
    assert not [figure for figure in said.figures if figure.unit == "N mm"]
    (reason,) = (left.reason for left in said.left_out if left.name == "moment")
    assert "it has no stiff plate" in reason
    finger = sbafab.predict(sbafab.load("finger"), pressures_kpa=[5.0])
    assert [figure for figure in finger.figures if figure.unit == "N mm"]
