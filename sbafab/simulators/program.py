"""Starting a program, watching it, and stopping it when it takes too long or is interrupted."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from sbafab.errors import OutputError

LOOK_EVERY = 0.1
"""s between two looks at how far a run is."""
STOP_WITHIN = 10.0
"""s that a program has to end by itself before it is killed."""
INTERRUPTED = "it was interrupted"
OUT_OF_TIME = "it was stopped after"


class Ended(NamedTuple):
    """How a program ended: its exit code, and why it was stopped, None if it ended by itself."""

    code: int
    stopped: str | None


def program_path(name: str, install: str) -> str:
    """Path of an installed program. Raises OutputError that says how to ``install`` it."""
    found = shutil.which(name)
    if found is None:
        raise OutputError(f"{name} was not found; {install}")
    return found


def run_program(
    command: Sequence[str],
    log: Path,
    limit: float | None,
    look: Callable[[], None],
) -> Ended:
    """Runs a command in the folder of its ``log``, which takes what it prints.

    ``look`` is called while it runs; after ``limit`` seconds it is stopped. Ctrl-C and SIGTERM
    stop the run, not the program that started it, so that what was reached can be kept. One
    thread, unless OMP_NUM_THREADS says otherwise. Raises OutputError where it cannot be started.
    """
    began = time.monotonic()
    stopped: str | None = None
    with log.open("wb") as opened:
        try:
            # In a session of its own: the command may be a script that starts the real program.
            process = subprocess.Popen(
                command,
                cwd=log.parent,
                stdin=subprocess.DEVNULL,
                stdout=opened,
                stderr=subprocess.STDOUT,
                env={"OMP_NUM_THREADS": "1", **os.environ},
                start_new_session=True,
            )
        except OSError as reason:
            raise OutputError(
                f"{command[0]} could not be started ({reason.strerror}); see whether it is a "
                "program that runs on this machine"
            ) from reason
        try:
            while stopped is None:
                try:
                    process.wait(LOOK_EVERY)
                    break
                except subprocess.TimeoutExpired:
                    look()
                if limit is not None and time.monotonic() - began >= limit:
                    stopped = f"{OUT_OF_TIME} {limit / 60:g} minutes"
        except KeyboardInterrupt:
            # Hours of computing are not thrown away with the rest of them.
            stopped = INTERRUPTED
        finally:
            _end(process)
    return Ended(process.returncode, stopped)


def _end(process: subprocess.Popen[bytes]) -> None:
    """Ends the program and what it started."""
    for number in (signal.SIGTERM, getattr(signal, "SIGKILL", signal.SIGTERM)):
        if process.poll() is not None:
            return
        if hasattr(os, "killpg"):
            os.killpg(process.pid, number)
        else:
            process.terminate()
        try:
            process.wait(STOP_WITHIN)
        except subprocess.TimeoutExpired:
            continue
