"""What is told of a search's end: what binds, what has nothing to spare, the Pareto front."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from sbafab.search.pareto import front
from sbafab.search.places import place_said
from sbafab.search.space import SearchSpace
from sbafab.search.trial import Steps, Trial, misses
from sbafab.search.walks import neighbours

SHOWN = 8
"""Designs of the Pareto front that are shown."""
TIGHT = ("bond-width", "mask-overhang", "tube-fit", "film-limits", "press-fit", "pin-fit")
"""Rules whose margins a design can be changed to widen."""
LITTLE = 0.005
"""Share of a limit that is nothing to spare."""


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
class RangeEnd:
    """A key at the end of its range that would be better beyond: ``low`` to ``high`` in steps of
    ``step``, mm or a number of balloons, as the key is.
    """

    key: str
    value: Any
    low: float
    high: float
    step: float


def without_room(best: Trial) -> list[Spare]:
    """Rules on lengths that hold and have nothing to spare."""
    laminate = best.laminate
    return [
        Spare(one.rule, one.measured or 0.0, one.unit, place_said(laminate, one.where))
        for one in (best.rules or {}).values()
        if laminate is not None
        and one.verdict == "pass"
        and one.rule in TIGHT
        and one.share is not None
        and abs(one.share) < LITTLE
    ]


def bindings(space: SearchSpace, place: Steps, best: Trial) -> list[Binding]:
    """What stops every single step that would come nearer the goal.

    Of the nearest miss: the steps to designs that cannot be made, or that no model knows.
    """
    found = []
    for axis, other in _steps(place):
        if not space.lows[axis] <= other[axis] <= space.highs[axis]:
            continue
        trial = space.looked_at(other)
        if _is_nearer(space, place, other, trial, best):
            broken = misses(space.wanted, space.with_rules(trial))
            if broken:
                key = space.free[axis].key
                found.append(Binding(key, trial.values[key], "; ".join(broken)))
    return found


def _is_nearer(space: SearchSpace, place: Steps, other: Steps, trial: Trial, best: Trial) -> bool:
    """Whether a step would come nearer the goal; where nothing comes of it, by the step back."""
    if not trial.refused:
        return best.holds and trial.cost < best.cost
    if not best.holds:
        return True
    back = space.looked_at(tuple(2 * at - to for at, to in zip(place, other, strict=True)))
    return not back.refused and back.cost > best.cost


def range_ends(space: SearchSpace, place: Steps, best: Trial) -> list[RangeEnd]:
    """The keys whose range alone stops a better design, or a nearer miss."""
    found = []
    for axis, other in _steps(place):
        if space.lows[axis] <= other[axis] <= space.highs[axis] or space.is_asked(axis, other):
            continue
        if space.with_rules(space.looked_at(other)).rank < best.rank:
            one = space.free[axis]
            low, high = (
                round(one.low + step * one.step, 6)
                for step in (space.lows[axis], space.highs[axis])
            )
            found.append(RangeEnd(one.key, space.number(axis, place), low, high, one.step))
    return found


def _steps(place: Steps) -> list[tuple[int, Steps]]:
    """The places a step of one key away, each with the key's number."""
    count = len(place)
    return [
        (
            next(axis for axis, by in enumerate(move) if by),
            tuple(at + by for at, by in zip(place, move, strict=True)),
        )
        for move in neighbours([1] * count)[: 2 * count]
    ]


def pareto_front(space: SearchSpace, best: Trial) -> tuple[list[Trial], int]:
    """Designs that hold, rules included, and that none of those tried betters in everything.

    The best first, also where another one equals it in the goal, then in the order of the goal;
    where they are many the ends and some between. With it how many there are.
    """
    wanted = space.wanted
    sides = [
        one
        for one in wanted.requirements
        if one.quantity.key is None and one.quantity != wanted.goal.quantity
    ]
    left = [trial for trial in space.trials.values() if trial.holds]
    first = left.index(best)
    more = [False, *(one.at_least for one in sides)]
    while True:
        rows = [[trial.cost, *(trial.value(one) for one in sides)] for trial in left]
        numbers = sorted({first, *front(rows, more)}, key=lambda number: left[number].rank)
        chosen = _spread(numbers)
        checked = {number: space.with_rules(left[number]) for number in chosen}
        failed = [number for number, trial in checked.items() if not trial.holds]
        if not failed:
            return [checked[number] for number in chosen], len(numbers)
        first -= sum(number < first for number in failed)
        left = [
            checked.get(number, trial) for number, trial in enumerate(left) if number not in failed
        ]


def _spread(numbers: list[int]) -> list[int]:
    """Some of them, evenly, the first and the last among them."""
    if len(numbers) <= SHOWN:
        return numbers
    return [numbers[round(at * (len(numbers) - 1) / (SHOWN - 1))] for at in range(SHOWN)]
