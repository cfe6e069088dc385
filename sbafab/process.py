"""Settings of a process that runs a command, its processors, and the type of progress."""

from __future__ import annotations

import atexit
import gc
import os
from collections.abc import Callable

YOUNG = 200_000
"""Objects before a garbage collection: a run keeps most of its objects and has few cycles, and
collecting at the default threshold takes a tenth of its time.
"""


def prepare() -> None:
    """Set environment and garbage collection of the process; a second call changes nothing."""
    # pydantic searches all installed packages for plugins; none is used.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    # Matrices are small: more threads are slower, and may change the order of sums.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    gc.set_threshold(YOUNG, *gc.get_threshold()[1:])
    # A last collection when the process ends would take 0.05 s or more.
    atexit.register(gc.freeze)


def processors() -> int:
    """Return how many processors this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:
        return os.cpu_count() or 1


# Progress of long work.


Progress = Callable[[str, int, int], None]
"""Called with the stage, the amount done and the total."""
Counted = Callable[[int, int], None]
"""Called with the number done and the total."""


def ignore_progress(stage: str, done: int, total: int) -> None:
    """Ignore progress."""
