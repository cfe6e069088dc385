"""Processor times on one core, programs run by turns.

Processor time tells the same where other work waits for the core; on an idle machine it is the
wall time of these programs, which neither wait nor share their work among threads.
"""

from __future__ import annotations

import math
import os
import statistics
import subprocess
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent


UNKEPT = "PYTHONDONTWRITEBYTECODE"


def keep_to_one_core() -> None:
    """This process and all that it starts; where the system cannot, says so."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    else:
        print("(this system cannot keep a process to one core)")


def environment(root: Path) -> dict[str, str]:
    """In which a program finds the version in that folder.

    Modules are compiled by the first run and kept, as those of an installed program are.
    """
    kept = {name: value for name, value in os.environ.items() if name != UNKEPT}
    return {**kept, "PYTHONPATH": str(root)}


def seconds(command: Sequence[str | Path], root: Path = ROOT) -> float:
    """Processor time of one run. Raises CalledProcessError with the program's output."""
    began = os.times()
    subprocess.run(
        command, cwd=root, check=True, capture_output=True, text=True, env=environment(root)
    )
    ended = os.times()
    spent = ended.children_user - began.children_user, ended.children_system - began.children_system
    return sum(spent)


def own_seconds(work: Callable[[], object]) -> float:
    """Processor time of something that this process does."""
    began = time.process_time()
    work()
    return time.process_time() - began


def by_turns(commands: Mapping[str, Sequence[str | Path]], rounds: int) -> dict[str, list[float]]:
    """Times of every command; a first, uncounted round warms the file cache."""
    times: dict[str, list[float]] = {name: [] for name in commands}
    for turn in range(rounds + 1):
        for name, command in commands.items():
            taken = seconds(command)
            if turn:
                times[name].append(taken)
    return times


def sizes_by_turns(
    sizes: Iterable[int], rounds: int, work: Callable[[int, int], float]
) -> dict[int, list[float]]:
    """Times of a work of several sizes; it gets size and round, so that no round is as another.

    A first, uncounted round fetches what is imported when it is used.
    """
    times: dict[int, list[float]] = {size: [] for size in sizes}
    work(min(times), rounds)
    for turn in range(rounds):
        for size, taken in times.items():
            taken.append(work(size, turn))
    return times


def exponent(times: Mapping[int, Sequence[float]], least: int = 1) -> float:
    """The power of the size with which the median time grows, by least squares of logarithms.

    Sizes below the ``least`` are left out: what is done once counts most there.
    """
    points = [
        (math.log(n), math.log(statistics.median(taken)))
        for n, taken in times.items()
        if n >= least
    ]
    x, y = (sum(values) / len(points) for values in zip(*points, strict=True))
    return sum((a - x) * (b - y) for a, b in points) / sum((a - x) ** 2 for a, _ in points)


class Row(NamedTuple):
    """Processor times in seconds of one piece of work, and what is said of them."""

    name: str
    times: Sequence[float]
    remark: str = ""

    @property
    def median(self) -> float:
        return statistics.median(self.times)


class Section(NamedTuple):
    """What belongs together; ``power`` is that of the size with which time grows."""

    key: str
    title: str
    rows: Sequence[Row]
    notes: Sequence[str] = ()
    power: float | None = None
    unit: str = "s"
    timed: str = "processor time"

    @property
    def text(self) -> str:
        """As it is printed: least and median of each row."""
        each = {"s": 1, "ms": 1000}[self.unit]
        lines = [self.title, f"  {f'{self.timed}, {self.unit}':<44}{'least':>9}{'median':>9}"]
        for row in self.rows:
            least, median = each * min(row.times), each * row.median
            lines.append(f"  {row.name:<44}{least:9.3f}{median:9.3f}  {row.remark}".rstrip())
        return "\n".join([*lines, *(f"  {note}" for note in self.notes)])
