"""A balloon at a volume or under a force, and the stress of its film, against statics."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from sbafab.errors import DesignError
from sbafab.models.balloon import Balloon, inflate
from sbafab.models.balloons import inflate_to, pressed_by, stresses

INNER = Balloon(neck=1.25, bore=0.5)


def test_volumes_and_forces_lead_back_to_pressures_and_heights() -> None:
    volumes = [2.0, 15.0]
    assert inflate_to(INNER, volumes).volume == pytest.approx(volumes, rel=2e-5)
    held = inflate_to(INNER, 14.0, 0.8)
    assert held.volume == pytest.approx([14.0], rel=2e-5)
    assert held.height == pytest.approx([0.8], rel=1e-2)
    forces = [100.0]
    pressed = pressed_by(INNER, 10.0, forces)
    assert pressed.force == pytest.approx(forces, rel=2e-5)
    assert inflate(INNER, 10.0, pressed.height).force == pytest.approx(forces, rel=0.02)


def test_the_film_bears_what_the_air_above_it_presses() -> None:
    """Cut round at any radius: tension times its upright part is the air's force on the disc."""
    lone = replace(Balloon(), wrinkles=False)
    found = inflate(lone, [1.0, 8.0])
    stress = stresses(lone, found)
    r = (found.r[:, 1:] + found.r[:, :-1]) / 2
    steep = -np.diff(found.z) / np.hypot(np.diff(found.r), np.diff(found.z))
    # Away from pole and rim, where bending carries a part.
    for element in (10, 14):
        held = stress.meridian[:, element] * lone.thickness * steep[:, element]
        assert 2 * held / r[:, element] == pytest.approx([1.0, 8.0], rel=0.03)


def test_films_that_wrinkle_bear_nothing_round_the_hoop() -> None:
    lone = Balloon()
    hoop = stresses(lone, inflate(lone, 6.0)).hoop[0]
    assert (hoop[: lone.edge] >= 0).all()
    assert hoop[lone.edge - 1] == 0
    assert (hoop[lone.edge :] < 0).all()


@pytest.mark.parametrize(
    ("ask", "said"),
    [
        (lambda: inflate_to(INNER, 0.0), "above 0 ul"),
        (lambda: inflate_to(INNER, 500.0), "does not hold 500 ul at 367 kPa"),
        (lambda: pressed_by(INNER, 1.0, 0.0), "above 0 mN"),
        (lambda: pressed_by(INNER, 1.0, 50.0), "50 mN press a balloon flat at 1 kPa"),
        (lambda: stresses(replace(INNER, mate=INNER), inflate(INNER, 1.0)), "unlike films"),
    ],
)
def test_what_cannot_be_is_refused(ask: Callable[[], object], said: str) -> None:
    with pytest.raises(DesignError, match=said):
        ask()
