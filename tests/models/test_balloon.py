"""The elastic balloon against a closed limit and an axisymmetric mesh in CalculiX."""

from __future__ import annotations

import math
import shutil
from dataclasses import replace

import numpy as np
import pytest

from docs.scripts.axisymmetric import MeridianSection, axisymmetric_states
from sbafab.errors import DesignError
from sbafab.models import film_elements
from sbafab.models.balloon import inflate
from sbafab.models.film_elements import Balloon
from tests.quick import few

TPE = Balloon()
IDEAL = Balloon(thickness=1e-4, modulus=1e11, inextensible=True)


def pressed_ideal(disc: float, length: float) -> tuple[float, float]:
    """Height (mm) and volume (ul) of a hoop-free film of one length between plates it touches in a
    disc: sin(slope) = (r^2 - disc^2) / (equator^2 - disc^2), integrated over the slope.
    """
    x, weights = np.polynomial.legendre.leggauss(200)
    slope, weights = (x + 1) * math.pi / 4, weights * math.pi / 4
    low, high = disc, length
    for _ in range(100):
        equator = (low + high) / 2
        span = equator**2 - disc**2
        r = np.sqrt(disc**2 + span * np.sin(slope))
        along = disc + float((weights * span / (2 * r)).sum())
        low, high = (equator, high) if along < length else (low, equator)
    rising = weights * np.sin(slope) * span / (2 * r)
    return 2 * float(rising.sum()), math.tau * float((rising * r**2).sum())


def test_a_film_that_cannot_stretch_between_plates_is_the_closed_limit() -> None:
    discs = np.array([0.5, 2.0])
    limits = np.array([pressed_ideal(disc, 2.5) for disc in discs])
    found = inflate(IDEAL, 100.0, limits[:, 0])
    assert found.volume == pytest.approx(limits[:, 1], rel=1e-3)
    assert found.force == pytest.approx(100 * math.pi * discs**2, rel=3e-3)


@pytest.mark.long
def test_force_too_is_the_closed_limit_to_a_thousandth_with_more_elements(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(film_elements, "FILM_ELEMENTS", 96)
    discs = np.array([0.5, 1.5])
    limits = np.array([pressed_ideal(disc, 2.5) for disc in discs])
    found = inflate(replace(IDEAL), 100.0, limits[:, 0])
    assert found.volume == pytest.approx(limits[:, 1], rel=1e-3)
    assert found.force == pytest.approx(100 * math.pi * discs**2, rel=1e-3)


def test_without_plates_it_is_a_mylar_balloon() -> None:
    # Its meridian is an elastica: volume 1.2185 l^3, height 0.9139 l for the flat radius l.
    found = inflate(IDEAL, 100.0)
    assert found.volume == pytest.approx([1.2185 * 2.5**3], rel=1e-3)
    assert found.height == pytest.approx([0.9139 * 2.5], rel=2e-3)


@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed")
@pytest.mark.parametrize("pocket", few([5.0, 10.0], 1))
@pytest.mark.parametrize(("neck", "bore"), [(0.0, 0.0), (2.5, 1.0)], ids=["alone", "in a stack"])
def test_smooth_strokes_and_volumes_are_those_of_an_axisymmetric_mesh(
    pocket: float, neck: float, bore: float
) -> None:
    pressures = [0.5, 2.0, 10.0]
    mesh = axisymmetric_states(pressures, MeridianSection(pocket=pocket, neck=neck, bore=bore))
    smooth = replace(TPE, pocket=pocket / 2, neck=neck / 2, bore=bore / 2, wrinkles=False)
    own = inflate(smooth, pressures)
    assert own.height == pytest.approx([state.stroke for state in mesh], rel=0.015)
    assert own.volume == pytest.approx([state.volume for state in mesh], rel=0.015)


def test_a_plate_that_is_not_reached_does_not_push() -> None:
    free = inflate(TPE, 6.0)
    assert inflate(TPE, 6.0, 2.0).force == pytest.approx([0.0])
    assert inflate(TPE, 6.0, 2.0).height == pytest.approx(free.height, rel=1e-6)


@pytest.mark.parametrize(("pressure", "height"), [(0.0, None), (math.nan, None), (5.0, 0.0)])
def test_loads_of_nothing_are_refused(pressure: float, height: float | None) -> None:
    with pytest.raises(DesignError, match="above 0 kPa"):
        inflate(TPE, pressure, height)


def test_force_is_what_the_air_gains_on_the_way() -> None:
    """The work of the air is that of the plates and what the films store (virtual work)."""
    ring = replace(TPE, neck=1.25, bore=0.5, wrinkles=False)
    heights = np.array([0.6, 0.602])
    found = inflate(ring, 10.0, heights)
    gained = 10.0 * np.diff(found.volume) - np.diff(found.energy)
    assert gained == pytest.approx(found.force.mean() * np.diff(found.height), rel=0.01)
