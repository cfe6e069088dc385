"""Force, flow, bending, stiffness, folding: closed forms and the paper's numbers."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sbafab.errors import DesignError
from sbafab.geometry.region import Region, disc, rectangle
from sbafab.models import formulas, parabola, printed
from sbafab.models.formulas import (
    folded_diameter,
    force,
    largest_tube,
    modulus,
    second_moments,
    tip_stiffness,
    work_uj,
)
from sbafab.models.pneumatics import seconds

AXES = [(4.25 * math.cos(t), 4.25 * math.sin(t)) for t in np.radians([0, 120, 240])]


def test_force_of_a_flat_balloon_of_5_at_100_kpa() -> None:
    # p (2/3) pi l^2 and p (pi/2) l^2.
    assert float(force(100, printed.rate(0.0, 2.5))) == pytest.approx(0.1 * 2 / 3 * math.pi * 6.25)
    assert float(force(100, parabola.rate(0.0, 2.5))) == pytest.approx(0.1 * math.pi / 2 * 6.25)
    assert float(force(100, printed.rate(0.0, 2.5))) == pytest.approx(1.31, abs=0.005)
    assert float(force(100, parabola.rate(0.0, 2.5))) == pytest.approx(0.98, abs=0.005)


@pytest.mark.parametrize("pressure", [-1, 1001, math.nan])
def test_pressure_out_of_range_says_the_range(pressure: float) -> None:
    with pytest.raises(DesignError, match="give 0 to 1000 kPa, as a gauge shows it"):
        force(pressure, 1.0)


def test_water_fills_a_3dof_in_0_935_s() -> None:
    balloon = float(printed.volume(17.5 / 15, 2.5))
    assert float(seconds(3 * 15 * balloon, 35)) == pytest.approx(0.935, abs=0.0005)


def test_gas_is_counted_at_the_atmosphere() -> None:
    assert float(seconds(1000, 60)) == pytest.approx(1.0)
    assert float(seconds(1000, 60, gas_at_kpa=101.325)) == pytest.approx(2.0)
    with pytest.raises(DesignError, match="flow = 0 ml/min must be from"):
        seconds(1.0, 0.0)


def test_work_of_a_litre_at_a_kilopascal_is_a_joule() -> None:
    assert work_uj(1.0, 1e6) == 1e6


def test_one_long_chamber_bends_to_the_other_side() -> None:
    found = formulas.bend([13.0, 7.0, 7.0], AXES)
    # The two others lie half as far on the other side: 6 mm over 1.5 x 4.25.
    assert float(found.angle) == pytest.approx(6 / (1.5 * 4.25))
    assert float(found.length) == pytest.approx(9.0)
    assert abs(float(found.towards)) == pytest.approx(math.pi)
    r = 9.0 / float(found.angle)
    np.testing.assert_allclose(
        found.tip,
        [-r * (1 - math.cos(found.angle)), 0.0, r * math.sin(found.angle)],
        atol=1e-12,
    )


def test_chamber_lengths_come_back_from_the_arc() -> None:
    lengths = np.array([8.0, 11.0, 6.5])
    found = formulas.bend(lengths, AXES)
    inner = [
        float(found.length)
        - float(found.angle) * (x * math.cos(found.towards) + y * math.sin(found.towards))
        for x, y in AXES
    ]
    np.testing.assert_allclose(inner, lengths, rtol=1e-12)


def test_equal_chambers_stay_straight_whatever_their_number() -> None:
    for count in range(2, 9):
        turns = np.linspace(0, 2 * math.pi, count, endpoint=False)
        axes = np.column_stack([np.cos(turns), np.sin(turns)]) * 5
        found = formulas.bend(np.full((4, count), 9.0), axes)
        np.testing.assert_allclose(found.angle, 0, atol=1e-12)
        np.testing.assert_allclose(found.tip, np.tile([0, 0, 9.0], (4, 1)), atol=1e-11)


def test_two_chambers_bend_in_their_plane() -> None:
    found = formulas.bend([10.0, 8.0], [(4.0, 0.0), (-4.0, 0.0)])
    assert float(found.angle) == pytest.approx(2 / 8)
    assert float(found.tip[1]) == pytest.approx(0, abs=1e-12)


def test_three_folded_lobes() -> None:
    assert folded_diameter(6.5, 1.865) == pytest.approx(9.9, abs=0.05)
    assert folded_diameter(6.5, 0.95) == pytest.approx(8.6, abs=0.05)
    # Lobes without thickness: a triangle in its circle.
    assert folded_diameter(6.5, 0.0) == pytest.approx(2 * 6.5 / math.sqrt(3))


def test_strip_of_the_paper_opens_to_the_rpt040_tube() -> None:
    assert largest_tube(math.pi * 1.016 / 2) == pytest.approx(1.016)


def test_second_moments_of_disc_rectangle_and_what_is_moved_or_turned() -> None:
    low, high = second_moments(disc((3.0, -2.0), 3.25))
    assert low == pytest.approx(math.pi * 3.25**4 / 4, rel=2e-4)
    assert high == pytest.approx(low, rel=1e-6)
    bar = rectangle((-1.0, -3.0), (1.0, 3.0)).turned(30.0).moved(7.0, 1.0)
    assert second_moments(bar) == pytest.approx((6 * 8 / 12, 2 * 216 / 12))


def test_second_moment_of_a_ring_leaves_the_hole_out() -> None:
    ring: Region = disc((0.0, 0.0), 2.0) - disc((0.0, 0.0), 1.0)
    assert second_moments(ring)[0] == pytest.approx(math.pi * (16 - 1) / 4, rel=5e-4)


def test_cantilever_there_and_back() -> None:
    stiffness = tip_stiffness(60.0, 400.0, 17.5)
    assert modulus(stiffness * 0.3, 0.3, 17.5, 400.0) == pytest.approx(60.0)
    # F l^3 / (3 delta I) with F = 1 N, l = 10 mm, delta = 1 mm, I = 1 mm4.
    assert modulus(1.0, 1.0, 10.0, 1.0) == pytest.approx(1000 / 3 * 1000)
