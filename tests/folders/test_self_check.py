"""A run reads what it wrote, and puts nothing in place that is not what it found to hold."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest

from sbafab.actuators import load_design
from sbafab.cli.exit import exit_plainly
from sbafab.cutting import layer_files
from sbafab.cutting.bottom_left import bottom_left
from sbafab.cutting.dxf_read import read_profile
from sbafab.cutting.dxf_write import dxf_text
from sbafab.cutting.layer_files import write_layer_files
from sbafab.cutting.placements import NestPart, Placement, Stock
from sbafab.cutting.sequence import cutting_sequence
from sbafab.errors import DefectError, OutputError
from sbafab.folders import artefacts
from sbafab.folders import check as as_built
from sbafab.folders.check import check_folder
from sbafab.folders.manifest import file_hashes
from sbafab.folders.run import RunRequest, generate
from sbafab.geometry.contour import Contour
from sbafab.meshing.conforming.layup import MeshSettings
from sbafab.rules.rule import Explanation, Rule
from tests.folders.doctoring import Doctor

FEW = ("stack.balloons=1", "rules.yield_builds=100")
Edit = Callable[[Path], object]


def spoilt(edit: Edit) -> Callable[..., object]:
    """Writes the cut files, and then one of them once more, as a defect of the program might."""

    def write(*wanted: Any) -> object:
        files = write_layer_files(*wanted)
        edit(next((wanted[2] / "layers").glob("003_TPE_*.dxf")))
        return files

    return write


def redrawn(path: Path) -> None:
    found = read_profile(path)
    text = dxf_text(cutting_sequence(found.region.moved(0.15, 0.0)), found.properties)
    path.write_text(text, newline="\n")


def in_inches(path: Path) -> None:
    path.write_text(path.read_text().replace("$INSUNITS\n 70\n4\n", "$INSUNITS\n 70\n1\n"))


@pytest.mark.parametrize("edit", [redrawn, in_inches])
def test_a_run_whose_files_are_not_what_was_read_back_changes_nothing(
    edit: Edit, tmp_path: Path
) -> None:
    design = load_design("1dof-5mm", FEW)
    before = file_hashes(generate(RunRequest(design, tmp_path, ("cut",))).folder)
    with (
        patch.object(artefacts, "write_layer_files", spoilt(edit)),
        pytest.raises(DefectError, match=r"003_TPE_.* was changed .*a defect of sbafab.*report"),
    ):
        generate(RunRequest(design, tmp_path, ("cut",)))
    assert file_hashes(tmp_path / "1dof-5mm") == before
    assert [path.name for path in tmp_path.iterdir() if path.suffix == ".part"] == []


def without_a_contour(contours: Sequence[Contour], *more: Any) -> str:
    return dxf_text(contours[1:], *more)


def without_properties(contours: Sequence[Contour], _: object, *more: Any) -> str:
    return dxf_text(contours, {}, *more)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [(without_a_contour, "outlines, not"), (without_properties, "custom property DESIGN is None")],
)
def test_a_file_that_does_not_read_back_as_its_path_ends_the_run(
    wrong: Callable[..., str], said: str, tmp_path: Path
) -> None:
    with patch.object(layer_files, "dxf_text", wrong), pytest.raises(OutputError, match=said):
        generate(RunRequest(load_design("1dof-5mm", FEW), tmp_path, ("cut",)))
    assert not (tmp_path / "1dof-5mm").exists()


def test_a_defect_ends_with_the_code_of_a_failed_rule(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop, exit_plainly():
        raise DefectError("the files do not hold")
    assert stop.value.code == 1
    assert "the files do not hold" in capsys.readouterr().err


def test_a_mistake_of_the_program_is_no_finding(doctor: Doctor) -> None:
    def mistaken(*_: object) -> list[object]:
        raise AttributeError("no attribute of this name")

    doctor.redraw(5, lambda region: region.moved(0.15, 0.0))
    rules = (Rule("mistaken", mistaken, Explanation("", "", "")),)  # type: ignore[arg-type]
    with patch.object(as_built, "RULES", rules), pytest.raises(AttributeError):
        check_folder(doctor.folder)


def as_designed(folder: Path) -> list[str]:
    found = check_folder(folder)
    return [f.message for f in found if f.rule == "as-designed" and f.verdict == "fail"]


def test_conforming_meshes_are_no_fault_of_a_folder(tmp_path: Path) -> None:
    """Their cavities are surfaces too, which the design alone does not make."""
    pytest.importorskip("netgen")
    design = load_design("1dof-5mm", FEW)
    generate(RunRequest(design, tmp_path, ("cut", "mesh")))
    filled = MeshSettings(h=0.75, fill_ul=5.0)
    generate(RunRequest(design, tmp_path, ("mesh",), meshes=filled, formats=("stl",)))
    doctor = Doctor(tmp_path / "1dof-5mm")
    assert "mesh/cavity_chamber1_conforming.stl" in doctor.manifest["files"]
    assert [f.message for f in check_folder(doctor.folder) if f.verdict == "fail"] == []
    doctor.set_manifest(lambda m: m["meshes"].append({**m["meshes"][0], "file": "mesh/none.stl"}))
    (told,) = (f.message for f in check_folder(doctor.folder) if f.verdict == "fail")
    assert "meshes lists mesh/none.stl, which is not in files" in told


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
        patch("sbafab.cutting.nesting.bottom_left", moved),
        pytest.raises(DefectError, match=said),
    ):
        generate(RunRequest(load_design("1dof-5mm", FEW), tmp_path, ("cut",)))
    assert not (tmp_path / "1dof-5mm").exists()


def test_a_job_is_made_again_whole(tmp_path: Path) -> None:
    """A folder of layer files is told by its place, not by letters in another folder's name."""
    designs = [load_design("1dof-5mm", [*FEW, f"name={name}"]) for name in ("one", "multilayers")]
    folder = generate(RunRequest(designs, tmp_path, name="both")).folder
    assert as_designed(folder) == []
    doctor = Doctor(folder / "multilayers")
    path = doctor.folder / "press.json"
    path.write_text(path.read_text().replace('"temperature_c": 135', '"temperature_c": 270'))
    doctor.rehash()
    Doctor(folder).rehash()
    [said] = as_designed(folder)
    assert said.startswith("multilayers/press.json is not what design.toml makes")
