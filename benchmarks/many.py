"""Rate and memory of one process over many designs, each another one, as a sweep measures them."""

from __future__ import annotations

import random
import resource
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

DESIGN = "1dof-5mm"
TOLD = 8
"""How often memory and rate are told over a run."""


class Reached(NamedTuple):
    """Designs so far, seconds of processor time for each of the last of them, most memory in MB."""

    designs: int
    seconds: float
    memory: float


def measured(designs: int) -> Iterator[Reached]:
    """Builds and checks designs of other sizes and heights; seeded, so the same every time."""
    from sbafab.actuators import build, load_design
    from sbafab.rules.deck import run_deck
    from sbafab.runtime import prepare

    prepare()
    draw = random.Random(1)
    base = load_design(DESIGN)
    began, before = time.process_time(), 0
    for number in range(1, designs + 1):
        diameter = round(draw.uniform(4.0, 8.0), 3)
        design = base.with_({"chamber.diameter": diameter, "stack.balloons": draw.randint(2, 6)})
        run_deck(build(design), design)
        if number % max(1, designs // TOLD) == 0:
            now = time.process_time()
            yield Reached(number, (now - began) / (number - before), _most_memory())
            began, before = now, number


def _most_memory() -> float:
    """The most memory that this process has held, MB."""
    status = Path("/proc/self/status")
    if status.exists():
        # What the system counts for a process begins with what held it: this does not.
        (line,) = (one for one in status.read_text().splitlines() if one.startswith("VmHWM"))
        return int(line.split()[1]) / 1e3
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most / (1e6 if sys.platform == "darwin" else 1e3)
