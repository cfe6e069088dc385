"""Assemblies on the command line: checks between parts, folders, exit codes."""

from __future__ import annotations

import json

from tests.cli.conftest import Run


def test_check_names_designs_and_checks_between_parts(run: Run) -> None:
    code, out, _ = run("check brace --json")
    assert code == 0
    findings = json.loads(out)["findings"]
    bonds = {f["message"].partition(":")[0] for f in findings if f["rule"] == "bond-width"}
    assert bonds == {"radial-15mm", "3dof-15mm"}
    (brace,) = [f for f in findings if f["rule"] == "lumen-brace"]
    # Paper, Sec. 2.1: about 28; 28.06 less the films that melt to a fifth in the press.
    films = 3 * 0.038 * (1 - 0.204)
    assert 27.0 < brace["measured"] < 28.06 - 2 * films + 0.01


def test_generate_says_what_it_made_and_exits_1_on_a_failed_check(run: Run) -> None:
    small = "generate aperture --set parts.arm.set.stack.balloons=1"
    code, out, _ = run(small)
    assert code == 0
    for text in ("arm (3dof-15mm)", "magnet (magnet)", "sheets/TPE_1.dxf", "assembled.glb"):
        assert text in out, text
    code, out, _ = run("check out/aperture")
    assert code == 0
    assert "as built" in out
    code, out, _ = run(f"{small} --set parts.magnet.offset=[0,0]")
    assert code == 1
    assert "failed: seat. No cut files were written" in out
    assert "--waive seat" in out


def test_new_writes_an_assembly_to_start_from(run: Run) -> None:
    assert run("new standing robot.toml")[0] == 0
    code, out, _ = run("check robot.toml --json")
    assert code == 0
    assert json.loads(out)["source"] == "design"
