"""This version with the compiled modules of a wheel that was built with SBAFAB_COMPILE=1."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

from benchmarks.timing import ROOT, environment

SCRIPT = ROOT / ".ci" / "compile_modules.py"
WORKS = (
    "design and rules, 1dof-5mm",
    "design and rules, radial-15mm",
    "design and rules, 3dof-15mm",
    "generate 3dof-15mm",
)
"""What is measured compiled and plain, by the names of ``versions``."""
DECKS = ("1dof-5mm", "3dof-15mm")
"""Templates of which one design after the other is checked, compiled and plain by turns."""
DESIGNS = 20
"""Designs of other sizes in one process: short runs, for machines are seldom quiet for long."""
PROGRAM = """
import sys
from sbafab.process import prepare
prepare()
from benchmarks.decks import checked
template, count, total = sys.argv[1], int(sys.argv[2]), 0.0
for turn in range(-3, count):
    taken = checked(template, turn)
    if turn >= 0:  # those before fetch what is imported
        total += taken
print(total / count)
"""


def made(folder: Path) -> Path | None:
    """The folder with a copy of the package and what is compiled of it; None without a compiler."""
    for name in ("sbafab", "templates"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    run = subprocess.run([sys.executable, SCRIPT, folder], check=False, capture_output=True)
    return None if run.returncode else folder


def deck_time(root: Path, template: str) -> float:
    """Processor time of a deck of the package in a folder, where one design follows the other."""
    kept = environment(root)
    run = subprocess.run(
        [sys.executable, "-P", "-c", PROGRAM, template, str(DESIGNS)],
        env={**kept, "PYTHONPATH": os.pathsep.join([str(root), str(ROOT)])},
        check=True,
        capture_output=True,
        text=True,
    )
    return float(run.stdout)
