"""Predicted yields against 100,000 independent random builds: ``python -m docs.scripts.yields``.

Each design is written to a folder, which ``tests/judge/yields.py`` judges: it shares no code with
the rules. ``docs/measured/yields.csv`` has a row a design. Some fail registration-worst-case, which
is waived here, as it is their share of good builds that is compared.
"""

from __future__ import annotations

import csv
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from sbafab.actuators import build, load_design
from sbafab.folders.run import RunRequest, generate
from sbafab.rules.registration_yield import simulate
from tests.judge.yields import judged_yield

ROOT = Path(__file__).parents[2]
TABLE = ROOT / "docs" / "measured" / "yields.csv"
GALLERY = ROOT / "docs" / "gallery"
BUILDS = 100_000
WAIVED = ("registration-worst-case", "pin-fit")


def _hand(millimetres: float, degrees: float) -> tuple[str, str]:
    return (
        f"registration.hand_placement={millimetres}",
        f"registration.hand_turn={degrees}",
    )


EARS, MIDDLE = "registration.method=ears", "registration.sequence=middle-first"
DESIGNS: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("1dof-5mm", ()),
    ("1dof-5mm", (MIDDLE,)),
    ("1dof-5mm", _hand(0.12, 0.6)),
    ("1dof-5mm", (*_hand(0.2, 1), "bond.width=0.85", "mask.overhang=0.6")),
    ("1dof-5mm", ("stack.balloons=12", *_hand(0.1, 0.4))),
    ("1dof-5mm", (EARS, "registration.cutting_error=0.13")),
    ("1dof-10mm", ()),
    ("1dof-10mm", (*_hand(0.05, 1), "registration.cutting_error=0.12")),
    ("1dof-10mm", (EARS, "registration.plate_made_by=cnc-mill", "registration.pin_clearance=0.05")),
    ("1dof-10mm", (MIDDLE, "stack.balloons=3", *_hand(0.15, 0.6))),
    ("3dof-15mm", ()),
    ("3dof-15mm", ("stack.balloons=3", *_hand(0.12, 0.6))),
    ("3dof-15mm", ("stack.balloons=6", MIDDLE, *_hand(0.1, 0.5))),
    ("3dof-15mm", ("chamber.count=4", "stack.balloons=2", *_hand(0.1, 0.3))),
    (
        "3dof-15mm",
        (
            *("stack.balloons=2", EARS, "registration.plate_made_by=drill-press"),
            *("bond.width=1.1", "mask.overhang=0.85"),
        ),
    ),
    ("radial-15mm", ()),
    ("radial-15mm", (*_hand(0.12, 0.3), "bond.width=0.8")),
    ("radial-15mm", ("stack.balloons=2", EARS, "registration.cutting_error=0.13")),
    ("oval", ("stack.balloons=4",)),
    ("bean", ("stack.balloons=2", *_hand(0.1, 0.4))),
)
"""Templates and drawings of the gallery, with keys set."""


class JudgedYield(NamedTuple):
    """A design's predicted share, of how many builds, and that of the judge; in per cent."""

    design: str
    keys: str
    predicted: float
    builds: int
    judged: float
    difference: float


def judged(source: str, keys: tuple[str, ...], builds: int = BUILDS) -> JudgedYield:
    """Return both shares of good builds of a design."""
    drawn = GALLERY / f"{source}.toml"
    design = load_design(drawn if drawn.is_file() else source, keys, WAIVED)
    share = simulate(build(design), design).whole
    with tempfile.TemporaryDirectory() as folder:
        quick = design.with_({"rules.yield_builds": 100})
        run = generate(RunRequest(quick, Path(folder), ("cut", "press")))
        found = judged_yield(run.folder, builds)
    predicted, other = 100 * share.value, 100 * found
    return JudgedYield(
        source,
        " ".join(keys),
        round(predicted, 2),
        share.builds,
        round(other, 2),
        round(predicted - other, 2),
    )


def rows() -> Iterator[JudgedYield]:
    """Yield both shares of all designs."""
    for source, keys in DESIGNS:
        row = judged(source, keys)
        print(*row, file=sys.stderr, flush=True)
        yield row


def main() -> None:
    """Write the table; exit with 1 where a prediction is off by more than a percentage point."""
    table = list(rows())
    with TABLE.open("w", encoding="utf-8", newline="") as opened:
        writer = csv.writer(opened, lineterminator="\n")
        writer.writerow(JudgedYield._fields)
        writer.writerows(table)
    if any(abs(row.difference) > 1 for row in table):
        sys.exit(1)


if __name__ == "__main__":
    main()
