"""Searches among real designs: what others have built, every design of a grid, and Optuna."""

from __future__ import annotations

import itertools
import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

import sbafab
from sbafab.cli import app
from sbafab.design.records import Free
from sbafab.errors import DesignError
from sbafab.search.trial import SearchProblem, evaluated, read_all

CASES = {
    # The paper's 1-DoF actuator (Sec. 4): pockets of 5 in an outline of 6.5, 7 mm at 10 kPa.
    "paper-1dof": ("1dof-5mm", ["--min", "stroke@10kPa=7", "--max", "outline_diameter=6.5"]),
    # Its radial expansion (Sec. 2.1, 5): passes deflated, and pushes on a lumen of one inch, which
    # leaves 5.036 mm to rise; 0.3 N a stack at 10 kPa are ours.
    "paper-radial": (
        "radial-15mm",
        [
            *("--min", "inflated_diameter=25.4", "--max", "deflated_diameter=15.4"),
            *("--min", "force@5.036mm@10kPa=0.3"),
        ],
    ),
    # The small STIFF-FLOP arm, 14.3 mm across to pass a trocar of 15 (stiff-flop.eu, news).
    "trocar": (
        "3dof-15mm",
        ["--max", "outline_diameter=14.3", "--min", "lumen=2", "--min", "stroke@10kPa=15"],
    ),
}


@pytest.mark.long
@pytest.mark.parametrize("case", CASES)
def test_what_others_have_built_is_found_and_generates(case: str, tmp_path: Path) -> None:
    template, asked = CASES[case]
    target = tmp_path / f"{case}.toml"
    # The manifest has the sizes of films that are not pressed yet.
    drawn = ["--set", "models.calibration=none"]
    arguments = ["find", template, *asked, *drawn, "--to", str(target), "--json"]
    ended = CliRunner().invoke(app, arguments)
    assert ended.exit_code == 0, ended.output
    told = json.loads(ended.output)
    assert told["binds"]
    run = sbafab.generate(target, out=tmp_path)
    assert not run.failed
    sizes = run.manifest["sizes"]
    for name, value in told["best"]["figures"].items():
        if name in sizes:
            assert sizes[name] == pytest.approx(value, abs=1e-3)
    assert not sbafab.check_folder(run.folder).failed


@pytest.mark.long
def test_a_tip_with_lumen_stroke_and_force() -> None:
    """20 mm round, 3 mm lumen, 25 mm of stroke, and 3 N half way at 50 kPa."""
    found = sbafab.find(
        "3dof-15mm",
        least={"lumen": 3, "stroke": 25, "force@12.5mm@50kPa": 3},
        most={"outline_diameter": 20},
    )
    assert found.holds
    assert found.best.figures["lumen"] >= 3
    assert not sbafab.check("3dof-15mm", dict(found.best.values)).failed


@pytest.mark.long
@pytest.mark.parametrize(
    ("least", "best"),
    [({"stroke@10kPa": 10}, "mass"), ({"stroke@10kPa": 8, "force@4mm@20kPa": 0.4}, "height")],
)
def test_no_real_design_is_better(least: dict[str, float], best: str) -> None:
    free = (Free("chamber.diameter", 4.0, 9.0, 0.2), Free("stack.balloons", 2, 12, 1))
    found = sbafab.find("1dof-5mm", least=least, best=best, free=free)
    asked = [f"{name}={value}" for name, value in least.items()]
    requirements, goal = read_all(asked, [], best)
    wanted = SearchProblem(sbafab.load("1dof-5mm"), requirements, goal)
    every = (
        evaluated(wanted, {"chamber.diameter": round(4 + step / 5, 1), "stack.balloons": n})
        for step, n in itertools.product(range(26), range(2, 13))
    )
    lightest = min(trial.rank for trial in every)
    assert found.holds
    assert found.best.rank == lightest
    assert found.tries < 26 * 11


@pytest.mark.long
def test_optuna_finds_it_too_and_goes_on_from_its_storage(tmp_path: Path) -> None:
    pytest.importorskip("optuna")
    storage = f"sqlite:///{tmp_path / 'search.db'}"
    asked: dict[str, Any] = {"least": {"stroke@10kPa": 7}, "most": {"outline_diameter": 6.5}}
    plain = sbafab.find("1dof-5mm", **asked)
    first = sbafab.find("1dof-5mm", optuna=True, storage=storage, tries=30, **asked)
    more = sbafab.find("1dof-5mm", optuna=True, storage=storage, tries=60, **asked)
    assert more.holds
    assert more.best.rank <= first.best.rank
    assert more.best.cost <= 1.3 * plain.best.cost
    with pytest.raises(DesignError, match="--storage nowhere cannot be used"):
        sbafab.find("1dof-5mm", optuna=True, storage="nowhere", tries=4, **asked)
