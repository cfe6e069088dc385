"""Output folders and laminates imported: the same layers, findings and cut files to the byte."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from hypothesis import given, settings

from sbafab.actuators import build, load_design
from sbafab.design.files import template_names
from sbafab.design.identity import design_sha256
from sbafab.design.laminate_file import FILE, laminate_json
from sbafab.folders.run import RunRequest, generate
from sbafab.geometry.edges import Line
from sbafab.importing.laminates import import_folder, import_laminate
from sbafab.importing.records import Written, write_imported
from sbafab.laminate.laminate import Laminate
from sbafab.rules.deck import run_deck
from tests.designs import FEW, drawn, tables
from tests.importing.conftest import Importing
from tests.properties.designs import Draft, valid
from tests.properties.test_designs import share
from tests.quick import few

GALLERY = Path(__file__).parents[2] / "docs" / "gallery"
SMALLER = ("1dof-5mm", "3dof-15mm")
"""Templates that are taken with fewer balloons."""
ASSEMBLIES = ("aperture", "brace", "standing")
DESIGNS: dict[str, tuple[str, list[str]]] = {
    "1dof-5mm": ("1dof-5mm", ["stack.balloons=3"]),
    "3dof-15mm": ("3dof-15mm", ["stack.balloons=2"]),
    **{name: (name, []) for name in template_names() if name not in (*SMALLER, *ASSEMBLIES)},
    "radial manifold": ("radial-15mm", ["inlet.manifold=true", "stack.balloons=2"]),
    "radial ears": ("radial-15mm", ["registration.method=ears", "sheet.overlap=2"]),
    "ears stay in": (
        "1dof-5mm",
        ["registration.method=ears", "registration.full_bond_pins=in"],
    ),
    "taper": (str(GALLERY / "taper-12-to-6.toml"), []),
    "drawn outline": (str(GALLERY / "oval.toml"), []),
}


def folder_of(source: str, changes: list[str], out: Path) -> tuple[Laminate, Path]:
    design = load_design(source, [*changes, "rules.yield_builds=100", "sheets.label=false"])
    folder = generate(RunRequest(design, out, ("cut", "press"))).folder
    return build(design), folder


def holes(dxf: bytes) -> bytes:
    """The circles of a base plate's cut file, without their handles."""
    return b"\n".join(re.findall(rb"AcDbCircle\n(?:.*\n){8}", dxf))


def untimed(press: bytes) -> bytes:
    """A press.json without minutes of work by hand and in all."""
    return re.sub(
        rb'"(hands_minutes|estimated_build_minutes|estimate_basis)": (?:"[^"]*"|[0-9.nul]+)',
        rb'"\1": null',
        press,
    )


def measured(checks: bytes) -> bytes:
    """Return a folder's findings without their sentences."""
    found = json.loads(checks)["findings"]
    rows = [{k: v for k, v in row.items() if k not in ("message", "remedy")} for row in found]
    return json.dumps(rows).encode()


def imported(folder: Path, file: Path) -> Written:
    return write_imported(import_folder(folder), file, folder.name)


@pytest.mark.parametrize("name", few(DESIGNS, 2))
def test_a_folder_comes_back_with_the_same_bytes(name: str, tmp_path: Path) -> None:
    laminate, folder = folder_of(*DESIGNS[name], tmp_path / "out")
    written = imported(folder, tmp_path / "again.toml")
    again = written.laminate
    assert replace(again, family=laminate.family) == laminate
    assert all(
        a.profile.is_exactly(b.profile) for a, b in zip(again.layers, laminate.layers, strict=True)
    )
    assert run_deck(again, FEW) == run_deck(laminate, FEW)

    second = generate(RunRequest(written.design, tmp_path / "second", ("cut", "press"))).folder
    hashes = [json.loads((top / "manifest.json").read_text()) for top in (folder, second)]
    ours, theirs = (entry["design_sha256"].encode() for entry in hashes)
    assert theirs == design_sha256(written.design).encode()
    cut = [*folder.glob("layers/*.dxf"), *folder.glob("sheets/*.dxf")]
    assert len(cut) > len(laminate.layers)
    for path in (*cut, folder / "checks.json", folder / "press.json", folder / "press.csv"):
        ours_text, theirs_text = path.read_bytes(), (second / path.relative_to(folder)).read_bytes()
        if path.name == "fixture.dxf":
            # Its lettering spells the design's hash.
            ours_text, theirs_text = holes(ours_text), holes(theirs_text)
        if path.name == "press.json":
            # Nobody timed the work at drawn layers, so that their minutes are null.
            ours_text, theirs_text = untimed(ours_text), untimed(theirs_text)
        if path.name == "checks.json":
            # What mends a family's design, a wider bond say, mends no drawn one.
            ours_text, theirs_text = measured(ours_text), measured(theirs_text)
        assert theirs_text.replace(theirs, ours) == ours_text, path.name


def read_back(laminate: Laminate, folder: Path) -> Written:
    path = folder / FILE
    path.write_text(laminate_json(laminate), encoding="utf-8")
    written = write_imported(import_laminate(path), folder / "again.toml", FILE)
    again = replace(written.laminate, family=laminate.family, name=laminate.name)
    assert uncoloured(again) == uncoloured(laminate)
    return written


def uncoloured(laminate: Laminate) -> Laminate:
    """The laminate without the colours of its films, which films that it has none of count for."""
    layers = (replace(layer, film=replace(layer.film, shade=0)) for layer in laminate.layers)
    return replace(laminate, layers=tuple(layers))


@pytest.mark.parametrize("name", few(DESIGNS, 3))
def test_a_laminate_alone_comes_back_exactly(name: str, tmp_path: Path) -> None:
    source, changes = DESIGNS[name]
    read_back(build(load_design(source, changes)), tmp_path)


def comes_back(draft: Draft) -> None:
    with TemporaryDirectory() as name:
        read_back(build(load_design(draft.write(Path(name)))), Path(name))


@share(2, 2)
@given(valid())
def test_a_random_laminate_comes_back_exactly(draft: Draft) -> None:
    comes_back(draft)


@pytest.mark.long
@settings(max_examples=100)
@given(valid())
def test_100_random_laminates_come_back_exactly(draft: Draft) -> None:
    comes_back(draft)


def test_a_kit_comes_along(tmp_path: Path) -> None:
    from sbafab.design.kits import write_kit

    kit = write_kit(tmp_path / "lab.toml")
    kit.write_text(
        kit.read_text().replace("temperature_c = { value = 135", "temperature_c = { value = 140")
    )
    source = tmp_path / "mine.toml"
    source.write_text('name = "mine"\nfamily = "1dof"\nkit = "lab.toml"\n[stack]\nballoons = 2\n')
    design = load_design(source, ["rules.yield_builds=100"])
    assert design.press.temperature_c == 140
    folder = generate(RunRequest(design, tmp_path / "out", ("cut",))).folder
    written = imported(folder, tmp_path / "again.toml")
    assert written.design.kit == "again-drawings/kit.toml"
    assert written.design.press == design.press
    assert written.design.rules == design.rules


def test_the_command_writes_a_design_and_says_what_is_not_carried(
    importing: Importing, tmp_path: Path
) -> None:
    _, folder = folder_of("1dof-5mm", ["stack.balloons=2"], tmp_path / "out")
    result = importing(folder, "--json")
    assert result.exit_code == 0
    said = json.loads(result.stdout)
    assert (said["file"], said["layers"]) == ("1dof-5mm.toml", 7)
    assert any("family 1dof: its keys are not carried over" in line for line in said["remarks"])
    assert Path("1dof-5mm-drawings", FILE).read_bytes() == (folder / FILE).read_bytes()
    again = importing(folder)
    assert again.exit_code == 2
    assert (
        "1dof-5mm.toml already exists; move it, or choose another place with -o or --to"
        in again.output
    )


def test_a_chamber_without_an_inlet_is_named(importing: Importing, tmp_path: Path) -> None:
    document = json.loads(laminate_json(build(load_design("1dof-5mm")))) | {"inlets": []}
    (tmp_path / FILE).write_text(json.dumps(document), encoding="utf-8")
    assert "chamber chamber1 has 0 inlets" in importing(tmp_path / FILE).output


def test_an_assembly_is_refused_with_its_designs(importing: Importing, tmp_path: Path) -> None:
    folder = tmp_path / "pair"
    part = folder / "1dof-5mm"
    part.mkdir(parents=True)
    (folder / "design.toml").write_text('name = "pair"\nfamily = "assembly"\n')
    (part / "design.toml").write_text('name = "1dof-5mm"\nfamily = "1dof"\n')
    said = importing(folder).output
    assert "holds an assembly" in said
    assert f'import one of its designs: "1dof-5mm" in {folder}' in said


# Seams, folds, faces, ports and nets of a laminate.json come back with its design.


HALF_RING = [[-2, 30], [-2, 20, 1], [-2, -20], [2, -20], [2, 30]]


def welded(**changes: Any) -> dict[str, Any]:
    """Two coated films on their coated faces, welded along an open path of lines."""
    data = tables("welded")
    data["films"] = {
        "tpe": {"faces": {"upper": "pu", "lower": "nylon"}},
        "foil": {
            "kind": "structural",
            "product": "foil",
            "thickness": 0.05,
            "melting_point": 130,
            "faces": {"upper": "nylon", "lower": "pu"},
        },
    }
    data["layers"][1]["film"] = "foil"
    data["face_bonds"] = {"weld": {"faces": ["pu", "pu"], "by": "hot-tip", "temperature_c": 150}}
    return {**data, **changes}


def turned() -> dict[str, Any]:
    """The same of one film, the upper one turned."""
    data = welded()
    data["layers"][1] = {"role": "cap", "shape": "film", "turned": True}
    return data


def ringed() -> dict[str, Any]:
    """Welded along the boundary of a shape with a hole, and named places on two nets."""
    data = tables("welded")
    data["shapes"]["rim"] = {"ring": [38, 20]}
    data["seams"] = [
        {"name": "rim", "layers": [1, 2], "shape": "rim", "width": 1, "tool": "roller"},
    ]
    data["ports"] = [
        {"name": "middle", "layers": [1, 2], "at": [0, 0]},
        {"name": "between", "layers": [1, 2], "at": [14, 0]},
    ]
    data["nets"] = {"a": ["pouch", "between"]}
    return data


JOINED = {"faces": welded, "turned": turned, "shape": ringed, "fold": lambda: tables("folded")}


def again(data: dict[str, Any], folder: Path) -> tuple[Laminate, Written]:
    laminate = drawn(folder, data)
    (folder / FILE).write_text(laminate_json(laminate), encoding="utf-8")
    written = write_imported(import_laminate(folder / FILE), folder / "again.toml", FILE)
    return laminate, written


@pytest.mark.parametrize("name", JOINED)
def test_joints_come_back_exactly(name: str, tmp_path: Path) -> None:
    laminate, written = again(JOINED[name](), tmp_path)
    assert written.laminate == laminate
    assert any((laminate.seams, laminate.folds, laminate.nets, laminate.bonds))


def test_an_open_path_keeps_its_arcs(tmp_path: Path) -> None:
    data = tables("welded")
    data["seams"][0]["path"] = HALF_RING
    laminate, written = again(data, tmp_path)
    (ours,), (theirs,) = laminate.seams[0].path, written.laminate.seams[0].path
    assert replace(laminate.seams[0], path=()) == replace(written.laminate.seams[0], path=())
    assert sum(not isinstance(edge, Line) for edge in ours) >= 1
    for a, b in zip(ours, theirs, strict=True):
        assert a.start == pytest.approx(b.start, abs=1e-12)
        assert a.bulge == pytest.approx(b.bulge, abs=1e-12)
