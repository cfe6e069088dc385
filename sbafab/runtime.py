"""Settings of a process that runs a command, its threads, and the type of progress."""

from __future__ import annotations

import atexit
import gc
import os
from collections.abc import Callable
from contextlib import ContextDecorator
from functools import cache
from threading import Lock
from typing import Any

YOUNG = 200_000
"""Objects before a garbage collection: a run keeps most of its objects and has few cycles, and
collecting at the default threshold takes a tenth of its time.
"""


def prepare() -> None:
    """Set the process's environment and garbage collection; a second call changes nothing."""
    # pydantic searches all installed packages for plugins; none is used.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    # Matrices are small: more threads are slower, and may change the order of sums.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    gc.set_threshold(YOUNG, *gc.get_threshold()[1:])
    # A last collection when the process ends would take 0.05 s or more.
    atexit.register(gc.freeze)


class OneBlasThread(ContextDecorator):
    """Run linear algebra on one thread, in this process, while any of its threads is inside.

    It is a nestable decorator or context manager. Our matrices are small: more threads wait for
    each other, a hundred times longer if there are more than processors. The caller's settings are
    restored afterwards.
    """

    def __init__(self) -> None:
        self._lock, self._depth = Lock(), 0
        self._limit: Any = None

    def __enter__(self) -> None:
        with self._lock:
            if self._depth == 0:
                self._limit = _thread_pools().limit(limits=1, user_api="blas")
            self._depth += 1

    def __exit__(self, *error: object) -> None:
        with self._lock:
            self._depth -= 1
            if self._depth == 0:
                self._limit.restore_original_limits()


@cache
def _thread_pools() -> Any:
    """Return the thread pools of NumPy's linear algebra, which is already loaded."""
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


one_blas_thread = OneBlasThread()


def processors() -> int:
    """Return the number of processors available to this process."""
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
