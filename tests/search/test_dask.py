"""The same sweep on a Dask cluster that loses a worker half way: same rows, same bytes."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import sbafab
from sbafab.errors import OutputError

pytest.importorskip("distributed")
# Designs of one diameter share a map, whatever their number of balloons.
VARY = ("chamber.diameter=5,6", "stack.balloons=2:6:1", "bore.clearance=-1,0.04")
QUICK: dict[str, Any] = {"rules": {"yield_builds": 100}, "pressures_kpa": (10.0,)}


def _started(*arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "distributed.cli." + arguments[0], *arguments[1:]],
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.fixture
def cluster() -> Iterator[tuple[str, list[subprocess.Popen[str]]]]:
    """A scheduler on loopback and two workers of one thread each, without nannies."""
    local = ("--host", "127.0.0.1")
    scheduler = _started("dask_scheduler", *local, "--port", "0", "--no-dashboard")
    assert scheduler.stderr is not None
    found = next(m for line in scheduler.stderr if (m := re.search(r"Scheduler at:\s+(\S+)", line)))
    plain = ("--nthreads", "1", "--no-nanny", "--no-dashboard")
    workers = [_started("dask_worker", found[1], *local, *plain) for _ in range(2)]
    for worker in workers:
        assert worker.stderr is not None
        next(line for line in worker.stderr if "Registered to" in line)
    yield found[1], workers
    for process in (*workers, scheduler):
        process.kill()
        process.communicate()


@pytest.mark.long
def test_a_worker_killed_half_way_loses_and_doubles_no_row(
    cluster: tuple[str, list[subprocess.Popen[str]]], tmp_path: Path
) -> None:
    address, workers = cluster
    journal = tmp_path / "far" / "1dof-5mm-sweep" / "journal.jsonl"
    lines_then: list[int] = []

    def kill_one() -> None:
        while not journal.is_file() or journal.read_bytes().count(b"\n") < 6:
            time.sleep(0.01)
        workers[0].send_signal(signal.SIGKILL)
        lines_then.append(journal.read_bytes().count(b"\n"))

    killer = threading.Thread(target=kill_one)
    killer.start()
    far = sbafab.sweep("1dof-5mm", vary=VARY, out=tmp_path / "far", dask=address, **QUICK)
    killer.join()
    assert lines_then[0] < 20
    assert workers[0].wait() == -signal.SIGKILL
    assert far.measured == far.designs == 20
    assert journal.read_bytes().count(b"\n") == 20
    near = sbafab.sweep("1dof-5mm", vary=VARY, out=tmp_path / "near", workers=2, **QUICK)
    for name in ("sweep.csv", "sweep.html"):
        assert (far.folder / name).read_bytes() == (near.folder / name).read_bytes()
    assert far.outcomes == near.outcomes == {"passes": 10, "refused": 10}


def test_where_no_scheduler_answers_that_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sbafab.search.trials.CONNECT", 0.2)
    with pytest.raises(OutputError, match=r"no Dask scheduler answers at tcp://127\.0\.0\.1:9"):
        sbafab.sweep("1dof-5mm", vary=VARY, out=tmp_path, dask="tcp://127.0.0.1:9", **QUICK)
