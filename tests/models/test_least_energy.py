"""Banded systems beside dense ones, and the energies' slopes beside their differences."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from sbafab.models import least_energy
from sbafab.models.balloon import (
    BalloonLoad,
    initial_shape,
    rim_ripples,
    ripple_energy,
    total_energy,
)
from sbafab.models.film_elements import RIM_ELEMENTS, Balloon
from sbafab.models.least_energy import NoEquilibrium, equilibrium

INNER = Balloon(neck=1.25, bore=0.5)
DRAW = np.random.default_rng(3)


def positive(size: int = 12, width: int = 4, rows: int = 3) -> np.ndarray:
    band = DRAW.normal(size=(size, width, rows))
    band[:, 0] += 10.0
    for k in range(1, width):
        band[size - k :, k] = 0.0
    return band


def test_a_band_is_solved_as_the_whole_matrix_is() -> None:
    band, wanted = positive(), DRAW.normal(size=(12, 3))
    own = np.transpose(least_energy.solve(band, wanted))
    assert own == pytest.approx(
        np.linalg.solve(least_energy.dense(band), wanted.T[..., None])[..., 0]
    )


@pytest.mark.parametrize("size", [3, 4, 48, 97])
def test_a_positive_band_is_solved_whole(size: int) -> None:
    band, wanted = positive(size), DRAW.normal(size=(size, 3))
    expected = least_energy.solve(band, wanted)
    assert least_energy.solve_whole(band, wanted) == pytest.approx(expected)
    band[size // 2, 0, 1] = -1.0
    assert least_energy.solve_whole(band, wanted) is None


def test_unknowns_that_are_equal_are_joined_and_those_that_are_held_are_none() -> None:
    band, pick = positive(), np.delete(np.eye(12), [1, 7], axis=1)
    pick[1], pick[5] = pick[3], 0.5 * pick[4] - pick[2]
    first, off = np.divmod(np.arange(48), 4)
    good = np.flatnonzero(first + off < 12)
    i, j = first[good], (first + off)[good]
    packing = least_energy.packing(pick[i], pick[j], good, i != j)
    whole = pick.T @ least_energy.dense(band) @ pick
    assert least_energy.dense(packing.band(band.reshape(-1, 3))) == pytest.approx(whole)


@pytest.mark.parametrize("order", [2, 6])
def test_slopes_are_what_the_energy_changes_by(order: int) -> None:
    one = replace(INNER, order=order)
    (ripple,) = rim_ripples((one,), np.full((RIM_ELEMENTS, 2), -0.04), [np.array([1.0, 9.0])])
    load = BalloonLoad(
        np.array([3.0, 50.0]),
        np.array([0.4, 0.7]),
        np.full((len(one.nodes) - 1, 2), 20.0),
        tied=True,
        ripple=ripple,
    )
    x = initial_shape(one, load)
    x += DRAW.normal(0, 0.003, x.shape)
    x[2 * one.edge :: 2] *= 0.96
    assert (ripple_energy(one, ripple, x[::2])[0] < 0).all()
    found, step = total_energy(one, load, x), 1e-6
    slopes, curves = [], []
    for i in range(len(x)):
        moved = np.zeros_like(x)
        moved[i] = step
        more, less = total_energy(one, load, x + moved), total_energy(one, load, x - moved)
        slopes.append((more.energy - less.energy) / (2 * step))
        curves.append((more.gradient - less.gradient) / (2 * step))
    assert found.gradient == pytest.approx(np.array(slopes), rel=1e-5, abs=1e-3)
    whole = np.transpose(curves, (2, 0, 1))
    own, rim = least_energy.dense(found.matrix), np.arange(2 * one.edge, len(x), 2)
    own[:, rim[:, None], rim] += np.moveaxis(found.rim, -1, 0)
    assert own == pytest.approx(whole, rel=1e-4, abs=1e-6 * whole.max())


def well(x: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """x^4 - x^2 a row: from near 0, where it bends downward, to one of its two floors."""
    return (x**4 - x**2)[0], 4 * x**3 - 2 * x, (12 * x**2 - 2)[:, None]


def endless(x: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Falls for ever."""
    return x[0], np.ones_like(x), np.ones((1, *x.shape))


def found(energies: Callable[..., tuple[np.ndarray, ...]], start: list[float]) -> np.ndarray:
    x = np.array([start])
    return equilibrium(
        energies, lambda _, ahead: np.abs(ahead)[0], x, np.ones(2), np.full(2, 1e-12)
    )


def test_the_least_energy_is_found_from_where_it_bends_downward() -> None:
    assert found(well, [0.01, -0.3]) == pytest.approx(np.array([[0.5**0.5, -(0.5**0.5)]]))


def test_an_energy_without_a_least_one_is_given_up() -> None:
    with pytest.raises(NoEquilibrium):
        found(endless, [0.0, 0.0])
