"""Benchmarks: ``python -m benchmarks [--rounds N] [--rivals FOLDER] [--before FOLDER]``.

The plates of other programs need a virtual environment with them: ``--install`` makes it.
``--before`` compares with the checkout of an earlier version, by turns, and measures nothing else.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path
from statistics import median

from benchmarks.sections import RIVALS, Asked, sections
from benchmarks.timing import ROOT, Row, Section, keep_to_one_core
from benchmarks.versions import Compared, compared
from sbafab.runtime import prepare


def main() -> None:
    arguments = parsed()
    if arguments.install:
        install(arguments.rivals)
    keep_to_one_core()
    prepare()
    if arguments.before is not None:
        print(beside(compared(arguments.before.resolve(), arguments.rounds)).text)
        return
    asked = Asked(arguments.rounds, arguments.designs, python_of(arguments.rivals))
    for section in sections(asked):
        print(f"{section.text}\n", flush=True)


def parsed() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--rounds", type=int, default=5, help="counted rounds (default: 5)")
    parser.add_argument(
        "--designs", type=int, default=400, help="in one process, one by one (default: 400)"
    )
    parser.add_argument(
        "--rivals", type=Path, default=ROOT / ".benchmarks" / "venv", help="virtual environment"
    )
    parser.add_argument("--install", action="store_true", help="make that environment first")
    parser.add_argument("--before", type=Path, help="checkout of an earlier version")
    return parser.parse_args()


def install(folder: Path) -> None:
    subprocess.run([sys.executable, "-m", "venv", folder], check=True)
    subprocess.run([python_of(folder), "-m", "pip", "install", *RIVALS.values()], check=True)


def python_of(folder: Path) -> Path:
    return folder / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")


def beside(found: list[Compared]) -> Section:
    """This version's times, and what the earlier one took."""
    rows = [
        Row(one.name, one.now, f"{median(one.before):.3f} before, {one.ratio:.1f} times as long")
        for one in found
    ]
    return Section("versions", "This version beside an earlier one", rows)


if __name__ == "__main__":
    main()
