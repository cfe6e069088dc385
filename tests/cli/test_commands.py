"""The commands: help, exit codes, the folders that they write, JSON for programs."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from sbafab.cli import COMMANDS, SUMMARIES
from sbafab.design.files import template_names
from tests.cli.conftest import Run

HELP = {
    "check": "cut files would state it",
    "cut": "Write the cut files",
    "press": "Write the schedule",
    "predict": "Write the prediction",
    "record": "Result of the leak test.",
    "sweep": "Accept the failure of this rule in every design",
    "find": "Folder in which found.toml is written",
    "picture": "NAME-flat.png",
}
"""Words of a command's own options, whose functions several commands share."""


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help(command: str, run: Run) -> None:
    code, out, _ = run(f"{command} --help")
    assert code == 0
    assert "Usage: sbafab" in out
    assert HELP.get(command, "") in " ".join(out.split())
    assert SUMMARIES[command] == COMMANDS[command].get_short_help_str(200)


def test_the_list_of_commands_is_in_groups(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    _, out, _ = run("--help")
    listed: dict[str, list[str]] = {}
    for line in out.partition("Options:")[2].splitlines():
        if line and not line.startswith(" "):
            listed[line.rstrip(":")] = []
        elif line[2:3].isalpha():
            assert not line.endswith("...")
            listed[list(listed)[-1]].append(line.split()[0])
    groups = ("Design", "Check", "Make", "Predict", "Search", "Measure")
    assert tuple(name for name in listed if name != "Not installed") == groups
    assert sorted(name for group in groups for name in listed[group]) == sorted(COMMANDS)


def test_generate_says_what_it_made(run: Run) -> None:
    code, out, _ = run("generate 1dof-5mm --set sheets.tpe.border=1")
    assert code == 0
    for text in ("23 in 7 patterns", "read back", "45 min", "2.555 kN", "1dof-5mm passed: "):
        assert text in out, text
    assert " ".join(out.split()).count("borders have no room for labels") == 1
    assert Path("out/1dof-5mm/manifest.json").is_file()


def test_a_failed_rule_is_exit_1_and_names_the_waiver(run: Run) -> None:
    code, out, _ = run("cut 1dof-5mm --set mask.overhang=0.47")
    assert code == 1
    assert "No cut files were written" in out
    assert "--waive mask-overhang" in out
    assert not Path("out/1dof-5mm/layers").exists()
    assert run("cut 1dof-5mm --set mask.overhang=0.47 --waive mask-overhang")[0] == 0
    assert Path("out/1dof-5mm/layers").is_dir()


def test_waivers_of_the_file_and_of_the_command_add_up(run: Run) -> None:
    waived = ("--set", 'rules.waive=["bond-width"]', "--waive", "tube-fit")
    assert run("check 1dof-5mm --set bond.width=0.72", *waived)[0] == 0


def test_check_prints_json(run: Run) -> None:
    code, out, _ = run("check 3dof-15mm --json")
    assert code == 0
    checks = json.loads(out)
    assert checks["source"] == "design"
    worst = {f["rule"]: f for f in checks["findings"] if f["verdict"] == "pass"}
    assert worst["bond-width"]["measured"] == pytest.approx(0.75, abs=1e-6)
    assert worst["mask-overhang"]["measured"] == pytest.approx(0.5, abs=1e-6)
    waived = [f for f in checks["findings"] if f["verdict"] == "waived"]
    assert waived
    assert all("pin" in finding["message"] for finding in waived)
    code, out, _ = run("check 1dof-5mm --set stack.balloons=1 --set mask.overhang=0.47 --json")
    found = json.loads(out)
    assert code == 1
    assert (found["schema"], found["design"]) == ("sbafab/checks@1", "1dof-5mm")
    failed = {f["rule"] for f in found["findings"] if f["verdict"] == "fail"}
    assert (found["summary"]["holds"], found["summary"]["fail"]) == (False, len(failed))


def test_templates_schema_and_new(run: Run) -> None:
    code, out, _ = run("new")
    assert code == 0
    assert [line.split()[0] for line in out.splitlines()] == [*template_names(), "coupon", "kit"]
    _, out, _ = run("schema")
    records = json.loads(out)["$defs"]
    assert {"OneDofDesign", "LobedDesign", "RadialDesign", "Assembly"} <= set(records)
    unsaid = [
        f"{name}.{key}"
        for name, record in records.items()
        for key, value in record["properties"].items()
        if not (value | records.get(value.get("$ref", "").split("/")[-1], {})).get("description")
    ]
    assert unsaid == []
    assert run("new 1dof-5mm")[0] == 0
    assert run("check 1dof-5mm.toml")[0] == 0


def test_keys_are_explained_without_the_marks_of_source_text(run: Run) -> None:
    code, out, _ = run("explain seams")
    assert code == 0
    assert "by their numbers in layers" in " ".join(out.split())
