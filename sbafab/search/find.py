"""The design that meets requirements and is best in one thing, found by trying.

First a coarse grid over the free keys, then steps from the best that was found, twice as fine when
none helps; rules are asked of what would become the best. With Optuna in place of the grid.
"""

from __future__ import annotations

import itertools
import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from sbafab.design.form import Free
from sbafab.design.records import Design
from sbafab.design.writing import keys_of
from sbafab.errors import DesignError
from sbafab.progress import Progress, unheard
from sbafab.search.pareto import front
from sbafab.search.places import place_said
from sbafab.search.requirements import Goal, Requirement
from sbafab.search.trial import Steps, Trial, Wanted, misses, tried

TRIES = 120
TRYING = "trying designs"
GRID_SHARE = 0.3
"""Of all tries, for the coarse grid."""
SHOWN = 8
"""Designs of the Pareto front that are shown."""
FINEST = 60
"""Tries beyond all others for the last steps."""
TIGHT = ("bond-width", "mask-overhang", "tube-fit", "film-limits", "press-fit", "pin-fit")
"""Rules whose margins a design can be changed to widen."""
LITTLE = 0.005
"""Share of a limit that is nothing to spare."""
STARTS = 4
"""Designs of the grid from which to go on."""
SEED = 20_240


@dataclass(frozen=True)
class FindRequest:
    """What is looked for, from which design; ``free`` keys in place of the family's own, if any.

    ``optuna`` searches with it, ``storage`` is its database, in which a search goes on.
    """

    design: Design
    requirements: tuple[Requirement, ...]
    goal: Goal
    free: tuple[Free, ...] | None = None
    tries: int = TRIES
    optuna: bool = False
    storage: str | None = None


@dataclass(frozen=True)
class Binding:
    """A step of one key that would be better, and what it breaks."""

    key: str
    value: Any
    breaks: str


@dataclass(frozen=True)
class Spare:
    """A rule whose worst value, ``measured`` in ``unit``, has nothing to spare, and where."""

    rule: str
    measured: float
    unit: str
    place: str


@dataclass(frozen=True)
class FoundDesign:
    """What a search ends with: the ``best`` design, or where it does not hold the nearest miss.

    ``front``: designs that hold and that none betters in the goal and in every requirement.
    """

    wanted: Wanted
    best: Trial
    binds: tuple[Binding, ...]
    front: tuple[Trial, ...]
    tries: int
    free: tuple[Free, ...]

    @property
    def holds(self) -> bool:
        """Whether the best design meets all and every rule passes."""
        return self.best.holds

    @property
    def without_room(self) -> list[Spare]:
        """Rules on lengths that hold and have nothing to spare."""
        laminate = self.best.laminate
        return [
            Spare(one.rule, one.measured or 0.0, one.unit, place_said(laminate, one.where))
            for one in (self.best.rules or {}).values()
            if laminate is not None
            and one.verdict == "pass"
            and one.rule in TIGHT
            and one.share is not None
            and abs(one.share) < LITTLE
        ]

    @property
    def missed(self) -> list[str]:
        """What the best design breaks, a sentence each; empty where it holds."""
        return misses(self.wanted, self.best)


def free_keys(request: FindRequest) -> tuple[Free, ...]:
    """The keys that may change, within what the requirements say of them. Raises DesignError."""
    asked = {one.quantity.name for one in request.requirements} | {request.goal.quantity.name}
    every = request.design.free if request.free is None else request.free
    own = [one for one in every if not one.asked or one.asked in asked]
    found = [_within(one, request.requirements) for one in own]
    if not found:
        raise DesignError(
            f"a search knows no key of {request.design.name} that it may change; name one with "
            "--free KEY=LOW:HIGH:STEP"
        )
    return tuple(found)


def _within(free: Free, requirements: Sequence[Requirement]) -> Free:
    for one in requirements:
        if one.quantity.key == free.key:
            low = max(free.low, one.limit) if one.at_least else free.low
            high = free.high if one.at_least else min(free.high, one.limit)
            free = replace(free, low=low, high=max(high, low))
    return free


class Search:
    """The designs that were tried, each once, by the steps of their free keys."""

    def __init__(self, request: FindRequest, tell: Progress) -> None:
        self.request = request
        self.wanted = Wanted(request.design, request.requirements, request.goal)
        self.free = free_keys(request)
        self.counts = [int(round((one.high - one.low) / one.step, 6)) for one in self.free]
        self.trials: dict[Steps, Trial] = {}
        self._tell = tell

    @property
    def is_over(self) -> bool:
        return len(self.trials) >= self.request.tries

    def values(self, place: Steps) -> Mapping[str, Any]:
        """The keys' values at a place, whole numbers where low and step are."""
        found: dict[str, Any] = {}
        for free, step in zip(self.free, place, strict=True):
            value = round(free.low + step * free.step, 6)
            is_whole = free.low == int(free.low) and free.step == int(free.step)
            found[free.key] = int(value) if is_whole else value
        return found

    def nearest(self) -> Steps:
        """Where the design itself stands, or as near as the free keys come to it."""
        keys = {key: value for key, value, _ in keys_of(self.request.design)}
        found = []
        for free, count in zip(self.free, self.counts, strict=True):
            own: Any = keys.get(free.key)
            at = own if isinstance(own, int | float) else (free.low + free.high) / 2
            found.append(min(max(round((at - free.low) / free.step), 0), count))
        return tuple(found)

    def trial(self, place: Steps) -> Trial:
        """What is found there; a design that would be the best so far is asked for its rules."""
        if place not in self.trials:
            self._tell(TRYING, len(self.trials), self.request.tries)
            found = tried(self.wanted, self.values(place))
            so_far = min((one.rank for one in self.trials.values() if one.rules), default=None)
            if not found.refused and (so_far is None or found.rank < so_far):
                found = self.with_rules(found)
            self.trials[place] = found
        return self.trials[place]

    def with_rules(self, trial: Trial) -> Trial:
        if trial.rules is not None or trial.refused:
            return trial
        return tried(self.wanted, trial.values, with_rules=True)

    def best(self) -> tuple[Steps, Trial]:
        """The best with its rules; where they change the order, the next best is asked."""
        while True:
            place = min(self.trials, key=lambda one: self.trials[one].rank)
            trial = self.trials[place]
            if trial.rules is not None or trial.refused:
                return place, trial
            self.trials[place] = self.with_rules(trial)


def find(request: FindRequest, tell: Progress = unheard) -> FoundDesign:
    """The best design, or the nearest miss. Raises DesignError for what cannot be asked."""
    search = Search(request, tell)
    if request.optuna:
        from sbafab.search.optimiser import with_optuna

        with_optuna(search)
    else:
        _grid(search)
        _steps(search)
    place, best = search.best()
    if best.refused:
        raise DesignError(f"no design could be made: {best.refused}")
    binds = tuple(_binding(search, place, best)) if best.holds else ()
    return FoundDesign(
        search.wanted, best, binds, tuple(_front(search)), len(search.trials), search.free
    )


def _grid(search: Search) -> None:
    """A coarse grid, as fine as its share of the tries allows."""
    room = max(8.0, GRID_SHARE * search.request.tries)
    levels = max(2, int(room ** (1 / len(search.free))))
    axes = []
    for count in search.counts:
        few = min(levels, count + 1)
        steps = [round(count * number / max(1, few - 1)) for number in range(few)]
        axes.append(list(dict.fromkeys(steps)))
    for place in itertools.product(*axes):
        if search.is_over:
            return
        search.trial(place)


def _steps(search: Search) -> None:
    """From some starts by coarse steps, then from the best of all by the finest.

    While nothing holds it starts anew from random places, as long as there are tries. The finest
    steps go on past these: what is found has no better neighbour.
    """
    dice = random.Random(SEED)
    starts = _starts(search)
    while not search.is_over:
        if starts:
            start = starts.pop(0)
        elif search.best()[1].holds:
            break
        else:
            start = tuple(dice.randint(0, count) for count in search.counts)
        _descended(search, start)
    last, _ = search.best()
    _walked(search, last, [1] * len(search.free), len(search.trials) + FINEST)


def _starts(search: Search) -> list[Steps]:
    """Where the design itself stands, and the best of the grid that are far from each other."""
    found = [search.nearest()]
    for place in sorted(search.trials, key=lambda place: search.trials[place].rank):
        is_far = all(
            any(
                abs(a - b) * 3 > count
                for a, b, count in zip(place, other, search.counts, strict=True)
            )
            for other in found
        )
        if is_far and len(found) < STARTS:
            found.append(place)
    return found


def _descended(search: Search, start: Steps) -> None:
    """Walks with steps that are halved where none is better."""
    place, share = start, 4
    while share <= 2 * max(search.counts) and not search.is_over:
        place = _walked(search, place, [max(1, count // share) for count in search.counts])
        share *= 2


def _walked(search: Search, place: Steps, stride: Sequence[int], most: int = 0) -> Steps:
    """Where steps lead while they are better: along a key, or along two against each other.

    Where two requirements meet, only a step of both keys leads on. What is better once is tried
    again.
    """
    most = most or search.request.tries
    moves = _moves(stride)
    stale = 0
    while stale < len(moves) and len(search.trials) < most:
        other = _moved(search, place, moves[0])
        if other is not None and search.trial(other).rank < search.trial(place).rank:
            place, stale = other, 0
        else:
            stale += 1
            moves = [*moves[1:], moves[0]]
    return place


def _moves(stride: Sequence[int]) -> list[tuple[int, ...]]:
    count = len(stride)
    single = [
        tuple(sign * stride[axis] if axis == own else 0 for axis in range(count))
        for own in range(count)
        for sign in (-1, 1)
    ]
    pairs = []
    for a, b in itertools.combinations(range(count), 2):
        for sign in (-1, 1):
            move = [0] * count
            move[a], move[b] = sign * stride[a], -sign * stride[b]
            pairs.append(tuple(move))
    return [*single, *pairs]


def _moved(search: Search, place: Steps, move: Sequence[int]) -> Steps | None:
    """The place of a step, kept within the keys' ranges; None where that leads nowhere."""
    inside = tuple(
        min(max(at + by, 0), most) for at, by, most in zip(place, move, search.counts, strict=True)
    )
    return inside if inside != place else None


def _binding(search: Search, place: Steps, best: Trial) -> list[Binding]:
    """What stops every single step that would come nearer the goal."""
    found = []
    for move in _moves([1] * len(place))[: 2 * len(place)]:
        other = _moved(search, place, move)
        axis = next(number for number, by in enumerate(move) if by)
        key = search.free[axis].key
        if other is None:
            continue
        trial = search.with_rules(search.trial(other))
        if trial.cost < best.cost or (trial.refused and trial.rank > best.rank):
            broken = misses(search.wanted, trial)
            if broken:
                found.append(Binding(key, trial.values[key], "; ".join(broken)))
    return found


def _front(search: Search) -> list[Trial]:
    """Designs that hold, rules included, on the front of goal and requirements."""
    wanted = search.wanted
    sides = [
        one
        for one in wanted.requirements
        if one.quantity.key is None and one.quantity != wanted.goal.quantity
    ]
    left = [trial for trial in search.trials.values() if trial.holds]
    shown: list[Trial] = []
    rows = [[trial.cost, *(trial.value(one) for one in sides)] for trial in left]
    more = [False, *(one.at_least for one in sides)]
    for number in sorted(front(rows, more), key=lambda number: left[number].rank):
        checked = search.with_rules(left[number])
        if checked.holds:
            shown.append(checked)
        if len(shown) == SHOWN:
            break
    return shown
