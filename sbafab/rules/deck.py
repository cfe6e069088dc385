"""The rule deck: all rules in the order they are reported."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

from sbafab.laminate.laminate import Laminate
from sbafab.process import Progress
from sbafab.rules import (
    bond_width,
    bridges,
    channel_clear,
    facing_films,
    film_limits,
    mask_overhang,
    piece_count,
    pin_fit,
    pin_holes,
    press_fit,
    registration_nominal,
    registration_worst_case,
    registration_yield,
    scrap,
    sealing,
    tube_fit,
)
from sbafab.rules.finding import Finding
from sbafab.rules.limits import Limits, lowered
from sbafab.rules.measures import Measures


class Rule(NamedTuple):
    """A rule's stable name and the function that measures it.

    ``at_most``: its limit is the most that may be measured; of all others it is the least.
    """

    name: str
    check: Callable[[Measures], list[Finding]]
    at_most: bool = False


def _alone(
    check: Callable[[Laminate, Limits], list[Finding]],
) -> Callable[[Measures], list[Finding]]:
    """A rule that shares nothing with others."""
    return lambda own: check(own.laminate, own.limits)


def _sharing(
    check: Callable[[Laminate, Limits, Measures], list[Finding]],
) -> Callable[[Measures], list[Finding]]:
    """A rule that asks for what others ask for as well."""
    return lambda own: check(own.laminate, own.limits, own)


RULES = (
    Rule(bond_width.NAME, _sharing(bond_width.check)),
    Rule(mask_overhang.NAME, _sharing(mask_overhang.check)),
    Rule(facing_films.NAME, _sharing(facing_films.check), at_most=True),
    Rule(sealing.NAME, _alone(sealing.check), at_most=True),
    Rule(channel_clear.NAME, _alone(channel_clear.check)),
    Rule(tube_fit.NAME, _alone(tube_fit.check)),
    Rule(piece_count.NAME, _alone(piece_count.check), at_most=True),
    Rule(pin_holes.NAME, _alone(pin_holes.check), at_most=True),
    Rule(pin_fit.NAME, _alone(pin_fit.check), at_most=True),
    Rule(bridges.NAME, _alone(bridges.check)),
    Rule(scrap.NAME, _alone(scrap.check), at_most=True),
    Rule(film_limits.NAME, _alone(film_limits.check)),
    Rule(press_fit.NAME, _alone(press_fit.check), at_most=True),
    Rule(registration_nominal.NAME, _alone(registration_nominal.check), at_most=True),
    Rule(registration_worst_case.NAME, _sharing(registration_worst_case.check)),
    Rule(registration_yield.NAME, _sharing(registration_yield.check)),
)

AT_MOST = frozenset(rule.name for rule in RULES if rule.at_most)
"""Rules whose limit is the most that may be measured."""


def run_deck(
    laminate: Laminate, limits: Limits, progress: Progress | None = None
) -> tuple[Finding, ...]:
    """What every rule finds, in the deck's order; failures the user waived say so."""
    findings: list[Finding] = []
    measures = Measures(laminate, limits)
    for number, rule in enumerate(RULES):
        if progress is not None:
            progress(rule.name, number, len(RULES))
        findings += run_rule(rule, laminate, limits, measures)
    return tuple(findings)


def run_rule(
    rule: Rule, laminate: Laminate, limits: Limits, measures: Measures | None = None
) -> list[Finding]:
    """What one rule finds; failures the user waived and weakened limits say so.

    ``measures`` are those of the same laminate and limits, for rules that share them.
    """
    weak = lowered(limits, rule.name)
    return [
        _waived(finding) if rule.name in limits.waive and finding.verdict == "fail" else finding
        for finding in (
            _against(weak, found) for found in rule.check(measures or Measures(laminate, limits))
        )
    ]


def has_failed(findings: Iterable[Finding]) -> bool:
    """Whether a rule failed that nobody waived: then nothing may be cut."""
    return any(finding.verdict == "fail" for finding in findings)


def rule_names() -> tuple[str, ...]:
    return tuple(rule.name for rule in RULES)


def _against(weak: Sequence[str], finding: Finding) -> Finding:
    """The finding with the limits that the design lowers; a rule's own waivers need none."""
    if not weak or finding.verdict == "waived":
        return finding
    return replace(finding, message=f"{finding.message}; limits lowered: {', '.join(weak)}")


def _waived(finding: Finding) -> Finding:
    message = f"waived by the design: {finding.message}"
    return replace(finding, verdict="waived", by_user=True, message=message)


__all__ = ["AT_MOST", "RULES", "Limits", "Rule", "has_failed", "rule_names", "run_deck", "run_rule"]
