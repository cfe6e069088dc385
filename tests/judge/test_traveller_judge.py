"""The judge of the traveller sees the fault that is put into a page; sound ones it leaves alone."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest
import tomli_w

from tests.judge.doctoring import Patient
from tests.judge.traveller import judge_traveller
from tests.judge.using import sbafab

DESIGN = {
    "name": "page",
    "family": "1dof",
    "stack": {"balloons": 5},
    "laser": {"kerf_tpe": [0.12, 0.1], "kerf_ptfe": 0.08},
    "sheets": {"tpe": {"roll": True}},
    "order": {"copies": 2},
    "rules": {"yield_builds": 100, "worst_bond_width": 0, "worst_mask_overhang": 0},
}


PAGES = ("traveller.html", "bench.html")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Patient:
    home = tmp_path_factory.mktemp("page")
    design = home / "page.toml"
    design.write_text(tomli_w.dumps(DESIGN))
    ended = sbafab("generate", design, "-o", home / "out")
    assert ended.code == 0, ended.said
    return Patient(home / "out" / "page", design)


@pytest.fixture
def patient(made: Patient) -> Iterator[Patient]:
    """The folder, its pages put right again afterwards."""
    sound = {name: (made.folder / name).read_bytes() for name in PAGES}
    yield made
    for name, data in sound.items():
        (made.folder / name).write_bytes(data)


def said(patient: Patient) -> list[str]:
    return list(judge_traveller(patient.opened()))


def test_a_sound_page_is_left_alone(made: Patient) -> None:
    assert (made.folder / "traveller.html").is_file()
    assert said(made) == []


FLAT = "<dt>Thickness, sum of the films as bought</dt><dd>"
FAULTS = {
    "an end tag too many": ("</section>", "</div></section>", "closes nothing"),
    "a part counted wrongly": ("<b>2</b>", "<b>3</b>", "is counted 3"),
    "spares that are not cut": (r"\+ 1 spare", "+ 2 spare", "is counted"),
    "another film": ("<td>TPE</td><td>base</td>", "<td>PTFE</td><td>base</td>", "to be PTFE"),
    "a longer cut": (r"(\d\d) mm</td><td>TPE_1", r"1\1 mm</td><td>TPE_1", "P01 cuts"),
    "a part more on a sheet": (
        "3 \N{MULTIPLICATION SIGN} P01",
        "4 \N{MULTIPLICATION SIGN} P01",
        "are named",
    ),
    "less to cut": (r"(\d\.\d+) m of cut", r"9\1 m of cut", "the laser cuts"),
    "a hole elsewhere": (
        r'(chamber1</th>(?:<td class="number">[^<]*</td>){3}<td class="number">)(\d)',
        r"\g<1>9\2",
        "no hole is there",
    ),
    "a wider bore": ('<td class="number">1.04</td>', '<td class="number">1.1</td>', "held by"),
    "another mask laid": ("PTFE chamber mask P02", "PTFE chamber mask P06", "laid as"),
    "a layer forgotten": (' data-layers="2"', "", r"step 1 lays [3], not [2, 3]"),
    "a mask laid too far out": ("its edge 0.5 mm outside", "its edge 0.6 mm outside", "lie 0.6"),
    "a wall turned to another edge": (
        r"turn by eye, its edge 0\.75 mm outside",
        "turn by eye, its edge 0.85 mm outside",
        "lie 0.85",
    ),
    "a stack laid along another edge": (
        r"edge \(layer 3\) on that",
        "edge (layer 3) 0.5 mm outside that",
        "layer 3 is to lie 0.5",
    ),
    "a cap laid along another edge": ("0.5 mm inside that", "0.5 mm outside that", "outside layer"),
    "a shorter press": (">3 min<", ">2 min<", "step 1 shows"),
    "another height": (r"\(about 0.063 mm\)", "(about 0.093 mm)", "0.063 mm high"),
    "a pin too deep": (
        r"(\d)\.\d\d mm in the plate",
        r"\1.96 mm in the plate",
        "divides its length",
    ),
    "a pin that stands too high": (
        r"0\.\d(\d) mm or more over",
        r"0.9\1 mm or more over",
        "mm high",
    ),
    "a pin truer than any sold": (
        r"0\.35 to 0\.95 mm over it",
        "0.60 to 0.70 mm over it",
        "wants truer pins",
    ),
    "paper that the pins leave out": ("Tape a fresh print", "Tape a print", "mm high"),
    "a turn more": ("3 times in this order", "4 times in this order", "turns, and layers"),
    "less film": (r"(\d+\.\d) cm² of parts", r"9\1 cm² of parts", "parts are"),
    "a thicker laminate": (f"{FLAT}0", f"{FLAT}1", "mm thick"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_the_judge_sees(patient: Patient, fault: str) -> None:
    old, new, expected = FAULTS[fault]
    changes = 0
    for path in (patient.folder / name for name in PAGES):
        page, times = re.subn(old, new, path.read_text(encoding="utf-8"))
        path.write_text(page, encoding="utf-8")
        changes += times
    assert changes
    assert any(expected in sentence for sentence in said(patient)), said(patient)
