"""The rule deck: all rules in the order they are reported, and the functions that run them.

A rule is a file in this folder with a ``RULE``, whose name is in ``RuleName``, in order; or an
entry point of an installed package. A rule that cannot be loaded is an error: no design passes
without it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import get_args

from sbafab import plugins
from sbafab.design.records import Design
from sbafab.design.sections import RuleName
from sbafab.errors import DesignError
from sbafab.laminate.laminate import Laminate
from sbafab.plugins import Plugins
from sbafab.process import Progress
from sbafab.rules.finding import Finding, marked
from sbafab.rules.limits import lowered
from sbafab.rules.measures import Measures
from sbafab.rules.rule import Rule
from sbafab.rules.sentences import WORDS, Explanation, catalogue, explained

OWN = {name: f"sbafab.rules.{name.replace('-', '_')}:RULE" for name in get_args(RuleName)}


RULES: tuple[Rule, ...] = ()
for _name, _rule in Plugins(plugins.RULES, "rule", Rule, OWN).items():
    if _rule.name != _name:
        raise DesignError(f"rule {_name} of an installed package calls itself {_rule.name}")
    RULES += (_rule,)

AT_MOST = frozenset(rule.name for rule in RULES if rule.at_most)
"""Rules whose limit is the largest value allowed."""


def run_deck(
    laminate: Laminate, design: Design, progress: Progress | None = None
) -> tuple[Finding, ...]:
    """Return the findings of every rule in the deck's order; failures the user waived say so."""
    findings: list[Finding] = []
    measures = Measures(laminate, design)
    for number, rule in enumerate(RULES):
        if progress is not None:
            progress(rule.name, number, len(RULES))
        findings += run_rule(rule, measures)
    return tuple(findings)


def run_rule(rule: Rule, measures: Measures) -> list[Finding]:
    """Return the findings of a rule; failures the user waived and lowered limits are marked."""
    weak, waived = lowered(measures.design, rule.name), rule.name in measures.design.rules.waive
    return [marked(found, weak, "the design" if waived else "") for found in rule.check(measures)]


def has_failed(findings: Iterable[Finding]) -> bool:
    """Return True if a rule failed and is not waived; then nothing may be cut."""
    return any(finding.verdict == "fail" for finding in findings)


def rule_names() -> tuple[str, ...]:
    return tuple(rule.name for rule in RULES)


AS_BUILT = ("file-integrity", "manifest-claims", "as-designed")
"""The checks on a folder, beside the rules on what it will cut."""

EXPLAINED: Mapping[str, Explanation] = {rule.name: rule.explanation for rule in RULES} | {
    name: explained(name) for name in catalogue() if name not in (WORDS, *get_args(RuleName))
}
"""Explanations of all rules and checks by name, for ``sbafab explain`` and the reference pages."""
