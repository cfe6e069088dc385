"""Assemblies on the command line: what is said, exit codes, commands that take designs only."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from sbafab.cli import main


def run(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    out, err = capsys.readouterr()
    return int(ended.value.code or 0), out, err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["check", "brace", "--set", "parts.arm.on=tubs"], "did you mean tube?"),
        (["check", "brace", "--set", "parts.arm.at=top"], '"start", "end", "outside"'),
        (["check", "brace", "--set", "parts.arm.design=nosuch"], "parts.arm: 'nosuch' is neither"),
        (["generate", "brace", "--set", "parts.tube.kind=pipe"], "parts.tube.kind = 'pipe'"),
        (["generate", "brace", "--set", "parts.tube.on=cup"], "no tube can be fixed on a cup"),
        (
            ["generate", "brace", "--waive", "seats"],
            "--waive 'seats': no rule has that name; did you mean seat",
        ),
        (["generate", "brace", "--set", "parts=1"], "add [parts.NAME]"),
        (["generate", "standing", "--copies", "0"], "order.copies = 0"),
        (["generate", "brace", "--set", "parts.arm.set.laser.kerf_tpe=0.1"], "laser differs"),
        (["press", "brace"], "is an assembly of several designs"),
        (["mesh", "brace"], "is an assembly of several designs"),
        (["cut", "brace"], "is an assembly of several designs"),
        (["picture", "brace"], "is an assembly of several designs"),
        (["simulate", "brace", "--with", "sofa"], "is an assembly of several designs"),
        (["nest", "brace", "1dof-5mm"], "is an assembly of several designs"),
    ],
)
def test_bad_input_is_one_sentence_and_exit_2(
    arguments: list[str],
    said: str,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    code, out, err = run(arguments, capsys)
    assert (code, out) == (2, "")
    assert err.startswith("sbafab: ")
    assert err.count("\n") == 1
    assert said in err
    assert list(tmp_path.iterdir()) == []


def test_check_names_designs_and_checks_between_parts(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(["check", "brace", "--json"], capsys)
    assert code == 0
    findings = json.loads(out)["findings"]
    assert {f["message"].partition(":")[0] for f in findings if f["rule"] == "bond-width"} == {
        "radial-15mm",
        "3dof-15mm",
    }
    (brace,) = [f for f in findings if f["rule"] == "lumen-brace"]
    # Paper, Sec. 2.1: about 28; 28.06 less the films that melt to a fifth in the press.
    films = 3 * 0.038 * (1 - 0.204)
    assert 27.0 < brace["measured"] < 28.06 - 2 * films + 0.01


def test_generate_says_what_it_made_and_exits_1_on_a_failed_check(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    small = ["-o", str(tmp_path), "--set", "parts.arm.set.stack.balloons=1"]
    code, out, _ = run(["generate", "aperture", *small], capsys)
    assert code == 0
    for text in ("arm (3dof-15mm)", "magnet (magnet)", "sheets/TPE_1.dxf", "assembled.glb"):
        assert text in out, text
    code, out, _ = run(["check", str(tmp_path / "aperture")], capsys)
    assert code == 0
    assert "as built" in out
    code, out, _ = run(
        ["generate", "aperture", *small, "--set", "parts.magnet.offset=[0,0]"], capsys
    )
    assert code == 1
    assert "failed: seat. No cut files were written" in out
    assert "--waive seat" in out


def test_new_writes_an_assembly_to_start_from(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    code, _, _ = run(["new", "standing", "robot.toml"], capsys)
    assert code == 0
    code, out, _ = run(["check", "robot.toml", "--json"], capsys)
    assert code == 0
    assert json.loads(out)["source"] == "design"


def test_an_assembly_takes_no_decks(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    code, _, err = run(["generate", "brace", "--decks", "-o", str(tmp_path)], capsys)
    assert code == 2
    assert "--decks goes with one design" in err
