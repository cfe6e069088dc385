"""What the technician must know before starting; the rules' findings have their own page."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from sbafab.reports.traveller import quantities as say
from sbafab.reports.traveller.bill import kerf_states
from sbafab.reports.traveller.job import Work
from sbafab.rules.finding import Finding
from sbafab.rules.lowered import CHECKED_AGAINST


def cautions(work: Work) -> list[tuple[str, str]]:
    """Every warning once: a short title and what it says."""
    return list(dict.fromkeys(_all(work)))


def for_the_designer(findings: Iterable[Finding]) -> list[tuple[str, str]]:
    """Where the rules' warnings stand: nobody at the press can mend them; empty without any."""
    rules = {finding.rule for finding in findings if finding.verdict == "warn"}
    if not rules:
        return []
    words = (
        f"{say.count(len(rules), 'rule')} {'warns' if len(rules) == 1 else 'warn'}. findings.html "
        "says of what, and what helps; at the press do as the steps say."
    )
    return [("For the designer", words)]


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
    nominal = [material for material, _, measured in kerf_states(job, materials) if not measured]
    if nominal:
        yield (
            f"{' and '.join(nominal)} kerf uncalibrated",
            "edges are nominal, so outlines come out smaller and holes larger by half a kerf. "
            "Cut, measure and compute a calibration piece (“sbafab new coupon”, “sbafab kerf”), "
            "and generate again.",
        )
    if job.underlay is not None:
        yield (
            "Toner on the underlay",
            "laser toner softens in the press and may mark the release film or stick to it: print "
            "with ink if you can. Each print goes into the press once: paper dries there and "
            "shrinks. Not tried by us.",
        )
    for warning in schedule.warnings:
        if not warning.startswith(("made although", CHECKED_AGAINST)) and not _is_in_step(warning):
            yield "Press schedule", warning


def _is_in_step(warning: str) -> bool:
    """Whether the press step itself says it where the layer is laid."""
    return warning.endswith("align by hand")
