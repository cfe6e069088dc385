"""What is required of a design, and by how much one keeps it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from sbafab.actuators import build
from sbafab.design.files import keys_of, shown
from sbafab.design.records import Design, Free
from sbafab.errors import DesignError, GeometryError
from sbafab.laminate.laminate import Laminate, film_mass
from sbafab.output.checked import Checked, limits, refuse_undoable
from sbafab.process import Progress
from sbafab.rules.deck import run_deck
from sbafab.search.measure import RuleMargin, margins
from sbafab.search.quantities import (
    AskedQuantity,
    Subject,
    named_pressure,
    read_limit,
    read_quantity,
    safer,
    shown_value,
)

CLOSE = 1e-9


@dataclass(frozen=True)
class Requirement:
    """A quantity that must be at least, or at most, so much."""

    quantity: AskedQuantity
    limit: float
    at_least: bool

    def margin(self, value: float) -> float:
        """By what share of the limit a value keeps it; below 0 it does not."""
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
    def said(self) -> str:
        return f"{self.quantity.said} {self.bound}"


@dataclass(frozen=True)
class Goal:
    """The quantity to be best in: as much of it as can be, or as little."""

    quantity: AskedQuantity
    more: bool

    def cost(self, value: float) -> float:
        return -value if self.more else value

    @property
    def said(self) -> str:
        return f"{'most' if self.more else 'least'} {self.quantity.said}"


GOOD_IF_MORE = ("stroke", "bend", "force", "yield", "lumen")
"""Of these as much as can be is best, of all others as little."""


def read_all(
    least: Sequence[str], most: Sequence[str], best: str
) -> tuple[tuple[Requirement, ...], Goal]:
    """The requirements of ``QUANTITY=VALUE`` texts, and the goal. Raises DesignError.

    A bend or a force without a pressure is one at the highest that any of them names; a stroke
    without one is the full stroke.
    """
    pairs = [(text, True) for text in least] + [(text, False) for text in most]
    kpa = named_pressure([text.partition("=")[0] for text, _ in pairs] + [best])
    found = tuple(_read(text, at_least, kpa) for text, at_least in pairs)
    _refuse_contradictions(found, [text for text, _ in pairs])
    quantity = read_quantity(best, kpa)
    return found, Goal(quantity, quantity.name in GOOD_IF_MORE)


def _read(text: str, at_least: bool, kpa: float | None) -> Requirement:
    option = "--min" if at_least else "--max"
    name, equals, value = text.partition("=")
    if not equals or not value.strip():
        raise DesignError(
            f"{option} {shown(text)} is not QUANTITY=VALUE; write for example {option} "
            f"{'stroke@50kPa=25' if at_least else 'overall_diameter=20'}"
        )
    quantity = safer(read_quantity(name, kpa), at_least)
    try:
        limit = read_limit(quantity, value)
    except ValueError as error:
        raise DesignError(f"{option} {shown(text)}: the value {error}") from None
    return Requirement(quantity, limit, at_least)


def _refuse_contradictions(found: Sequence[Requirement], texts: Sequence[str]) -> None:
    """Raises DesignError where one quantity must be more than it may be."""
    for least, said in zip(found, texts, strict=True):
        for most, other in zip(found, texts, strict=True):
            if not least.at_least or most.at_least or least.limit <= most.limit:
                continue
            # The inflated diameter that must reach is never more than the one that must not touch.
            if least.quantity == safer(most.quantity, at_least=True):
                raise DesignError(
                    f"--min {shown(said)} and --max {shown(other)} contradict each other; no "
                    "design can meet both, so change one"
                )


# The designs that a search may try: steps of the free keys, each tried once.


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


# One design tried: its figures against the requirements, its rules by their margins.


YIELD = "registration-yield"
IMPOSSIBLE = 1e6
"""By how much a design that cannot be made misses: by more than any that can."""
Steps = tuple[int, ...]
"""A design by the step at which each free key stands."""


@dataclass(frozen=True)
class Trial:
    """A design with what was found of it. ``rules`` is None where they were not asked.

    ``values`` are those of the free keys, ``figures`` by quantity in its unit: mm, N, g or a share.
    ``missed`` is by what share requirements and rules are missed, all together; 0 where none is.
    ``cost``, in the unit of what is best, is the less the better; ``mass`` is in g. ``refused``
    says why no such design can be made.
    """

    values: Mapping[str, Any]
    figures: Mapping[str, float] = field(default_factory=dict)
    rules: Mapping[str, RuleMargin] | None = None
    missed: float = 0.0
    cost: float = 0.0
    mass: float = 0.0
    refused: str = ""
    laminate: Laminate | None = field(default=None, repr=False, compare=False)

    @property
    def holds(self) -> bool:
        """Whether nothing is missed and it can be made."""
        return self.missed == 0.0 and not self.refused

    @property
    def rank(self) -> tuple[float, float, float]:
        """What is missed as a share, then the cost, of equals the mass; the less, the better."""
        return self.missed, self.cost, self.mass

    def value(self, requirement: Requirement | Goal) -> float:
        """The figure that a requirement or the goal is about, in its unit."""
        return self.figures[requirement.quantity.said]


@dataclass(frozen=True)
class Wanted:
    """All that is asked: requirements, the goal, and the design whose keys change."""

    design: Design
    requirements: tuple[Requirement, ...]
    goal: Goal

    @property
    def asks_for_yield(self) -> bool:
        return any(quantity.name == "yield" for quantity in self.quantities)

    @property
    def quantities(self) -> list[AskedQuantity]:
        """All that figures are asked of: requirements first, then the goal."""
        return [*(one.quantity for one in self.requirements), self.goal.quantity]


def tried(wanted: Wanted, values: Mapping[str, Any], with_rules: bool = False) -> Trial:
    """The trial of a design; without rules only requirements count, which is much quicker."""
    try:
        design = wanted.design.with_(dict(values))
        laminate = build(design)
        rules = None
        if with_rules or wanted.asks_for_yield:
            findings = run_deck(laminate, limits(design))
            rules = margins(findings)
            checked = Checked(design, laminate, findings)
            if not checked.failed:
                refuse_undoable([checked])
        figures = _figures(wanted, Subject(design, laminate), rules)
    except (DesignError, GeometryError) as error:
        said = " ".join(str(error).split())
        return Trial(values, missed=IMPOSSIBLE, refused=said)
    missed = sum(
        -min(0.0, one.margin(figures[one.quantity.said]) + CLOSE) for one in wanted.requirements
    )
    missed += sum(_short(one) for one in (rules or {}).values())
    cost = wanted.goal.cost(figures[wanted.goal.quantity.said])
    return Trial(values, figures, rules, missed, cost, _mass(laminate), laminate=laminate)


def _mass(laminate: Laminate) -> float:
    """The films' mass in g, by which equals are told apart; 0 where a density is not known."""
    try:
        return film_mass(laminate)
    except DesignError:
        return 0.0


def _short(rule: RuleMargin) -> float:
    """By what share a rule that fails misses its limit."""
    if rule.verdict != "fail":
        return 0.0
    return max(1e-3, -(rule.share or 0.0))


def _figures(
    wanted: Wanted, subject: Subject, rules: Mapping[str, RuleMargin] | None
) -> dict[str, float]:
    def share_of_good() -> float:
        found = (rules or {}).get(YIELD)
        if found is None or found.measured is None:
            raise DesignError(f"no yield of {subject.design.name} can be counted")
        return found.measured

    return {quantity.said: subject.value(quantity, share_of_good) for quantity in wanted.quantities}


def misses(wanted: Wanted, trial: Trial) -> list[str]:
    """What a design breaks, a sentence each: requirements, then rules."""
    if trial.refused:
        return [trial.refused]
    said = [
        f"{one.quantity.said} {shown_value(one.quantity, trial.value(one))}, not {one.bound}"
        for one in wanted.requirements
        if not one.holds(trial.value(one))
    ]
    return [*said, *broken_rules(trial)]


def value_said(value: Any) -> str:
    """The value of a key, a list in brackets."""
    return f"[{', '.join(map(value_said, value))}]" if isinstance(value, list) else f"{value:g}"


def keys_said(values: Mapping[str, Any]) -> str:
    """Keys with their values, as people read them."""
    return ", ".join(f"{key} = {value_said(value)}" for key, value in values.items())


def broken_rules(trial: Trial) -> list[str]:
    """The rules that a design breaks, a sentence each."""
    failed = [one for one in (trial.rules or {}).values() if one.verdict == "fail"]
    return [f"{one.rule}: {one.message}" for one in failed]
