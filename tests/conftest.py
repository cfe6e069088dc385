"""Settings for every test: hypothesis draws the same examples on every machine."""

from __future__ import annotations

import gc
import os
from collections import Counter
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from sbafab.runtime import prepare

# Workers share the processors already: more threads are slower, and may change the order of sums.
# numpy reads these when it is first imported, here and in the processes that tests start.
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

settings.register_profile(
    "sbafab",
    derandomize=True,
    deadline=None,
    database=None,
    max_examples=60,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("sbafab")

LONG = os.environ.get("SBAFAB_LONG", "")
"""Whether only the tests marked ``long`` run, as ``.ci/run`` has them beside the suite; if ``all``,
whole random campaigns with them.
"""
MARKS = {"": set[str](), "all": {"long", "campaign"}}.get(LONG, {"long"})
"""Marks of the tests that run; the suite has those without any."""
SLOW_ROOMS = {"calibration", "models", "search", "simulators", "site", "validation"}
"""Folders of tests that take up to a minute each: of those marked ``long`` they run first, lest a
worker begins one when the others are done."""


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Keep what is collected, which lives as long as the session, from the garbage collector.

    Every full collection among the tests would walk through it again. Then collections are as rare
    as in a process that runs a command.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.collect()
        gc.freeze()
        gc.enable()
        prepare()


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """The suite leaves out what is marked ``long`` or ``campaign``; see MARKS for other runs."""
    chosen, left_out = [], []
    for item in items:
        marks = {mark.name for mark in item.iter_markers()} & {"long", "campaign"}
        (chosen if (marks <= MARKS and bool(marks) == bool(MARKS)) else left_out).append(item)
    config.hook.pytest_deselected(items=left_out)
    items[:] = chosen
    if LONG:
        items.sort(key=lambda item: item.path.parent.name not in SLOW_ROOMS)


SKIPPED = "SBAFAB_SKIPPED"
"""Variable with the path of a file to write, a line a test that was skipped: ``.ci/run`` runs these
again where the programs are that they lacked."""
READERS = ("klayout", "meerk40t", "pyogrio")
"""Packages of the extra ``interop`` without which ``tests/interop`` is not collected."""
INSTALL = 'python -m pip install -e ".[dev,interop]"'


def pytest_ignore_collect(collection_path: Path) -> bool | None:
    """Leave ``tests/interop`` out where a reader of cut files is not installed."""
    if collection_path == Path(__file__).parent / "interop" and _missing_readers():
        return True
    return None


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Name what was skipped, and for want of what, at the end."""
    if hasattr(terminalreporter.config, "workerinput"):
        return
    skipped = terminalreporter.stats.get("skipped", [])
    if SKIPPED in os.environ:
        names = sorted({report.nodeid for report in skipped})
        Path(os.environ[SKIPPED]).write_text("".join(f"{name}\n" for name in names))
    reasons = Counter(
        report.longrepr[2].removeprefix("Skipped: ") if isinstance(report.longrepr, tuple) else ""
        for report in skipped
    )
    missing = _missing_readers()
    if missing:
        terminalreporter.write_line(
            f"not run: tests/interop, which needs {', '.join(missing)}; install with {INSTALL}"
        )
    for reason, count in sorted(reasons.items()):
        terminalreporter.write_line(f"skipped {count}: {reason}")


def _missing_readers() -> list[str]:
    return [name for name in READERS if find_spec(name) is None]
