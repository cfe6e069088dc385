"""The checks between the parts of an assembly, as findings; each has a stable name."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

from sbafab.assemblies import collisions, deployment, fits
from sbafab.assemblies.build import Assembled
from sbafab.assemblies.records import CheckName
from sbafab.rules.finding import Finding

CHECKS: Mapping[CheckName, Callable[[Assembled], Iterator[Finding]]] = {
    "tube-match": fits.tube_match,
    "inlet-match": fits.inlet_match,
    "line-clearance": fits.line_clearance,
    "seat": fits.seat,
    "collision": collisions.collision,
    "aperture": deployment.aperture,
    "lumen-pass": deployment.lumen_pass,
    "lumen-brace": deployment.lumen_brace,
}


def run_checks(assembled: Assembled) -> tuple[Finding, ...]:
    """What every check finds, in their order; failures that the assembly waives say so."""
    waive = assembled.assembly.rules.waive
    return tuple(
        _waived(finding) if name in waive and finding.verdict == "fail" else finding
        for name, check in CHECKS.items()
        for finding in check(assembled)
    )


def _waived(finding: Finding) -> Finding:
    message = f"waived by the assembly: {finding.message}"
    return replace(finding, verdict="waived", by_user=True, message=message)
