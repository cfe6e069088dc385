"""Whole-process times on one core, programs run by turns."""

from __future__ import annotations

import os
import statistics
import subprocess
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def keep_to_one_core() -> None:
    """This process and all that it starts; where the system cannot, says so."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    else:
        print("(this system cannot keep a process to one core)")


def seconds(command: Sequence[str | Path]) -> float:
    """Wall time of one run. Raises CalledProcessError with the program's output."""
    began = time.perf_counter()
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True)
    return time.perf_counter() - began


def by_turns(commands: Mapping[str, Sequence[str | Path]], rounds: int) -> dict[str, list[float]]:
    """Times of every command; a first, uncounted round warms the file cache."""
    times: dict[str, list[float]] = {name: [] for name in commands}
    for turn in range(rounds + 1):
        for name, command in commands.items():
            taken = seconds(command)
            if turn:
                times[name].append(taken)
    return times


def row(name: str, times: Sequence[float], remark: str = "") -> str:
    return f"  {name:<36}{min(times):8.3f}{statistics.median(times):8.3f}  {remark}".rstrip()


HEAD = f"  {'seconds':<36}{'least':>8}{'median':>8}"
