"""The commands: exit codes, one sentence for bad input, JSON for programs."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from sbafab.cli import COMMANDS, SUMMARIES, main
from sbafab.design.files import template_names


def run(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    out, err = capsys.readouterr()
    return int(ended.value.code or 0), out, err


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run([command, "--help"], capsys)
    assert code == 0
    assert "Usage: sbafab" in out


def test_the_list_of_commands_is_in_groups(capsys: pytest.CaptureFixture[str]) -> None:
    _, out, _ = run(["--help"], capsys)
    listed: dict[str, list[str]] = {}
    for line in out.partition("Options:")[2].splitlines():
        if line and not line.startswith(" "):
            listed[line.rstrip(":")] = []
        elif line[2:3].isalpha():
            listed[list(listed)[-1]].append(line.split()[0])
    groups = ("Design", "Check", "Make", "Predict", "Search", "Measure")
    assert tuple(name for name in listed if name != "Not installed") == groups
    assert sorted(name for group in groups for name in listed[group]) == sorted(COMMANDS)


@pytest.mark.parametrize("command", COMMANDS)
def test_the_list_of_commands_quotes_their_help(command: str) -> None:
    assert SUMMARIES[command] == COMMANDS[command].get_short_help_str(200)


CUT_ONE = ["cut", "1dof-5mm", "--set", "bore.diameter=1"]


@pytest.mark.parametrize(
    "arguments",
    [
        ["check", "nosuch"],
        ["check", "3dof-15mm", "--set", "bond.widht=1"],
        ["check", "3dof-15mm", "--set", "bond.width=-1"],
        ["generate", "3dof-15mm", "--set", "name=../x"],
        ["generate", "3dof-15mm", "--waive", "nonsense"],
        ["cut", "1dof-5mm", "--set", "bore.diameter=9"],
        ["press", "1dof-5mm", "--set", "press.temperature_c=110"],
        ["new", "nosuch"],
        ["cut", "1dof-5mm", "--copies", "0"],
        ["cut", "1dof-5mm", "--copies", "900", "--set", "sheets.tpe.most=1"],
        ["cut", "1dof-5mm", "--set", "sheets.ptfe.border=80"],
        ["cut", "1dof-5mm", "--set", "sheets.tpe.spacing=0"],
        ["cut", "1dof-5mm", "--set", "sheets.tpe.spacing=90", "--set", "sheets.tpe.most=3"],
        ["cut", "1dof-5mm", "--set", "sheets.tpe.pins=[[1,2]]"],
        ["cut", "1dof-5mm", "--set", "laser.kerf_tpe=-0.1"],
        ["cut", "1dof-5mm", "--set", "laser.kerf_tpe=2"],
        [*CUT_ONE, "--waive", "film-limits", "--set", "laser.kerf_tpe=1"],
        ["mesh", "1dof-5mm", "--h", "5"],
        ["mesh", "1dof-5mm", "--fill", "30"],
        ["mesh", "1dof-5mm", "--fill", "nosuch=3"],
        ["mesh", "3dof-15mm", "--symmetry", "quarter"],
        ["nest", "1dof-5mm", "1dof-5mm"],
        ["nest", "1dof-5mm", "nosuch"],
        ["nest", "1dof-5mm", "--name", "a/b"],
    ],
)
def test_bad_input_is_one_sentence_and_exit_2(
    arguments: list[str],
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    code, out, err = run(arguments, capsys)
    assert code == 2
    assert out == ""
    assert err.startswith("sbafab: ")
    assert err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "command"),
    [
        (["frobnicate"], "sbafab"),
        (["check"], "sbafab check"),
        (["check", "x", "--bogus"], "sbafab check"),
        (["generate", "x", "--copies", "1e3"], "sbafab generate"),
        (["generate", "1dof-5mm", "--chord-error", "0.01"], "sbafab generate"),
        (["kerf", "x.csv", "--resolution", "nan"], "sbafab kerf"),
    ],
)
def test_bad_usage_is_one_sentence_and_exit_2(
    arguments: list[str], command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out, err = run(arguments, capsys)
    assert code == 2
    assert out == ""
    assert err.startswith("sbafab: ")
    assert err.endswith((f"; see {command} --help\n", f"? See {command} --help\n"))
    assert err.count("\n") == 1


def test_no_command_is_exit_2_and_shows_the_help(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = run([], capsys)
    assert code == 2
    assert "Usage: sbafab" in out + err


def test_generate_says_what_it_made(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    code, out, _ = run(["generate", "1dof-5mm", "-o", str(tmp_path)], capsys)
    assert code == 0
    for text in ("23 in 7 patterns", "read back", "45 min", "2.555 kN", "1dof-5mm passed: "):
        assert text in out, text
    assert (tmp_path / "1dof-5mm" / "manifest.json").is_file()


def test_a_failed_rule_is_exit_1_and_names_the_waiver(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    arguments = ["cut", "1dof-5mm", "-o", str(tmp_path), "--set", "mask.overhang=0.47"]
    code, out, _ = run(arguments, capsys)
    assert code == 1
    assert "No cut files were written" in out
    assert "--waive mask-overhang" in out
    assert not (tmp_path / "1dof-5mm" / "layers").exists()
    code, out, _ = run([*arguments, "--waive", "mask-overhang"], capsys)
    assert code == 0
    assert (tmp_path / "1dof-5mm" / "layers").is_dir()


def test_waivers_of_the_file_and_of_the_command_add_up(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    arguments = [
        *("check", "1dof-5mm", "--set", "bond.width=0.72", "--set", 'rules.waive=["bond-width"]'),
        *("--waive", "tube-fit"),
    ]
    code, _, _ = run(arguments, capsys)
    assert code == 0


def test_check_prints_json(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(["check", "3dof-15mm", "--json"], capsys)
    assert code == 0
    checks = json.loads(out)
    assert checks["source"] == "design"
    worst = {f["rule"]: f for f in checks["findings"] if f["verdict"] == "pass"}
    assert worst["bond-width"]["measured"] == pytest.approx(0.75, abs=1e-6)
    assert worst["mask-overhang"]["measured"] == pytest.approx(0.5, abs=1e-6)
    waived = [f for f in checks["findings"] if f["verdict"] == "waived"]
    assert waived
    assert all("pin" in finding["message"] for finding in waived)


def test_generate_prints_json(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    code, out, _ = run(["press", "1dof-5mm", "--json", "-o", str(tmp_path)], capsys)
    assert code == 0
    result = json.loads(out)
    assert result["failed"] is False
    assert "press.json" in result["files"]


def test_templates_schema_and_new(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    code, out, _ = run(["new"], capsys)
    assert code == 0
    names = [line.split()[0] for line in out.splitlines()]
    assert names == [*template_names(), "coupon", "kit"]
    assert run(["new", "1dof-5mm", "--json"], capsys)[0] == 2
    assert list(tmp_path.iterdir()) == []
    code, out, _ = run(["schema"], capsys)
    assert code == 0
    records = json.loads(out)["$defs"]
    assert {"OneDofDesign", "LobedDesign", "RadialDesign", "Assembly"} <= set(records)
    unsaid = [
        f"{name}.{key}"
        for name, record in records.items()
        for key, value in record["properties"].items()
        if not (value | records.get(value.get("$ref", "").split("/")[-1], {})).get("description")
    ]
    assert unsaid == []
    code, out, _ = run(["new", "1dof-5mm"], capsys)
    assert code == 0
    code, _, _ = run(["check", "1dof-5mm.toml"], capsys)
    assert code == 0


def test_a_sheet_without_room_for_its_label_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    narrow = ["--set", "sheets.tpe.border=1"]
    _, out, _ = run(["generate", "1dof-5mm", "-o", str(tmp_path), *narrow], capsys)
    assert " ".join(out.split()).count("borders have no room for labels") == 1


@pytest.mark.parametrize(
    ("arguments", "says", "exit_code"),
    [
        (["1dof-5mm", "--set", "sheets.tpe.width=25"], "does not fit the usable 5.0 x 132.4 mm", 1),
        (["brace", "--set", "sheets.tpe.width=30"], "does not fit the usable 10.0 x 132.4 mm", 1),
        (["1dof-5mm", "--set", "order.copies=900"], "sheets.tpe.most allows 20", 2),
    ],
)
def test_check_refuses_what_generate_would_refuse(
    arguments: list[str],
    says: str,
    exit_code: int,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    # A part that no sheet takes ends as one that the press does not take: exit code 1.
    code, out, said_by_check = run(["check", *arguments], capsys)
    assert (code, out) == (exit_code, "")
    assert says in said_by_check
    code, _, said_by_generate = run(["generate", *arguments, "-o", str(tmp_path)], capsys)
    assert code == exit_code
    # A slow machine may say how far it was before.
    assert said_by_generate.splitlines()[-1] == said_by_check.splitlines()[-1]
