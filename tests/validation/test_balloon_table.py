"""The elastic balloon beside CalculiX: docs/measured/balloons.csv, and what it claims."""

from __future__ import annotations

import shutil

import numpy as np
import pytest

from docs.scripts.balloon_runs import CASES, Case, elastic, known
from docs.scripts.ripple_sector import Sector, sector_states
from sbafab.models.balloon import inflate
from sbafab.models.film_elements import Balloon
from tests.quick import few

LIMITS = {"held smooth": 1.5, "free to wrinkle": 3.0, "even ripples": 3.0, "half a wave": 3.0}
"""Per cent in stroke and air."""
MISSED = {
    "d = 10, alone, free to wrinkle": 5.0,
    "d = 5, in a stack, free to wrinkle": 5.5,
    "d = 20, alone, 24 even ripples": 12.5,
}
"""Rows that do not keep their limit, and by how much they miss it at most; the page says why."""


def cells(name: str) -> list[list[float]]:
    return [[float(value) for value in cell.split(",")] for cell in known()[name][1:]]


@pytest.mark.parametrize("case", few(CASES, 5), ids=lambda case: case.name)
def test_the_table_says_what_the_model_says_and_how_far_it_is_off(case: Case) -> None:
    pressures, stroke, mesh_stroke, off, air, mesh_air, air_off = cells(case.name)
    assert tuple(pressures) == case.pressures
    own_stroke, own_air = elastic(case)
    assert own_stroke == pytest.approx(stroke, abs=6e-4)
    assert own_air == pytest.approx(air, abs=6e-3)
    for own, other, told in ((own_stroke, mesh_stroke, off), (own_air, mesh_air, air_off)):
        assert 100 * (own / np.array(other) - 1) == pytest.approx(told, abs=0.16)
    (limit,) = (limit for word, limit in LIMITS.items() if word in case.name)
    limit = MISSED.get(case.name, limit)
    assert np.abs([off, air_off]).max() <= limit


@pytest.mark.long
@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed")
def test_a_balloon_that_ripples_in_calculix() -> None:
    pressures = [0.25, 0.5, 1.0, 2.0]
    own = inflate(Balloon(), pressures)
    found = sector_states(Sector(5.0, 7, round=5, even=True), pressures)
    assert own.height == pytest.approx([state.stroke for state in found], rel=0.03)
    assert own.volume == pytest.approx([state.air for state in found], rel=0.03)
    # Smooth at first, then the rim's outside waves, and the pocket's edge hardly does.
    assert found[0].outside < 0.05
    assert found[-1].outside > 0.2 > 5 * found[-1].edge
