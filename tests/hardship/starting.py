"""Starting programs that are stopped by signals or lack permissions, whoever started the tests.

Under ``nohup`` and as a background job of a shell, SIGINT or SIGHUP is ignored, and every process
started from there inherits that. A program that a test stops by a signal begins with ANSWERING.
"""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

ANSWERING = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)
for name in ("SIGTERM", "SIGHUP"):
    if hasattr(signal, name):
        signal.signal(getattr(signal, name), signal.SIG_DFL)
"""
"""Python source that sets the usual answers to SIGINT, SIGTERM and SIGHUP."""
WITHOUT_PRIVILEGES = """
import ctypes, os
if os.getuid() == 0:
    none = (ctypes.c_uint32 * 6)()
    refused = ctypes.CDLL(None).capset((ctypes.c_uint32 * 2)(0x20080522, 0), none)
    assert not refused, "root keeps its capabilities, to which nothing is read-only"
"""
"""Root without capabilities owns its files and obeys their modes, as any user does."""
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


def assert_refused(ended: Any, *says: str) -> None:
    """A run ended with one sentence, which says all this, and exit code 2."""
    assert ended.code == 2, ended.err
    assert ended.err.startswith("sbafab: ")
    assert ended.err.count("\n") == 1, ended.err
    for text in says:
        assert text in ended.err, ended.err
