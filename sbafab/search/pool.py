"""Run jobs in parallel: in threads of this machine, or on a Dask cluster."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from typing import Any, NamedTuple

from sbafab.errors import DesignError, OutputError
from sbafab.process import processors
from sbafab.search.measure import SweepRow, fingerprint

AHEAD = 3
"""Jobs handed to a worker before it finishes the first."""
POLL = 1.0
"""Interval of progress calls while waiting, s."""
CONNECT = 10
"""Time for a scheduler to answer, s."""
DASK_EXTRA = 'Dask is not installed: pip install "sbafab[dask]"'


class Pool(NamedTuple):
    """Runs ``guarded`` on its workers; ``size`` of them at a time."""

    executor: Executor
    size: int


@contextmanager
def local_pool(workers: int | None = None) -> Iterator[Pool]:
    """One thread per worker, each with its own process; none outlives the block."""
    size = workers or processors()
    open_all()
    executor = ThreadPoolExecutor(size)
    try:
        yield Pool(executor, size)
    finally:
        # Killed processes release the threads that wait for them.
        executor.shutdown(wait=False, cancel_futures=True)
        close_all()
        executor.shutdown()


@contextmanager
def dask_pool(address: str) -> Iterator[Pool]:
    """The workers of the cluster behind a scheduler's address, which must have sbafab installed.

    Raises OutputError if there is no scheduler, DesignError without the extra.
    """
    try:
        from distributed import Client

        untyped: Any = Client
    except ImportError:
        raise DesignError(DASK_EXTRA) from None
    try:
        client: Any = untyped(address, timeout=CONNECT)
    except (OSError, ValueError) as error:
        message = " ".join(str(error).split())
        raise OutputError(
            f"no Dask scheduler answers at {address} ({message}); start one with `dask scheduler`, "
            "or name its address, such as tcp://127.0.0.1:8786"
        ) from None
    try:
        size = sum(client.nthreads().values())
        yield Pool(client.get_executor(), max(1, size))
    finally:
        client.close()


def run_jobs(
    pool: Pool,
    jobs: Iterable[tuple[str, MeasureJob]],
    seconds: float,
    done: Callable[[str, SweepRow], None],
    waiting: Callable[[], None],
) -> None:
    """Run every job once and pass its key and row to ``done`` as soon as it ends, in any order.

    Few jobs are pending at any time, so that memory does not grow with their number. ``waiting`` is
    called in every second in which no job ends.
    """
    remaining = iter(jobs)
    running: dict[Future[SweepRow], str] = {}
    room = AHEAD * pool.size
    try:
        while True:
            for key, job in _first(remaining, room - len(running)):
                running[pool.executor.submit(guarded, job, seconds)] = key
            if not running:
                return
            ended, _ = wait(running, timeout=POLL, return_when=FIRST_COMPLETED)
            if not ended:
                waiting()
            for future in ended:
                done(running.pop(future), _row(future))
    finally:
        for future in running:
            future.cancel()


def _first(jobs: Iterator[tuple[str, MeasureJob]], count: int) -> Iterator[tuple[str, MeasureJob]]:
    for _ in range(count):
        job = next(jobs, None)
        if job is None:
            return
        yield job


def _row(future: Future[SweepRow]) -> SweepRow:
    try:
        row = future.result()
    except Exception as error:
        # A cluster gives up a job after its workers died several times.
        message = " ".join(str(error).split())[:300]
        row = {"outcome": "crashed", "reason": f"{type(error).__name__}: {message}", "seconds": 0.0}
    if row["outcome"] == "unlike":
        raise OutputError(
            f"a worker runs sbafab {row['reason']} and this is {fingerprint()}; install the same "
            "version there"
        )
    return row


# Each thread hands its jobs to its own process, which is killed after the time limit.
#
# The same function runs in threads of this process and of a Dask worker.


ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""One numeric thread per process: several processes already share the processors."""
ATTEMPTS = 2
"""A process may be killed from outside; a design that kills two in a row is to blame."""

COMMAND = (sys.executable, "-m", "sbafab.search.measure")

MeasureJob = dict[str, Any]
"""The keyword arguments of ``measured``, and the ``program`` version required."""

_thread = threading.local()


class _Started:
    """The running processes, and whether more may be started."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.children: set[Child] = set()
        self.may_start = True


_started = _Started()


class Child:
    """A running process of ``sbafab.search.measure``."""

    def __init__(self) -> None:
        alone = {name: os.environ.get(name, "1") for name in ONE_THREAD}
        with _started.lock:
            if not _started.may_start:
                raise RuntimeError("no process is started any more")
            self._process = subprocess.Popen(
                COMMAND,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
                encoding="utf-8",
                env={**os.environ, **alone, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            )
            _started.children.add(self)

    def answer(self, job: MeasureJob, seconds: float) -> SweepRow:
        """The row of a job; a row with the reason if the process dies or takes too long."""
        late = threading.Event()

        def stop() -> None:
            late.set()
            self._process.kill()

        clock = threading.Timer(seconds, stop)
        clock.daemon = True
        clock.start()
        try:
            line = self._exchange(json.dumps(job))
        finally:
            clock.cancel()
        if line.endswith("\n"):
            row: SweepRow = json.loads(line)
            return row
        self.close()
        if late.is_set():
            reason = f"stopped after {seconds:g} s; --timeout gives it longer"
            return {"outcome": "too long", "reason": reason, "seconds": seconds}
        return {
            "outcome": "crashed",
            "reason": _exit_reason(self._process.returncode),
            "seconds": 0.0,
        }

    def _exchange(self, job: str) -> str:
        """The answer to a line, truncated if the process died."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        with suppress(OSError, ValueError):
            self._process.stdin.write(job + "\n")
            self._process.stdin.flush()
            return self._process.stdout.readline()
        return ""

    @property
    def is_alive(self) -> bool:
        return self._process.poll() is None

    def close(self) -> None:
        """Kills the process and waits until it is gone."""
        self._process.kill()
        self._process.wait()
        _started.children.discard(self)
        for stream in (self._process.stdin, self._process.stdout):
            with suppress(OSError):
                if stream is not None:
                    stream.close()


def guarded(job: MeasureJob, seconds: float) -> SweepRow:
    """The row of a job, measured in this thread's own process; dead processes are replaced."""
    row: SweepRow = {}
    for _ in range(ATTEMPTS):
        child = getattr(_thread, "child", None)
        if child is None or not child.is_alive:
            if child is not None:
                child.close()
            child = _thread.child = Child()
        row = child.answer(job, seconds)
        # A crash that Python could still report is reported in the same way on a retry.
        if row["outcome"] != "crashed" or child.is_alive:
            return row
    return row


def open_all() -> None:
    """Lets threads of this process start processes again."""
    with _started.lock:
        _started.may_start = True


def close_all() -> None:
    """Kills the processes started by threads of this process, and prevents new ones."""
    with _started.lock:
        _started.may_start = False
        children = list(_started.children)
    for child in children:
        child.close()


def _exit_reason(code: int | None) -> str:
    if code is None or code >= 0:
        return f"its process ended with exit code {code}"
    with suppress(ValueError):
        return f"its process was killed by {signal.Signals(-code).name}"
    return f"its process was killed by signal {-code}"
