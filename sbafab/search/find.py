"""Search for the design that meets all requirements and is best in one quantity.

Small spaces are evaluated completely; else a coarse grid and local searches from its best points,
or Optuna, then steps from the best candidate. Rules are checked only for a candidate that would
become the best. The result lists the binding constraints and can be written as a design file.
"""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import tomli_w

from sbafab.actuators import build
from sbafab.design.files import KIT, Change, design_path, kit_names, override, read_toml, shown
from sbafab.design.kits import kit_path
from sbafab.design.records import Design, Free, keys_of
from sbafab.errors import DesignError, OutputError, SbafabError
from sbafab.laminate.laminate import Laminate
from sbafab.models.balloons import balloons_of, has_balloons
from sbafab.models.figures import FLAGS, Flag
from sbafab.models.intervals import uncertainty_of
from sbafab.models.paper import Counterpart
from sbafab.process import Progress, ignore_progress
from sbafab.rules.finding import Place
from sbafab.search.quantities import (
    AS_DRAWN,
    AT_PRESSURE,
    RequestedQuantity,
    Subject,
    group_of,
    read_quantity,
    refuse_unknown_key,
    shown_interval,
    shown_value,
)
from sbafab.search.strategies import (
    explore,
    neighbours,
    refine,
    try_every_design,
    widen_ranges,
    with_optuna,
)
from sbafab.search.sweep_report import front
from sbafab.search.trial import (
    Goal,
    GridPoint,
    Requirement,
    SearchProblem,
    SearchSpace,
    Trial,
    broken_rules,
    figure_text,
    keys_said,
    misses,
)

TRIES, LEAST_TRIES = 240, 4
COUNT = "chamber.count"
"""Key of the number of chambers side by side."""


@dataclass(frozen=True)
class FindRequest:
    """Requirements and goal of a search, and the design it starts from.

    ``free`` are the keys it may change in place of the family's own, if any. ``optuna`` searches
    with Optuna; ``storage`` is Optuna's database, in which a search resumes. With ``sure``, a share
    above 0.5 and below 1, each requirement on a predicted quantity must hold with that probability.
    """

    design: Design
    requirements: tuple[Requirement, ...]
    goal: Goal
    free: tuple[Free, ...] | None = None
    tries: int = TRIES
    optuna: bool = False
    storage: str | None = None
    sure: float | None = None


@dataclass(frozen=True)
class FoundDesign:
    """Result of a search: the ``best`` design, or the nearest miss if none passes.

    ``front``: Pareto-optimal passing designs, in the goal and every requirement, a selection of
    ``on_front`` designs. ``ends``: keys limited only by their range. ``is_cut_short``: more tries
    might have led to a better one.
    """

    problem: SearchProblem
    best: Trial
    binds: tuple[Binding, ...]
    ends: tuple[RangeEnd, ...]
    front: tuple[Trial, ...]
    on_front: int
    tries: int
    is_cut_short: bool
    free: tuple[Free, ...]

    @property
    def holds(self) -> bool:
        """True if the best design meets all requirements and every rule passes."""
        return self.best.holds

    @property
    def without_room(self) -> list[Spare]:
        """Rules on lengths that pass with nothing to spare."""
        return without_room(self.best)

    @property
    def missed(self) -> list[str]:
        """Requirements and rules that the best design breaks, one sentence each."""
        return misses(self.problem, self.best)

    @property
    def measured(self) -> dict[str, Counterpart]:
        """Measured values of the paper, by quantity, if its model is off by over a quarter."""
        if self.best.laminate is None:
            return {}
        subject = self._subject
        return {
            quantity.label: counterpart
            for quantity in self.problem.quantities
            if (counterpart := subject.counterpart(quantity)) is not None
        }

    @cached_property
    def intervals(self) -> dict[str, tuple[float, float]]:
        """90 % intervals for measurements of the best design, by quantity in its unit, if it has a
        calibration.
        """
        if self.best.laminate is None:
            return {}
        intervals = {}
        for quantity in self.problem.quantities:
            try:
                interval = self._subject.interval(quantity)
            except DesignError:
                continue
            if interval is not None:
                intervals[quantity.label] = interval
        return intervals

    @cached_property
    def flags(self) -> dict[str, tuple[Flag, ...]]:
        """Limits to trust in figures of the best design, by quantity, as flagged by ``predict``."""
        if self.best.laminate is None:
            return {}
        each = {q.label: self._subject.flags(q) for q in self.problem.quantities}
        return {label: flags for label, flags in each.items() if flags}

    @cached_property
    def _subject(self) -> Subject:
        assert self.best.laminate is not None
        design = self.problem.design.with_(dict(self.best.values))
        return self.problem.subject(design, self.best.laminate)

    @property
    def broken_rules(self) -> list[str]:
        """The failing rules."""
        return broken_rules(self.best)


def free_keys(request: FindRequest) -> tuple[Free, ...]:
    """Return the free keys, restricted by the requirements on them.

    Raises DesignError, also if the design has no such quantity.
    """
    quantities = SearchProblem(request.design, request.requirements, request.goal).quantities
    for quantity in quantities:
        refuse_unknown_key(quantity, request.design)
    if request.sure is not None:
        _refuse_unsure(request, request.sure)
    keys = {key: value for key, value, _ in keys_of(request.design)}
    names = {quantity.name for quantity in quantities}
    every = request.design.free if request.free is None else request.free
    free = [key for key in every if not key.asked or key.asked in names]
    for requirement in request.requirements:
        _refuse_fixed(requirement, keys, free)
    for quantity in quantities:
        _refuse_bend(quantity, request.design, free)
    narrowed = [_within(key, request.requirements) for key in free]
    if not narrowed:
        raise DesignError(
            f"the search may change no key of {request.design.name}; name one with "
            "--free KEY=LOW:HIGH:STEP"
        )
    if not any(key.key.startswith(OF_FILMS) for key in narrowed):
        _refuse_unknown_films(quantities, request.design)
    return tuple(narrowed)


OF_FILMS = ("films.", "layup.")
"""Prefixes of keys that change a design's films."""
KNOWN_BY_FILM = ("mass", "burst", "reference_stroke")
"""Quantities whose availability depends only on a design's films, and quick to evaluate."""


def _refuse_unknown_films(quantities: Sequence[RequestedQuantity], design: Design) -> None:
    """Raises DesignError if a quantity is unknown for a design's films at any size: no candidate
    could be evaluated.
    """
    try:
        laminate = build(design)
    except SbafabError:
        return  # the search may start from impossible sizes
    subject, form = Subject(design, laminate), design.form
    has_modulus = all(layer.film.elastic for layer in laminate.tpe_layers)
    for quantity in quantities:
        is_moved = quantity.name in AT_PRESSURE or quantity.name == "time"
        try:
            if quantity.name in KNOWN_BY_FILM:
                subject.value(quantity, lambda: math.nan)
            elif quantity.share:
                subject.value(read_quantity("reference_stroke"), lambda: math.nan)
            if is_moved and has_balloons(form) and not has_modulus:
                balloons_of(design, laminate)
        except DesignError as error:
            raise DesignError(f"{quantity.label}: {error}") from None


def _refuse_unsure(request: FindRequest, sure: float) -> None:
    """Raises DesignError for an invalid probability, and for requirements that cannot have one."""
    if not 0.5 < sure < 1:
        raise DesignError(f"sure = {sure:g} must be above 0.5 and below 1, such as 0.9")
    design = request.design
    if uncertainty_of(design) is None:
        raise DesignError(
            f"sure = {sure:g} needs a calibration, and models.calibration of {design.name} is "
            f'"{design.models.calibration}"; name one such as "paper", or leave sure out'
        )
    for requirement in request.requirements:
        quantity = requirement.quantity
        is_exact = quantity.key is not None or quantity.name in (*AS_DRAWN, "burst")
        if not is_exact and group_of(quantity, design.form) is None:
            instead = "; ask for stroke@10kPa" if quantity.name == "reference_stroke" else ""
            raise DesignError(
                f"sure = {sure:g}: no calibrated model gives {quantity.label} of {design.name}, so "
                f"that its probability is not known{instead or '; leave sure out'}"
            )


def _refuse_fixed(
    requirement: Requirement, keys: Mapping[str, object], free: Sequence[Free]
) -> None:
    """Raises DesignError if a requirement on a key contradicts its value and the key is not
    free.
    """
    key = requirement.quantity.key
    value = keys.get(key or "")
    if isinstance(value, str):
        raise DesignError(
            f"{key} is a word, {shown(value)}, and has no least or most; set it with --set, or let "
            f"the search choose with --free {key}={value},..."
        )
    if key in [free_key.key for free_key in free] or not isinstance(value, int | float):
        return
    if not requirement.holds(value):
        raise DesignError(
            f"{key} = {value:g}, not {requirement.bound}, and the search does not change it; give "
            f"it a range with --free {key}=LOW:HIGH:STEP"
        )


def _refuse_bend(quantity: RequestedQuantity, design: Design, free: Sequence[Free]) -> None:
    """Raises DesignError for a bend if the actuator does not bend, or if no chamber would stay
    empty while their number is fixed.
    """
    if quantity.name != "bend":
        return
    if not design.form.is_parallel:
        raise DesignError(f"{design.name} does not bend; only chambers side by side do")
    stacks = design.form.stacks
    if quantity.chambers < stacks or COUNT in [each.key for each in free]:
        return
    raise DesignError(
        f"{quantity.label}: {design.name} has {stacks} chambers, of which one must stay empty; ask "
        f"for at most {stacks - 1}, or for more chambers with --free {COUNT}=LOW:HIGH:STEP"
    )


def _within(free: Free, requirements: Sequence[Requirement]) -> Free:
    """The range restricted by requirements on the key itself. Raises DesignError if it is empty."""
    for requirement in requirements:
        if requirement.quantity.key != free.key:
            continue
        is_beyond = (
            requirement.limit > free.high if requirement.at_least else requirement.limit < free.low
        )
        if is_beyond and not free.widens:
            raise DesignError(
                f"{free.key} must be {requirement.bound}, and its range is {free.low:g} to "
                f"{free.high:g}; "
                f"give it another one with --free {free.key}=LOW:HIGH:STEP"
            )
        if requirement.at_least:
            low = max(free.low, requirement.limit)
            free = replace(free, low=low, high=max(free.high, low))
        else:
            high = min(free.high, requirement.limit)
            free = replace(free, low=min(free.low, high), high=high)
    return free


def find(request: FindRequest, progress: Progress = ignore_progress) -> FoundDesign:
    """Return the best design, or the nearest miss. Raises DesignError for an impossible request."""
    if request.tries < LEAST_TRIES:
        raise DesignError(f"tries = {request.tries} must be at least {LEAST_TRIES}")
    if request.storage is not None and not request.optuna:
        raise DesignError("storage is Optuna's; search with optuna = True, or leave it out")
    problem = SearchProblem(request.design, request.requirements, request.goal, request.sure)
    space = SearchSpace(problem, free_keys(request), request.tries, progress)
    if request.optuna:
        with_optuna(space, request.storage)
    elif space.size <= request.tries:
        try_every_design(space)
    else:
        explore(space)
    refine(space)
    widen_ranges(space)
    point, best = space.best()
    if best.refused:
        raise DesignError(_commonest_reason(space))
    shown, count = pareto_front(space, best) if best.holds else ([], 0)
    return FoundDesign(
        problem,
        best,
        tuple(bindings(space, point, best)),
        tuple(range_ends(space, point, best)),
        tuple(shown),
        count,
        len(space.trials),
        request.tries <= len(space.trials) < space.size,
        space.free,
    )


def _commonest_reason(space: SearchSpace) -> str:
    """Return why most candidates were refused, as in the nearest one's message."""
    refused = sorted(space.trials.values(), key=lambda trial: trial.rank)
    counts = Counter(trial.refused_at for trial in refused)
    nearest = max(refused, key=lambda trial: counts[trial.refused_at])
    count = counts[nearest.refused_at]
    return f"no design could be made: {nearest.refused} ({count} of the {len(refused)} tried)"


# The diagnosis of a search: binding constraints, tight rules, range ends, the Pareto front.


SHOWN = 8
"""Most designs of the Pareto front that are shown."""
TIGHT = ("bond-width", "mask-overhang", "tube-fit", "film-limits", "press-fit", "pin-fit")
"""Rules with margins that a design change can widen."""
LITTLE = 0.005
"""Largest share of a limit that counts as nothing to spare."""


@dataclass(frozen=True)
class Binding:
    """A step of one key that would improve the design, and what it breaks."""

    key: str
    value: Any
    breaks: str


@dataclass(frozen=True)
class Spare:
    """A rule whose worst value, ``measured`` in ``unit``, has nothing to spare, and its place."""

    rule: str
    measured: float
    unit: str
    place: str


@dataclass(frozen=True)
class RangeEnd:
    """A key at the end of its range that would be better beyond, ``above`` or below: ``low`` to
    ``high`` in steps of ``step``, in mm or balloons, depending on the key.
    """

    key: str
    value: Any
    low: float
    high: float
    step: float
    above: bool

    @property
    def wider(self) -> tuple[float, float]:
        """Ends of a range twice as wide, and at least a step wider, in the better direction."""
        span = max(self.high - self.low, self.step)
        if self.above:
            return self.low, self.high + span
        return max(self.low - span, min(self.step, self.low - self.step)), self.high


def without_room(best: Trial) -> list[Spare]:
    """Return the rules on lengths that pass without margin."""
    laminate = best.laminate
    return [
        Spare(rule.rule, rule.measured or 0.0, rule.unit, place_text(laminate, rule.where))
        for rule in (best.rules or {}).values()
        if laminate is not None
        and rule.verdict == "pass"
        and rule.rule in TIGHT
        and rule.share is not None
        and abs(rule.share) < LITTLE
    ]


def bindings(space: SearchSpace, point: GridPoint, best: Trial) -> list[Binding]:
    """Return the binding constraints: what each improving single step breaks.

    For the nearest miss: the steps to designs that cannot be made, or that no model covers.
    """
    constraints = []
    for axis, neighbour in _steps(point):
        if not space.lows[axis] <= neighbour[axis] <= space.highs[axis]:
            continue
        trial = space.peek(neighbour)
        if _is_nearer(space, point, neighbour, trial, best):
            broken = misses(space.problem, space.with_rules(trial))
            if broken:
                key = space.free[axis].key
                constraints.append(Binding(key, trial.values[key], "; ".join(broken)))
    return constraints


def _is_nearer(
    space: SearchSpace, point: GridPoint, neighbour: GridPoint, trial: Trial, best: Trial
) -> bool:
    """Return True if a step improves the design; a refused one is judged by the step back."""
    if not trial.refused:
        return best.holds and trial.cost < best.cost
    if not best.holds:
        return True
    back = space.peek(tuple(2 * at - to for at, to in zip(point, neighbour, strict=True)))
    return not back.refused and back.cost > best.cost


def range_ends(space: SearchSpace, point: GridPoint, best: Trial) -> list[RangeEnd]:
    """Return the keys whose range alone prevents a better design, or a nearer miss."""
    ends = []
    for axis, neighbour in _steps(point):
        is_inside = space.lows[axis] <= neighbour[axis] <= space.highs[axis]
        if is_inside or space.free[axis].choices or space.is_excluded(axis, neighbour):
            continue
        if space.with_rules(space.peek(neighbour)).rank < best.rank:
            free = space.free[axis]
            low, high = (
                round(free.low + step * free.step, 6)
                for step in (space.lows[axis], space.highs[axis])
            )
            above = neighbour[axis] > space.highs[axis]
            ends.append(RangeEnd(free.key, space.number(axis, point), low, high, free.step, above))
    return ends


def _steps(point: GridPoint) -> list[tuple[int, GridPoint]]:
    """The places one step of one key away, each with the key's number."""
    count = len(point)
    return [
        (
            next(axis for axis, by in enumerate(move) if by),
            tuple(at + by for at, by in zip(point, move, strict=True)),
        )
        for move in neighbours([1] * count)[: 2 * count]
    ]


def pareto_front(space: SearchSpace, best: Trial) -> tuple[list[Trial], int]:
    """Return the Pareto-optimal designs among those tried that pass all rules, and their number.

    The best is first, also if another one equals it in the goal; the rest are in the order of the
    goal. If they are many, the ends and some between are returned.
    """
    problem = space.problem
    sides = [
        requirement
        for requirement in problem.requirements
        if requirement.quantity.key is None and requirement.quantity != problem.goal.quantity
    ]
    passing = [trial for trial in space.trials.values() if trial.holds]
    first = passing.index(best)
    more = [False, *(requirement.at_least for requirement in sides)]
    while True:
        rows = [
            [trial.cost, *(trial.judged(requirement) for requirement in sides)] for trial in passing
        ]
        numbers = sorted({first, *front(rows, more)}, key=lambda number: passing[number].rank)
        chosen = _spread(numbers)
        checked = {number: space.with_rules(passing[number]) for number in chosen}
        failed = [number for number, trial in checked.items() if not trial.holds]
        if not failed:
            return [checked[number] for number in chosen], len(numbers)
        first -= sum(number < first for number in failed)
        passing = [
            checked.get(number, trial)
            for number, trial in enumerate(passing)
            if number not in failed
        ]


def _spread(numbers: list[int]) -> list[int]:
    """Some of them, evenly spaced, including the first and the last."""
    if len(numbers) <= SHOWN:
        return numbers
    return [numbers[round(at * (len(numbers) - 1) / (SHOWN - 1))] for at in range(SHOWN)]


# The place of a finding in an actuator, as text.


RING = 1.0
"""Distance around a bore or the lumen that still belongs to it: a bond and its mask, mm."""


def place_text(laminate: Laminate, where: Place) -> str:
    """For example "at the lumen", "at the inlet tab of chamber2"; empty if unknown."""
    if where.x is None or where.y is None:
        return ""
    x, y = where.x, where.y
    if laminate.lumen is not None and math.hypot(x, y) <= laminate.lumen / 2 + RING:
        return "at the lumen"
    for bore in laminate.bores:
        if math.dist((x, y), bore.centre) <= bore.diameter / 2 + RING:
            return f"at the bore of {bore.chamber}"
    for inlet in laminate.inlets:
        mouth, along = inlet.mouth, inlet.direction
        back = (mouth[0] - x) * along[0] + (mouth[1] - y) * along[1]
        aside = abs((mouth[0] - x) * along[1] - (mouth[1] - y) * along[0])
        if -RING <= back <= inlet.length and aside <= inlet.width / 2 + RING:
            return f"at the inlet tab of {inlet.chamber}"
    return "at the rim"


# The design file of the result: the starting design's file with the new values.


FOUND = "found.toml"
"""The default file name in the folder of ``-o``."""


def refuse_existing(target: Path) -> None:
    """Raises OutputError if the file exists: designs are never overwritten."""
    if target.exists():
        raise OutputError(
            f"{target} exists and is not overwritten; name another folder with -o or file with "
            "--to, or remove it first"
        )


def found_toml(
    source: str | Path, assignments: Sequence[str], name: str, result: FoundDesign, target: Path
) -> str:
    """Return the text of the design file ``target`` of a result, with its figures as comments."""
    changes: list[Change] = [*assignments, dict(result.best.values), {"name": name}]
    data = override(read_toml(design_path(source)), changes)
    data = override(data, [_paths_beside(target, data, result.problem.design)])
    first = {key: value for key, value in data.items() if not isinstance(value, dict)}
    tables = {key: value for key, value in data.items() if isinstance(value, dict)}
    limits = []
    for requirement in result.problem.requirements:
        value = figure_text(result.problem, result.best, requirement)
        aside = _interval_text(result, requirement)
        limits.append(f"# {requirement.quantity.label} = {value} ({requirement.bound}{aside})")
    goal = result.problem.goal
    value = shown_value(goal.quantity, result.best.value(goal))
    best = f"# {goal.quantity.label} = {value} (the goal{_interval_text(result, goal)})"
    keys = keys_said(result.best.values)
    measured = [f"# {name}: {value.sentence()}" for name, value in result.measured.items()]
    measured += [f"# {name}: {FLAGS[f]}" for name, flags in result.flags.items() for f in flags]
    head = [f"# Found by sbafab find, from {Path(source).name}: {keys}.", *limits, best, *measured]
    return "\n".join(line.rstrip() for line in head) + "\n\n" + tomli_w.dumps(first | tables)


def _interval_text(result: FoundDesign, subject: Requirement | Goal) -> str:
    interval = result.intervals.get(subject.quantity.label)
    if interval is None or result.best.value(subject) < 0:
        return ""
    return f"; 90 % interval {shown_interval(interval)}"


def _paths_beside(target: Path, data: Mapping[str, Any], design: Design) -> dict[str, str]:
    """Return the paths of a design's drawings, kit and calibration, by key, relative to the folder
    of ``target``, so that all can be moved together.
    """
    files = {**design.drawings}
    if KIT in data and design.kit not in kit_names():
        files[KIT] = kit_path(design.kit, design.folder)
    calibration = design.folder / design.models.calibration
    if "calibration" in data.get("models", {}) and calibration.is_file():
        files["models.calibration"] = calibration
    folder = target.absolute().parent.resolve()
    return {
        key: Path(os.path.relpath(file.parent.resolve() / file.name, folder)).as_posix()
        for key, file in files.items()
    }


def write_found(text: str, target: Path) -> None:
    """Raises OutputError if it cannot be written, also if a file appeared meanwhile."""
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with target.open("x", encoding="utf-8", newline="\n") as opened:
            opened.write(text)
    except OSError as error:
        raise OutputError(
            f"{target} cannot be written: {error.strerror or error}; name another folder with -o"
        ) from None
