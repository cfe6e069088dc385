"""Running ``ccx``: started, watched, stopped when it takes too long, its ending understood."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from sbafab.errors import OutputError
from sbafab.simulators.calculix.frd import SAME_TIME, read_sta

Progress = Callable[[str, int, int], None]
"""Told what is being done, and how much of how much is."""

PROGRAM = "ccx"
LOG = "ccx.log"
LOOK_EVERY = 0.2
STOP_WITHIN = 10.0
INTERRUPTED = "it was interrupted"
OUT_OF_TIME = "it was stopped after"
DIVERGED = "its iterations no longer converge, however small the step"


class Ending(NamedTuple):
    """How a run ended: the last converged time in s, and what stopped it, None if nothing did."""

    time: float
    stopped: str | None


def find_ccx() -> str:
    """Path of the solver. Raises OutputError where it is not installed."""
    found = shutil.which(PROGRAM)
    if found is None:
        raise OutputError(
            f"{PROGRAM} is not here; install CalculiX: on Debian and Ubuntu the package "
            "calculix-ccx (apt install calculix-ccx)"
        )
    return found


def run_ccx(
    folder: Path, job: str, end: float, timeout: float, tell: Progress | None = None
) -> Ending:
    """Runs a deck in its folder to the time ``end``, for at most ``timeout`` seconds.

    Ctrl-C ends the run, not the program. What ccx prints goes to ``ccx.log`` there. One thread,
    unless OMP_NUM_THREADS says otherwise.
    """
    command = [find_ccx(), "-i", job]
    started = time.monotonic()
    environment = {"OMP_NUM_THREADS": "1", **os.environ}
    with (folder / LOG).open("wb") as log:
        try:
            process = subprocess.Popen(
                command, cwd=folder, stdout=log, stderr=subprocess.STDOUT, env=environment
            )
        except OSError as reason:
            raise OutputError(
                f"{command[0]} could not be started ({reason.strerror}); see whether it is a "
                "program that runs on this machine"
            ) from reason
        stopped: str | None = None
        try:
            while process.poll() is None and stopped is None:
                time.sleep(LOOK_EVERY)
                reached = _reached(folder / f"{job}.sta")
                if tell is not None:
                    tell("ccx, percent of the load", int(100 * reached / end), 100)
                if time.monotonic() - started >= timeout:
                    stopped = f"{OUT_OF_TIME} {timeout / 60:g} minutes"
        except KeyboardInterrupt:
            # Hours of computing are not thrown away with the rest of them.
            stopped = INTERRUPTED
        finally:
            _stop(process)
    reached = _reached(folder / f"{job}.sta")
    if stopped is not None:
        return Ending(reached, stopped)
    is_there = reached >= end * (1 - SAME_TIME)
    return Ending(reached, _complaint(folder / LOG, process.returncode, is_there))


def _reached(sta: Path) -> float:
    return max(read_sta(sta), default=0.0)


def _stop(process: subprocess.Popen[bytes]) -> None:
    if process.poll() is None:
        process.terminate()
        try:
            process.wait(STOP_WITHIN)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _complaint(log: Path, code: int, is_there: bool) -> str | None:
    """What went wrong; ccx's exit code alone does not tell, and may be 0 all the same.

    A step that diverges and is tried again with less is no failure.
    """
    text = log.read_text(encoding="utf-8", errors="replace")
    if is_there and code == 0 and "Job finished" in text:
        return None
    if re.search(r"diverge|increment size smaller than minimum", text):
        return DIVERGED
    error = re.search(r"\*ERROR[^:\n]*:?\s*(.+)", text)
    if error is not None:
        return f"it reports: {error[1].strip().rstrip('.:')}"
    return f"it ended with code {code} and without a word"
