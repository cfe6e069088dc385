"""Starting programs that are stopped by signals, whoever started the tests.

Under ``nohup`` and as a background job of a shell, SIGINT or SIGHUP is ignored, and every process
started from there inherits that. A program that a test stops by a signal begins with ANSWERING.
"""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager

ANSWERING = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)
for name in ("SIGTERM", "SIGHUP"):
    if hasattr(signal, name):
        signal.signal(getattr(signal, name), signal.SIG_DFL)
"""
"""Python source that sets the usual answers to SIGINT, SIGTERM and SIGHUP."""
NAMES = ("SIGINT", "SIGHUP")


@contextmanager
def ignored_signals() -> Iterator[None]:
    """Ignore SIGINT and SIGHUP here and in what is started meanwhile, as under ``nohup``."""
    numbers = [getattr(signal, name) for name in NAMES if hasattr(signal, name)]
    before = {number: signal.signal(number, signal.SIG_IGN) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
