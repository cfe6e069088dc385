"""How far each rule is from failing: its findings as one verdict and one margin."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from sbafab.rules.deck import AT_MOST
from sbafab.rules.finding import Finding, Place, Verdict

ORDER: tuple[Verdict, ...] = ("fail", "waived", "warn", "pass")


class RuleMargin(NamedTuple):
    """A rule's worst verdict, and by how much the worst value keeps its limit: below 0 it does not.

    ``margin`` is None where nothing was measured, or where there is no limit.
    """

    rule: str
    verdict: Verdict
    margin: float | None
    measured: float | None
    limit: float | None
    unit: str
    where: Place
    message: str

    @property
    def share(self) -> float | None:
        """The margin as a share of the limit, where that is not 0."""
        if self.margin is None:
            return None
        return self.margin / self.limit if self.limit else self.margin


def margin_of(finding: Finding) -> float | None:
    """By how much a finding keeps its limit, in its unit."""
    if finding.measured is None or finding.limit is None:
        return None
    more = finding.measured - finding.limit
    return round(-more if finding.rule in AT_MOST else more, 6)


def margins(findings: Iterable[Finding]) -> dict[str, RuleMargin]:
    """The worst of each rule, in the deck's order; what a rule waives by itself counts for none."""
    found: dict[str, RuleMargin] = {}
    for finding in findings:
        if finding.verdict == "waived" and not finding.by_user:
            continue
        own = RuleMargin(
            finding.rule,
            finding.verdict,
            margin_of(finding),
            finding.measured,
            finding.limit,
            finding.unit,
            finding.where,
            finding.message,
        )
        before = found.get(finding.rule)
        if before is None or _badness(own) < _badness(before):
            found[finding.rule] = own
    return found


def _badness(one: RuleMargin) -> tuple[int, float]:
    """The worse, the smaller."""
    share = one.share
    return ORDER.index(one.verdict), share if share is not None else 0.0
