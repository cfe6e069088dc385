"""A margin is below 0 just where a rule fails, whichever way its limit counts."""

from __future__ import annotations

from dataclasses import replace

import pytest

import sbafab
from sbafab.rules.finding import Finding, Findings, Place
from sbafab.rules.limits import TOLERANCE
from sbafab.search.trials import margin, worst_findings

FAULTY = (
    {"bond.width": 0.6, "mask.overhang": 0.3, "laser.least_feature": 1.2},
    {"press.platen_width": 7, "registration.pin_stretch": 0.1, "rules.worst_bond_width": 0.7},
    {"rules.target_yield": 0.999, "inlet.width": 1.5},
)


def _findings(name: str, changes: dict[str, float]) -> Findings:
    return sbafab.check(name, {"rules.yield_builds": 100, **changes})


@pytest.mark.parametrize("changes", FAULTY, ids=lambda changes: next(iter(changes)))
def test_what_fails_has_a_margin_below_zero(changes: dict[str, float]) -> None:
    findings = _findings("1dof-5mm", changes)
    assert len({finding.rule for finding in findings.failed}) >= len(changes)
    for finding in findings:
        left = margin(finding)
        if finding.verdict == "fail":
            assert left is not None
            assert left < 0
        elif finding.verdict == "pass" and left is not None:
            assert left >= -2 * TOLERANCE
    for rule in {finding.rule for finding in findings.failed}:
        assert worst_findings(findings)[rule].verdict == "fail"


def test_a_rules_worst_finding_is_the_one_that_counts() -> None:
    better = Finding("bond-width", "pass", 0.75, 0.8, "mm", Place(), "")
    worse = replace(better, measured=0.76)
    flush = replace(better, verdict="waived", measured=0.0)
    asked = replace(better, verdict="waived", measured=0.7, waived_by="the design")
    assert margin(worst_findings([better, worse, flush])["bond-width"]) == pytest.approx(0.01)
    assert margin(worst_findings([better, asked, worse])["bond-width"]) == pytest.approx(-0.05)
    assert worst_findings([flush]) == {}


def test_a_most_counts_the_other_way() -> None:
    most = Finding("press-fit", "pass", 152.4, 20.0, "mm", Place(), "")
    assert margin(most) == pytest.approx(132.4)
    assert margin(replace(most, limit=None)) is None
