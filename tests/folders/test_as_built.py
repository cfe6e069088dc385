"""Checks of doctored folders: every fault is told, by the rule that is named for it.

Faults come with hashes put right, so that each has to be seen in the geometry itself.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

import pytest

from sbafab.actuators import load_design
from sbafab.cli import main
from sbafab.cutting.kerf import in_chords
from sbafab.design.sections import rule_names
from sbafab.errors import OutputError
from sbafab.folders.check import check_folder
from sbafab.folders.run import RunRequest, generate
from sbafab.geometry.offset import grow, shrink
from sbafab.rules.finding import Finding
from tests.folders.doctoring import Doctor


def failed(folder: Path) -> dict[str, Finding]:
    """The first failing finding of every rule that fails."""
    found: dict[str, Finding] = {}
    for finding in check_folder(folder):
        if finding.verdict == "fail":
            found.setdefault(finding.rule, finding)
    return found


def test_a_finding_names_the_faulty_layer(lobed: Doctor) -> None:
    lobed.redraw(9, lambda r: r.moved(0.15, 0.0))
    lobed.rehash()
    found = failed(lobed.folder)
    assert "file-integrity" not in found
    assert found["as-designed"].where.layers == (9,)
    finding = found["registration-nominal"]
    assert 9 in finding.where.layers
    assert finding.measured == pytest.approx(0.15, abs=1e-6)


def delete_file(doctor: Doctor) -> None:
    doctor.path(3).unlink()


def empty_file(doctor: Doctor) -> None:
    doctor.path(3).write_text("")


def truncate(doctor: Doctor) -> None:
    text = doctor.path(3).read_text()
    doctor.path(3).write_text(text[: int(0.9 * len(text))])


def not_dxf(doctor: Doctor) -> None:
    doctor.path(3).write_bytes(b"\x89PNG\r\n\x1a\n\x00\x00")


def inch_header(doctor: Doctor) -> None:
    doctor.edit(3, "$INSUNITS\n 70\n4\n", "$INSUNITS\n 70\n1\n")


def open_contour(doctor: Doctor) -> None:
    text = doctor.path(3).read_text()
    head, marker, tail = text.rpartition("AcDbPolyline\n")
    doctor.path(3).write_text(head + marker + tail.replace(" 70\n1\n", " 70\n0\n", 1))


def doubled_contour(doctor: Doctor) -> None:
    text = doctor.path(3).read_text()
    start = text.index("  0\nCIRCLE\n")
    end = text.index("  0\n", start + 4)
    entity = text[start:end]
    head, handle, rest = entity.partition("  5\n")
    _, line, rest = rest.partition("\n")
    doctor.path(3).write_text(text[:end] + head + handle + "FFFF" + line + rest + text[end:])


def crossing_contours(doctor: Doctor) -> None:
    doctor.edit(3, "AcDbCircle\n 10\n0.0\n", "AcDbCircle\n 10\n-3.2\n")


def wrong_dxf_layer(doctor: Doctor) -> None:
    doctor.edit(3, "  8\nCUT_INNER\n100\nAcDbCircle", "  8\nCUT_OUTER\n100\nAcDbCircle")


def contour_on_reference(doctor: Doctor) -> None:
    doctor.edit(3, "  8\nCUT_INNER\n100\nAcDbCircle", "  8\nREFERENCE\n100\nAcDbCircle")


@pytest.mark.parametrize(
    "fault",
    [
        delete_file,
        empty_file,
        truncate,
        not_dxf,
        inch_header,
        open_contour,
        doubled_contour,
        crossing_contours,
        wrong_dxf_layer,
        contour_on_reference,
    ],
)
def test_unsound_files_are_told_with_their_layer(
    fault: Callable[[Doctor], None], doctor: Doctor
) -> None:
    fault(doctor)
    found = check_folder(doctor.folder)
    broken = [f for f in found if f.rule == "file-integrity" and f.verdict == "fail"]
    assert [finding.where.layers for finding in broken] == [(3,)]
    assert "003_TPE_wall.dxf" in broken[0].message
    told = {finding.rule: finding for finding in found}
    assert told["sealing"].verdict == "warn"
    assert "not run" in told["sealing"].message


def test_chords_that_no_property_states_depart_from_the_design(doctor: Doctor) -> None:
    doctor.redraw(3, lambda region: in_chords(region, "separator-mask", 0.005))
    doctor.rehash()
    assert failed(doctor.folder)["as-designed"].where.layers == (3,)


def test_files_swapped_are_told(doctor: Doctor) -> None:
    one, other = doctor.path(4), doctor.path(6)
    text = one.read_text()
    one.write_text(other.read_text())
    other.write_text(text)
    doctor.rehash()
    claims = [f for f in check_folder(doctor.folder) if f.rule == "manifest-claims"]
    assert {4, 6} <= {layer for finding in claims for layer in finding.where.layers}
    assert "sealing" in failed(doctor.folder)


@pytest.mark.parametrize("times", [2, -1])
def test_a_kerf_undone_wrongly_breaks_rules(times: int, tmp_path: Path) -> None:
    design = load_design(
        "1dof-5mm", ["stack.balloons=2", "laser.kerf_tpe=0.2", "rules.yield_builds=100"]
    )
    doctor = Doctor(generate(RunRequest(design, tmp_path, ("cut",))).folder)
    # The file holds the path for one kerf; half a kerf is 0.1.
    for layer in (1, 3, 5, 7):
        doctor.redraw(layer, lambda r: grow(r, 0.1) if times == 2 else shrink(r, 0.2))
    doctor.rehash()
    found = failed(doctor.folder)
    assert "as-designed" in found
    assert {"channel-clear", "mask-overhang"} & set(found)


def swap_layers(manifest: dict[str, list[object]]) -> None:
    layers = manifest["layers"]
    layers[3], layers[5] = layers[5], layers[3]


SHEET = {"width": 150.0, "border": 5.0, "density": 0.9, "picture": "a.svg", "number": 2}
CLAIMS: list[tuple[str, Callable[..., object], str]] = [
    ("order", swap_layers, "layers.4.index is 6, not 4"),
    ("height", lambda m: m["layers"][4].update(z=0.5), "layers.5.z is 0.5"),
    ("area", lambda m: m["layers"][4].update(area=m["layers"][4]["area"] * 1.002), "5.area is"),
    ("bores", lambda m: m["layers"][0].update(bores=["chamber1"]), "layers.1.bores has 1"),
    ("path", lambda m: m["layers"][3].update(file="../outside.dxf"), "layers.4.file is"),
    ("hash", lambda m: m["files"].update({"press.json": "0" * 64}), "press.json"),
    ("file hash", lambda m: m["files"].update({m["layers"][2]["file"]: "0" * 64}), "was changed"),
    ("bond", lambda m: m["interfaces"][0].update(bond_area=99.0), "interfaces.1.bond_area is 99.0"),
    ("bore", lambda m: m["bores"][0].update(x=0.002), "bores.1.x is 0.002, not 0.0"),
    ("lumen", lambda m: m.update(lumen=3.0), "lumen is 3.0, not null"),
    ("design", lambda m: m.update(design_sha256="0" * 64), "design_sha256 is"),
    ("kerf", lambda m: m["kerf"]["TPE"].update(state="compensated", width=0.1), "kerf.TPE.state"),
    ("waived", lambda m: m.update(waived=["sealing"]), "waived has 1 entries, not 0"),
    ("size", lambda m: m["sizes"].update(width=9.0), "sizes.width is 9.0"),
    ("film", lambda m: m["films"][0].update(layers=3), "films.1.layers is 3"),
    ("no sheets", lambda m: m.pop("sheets"), "sheets is missing"),
    ("copies", lambda m: m.update(copies=3), "copies is 3, not 1"),
    ("parts", lambda m: m["sheets"][0]["parts"][0].update(count=9), "sheets.1.parts.1.count is 9"),
    *(
        (key, lambda m, key=key: m["sheets"][0].update({key: SHEET[key]}), f"sheets.1.{key} is")
        for key in SHEET
    ),
]


@pytest.mark.parametrize(("change", "said"), [c[1:] for c in CLAIMS], ids=[c[0] for c in CLAIMS])
def test_wrong_claims_are_told(
    change: Callable[..., object],
    said: str,
    doctor: Doctor,
    remember: Callable[[], AbstractContextManager[None]],
) -> None:
    doctor.set_manifest(change)
    with remember():
        found = check_folder(doctor.folder)
    told = [f.message for f in found if f.rule == "manifest-claims" and f.verdict == "fail"]
    assert any(said in message for message in told), told


def test_files_too_many_are_told_cut_files_as_faults(doctor: Doctor) -> None:
    (doctor.folder / "note.txt").write_text("bench 3")
    assert "manifest-claims" not in failed(doctor.folder)
    shutil.copy(doctor.path(4), doctor.folder / "layers" / "spare.dxf")
    assert "spare.dxf" in failed(doctor.folder)["manifest-claims"].message


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (None, "design.toml is missing"),
        ("name = ", "design.toml cannot be used"),
        ('family = "cubic"', "design.toml cannot be used"),
        ('family = "1dof"\nname = "x"\nbond.width = 9', "design.toml makes no laminate"),
    ],
)
def test_without_a_usable_design_only_hashes_are_compared(
    text: str | None, said: str, doctor: Doctor
) -> None:
    path = doctor.folder / "design.toml"
    path.unlink()
    if text is not None:
        path.write_text(text)
    doctor.path(4).write_text("cut twice")
    designed, *claimed = sorted(check_folder(doctor.folder), key=lambda f: f.rule)
    assert (designed.rule, designed.verdict) == ("as-designed", "fail")
    assert said in designed.message
    assert "only the hashes of the files were compared" in designed.message
    assert {(finding.rule, finding.verdict) for finding in claimed} == {("manifest-claims", "fail")}
    assert {finding.where.layers for finding in claimed} == {(4,), ()}


def test_a_folder_of_another_version_is_one_sentence(doctor: Doctor) -> None:
    (doctor.folder / "checks.json").write_text("{}")
    doctor.set_manifest(lambda m: m.update(generator="sbafab 0.0.1"))
    designed = [f for f in check_folder(doctor.folder) if f.rule == "as-designed"]
    assert [finding.verdict for finding in designed] == ["fail"]
    assert "made by sbafab 0.0.1" in designed[0].message
    # Whoever cuts it still hears of what it would cut.
    doctor.redraw(5, lambda r: r.moved(0.15, 0.0))
    assert len([f for f in check_folder(doctor.folder) if f.rule == "as-designed"]) == 2


def test_limits_come_from_the_folders_design(doctor: Doctor) -> None:
    path = doctor.folder / "design.toml"
    path.write_text(path.read_text().replace("bond_width = 0.75", "bond_width = 0.8"))
    found = failed(doctor.folder)
    assert found["bond-width"].limit == 0.8
    assert "manifest-claims" in found


@pytest.mark.parametrize(
    "text",
    [
        None,
        "",
        "{",
        "[]",
        "[" * 100_000,
        '{"schema": "sbafab/manifest@2"}',
        '{"schema": "sbafab/manifest@1"}',
    ],
)
def test_a_folder_without_a_sound_manifest_is_one_sentence(
    text: str | None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if text is not None:
        (tmp_path / "manifest.json").write_text(text)
    with pytest.raises(SystemExit) as ended:
        main(["check", str(tmp_path)])
    out, err = capsys.readouterr()
    assert ended.value.code == 2
    assert out == ""
    assert err.startswith("sbafab: ")
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    "change",
    [
        lambda m: m.pop("layers"),
        lambda m: m.update(layers=[]),
        lambda m: m["layers"][2].update(thickness="thick"),
        lambda m: m["layers"][2].update(role="lid"),
        lambda m: m["interfaces"][2].pop("masks"),
        lambda m: [layer.update(file=None) for layer in m["layers"]],
    ],
)
def test_a_manifest_of_wrong_types_is_one_sentence(
    change: Callable[..., object], doctor: Doctor
) -> None:
    doctor.set_manifest(change)
    with pytest.raises(OutputError) as refused:
        check_folder(doctor.folder)
    assert "\n" not in str(refused.value)


def test_the_command_prints_findings_and_writes_nothing(
    doctor: Doctor, capsys: pytest.CaptureFixture[str]
) -> None:
    before = sorted(doctor.folder.rglob("*"))
    main_code(["check", str(doctor.folder), "--json"], 0)
    shown = json.loads(capsys.readouterr().out)
    assert shown["source"] == "as-built"
    # A design that declares no nets has no finding of that rule.
    rules = {"file-integrity", *rule_names()} - {"nets"}
    assert {finding["rule"] for finding in shown["findings"]} >= rules
    doctor.redraw(5, lambda r: r.moved(0.15, 0.0))
    main_code(["check", str(doctor.folder)], 1)
    assert "registration-nominal" in capsys.readouterr().out
    main_code(["check", str(doctor.folder), "--waive", "sealing"], 2)
    assert sorted(doctor.folder.rglob("*")) == before


def main_code(arguments: list[str], code: int) -> None:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert (ended.value.code or 0) == code
