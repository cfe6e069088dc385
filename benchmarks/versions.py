"""The same work by an earlier version and by this one, by turns; the earlier one is a checkout.

Only what 0.1.0 could do as well is compared: whole commands, and a function of the package.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Container, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from benchmarks import copies, decks, outlines, plates_sbafab
from benchmarks.timing import ROOT, environment, seconds

DESIGNS = 8
"""Decks in one process, all of different designs."""
LEAST_TIME = 30
"""Seconds of turns at least: a machine is seldom quiet for long, and short work is soon redone."""
EDGES = 300
MANY = 50
DECK = """
import sys, time, sbafab
template, key, first, count = sys.argv[1:]
for turn in range(int(count) + 1):
    began = time.process_time()
    sbafab.check(template, f"{key}={float(first) + turn / 1000:.3f}")
    if turn:  # the first one fetches what is imported
        print(time.process_time() - began)
"""
Work = Callable[[Path], list[float]]
"""Gives seconds of processor time for the version in a folder."""


class Compared(NamedTuple):
    """Processor times in seconds of one piece of work."""

    name: str
    before: Sequence[float]
    now: Sequence[float]

    @property
    def ratio(self) -> float:
        return statistics.median(self.before) / statistics.median(self.now)


def compared(
    before: Path, rounds: int, now: Path = ROOT, only: Container[str] = ()
) -> list[Compared]:
    """Every piece of work, by turns; ``before`` and ``now`` are the folders of the versions.

    ``only``: the names of what is measured, of all if empty.
    """
    found = []
    with tempfile.TemporaryDirectory() as place:
        for name, work in works(Path(place)).items():
            if only and name not in only:
                continue
            times: dict[Path, list[float]] = {before: [], now: []}
            turns, ends = 0, time.monotonic() + LEAST_TIME
            while turns < rounds or time.monotonic() < ends:
                for root, taken in times.items():
                    taken.extend(work(root))
                turns += 1
            found.append(Compared(name, times[before], times[now]))
    return found


def works(place: Path) -> Mapping[str, Work]:
    """What is compared, by its name; what is written goes to ``place``."""
    outline = place / "outline.dxf"
    outlines.save(outline, EDGES)
    sheets = [
        f"sheets.{film}.{side}={copies.SHEET}"
        for film in ("tpe", "ptfe")
        for side in ("width", "length")
    ]
    many = [f"order.copies={MANY}", *sheets]
    return {
        **{f"design and rules, {template}": _deck(template) for template in decks.VARIED},
        "sbafab --help": _command("--help"),
        "check 1dof-5mm": _command("check", "1dof-5mm"),
        f"check 1dof-5mm, drawn outline of {EDGES} edges": _command(
            "check", "1dof-5mm", "--set", f"chamber.outline={outline}"
        ),
        **{
            f"generate {template}": _command("generate", template, "-o", str(place / "out"))
            for template in ("1dof-5mm", "radial-15mm", "3dof-15mm", "brace")
        },
        f"cut {copies.DESIGN}, {MANY} copies": _command(
            "cut", copies.DESIGN, "-o", str(place / "many"), *(f"--set={key}" for key in many)
        ),
        "40 plates, a DXF each": lambda root: [
            seconds([sys.executable, plates_sbafab.__file__, tempfile.mkdtemp(dir=place)], root)
        ],
    }


def _deck(template: str) -> Work:
    key, first = decks.VARIED[template]

    def work(root: Path) -> list[float]:
        run = subprocess.run(
            [sys.executable, "-c", DECK, template, key, str(first), str(DESIGNS)],
            cwd=root,
            env=environment(root),
            check=True,
            capture_output=True,
            text=True,
        )
        return [float(line) for line in run.stdout.split()]

    return work


def _command(*arguments: str) -> Work:
    program = "import sys; from sbafab.cli import main; sys.argv[0] = 'sbafab'; main()"
    return lambda root: [seconds([sys.executable, "-c", program, *arguments], root)]
