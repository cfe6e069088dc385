"""A hunt for counterexamples: ``python -m tests.hunt --booleans 100000 --offsets 20000 --seed 1``.

Every case follows from the seed and its number, which a finding names; ``--first`` starts there.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from random import Random

from sbafab.errors import GeometryError
from tests.hunt import cases, oracle

CHUNK = 200


def boolean_finding(seed: int, number: int) -> str | None:
    """What is wrong with one boolean, if anything."""
    random = Random(number)
    what, kind = random.choice(list(oracle.OPERATIONS)), cases.kind_of(number)
    try:
        a, b = cases.pair(seed, number)
        found = oracle.complaint(what, a, b, random)
    except (GeometryError, ArithmeticError, ValueError, IndexError, RecursionError) as error:
        found = f"refused: {error!r}"
    return None if found is None else f"{kind} {what}: {found}"


def offset_finding(seed: int, number: int) -> str | None:
    """What is wrong with one offset, if anything."""
    try:
        region, distance = cases.offset_case(seed, number)
        found = oracle.offset_complaint(region, distance, Random(number))
    except (GeometryError, ArithmeticError, ValueError, IndexError, RecursionError) as error:
        return f"refused: {error!r}"
    return None if found is None else f"offset by {distance:.6g}: {found}"


HUNTS = {"booleans": boolean_finding, "offsets": offset_finding}


def hunted(what: str, seed: int, first: int, count: int) -> list[tuple[int, str]]:
    """The findings among ``count`` cases, with their numbers."""
    found = ((n, HUNTS[what](seed, n)) for n in range(first, first + count))
    return [(number, finding) for number, finding in found if finding is not None]


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.hunt", description=__doc__)
    parser.add_argument("--booleans", type=int, default=0, help="how many booleans")
    parser.add_argument("--offsets", type=int, default=0, help="how many offsets")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--show", type=int, default=20, help="findings to print in full")
    arguments = parser.parse_args()
    total = 0
    for what in HUNTS:
        count = getattr(arguments, what)
        began, tally, shown = time.perf_counter(), Counter[str](), 0
        firsts = range(arguments.first, arguments.first + count, CHUNK)
        last = arguments.first + count
        sizes = [min(CHUNK, last - first) for first in firsts]
        with ProcessPoolExecutor(arguments.processes) as pool:
            hunt = partial(hunted, what, arguments.seed)
            for findings in pool.map(hunt, firsts, sizes):
                for number, finding in findings:
                    tally["refused" if "refused" in finding else "wrong"] += 1
                    shown += 1
                    if shown <= arguments.show:
                        print(f"{what} {arguments.seed}/{number}: {finding}", flush=True)
        if count:
            spent = time.perf_counter() - began
            wrong, refused = tally["wrong"], tally["refused"]
            print(f"{what}: {count} cases, {wrong} wrong, {refused} refused, {spent:.0f} s")
        total += tally.total()
    return 1 if total else 0


if __name__ == "__main__":
    raise SystemExit(main())
