"""Whole runs: what lies in the folder, what failing designs leave out, same input same bytes."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import sbafab
from sbafab.actuators import build, load_design
from sbafab.design.identity import design_sha256
from sbafab.design.laminate_file import read_laminate
from sbafab.errors import OutputError
from sbafab.folders import artefacts
from sbafab.folders.check import check_folder
from sbafab.folders.run import RunRequest, generate
from sbafab.meshing import formats
from sbafab.meshing.conforming.layup import MeshSettings
from tests.quick import few

TEMPLATES = ["1dof-5mm", "1dof-10mm", "3dof-15mm", "radial-15mm"]


def hashes(folder: Path) -> dict[str, str]:
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def manifest_of(folder: Path) -> dict[str, object]:
    manifest: dict[str, object] = json.loads((folder / "manifest.json").read_text())
    return manifest


@pytest.mark.parametrize("name", TEMPLATES)
def test_everything_is_there_and_hashed(name: str, tmp_path: Path) -> None:
    design = load_design(name)
    run = generate(RunRequest(design, tmp_path))
    assert not run.failed
    manifest = manifest_of(run.folder)
    on_disk = hashes(run.folder)
    assert on_disk.pop("manifest.json")
    assert manifest["files"] == on_disk
    laminate = build(design)
    assert read_laminate(run.folder / "laminate.json") == laminate
    layers = [f"layers/{layer.name}.dxf" for layer in laminate.layers]
    assert [path for path in on_disk if path.startswith("layers/")] == sorted(layers)
    cavities = [f"mesh/cavity_{chamber.name}.stl" for chamber in laminate.chambers]
    for path in [
        "checks.json",
        "laminate.json",
        "design.toml",
        "press.json",
        "press.csv",
        "mesh/solid.stl",
        "mesh/solid.3mf",
        "mesh/solid.glb",
        "preview/layers.svg",
        "preview/stack.svg",
        "preview/solid.png",
        *cavities,
    ]:
        assert path in on_disk, path
    assert manifest["design_sha256"] == design_sha256(design)
    again = load_design(run.folder / "design.toml")
    assert design_sha256(again) == design_sha256(design)


def test_a_failing_design_writes_no_cut_files(tmp_path: Path) -> None:
    design = load_design("1dof-5mm", ["bond.width=0.72"])
    run = generate(RunRequest(design, tmp_path))
    assert run.failed
    written = hashes(run.folder)
    assert not [path for path in written if path.startswith(("layers/", "mesh/", "press"))]
    for path in ("laminate.json", "preview/layers.svg"):
        assert "must not be built; failed: bond-width" in (run.folder / path).read_text(), path
    findings = json.loads((run.folder / "checks.json").read_text())["findings"]
    assert "fail" in {finding["verdict"] for finding in findings}


def test_waivers_stand_in_every_file(tmp_path: Path) -> None:
    waive = 'rules.waive=["bond-width", "tube-fit"]'
    run = generate(RunRequest(load_design("1dof-5mm", ["bond.width=0.72", waive]), tmp_path))
    assert not run.failed
    cut = sorted((run.folder / "layers").iterdir())
    assert len(cut) == 23
    for path in cut:
        assert "bond-width, tube-fit" in path.read_text(), path.name
    assert manifest_of(run.folder)["waived"] == ["bond-width", "tube-fit"]
    for path in ("laminate.json", "press.json", "preview/layers.svg"):
        assert "bond-width, tube-fit" in (run.folder / path).read_text(), path


def test_lowered_limits_stand_in_every_file(tmp_path: Path) -> None:
    settings = ["bond.width=0.6", "rules.bond_width=0.6", "rules.worst_bond_width=0"]
    run = generate(RunRequest(load_design("1dof-5mm", [*settings, "stack.balloons=2"]), tmp_path))
    assert not run.failed
    said = ["bond_width 0.6 (paper 0.75)", "worst_bond_width 0 (default 0.5)"]
    manifest = manifest_of(run.folder)
    assert (manifest["waived"], manifest["lowered_limits"]) == ([], said)
    cut = [*(run.folder / "layers").iterdir(), *(run.folder / "sheets").glob("*.dxf")]
    assert len(cut) == 7 + 3
    for path in cut:
        text = path.read_text()
        assert f"LIMITS\n  9\n$CUSTOMPROPERTY\n  1\n{', '.join(said)}\n" in text, path.name
        assert "WAIVED\n  9\n$CUSTOMPROPERTY\n  1\nnone\n" in text, path.name
    names = ("layers.svg", "stack.svg")
    others = ["press.json", "press.csv", "checks.json", *(f"preview/{name}" for name in names)]
    for name in (*others, "traveller.html"):
        assert said[0] in (run.folder / name).read_text(), name
    # In the head of the traveller, among its warnings, and at the first step.
    assert (run.folder / "traveller.html").read_text().count(said[0]) >= 3
    assert not [f for f in check_folder(run.folder) if f.verdict == "fail"]


def test_a_waiver_that_was_not_needed_is_not_claimed(tmp_path: Path) -> None:
    waive = 'rules.waive=["bond-width", "mask-overhang"]'
    run = generate(RunRequest(load_design("1dof-5mm", [waive]), tmp_path, ["cut"]))
    assert manifest_of(run.folder)["waived"] == []


def test_parts_keep_what_is_of_the_same_design(tmp_path: Path) -> None:
    whole = generate(RunRequest(load_design("1dof-5mm"), tmp_path))
    before = hashes(whole.folder)
    generate(RunRequest(load_design("1dof-5mm"), tmp_path, ["press"]))
    assert hashes(whole.folder) == before


def test_a_run_that_dies_half_way_leaves_the_old_output(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = generate(RunRequest(load_design("1dof-5mm"), tmp_path))
    before = hashes(run.folder)

    def dies(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(artefacts, "write_meshes", dies)
    with pytest.raises(KeyboardInterrupt):
        generate(RunRequest(load_design("1dof-5mm", ["bond.width=0.8"]), tmp_path))
    assert hashes(run.folder) == before
    assert sorted(os.listdir(tmp_path)) == [".1dof-5mm.lock", "1dof-5mm"]


def test_a_mesh_that_fails_is_left_out_by_name_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = hashes(generate(RunRequest(load_design("1dof-5mm"), tmp_path / "whole")).folder)

    def fails(*_: object) -> None:
        raise OutputError("the mesh of the cavity is not closed")

    monkeypatch.setattr(formats, "cavity", fails)
    run = generate(RunRequest(load_design("1dof-5mm"), tmp_path))
    name = "mesh/cavity_chamber1.stl"
    assert run.left_out == ((name, "the mesh of the cavity is not closed"),)
    rest = {file: value for file, value in whole.items() if file not in (name, "manifest.json")}
    assert {k: v for k, v in hashes(run.folder).items() if k != "manifest.json"} == rest
    assert all(finding.verdict != "fail" for finding in check_folder(run.folder))


@pytest.mark.parametrize(
    ("name", "balloons"), few([("3dof-15mm", 2), ("radial-15mm", 1)], 1, names=2)
)
def test_same_input_same_bytes(name: str, balloons: int, tmp_path: Path) -> None:
    size = f"stack.balloons={balloons}"
    here = hashes(generate(RunRequest(load_design(name, [size]), tmp_path / "here")).folder)
    script = f"import sys, sbafab; sbafab.generate(sys.argv[1], {size!r}, out=sys.argv[2])"
    environment = {**os.environ, "PYTHONHASHSEED": "4711", "TZ": "Pacific/Kiritimati"}
    subprocess.run(
        [sys.executable, "-c", script, name, str(tmp_path / "there")], check=True, env=environment
    )
    assert hashes(tmp_path / "there" / name) == here


def test_a_drawn_outline_travels_with_the_output(tmp_path: Path) -> None:
    drawing = tmp_path / "drop.svg"
    drawing.write_text(
        '<svg xmlns="http://www.w3.org/2000/svg">'
        '<path d="M 4 0 A 4 4 0 0 1 -4 0 A 4 4 0 0 1 4 0 Z"/></svg>'
    )
    toml = tmp_path / "drop.toml"
    toml.write_text('family = "1dof"\n[chamber]\noutline = "drop.svg"\n[stack]\nballoons = 2\n')
    design = load_design(toml)
    run = generate(RunRequest(design, tmp_path / "out", ["cut"]))
    again = load_design(run.folder / "design.toml")
    assert design_sha256(again) == design_sha256(design)
    assert run.manifest["sizes"]["outline_diameter"] == pytest.approx(9.5)


def test_conforming_meshes_stay_beside_those_of_a_later_run(tmp_path: Path) -> None:
    design = load_design("1dof-5mm", ["stack.balloons=1"])
    asked = MeshSettings(h=0.7, symmetry="quarter")
    made = generate(RunRequest(design, tmp_path, ("mesh",), meshes=asked, formats=("vtu",)))
    figures = made.manifest["mesh_statistics"]
    assert figures["volume"]["least_scaled_jacobian"] > 0
    assert made.manifest["meshes"][-1]["kind"] == "shell"
    later = generate(RunRequest(design, tmp_path))
    assert {mesh["file"] for mesh in later.manifest["meshes"]} == {
        mesh["file"] for mesh in made.manifest["meshes"]
    }
    assert later.manifest["mesh_statistics"] == figures
    assert (later.folder / "mesh" / "volume.vtu").is_file()
    other = generate(RunRequest(load_design("1dof-5mm"), tmp_path))
    assert not (other.folder / "mesh" / "volume.vtu").exists()


def test_a_pin_that_no_step_uses_has_a_hole_without_a_depth(tmp_path: Path) -> None:
    """A check that passes, or is waived, is followed by files."""
    pin = 'pins=[{name="p1", at=[15,0], diameter=1.0, clearance=0.04}]'
    run = sbafab.generate("pouch", pin, "rules.waive=['pin-holes']", out=tmp_path)
    assert "not used" in (run.folder / "bench.html").read_text(encoding="utf-8")
