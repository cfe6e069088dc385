"""The rule deck: all rules in the order they are reported, and what runs them.

A rule is a file of this folder with a ``RULE``; ``design.records.RuleName`` lists them in order.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from importlib import import_module
from typing import get_args

from sbafab.design.records import RuleName
from sbafab.laminate.laminate import Laminate
from sbafab.process import Progress
from sbafab.rules.finding import Finding
from sbafab.rules.limits import Limits, lowered
from sbafab.rules.measures import Measures
from sbafab.rules.rule import Rule

RULES: tuple[Rule, ...] = tuple(
    import_module(f"sbafab.rules.{name.replace('-', '_')}").RULE for name in get_args(RuleName)
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
