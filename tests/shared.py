"""Values that take long to work out, made once in a session of several workers."""

from __future__ import annotations

import os
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import pytest
from filelock import FileLock

Value = TypeVar("Value")


def shared_folder(factory: pytest.TempPathFactory) -> Path:
    """Return the session's temporary folder, which all workers of ``pytest -n`` have in common."""
    root = factory.getbasetemp()
    return root.parent if "PYTEST_XDIST_WORKER" in os.environ else root


def shared(factory: pytest.TempPathFactory, name: str, make: Callable[[], Value]) -> Value:
    """Return what ``make`` returns; one worker calls it, the others wait and read its value."""
    path = shared_folder(factory) / f"{name}.pickle"
    with FileLock(path.with_suffix(".lock")):
        if not path.exists():
            path.write_bytes(pickle.dumps(make()))
        value: Value = pickle.loads(path.read_bytes())
        return value
