"""Registered sheets at random, cut apart and judged; and the faults that their judge must see.

``SBAFAB_JUDGED=100`` judges that many in place of the few, ``SBAFAB_SEED=7`` draws others.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import tomli_w
from shapely import Point, affinity, box
from shapely.geometry.base import BaseGeometry

from tests.judge.campaign import Ways, run_case
from tests.judge.doctoring import Patient
from tests.judge.panels import judge_panel
from tests.judge.using import sbafab

COUNT = int(os.environ.get("SBAFAB_JUDGED", "4"))
SEED = int(os.environ.get("SBAFAB_SEED", "5"))
FEW = Ways(lean=True, check=False, most_balloons=3, in_sheets=True)


def test_what_comes_free_of_random_sheets_holds() -> None:
    cases = [run_case(SEED, number, FEW) for number in range(COUNT)]
    assert [(case.name, *case.disagreements) for case in cases if case.disagreements] == []
    assert any(case.is_judged for case in cases), [case.refused for case in cases]


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Patient:
    home = tmp_path_factory.mktemp("sheets")
    design = home / "two.toml"
    tables = {
        "name": "two",
        "family": "1dof",
        "stack": {"balloons": 2},
        "order": {"copies": 2},
        "registration": {"method": "sheet", "experimental": True},
    }
    design.write_text(tomli_w.dumps(tables))
    ended = sbafab("cut", design, "-o", home / "out")
    assert ended.code == 0, ended.said
    return Patient(home / "out" / "two", design)


@pytest.fixture
def patient(sound: Patient, tmp_path: Path) -> Patient:
    shutil.copytree(sound.folder, tmp_path / "copy")
    return Patient(tmp_path / "copy", sound.design)


def test_sound_sheets_are_left_alone(sound: Patient) -> None:
    assert list(judge_panel(sound.opened())) == []


def _one_slot_less(space: Any) -> None:
    space.delete_entity(next(e for e in space if e.dxf.layer == "CUT_OUTER"))


def _square(half: float) -> BaseGeometry:
    return box(-half, -half, half, half)


def _disc(radius: float) -> BaseGeometry:
    return Point(0, 0).buffer(radius)


FAULTS: dict[str, tuple[Callable[[Patient], object], str]] = {
    # Layers: 1 base, 2 pocket, 3 wall, 4 separator, 5 wall, 6 pocket, 7 cap.
    "a mask that is not turned over": (
        lambda p: p.redraw([2], lambda sheet: affinity.scale(sheet, -1, 1, origin=(0, 0))),
        "layer 2 goes on its pins in 0 ways",
    ),
    "a bridge that is not cut": (
        lambda p: p.edit_dxf("sheets/second_cut.dxf", _one_slot_less),
        "nothing of layer 1 is in place",
    ),
    "a part without bridges": (
        lambda p: p.redraw([3], lambda sheet: sheet - (_square(8) - _square(3.4))),
        "film 3 falls apart before the second cut",
    ),
    "a mask that is too large": (
        lambda p: p.redraw([6], lambda sheet: sheet | _disc(2.6) - _disc(0.52)),
        "place 1: the bond of interface 3 is 0.6",
    ),
    "scrap over a tab": (
        lambda p: p.redraw([5], lambda sheet: sheet | box(7.5, -4.8, 10.5, 4.8)),
        "scrap of film 5 is bonded to a part of film 3",
    ),
    "a pin in a film": (
        lambda p: p.redraw([5], lambda sheet: sheet | Point(-3.5, 11.425).buffer(2)),
        "layer 5 goes on its pins in 0 ways",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_the_judge_sees(patient: Patient, fault: str) -> None:
    doctor, expected = FAULTS[fault]
    doctor(patient)
    said = [found.said for found in judge_panel(patient.opened())]
    assert any(expected in sentence for sentence in said), said
