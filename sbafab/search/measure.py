"""Measure one design: rules with their margins, predicted figures, and all its keys.

As a program it measures designs one after the other, and may be killed at any moment.
"""

from __future__ import annotations

import hashlib
import json
import os
import queue
import signal
import sys
import threading
import time
from collections.abc import Iterable, Mapping, Sequence
from functools import cache, lru_cache
from pathlib import Path
from typing import IO, Any, Literal, NamedTuple

import sbafab
from sbafab.actuators import records
from sbafab.design.files import checked as checked_record
from sbafab.design.identity import design_sha256
from sbafab.design.records import Design, keys_of
from sbafab.errors import SbafabError
from sbafab.models.figures import PredictionRequest
from sbafab.models.intervals import factors_of
from sbafab.models.prediction import predict
from sbafab.output.checked import check, refuse_undoable
from sbafab.plugins import FAMILIES, RULES, installed
from sbafab.process import prepare
from sbafab.rules.deck import AT_MOST
from sbafab.rules.finding import Finding, Place, Verdict

SweepOutcome = Literal["passes", "fails", "refused", "crashed", "too long"]
"""Every rule passes; a rule failed; the design cannot be made; its process died; or took too long.
"""
SweepRow = dict[str, Any]
"""The measurements of one design, as JSON values. ``outcome`` and ``reason`` are always present;
``sha256``, ``keys``, ``rules``, ``yield`` (share of good builds and the ends of its interval),
``figures`` by their ``FigureKey`` if the design could be measured so far, and the messages of the
rules that ``failed``."""


def measured(
    tables: Mapping[str, Any], folder: str, values: Mapping[str, Any], pressures: Sequence[float]
) -> SweepRow:
    """Return the row of the design in ``tables`` with ``values`` set; never raises a SbafabError.

    Relative paths start at ``folder``; ``pressures``, kPa, are for forces and strokes.
    """
    row: SweepRow = {"outcome": "refused", "reason": ""}
    try:
        design = _base(json.dumps(tables), folder).with_(dict(values))
        row["keys"] = {key: value for key, value, _ in keys_of(design)}
        row["sha256"] = design_sha256(design)
        _measure(design, pressures, row)
    except SbafabError as error:
        row["reason"] = " ".join(str(error).split())
    return row


@lru_cache(maxsize=4)
def _base(tables: str, folder: str) -> Design:
    data = json.loads(tables)
    families = records()
    return checked_record(families[data["family"]], data, families).placed(Path(folder))


def _measure(design: Design, pressures: Sequence[float], row: SweepRow) -> None:
    checked = check(design)
    worst = margins(checked.findings)
    row["rules"] = {
        name: [rule.verdict, rule.margin, rule.measured, rule.limit, rule.unit]
        for name, rule in worst.items()
    }
    row["yield"] = next(
        ([each.measured, *each.interval] for each in checked.findings if each.interval), []
    )
    # Figures have no intervals here: with the factors given, none are computed.
    request = PredictionRequest(tuple(pressures), calibration=factors_of(design))
    prediction = predict(design, request, checked.laminate)
    row["figures"] = {str(figure.key): figure.as_dict()["value"] for figure in prediction.figures}
    if checked.failed:
        failed = {name: rule.message for name, rule in worst.items() if rule.verdict == "fail"}
        row["outcome"], row["failed"] = "fails", failed
        row["reason"] = " | ".join(f"{name}: {message}" for name, message in failed.items())
        return
    refuse_undoable([checked])
    row["outcome"] = "passes"


# The margin of each rule: its findings as one verdict and one margin.


ORDER: tuple[Verdict, ...] = ("fail", "waived", "warn", "pass")


class RuleMargin(NamedTuple):
    """A rule's worst verdict, and the margin of the worst value to its limit: below 0 it fails.

    ``margin`` is None if nothing was measured, or if there is no limit.
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
        """The margin as a share of the limit, unless that is 0."""
        if self.margin is None:
            return None
        return self.margin / self.limit if self.limit else self.margin


def margin_of(finding: Finding) -> float | None:
    """Margin of a finding to its limit, in its unit."""
    if finding.measured is None or finding.limit is None:
        return None
    more = finding.measured - finding.limit
    return round(-more if finding.rule in AT_MOST else more, 6)


def margins(findings: Iterable[Finding]) -> dict[str, RuleMargin]:
    """The worst of each rule, in the deck's order; findings waived by the rule itself are
    ignored.
    """
    worst: dict[str, RuleMargin] = {}
    for finding in findings:
        if finding.verdict == "waived" and not finding.by_user:
            continue
        margin = RuleMargin(
            finding.rule,
            finding.verdict,
            margin_of(finding),
            finding.measured,
            finding.limit,
            finding.unit,
            finding.where,
            finding.message,
        )
        before = worst.get(finding.rule)
        if before is None or _severity(margin) < _severity(before):
            worst[finding.rule] = margin
    return worst


def _severity(margin: RuleMargin) -> tuple[int, float]:
    """Sort key of a margin: the worse, the smaller."""
    share = margin.share
    return ORDER.index(margin.verdict), share if share is not None else 0.0


# The exact version of the program: rows of different versions are never mixed.


@cache
def fingerprint() -> str:
    """The version, and a hash of the package's source and of the packages that add to it."""
    root = Path(sbafab.__file__).parent
    total = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        total.update(path.relative_to(root).as_posix().encode())
        total.update(path.read_bytes())
    for entry in (*installed(FAMILIES), *installed(RULES)):
        version = entry.dist.version if entry.dist else ""
        total.update(f"{entry.name} {entry.value} {version}".encode())
    return f"{sbafab.__version__}+{total.hexdigest()[:12]}"


# The process: one job per line from standard input, one row per line to standard output. It ends
# when its input ends, because the parent is gone, even in the middle of a job.


def main() -> None:
    """Measures until standard input ends."""
    # Ctrl-C goes to all processes of a terminal; the parent ends this one.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    prepare()
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8", newline="\n")
    # Output of libraries must not mix with the answers.
    os.dup2(2, 1)
    jobs: queue.SimpleQueue[str] = queue.SimpleQueue()
    threading.Thread(target=_read, args=(sys.stdin, jobs), daemon=True).start()
    while True:
        job = json.loads(jobs.get())
        answers.write(json.dumps(_answer(job)) + "\n")
        answers.flush()


def _read(lines: IO[str], jobs: queue.SimpleQueue[str]) -> None:
    for line in lines:
        jobs.put(line)
    os._exit(0)


def _answer(job: dict[str, Any]) -> dict[str, Any]:
    if job.pop("program") != fingerprint():
        return {"outcome": "unlike", "reason": fingerprint()}
    began = time.perf_counter()
    try:
        row = measured(**job)
    except Exception as error:
        message = " ".join(str(error).split())
        row = {"outcome": "crashed", "reason": f"{type(error).__name__}: {message}"}
    row["seconds"] = round(time.perf_counter() - began, 4)
    return row


if __name__ == "__main__":
    main()
