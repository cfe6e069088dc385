"""One design tried: its figures against the requirements, its rules by their margins."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from sbafab.actuators import build
from sbafab.design.records import Design
from sbafab.errors import DesignError
from sbafab.geometry.inconsistent import GeometryError
from sbafab.laminate.extent import film_mass
from sbafab.laminate.laminate import Laminate
from sbafab.output.checking import refuse_undoable
from sbafab.output.planned import Checked
from sbafab.output.settings import limits
from sbafab.rules.deck import run_deck
from sbafab.search.margins import RuleMargin, margins
from sbafab.search.quantities import AskedQuantity, Subject, shown_value
from sbafab.search.requirements import CLOSE, Goal, Requirement

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
