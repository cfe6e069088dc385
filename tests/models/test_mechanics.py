"""Pressures, flow, stiffness, folding: formulas and the paper's numbers."""

from __future__ import annotations

import math

import pytest

from sbafab.errors import DesignError
from sbafab.geometry.region import Region, disc, rectangle
from sbafab.models.closed_forms import (
    folded_diameter,
    largest_tube,
    modulus,
    second_moments,
    tip_stiffness,
)
from sbafab.models.pneumatics import refuse_pressure, seconds


@pytest.mark.parametrize("pressure", [-1, 0, 1001, math.nan])
def test_pressure_out_of_range_says_the_range(pressure: float) -> None:
    with pytest.raises(DesignError, match="give more than 0, at most 1000 kPa gauge"):
        refuse_pressure(pressure)


def test_gas_is_counted_at_the_atmosphere() -> None:
    assert float(seconds(1000, 60)) == pytest.approx(1.0)
    assert float(seconds(1000, 60, gas_at_kpa=101.325)) == pytest.approx(2.0)
    with pytest.raises(DesignError, match="flow = 0 ml/min must be from"):
        seconds(1.0, 0.0)


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
