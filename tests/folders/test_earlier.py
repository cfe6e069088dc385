"""What of an earlier run in the same folder stays, and what goes."""

from __future__ import annotations

from pathlib import Path

import pytest

from sbafab.actuators import load_design
from sbafab.assemblies.files import load
from sbafab.assemblies.records import Assembly
from sbafab.cutting.cut_settings import Curves
from sbafab.errors import OutputError
from sbafab.folders.artefacts import RunPart
from sbafab.folders.check import check_folder
from sbafab.folders.manifest import file_hashes
from sbafab.folders.run import RunRequest, generate
from sbafab.meshing.conforming.layup import MeshSettings
from tests.quick import few

SMALL = ("stack.balloons=1",)
OTHER = (*SMALL, "press.temperature_c=140")
WRONG = (*SMALL, "bond.width=0.72")


def simulated(out: Path, result: str, mesh: str = "mesh") -> RunRequest:
    """A run with what a simulator left; with an empty result, as an export does."""
    folder = out / f"{mesh}{result}" / "calculix"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "mesh.inp").write_text(mesh)
    if result:
        (folder / "result.json").write_text(result)
    return RunRequest(load_design("1dof-5mm", SMALL), out, ("calculix",), simulated=folder)


def test_a_failing_design_leaves_another_ones_run_as_it_was(tmp_path: Path) -> None:
    good = generate(RunRequest(load_design("1dof-5mm", SMALL), tmp_path))
    before = file_hashes(good.folder)
    run = generate(RunRequest(load_design("1dof-5mm", WRONG), tmp_path))
    assert run.failed
    assert run.kept
    assert file_hashes(good.folder) == before


def test_a_failing_design_takes_the_place_of_a_failed_one(tmp_path: Path) -> None:
    generate(RunRequest(load_design("1dof-5mm", WRONG), tmp_path))
    run = generate(RunRequest(load_design("1dof-5mm", (*SMALL, "bond.width=0.71")), tmp_path))
    assert run.failed
    assert not run.kept
    assert "0.71" in (run.folder / "design.toml").read_text()
    assert {"checks.json", "preview/layers.svg"} <= set(run.manifest["files"])


@pytest.mark.parametrize("part", few(["cut", "press", "mesh", "preview"], 2))
def test_a_part_alone_does_not_put_away_another_designs_files(
    part: RunPart, tmp_path: Path
) -> None:
    good = generate(RunRequest(load_design("1dof-5mm", SMALL), tmp_path))
    before = file_hashes(good.folder)
    with pytest.raises(OutputError, match=r"of another design or version .* --set name=NAME"):
        generate(RunRequest(load_design("1dof-5mm", OTHER), tmp_path, (part,)))
    assert file_hashes(good.folder) == before


def test_a_part_made_anew_for_another_design_takes_the_old_ones_place(tmp_path: Path) -> None:
    generate(RunRequest(load_design("1dof-5mm", SMALL), tmp_path, ("press",)))
    run = generate(RunRequest(load_design("1dof-5mm", OTHER), tmp_path, ("press",)))
    assert "140" in (run.folder / "press.json").read_text()


def test_a_whole_run_of_another_design_says_what_it_put_away(tmp_path: Path) -> None:
    generate(simulated(tmp_path, "1.6"))
    run = generate(RunRequest(load_design("1dof-5mm", OTHER), tmp_path))
    assert run.dropped == ("calculix/mesh.inp", "calculix/result.json")


def test_results_stay_while_what_they_come_from_is_the_same(tmp_path: Path) -> None:
    ran = generate(simulated(tmp_path, "1.6"))
    before = file_hashes(ran.folder)
    assert generate(simulated(tmp_path, "")).dropped == ()
    assert file_hashes(ran.folder) == before
    with pytest.raises(OutputError, match="holds results of other settings"):
        generate(simulated(tmp_path, "", mesh="finer"))
    assert file_hashes(ran.folder) == before
    again = generate(simulated(tmp_path, "1.7", mesh="finer"))
    assert (again.folder / "calculix" / "result.json").read_text() == "1.7"


def test_a_failing_assembly_leaves_an_earlier_run_as_it_was(tmp_path: Path) -> None:
    def aperture(*assignments: str) -> Assembly:
        found = load("aperture", ("parts.arm.set.stack.balloons=1", *assignments))
        assert isinstance(found, Assembly)
        return found

    good = generate(RunRequest(aperture(), tmp_path))
    before = file_hashes(good.folder)
    run = generate(RunRequest(aperture("parts.magnet.offset=[0, 0]"), tmp_path))
    assert run.failed
    assert run.kept
    assert file_hashes(good.folder) == before


def test_a_design_of_an_assembly_is_not_written_into(tmp_path: Path) -> None:
    found = load("aperture", ("parts.arm.set.stack.balloons=1",))
    assert isinstance(found, Assembly)
    aperture = generate(RunRequest(found, tmp_path)).folder
    before = file_hashes(aperture)
    arm = load_design(aperture / "3dof-15mm" / "design.toml")
    with pytest.raises(OutputError, match="several designs made together"):
        generate(RunRequest(arm, aperture, ("press",)))
    assert file_hashes(aperture) == before


def test_meshes_of_another_fill_are_not_mixed(tmp_path: Path) -> None:
    design = load_design("1dof-5mm", SMALL)

    def meshed(fill: float | None, *formats: str) -> set[str]:
        settings = MeshSettings(h=0.7, fill_ul=fill)
        run = generate(RunRequest(design, tmp_path, ("mesh",), meshes=settings, formats=formats))
        return set(run.manifest["files"])

    assert "mesh/volume.vtu" in meshed(5.0, "vtu")
    assert {"mesh/volume.vtu", "mesh/cavity_chamber1_conforming.stl"} <= meshed(5.0, "stl")
    flat = meshed(None, "stl")
    assert "mesh/volume.vtu" not in flat
    # A flat pocket has no volume, so that a surface of the film alone is written.
    assert "mesh/cavity_chamber1_conforming.stl" not in flat
    assert any(path.endswith(".stl") for path in flat)


def test_cut_files_in_chords_stay_so_beside_a_new_schedule(tmp_path: Path) -> None:
    design = load_design("1dof-5mm", SMALL)
    generate(RunRequest(design, tmp_path, ("cut",), Curves("chords", 0.02)))
    run = generate(RunRequest(design, tmp_path, ("press",)))
    assert run.manifest["curves"] == "chords within 0.02 mm"
    assert [f.message for f in check_folder(run.folder) if f.verdict == "fail"] == []
