"""Searches: against every design there is, for what cannot be, and what they tell."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from statistics import NormalDist
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result

import sbafab
from sbafab.cli import app
from sbafab.design.records import Free
from sbafab.errors import DesignError
from sbafab.models.calibration import UNKNOWNS, calibration_of
from sbafab.models.figures import Factors
from sbafab.search import space as module
from sbafab.search.find import FoundDesign, RangeEnd, find, free_keys
from sbafab.search.quantities import QUANTITIES, read_all, read_quantity
from sbafab.search.space import FindRequest, Trial, figure_text, free_of, read_free

FREE = (Free("chamber.diameter", 3.0, 12.0, 0.1), Free("stack.balloons", 2, 20, 1))
Search = Callable[..., FoundDesign]


def _made_up(wanted: FindRequest, values: Mapping[str, Any], with_rules: bool = False) -> Trial:
    """Stroke 0.4 d n, mass d^2 n and a force that falls with stroke; small pockets cannot be."""
    d, n = values["chamber.diameter"], values["stack.balloons"]
    if d < 3.4:
        return Trial(values, missed=1e6, refused="too small")
    figures = {"stroke@50kPa": 0.4 * d * n, "mass": d * d * n / 1000, "width": d + 1.5}
    figures["force@5mm@50kPa"] = max(0.0, 0.04 * d * d * (1 - 5 / (0.4 * d * n)))
    missed = sum(-min(0.0, one.margin(figures[one.quantity.label])) for one in wanted.requirements)
    cost = wanted.goal.cost(figures[wanted.goal.quantity.label])
    return Trial(values, figures, {} if with_rules else None, missed, cost)


def _request(
    least: Sequence[str] = (),
    most: Sequence[str] = (),
    best: str = "mass",
    free: tuple[Free, ...] | None = FREE,
    **more: Any,
) -> FindRequest:
    return FindRequest(sbafab.load("1dof-5mm"), *read_all(least, most, best), free, **more)


@pytest.fixture
def search(monkeypatch: pytest.MonkeyPatch) -> Search:
    """A search among made-up designs."""
    monkeypatch.setattr(module, "evaluated", _made_up)
    return lambda *limits, **more: find(_request(*limits, **more))


def run(*arguments: str, to: Path) -> Result:
    return CliRunner().invoke(app, ["find", "1dof-5mm", *arguments, "--to", str(to)])


@pytest.mark.parametrize("stroke", [10, 25, 45])
@pytest.mark.parametrize("force", [0.5, 1.5, 3.0])
def test_it_finds_what_trying_every_design_finds(
    stroke: float, force: float, search: Search
) -> None:
    limits = [f"stroke@50kPa={stroke}", f"force@5mm@50kPa={force}"], ["width=12"]
    request = _request(*limits)
    every = [
        _made_up(request, {"chamber.diameter": 3 + step / 10, "stack.balloons": n})
        for step, n in itertools.product(range(91), range(2, 21))
    ]
    best = min(every, key=lambda trial: trial.rank)
    found = search(*limits)
    assert found.holds == best.holds
    assert found.tries < 0.14 * len(every)
    if best.holds:
        assert found.best.rank == best.rank
    else:
        assert found.best.missed <= best.missed + 0.01
    # Each step that would be better is said to break something, and it does.
    for bind in found.binds:
        assert not _made_up(request, {**found.best.values, bind.key: bind.value}).holds
        assert bind.breaks
    for one, other in itertools.permutations(found.front, 2):
        worse = [one.cost >= other.cost]
        worse += [one.value(r) <= other.value(r) for r in request.requirements if r.at_least]
        worse += [one.value(r) >= other.value(r) for r in request.requirements if not r.at_least]
        assert not all(worse)


def test_what_is_missed_by_a_few_designs_alone_ends_with_the_nearest() -> None:
    """Two of them: once they are tried, nothing is left to try."""
    free = (Free("stack.balloons", 3, 4, 1),)
    found = sbafab.find("1dof-5mm", least={"stroke@10kPa": 1000}, free=free)
    assert not found.holds
    assert (found.tries, found.is_cut_short) == (2, False)
    assert found.best.values == {"stack.balloons": 4}
    assert [(one.key, one.value) for one in found.ends] == [("stack.balloons", 4)]


def test_a_range_of_the_family_widens_where_the_best_lies_beyond(search: Search) -> None:
    """With 20 balloons, 0.4 d n = 200 takes d = 25, beyond 16."""
    own = tuple(sbafab.load("1dof-5mm").free[:2])
    found = search(["stroke@50kPa=200"], free=own)
    assert found.holds
    assert found.best.values == {"chamber.diameter": 25.0, "stack.balloons": 20}
    found = search(["stroke@50kPa=200"], free=tuple(replace(one, widens=False) for one in own))
    assert not found.holds
    ends = {(one.key, one.value) for one in found.ends}
    assert ends == {("chamber.diameter", 16.0), ("stack.balloons", 20)}


@pytest.mark.usefixtures("search")
def test_no_more_designs_are_tried_than_asked_for() -> None:
    told: list[tuple[int, int]] = []
    request = _request(["stroke@50kPa=25"], tries=30)
    found = find(request, lambda _, done, total: told.append((done, total)))
    assert found.tries == 30
    assert found.is_cut_short
    assert told == [(done, 30) for done in range(30)]
    for tries in range(12, 80):
        for stroke in (25, 90, 500):
            assert find(_request([f"stroke@50kPa={stroke}"], tries=tries)).tries <= tries


def test_the_front_is_shown_from_end_to_end(search: Search) -> None:
    found = search(["stroke@50kPa=10"])
    assert len(found.front) == 8 < found.on_front
    strokes = [one.figures["stroke@50kPa"] for one in found.front]
    assert strokes == sorted(strokes)
    # The longest of all, 0.4 x 12 x 20, is on every front.
    assert strokes[-1] == pytest.approx(96)


def test_what_stops_the_nearest_miss_is_told(search: Search) -> None:
    """Least width of what can be made is 3.4 + 1.5; smaller pockets cannot be."""
    found = search([], ["width=4"])
    assert not found.holds
    assert found.best.values["chamber.diameter"] == 3.4
    told = [(one.key, one.value, one.breaks) for one in found.binds]
    assert told == [("chamber.diameter", 3.3, "too small")]


@pytest.mark.parametrize(
    ("low", "high", "goal", "bound"),
    [(3.3, 5.0, "mass", ["chamber.diameter"]), (3.0, 3.4, "stroke@50kPa", [])],
)
def test_what_cannot_be_made_binds_on_the_way_to_the_goal_alone(
    low: float, high: float, goal: str, bound: list[str], search: Search
) -> None:
    """Pockets of 3.3 cannot be made: that stops the least pocket, and not one that is to grow."""
    free = (Free("chamber.diameter", low, high, 0.1), Free("stack.balloons", 5, 5, 1))
    found = search(best=goal, free=free)
    assert found.best.values["chamber.diameter"] == 3.4
    assert [one.key for one in found.binds] == bound


def test_rules_are_asked_of_few_designs(monkeypatch: pytest.MonkeyPatch) -> None:
    """All nine are tried, each better than the one before: only the best is asked for its rules."""
    asked: list[int] = []

    def counted(wanted: FindRequest, values: Mapping[str, Any], with_rules: bool = False) -> Trial:
        if with_rules:
            asked.append(values["stack.balloons"])
        return _made_up(wanted, {"chamber.diameter": 5.0, **values}, with_rules)

    monkeypatch.setattr(module, "evaluated", counted)
    found = find(_request(best="stroke@50kPa", free=(Free("stack.balloons", 2, 10, 1),)))
    assert found.best.figures["stroke@50kPa"] == pytest.approx(20)
    # And a step beyond its range, which would be better.
    assert set(asked) == {10, 11}


def test_what_equals_the_best_is_told_by_its_mass(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every design has the same width; more balloons weigh more, and give more stroke."""

    def flat(wanted: FindRequest, values: Mapping[str, Any], with_rules: bool = False) -> Trial:
        n = values["stack.balloons"]
        figures = {"width": 5.0, "stroke@10kPa": 1.0 * n}
        return Trial(values, figures, {} if with_rules else None, max(0.0, 4 - n), 5.0, 10.0 + n)

    monkeypatch.setattr(module, "evaluated", flat)
    found = find(
        _request(["stroke@10kPa=4"], best="width", free=(Free("stack.balloons", 2, 9, 1),))
    )
    assert found.best.values == {"stack.balloons": 4}
    assert [one.values["stack.balloons"] for one in found.front] == [4, 9]


@pytest.mark.parametrize(
    ("low", "above", "wider"), [(7, True, (7, 8)), (7, False, (6, 7)), (1, False, (0, 1))]
)
def test_a_wider_range_is_never_the_same(low: int, above: bool, wider: tuple[int, int]) -> None:
    assert RangeEnd("stack.balloons", low, low, low, 1, above).wider == wider


def test_the_same_search_finds_the_same() -> None:
    free = (Free("chamber.diameter", 2.3, 3.0, 0.1),)
    asked: dict[str, Any] = {"most": {"width": 14}, "best": "chamber.diameter", "free": free}
    first, second = (sbafab.find("1dof-5mm", **asked) for _ in range(2))
    assert first.best == second.best
    # The smallest pocket that a bore of 1.04 and a bond round it leave.
    assert first.best.values["chamber.diameter"] == 2.6


# Real designs.


def test_where_nothing_meets_all_the_nearest_miss_is_said(tmp_path: Path) -> None:
    target = tmp_path / "found.toml"
    asked = ("--max", "outline_diameter=4", "--tries", "4")
    ended = run(*asked, to=target)
    assert ended.exit_code == 1
    assert "Nearest miss: chamber.diameter = 2.6" in ended.output
    assert "outline_diameter 4.1 mm; at most 4 mm: MISSED" in ended.output
    assert not target.exists()
    target.write_text("mine")
    ended = run(*asked, to=target)
    assert ended.exit_code == 2
    assert "exists; choose another folder" in ended.output
    assert "trying designs" not in ended.output
    assert target.read_text() == "mine"


def test_paths_of_a_found_design_start_beside_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A kit named on the command line, and one beside the design: both move with the folder."""
    lab = tmp_path / "lab"
    lab.mkdir()
    for name in ("mine.toml", "other.toml"):
        assert CliRunner().invoke(app, ["new", "kit", str(lab / name)]).exit_code == 0
    (lab / "tip.toml").write_text('kit = "mine.toml"\n' + sbafab.template("1dof-5mm"))
    monkeypatch.chdir(tmp_path)
    asked = ["find", "lab/tip.toml", "--max", "mass=1", "--tries", "4", "--free"]
    asked += ["chamber.diameter=4:5:1", "--set", "stack.balloons=2"]
    for more, folder, kit in (
        ([], "lab/new", "../mine.toml"),
        ([], "lab", "mine.toml"),
        (["--set", "kit=lab/other.toml"], "found", "../lab/other.toml"),
    ):
        ended = CliRunner().invoke(app, [*asked, *more, "-o", folder])
        assert ended.exit_code == 0, ended.output
        assert f'kit = "{kit}"' in Path(folder, "found.toml").read_text()
    (tmp_path / "moved").mkdir()
    lab.rename(tmp_path / "moved" / "lab")
    for name in ("lab/found.toml", "lab/new/found.toml"):
        assert sbafab.load(tmp_path / "moved" / name).stack.balloons == 2


def test_a_file_is_called_as_asked_and_its_design_loads(tmp_path: Path) -> None:
    asked = ("--max", "mass=1", "--tries", "4", "--set", "stack.balloons=4")
    ended = CliRunner().invoke(app, ["find", "1dof-5mm", *asked, "-o", str(tmp_path / "new")])
    assert ended.exit_code == 0, ended.output
    assert sbafab.load(tmp_path / "new" / "found.toml").name == "found"
    ended = run(*asked, to=tmp_path / "my file.toml")
    assert ended.exit_code == 0, ended.output
    assert f"sbafab generate '{tmp_path / 'my file.toml'}'" in ended.output
    design = sbafab.load(tmp_path / "my file.toml")
    assert design.name == "my-file"
    # A key that is set stays.
    assert design.stack.balloons == 4
    assert "stack.balloons" not in ended.output.partition("from 1dof-5mm")[0]


TAPER = ("--set", "chamber.diameter=[8, 7, 6]", "--set", "stack.balloons=3")


def test_a_taper_is_scaled_as_a_whole(tmp_path: Path) -> None:
    asked = (*TAPER, "--min", "reference_stroke=4", "--tries", "40")
    ended = run(*asked, "--free", "chamber.diameter=6:12:0.2", to=tmp_path / "found.toml")
    assert ended.exit_code == 0, ended.output
    diameters: Any = sbafab.load(tmp_path / "found.toml").chamber.diameter  # type: ignore[attr-defined]
    first, second, third = diameters
    assert (second / first, third / first) == pytest.approx((7 / 8, 6 / 8), abs=0.002)
    # Sec. 4.6: 17.5 mm of 15 balloons of d = 5; the largest diameter goes in steps of 0.2.
    stroke = 17.5 / 15 / 5 * sum(diameters)
    assert 4 <= stroke < 4 * (1 + 0.2 / first) + 0.01
    assert f"reference_stroke {stroke:.4g} mm; at least 4 mm" in ended.output
    refused = run(*asked, "--free", "stack.balloons=2:4:1", to=tmp_path / "b.toml")
    assert refused.exit_code == 2
    assert "which a search scales; omit stack.balloons" in refused.output


def test_the_help_lists_every_quantity_with_its_unit() -> None:
    said = CliRunner().invoke(app, ["find", "--help"]).output
    lines = [" ".join(line.split()) for line in said.splitlines()]
    for one in QUANTITIES:
        assert any(line.startswith(f"{one.written} {one.unit}".strip()) for line in lines), one
        kpa = "@-5kPa" if one.written == "slip@P" else "@5kPa"
        name = one.written.replace("@H@P", "@1mm@5kPa").replace("@P", kpa)
        assert read_quantity(name).unit == one.unit


@pytest.mark.parametrize("sure", [None, 0.9])
def test_a_requirement_holds_with_a_probability(sure: float | None) -> None:
    """Heights are lognormal: 2 n - 1 masks, and 2 n films times the press factor, and what that
    and the number of balloons, 15 in the evidence, leave uncertain.
    """
    design = sbafab.load("1dof-5mm")
    free = (Free("stack.balloons", 2, 20, 1),)
    found = sbafab.find(design, most={"height": 0.9}, best="stroke", free=free, sure=sure)
    calibration = calibration_of(design)
    assert calibration is not None
    row = [unknown.field for unknown in UNKNOWNS].index("press_factor")
    missed = calibration.discrepancy["flat height"]
    quantile = NormalDist().inv_cdf(sure or 0.5)
    change, moved = calibration.shifted()[row]

    def height(balloons: int, factors: Factors = calibration.factors) -> float:
        films = 2 * balloons * 0.038 * factors.press_factor
        return films + (2 * balloons - 1) * 0.025

    def deviation(balloons: int) -> float:
        slope = math.log(height(balloons, moved) / height(balloons)) / change
        spread = slope * math.sqrt(calibration.covariance[row][row])
        return math.hypot(spread, missed, 0.05 * math.log2(max(15 / balloons, balloons / 15)))

    bounds = {n: height(n) * math.exp(quantile * deviation(n)) for n in range(2, 21)}
    most = max(n for n, bound in bounds.items() if bound <= 0.9)
    assert found.best.values == {"stack.balloons": most}
    (requirement,) = found.request.requirements
    assert found.best.value(requirement) == pytest.approx(height(most))
    assert found.best.judged(requirement) == pytest.approx(bounds[most], rel=1e-6)
    low, high = found.intervals["height"]
    factor = math.exp(NormalDist().inv_cdf(0.95) * deviation(most))
    # No film is thinner than none.
    assert low == pytest.approx(max(height(most) / factor, (2 * most - 1) * 0.025))
    assert high == pytest.approx(height(most) * factor)
    text = figure_text(found.request, found.best, requirement)
    assert ("or less with" in text) == (sure is not None)


def test_a_bound_is_shown_beside_its_median(tmp_path: Path) -> None:
    target = tmp_path / "found.toml"
    asked = ("--max", "height=1.5", "--free", "stack.balloons=3:6:1", "--fix", "chamber.diameter")
    ended = run(*asked, "--sure", "90%", "--json", to=target)
    assert ended.exit_code == 0, ended.output
    said = json.loads(ended.stdout)
    (row,) = said["requirements"]
    assert said["sure"] == 0.9
    assert row["median"] == said["best"]["figures"]["height"] < row["bound"] < row["limit"]
    low, high = said["intervals"]["height"]
    assert row["bound"] < high
    head = target.read_text().splitlines()[1]
    assert f"{row['median']:.4g} mm in the median, {row['bound']:.4g} mm or less with 90 %" in head
    ended = run(*asked, to=tmp_path / "other.toml")
    shown = f"{low:.3g} to {high:.3g}"
    assert f"height {row['median']:.4g} mm ({shown}); at most 1.5 mm" in ended.output
    assert "meets the requirement in the median. Next" in " ".join(ended.output.split())


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"tries": 0}, "at least 4"),
        ({"sure": 0.5}, "above 0.5 and below 1"),
        ({"free": ()}, "1dof-5mm has no free key"),
        ({"free": FREE, "least": {"chamber.diameter": 20}}, "its range is 3 to 12"),
    ],
)
def test_what_a_program_asks_is_checked_too(asked: dict[str, Any], said: str) -> None:
    with pytest.raises(DesignError, match=said):
        sbafab.find("1dof-5mm", **asked)


def test_a_requirement_beyond_a_range_that_widens_moves_it() -> None:
    found = sbafab.find("1dof-5mm", least={"chamber.diameter": np.int64(20)}, tries=12)
    assert found.best.values["chamber.diameter"] == 20
    for least, most, ends in (("2", "9", (2.6, 9.0)), ("3", "20", (3.0, 16.0)), ("1", "2", (2, 2))):
        limits = [f"chamber.diameter={least}"], [f"chamber.diameter={most}"]
        free = free_keys(_request(*limits, free=None))[0]
        assert (free.low, free.high) == ends


def test_tabs_in_the_way_are_named(tmp_path: Path) -> None:
    """Two tabs of 5 mm, or three, leave nothing within 10."""
    asked = ("--max", "overall_diameter=10", "--tries", "4")
    ended = run(*asked, to=tmp_path / "found.toml")
    assert ended.exit_code == 1
    assert ended.stderr.startswith("note: overall_diameter counts the inlet tabs; use outline_diam")
    freed = run(*asked, "--free", "inlet.tab_length=3:5:1", to=tmp_path / "found.toml")
    assert "inlet tabs" not in freed.output


def test_keys_are_freed_and_fixed_by_name() -> None:
    design = sbafab.load("3dof-15mm")
    keys = [one.key for one in read_free(design, ["inlet.tab_length=3:5:0.5"], ["lumen.diameter"])]
    assert "inlet.tab_length" in keys
    assert "lumen.diameter" not in keys
    for free, fixed, said in (
        (["inlet.tab_length=3:5"], [], "LOW:HIGH:STEP"),
        (["inlet.tab=3:5:1"], [], "inlet.tab_length"),
        ([], ["order.copies"], "by default"),
    ):
        with pytest.raises(DesignError, match=said):
            read_free(design, free, fixed)
    # What it must fit gives the chamber, unless a range for it is named.
    fits = sbafab.load("1dof-5mm", "fits.diameter=20")
    keys = [one.key for one in read_free(fits, [], [], ["fits.diameter"])]
    assert "chamber.diameter" not in keys
    named = read_free(fits, ["stack.balloons=2:5:1"], [], ["stack.balloons"])
    assert "stack.balloons" in [one.key for one in named]


def test_keys_from_python_are_texts_as_on_the_command_line() -> None:
    design = sbafab.load("1dof-5mm")
    texts = ["chamber.diameter=8:12:0.5", "registration.method=channel-pin,ears"]
    every = {key.key: key for key in read_free(design, texts)}
    assert free_of(design, texts) == (every["chamber.diameter"], every["registration.method"])
    assert free_of(design, texts[0]) == (Free("chamber.diameter", 8, 12, 0.5),)
    assert free_of(design, FREE) == FREE
    for wrong in ([8], 8, [None], [("chamber.diameter", 8, 12)]):
        with pytest.raises(DesignError, match="KEY=LOW:HIGH:STEP"):
            sbafab.find(design, free=wrong)


# Keys that are words.


YIELDING = ("stack.balloons=2", "rules.yield_builds=400")
ROUGH = ("registration.hand_placement=0.2", "registration.hand_turn=1")


def best_yield(*assignments: str, free: str) -> FoundDesign:
    design = sbafab.load("1dof-5mm", *YIELDING, *assignments)
    keys = read_free(design, [free], [key.key for key in design.free])
    return find(FindRequest(design, *read_all([], [], "yield"), keys, tries=8))


def test_the_best_yield_is_that_of_the_best_words() -> None:
    found = best_yield(*ROUGH, free="registration.method=channel-pin,ears")
    assert found.best.values == {"registration.method": "ears"}
    by_word = {trial.values["registration.method"]: trial for trial in (found.best, *found.front)}
    for word, trial in by_word.items():
        changed = sbafab.load("1dof-5mm", *YIELDING, *ROUGH, f"registration.method={word}")
        (finding,) = (row for row in sbafab.check(changed) if row.rule == "registration-yield")
        assert trial.figures["yield"] == finding.measured
    # Words have no end beyond which another one would be better.
    assert found.ends == ()


@pytest.mark.parametrize("word", ["bottom-first", "middle-first"])
def test_of_equal_words_that_of_the_design_stays(word: str) -> None:
    # On ears every build is good, whatever is stacked first.
    given = ("registration.method=ears", f"registration.sequence={word}")
    found = best_yield(*given, free="registration.sequence=bottom-first,middle-first")
    assert found.best.figures["yield"] == 1
    assert found.best.values == {"registration.sequence": word}


def test_a_yield_frees_the_ways_of_registration() -> None:
    free = {key.key: key for key in free_keys(_request(["yield=0.9"], free=None))}
    assert free["registration.method"].choices == ("channel-pin", "ears")
    assert free["registration.sequence"].choices == ("bottom-first", "middle-first")
    keys = [key.key for key in free_keys(_request(free=None))]
    assert not [key for key in keys if key.startswith("registration")]


# Films of which something is not known.


TPU = {"product": "TPU 85A", "thickness": 0.1, "modulus": 20, "poisson": 0.45, "density": 1200}


@pytest.mark.parametrize(
    ("asked", "left_out", "said"),
    [
        ("burst", "", "burst: burst pressure: no burst test of this film is known"),
        ("reference_stroke", "", "reference_stroke: reference stroke: the paper measured it"),
        ("force@50%@10kPa", "", "force@50%@10kPa: reference stroke: the paper measured it"),
        ("mass", "density", "mass: "),
        ("stroke@10kPa", "modulus", "films.tpe.modulus"),
    ],
)
def test_what_no_film_of_the_design_is_known_for_is_refused_before_any_is_tried(
    asked: str, left_out: str, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "evaluated", None)
    film = {key: value for key, value in TPU.items() if key != left_out}
    with pytest.raises(DesignError) as refused:
        sbafab.find("3dof-15mm", films={"tpe": film}, most={asked: 1}, best="width")
    assert said in str(refused.value)
    # Another film may know it.
    free = (Free("films.tpe.thickness", 0.038, 0.1, 0.062),)
    design = sbafab.load("3dof-15mm", films={"tpe": film})
    assert free_keys(FindRequest(design, *read_all([], [f"{asked}=1"], "width"), free)) == free


def test_a_press_that_bonds_no_film_is_told_before_any_design_is_tried(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(module, "evaluated", None)
    with pytest.raises(DesignError, match=r"press\.temperature_c = 80 does not bond"):
        sbafab.find("1dof-5mm", press={"temperature_c": 80}, least={"stroke": 8})
    # A temperature that is to be found may bond them.
    free = (Free("press.temperature_c", 80, 140, 60),)
    design = sbafab.load("1dof-5mm", press={"temperature_c": 80})
    assert free_keys(FindRequest(design, *read_all([], [], "mass"), free)) == free


def test_a_flat_force_needs_no_modulus_as_in_predict() -> None:
    film = {key: value for key, value in TPU.items() if key != "modulus"}
    free = ["stack.balloons=6:6:1"]
    asked = {"least": {"force@0mm@100kPa": 2}, "free": free, "best": "width"}
    found = sbafab.find("1dof-5mm", films={"tpe": film}, **asked)
    said = sbafab.predict("1dof-5mm", films={"tpe": film})
    predicted = said.value("blocked_force", kpa=100, share=0)
    assert found.best.figures["force@0mm@100kPa"] == pytest.approx(predicted)
    assert found.flags["force@0mm@100kPa"] == ("extrapolation",)


def test_a_nearest_miss_says_that_it_is_one() -> None:
    free = ["stack.balloons=6:6:1"]
    missed = sbafab.find("1dof-5mm", most={"outline_diameter": 4}, free=free)
    assert "nearest miss: outline_diameter" in repr(missed)
    assert "Nearest miss: stack.balloons = 6" in missed._repr_html_()
    met = sbafab.find("1dof-5mm", most={"outline_diameter": 40}, free=free)
    assert repr(met) == "FoundDesign(stack.balloons = 6)"


def test_the_reason_that_holds_for_most_is_given_and_not_that_of_the_smallest() -> None:
    """Pockets of 2.5 mm are too small for the model; the other four stretch by over 15 %."""
    free = ["chamber.diameter=2.5:5.1:0.65", "stack.balloons=6:6:1"]
    drawn = {"models.calibration": "none"}
    with pytest.raises(DesignError, match=r"stretch.*\(4 of the 5 tried\)"):
        sbafab.find("1dof-5mm", drawn, least={"stroke@340kPa": 4}, free=free, best="width")


@pytest.mark.long
def test_a_figure_is_that_of_predict_above_the_pressure_of_usual_maps() -> None:
    """110 kPa: up to there a map is made without being asked."""
    design = sbafab.load("1dof-5mm", "stack.balloons=2", films={"tpe": TPU})
    free = ["chamber.diameter=5:5:1", "stack.balloons=2:2:1"]
    found = sbafab.find(design, least={"force@0mm@200kPa": 1}, free=free)
    predicted = sbafab.predict(design, pressures_kpa=200)
    force = predicted.value("blocked_force", "elastic-stack", kpa=200, share=0)
    assert found.best.figures["force@0mm@200kPa"] == pytest.approx(force, rel=1e-9)
