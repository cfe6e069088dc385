"""The checks between the parts of an assembly, as findings; each has a stable name."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

from sbafab.assemblies import collisions, deployment, fits, supply
from sbafab.assemblies.build import Assembled
from sbafab.assemblies.records import AssemblyRules, CheckName
from sbafab.rules.finding import Finding
from sbafab.rules.lowered import weakened

CHECKS: Mapping[CheckName, Callable[[Assembled], Iterator[Finding]]] = {
    "tube-match": fits.tube_match,
    "inlet-match": fits.inlet_match,
    "line-clearance": fits.line_clearance,
    "seat": fits.seat,
    "collision": collisions.collision,
    "aperture": deployment.aperture,
    "lumen-pass": deployment.lumen_pass,
    "lumen-brace": deployment.lumen_brace,
    "supply-tubes": supply.supply_tubes,
}

AT_MOST: frozenset[CheckName] = frozenset(
    ("tube-match", "inlet-match", "collision", "aperture", "lumen-pass", "supply-tubes")
)
"""Checks whose limit is the most that may be measured; of all others it is the least."""


def run_checks(assembled: Assembled) -> tuple[Finding, ...]:
    """What every check finds, in their order; failures that the assembly waives say so."""
    rules = assembled.assembly.rules
    return tuple(
        _waived(finding) if name in rules.waive and finding.verdict == "fail" else finding
        for name, check in CHECKS.items()
        for finding in (_against(lowered_checks(rules, name), found) for found in check(assembled))
    )


def lowered_checks(rules: AssemblyRules, name: str | None = None) -> tuple[str, ...]:
    """Each limit (of one check) that an assembly weakens, with its value and the usual one."""
    usual = AssemblyRules()
    keys = (
        ("line-clearance", "line_clearance", rules.line_clearance < usual.line_clearance),
        ("tube-match", "tube_tolerance", rules.tube_tolerance > usual.tube_tolerance),
        ("seat", "seat_share", rules.seat_share < usual.seat_share),
    )
    return tuple(
        weakened(key, getattr(rules, key), getattr(usual, key), "default")
        for check, key, is_weaker in keys
        if is_weaker and name in (None, check)
    )


def _against(weak: tuple[str, ...], finding: Finding) -> Finding:
    if not weak:
        return finding
    return replace(finding, message=f"{finding.message}; limits lowered: {', '.join(weak)}")


def _waived(finding: Finding) -> Finding:
    message = f"waived by the assembly: {finding.message}"
    return replace(finding, verdict="waived", by_user=True, message=message)
