"""``sbafab check --target-yield``."""

from __future__ import annotations

import json

import pytest

from sbafab.cli import main

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
    assert run([*SMALL, "--target-yield", "1"], capsys)[0] == 2


def test_an_assembly_has_no_yield_of_its_own(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["check", "brace", "--target-yield", "0.9"])
    assert ended.value.code == 2
    assert "check its parts' designs one by one" in capsys.readouterr().err
