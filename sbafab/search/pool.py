"""Jobs run beside each other: in threads of this machine, or on a Dask cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from typing import Any, NamedTuple

from sbafab.errors import DesignError, OutputError
from sbafab.process import processors
from sbafab.search.measure import SweepRow
from sbafab.search.worker import MeasureJob, close_all, guarded, open_all

AHEAD = 3
"""Jobs a worker is handed before it has done the first."""
POLL = 1.0
"""Seconds after which a progress that waits is told so."""
CONNECT = 10
"""Seconds that a scheduler has to answer."""
DASK_EXTRA = 'Dask is not installed: pip install "sbafab[dask]"'


class Pool(NamedTuple):
    """Runs ``guarded`` on its workers; ``size`` of them at a time."""

    executor: Executor
    size: int


@contextmanager
def local_pool(workers: int | None = None) -> Iterator[Pool]:
    """A thread a worker, each with a process of its own; none outlives the block."""
    size = workers or processors()
    open_all()
    executor = ThreadPoolExecutor(size)
    try:
        yield Pool(executor, size)
    finally:
        # Killed processes let the threads that wait for them go on, and end.
        executor.shutdown(wait=False, cancel_futures=True)
        close_all()
        executor.shutdown()


@contextmanager
def dask_pool(address: str) -> Iterator[Pool]:
    """The workers of the cluster behind a scheduler's address, which must have sbafab installed.

    Raises OutputError where there is no scheduler, DesignError without the extra.
    """
    try:
        from distributed import Client

        untyped: Any = Client
    except ImportError:
        raise DesignError(DASK_EXTRA) from None
    try:
        client: Any = untyped(address, timeout=CONNECT)
    except (OSError, ValueError) as error:
        said = " ".join(str(error).split())
        raise OutputError(
            f"no Dask scheduler answers at {address} ({said}); start one with `dask scheduler`, "
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
    """Has every job done once and tells its key and row as soon as it is; in no order.

    Few jobs are in the works at any time, so that memory does not grow with their number.
    ``waiting`` is called every second in which none is done.
    """
    left = iter(jobs)
    running: dict[Future[SweepRow], str] = {}
    room = AHEAD * pool.size
    try:
        while True:
            for key, job in _first(left, room - len(running)):
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
        # A cluster gives up a job whose workers died under it several times.
        said = " ".join(str(error).split())[:300]
        row = {"outcome": "crashed", "reason": f"{type(error).__name__}: {said}", "seconds": 0.0}
    if row["outcome"] == "unlike":
        from sbafab.search.fingerprint import fingerprint

        raise OutputError(
            f"a worker runs sbafab {row['reason']} and this is {fingerprint()}; install the same "
            "one there"
        )
    return row
