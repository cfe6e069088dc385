"""The elastic balloon beside CalculiX: the table of docs/prediction.md, and what it claims."""

from __future__ import annotations

import shutil

import numpy as np
import pytest

from docs.scripts.balloon_runs import CASES, PAGE, PRESSURES, Case, Run, elastic, known, measured

LIMITS = {"held smooth": 1.5, "free to wrinkle": 3.0}
"""Per cent in stroke and air."""
MISSED = {"d = 10, alone, free to wrinkle": 4.5, "d = 5, in a stack, free to wrinkle": 5.5}
"""Rows that do not keep their limit, and by how much they miss it at most; the page says why."""


def cells(name: str) -> list[list[float]]:
    row = known(PAGE.read_text(encoding="utf-8"))[name]
    return [[float(value) for value in cell.split(",")] for cell in row.split("|")[2:-1]]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
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
def test_a_balloon_that_wrinkles_in_calculix() -> None:
    pytest.importorskip("netgen")
    # A mesh coarser than the table's, which holds too little air below 2 kPa.
    case = Case("1dof-5mm", True, 0.35, (Run(PRESSURES[1:3], 0.05),))
    (own_stroke, own_air), (stroke, air) = elastic(case), measured(case)
    assert own_stroke == pytest.approx(stroke, rel=0.03)
    assert own_air == pytest.approx(air, rel=0.03)
