"""Run the trials of a sweep: measure designs in local processes, or on a Dask cluster.

A trial consists of a design's rules with their margins, its predicted figures, and all its keys. As
a program this module measures designs one after another, and may be killed at any moment.
"""

from __future__ import annotations

import hashlib
import json
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from functools import cache
from itertools import islice
from pathlib import Path
from typing import IO, Any, Literal

import sbafab
from sbafab.actuators import records
from sbafab.design.files import checked as checked_record
from sbafab.design.identity import design_sha256
from sbafab.errors import DesignError, OutputError, SbafabError
from sbafab.folders.build import Build, make_build, refuse_undoable
from sbafab.models.calibration import factors_of
from sbafab.models.figures import PredictionRequest
from sbafab.models.prediction import predict
from sbafab.plugins import FAMILIES, RULES, installed
from sbafab.rules.deck import AT_MOST
from sbafab.rules.finding import Finding, decisive
from sbafab.runtime import prepare, processors
from sbafab.search.quantities import RequestedQuantity, read_quantity
from sbafab.search.quantities import measured as measured_quantity
from sbafab.search.vary import key_values

SweepOutcome = Literal["passes", "fails", "refused", "crashed", "too long"]
"""Every rule passes; a rule failed; the design cannot be made; its process died; or took too long.
"""
SweepRow = dict[str, Any]
"""The measurements of one design, as JSON values. ``outcome`` and ``reason`` are always present;
``sha256``, ``keys``, ``rules``, ``yield`` (share of good builds and the ends of its interval),
``figures`` by their ``FigureKey`` if the design could be measured so far, the ``quantities`` that
have limits (value, column, and the reason if there is no value), and the messages of the rules that
``failed``."""


def measured(
    tables: Mapping[str, Any],
    folder: str,
    values: Mapping[str, Any],
    pressures: Sequence[float],
    quantities: Sequence[str] = (),
) -> SweepRow:
    """Return the row of the design in ``tables`` with ``values`` set; never raises a SbafabError.

    Relative paths are based on ``folder``; ``pressures`` in kPa apply to forces and strokes;
    ``quantities`` are labels of those with limits.
    """
    row: SweepRow = {"outcome": "refused", "reason": ""}
    families = records()
    try:
        base = checked_record(families[tables["family"]], tables, families).placed(Path(folder))
        design = base.with_(dict(values))
        row |= {"keys": key_values(design), "sha256": design_sha256(design)}
        made_build = make_build(design)
        worst = worst_findings(made_build.findings)
        row["rules"] = {
            name: [rule.verdict, margin(rule), rule.measured, rule.limit, rule.unit]
            for name, rule in worst.items()
        }
        shares = ([each.measured, *each.interval] for each in made_build.findings if each.interval)
        row["yield"] = next(shares, [])
        # Figures have no intervals here: with the factors given, none are computed.
        request = PredictionRequest(tuple(pressures), calibration=factors_of(design))
        figures = predict(design, request, made_build.laminate).figures
        row["figures"] = {str(figure.key): figure.as_dict()["value"] for figure in figures}
        _add_quantities(row, [read_quantity(text) for text in quantities], made_build)
        failed = {name: rule.message for name, rule in worst.items() if rule.verdict == "fail"}
        if failed:
            return row | failure(failed)
        refuse_undoable([made_build])
        return row | {"outcome": "passes"}
    except SbafabError as error:
        return row | {"reason": _one_line(error)}


def failure(messages: Mapping[str, str]) -> SweepRow:
    """Return the outcome of a failing design, from the message of each rule and limit."""
    reason = " | ".join(f"{name}: {message}" for name, message in messages.items())
    return {"outcome": "fails", "failed": dict(messages), "reason": reason}


def _add_quantities(row: SweepRow, quantities: Sequence[RequestedQuantity], of: Build) -> None:
    """Add quantities to a row, and those of their figures that it lacks."""
    good = row["yield"][0] if row["yield"] else None
    kpa = [quantity.kpa for quantity in quantities if quantity.kpa is not None]
    row["quantities"] = {}
    for each in quantities:
        column = each.key or each.name
        try:
            value, figure = measured_quantity(each, of.design, of.laminate, good, kpa)
        except DesignError as error:
            row["quantities"][each.label] = [None, "", _one_line(error)]
            continue
        if figure is not None:
            column = figure.key.heading
            row["figures"].setdefault(str(figure.key), figure.as_dict()["value"])
        row["quantities"][each.label] = [value, column, ""]


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())


# The margin of each rule: its findings as one verdict and one margin.


def margin(finding: Finding) -> float | None:
    """Return the margin of the value to its limit in its unit, below 0 if the rule fails; None if
    nothing was measured, or without a limit.
    """
    if finding.measured is None or finding.limit is None:
        return None
    more = finding.measured - finding.limit
    return round(-more if finding.rule in AT_MOST else more, 6)


def margin_share(finding: Finding) -> float | None:
    """Return the margin as a share of the limit, unless that is 0."""
    left = margin(finding)
    return left / finding.limit if left is not None and finding.limit else left


def worst_findings(findings: Iterable[Finding]) -> dict[str, Finding]:
    """Return the worst finding of each rule, in the deck's order; findings waived by the rule
    itself are ignored.
    """
    judged = [finding for finding in findings if finding.verdict != "waived" or finding.by_user]
    worst = decisive(sorted(judged, key=lambda finding: margin_share(finding) or 0.0))
    return {finding.rule: worst[finding.rule] for finding in judged}


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
    """Measure designs until standard input ends."""
    # Ctrl-C goes to all processes of a terminal; the parent ends this one.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    prepare()
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8", newline="\n")
    # Output of libraries must not mix with the answers.
    os.dup2(2, 1)
    jobs: queue.SimpleQueue[str] = queue.SimpleQueue()
    threading.Thread(target=_read, args=(sys.stdin, jobs), daemon=True).start()
    while True:
        answers.write(json.dumps(_answer(json.loads(jobs.get()))) + "\n")
        answers.flush()


def _read(lines: IO[str], jobs: queue.SimpleQueue[str]) -> None:
    for line in lines:
        jobs.put(line)
    os._exit(0)


def _answer(job: dict[str, Any]) -> SweepRow:
    if job.pop("program") != fingerprint():
        return {"outcome": "unlike", "reason": fingerprint()}
    began = time.perf_counter()
    try:
        row = measured(**job)
    except Exception as error:
        row = _crashed(error)
    return row | {"seconds": round(time.perf_counter() - began, 4)}


def _crashed(error: Exception | str) -> SweepRow:
    reason = error if isinstance(error, str) else f"{type(error).__name__}: {_one_line(error)}"
    return {"outcome": "crashed", "reason": reason, "seconds": 0.0}


# Jobs in parallel, in threads of this machine or on a Dask cluster: an executor either way.
# Each thread hands its jobs to its own process, which is killed after the time limit.


AHEAD = 3
"""Jobs handed to a worker before it finishes the first."""
POLL = 1.0
"""Interval of progress calls while waiting, s."""
CONNECT = 10
"""Time for a scheduler to answer, s."""
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""One numeric thread per process: several processes already share the processors."""
ATTEMPTS = 2
"""A process may be killed from outside; a design that kills two in a row is to blame."""
COMMAND = (sys.executable, "-m", "sbafab.search.trials")
MeasureJob = dict[str, Any]
"""The keyword arguments of ``measured``, and the ``program`` version required."""
Pool = tuple[Executor, int]
"""An executor that runs ``guarded``, and the number of its workers."""


@contextmanager
def local_pool(workers: int | None = None) -> Iterator[Pool]:
    """One thread per worker, each with its own process; none outlives the block."""
    size = workers or processors()
    _may_start.set()
    executor = ThreadPoolExecutor(size)
    try:
        yield executor, size
    finally:
        # Killed processes release the threads that wait for them.
        executor.shutdown(wait=False, cancel_futures=True)
        close_all()
        executor.shutdown()


@contextmanager
def dask_pool(address: str) -> Iterator[Pool]:
    """The workers of the cluster behind a scheduler's address, which must have sbafab installed.

    Raises OutputError without a scheduler, DesignError without the extra.
    """
    try:
        from distributed import Client
    except ImportError:
        raise DesignError('Dask is not installed: pip install "sbafab[dask]"') from None
    try:
        client: Any = Client(address, timeout=CONNECT)
    except (OSError, ValueError) as error:
        raise OutputError(
            f"no Dask scheduler answers at {address} ({_one_line(error)}); start one with `dask "
            "scheduler`, or name its address, such as tcp://127.0.0.1:8786"
        ) from None
    with client:
        yield client.get_executor(), max(1, sum(client.nthreads().values()))


def run_jobs(
    pool: Pool, jobs: Iterable[tuple[str, MeasureJob]], seconds: float
) -> Generator[tuple[str, SweepRow] | None, None, None]:
    """Run every job once and yield its key and row as soon as it ends, in any order; and None in
    every second in which no job ends.

    Few jobs are pending at any time, so that memory does not grow with their number.
    """
    executor, size = pool
    remaining = iter(jobs)
    running: dict[Future[SweepRow], str] = {}
    try:
        while True:
            for key, job in islice(remaining, AHEAD * size - len(running)):
                running[executor.submit(guarded, job, seconds)] = key
            if not running:
                return
            ended, _ = wait(running, timeout=POLL, return_when=FIRST_COMPLETED)
            if not ended:
                yield None
            for future in ended:
                yield running.pop(future), _row(future)
    finally:
        for future in running:
            future.cancel()


def _row(future: Future[SweepRow]) -> SweepRow:
    try:
        row = future.result()
    except Exception as error:
        # A cluster gives up a job after its workers died several times.
        return _crashed(error)
    if row["outcome"] == "unlike":
        raise OutputError(
            f"a worker runs sbafab {row['reason']} and this is {fingerprint()}; install the same "
            "version there"
        )
    return row


_thread = threading.local()
_children: set[subprocess.Popen[str]] = set()
"""The running processes; changed with ``_lock`` held."""
_lock = threading.Lock()
_may_start = threading.Event()
_may_start.set()


def guarded(job: MeasureJob, seconds: float) -> SweepRow:
    """The row of a job, measured in this thread's own process; dead processes are replaced."""
    row: SweepRow = {}
    for _ in range(ATTEMPTS):
        child = getattr(_thread, "child", None)
        if child is None or child.poll() is not None:
            child = _thread.child = _child()
        row = _measured_by(child, job, seconds)
        # A crash that Python could still report is reported in the same way on a retry.
        if row["outcome"] != "crashed" or child.poll() is None:
            return row
    return row


def _child() -> subprocess.Popen[str]:
    """Start a process that measures."""
    alone = {name: os.environ.get(name, "1") for name in ONE_THREAD}
    path = os.pathsep.join(filter(None, sys.path))
    with _lock:
        if not _may_start.is_set():
            raise RuntimeError("no process is started any more")
        child = subprocess.Popen(
            COMMAND,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            encoding="utf-8",
            env={**os.environ, **alone, "PYTHONPATH": path},
        )
        _children.add(child)
    return child


def _measured_by(child: subprocess.Popen[str], job: MeasureJob, seconds: float) -> SweepRow:
    """The row of a job; a row with the reason if the process dies or takes too long."""
    assert child.stdin is not None
    assert child.stdout is not None
    clock = threading.Timer(seconds, child.kill)
    clock.daemon = True
    clock.start()
    line = ""
    with suppress(OSError, ValueError):
        child.stdin.write(json.dumps(job) + "\n")
        child.stdin.flush()
        line = child.stdout.readline()
    is_late = not clock.is_alive()
    clock.cancel()
    if line.endswith("\n"):
        row: SweepRow = json.loads(line)
        return row
    _close(child)
    if is_late:
        reason = f"stopped after {seconds:g} s; --timeout gives it longer"
        return {"outcome": "too long", "reason": reason, "seconds": seconds}
    return _crashed(_exit_reason(child.returncode))


def close_all() -> None:
    """Kill the processes started by threads of this process, and prevent new ones."""
    with _lock:
        _may_start.clear()
        children = list(_children)
    for child in children:
        _close(child)


def _close(child: subprocess.Popen[str]) -> None:
    """Kill a process and wait until it is gone."""
    child.kill()
    child.wait()
    _children.discard(child)
    for stream in (child.stdin, child.stdout):
        with suppress(OSError):
            if stream is not None:
                stream.close()


def _exit_reason(code: int) -> str:
    if code >= 0:
        return f"its process ended with exit code {code}"
    with suppress(ValueError):
        return f"its process was killed by {signal.Signals(-code).name}"
    return f"its process was killed by signal {-code}"


if __name__ == "__main__":
    main()
