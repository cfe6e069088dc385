"""Sweeps that are killed or stopped go on where they were: no design lost, none counted twice."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from conftest import Runs

ARGUMENTS = [
    *("sweep", "1dof-5mm", "--workers", "1", "--pressure", "10"),
    *("--vary", "bond.width=0.7,0.75", "--vary", "stack.balloons=2:5:1"),
    *("--set", "rules.yield_builds=100"),
]
FILES = ("sweep.csv", "sweep.html")


def _stopped_at(runs: Runs, folder: Path, lines: int, number: int) -> tuple[int, str, int]:
    """Exit code, what it said, and lines in the journal of a run sent a signal at that many."""
    journal = folder / "out" / "1dof-5mm-sweep" / "journal.jsonl"
    pid = runs.start(ARGUMENTS, folder)
    while not journal.is_file() or journal.read_bytes().count(b"\n") < lines:
        time.sleep(0.005)
    os.kill(pid, number)
    ended = runs.wait(pid)
    return ended.code, ended.err, journal.read_bytes().count(b"\n")


def _children(folder: Path) -> list[str]:
    """Processes that measure designs for a sweep into this folder: their cwd tells."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            command = (process / "cmdline").read_bytes()
            if b"sbafab.search.trials" in command and (process / "cwd").readlink() == folder:
                found.append(process.name)
        except OSError:
            continue
    return found


@pytest.mark.long
def test_killed_and_stopped_it_goes_on_where_it_was(runs: Runs, tmp_path: Path) -> None:
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    whole.mkdir()
    broken.mkdir()
    assert runs.run(ARGUMENTS, whole).code == 0
    code, _, first = _stopped_at(runs, broken, 2, signal.SIGKILL)
    assert code == -signal.SIGKILL
    code, said, second = _stopped_at(runs, broken, first + 2, signal.SIGTERM)
    assert code == 128 + signal.SIGTERM
    assert f"{second} of 8 designs are computed; run the same command again to resume" in said
    assert "Traceback" not in said
    # What measured for them is gone, the killed run's too.
    for _ in range(100):
        if not _children(broken):
            break
        time.sleep(0.05)
    assert not _children(broken)
    ended = runs.run([*ARGUMENTS, "--json"], broken)
    assert f'"measured_now": {8 - second}' in ended.out
    for name in FILES:
        paths = [folder / "out" / "1dof-5mm-sweep" / name for folder in (whole, broken)]
        assert paths[0].read_bytes() == paths[1].read_bytes()
    journal = broken / "out" / "1dof-5mm-sweep" / "journal.jsonl"
    assert journal.read_bytes().count(b'{"key"') == 8


@pytest.mark.long
def test_two_sweeps_do_not_share_a_folder(runs: Runs, tmp_path: Path) -> None:
    pid = runs.start(ARGUMENTS, tmp_path)
    while not (tmp_path / "out" / "1dof-5mm-sweep" / "journal.jsonl").is_file():
        time.sleep(0.005)
    ended = runs.run(ARGUMENTS, tmp_path)
    os.kill(pid, signal.SIGTERM)
    runs.wait(pid)
    assert ended.code == 2
    assert "another sweep is writing" in ended.err
