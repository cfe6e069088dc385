"""The designs of a search: its free keys, each candidate evaluated once, and which are tried.

Small spaces are evaluated completely; otherwise a coarse grid and local searches from its best
points, then steps from the best candidate. A local search takes steps along a key, along two keys
in opposite directions, and with one key fixed: if a requirement couples keys, only a step of one
key with the others adjusted makes progress.
"""

from __future__ import annotations

import itertools
import math
import random
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sbafab.actuators import build
from sbafab.design.files import shown
from sbafab.design.records import Design, Free
from sbafab.errors import BeyondError, DesignError, GeometryError
from sbafab.folders.build import Build, refuse_undoable
from sbafab.laminate.laminate import Laminate, film_mass
from sbafab.models.figures import Figure
from sbafab.rules.deck import run_deck
from sbafab.rules.finding import Finding
from sbafab.runtime import Progress
from sbafab.search.quantities import (
    CLOSE,
    Goal,
    RequestedQuantity,
    Requirement,
    measured,
    shown_value,
)
from sbafab.search.trials import margin_share, worst_findings
from sbafab.search.vary import key_values, read_varied, refuse_unknown

TRIES = 240


@dataclass(frozen=True)
class FindRequest:
    """Requirements and goal of a search, and its initial design.

    ``free`` are the keys that it may change instead of the family's own, if any. With ``sure``, a
    share above 0.5 and below 1, each requirement on a predicted quantity must hold with that
    probability.
    """

    design: Design
    requirements: tuple[Requirement, ...]
    goal: Goal
    free: tuple[Free, ...] | None = None
    tries: int = TRIES
    sure: float | None = None

    @property
    def quantities(self) -> list[RequestedQuantity]:
        """The quantities to evaluate: those of the requirements first, then of the goal."""
        return [*(requirement.quantity for requirement in self.requirements), self.goal.quantity]

    def measured(
        self,
        quantity: RequestedQuantity,
        design: Design,
        laminate: Laminate,
        good: float | None = None,
        probability: float | None = None,
    ) -> tuple[float, Figure | None]:
        """Return a quantity of a candidate, with maps that cover all pressures of the request."""
        kpa = [each.kpa for each in self.quantities if each.kpa is not None]
        return measured(quantity, design, laminate, good, kpa, probability)


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
    cannot be made, and equal reasons have one ``cause``. ``intervals``, by quantity in its unit,
    have ends that are compared with limits, if requirements have a probability. ``words`` counts
    keys with words that differ from the starting design's.
    """

    values: Mapping[str, Any]
    figures: Mapping[str, float] = field(default_factory=dict)
    rules: Mapping[str, Finding] | None = None
    missed: float = 0.0
    cost: float = 0.0
    mass: float = 0.0
    refused: str = ""
    laminate: Laminate | None = field(default=None, repr=False, compare=False)
    intervals: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    words: int = 0
    cause: tuple[type, int] | None = None

    @property
    def holds(self) -> bool:
        """True if the design can be built and misses nothing."""
        return self.missed == 0.0 and not self.refused

    @property
    def rank(self) -> tuple[float, float, float, int]:
        """Sort key, best first: missed share, then cost, mass and changed words."""
        return self.missed, self.cost, self.mass, self.words

    @property
    def broken_rules(self) -> list[str]:
        """The failing rules, one sentence each."""
        failed = [rule for rule in (self.rules or {}).values() if rule.verdict == "fail"]
        return [f"{rule.rule}: {rule.message}" for rule in failed]

    def value(self, requirement: Requirement | Goal) -> float:
        """Return the figure for a requirement or the goal, in its unit."""
        return self.figures[requirement.quantity.label]

    def judged(self, requirement: Requirement) -> float:
        """Return the value to compare with the limit, in its unit: the relevant end of the
        interval, if there is one.
        """
        interval = self.intervals.get(requirement.quantity.label)
        return interval[not requirement.at_least] if interval else self.value(requirement)

    def meets(self, requirement: Requirement) -> bool:
        """Return True if the value, or its bound, meets the limit."""
        return requirement.holds(self.judged(requirement))


def evaluated(request: FindRequest, values: Mapping[str, Any], with_rules: bool = False) -> Trial:
    """The candidate with these values; without rules, only requirements count, which is faster."""
    rules: Mapping[str, Finding] | None = None
    figures: dict[str, float] = {}
    try:
        design = request.design.with_(dict(values))
        laminate = build(design)
        if with_rules or any(quantity.name == "yield" for quantity in request.quantities):
            checked_build = Build(design, laminate, run_deck(laminate, design))
            rules = worst_findings(checked_build.findings)
            if not checked_build.failed:
                refuse_undoable([checked_build])
        share = rules[YIELD].measured if rules and YIELD in rules else None
        intervals = _add_figures(figures, request, design, laminate, share)
    except (DesignError, GeometryError) as error:
        excess = error.excess if isinstance(error, BeyondError) else IMPOSSIBLE
        reason = " ".join(str(error).split())
        cause = type(error), len(figures)
        return Trial(values, missed=IMPOSSIBLE + excess, refused=reason, cause=cause)
    keys = key_values(request.design)
    words = sum(isinstance(value, str) and value != keys.get(key) for key, value in values.items())
    trial = Trial(values, figures, rules, laminate=laminate, intervals=intervals, words=words)
    missed = [-min(0.0, row.margin(trial.judged(row)) + CLOSE) for row in request.requirements]
    # The share by which each failing rule misses its limit.
    failed = (rule for rule in (rules or {}).values() if rule.verdict == "fail")
    missed += [max(1e-3, -(margin_share(rule) or 0.0)) for rule in failed]
    mass = 0.0  # a tie-breaker, without the density of a film
    with suppress(DesignError):
        mass = film_mass(laminate)
    cost = request.goal.cost(trial.value(request.goal))
    return replace(trial, missed=sum(missed), cost=cost, mass=mass)


def _add_figures(
    figures: dict[str, float],
    request: FindRequest,
    design: Design,
    laminate: Laminate,
    good: float | None,
) -> dict[str, tuple[float, float]]:
    """Add the quantities of a candidate to ``figures``, and return the intervals whose ends a
    measured value passes with a probability of ``1 - sure``.
    """
    intervals: dict[str, tuple[float, float]] = {}
    required = {row.quantity for row in request.requirements if request.sure is not None}
    for quantity in dict.fromkeys(request.quantities):
        label, probability = quantity.label, None
        if quantity in required and request.sure is not None:
            probability = 2 * request.sure - 1
        value, figure = request.measured(quantity, design, laminate, good, probability)
        figures[label] = value
        if probability and figure and figure.interval:
            intervals[label] = figure.interval
        elif probability and figure and quantity.is_calibrated(design.form) and label != "height":
            raise DesignError(f"{label} is unknown for some factors of the calibration")
    return intervals


def figure_text(request: FindRequest, trial: Trial, requirement: Requirement) -> str:
    """Return the figure of a requirement; with a probability, its median and its bound."""
    quantity, median = requirement.quantity, trial.value(requirement)
    value = shown_value(quantity, median)
    if request.sure is None or quantity.label not in trial.intervals or median < 0:
        return value
    bound = f"{max(trial.judged(requirement), 0.0):.4g} {quantity.unit}"
    side = "more" if requirement.at_least else "less"
    return f"{value} in the median, {bound} or {side} with {100 * request.sure:g} % probability"


def misses(request: FindRequest, trial: Trial) -> list[str]:
    """The constraints that a candidate breaks, one sentence each: requirements, then rules."""
    if trial.refused:
        return [trial.refused]
    broken = [
        f"{row.quantity.label} {figure_text(request, trial, row)}, not {row.bound}"
        for row in request.requirements
        if not trial.meets(row)
    ]
    return [*broken, *trial.broken_rules]


# The free keys, ``KEY=LOW:HIGH:STEP``.


def numbers_of(value: Any) -> list[float]:
    """Return the numbers of a key with a list, such as one diameter per balloon; else empty."""
    return list(map(float, value)) if isinstance(value, list | tuple) and value else []


def read_free(
    design: Design,
    free: str | Iterable[Free | str],
    fixed: Sequence[str] = (),
    assigned: Sequence[str] = (),
) -> tuple[Free, ...]:
    """Return the family's free keys without ``fixed`` ones, replaced by the keys of ``free``: texts
    or records, or a single text.

    Keys ``assigned`` by hand do not change, except lists, which are scaled as a whole; an envelope
    to fit determines the chamber. Raises DesignError.
    """
    keys = key_values(design)
    assigned = [key for key in assigned if not numbers_of(keys.get(key))]
    is_several = isinstance(free, Iterable) and not isinstance(free, str)
    named = [_free_of(key) for key in (free if is_several else [free])]
    refuse_unknown(design, named, "--free")
    for key, word in ((each.key, word) for each in named for word in each.choices):
        design.with_({key: word})
    fits = any(key.startswith("fits.") for key in assigned)
    unfree = {*assigned, *(["chamber.diameter"] if fits else [])}
    every = {key.key: key for key in design.free if key.key not in unfree}
    for key in dict.fromkeys(fixed):
        if key not in assigned and every.pop(key, None) is None:
            raise DesignError(
                f"--fix {shown(key)}: by default a search changes {', '.join(every) or 'nothing'}"
            )
    # Named keys are free whatever the requirements name.
    every |= {key.key: key for key in named}
    if "stack.balloons" in every and numbers_of(keys.get("chamber.diameter")):
        raise DesignError(
            "--free stack.balloons: chamber.diameter lists a diameter for each balloon, which a "
            "search scales; omit stack.balloons, or give one diameter"
        )
    return tuple(every.values())


def free_of(design: Design, free: str | Iterable[Free | str]) -> tuple[Free, ...]:
    """Return the keys named by a caller, instead of the family's own. Raises DesignError."""
    return read_free(design, free, [key.key for key in design.free])


def _free_of(text: object) -> Free:
    """The free key in ``KEY=LOW:HIGH:STEP``, or in ``KEY=word,word`` for a choice of words."""
    if isinstance(text, Free):
        return text
    if not isinstance(text, str):
        raise DesignError(
            f"free contains {shown(text)}; give texts KEY=LOW:HIGH:STEP, for example "
            '["chamber.diameter=3:12:0.1"]'
        )
    free = read_varied(text, "--free")
    if not free.step or not all(isinstance(value, str) for value in free.choices):
        raise DesignError(
            f"--free {shown(text)} is not KEY=LOW:HIGH:STEP; write for example "
            "--free chamber.diameter=3:12:0.1 or --free registration.method=channel-pin,ears"
        )
    return free


# The candidates by the steps of their free keys, each evaluated once.


class SearchSpace:
    """The candidates evaluated so far, each once, by the steps of their free keys.

    ``lows`` and ``highs`` are the least and largest step of each key, ``start`` the initial
    design's point, or the nearest to it. At most ``tries`` candidates are evaluated; the current
    stage ends at ``limit``.
    """

    def __init__(self, request: FindRequest, free: tuple[Free, ...], progress: Progress) -> None:
        self.request = request
        self.free = free
        self.limit = request.tries
        self.lows = np.zeros(len(free), int)
        self.highs = np.array([round((axis.high - axis.low) / axis.step, 6) for axis in free], int)
        self.trials: dict[GridPoint, Trial] = {}
        self._tell = progress
        self._keys = key_values(request.design)
        self.start = self.inside([_step_of(key, self._keys.get(key.key)) for key in free])

    @property
    def is_over(self) -> bool:
        return len(self.trials) >= min(self.limit, self.size)

    @property
    def size(self) -> int:
        """The number of designs in the space."""
        return math.prod(self.counts) if self.counts else 0

    @property
    def counts(self) -> list[int]:
        """The number of values of each key."""
        counts: list[int] = (self.highs - self.lows + 1).tolist()
        return counts

    def number(self, axis: int, point: GridPoint) -> float:
        """Return the value of a key at a point; for a list its largest number."""
        return round(self.free[axis].low + point[axis] * self.free[axis].step, 6)

    def values(self, point: GridPoint) -> Mapping[str, Any]:
        """Return the keys' values at a point; integers if low and step are integers.

        A list, such as the diameters of a tapered stack, is scaled as a whole.
        """
        return {free.key: self._value(axis, point) for axis, free in enumerate(self.free)}

    def _value(self, axis: int, point: GridPoint) -> Any:
        free = self.free[axis]
        listed = numbers_of(self._keys.get(free.key))
        if listed:
            number = self.number(axis, point)
            return [round(value * number / max(listed), 2) for value in listed]
        return free.at(point[axis])

    def inside(self, steps: ArrayLike) -> GridPoint:
        """Return the point, or the nearest to it within the keys' ranges."""
        return tuple(np.clip(steps, self.lows, self.highs).tolist())

    def neighbours(self, point: GridPoint) -> Iterator[tuple[int, GridPoint, bool]]:
        """Yield the points one step of one key away, with the key's number and whether its range
        contains it.
        """
        for axis, by in itertools.product(range(len(point)), (-1, 1)):
            at = point[axis] + by
            is_inside = bool(self.lows[axis] <= at <= self.highs[axis])
            yield axis, (*point[:axis], at, *point[axis + 1 :]), is_inside

    def is_excluded(self, axis: int, point: GridPoint) -> bool:
        """Return True if a requirement on the key itself excludes its value at the point."""
        key, at = self.free[axis].key, self.number(axis, point)
        return any(
            row.quantity.key == key and not row.holds(at) for row in self.request.requirements
        )

    def trial(self, point: GridPoint, checks_rules: bool = True) -> Trial:
        """Return the candidate at a point; its rules are checked if it would be the best so far.

        Without ``checks_rules`` they are not checked, since rules take most of the time.
        """
        if point not in self.trials:
            self._tell("trying designs", len(self.trials), self.request.tries)
            candidate = self.peek(point)
            ranks = [trial.rank for trial in self.trials.values() if trial.rules]
            if checks_rules and all(candidate.rank < rank for rank in ranks):
                candidate = self.with_rules(candidate)
            self.trials[point] = candidate
        return self.trials[point]

    def peek(self, point: GridPoint) -> Trial:
        """Return the candidate at a point, also out of range; it does not count as a try."""
        if point in self.trials:
            return self.trials[point]
        return evaluated(self.request, self.values(point))

    def with_rules(self, trial: Trial) -> Trial:
        """Return the candidate with its rules checked, unless they are known or it was refused."""
        if trial.rules is not None or trial.refused:
            return trial
        return evaluated(self.request, trial.values, with_rules=True)

    def best(self) -> tuple[GridPoint, Trial]:
        """Return the best candidate with rules checked; if they make it worse, the next one is
        tried.
        """
        while True:
            best = min(self.trials, key=lambda point: self.trials[point].rank)
            trial = self.with_rules(self.trials[best])
            if trial is self.trials[best]:
                return best, trial
            self.trials[best] = trial


def _step_of(free: Free, value: Any) -> int:
    """Return the step of a key's value; for a list, of its largest number."""
    if free.choices:
        return free.choices.index(value) if value in free.choices else 0
    at = max(numbers_of(value), default=value)
    return round(
        ((at if isinstance(at, int | float) else (free.low + free.high) / 2) - free.low) / free.step
    )


# Strategies: coarse grid, local searches, wider ranges.


GRID_SHARE = 0.25
WALK_SHARE = 0.6
"""Shares of all tries: for the coarse grid, and the point where walks from far places must end."""
STARTS = 4
"""Designs of the grid from which to continue."""
FEW = 40
"""Most values of a key that is held fixed in turn: balloons, not diameters."""
FIXED_STEPS = (-1, 1, -2, 2)
"""Steps of the key that is then held fixed."""
WIDENINGS = 4
"""Most times a range is widened, by its own width each time."""
SEED = 20_240


def searched(request: FindRequest, free: tuple[Free, ...], progress: Progress) -> SearchSpace:
    """Return the space of a request after the whole search."""
    space = SearchSpace(request, free, progress)
    if space.size <= request.tries:
        for steps in np.ndindex(*space.counts):
            space.trial(tuple((space.lows + steps).tolist()), checks_rules=False)
    else:
        _explore(space)
    _refine(space)
    _widen_ranges(space)
    return space


def _explore(space: SearchSpace) -> None:
    """Evaluate a coarse grid, then search locally from its best distant points, halving steps that
    do not improve.

    While no design passes, it restarts from random points, as long as tries are left.
    """
    space.limit = round(WALK_SHARE * space.request.tries)
    for point in itertools.product(*_grid(space)):
        if not space.is_over:
            space.trial(point, checks_rules=False)
    dice = random.Random(SEED)
    starts = _starts(space)
    while not space.is_over:
        if starts:
            point = starts.pop(0)
        elif space.best()[1].holds:
            break
        else:
            point = tuple(map(dice.randint, space.lows.tolist(), space.highs.tolist()))
        most = 2 * max(space.counts)
        point = _walks(space, point, [2**n for n in range(2, 64) if 2**n <= most])


def _grid(space: SearchSpace) -> Iterator[list[int]]:
    """Yield the steps of each key on a coarse grid, as fine as its share of the tries allows.

    Keys with words keep their initial value: the walks from the grid change them.
    """
    room = max(8.0, GRID_SHARE * space.request.tries)
    numbers = sum(not free.choices for free in space.free)
    levels = max(2, int(room ** (1 / max(1, numbers))))
    axes = zip(space.free, space.start, space.lows.tolist(), space.counts, strict=True)
    for free, at, low, count in axes:
        few = min(levels, count)
        steps = [low + round((count - 1) * number / max(1, few - 1)) for number in range(few)]
        yield [at] if free.choices else list(dict.fromkeys(steps))


def _starts(space: SearchSpace) -> list[GridPoint]:
    """Return the initial point and the best grid points that are far apart."""
    starts = [space.start]
    for point in sorted(space.trials, key=lambda point: space.trials[point].rank):
        apart = 3 * np.abs(np.subtract(starts, point)) > space.counts
        if len(starts) < STARTS and apart.any(axis=1).all():
            starts.append(point)
    return starts


def _refine(space: SearchSpace) -> None:
    """Search locally from the best until no neighbour and no search with a fixed key is better."""
    space.limit = space.request.tries
    while not space.is_over:
        point = _walk(space, space.best()[0], [1] * len(space.free))
        if not _has_better_walk(space, point):
            return


def _has_better_walk(space: SearchSpace, point: GridPoint) -> bool:
    """Return True if a search with a key fixed one or two steps away finds a better candidate."""
    counts = space.counts
    axes = [axis for axis, count in enumerate(counts) if 1 < count <= FEW and len(counts) > 1]
    for axis, by in itertools.product(sorted(axes, key=lambda axis: counts[axis]), FIXED_STEPS):
        start = space.inside(np.add(point, by * np.eye(len(point), dtype=int)[axis]))
        if start == point or space.is_over:
            continue
        start = _walks(space, start, (32, 128, max(counts)), axis)
        if start in space.trials and space.trial(start).rank < space.trial(point).rank:
            return True
    return False


def _walks(
    space: SearchSpace, point: GridPoint, shares: Iterable[int], fixed: int | None = None
) -> GridPoint:
    """The end of walks with strides of each key's range over ``share``, with one key fixed."""
    for share in shares:
        strides = [max(1, count // share) for count in space.counts]
        if fixed is not None:
            strides[fixed] = 0
        point = _walk(space, point, strides)
    return point


def _walk(space: SearchSpace, point: GridPoint, stride: Sequence[int]) -> GridPoint:
    """Return the end of improving steps: along one key, or along two in opposite directions.

    Where two requirements meet, only a step of both keys makes progress. An improving move is
    repeated. A key with a stride of 0 is fixed.
    """
    steps = [by for by in np.diag(stride) if by.any()]
    steps += [a - b for a, b in itertools.combinations(steps, 2)]
    moves = deque(sign * by for by in steps for sign in (-1, 1))
    stale = 0
    while stale < len(moves) and not space.is_over:
        to = space.inside(point + moves[0])
        here = space.trial(point).rank
        if to != point and not space.is_over and space.trial(to).rank < here:
            point, stale = to, 0
        else:
            stale += 1
            moves.rotate(-1)
    return point


def _widen_ranges(space: SearchSpace) -> None:
    """Search beyond the ends of ranges that may widen, as long as that finds better designs."""
    for _ in range(WIDENINGS):
        point, before = space.best()
        ends = space.lows.copy(), space.highs.copy()
        counts = space.counts
        for axis, beyond, is_inside in space.neighbours(point):
            free = space.free[axis]
            is_impossible = space.number(axis, beyond) <= 0 or space.is_excluded(axis, beyond)
            if not free.widens or is_inside or is_impossible:
                continue
            if beyond[axis] > point[axis]:
                space.highs[axis] += counts[axis]
            else:
                below = int(round(free.low / free.step + space.lows[axis], 6)) - 1
                space.lows[axis] -= min(counts[axis], below)
        if space.counts == counts:
            return
        _refine(space)
        if not space.best()[1].rank < before.rank:
            space.lows, space.highs = ends
            return
