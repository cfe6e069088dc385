"""Running ``ccx``: to which load it came, and what stopped it."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

from sbafab.progress import Progress
from sbafab.simulators.calculix.frd import SAME_TIME, read_sta
from sbafab.simulators.program import program_path, run_program

LOG = "ccx.log"
DIVERGED = "its iterations no longer converge, however small the step"


class Ending(NamedTuple):
    """How a run ended: the last converged time in s, and what stopped it, None if nothing did."""

    time: float
    stopped: str | None


def find_ccx() -> str:
    """Path of the solver. Raises OutputError where it is not installed."""
    return program_path(
        "ccx",
        "install CalculiX; on Debian and Ubuntu: apt install calculix-ccx",
    )


def run_ccx(
    folder: Path, job: str, end: float, timeout: float, tell: Progress | None = None
) -> Ending:
    """Runs a deck in its folder to the time ``end``, for at most ``timeout`` seconds.

    What ccx prints goes to ``ccx.log`` there.
    """
    sta = folder / f"{job}.sta"

    def look() -> None:
        if tell is not None:
            tell("ccx, percent of the load", int(100 * _reached(sta) / end), 100)

    code, stopped = run_program([find_ccx(), "-i", job], folder / LOG, timeout, look)
    reached = _reached(sta)
    if stopped is not None:
        return Ending(reached, stopped)
    is_there = reached >= end * (1 - SAME_TIME)
    return Ending(reached, _complaint(folder / LOG, code, is_there))


def _reached(sta: Path) -> float:
    return max(read_sta(sta), default=0.0)


def _complaint(log: Path, code: int, is_there: bool) -> str | None:
    """What went wrong; ccx's exit code alone does not tell, and may be 0 all the same.

    A step that diverges and is tried again with less is no failure.
    """
    text = log.read_text(encoding="utf-8", errors="replace")
    if is_there and code == 0 and "Job finished" in text:
        return None
    if re.search(r"diverge|increment size smaller than minimum", text):
        return DIVERGED
    error = re.search(r"\*ERROR[^:\n]*:?\s*(.+)", text)
    if error is not None:
        return f"it reports: {error[1].strip().rstrip('.:')}"
    return f"it ended with code {code} and without a word"
