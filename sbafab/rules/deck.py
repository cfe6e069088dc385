"""The rule deck: all rules in the order they are reported, and the functions that run them.

A rule is a file in this folder with a ``RULE`` and a table in ``sentences.toml``, in order; or an
entry point of an installed package. A rule that cannot be loaded is an error: no design passes
without it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from sbafab import catalogue, plugins
from sbafab.design.records import Design
from sbafab.errors import DesignError
from sbafab.laminate.laminate import Laminate
from sbafab.plugins import Plugins
from sbafab.rules.finding import Finding, marked
from sbafab.rules.limits import lowered
from sbafab.rules.measures import Measures
from sbafab.rules.rule import Rule
from sbafab.rules.sentences import Explanation, explained
from sbafab.runtime import Progress

OWN = {name: f"sbafab.rules.{name.replace('-', '_')}:RULE" for name in catalogue.names("rules")}


RULES: tuple[Rule, ...] = ()
for _name, _rule in Plugins(plugins.RULES, "rule", Rule, OWN).items():
    if _rule.name != _name:
        raise DesignError(f"rule {_name} of an installed package calls itself {_rule.name}")
    RULES += (_rule,)


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
    return [
        marked(finding, weak, "the design" if waived else "") for finding in rule.check(measures)
    ]


def has_failed(findings: Iterable[Finding]) -> bool:
    """Return True if a rule failed and is not waived; then nothing may be cut."""
    return any(finding.verdict == "fail" for finding in findings)


EXPLAINED: Mapping[str, Explanation] = {rule.name: rule.explanation for rule in RULES} | {
    name: explained(name)
    for group in ("assemblies", "folders", "netlists")
    for name in catalogue.names(group)
}
"""Explanations of all rules and checks by name, for ``sbafab explain`` and the reference pages."""

AT_MOST = frozenset(
    (
        *(rule.name for rule in RULES if rule.at_most),
        *(name for name, explanation in EXPLAINED.items() if explanation.at_most),
    )
)
"""Rules and checks whose limit is the largest value allowed."""
