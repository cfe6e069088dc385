"""Jobs handed to a process of their own each thread has, which is killed where it takes too long.

The same function runs in the threads of this process and in those of a Dask worker.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
from contextlib import suppress
from typing import Any

from sbafab.search.measure import SweepRow

ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""One a process: several processes share the processors already."""
ATTEMPTS = 2
"""A process may die by somebody else's doing; a design that kills two in a row is to blame."""

COMMAND = (sys.executable, "-m", "sbafab.search.child")

MeasureJob = dict[str, Any]
"""The keyword arguments of ``measured``, and ``program``, which has to do it."""

_own = threading.local()


class _Started:
    """The processes that run, and whether more may be started."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.children: set[Child] = set()
        self.may_start = True


_started = _Started()


class Child:
    """A running process of ``sbafab.search.child``."""

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
        """The row of a job; one that says why where the process dies or takes longer."""
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
        return {"outcome": "crashed", "reason": _how(self._process.returncode), "seconds": 0.0}

    def _exchange(self, job: str) -> str:
        """The answer to a line, cut short where the process died."""
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
    """The row of a job, measured in this thread's own process; dead ones are replaced."""
    row: SweepRow = {}
    for _ in range(ATTEMPTS):
        child = getattr(_own, "child", None)
        if child is None or not child.is_alive:
            if child is not None:
                child.close()
            child = _own.child = Child()
        row = child.answer(job, seconds)
        # What Python could still say of a crash is said the same way again.
        if row["outcome"] != "crashed" or child.is_alive:
            return row
    return row


def open_all() -> None:
    """Lets threads of this process start processes again."""
    with _started.lock:
        _started.may_start = True


def close_all() -> None:
    """Kills the processes that threads of this process have started, and has them start no more."""
    with _started.lock:
        _started.may_start = False
        children = list(_started.children)
    for child in children:
        child.close()


def _how(code: int | None) -> str:
    if code is None or code >= 0:
        return f"its process ended with exit code {code}"
    with suppress(ValueError):
        return f"its process was killed by {signal.Signals(-code).name}"
    return f"its process was killed by signal {-code}"
