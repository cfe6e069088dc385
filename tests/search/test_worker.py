"""Processes that die, hang or run another program become rows with a reason."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from sbafab.errors import OutputError
from sbafab.search import trials as pool_module
from sbafab.search.trials import MeasureJob, close_all, guarded, local_pool, run_jobs

PUPPET = """
import json, os, signal, sys, time
from pathlib import Path
for line in sys.stdin:
    job = json.loads(line)
    if job["do"] == "hang":
        time.sleep(600)
    if job["do"] == "die" or (job["do"] == "die once" and not Path(job["mark"]).exists()):
        Path(job["mark"]).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    if job["do"] == "leave":
        sys.exit(3)
    print(json.dumps({"outcome": job.get("outcome", "passes"), "reason": "", "pid": os.getpid()}),
          flush=True)
"""


@pytest.fixture(autouse=True)
def puppet(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A process that does what its job says, in place of the one that measures."""
    monkeypatch.setattr(pool_module, "COMMAND", (sys.executable, "-S", "-c", PUPPET))
    monkeypatch.setattr(pool_module, "_thread", threading.local())
    pool_module._may_start.set()
    yield
    close_all()
    pool_module._may_start.set()


def test_one_process_does_job_after_job() -> None:
    rows = [guarded({"do": "answer"}, 60) for _ in range(3)]
    assert len({row["pid"] for row in rows}) == 1


def test_a_killed_process_is_replaced_and_one_that_kills_two_is_said(tmp_path: Path) -> None:
    mark = str(tmp_path / "died")
    assert guarded({"do": "die once", "mark": mark}, 60)["outcome"] == "passes"
    row = guarded({"do": "die", "mark": mark}, 60)
    assert row["outcome"] == "crashed"
    assert "SIGKILL" in row["reason"]
    assert "exit code 3" in guarded({"do": "leave"}, 60)["reason"]
    assert guarded({"do": "answer"}, 60)["outcome"] == "passes"


def test_what_takes_too_long_is_killed_and_not_tried_again() -> None:
    row = guarded({"do": "hang"}, 0.3)
    assert row == {
        "outcome": "too long",
        "reason": "stopped after 0.3 s; --timeout gives it longer",
        "seconds": 0.3,
    }
    assert guarded({"do": "answer"}, 60)["outcome"] == "passes"


def test_a_pool_does_every_job_once_and_leaves_no_process(tmp_path: Path) -> None:
    jobs: dict[str, MeasureJob] = {str(number): {"do": "answer"} for number in range(20)}
    jobs["7"] = {"do": "die", "mark": str(tmp_path / "died")}
    with local_pool(2) as pool:
        rows = [row for row in run_jobs(pool, jobs.items(), 60) if row is not None]
    found = [(key, row["outcome"]) for key, row in rows]
    assert sorted(key for key, _ in found) == sorted(jobs)
    assert [outcome for key, outcome in found if key == "7"] == ["crashed"]
    assert not pool_module._children


def test_stopped_half_way_it_leaves_no_process() -> None:
    jobs: list[tuple[str, MeasureJob]] = [
        ("0", {"do": "answer"}),
        *((str(n), {"do": "hang"}) for n in "12"),
    ]
    with pytest.raises(KeyboardInterrupt), local_pool(2) as pool:
        next(run_jobs(pool, jobs, 60))
        raise KeyboardInterrupt
    assert not pool_module._children


def test_another_program_is_told_apart() -> None:
    jobs: list[tuple[str, MeasureJob]] = [("0", {"do": "answer", "outcome": "unlike"})]
    with pytest.raises(OutputError, match="install the same"), local_pool(1) as pool:
        list(run_jobs(pool, jobs, 60))
