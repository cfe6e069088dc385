"""An assembly's folder: one nest, one traveller, one solid; read back and checked as built."""

from __future__ import annotations

import json
import re
import shutil
from collections import Counter
from pathlib import Path

import pytest
import trimesh
from lxml import html as lxml_html

from sbafab.assemblies.build import assemble
from sbafab.assemblies.files import assembly_sha256, load_assembly
from sbafab.cutting.dxf_read import read_profile
from sbafab.folders.check import check_folder
from sbafab.folders.manifest import file_hashes
from sbafab.folders.run import Run, RunRequest, generate
from tests.quick import few
from tests.site.formats import hold

SMALL = [f"parts.{name}.set.stack.balloons=2" for name in ("left", "right", "head")]
BRACE = ["parts.arm.set.stack.balloons=2"]
OFF = ["parts.magnet.offset=[0, 0]"]
"""A magnet beside its seat in the template of an aperture."""


@pytest.fixture(scope="module")
def standing(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return generate(RunRequest(load_assembly("standing", SMALL), tmp_path_factory.mktemp("out")))


@pytest.fixture(scope="module")
def brace(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return generate(RunRequest(load_assembly("brace", BRACE), tmp_path_factory.mktemp("out")))


@pytest.fixture(scope="module")
def aperture(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return generate(RunRequest(load_assembly("aperture", BRACE), tmp_path_factory.mktemp("out")))


def test_a_folder_for_each_design_and_one_page_for_all(brace: Run) -> None:
    assert not brace.failed
    assert {path.name for path in brace.folder.iterdir()} == {
        *("radial-15mm", "3dof-15mm", "sheets", "mesh", "preview"),
        *("traveller.html", "bench.html", "findings.html"),
        *("checks.json", "design.toml", "manifest.json"),
    }
    assert not [*brace.folder.glob("*/traveller.html"), *brace.folder.glob("*/bench.html")]
    assert (brace.folder / "preview" / "assembled.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.long
def test_a_design_used_three_times_is_drawn_once_and_cut_three_times(
    standing: Run,
) -> None:
    layers = list((standing.folder / "3dof-15mm" / "layers").glob("*.dxf"))
    assert len(layers) == 4 + 3
    for material in ("TPE", "PTFE"):
        one = sum(read_profile(path).region.area for path in layers if material in path.name)
        cut = sum(
            read_profile(path).region.area
            for path in (standing.folder / "sheets").glob(f"{material}_*.dxf")
        )
        # A spare of every pattern.
        assert cut == pytest.approx((3 + 1) * one, abs=1e-3)
    page = (standing.folder / "traveller.html").read_text(encoding="utf-8")
    assert "3dof-15mm, 3 copies: 1 lamination, all at once" in page
    assert "45 min in the press instead of 135" in page


def test_the_solid_has_a_node_a_part_at_true_size(brace: Run) -> None:
    scene = trimesh.load(brace.folder / "mesh" / "assembled.glb")
    names = {"tube", "grip", "arm", "cup", "vacuum"}
    assert set(scene.graph.nodes_geometry) == names
    # Metres, y up: the tube is 15 wide and 40 high.
    transform, geometry = scene.graph["tube"]
    low, high = scene.geometry[geometry].copy().apply_transform(transform).bounds
    assert (high - low) * 1000 == pytest.approx([15, 40, 15], abs=0.05)
    told = {n["name"]: n for m in brace.manifest["meshes"] for n in m["nodes"]}
    assert told["tube"]["volume_mm3"] == pytest.approx(3267.26, rel=1e-4)
    assert set(told) == names


def test_the_manifest_tells_parts_and_places(brace: Run) -> None:
    told = json.loads((brace.folder / "manifest.json").read_text(encoding="utf-8"))
    hold("assembly", told)
    parts = {part["name"]: part for part in told["parts"]}
    assert parts["arm"]["shift"] == [0, 0, 40]
    assert parts["grip"]["bent_radius"] == 7.5
    assert parts["grip"]["design"] == "radial-15mm"
    found = file_hashes(brace.folder)
    found.pop("manifest.json")
    assert told["files"] == found


def test_the_written_design_builds_the_same_assembly(brace: Run) -> None:
    again = assemble(load_assembly(brace.folder / "design.toml"))
    assert assembly_sha256(again) == brace.manifest["design_sha256"]


@pytest.mark.long
def test_the_same_assembly_gives_the_same_bytes(standing: Run, tmp_path: Path) -> None:
    again = generate(RunRequest(load_assembly("standing", SMALL), tmp_path))
    assert file_hashes(again.folder) == file_hashes(standing.folder)


def test_names_on_the_page_are_one_each_and_every_link_leads_somewhere(brace: Run) -> None:
    """Two designs stand on one page."""
    tree = lxml_html.fromstring((brace.folder / "traveller.html").read_text(encoding="utf-8"))
    names = Counter(node.get("id") for node in tree.iter() if node.get("id"))
    assert [name for name, count in names.items() if count > 1] == []
    links = {
        value.removeprefix("#")
        for node in tree.iter()
        for name, value in node.attrib.items()
        if name in ("href", "aria-labelledby") and not value.startswith("data:")
    }
    assert links <= set(names)


def test_moulds_are_closed_bodies(brace: Run) -> None:
    page = (brace.folder / "traveller.html").read_text(encoding="utf-8")
    moulds = set(re.findall(r"mesh/[^\s<\"]*mould[^\s<\"]*\.stl", page))
    assert len(moulds) == 2
    assert all(trimesh.load(brace.folder / path).is_watertight for path in moulds)


def test_the_total_counts_what_is_known_where_press_minutes_are_not(
    aperture: Run, tmp_path: Path
) -> None:
    """Of a film that they were not stated for: the rest of a total is as it was."""
    film = [f"parts.arm.set.films.tpe.{key}" for key in ("product=TPU", "thickness=0.038")]
    other = generate(RunRequest(load_assembly("aperture", [*BRACE, *film]), tmp_path, ("press",)))
    hours = [
        re.search(
            r"Total, without joining(at least )?([0-9.]+) h( and the press minutes)?",
            lxml_html.parse(run.folder / "traveller.html").getroot().text_content(),
        )
        for run in (aperture, other)
    ]
    assert [bool(each and each[1] and each[3]) for each in hours] == [False, True]
    known, least = (float(each[2]) for each in hours if each)
    plans = map(json.loads, (p.read_text("utf-8") for p in aperture.folder.rglob("press.json")))
    minutes = sum(plan["total_press_minutes"] for plan in plans)
    assert known - least == pytest.approx(minutes / 60, abs=0.11)


def test_a_failed_check_leaves_findings_and_nothing_to_cut(tmp_path: Path) -> None:
    run = generate(RunRequest(load_assembly("aperture", [*BRACE, *OFF]), tmp_path))
    assert run.failed
    assert not list(run.folder.rglob("*.dxf"))
    assert not (run.folder / "traveller.html").exists()
    told = json.loads((run.folder / "checks.json").read_text(encoding="utf-8"))
    failed = {f["rule"] for f in told["findings"] if f["verdict"] == "fail"}
    assert failed == {"seat"}


@pytest.mark.long
def test_a_failed_rule_of_one_design_stops_all(tmp_path: Path) -> None:
    keys = [*BRACE, "parts.arm.set.bond.width=0.4"]
    run = generate(RunRequest(load_assembly("brace", keys), tmp_path))
    assert run.failed
    assert not list(run.folder.rglob("*.dxf"))


@pytest.mark.long
def test_a_waived_check_is_said_on_sheets_page_and_manifest(tmp_path: Path) -> None:
    whole = load_assembly("aperture", ["parts.arm.set.stack.balloons=2", *OFF], ["seat"])
    run = generate(RunRequest(whole, tmp_path))
    assert not run.failed
    assert run.manifest["waived"] == ["seat"]
    sheet = (run.folder / "sheets" / "TPE_1.dxf").read_text(encoding="utf-8")
    assert "seat" in sheet
    assert "Waived checks" in (run.folder / "traveller.html").read_text(encoding="utf-8")
    assert not [f for f in check_folder(run.folder) if f.verdict == "fail"]


@pytest.mark.long
def test_lowered_limits_of_parts_and_checks_are_said(tmp_path: Path) -> None:
    keys = ["parts.arm.set.stack.balloons=2", "parts.arm.set.rules.bond_width=0.7"]
    whole = load_assembly("aperture", [*keys, "rules.seat_share=0.1"])
    run = generate(RunRequest(whole, tmp_path))
    assert not run.failed
    said = ["bond_width 0.7 (paper 0.75)", "seat_share 0.1 (default 0.25)"]
    assert run.manifest["lowered_limits"] == said
    assert ", ".join(said) in (run.folder / "sheets" / "TPE_1.dxf").read_text(encoding="utf-8")
    page = (run.folder / "traveller.html").read_text(encoding="utf-8")
    assert page.count(said[1]) >= 2
    assert not [f for f in check_folder(run.folder) if f.verdict == "fail"]
    path = run.folder / "manifest.json"
    path.write_text(path.read_text().replace(said[1], "seat_share 0.2 (default 0.25)"))
    assert any(said[1] in f.message for f in check_folder(run.folder) if f.verdict == "fail")


@pytest.mark.parametrize("name", few(("brace", "standing"), 1))
def test_the_folder_is_found_as_it_was_built(name: str, request: pytest.FixtureRequest) -> None:
    findings = check_folder(request.getfixturevalue(name).folder)
    assert [f.message for f in findings if f.verdict == "fail"] == []
    assert {"collision", "seat", "tube-match", "bond-width", "manifest-claims"} <= {
        f.rule for f in findings
    }


def doctored(run: Run, folder: Path) -> Path:
    return Path(shutil.copytree(run.folder, folder / run.folder.name))


def claims_failed(folder: Path) -> str:
    failed = [f for f in check_folder(folder) if f.verdict == "fail"]
    return " / ".join(f"{f.rule}: {f.message}" for f in failed)


@pytest.mark.long
def test_a_moved_part_is_found(standing: Run, tmp_path: Path) -> None:
    folder = doctored(standing, tmp_path)
    path = folder / "manifest.json"
    told = json.loads(path.read_text(encoding="utf-8"))
    told["parts"][1]["shift"][0] += 1
    path.write_text(json.dumps(told), encoding="utf-8")
    said = claims_failed(folder)
    assert said.startswith("manifest-claims: manifest.json: parts.2.shift.1 is 16.0, not 15.0")


@pytest.mark.long
def test_another_design_file_is_found(standing: Run, tmp_path: Path) -> None:
    folder = doctored(standing, tmp_path)
    path = folder / "design.toml"
    path.write_text(path.read_text("utf-8").replace("angle = 60.0", "angle = 30.0"), "utf-8")
    said = claims_failed(folder)
    assert "manifest-claims: manifest.json: " in said
    assert "as-designed: traveller.html is not what design.toml makes" in said
    assert "design.toml was changed" in said


def test_a_broken_design_file_is_found(aperture: Run, tmp_path: Path) -> None:
    folder = doctored(aperture, tmp_path)
    (folder / "design.toml").write_text("family = 1", encoding="utf-8")
    assert "the parts were not put together" in claims_failed(folder)


def test_a_lost_sheet_is_found(aperture: Run, tmp_path: Path) -> None:
    folder = doctored(aperture, tmp_path)
    (folder / "sheets" / "TPE_1.dxf").unlink()
    assert "sheets/TPE_1.dxf" in claims_failed(folder)
