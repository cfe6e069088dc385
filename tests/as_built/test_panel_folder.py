"""A folder of registered sheets: written whole, read back, and doctored."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from sbafab.actuators import load_design
from sbafab.as_built.check import check_folder, read_folder
from sbafab.cutting.dxf_read import read_profile
from sbafab.cutting.dxf_write import Curves
from sbafab.cutting.second_cut import PATH
from sbafab.design.records import Design
from sbafab.errors import DesignError
from sbafab.geometry.shapes import strip
from sbafab.output.job import generate_job
from sbafab.output.run import generate
from sbafab.rules import bridges
from tests.as_built.doctoring import Doctor

KERF = 0.12


def design(*changes: str) -> Design:
    few = ("stack.balloons=2", "order.copies=2", "rules.yield_builds=100")
    return load_design("1dof-5mm", ['registration.method="sheet"', *few, *changes])


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    kerf = (f"laser.kerf_tpe={KERF}", f"laser.kerf_ptfe={KERF}")
    return generate(
        design(*kerf), tmp_path_factory.mktemp("panel"), ("cut", "press", "preview")
    ).folder


def failing(folder: Path) -> dict[str, str]:
    return {f.rule: f.message for f in check_folder(folder) if f.verdict == "fail"}


def test_a_written_folder_passes_and_is_read_back_as_the_design(whole: Path) -> None:
    assert failing(whole) == {}
    built = read_folder(whole)
    assert built.is_meant
    assert built.laminate is not None
    assert built.laminate.panel is not None
    panel = json.loads((whole / "manifest.json").read_text())["panel"]
    assert (len(panel["places"]), panel["batches"], panel["second_cut"]) == (2, 1, PATH)
    assert not list(whole.glob("sheets/TPE*"))


def test_kerf_leaves_parts_of_nominal_size(whole: Path) -> None:
    """Slots are cut inside their edges by half a kerf, sheets likewise outside theirs."""
    slots = read_profile(whole / PATH).region
    # 1.6 by 0.6, less a kerf on every side.
    assert [piece.area for piece in slots.pieces] == pytest.approx([1.48 * 0.48] * 6)
    (file,) = whole.glob("layers/001_TPE_base_kerf*.dxf")
    found = read_profile(file).region.bounds
    laminate = read_folder(whole).laminate
    assert laminate is not None
    assert laminate.panel is not None
    outline = laminate.panel.outline.bounds
    assert found[2] - found[0] == pytest.approx(outline[2] - outline[0] + KERF)


def test_a_copy_that_is_cut_otherwise_stands_for_its_layer(whole: Path, tmp_path: Path) -> None:
    doctor = Doctor(Path(shutil.copytree(whole, tmp_path / "faulty")))
    clean = read_folder(whole).laminate
    assert clean is not None
    assert clean.panel is not None
    x, y = clean.panel.places[1]
    # The second copy's cap, which ends 3.25 from its axis, is cut short: the beam takes half of
    # the kerf besides, on three sides of the notch.
    doctor.redraw(7, lambda sheet: sheet - strip((x, y + 2.9), (x, y + 3.6), 1.0))
    built = read_folder(doctor.folder)
    assert not built.is_meant
    assert built.laminate is not None
    cap = built.laminate.layer(7).profile
    assert clean.layer(7).profile.area - cap.area == pytest.approx(
        1.12 * (3.25 - 2.84) - 0.04, abs=0.03
    )
    (found,) = bridges.check(built.laminate, built.limits)
    assert found.verdict == "fail"


def test_a_folder_without_second_cut_fails(whole: Path, tmp_path: Path) -> None:
    doctor = Doctor(Path(shutil.copytree(whole, tmp_path / "faulty")))
    (doctor.folder / PATH).unlink()
    assert "file-integrity" in {problem.rule for problem in read_folder(doctor.folder).problems}


@pytest.mark.parametrize(
    ("refused", "said"),
    [
        (lambda out: generate(design(), out, curves=Curves("chords")), "are not drawn in chords"),
        (
            lambda out: generate_job([design(), design("name=other")], "job", out),
            "made in registered sheets",
        ),
    ],
)
def test_what_sheets_do_not_go_with_is_refused(
    refused: Callable[[Path], object], said: str, tmp_path: Path
) -> None:
    with pytest.raises(DesignError, match=said):
        refused(tmp_path)


def test_the_page_says_what_to_do_with_sheets(whole: Path) -> None:
    page = (whole / "traveller.html").read_text()
    for words in ("Registered sheets", "No bench has tried", "Weed", "face down", "fiducials"):
        assert words in page
    plan = json.loads((whole / "press.json").read_text())
    assert [(step["bond"], len(step["pins"])) for step in plan["steps"]] == [
        ("flash", 4),
        ("full", 4),
    ]
    assert "no bench has tried" in plan["warnings"][0]
