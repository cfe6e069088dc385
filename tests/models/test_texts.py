"""Figures in the texts of models and pages are those of the models, and of the record."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

import sbafab
from sbafab.models import elastic, paper
from sbafab.models.elastic import blocked_force
from sbafab.models.stack import Stack

DOCS = Path(__file__).parents[2] / "docs"


@pytest.fixture(scope="module")
def three() -> Stack:
    return sbafab.stack("3dof-15mm", "models.calibration=none")


def bend(three: Stack, chambers: int, pressure: float = 5.0) -> float:
    return three.pose((pressure,) * chambers + (0.0,) * (3 - chambers)).bend


def test_bends_that_predict_tells_of_are_the_stack_s_and_sofa_s(three: Stack) -> None:
    text = elastic.BEND.trust
    stack = re.search(r"at 5 kPa has (\d+) deg with two chambers, (\d+) with one", text)
    shell = re.search(r"have (\d+) and (\d+); the paper's largest is (\d+) \+- (\d+)", text)
    assert stack
    assert shell
    for chambers, said in zip((2, 1), stack.groups(), strict=True):
        assert float(said) == pytest.approx(bend(three, chambers), abs=0.51)
    record = json.loads((DOCS / "measured" / "sofa.json").read_text(encoding="utf-8"))
    rows = {row[0]: row[1] for row in record["tables"]["pressures"]["rows"]}
    for on, said in zip(("5, 5, 0", "5, 0, 0"), shell.groups(), strict=False):
        assert float(said) == pytest.approx(float(rows[on].split(", ")[1]), abs=0.51)
    assert [float(x) for x in shell.groups()[2:]] == list(paper.LARGEST_BEND[:2])


def test_shares_of_the_force_that_the_paper_measured(three: Stack) -> None:
    said = re.search(r"has ([\d.]+), ([\d.]+) and ([\d.]+) of it", elastic.FORCE.trust)
    assert said
    full = paper.FULL_HEIGHT.value - three.flat_height
    for share, measured, value in zip(paper.HEIGHTS, paper.FORCE_3DOF, said.groups(), strict=True):
        pushed = 3 * float(blocked_force(three, paper.FORCE_KPA, share * full))
        assert float(value) == pytest.approx(measured.value / pushed, abs=0.051)


def test_the_page_s_table_of_the_stack_beside_other_programs(three: Stack) -> None:
    page = (DOCS / "prediction.md").read_text(encoding="utf-8")
    row = {}
    for line in page.splitlines():
        cells = [cell.strip() for cell in line.split("|")[1:-1]]
        if len(cells) == 4 and "kPa in" in cells[0]:
            row[cells[0]] = float(re.findall(r"[\d.]+", cells[1])[0])
    rise = three.pose((5.0,) * 3).height - three.flat_height
    assert row["5 kPa in all, height above the flat one"] == pytest.approx(rise, abs=0.051)
    assert row["5 kPa in two chambers"] == pytest.approx(bend(three, 2), abs=0.51)
    assert row["5 kPa in one chamber"] == pytest.approx(bend(three, 1), abs=0.51)
    assert row["10 kPa in one chamber"] == pytest.approx(bend(three, 1, 10.0), abs=0.51)
