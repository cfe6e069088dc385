"""``python -m tests.judge --designs 300 --seed 1``: random designs, made and judged."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from tests.judge.campaign import Ways, run_cases, table


def main() -> int:
    """Exit code 1 if anything the judges saw disagrees with the program."""
    asked = argparse.ArgumentParser(prog="python -m tests.judge", description=__doc__)
    asked.add_argument("--designs", type=int, default=300, help="how many are drawn [300]")
    asked.add_argument("--seed", type=int, default=1, help="which are drawn [1]")
    asked.add_argument("--start", type=int, default=0, help="number of the first one [0]")
    asked.add_argument("--jobs", type=int, default=1, help="processes [1]")
    asked.add_argument("--lean", action="store_true", help="cut and press in place of generate")
    asked.add_argument("--no-check", action="store_true", help="without sbafab check FOLDER")
    asked.add_argument("--keep", type=Path, help="where designs and folders that disagree stay")
    given = asked.parse_args()
    ways = Ways(given.lean, not given.no_check, 5, given.keep)
    began = time.perf_counter()
    cases = []
    stopped = False
    try:
        for case in run_cases(given.seed, given.designs, ways, given.jobs, given.start):
            cases.append(case)
            for found in case.disagreements:
                print(f"{case.name} {found.judge}: {found.said}", file=sys.stderr, flush=True)
            if sys.stderr.isatty():
                print(f"\r{len(cases)} of {given.designs}", end="", file=sys.stderr, flush=True)
    except KeyboardInterrupt:
        stopped = True
    print(table(cases))
    if stopped:
        print(f"stopped after {len(cases)} of {given.designs}")
    print(f"wall time      {time.perf_counter() - began:.0f} s")
    return 1 if stopped or any(case.disagreements for case in cases) else 0


if __name__ == "__main__":
    raise SystemExit(main())
