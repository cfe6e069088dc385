"""Requirements, the search space of a design's free keys, and candidates, each evaluated once."""

from __future__ import annotations

import math
import traceback
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from sbafab.actuators import build
from sbafab.design.files import shown
from sbafab.design.records import Design, Free, keys_of
from sbafab.design.units import millimetres
from sbafab.errors import BeyondError, DesignError, GeometryError
from sbafab.laminate.laminate import Laminate, film_mass
from sbafab.models.mechanisms import ASKED
from sbafab.models.paper import WATER_FLOW
from sbafab.models.stack import MOST_PRESSURE
from sbafab.output.checked import Build, refuse_undoable
from sbafab.process import Progress
from sbafab.rules.deck import run_deck
from sbafab.search.measure import RuleMargin, margins
from sbafab.search.quantities import (
    RequestedQuantity,
    Subject,
    kpa_of,
    named_pressure,
    read_limit,
    read_quantity,
    safer,
    shown_value,
)
from sbafab.search.vary import read_varied, refuse_unknown

CLOSE = 1e-9


@dataclass(frozen=True)
class Requirement:
    """A quantity with its lower or upper limit."""

    quantity: RequestedQuantity
    limit: float
    at_least: bool

    def margin(self, value: float) -> float:
        """Return the margin of a value as a share of the limit; negative if it breaks the limit."""
        more = value - self.limit if self.at_least else self.limit - value
        return more / (abs(self.limit) or 1.0)

    def holds(self, value: float) -> bool:
        return self.margin(value) >= -CLOSE

    @property
    def bound(self) -> str:
        """For example "at least 3 N"."""
        most = "at least" if self.at_least else "at most"
        return f"{most} {self.limit:.10g} {self.quantity.unit}".strip()

    @property
    def label(self) -> str:
        return f"{self.quantity.label} {self.bound}"


@dataclass(frozen=True)
class Goal:
    """The quantity to maximise (``more``) or minimise."""

    quantity: RequestedQuantity
    more: bool

    def cost(self, value: float) -> float:
        return -value if self.more else value

    @property
    def label(self) -> str:
        return f"{'most' if self.more else 'least'} {self.quantity.label}"


GOOD_IF_MORE = (
    *(
        "stroke",
        "reference_stroke",
        "bend",
        "force",
        "lateral_stiffness",
        "burst",
        "yield",
        "lumen",
    ),
    *ASKED,
)
"""Quantities to maximise; all others are minimised."""


def read_all(
    least: Sequence[str], most: Sequence[str], best: str, flow_ml_min: float = WATER_FLOW
) -> tuple[tuple[Requirement, ...], Goal]:
    """The requirements of ``QUANTITY=VALUE`` texts, and the goal. Raises DesignError.

    A quantity without its pressure takes the highest pressure named by any of them, a time without
    a flow takes ``flow_ml_min``.
    """
    pairs = [(text, True) for text in least] + [(text, False) for text in most]
    kpa = named_pressure([text.partition("=")[0] for text, _ in pairs] + [best])
    requirements = tuple(_read(text, at_least, kpa, flow_ml_min) for text, at_least in pairs)
    _refuse_contradictions(requirements, [text for text, _ in pairs])
    quantity = read_quantity(best, kpa, flow_ml_min)
    return requirements, Goal(quantity, quantity.name in GOOD_IF_MORE)


def _read(text: str, at_least: bool, kpa: float | None, flow_ml_min: float) -> Requirement:
    option = "--min" if at_least else "--max"
    name, equals, value = text.partition("=")
    if not equals or not value.strip():
        raise DesignError(
            f"{option} {shown(text)} is not QUANTITY=VALUE; write for example {option} "
            f"{'stroke@50kPa=25' if at_least else 'overall_diameter=20'}"
        )
    quantity = safer(read_quantity(name, kpa, flow_ml_min), at_least)
    try:
        limit = read_limit(quantity, value)
    except ValueError as error:
        raise DesignError(f"{option} {shown(text)}: the value {error}") from None
    return Requirement(quantity, limit, at_least)


def _refuse_contradictions(requirements: Sequence[Requirement], texts: Sequence[str]) -> None:
    """Raises DesignError if a quantity's lower limit is above its upper limit."""
    for least, least_text in zip(requirements, texts, strict=True):
        for most, most_text in zip(requirements, texts, strict=True):
            if not least.at_least or most.at_least or least.limit <= most.limit:
                continue
            # The inflated diameter that must reach never exceeds the one that must not touch.
            if least.quantity == safer(most.quantity, at_least=True):
                raise DesignError(
                    f"--min {shown(least_text)} and --max {shown(most_text)} contradict each "
                    "other; no design can meet both, so change one"
                )


# One candidate: its figures against the requirements, its rules by their margins.


YIELD = "registration-yield"
IMPOSSIBLE = 1e6
"""Miss of a design whose film would fail under the requirement, plus the excess: more than any
design whose film holds. A design that cannot be made misses by twice as much."""
GridPoint = tuple[int, ...]
"""A design by the step of each free key."""


@dataclass(frozen=True)
class Trial:
    """An evaluated candidate. ``rules`` is None if they were not checked.

    ``values`` are of the free keys, ``figures`` by quantity in its unit: mm, N, g or a share.
    ``missed`` is the total share by which requirements and rules are missed; 0 if none is. A lower
    ``cost``, in the unit of the goal, is better; ``mass`` is in g. ``refused`` says why the design
    cannot be made, ``refused_at`` is the place in the program that raised it: one per reason,
    whatever its numbers. ``intervals``, by quantity in its unit, have ends that are compared with
    limits, if requirements have a probability. ``words`` counts keys with words that differ from
    the starting design's.
    """

    values: Mapping[str, Any]
    figures: Mapping[str, float] = field(default_factory=dict)
    rules: Mapping[str, RuleMargin] | None = None
    missed: float = 0.0
    cost: float = 0.0
    mass: float = 0.0
    refused: str = ""
    refused_at: str = ""
    laminate: Laminate | None = field(default=None, repr=False, compare=False)
    intervals: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    words: int = 0

    @property
    def holds(self) -> bool:
        """True if nothing is missed and the design can be made."""
        return self.missed == 0.0 and not self.refused

    @property
    def rank(self) -> tuple[float, float, float, int]:
        """Sort key, best first: missed share, then cost, mass and changed words."""
        return self.missed, self.cost, self.mass, self.words

    def value(self, requirement: Requirement | Goal) -> float:
        """The figure for a requirement or the goal, in its unit."""
        return self.figures[requirement.quantity.label]

    def judged(self, requirement: Requirement) -> float:
        """Return the value to compare with the limit, in its unit: the end of the interval on its
        side, if there is one.
        """
        return judged(requirement, self.figures, self.intervals)


def judged(
    requirement: Requirement,
    figures: Mapping[str, float],
    intervals: Mapping[str, tuple[float, float]],
) -> float:
    """Return the value of ``Trial.judged``."""
    label = requirement.quantity.label
    return intervals[label][not requirement.at_least] if label in intervals else figures[label]


@dataclass(frozen=True)
class SearchProblem:
    """Requirements, the goal, and the design to change.

    Each requirement on a predicted quantity must hold with the probability ``sure``, if any.
    """

    design: Design
    requirements: tuple[Requirement, ...]
    goal: Goal
    sure: float | None = None

    @property
    def needs_yield(self) -> bool:
        return any(quantity.name == "yield" for quantity in self.quantities)

    @property
    def quantities(self) -> list[RequestedQuantity]:
        """The quantities to evaluate: the requirements' first, then the goal's."""
        return [*(requirement.quantity for requirement in self.requirements), self.goal.quantity]

    def subject(self, design: Design, laminate: Laminate) -> Subject:
        """Return a candidate to evaluate, up to the highest pressure of the quantities."""
        pressures = [kpa for each in self.quantities if (kpa := kpa_of(each)) is not None]
        return Subject(design, laminate, most_kpa=max(MOST_PRESSURE, *pressures, 0.0))


def evaluated(problem: SearchProblem, values: Mapping[str, Any], with_rules: bool = False) -> Trial:
    """Return the candidate with these values; without rules, only requirements count: quicker."""
    try:
        design = problem.design.with_(dict(values))
        laminate = build(design)
        rules = None
        if with_rules or problem.needs_yield:
            findings = run_deck(laminate, design)
            rules = margins(findings)
            checked = Build(design, laminate, findings)
            if not checked.failed:
                refuse_undoable([checked])
        subject = problem.subject(design, laminate)
        figures = _figures(problem, subject, rules)
        intervals = {} if problem.sure is None else _intervals(problem, subject, problem.sure)
    except (DesignError, GeometryError) as error:
        message = " ".join(str(error).split())
        excess = error.excess if isinstance(error, BeyondError) else IMPOSSIBLE
        return Trial(
            values, missed=IMPOSSIBLE + excess, refused=message, refused_at=_raised_at(error)
        )
    missed = sum(
        -min(0.0, requirement.margin(judged(requirement, figures, intervals)) + CLOSE)
        for requirement in problem.requirements
    )
    missed += sum(_short(requirement) for requirement in (rules or {}).values())
    cost = problem.goal.cost(figures[problem.goal.quantity.label])
    mass = _mass(laminate)
    return Trial(values, figures, rules, missed, cost, mass, laminate=laminate, intervals=intervals)


def _raised_at(error: Exception) -> str:
    """Return the file and line that raised an error."""
    *_, (frame, line) = traceback.walk_tb(error.__traceback__)
    return f"{frame.f_code.co_filename}:{line}"


def _mass(laminate: Laminate) -> float:
    """The films' mass in g, the tie-breaker; 0 if a density is unknown."""
    try:
        return film_mass(laminate)
    except DesignError:
        return 0.0


def _short(rule: RuleMargin) -> float:
    """Return the share by which a failing rule misses its limit."""
    if rule.verdict != "fail":
        return 0.0
    return max(1e-3, -(rule.share or 0.0))


def _figures(
    problem: SearchProblem, subject: Subject, rules: Mapping[str, RuleMargin] | None
) -> dict[str, float]:
    def share_of_good() -> float:
        yield_margin = (rules or {}).get(YIELD)
        if yield_margin is None or yield_margin.measured is None:
            raise DesignError(f"the yield of {subject.design.name} cannot be computed")
        return yield_margin.measured

    return {
        quantity.label: subject.value(quantity, share_of_good) for quantity in problem.quantities
    }


def _intervals(
    problem: SearchProblem, subject: Subject, sure: float
) -> dict[str, tuple[float, float]]:
    """Return intervals whose ends a measured value passes with a probability of ``1 - sure``
    each.
    """
    each = {
        requirement.quantity.label: subject.interval(requirement.quantity, 2 * sure - 1)
        for requirement in problem.requirements
    }
    return {label: interval for label, interval in each.items() if interval is not None}


def figure_text(problem: SearchProblem, trial: Trial, requirement: Requirement) -> str:
    """Return the figure of a requirement; with a probability, its median and its bound."""
    quantity = requirement.quantity
    median = trial.value(requirement)
    value = shown_value(quantity, median)
    if problem.sure is None or quantity.label not in trial.intervals or median < 0:
        return value
    bound = f"{max(trial.judged(requirement), 0.0):.4g} {quantity.unit}"
    side = "more" if requirement.at_least else "less"
    return f"{value} in the median, {bound} or {side} with {100 * problem.sure:g} % probability"


def misses(problem: SearchProblem, trial: Trial) -> list[str]:
    """Return what a candidate breaks, one sentence each: requirements, then rules."""
    if trial.refused:
        return [trial.refused]
    broken = [
        f"{row.quantity.label} {figure_text(problem, trial, row)}, not {row.bound}"
        for row in problem.requirements
        if not row.holds(trial.judged(row))
    ]
    return [*broken, *broken_rules(trial)]


def value_said(value: Any) -> str:
    """The value of a key, a list in brackets."""
    if isinstance(value, str):
        return value
    return f"[{', '.join(map(value_said, value))}]" if isinstance(value, list) else f"{value:g}"


def keys_said(values: Mapping[str, Any]) -> str:
    """Keys with their values, for display."""
    return ", ".join(f"{key} = {value_said(value)}" for key, value in values.items())


def broken_rules(trial: Trial) -> list[str]:
    """Return the rules that a candidate breaks, one sentence each."""
    failed = [margin for margin in (trial.rules or {}).values() if margin.verdict == "fail"]
    return [f"{margin.rule}: {margin.message}" for margin in failed]


# The search space: the free keys, ``KEY=LOW:HIGH:STEP``, and the candidates by their steps, each
# evaluated once.


PROGRESS_LABEL = "trying designs"


def numbers_of(value: Any) -> list[float]:
    """The numbers of a key with a list, such as one diameter per balloon; else empty."""
    return list(map(float, value)) if isinstance(value, list | tuple) and value else []


def read_free(
    design: Design, texts: Sequence[str], fixed: Sequence[str] = (), assigned: Sequence[str] = ()
) -> tuple[Free, ...]:
    """The family's own keys without those ``fixed``, replaced by the keys of the ``texts`` if
    given.

    Keys ``given`` by hand do not change, except lists, which are scaled as a whole; an envelope to
    fit determines the chamber. Raises DesignError.
    """
    keys = {key: value for key, value, _ in keys_of(design)}
    assigned = [key for key in assigned if not numbers_of(keys.get(key))]
    varied = [_free_of(text) for text in texts]
    refuse_unknown(design, [read_varied(text, "--free") for text in texts], "--free")
    for words in varied:
        for word in words.choices:
            design.with_({words.key: word})
    free = {free_key.key: free_key for free_key in design.free}
    if any(key.startswith("fits.") for key in assigned):
        free.pop("chamber.diameter", None)
    for key in assigned:
        free.pop(key, None)
    for key in dict.fromkeys(fixed):
        if key in assigned:
            continue
        if key not in free:
            raise DesignError(
                f"--fix {shown(key)}: a search changes {', '.join(free) or 'nothing'} by default"
            )
        del free[key]
    # Named keys are free whatever the requirements name.
    free |= {free_key.key: free_key for free_key in varied}
    if "stack.balloons" in free and numbers_of(keys.get("chamber.diameter")):
        raise DesignError(
            "--free stack.balloons: chamber.diameter lists a diameter for each balloon, and a "
            "search scales that list; leave it out, or give one diameter"
        )
    return tuple(free.values())


def free_of(design: Design, free: Iterable[Free | str]) -> tuple[Free, ...]:
    """The keys that a caller names, in place of the family's own: each a ``Free`` or a text, or one
    text alone. Raises DesignError.
    """
    each = [free] if isinstance(free, str) else list(free) if isinstance(free, Iterable) else [free]
    for key in each:
        if not isinstance(key, Free | str):
            raise DesignError(
                f"free holds {shown(key)}; give texts KEY=LOW:HIGH:STEP, for example "
                '["chamber.diameter=3:12:0.1"]'
            )
    texts = [key for key in each if isinstance(key, str)]
    records = [key for key in each if isinstance(key, Free)]
    return (*records, *read_free(design, texts, [key.key for key in design.free]))


def _free_of(text: str) -> Free:
    """``KEY=LOW:HIGH:STEP``, or ``KEY=word,word`` for a key with a choice of words."""
    stepped = read_varied(text, "--free")
    if stepped.values and all(isinstance(value, str) for value in stepped.values):
        return Free.of_words(stepped.key, stepped.values)
    numbers = [value for value in stepped.values if isinstance(value, int | float)]
    parts = text.partition("=")[2].split(":")
    if len(parts) != 3 or len(numbers) != len(stepped.values):
        raise DesignError(
            f"--free {shown(text)} is not KEY=LOW:HIGH:STEP; write for example "
            "--free chamber.diameter=3:12:0.1 or --free registration.method=channel-pin,ears"
        )
    step = numbers[1] - numbers[0] if len(numbers) > 1 else millimetres(parts[2])
    return replace(Free(stepped.key, numbers[0], numbers[-1], 1), step=round(step, 9))


class SearchSpace:
    """The candidates evaluated so far, each once, by the steps of their free keys.

    ``lows`` and ``highs`` are the least and the largest step of each key. At most ``tries``
    candidates are evaluated; the current stage ends at ``limit``.
    """

    def __init__(
        self, problem: SearchProblem, free: tuple[Free, ...], tries: int, progress: Progress
    ) -> None:
        self.problem = problem
        self.free = free
        self.tries = self.limit = tries
        self.lows = [0] * len(free)
        self.highs = [int(round((axis.high - axis.low) / axis.step, 6)) for axis in free]
        self.trials: dict[GridPoint, Trial] = {}
        self._tell = progress
        self._keys: dict[str, Any] = {key: value for key, value, _ in keys_of(problem.design)}

    @property
    def is_over(self) -> bool:
        return len(self.trials) >= min(self.limit, self.size)

    @property
    def size(self) -> int:
        """Number of designs in the space."""
        return math.prod(self.counts) if self.counts else 0

    @property
    def counts(self) -> list[int]:
        """Number of values of each key."""
        return [high - low + 1 for low, high in zip(self.lows, self.highs, strict=True)]

    def number(self, axis: int, point: GridPoint) -> float:
        """The value of a key at a point; for a list its largest number."""
        return round(self.free[axis].low + point[axis] * self.free[axis].step, 6)

    def values(self, point: GridPoint) -> Mapping[str, Any]:
        """The keys' values at a point, whole numbers if low and step are.

        A list, such as the diameters of a tapered stack, is scaled as a whole.
        """
        values: dict[str, Any] = {}
        for axis, free in enumerate(self.free):
            value = self.number(axis, point)
            if free.choices:
                # Beyond its range a word stays the last one.
                last = len(free.choices) - 1
                values[free.key] = free.choices[min(max(point[axis], 0), last)]
                continue
            is_whole = free.low == int(free.low) and free.step == int(free.step)
            listed = numbers_of(self._keys.get(free.key))
            if listed:
                values[free.key] = [round(value * number / max(listed), 2) for number in listed]
            else:
                values[free.key] = int(value) if is_whole else value
        return values

    def nearest(self) -> GridPoint:
        """Return the starting design's point, or the nearest to it in the space."""
        steps = []
        for free in self.free:
            value: Any = self._keys.get(free.key)
            if free.choices:
                steps.append(free.choices.index(value) if value in free.choices else 0)
                continue
            listed = numbers_of(value)
            at = max(listed) if listed else value
            at = at if isinstance(at, int | float) else (free.low + free.high) / 2
            steps.append(round((at - free.low) / free.step))
        return self.inside(steps)

    def inside(self, steps: list[int]) -> GridPoint:
        """Return the point, or the nearest to it within the keys' ranges."""
        return tuple(
            min(max(at, low), high)
            for at, low, high in zip(steps, self.lows, self.highs, strict=True)
        )

    def trial(self, point: GridPoint, checks_rules: bool = True) -> Trial:
        """Return the candidate at a point; its rules are checked if it would be the best so far.

        Without ``checks_rules`` they are not: rules take most of the time.
        """
        if point not in self.trials:
            self._tell(PROGRESS_LABEL, len(self.trials), self.tries)
            candidate = self._evaluated(point)
            so_far = min(
                (trial.rank for trial in self.trials.values() if trial.rules), default=None
            )
            if (
                checks_rules
                and not candidate.refused
                and (so_far is None or candidate.rank < so_far)
            ):
                candidate = self.with_rules(candidate)
            self.trials[point] = candidate
        return self.trials[point]

    def peek(self, point: GridPoint) -> Trial:
        """Return the candidate at a point, also out of range; it does not count as a try."""
        return self.trials.get(point) or self._evaluated(point)

    def _evaluated(self, point: GridPoint) -> Trial:
        candidate = evaluated(self.problem, self.values(point))
        start = self.nearest()
        words = sum(
            free.choices != () and step != begin
            for free, step, begin in zip(self.free, point, start, strict=True)
        )
        return replace(candidate, words=words)

    def is_excluded(self, axis: int, point: GridPoint) -> bool:
        """Return True if a requirement on the key itself excludes its value at the point."""
        key = self.free[axis].key
        at = self.number(axis, point)
        return any(
            requirement.quantity.key == key and not requirement.holds(at)
            for requirement in self.problem.requirements
        )

    def with_rules(self, trial: Trial) -> Trial:
        """Return the candidate with its rules checked, unless they are known or it was refused."""
        if trial.rules is not None or trial.refused:
            return trial
        return replace(evaluated(self.problem, trial.values, with_rules=True), words=trial.words)

    def best(self) -> tuple[GridPoint, Trial]:
        """Return the best candidate, rules checked; if they make it worse, the next one is
        tried.
        """
        while True:
            best = min(self.trials, key=lambda point: self.trials[point].rank)
            trial = self.trials[best]
            if trial.rules is not None or trial.refused:
                return best, trial
            self.trials[best] = self.with_rules(trial)
