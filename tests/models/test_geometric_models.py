"""The paper's geometric model against quadrature, series and the paper's own equations."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import minimize_scalar

from sbafab.errors import DesignError
from sbafab.models import lens, parabola, printed
from sbafab.simulators.coarse import Meridian


@pytest.mark.parametrize("length", [2.5, 5.0, 0.7])
@pytest.mark.parametrize("share", [0.02, 0.3, 0.53])
def test_parabola_solves_eqs_1_to_3(length: float, share: float) -> None:
    h = share * length
    rho = float(parabola.radius(h, length))
    a = h / rho**2
    arc, _ = quad(lambda x: math.sqrt(1 + (2 * a * x) ** 2), 0, rho)
    held, _ = quad(lambda x: 2 * math.pi * x * (h - a * x * x), 0, rho)
    assert arc == pytest.approx(length, rel=1e-9)
    assert float(parabola.volume(h, length)) == pytest.approx(held, rel=1e-9)


def test_largest_volume_at_2_5_is_16_947() -> None:
    found = minimize_scalar(
        lambda rho: -held_by(rho, 2.5), bounds=(1.5, 2.4), method="bounded", options={"xatol": 1e-9}
    )
    most = parabola.fullest(2.5)
    assert 2 * most.volume == pytest.approx(-2 * found.fun, rel=1e-9)
    assert 2 * most.volume == pytest.approx(16.947, abs=0.0005)
    assert most.radius == pytest.approx(found.x, abs=1e-4)
    assert most.height == pytest.approx(1.33, abs=0.005)


def held_by(rho: float, length: float) -> float:
    """Volume of a half of this radius, its height from the arc by quadrature and bisection."""
    low, high = 0.0, length
    for _ in range(60):
        h = (low + high) / 2
        k = 2 * h / rho
        # Arc of y = h - h x^2 / rho^2 with x = rho t.
        arc = rho * quad(lambda t, k=k: math.sqrt(1 + (k * t) ** 2), 0, 1)[0]
        low, high = (h, high) if arc < length else (low, h)
    return math.pi * rho**2 * high / 2


@pytest.mark.parametrize("half", [1.0, 2.5, 5.0])
def test_scenes_stop_at_the_same_volume(half: float) -> None:
    steepest = Meridian(0.0, half, parabola.fullest(half).slope)
    assert steepest.volume == pytest.approx(2 * parabola.fullest(half).volume, rel=1e-9)


@pytest.mark.parametrize(("share", "ratio"), [(0.05, 1.333), (0.2, 1.337), (0.4, 1.395)])
def test_eq_4_against_eqs_1_to_3(share: float, ratio: float) -> None:
    h = 2.5 * share
    found = float(printed.volume(h, 2.5) / parabola.volume(h, 2.5))
    assert found == pytest.approx(ratio, abs=0.0005)


def test_series_of_eqs_1_to_3_and_of_eq_4_part_in_the_first_and_the_fifth_power() -> None:
    # v / l^3 = (pi/2) u (1 - (4/3) u^2 + (16/45) u^4) against (2 pi/3) u (... + (16/9) u^4).
    u = np.array([0.05, 0.1])
    exact = math.pi / 2 * u * (1 - 4 / 3 * u**2 + 16 / 45 * u**4)
    np.testing.assert_allclose(parabola.volume(u, 1.0), exact, rtol=1e-6)
    as_printed = 2 * math.pi / 3 * u * (1 - 4 / 3 * u**2 + 16 / 9 * u**4)
    np.testing.assert_allclose(printed.volume(u, 1.0), as_printed, rtol=1e-12)


def test_eq_4_is_as_printed() -> None:
    h, length = 1.1, 2.5
    by_hand = math.pi / (27 * 6.25) * (32 * 1.61051 - 24 * 1.331 * 6.25 + 18 * 1.1 * 39.0625)
    assert float(printed.volume(h, length)) == pytest.approx(by_hand, rel=1e-12)


@pytest.mark.parametrize(
    ("volume", "stroke", "rate", "most"),
    [
        (parabola.volume, parabola.height, parabola.rate, parabola.fullest(3.0).height),
        (
            parabola.balloon_volume,
            parabola.balloon_stroke,
            parabola.balloon_rate,
            2 * parabola.fullest(3.0).height,
        ),
        (printed.volume, printed.stroke, printed.rate, printed.largest_stroke(3.0)),
    ],
)
def test_there_and_back_and_the_slope_between(volume, stroke, rate, most) -> None:  # type: ignore[no-untyped-def]
    h = np.linspace(0, most, 23)
    # Where a volume is the largest, its height is only known to the root of the arithmetic's error.
    np.testing.assert_allclose(stroke(volume(h, 3.0), 3.0)[:-1], h[:-1], atol=1e-9)
    assert float(stroke(float(volume(most, 3.0)), 3.0)) == pytest.approx(most, abs=1e-6)
    step = 1e-5
    inner = h[1:-1]
    slope = (volume(inner + step, 3.0) - volume(inner - step, 3.0)) / (2 * step)
    np.testing.assert_allclose(rate(inner, 3.0), slope, rtol=1e-6, atol=1e-6)
    assert stroke(0.0, 3.0) == 0


def test_the_fullest_balloon_has_no_force_left() -> None:
    assert float(parabola.rate(parabola.fullest(2.5).height, 2.5)) == pytest.approx(0, abs=1e-6)


def test_scalars_and_arrays_of_any_shape() -> None:
    grid = np.array([[0.1, 0.2], [0.3, 0.4]])
    assert printed.volume(grid, 2.5).shape == (2, 2)
    assert float(parabola.volume(0.3, 2.5)) == parabola.volume(grid, 2.5)[1, 0]


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (
            lambda: parabola.balloon_stroke(17.0, 2.5),
            "volume of a balloon = 17 ul .* 0 to 16.94 ul",
        ),
        (lambda: parabola.balloon_stroke([1.0, -2.0], 2.5), "= -2 ul"),
        (lambda: parabola.volume(1.34, 2.5), "half a balloon = 1.34 mm .* 0 to 1.327 mm"),
        (lambda: printed.stroke(13.4, 2.5), "Eq. 4; give 0 to 13.29 ul"),
        (lambda: printed.volume(math.nan, 2.5), "stroke of a balloon = nan mm .* 0 to 1.327 mm"),
        (lambda: lens.stroke(410, 10, 8.5), "lens of two arcs; give 0 to 409.9 ul"),
    ],
)
def test_out_of_range_says_the_range(call, said: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(DesignError, match=said):
        call()


def test_what_the_range_says_is_allowed() -> None:
    assert parabola.balloon_stroke(16.94, 2.5) > 2.5
    assert printed.stroke(13.29, 2.5) > 1.32


def test_lens_keeps_the_length_of_its_films() -> None:
    width, run = 10.0, 8.5
    h = 4.0
    # A segment's radius from height and half angle; its arc must be the width.
    b = np.linspace(0.01, math.pi / 2, 200_001)
    radius = width / (2 * b)
    nearest = np.argmin(abs(2 * radius * (1 - np.cos(b)) - h))
    segment = radius[nearest] ** 2 * (2 * b[nearest] - math.sin(2 * b[nearest]))
    rise = h / 2
    caps = 2 * math.pi * rise**2 * (3 * radius[nearest] - rise) / 3
    assert float(lens.volume(h, width, run)) == pytest.approx(segment * run + caps, rel=1e-4)


def test_a_long_slot_becomes_a_cylinder() -> None:
    most = lens.fullest(10.0, 1e5)
    assert most.stroke == pytest.approx(20 / math.pi, rel=1e-3)
    assert most.volume == pytest.approx(math.pi * (10 / math.pi) ** 2 * 1e5, rel=1e-3)


def test_a_slot_without_run_is_nearly_the_parabola() -> None:
    # Two shapes of the same meridian length: within 2 % while they are shallow.
    h = np.linspace(0.2, 2.3, 9)
    ratio = lens.volume(h, 10.0, 0.0) / parabola.balloon_volume(h, 5.0)
    np.testing.assert_allclose(ratio, 1.0, atol=0.02)


def test_lens_there_and_back_and_its_slope() -> None:
    most = lens.fullest(10.0, 8.5)
    h = np.linspace(0.01, 0.99, 15) * most.stroke
    np.testing.assert_allclose(lens.stroke(lens.volume(h, 10, 8.5), 10, 8.5), h, rtol=1e-7)
    slope = (lens.volume(h + 1e-5, 10, 8.5) - lens.volume(h - 1e-5, 10, 8.5)) / 2e-5
    np.testing.assert_allclose(lens.rate(h, 10, 8.5), slope, rtol=1e-5, atol=1e-4)
    flat = 2 / 3 * 10 * 8.5 + math.pi * 100 / 8
    assert float(lens.rate(0.0, 10, 8.5)) == pytest.approx(flat, rel=1e-5)
