"""What the technician must know before starting."""

from __future__ import annotations

from collections.abc import Iterator

from sbafab.reports.traveller.bill import kerf_states
from sbafab.reports.traveller.job import Work
from sbafab.rules.lowered import CHECKED_AGAINST


def cautions(work: Work) -> list[tuple[str, str]]:
    """Every warning once: a short title and what it says."""
    return list(dict.fromkeys(_all(work)))


def _all(work: Work) -> Iterator[tuple[str, str]]:
    job, schedule = work.job, work.schedule
    films = list(dict.fromkeys(layer.film for layer in work.laminate.layers))
    materials = [film.material for film in films]
    for film in films:
        if film.warning:
            title = "PTFE fumes" if film.material == "PTFE" else f"Cutting {film.material}"
            yield title, film.warning
    if job.waived:
        yield (
            "Waived rules",
            f"made although the design waives {', '.join(job.waived)}. What they found: "
            + " / ".join(f.message for f in job.findings if f.by_user),
        )
    if job.lowered:
        yield (
            "Lowered limits",
            f"{CHECKED_AGAINST}{', '.join(job.lowered)}. What holds here may fail the usual "
            "limits: make sure that this is meant.",
        )
    for material, _, measured in kerf_states(job, materials):
        if not measured:
            yield (
                f"{material} kerf uncalibrated",
                "edges are nominal, so outlines come out smaller and holes larger by half a kerf. "
                "Make a calibration piece with “sbafab new coupon”, cut and measure it, compute "
                "the width with “sbafab kerf”, and generate again.",
            )
    for finding in job.findings:
        if finding.verdict == "warn":
            yield f"Rule {finding.rule} warns", finding.message
    for warning in schedule.warnings:
        if not warning.startswith(("made although", CHECKED_AGAINST)):
            yield "Press schedule", warning
