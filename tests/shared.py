"""What tests of several rooms share: values made once by several workers, and a browser."""

from __future__ import annotations

import os
import pickle
import shutil
import subprocess
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


CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)
FLAGS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    "--disable-background-networking",
)


def chromium(folder: Path, page: Path, *flags: str) -> str:
    """Open a page headless and return what the browser prints to its standard output."""
    command = [str(CHROMIUM), *FLAGS, f"--user-data-dir={folder / 'profile'}", *flags]
    done = subprocess.run(
        [*command, page.as_uri()], capture_output=True, text=True, timeout=60, check=True
    )
    return done.stdout
