"""A run reads what it has written, as ``sbafab check`` would, before it is swapped in."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from sbafab.as_built.check import check_written
from sbafab.as_built.expected import Meant, RunWork
from sbafab.as_built.records import CLAIMS, DESIGNED, INTEGRITY
from sbafab.errors import DefectError, OutputError
from sbafab.output.batch import Batch
from sbafab.output.checked import Planned
from sbafab.process import Progress
from sbafab.rules.finding import Finding

MOST_NAMED = 3


def refuse_unlike(batch: Batch, folder: Path, tell: Progress) -> None:
    """Raises DefectError where the files of a folder are not what its designs were found to be.

    The folder is then not swapped in, for either the files or the check of them are wrong, and no
    user can tell which. Raises OutputError where the chords that were asked for are too coarse.
    """
    tell("reading back", 0, 1)
    curves = batch.settings.curves
    works = {one.checked.design.name: _work(one) for one in batch.designs}
    failed = [finding for finding in check_written(folder, works) if finding.verdict == "fail"]
    if not failed:
        return
    said = _said(failed)
    if curves.in_chords:
        raise OutputError(
            f"drawn with chords, the cut files do not hold: {said}; nothing was written: ask for "
            f"a smaller --chord-error than {curves.chord_error:g}, or for arcs or bulges"
        )
    raise DefectError(
        f"the design holds and its cut files do not: {said}; this is a defect of sbafab and "
        "nothing was written: please report this sentence with the design file"
    )


def _work(planned: Planned) -> RunWork:
    """What a run knows of a design: its laminate, the beam's paths by pattern, the findings."""
    checked = planned.checked
    return RunWork(Meant(checked.laminate, planned.paths), checked.findings)


def _said(failed: Iterable[Finding]) -> str:
    """The first finding of each rule; what is cut first, what is claimed of it last."""
    first: dict[str, Finding] = {}
    for finding in failed:
        first.setdefault(finding.rule, finding)
    order = {DESIGNED: 0, INTEGRITY: 1, CLAIMS: 3}
    told = [
        f"{finding.rule}: {finding.message.rstrip('.')}"
        for finding in sorted(first.values(), key=lambda finding: order.get(finding.rule, 2))
    ]
    rest = len(told) - MOST_NAMED
    more = "" if rest <= 0 else "; 1 more rule fails" if rest == 1 else f"; {rest} more rules fail"
    return "; ".join(told[:MOST_NAMED]) + more
