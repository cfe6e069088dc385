"""Searches among real designs: what others have built, every design of a grid."""

from __future__ import annotations

import itertools
import json
from pathlib import Path

import pytest
from click.testing import CliRunner

import sbafab
from sbafab.cli import app
from sbafab.design.records import Free
from sbafab.runtime import ignore_progress
from sbafab.search.quantities import read_all
from sbafab.search.space import FindRequest, SearchSpace, evaluated

CASES = {
    # The paper's 1-DoF actuator (Sec. 4): pockets of 5 in an outline of 6.5, 7 mm at 10 kPa.
    "paper-1dof": (
        *("1dof-5mm", "--min", "stroke@10kPa=7", "--max", "outline_diameter=6.5"),
        *("--free", "chamber.diameter=4.6:5.4:0.2", "--free", "stack.balloons=5:8:1"),
    ),
    # Its radial expansion (Sec. 2.1, 5): passes deflated, and pushes on a lumen of one inch, which
    # leaves 5.036 mm to rise; 0.3 N a stack at 10 kPa are ours.
    "paper-radial": (
        *("radial-15mm", "--min", "inflated_diameter=25.4", "--max", "deflated_diameter=15.4"),
        *("--min", "force@5.036mm@10kPa=0.3"),
    ),
    # The small STIFF-FLOP arm, 14.3 mm across to pass a trocar of 15 (stiff-flop.eu, news).
    "trocar": (
        *("3dof-15mm", "--max", "outline_diameter=14.3", "--min", "lumen=2"),
        *("--min", "stroke@10kPa=15", "--free", "chamber.diameter=4:5.2:0.4"),
        *("--free", "stack.balloons=13:16:1", "--free", "lumen.diameter=2:2.4:0.4"),
    ),
}


@pytest.mark.long
@pytest.mark.parametrize("case", CASES)
def test_what_others_have_built_is_found_and_generates(case: str, tmp_path: Path) -> None:
    target = tmp_path / f"{case}.toml"
    # The manifest has the sizes of films that are not pressed yet.
    drawn = ["--set", "models.calibration=none", "--tries", "100"]
    ended = CliRunner().invoke(app, ["find", *CASES[case], *drawn, "--to", str(target), "--json"])
    assert ended.exit_code == 0, ended.output
    told = json.loads(ended.output)
    assert told["binds"]
    run = sbafab.cut(target, out=tmp_path)
    assert not run.failed
    sizes = run.manifest["sizes"]
    for name, value in told["best"]["figures"].items():
        if name in sizes:
            assert sizes[name] == pytest.approx(value, abs=1e-3)


@pytest.mark.long
def test_a_tip_with_lumen_stroke_and_force() -> None:
    """20 mm round, 3 mm lumen, 25 mm of stroke, and 3 N half way at 50 kPa."""
    found = sbafab.find(
        "3dof-15mm",
        least={"lumen": 3, "stroke": 25, "force@12.5mm@50kPa": 3},
        most={"outline_diameter": 20},
        free=["chamber.diameter=6.8:7:0.1", "lumen.diameter=3:3.2:0.2", "stack.balloons=12:13:1"],
    )
    assert found.holds
    assert found.tries == 12
    assert found.best.figures["lumen"] >= 3
    assert not sbafab.check("3dof-15mm", dict(found.best.values)).failed


@pytest.mark.long
@pytest.mark.parametrize(
    ("least", "best"),
    [({"stroke@10kPa": 10}, "mass"), ({"stroke@10kPa": 8, "force@4mm@20kPa": 0.4}, "height")],
)
def test_no_real_design_is_better(least: dict[str, float], best: str) -> None:
    free = (Free("chamber.diameter", 4.8, 7.2, 0.8), Free("stack.balloons", 4, 11, 1))
    requirements, goal = read_all([f"{name}={value}" for name, value in least.items()], [], best)
    request = FindRequest(sbafab.load("1dof-5mm"), requirements, goal, free)
    space = SearchSpace(request, free, ignore_progress)
    points = itertools.product(*map(range, space.counts))
    every = [evaluated(request, space.values(point)).rank for point in points]
    found = sbafab.find("1dof-5mm", least=least, best=best, free=free, tries=len(every) - 4)
    assert found.holds
    assert found.best.rank == min(every)
    assert found.tries < len(every)
