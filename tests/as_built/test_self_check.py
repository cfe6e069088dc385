"""A run reads what it wrote, and puts nothing in place that is not what it found to hold."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import pytest

from sbafab.actuators import load_design
from sbafab.as_built import check as as_built
from sbafab.as_built.check import FolderReadBack
from sbafab.cli.exit import exit_plainly
from sbafab.cutting.dxf_read import read_profile
from sbafab.cutting.dxf_write import dxf_text
from sbafab.cutting.order import cutting_order
from sbafab.cutting.properties import Curves
from sbafab.errors import DefectError, OutputError
from sbafab.geometry.region import Region
from sbafab.models.figures import Factors, PredictionRequest
from sbafab.models.prediction import predict
from sbafab.nesting.engines import bottom_left
from sbafab.nesting.records import NestPart, Placement, Stock
from sbafab.output import artefacts
from sbafab.output.artefacts import write_cut_files
from sbafab.output.checked import DesignPlan
from sbafab.output.manifest import file_hashes
from sbafab.process import Progress
from sbafab.rules.finding import Finding, Place
from sbafab.rules.rule import Explanation, Rule
from sbafab.runs import run
from sbafab.runs.check_folder import check_folder
from sbafab.runs.run import RunRequest, generate
from tests.as_built.doctoring import Doctor

FEW = ("stack.balloons=1", "rules.yield_builds=100")
Edit = Callable[[Path], object]


def spoilt(edit: Edit) -> Callable[..., object]:
    """Writes the cut files, and then one of them once more, as a defect of the program might."""

    def write(plan: DesignPlan, folder: Path, tell: Progress) -> None:
        write_cut_files(plan, folder, tell)
        edit(next((folder / "layers").glob("003_TPE_*.dxf")))

    return write


def redrawn(change: Callable[[Region], Region]) -> Edit:
    def edit(path: Path) -> None:
        found = read_profile(path)
        text = dxf_text(cutting_order(change(found.region)), found.properties)
        path.write_text(text, newline="\n")

    return edit


def in_inches(path: Path) -> None:
    path.write_text(path.read_text().replace("$INSUNITS\n 70\n4\n", "$INSUNITS\n 70\n1\n"))


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        (redrawn(lambda region: region.moved(0.15, 0.0)), "as-designed: layer 3 .* 0.15"),
        (in_inches, "file-integrity: layer 3 .* not in millimetres"),
    ],
)
def test_a_run_whose_files_are_not_its_design_changes_nothing(
    edit: Edit, said: str, tmp_path: Path
) -> None:
    design = load_design("1dof-5mm", FEW)
    before = file_hashes(generate(RunRequest(design, tmp_path, ("cut",))).folder)
    with (
        patch.object(artefacts, "write_cut_files", spoilt(edit)),
        pytest.raises(DefectError, match=f"(?s){said}.*a defect of sbafab.*report"),
    ):
        generate(RunRequest(design, tmp_path, ("cut",)))
    assert file_hashes(tmp_path / "1dof-5mm") == before
    assert [path.name for path in tmp_path.iterdir() if path.suffix == ".part"] == []


def test_rules_are_not_run_twice_on_what_is_as_designed(tmp_path: Path) -> None:
    def never(*_: object) -> list[object]:
        raise AssertionError

    rules = (Rule("never", never, Explanation("", "", "")),)  # type: ignore[arg-type]
    with patch.object(as_built, "RULES", rules):
        generate(RunRequest(load_design("1dof-5mm", FEW), tmp_path, ("cut",)))


def test_a_defect_ends_with_the_code_of_a_failed_rule(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop, exit_plainly():
        raise DefectError("the files do not hold")
    assert stop.value.code == 1
    assert "the files do not hold" in capsys.readouterr().err


def test_a_mistake_of_the_program_is_no_finding(clean_column: Path) -> None:
    def mistaken(*_: object) -> list[object]:
        raise AttributeError("no attribute of this name")

    rules = (Rule("mistaken", mistaken, Explanation("", "", "")),)  # type: ignore[arg-type]
    with patch.object(as_built, "RULES", rules), pytest.raises(AttributeError):
        check_folder(clean_column)


def as_designed(folder: Path) -> list[str]:
    found = check_folder(folder)
    return [f.message for f in found if f.rule == "as-designed" and f.verdict == "fail"]


def test_a_prediction_is_asked_for_again(tmp_path: Path) -> None:
    design = load_design("1dof-5mm", FEW)
    wish = PredictionRequest(volumes_ul=(5.0,), calibration=Factors(0.9, 1.1, 0.1, 12.0))
    generate(RunRequest(design, tmp_path, ("cut", "predict"), prediction=predict(design, wish)))
    doctor = Doctor(tmp_path / "1dof-5mm")
    assert as_designed(doctor.folder) == []
    path = doctor.folder / "predict.json"
    told = json.loads(path.read_text())
    told["figures"][0]["value"] += 1
    path.write_text(json.dumps(told))
    doctor.rehash()
    assert as_designed(doctor.folder)[0].startswith("predict.json is not what design.toml makes")


def test_a_job_is_made_again_whole(tmp_path: Path) -> None:
    designs = [load_design("1dof-5mm", [*FEW, f"name={name}"]) for name in ("one", "two")]
    folder = generate(RunRequest(designs, tmp_path, name="both")).folder
    assert as_designed(folder) == []
    doctor = Doctor(folder / "two")
    path = doctor.folder / "press.json"
    path.write_text(path.read_text().replace('"temperature_c": 135', '"temperature_c": 270'))
    doctor.rehash()
    Doctor(folder).rehash()
    assert as_designed(folder)[0].startswith("two/press.json is not what design.toml makes")


def test_chords_that_are_too_coarse_are_the_users_choice(tmp_path: Path) -> None:
    design = load_design("1dof-5mm", FEW)
    with (
        patch.object(artefacts, "write_cut_files", spoilt(in_inches)),
        pytest.raises(OutputError, match=r"smaller --chord-error than 0\.005"),
    ):
        generate(RunRequest(design, tmp_path, ("cut",), Curves("chords")))


@pytest.mark.parametrize(
    ("shift", "said"), [((0.5, 0.0), "mm apart at x"), ((-4.5, 0.0), "into the border")]
)
def test_parts_of_a_nest_that_lie_badly_are_not_let_through(
    shift: tuple[float, float], said: str, tmp_path: Path
) -> None:
    def moved(parts: Sequence[NestPart], stock: Stock) -> tuple[Placement, ...]:
        first, *others = bottom_left(parts, stock)
        x, y = first.shift
        return (replace(first, shift=(x + shift[0], y + shift[1])), *others)

    with (
        patch("sbafab.nesting.nest.bottom_left", moved),
        pytest.raises(DefectError, match=said),
    ):
        generate(RunRequest(load_design("1dof-5mm", FEW), tmp_path, ("cut",)))
    assert not (tmp_path / "1dof-5mm").exists()


def test_what_is_cut_is_told_before_what_is_claimed(tmp_path: Path) -> None:
    """The sentence names three rules: design and files first, the manifest's words last."""
    order = ("as-designed", "file-integrity", "sealing", "manifest-claims")
    found = [
        Finding(rule, "fail", None, None, "", Place(), f"wrong by {rule}")
        for rule in ("manifest-claims", "sealing", "file-integrity", "as-designed")
    ]
    with (
        patch.object(run, "read_back", lambda *_: FolderReadBack(tuple(found), (), ())),
        pytest.raises(DefectError) as told,
    ):
        generate(RunRequest(load_design("1dof-5mm", FEW), tmp_path, ("cut",)))
    said = [str(told.value).find(f"{rule}: wrong by {rule}") for rule in order]
    assert 0 < said[0] < said[1] < said[2]
    assert said[3] == -1
