"""Closed forms against quadrature, series, each other and the paper's numbers."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import minimize_scalar

from sbafab.errors import DesignError
from sbafab.models.closed_forms import (
    ClosedForm,
    bend,
    eq_4,
    eqs_1_to_3,
    lens,
    paraboloid_radius,
)
from sbafab.models.pneumatics import seconds
from sbafab.simulators.shell_model import Meridian

AXES = [(4.25 * math.cos(t), 4.25 * math.sin(t)) for t in np.radians([0, 120, 240])]
POCKETS = [eq_4(3.0), eqs_1_to_3(3.0), eqs_1_to_3(0.7), lens(10.0, 8.5), lens(10.0, 0.0)]


@pytest.mark.parametrize("length", [2.5, 5.0, 0.7])
@pytest.mark.parametrize("share", [0.02, 0.3, 0.53])
def test_two_halves_solve_eqs_1_to_3(length: float, share: float) -> None:
    h = share * length
    volume = float(eqs_1_to_3(length).volume(2 * h))
    rho = paraboloid_radius(volume / 2, h)
    a = h / rho**2
    arc, _ = quad(lambda x: math.sqrt(1 + (2 * a * x) ** 2), 0, rho)
    held, _ = quad(lambda x: 2 * math.pi * x * (h - a * x * x), 0, rho)
    assert arc == pytest.approx(length, rel=1e-8)
    assert volume / 2 == pytest.approx(held, rel=1e-8)


def test_largest_volume_at_2_5_is_16_947() -> None:
    def volume(k: float) -> float:
        """Volume of two halves of edge slope k, the radius from the arc by quadrature."""
        rho = 2.5 / quad(lambda t: math.sqrt(1 + (k * t) ** 2), 0, 1)[0]
        return math.pi * rho**3 * k / 2

    found = minimize_scalar(lambda k: -volume(k), bounds=(0.5, 3.0), method="bounded")
    most = eqs_1_to_3(2.5)
    assert most.largest_volume == pytest.approx(-found.fun, rel=1e-9)
    assert most.largest_volume == pytest.approx(16.947, abs=0.0005)
    assert most.largest_stroke / 2 == pytest.approx(1.33, abs=0.005)
    assert float(most.rate(most.largest_stroke)) == pytest.approx(0, abs=1e-6)
    assert Meridian(0.0, 2.5, most.fullest).volume == pytest.approx(16.9466, rel=1e-5)


@pytest.mark.parametrize(("share", "ratio"), [(0.05, 1.333), (0.2, 1.337), (0.4, 1.395)])
def test_eq_4_against_eqs_1_to_3(share: float, ratio: float) -> None:
    h = 2.5 * share
    found = 2 * float(eq_4(2.5).volume(h) / eqs_1_to_3(2.5).volume(2 * h))
    assert found == pytest.approx(ratio, abs=0.0005)


def test_series_of_eqs_1_to_3_and_of_eq_4_part_in_the_first_and_the_fifth_power() -> None:
    # v / l^3 = (pi/2) u (1 - (4/3) u^2 + (16/45) u^4) against (2 pi/3) u (... + (16/9) u^4).
    u = np.array([0.05, 0.1])
    exact = math.pi / 2 * u * (1 - 4 / 3 * u**2 + 16 / 45 * u**4)
    np.testing.assert_allclose(eqs_1_to_3(1.0).volume(2 * u) / 2, exact, rtol=1e-6)
    as_printed = 2 * math.pi / 3 * u * (1 - 4 / 3 * u**2 + 16 / 9 * u**4)
    np.testing.assert_allclose(eq_4(1.0).volume(u), as_printed, rtol=1e-12)


def test_eq_4_is_as_printed() -> None:
    by_hand = math.pi / (27 * 6.25) * (32 * 1.61051 - 24 * 1.331 * 6.25 + 18 * 1.1 * 39.0625)
    assert float(eq_4(2.5).volume(1.1)) == pytest.approx(by_hand, rel=1e-12)


@pytest.mark.parametrize("pocket", POCKETS, ids=lambda pocket: pocket.model.name)
def test_there_and_back_and_the_slope_between(pocket: ClosedForm) -> None:
    most = pocket.largest_stroke
    h = np.linspace(0, most, 23).reshape(1, 23)
    # Where a volume is the largest, its height is only known to the root of the arithmetic's error.
    np.testing.assert_allclose(pocket.stroke(pocket.volume(h))[0, :-1], h[0, :-1], atol=1e-7)
    assert float(pocket.stroke(pocket.largest_volume)) == pytest.approx(most, abs=1e-6)
    assert pocket.stroke(0.0) == 0
    inner, step = h[0, 2:-1], 1e-5
    slope = (pocket.volume(inner + step) - pocket.volume(inner - step)) / (2 * step)
    np.testing.assert_allclose(pocket.rate(inner), slope, rtol=2e-5, atol=1e-4)


@pytest.mark.parametrize(
    ("pocket", "volume", "message"),
    [
        (eqs_1_to_3(2.5), 17.0, "volume = 17 ul a balloon .* 0 to 16.94 ul"),
        (eqs_1_to_3(2.5), -2.0, "= -2 ul"),
        (eq_4(2.5), 13.4, "Eq. 4; give 0 to 13.29 ul"),
        (eq_4(2.5), math.nan, "= nan ul"),
        (lens(10.0, 8.5), 410.0, "lens of two arcs; give 0 to 409.9 ul"),
    ],
)
def test_out_of_range_names_a_range_that_is_allowed(
    pocket: ClosedForm, volume: float, message: str
) -> None:
    with pytest.raises(DesignError, match=message) as refused:
        pocket.stroke(volume)
    assert pocket.stroke(float(str(refused.value).split()[-4])) > 0.9 * pocket.largest_stroke


def test_lens_keeps_the_length_of_its_films() -> None:
    width, run, h = 10.0, 8.5, 4.0
    # A segment's radius from height and half angle; its arc must be the width.
    b = np.linspace(0.01, math.pi / 2, 200_001)
    radius = width / (2 * b)
    nearest = np.argmin(abs(2 * radius * (1 - np.cos(b)) - h))
    segment = radius[nearest] ** 2 * (2 * b[nearest] - math.sin(2 * b[nearest]))
    caps = 2 * math.pi * (h / 2) ** 2 * (3 * radius[nearest] - h / 2) / 3
    assert float(lens(width, run).volume(h)) == pytest.approx(segment * run + caps, rel=1e-4)
    flat = 2 / 3 * 10 * 8.5 + math.pi * 100 / 8
    assert float(lens(width, run).rate(0.0)) == pytest.approx(flat, rel=1e-5)


def test_a_long_slot_becomes_a_cylinder_and_one_without_run_nearly_the_parabola() -> None:
    long = lens(10.0, 1e5)
    assert long.largest_stroke == pytest.approx(20 / math.pi, rel=1e-3)
    assert long.largest_volume == pytest.approx(math.pi * (10 / math.pi) ** 2 * 1e5, rel=1e-3)
    # Two shapes of the same meridian length: within 2 % while they are shallow.
    h = np.linspace(0.2, 2.3, 9)
    ratio = lens(10.0, 0.0).volume(h) / eqs_1_to_3(5.0).volume(h)
    np.testing.assert_allclose(ratio, 1.0, atol=0.02)


def test_force_and_time_of_the_paper() -> None:
    # p (2/3) pi l^2 and p (pi/2) l^2.
    by_eq_4, by_eqs = (0.1 * float(of(2.5).push(0.0)) for of in (eq_4, eqs_1_to_3))
    assert by_eq_4 == pytest.approx(0.1 * 2 / 3 * math.pi * 6.25) == pytest.approx(1.31, abs=0.005)
    assert by_eqs == pytest.approx(0.1 * math.pi / 2 * 6.25) == pytest.approx(0.98, abs=0.005)
    balloon = float(eq_4(2.5).volume(17.5 / 15))
    assert float(seconds(3 * 15 * balloon, 35)) == pytest.approx(0.935, abs=0.0005)


def test_one_long_chamber_bends_to_the_other_side() -> None:
    found = bend([13.0, 7.0, 7.0], AXES)
    # The two others lie half as far on the other side: 6 mm over 1.5 x 4.25.
    assert float(found.angle) == pytest.approx(6 / (1.5 * 4.25))
    assert float(found.length) == pytest.approx(9.0)
    assert abs(float(found.towards)) == pytest.approx(math.pi)
    r = 9.0 / float(found.angle)
    tip = [-r * (1 - math.cos(found.angle)), 0.0, r * math.sin(found.angle)]
    np.testing.assert_allclose(found.tip, tip, atol=1e-12)


def test_chamber_lengths_come_back_from_the_arc() -> None:
    lengths = np.array([8.0, 11.0, 6.5])
    found = bend(lengths, AXES)
    towards = np.array([math.cos(found.towards), math.sin(found.towards)])
    inner = found.length - found.angle * (np.array(AXES) @ towards)
    np.testing.assert_allclose(inner, lengths, rtol=1e-12)


def test_equal_chambers_stay_straight_and_two_bend_in_their_plane() -> None:
    for count in range(2, 9):
        turns = np.linspace(0, 2 * math.pi, count, endpoint=False)
        axes = np.column_stack([np.cos(turns), np.sin(turns)]) * 5
        found = bend(np.full((4, count), 9.0), axes)
        np.testing.assert_allclose(found.angle, 0, atol=1e-12)
        np.testing.assert_allclose(found.tip, np.tile([0, 0, 9.0], (4, 1)), atol=1e-11)
    found = bend([10.0, 8.0], [(4.0, 0.0), (-4.0, 0.0)])
    assert float(found.angle) == pytest.approx(2 / 8)
    assert float(found.tip[1]) == pytest.approx(0, abs=1e-12)
