"""The designs that a search may try: steps of the free keys, each tried once."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from sbafab.design.form import Free
from sbafab.design.writing import keys_of
from sbafab.progress import Progress
from sbafab.search.trial import Steps, Trial, Wanted, tried

TRYING = "trying designs"


def numbers_of(value: Any) -> list[float]:
    """The numbers of a key that lists some, such as one diameter a balloon; else none."""
    return list(map(float, value)) if isinstance(value, list | tuple) and value else []


class SearchSpace:
    """The designs that were tried, each once, by the steps of their free keys.

    ``lows`` and ``highs`` are the least and the largest step of each key. No more than ``tries``
    designs are tried; ``limit`` is where the stage that runs now has to end.
    """

    def __init__(self, wanted: Wanted, free: tuple[Free, ...], tries: int, tell: Progress) -> None:
        self.wanted = wanted
        self.free = free
        self.tries = self.limit = tries
        self.lows = [0] * len(free)
        self.highs = [int(round((one.high - one.low) / one.step, 6)) for one in free]
        self.trials: dict[Steps, Trial] = {}
        self._tell = tell
        self._keys: dict[str, Any] = {key: value for key, value, _ in keys_of(wanted.design)}

    @property
    def is_over(self) -> bool:
        return len(self.trials) >= min(self.limit, self.size)

    @property
    def size(self) -> int:
        """How many designs there are."""
        return math.prod(self.counts) if self.counts else 0

    @property
    def counts(self) -> list[int]:
        """How many values each key takes."""
        return [high - low + 1 for low, high in zip(self.lows, self.highs, strict=True)]

    def number(self, axis: int, place: Steps) -> float:
        """The value of a key at a place; of a list its largest number."""
        return round(self.free[axis].low + place[axis] * self.free[axis].step, 6)

    def values(self, place: Steps) -> Mapping[str, Any]:
        """The keys' values at a place, whole numbers where low and step are.

        A list, such as the diameters of a tapered stack, is scaled as a whole.
        """
        found: dict[str, Any] = {}
        for axis, free in enumerate(self.free):
            value = self.number(axis, place)
            is_whole = free.low == int(free.low) and free.step == int(free.step)
            known = numbers_of(self._keys.get(free.key))
            if known:
                found[free.key] = [round(value * one / max(known), 2) for one in known]
            else:
                found[free.key] = int(value) if is_whole else value
        return found

    def nearest(self) -> Steps:
        """Where the design itself stands, or as near as the free keys come to it."""
        found = []
        for free in self.free:
            value: Any = self._keys.get(free.key)
            known = numbers_of(value)
            at = max(known) if known else value
            at = at if isinstance(at, int | float) else (free.low + free.high) / 2
            found.append(round((at - free.low) / free.step))
        return self.inside(found)

    def inside(self, place: list[int]) -> Steps:
        """The place, or the nearest to it within the keys' ranges."""
        return tuple(
            min(max(at, low), high)
            for at, low, high in zip(place, self.lows, self.highs, strict=True)
        )

    def trial(self, place: Steps, asks: bool = True) -> Trial:
        """What is found there; a design that would be the best so far is asked for its rules.

        Not where nothing hangs on it yet (``asks``): rules take most of the time.
        """
        if place not in self.trials:
            self._tell(TRYING, len(self.trials), self.tries)
            found = tried(self.wanted, self.values(place))
            so_far = min((one.rank for one in self.trials.values() if one.rules), default=None)
            if asks and not found.refused and (so_far is None or found.rank < so_far):
                found = self.with_rules(found)
            self.trials[place] = found
        return self.trials[place]

    def looked_at(self, place: Steps) -> Trial:
        """What is found there, also out of range; it counts for none of the tries."""
        return self.trials.get(place) or tried(self.wanted, self.values(place))

    def is_asked(self, axis: int, place: Steps) -> bool:
        """Whether a requirement itself keeps the key from its value at the place."""
        key = self.free[axis].key
        at = self.number(axis, place)
        return any(
            one.quantity.key == key and not one.holds(at) for one in self.wanted.requirements
        )

    def with_rules(self, trial: Trial) -> Trial:
        """The trial with its rules asked, unless they are known or there is no such design."""
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
