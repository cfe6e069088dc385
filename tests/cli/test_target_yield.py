"""``sbafab check --target-yield``."""

from __future__ import annotations

import json

from click.testing import CliRunner

from sbafab.cli import main

SMALL = ["check", "1dof-5mm", "--set", "stack.balloons=2", "--set", "rules.yield_builds=500"]
EARS = ["--set", "registration.method=ears"]


def test_a_missed_target_fails_and_is_advised_on() -> None:
    run = CliRunner().invoke(main, [*SMALL, "--target-yield", "0.9"])
    assert run.exit_code == 1
    assert "A yield of 0.9 needs bond.width = " in run.output


def test_a_reached_target_passes() -> None:
    run = CliRunner().invoke(main, [*SMALL, *EARS, "--target-yield", "0.5", "--json"])
    assert run.exit_code == 0
    advice = json.loads(run.output)["advice"]
    # The rules' own limits are enough.
    assert (advice["bond_width"], advice["mask_overhang"]) == (0.75, 0.5)


def test_a_share_of_one_or_more_is_refused() -> None:
    assert CliRunner().invoke(main, [*SMALL, "--target-yield", "1"]).exit_code == 2
