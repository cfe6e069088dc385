"""This version with the compiled modules of a wheel that was built with SBAFAB_COMPILE=1."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

from benchmarks.timing import ROOT

SCRIPT = ROOT / ".ci" / "compile_modules.py"
WORKS = (
    "design and rules, 1dof-5mm",
    "design and rules, radial-15mm",
    "design and rules, 3dof-15mm",
    "generate 3dof-15mm",
)
"""What is measured compiled and plain, by the names of ``versions``."""


def made(folder: Path) -> Path | None:
    """The folder with a copy of the package and what is compiled of it; None without a compiler."""
    for name in ("sbafab", "templates"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    run = subprocess.run([sys.executable, SCRIPT, folder], check=False, capture_output=True)
    return None if run.returncode else folder
