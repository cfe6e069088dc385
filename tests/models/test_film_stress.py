"""The stress of a balloon's film, against statics."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sbafab.models.balloon import Balloon, inflate
from tests.models.film_stress import stresses


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
