"""What a process that runs one command is told before it loads anything else."""

from __future__ import annotations

import atexit
import gc
import os
from collections.abc import Callable

YOUNG = 200_000
"""Records after which they are looked through for rings that nothing holds: a run makes many
records, keeps them to its end and makes hardly any ring, and looking takes a tenth of its time.
"""


def prepare() -> None:
    """Settings that hold for the whole process; asked for twice, they are the same."""
    # Plugins of pydantic, which have no part in this, are looked for in every package there is.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    # Matrices here are small: more threads take longer, and may sum in another order elsewhere.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    gc.set_threshold(YOUNG, *gc.get_threshold()[1:])
    # What is left when the process ends goes with it: looking for rings takes 0.05 s and more.
    atexit.register(gc.freeze)


def processors() -> int:
    """Return how many processors this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:
        return os.cpu_count() or 1


# How work that takes its time tells how far it is.


Progress = Callable[[str, int, int], None]
"""Told what is being done, and how much of how much is done."""
Counted = Callable[[int, int], None]
"""Told how many of how many are done."""


def unheard(what: str, done: int, total: int) -> None:
    """A progress that nobody watches."""
