"""Checks of doctored folders: every fault is told, by the rule that is named for it.

Faults come with hashes put right, so that each has to be seen in the geometry itself.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

import pytest

from sbafab.cli import main
from sbafab.cutting.kerf import in_chords
from sbafab.design.files import rule_names
from sbafab.errors import OutputError
from sbafab.folders.check import check_folder
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


def test_an_unsound_file_is_told_with_its_layer_and_no_rule_is_run(doctor: Doctor) -> None:
    """Each kind of unsound file is in the catalogue of faults."""
    doctor.path(3).write_text("no drawing")
    found = check_folder(doctor.folder)
    (broken,) = [f for f in found if f.rule == "file-integrity" and f.verdict == "fail"]
    assert broken.where.layers == (3,)
    assert "003_TPE_wall.dxf" in broken.message
    told = {finding.rule: finding for finding in found}
    assert told["sealing"].verdict == "warn"
    assert "not run" in told["sealing"].message


WRONG: list[tuple[Callable[..., object], str]] = [
    (lambda m: m["layers"].insert(3, m["layers"].pop(5)), "layers.4.index is 6, not 4"),
    (lambda m: m["layers"][0].update(bores=["chamber1"]), "layers.1.bores has 1"),
    (lambda m: m["layers"][3].update(file="../outside.dxf"), "layers.4.file is"),
    (lambda m: m["files"].update({m["layers"][2]["file"]: "0" * 64}), "was changed"),
    (lambda m: m.pop("sheets"), "sheets is missing"),
]


@pytest.mark.parametrize(("change", "said"), WRONG)
def test_the_first_wrong_key_of_a_manifest_is_named(
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


def test_chords_that_no_property_states_depart_from_the_design(doctor: Doctor) -> None:
    doctor.redraw(3, lambda region: in_chords(region, "separator-mask", 0.005))
    doctor.rehash()
    assert failed(doctor.folder)["as-designed"].where.layers == (3,)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (None, "design.toml is missing"),
        ("name = ", "design.toml cannot be used"),
        ('family = "cubic"', "design.toml cannot be used"),
        ('family = "1dof"\nname = "x"\nbond.width = 9', "design.toml does not make a laminate"),
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
