"""Designs a second by the clock, in one process and in several."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from functools import partial

from benchmarks.decks import checked
from benchmarks.timing import ROOT, environment
from sbafab.runtime import prepare


def rate(template: str, processes: int, designs: int) -> float:
    """Designs built and checked a second, all different; processes are warm before it counts."""
    return by_another_process(
        f"benchmarks.processes.measured({template!r}, {processes}, {designs})"
    )


def by_another_process(call: str) -> float:
    """Return the number that a call, with its module's whole name, gives in a new process.

    The measuring process may be kept to one core; the new one has all of the machine.
    """
    program = f"import {call.partition('(')[0].rpartition('.')[0]}; print({call})"
    run = subprocess.run(
        [sys.executable, "-c", program],
        cwd=ROOT,
        env=environment(ROOT),
        check=True,
        capture_output=True,
        text=True,
    )
    return float(run.stdout)


def measured(template: str, processes: int, designs: int) -> float:
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, range(os.cpu_count() or 1))
    with ProcessPoolExecutor(processes, initializer=prepare) as pool:
        list(pool.map(partial(checked, template), range(-4 * processes, 0)))
        began = time.perf_counter()
        list(pool.map(partial(checked, template), range(designs), chunksize=4))
        return designs / (time.perf_counter() - began)
