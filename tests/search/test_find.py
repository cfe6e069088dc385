"""Searches: against every design there is, for what cannot be, and for what others have built."""

from __future__ import annotations

import itertools
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

import sbafab
from sbafab.cli import app
from sbafab.design.form import Free
from sbafab.errors import DesignError
from sbafab.search import find as module
from sbafab.search.find import FindRequest, find
from sbafab.search.free import read_free
from sbafab.search.requirements import read_all
from sbafab.search.trial import Trial, Wanted

FREE = (Free("chamber.diameter", 3.0, 12.0, 0.1), Free("stack.balloons", 2, 20, 1))


def _made_up(wanted: Wanted, values: Mapping[str, Any], with_rules: bool = False) -> Trial:
    """Stroke 0.4 d n, mass d^2 n and a force that falls with stroke; small pockets cannot be."""
    d, n = values["chamber.diameter"], values["stack.balloons"]
    if d < 3.4:
        return Trial(values, missed=1e6, refused="too small")
    figures = {"stroke@50kPa": 0.4 * d * n, "mass": d * d * n / 1000, "width": d + 1.5}
    figures["force@5mm@50kPa"] = max(0.0, 0.04 * d * d * (1 - 5 / (0.4 * d * n)))
    missed = sum(-min(0.0, one.margin(figures[one.quantity.said])) for one in wanted.requirements)
    cost = wanted.goal.cost(figures[wanted.goal.quantity.said])
    return Trial(values, figures, {} if with_rules else None, missed, cost)


@pytest.mark.parametrize("stroke", [10, 25, 45])
@pytest.mark.parametrize("force", [0.5, 1.5, 3.0])
def test_it_finds_what_trying_every_design_finds(
    stroke: float, force: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "tried", _made_up)
    requirements, goal = read_all(
        [f"stroke@50kPa={stroke}", f"force@5mm@50kPa={force}"], ["width=12"], "mass"
    )
    request = FindRequest(sbafab.load("1dof-5mm"), requirements, goal, FREE)
    wanted = Wanted(request.design, requirements, goal)
    every = [
        _made_up(wanted, {"chamber.diameter": 3 + step / 10, "stack.balloons": n})
        for step, n in itertools.product(range(91), range(2, 21))
    ]
    best = min(every, key=lambda trial: trial.rank)
    found = find(request)
    assert found.holds == best.holds
    assert found.tries < 0.12 * len(every)
    if best.holds:
        assert found.best.cost <= 1.05 * best.cost
    else:
        assert found.best.missed <= best.missed + 0.01
    # Each step that would be better is said to break something, and it does.
    for bind in found.binds:
        values = {**found.best.values, bind.key: bind.value}
        assert not _made_up(wanted, values).holds
        assert bind.breaks
    for one, other in itertools.permutations(found.front, 2):
        worse = [one.cost >= other.cost]
        worse += [one.value(r) <= other.value(r) for r in requirements if r.at_least]
        worse += [one.value(r) >= other.value(r) for r in requirements if not r.at_least]
        assert not all(worse)


def test_the_same_search_finds_the_same() -> None:
    free = (Free("chamber.diameter", 2.3, 3.0, 0.1),)
    asked: dict[str, Any] = {"most": {"width": 14}, "best": "chamber.diameter", "free": free}
    first, second = (sbafab.find("1dof-5mm", **asked) for _ in range(2))
    assert first.best == second.best
    # The smallest pocket that a bore of 1.04 and a bond round it leave.
    assert first.best.values["chamber.diameter"] == 2.6


def test_where_nothing_meets_all_the_nearest_miss_is_said(tmp_path: Path) -> None:
    target = tmp_path / "found.toml"
    asked = ["find", "1dof-5mm", "--max", "outline_diameter=4", "--tries", "4", "-o", str(target)]
    ended = CliRunner().invoke(app, asked)
    assert ended.exit_code == 1
    assert "Nearest miss: chamber.diameter = 2.6" in ended.output
    assert "outline_diameter 4.1 mm, not at most 4 mm" in ended.output
    assert not target.exists()
    target.write_text("mine")
    ended = CliRunner().invoke(app, asked)
    assert ended.exit_code == 2
    assert "exists; name another file" in ended.output
    assert target.read_text() == "mine"


def test_keys_are_freed_and_fixed_by_name() -> None:
    design = sbafab.load("3dof-15mm")
    keys = [one.key for one in read_free(design, ["inlet.tab_length=3:5:0.5"], ["lumen.diameter"])]
    assert "inlet.tab_length" in keys
    assert "lumen.diameter" not in keys
    for free, fixed, said in (
        (["inlet.tab_length=3:5"], [], "LOW:HIGH:STEP"),
        (["inlet.tab=3:5:1"], [], "inlet.tab_length"),
        ([], ["order.copies"], "changes only"),
    ):
        with pytest.raises(DesignError, match=said):
            read_free(design, free, fixed)


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
    ended = CliRunner().invoke(app, ["find", template, *asked, "-o", str(target), "--json"])
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
