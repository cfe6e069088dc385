"""Measures what docs/benchmarks.md shows and writes its tables.

``python -m docs.scripts.benchmark_runs --before FOLDER`` wants a checkout of the version to compare
with, and a machine that does nothing else; it takes a quarter of an hour.
"""

from __future__ import annotations

import argparse
import platform
from collections.abc import Sequence
from datetime import date
from pathlib import Path

from benchmarks.__main__ import python_of
from benchmarks.sections import Asked, sections
from benchmarks.timing import ROOT, Section, keep_to_one_core
from benchmarks.versions import Compared, compared
from docs.scripts.measured import Record, Table, keep, record, versions
from sbafab.process import prepare

COMMAND = "python -m docs.scripts.benchmark_runs --before FOLDER"
AIMS = {
    "design and rules, 1dof-5mm": "0.010",
    "design and rules, 3dof-15mm": "0.033",
    "check 1dof-5mm, drawn outline of 300 edges": "1",
    "generate 3dof-15mm": "1.2",
    "cut 3dof-15mm, 50 copies": "5",
    "40 plates, a DXF each": "0.15",
}
"""Seconds that were aimed at."""
GROWN = ("balloons", "chambers", "edges", "copies")
"""Sections whose growth is told, in one table."""
TABLES = (
    "plates",
    "decks",
    "compiled",
    "processes",
    "memory",
    "poses",
    "commands",
    "growth",
    "versions",
)


def beside(found: Sequence[Compared]) -> Table:
    rows = [
        [one.name, f"{min(one.before):.3f}", f"{min(one.now):.3f}", AIMS.get(one.name, "")]
        for one in found
    ]
    return Table(["least processor time, s", "0.1.0", "now", "aim"], rows)


def growth(found: Sequence[Section]) -> Table:
    rows = []
    for one in found:
        if one.power is not None:
            sizes = [row.name.split()[0] for row in one.rows]
            least, most = f"{min(one.rows[0].times):.2f}", f"{min(one.rows[-1].times):.2f}"
            rows.append([one.title, f"{sizes[0]} to {sizes[-1]} {one.key}", f"{least} to {most}"])
            rows[-1].append(f"{one.power:.2f}")
    return Table(["work", "number of", "s", "grows to the power of"], rows)


def told(section: Section) -> Table:
    """Each row with its least time and remark."""
    each = 1000 if section.unit == "ms" else 1
    rows = [[row.name, f"{each * min(row.times):.3g}", row.remark] for row in section.rows]
    return Table(["", f"{section.timed}, {section.unit}", ""], rows)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m docs.scripts.benchmark_runs")
    parser.add_argument("--before", type=Path, required=True)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--designs", type=int, default=10_000)
    parser.add_argument(
        "--tables",
        nargs="+",
        choices=TABLES,
        default=[],
        help="measured again; the others stay as they are",
    )
    arguments = parser.parse_args()
    keep_to_one_core()
    prepare()
    rivals = python_of(ROOT / ".benchmarks" / "venv")
    used = {"Python": platform.python_version(), **versions(numpy="numpy", MuJoCo="mujoco")}
    day, again = date.today().isoformat(), arguments.tables
    tables: dict[str, Table] = {}
    if again:
        kept = record("benchmarks")
        if (kept.day, kept.versions) != (day, used):
            parser.error("the record is of another day or of other versions: measure all tables")
        tables = dict(kept.tables)
    if again != ["versions"]:
        only = [key for one in again for key in (GROWN if one == "growth" else [one])]
        made = list(sections(Asked(arguments.rounds, arguments.designs, rivals), only))
        tables |= {one.key: told(one) for one in made if one.power is None}
        if any(one.power is not None for one in made):
            tables["growth"] = growth(made)
    if not again or "versions" in again:
        tables["versions"] = beside(compared(arguments.before.resolve(), arguments.rounds))
    keep("benchmarks", Record(COMMAND, day, used, tables))


if __name__ == "__main__":
    main()
