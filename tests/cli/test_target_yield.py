"""``sbafab check --target-yield``."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import pytest

from sbafab.actuators import load_design
from sbafab.cli import main
from sbafab.design.records import design_toml

SMALL = ["check", "1dof-5mm", "--set", "stack.balloons=2", "--set", "rules.yield_builds=500"]
ROUGH = ["--set", "registration.hand_placement=0.2", "--set", "registration.hand_turn=1"]
EARS = ["--set", "registration.method=ears"]


def run(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    return int(ended.value.code or 0), capsys.readouterr().out


def test_a_missed_target_fails_and_is_advised_on(capsys: pytest.CaptureFixture[str]) -> None:
    code, out = run([*SMALL, *ROUGH, "--target-yield", "0.9"], capsys)
    assert code == 1
    assert "A yield of 0.9 needs bond.width = " in out
    # A design may be cut that only misses what was asked; one that asks for it itself may not.
    assert "must not be cut" not in out
    ending = "Without --target-yield all rules pass, and it may be cut"
    assert " ".join(out.split()).endswith(ending)
    code, out = run([*SMALL, *ROUGH, "--set", "rules.target_yield=0.9"], capsys)
    assert code == 1
    assert "failed: registration-yield. It must not be cut" in out
    own = ["--set", "rules.target_yield=0.8", "--target-yield", "0.9"]
    assert "must not be cut" in run([*SMALL, *ROUGH, *own], capsys)[1]


def test_a_reached_target_passes(capsys: pytest.CaptureFixture[str]) -> None:
    code, out = run([*SMALL, *EARS, "--target-yield", "0.5", "--json"], capsys)
    assert code == 0
    advice = json.loads(out)["advice"]
    # The rules' own limits are enough.
    assert (advice["bond_width"], advice["mask_overhang"]) == (0.75, 0.5)


def test_a_share_of_one_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    for text in ("1", "0", "1.5", "-0.5", "120%", "much", "0.9 mm"):
        with pytest.raises(SystemExit) as ended:
            main([*SMALL, "--target-yield", text])
        assert ended.value.code == 2
        assert "must be a share above 0 and below 1" in capsys.readouterr().err


def test_an_assembly_has_no_yield_of_its_own(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["check", "brace", "--target-yield", "0.9"])
    assert ended.value.code == 2
    assert "check its parts' designs one by one" in capsys.readouterr().err


# ``sbafab generate --target-yield``.


def generated(*arguments: str) -> list[str]:
    return ["generate", "1dof-5mm", *SMALL[2:], *arguments]


def test_the_folder_holds_the_changed_design(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = generated("--target-yield", "95%", *ROUGH, "--json", "-o", str(tmp_path))
    code, out = run(asked, capsys)
    assert code == 0
    reached = json.loads(out)["yield"]
    changed = {row["key"]: row["to"] for row in reached["changes"]}
    assert changed == {"registration.method": "ears"}
    assert {row["name"] for row in reached["figures"]} >= {"outline diameter", "reference stroke"}
    design = tmp_path / "1dof-5mm" / "design.toml"
    written = tomllib.loads(design.read_text(encoding="utf-8"))
    assert written["registration"]["method"] == "ears"
    assert written["rules"]["target_yield"] == 0.95
    # The folder can be made again from its own design.
    assert design_toml(load_design(design)) == design.read_text(encoding="utf-8")


@pytest.mark.long
def test_what_was_changed_is_printed_with_its_cost(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out = run(generated("--target-yield", "0.9", *ROUGH, "-o", str(tmp_path)), capsys)
    lines = [" ".join(line.split()) for line in out.splitlines()]
    assert code == 0
    assert "registration.method channel-pin ears" in lines
    assert any(line.startswith("outline diameter, mm 6.5 6.5") for line in lines)
    assert "Changed for a yield of 0.9: registration.method = ears;" in " ".join(lines)


def test_what_is_not_reached_writes_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    keys = ("registration.method=channel-pin", "bond.width=0.75", "mask.overhang=0.5")
    fixed = [part for key in keys for part in ("--set", key)]
    out = tmp_path / "out"
    with pytest.raises(SystemExit) as ended:
        main(generated("--target-yield", "0.99", *ROUGH, *fixed, "-o", str(out)))
    assert ended.value.code == 1
    said = capsys.readouterr().err
    assert "1dof-5mm does not reach a yield of 0.99, and nothing was written: the best" in said
    assert not out.exists()


def test_an_assembly_is_not_generated_for_a_yield(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["generate", "brace", "--target-yield", "0.9"])
    assert ended.value.code == 2
    assert "generate its parts' designs one by one" in capsys.readouterr().err
