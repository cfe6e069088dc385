"""Measures what docs/testing.md shows and writes its tables.

``python -m docs.scripts.benchmark_runs --before FOLDER`` wants a checkout of the version to compare
with, and a machine that does nothing else; it takes half an hour.
"""

from __future__ import annotations

import argparse
import platform
from collections.abc import Sequence
from datetime import date
from pathlib import Path
from statistics import median

from benchmarks.__main__ import python_of
from benchmarks.sections import MODULES, RIVALS, Asked, importable, sections
from benchmarks.timing import ROOT, Row, Section, keep_to_one_core
from benchmarks.versions import Compared, compared
from docs.scripts.measured import Record, keep, record, versions
from docs.scripts.tables import Table
from sbafab.runtime import prepare

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
RATES = ("decks", "processes", "poses")
"""Tables that tell rates: each has what another program took in the same run."""
ONCE = ("memory",)
"""Tables of one long run."""
TABLES = (
    "plates",
    "decks",
    "processes",
    "memory",
    "poses",
    "commands",
    "growth",
    "versions",
)


def versions_table(found: Sequence[Compared]) -> Table:
    rows = [
        [one.name, f"{median(one.before):.3f}", f"{median(one.now):.3f}", AIMS.get(one.name, "")]
        for one in found
    ]
    return Table(["median processor time, s", "0.1.0", "now", "aim"], rows)


def growth(found: Sequence[Section]) -> Table:
    rows = []
    for one in found:
        if one.power is not None:
            sizes = [row.name.split()[0] for row in one.rows]
            times = f"{one.rows[0].median:.2f} to {one.rows[-1].median:.2f}"
            rows.append([one.title, f"{sizes[0]} to {sizes[-1]} {one.key}", times])
            rows[-1].append(f"{one.power:.2f}")
    return Table(["work", "number of", "median processor time, s", "grows to the power of"], rows)


def told(section: Section, beside: Row | None = None) -> Table:
    """Return each row's median time, the least of how many, and what is said of it.

    ``beside``: another program's work in the same run, by which a reader's machine can be compared.
    """
    each = 1000 if section.unit == "ms" else 1
    if section.key in ONCE:
        once = [[row.name, f"{each * row.times[0]:.3g}", row.remark] for row in section.rows]
        return Table(["", f"{section.timed}, {section.unit}", ""], once)
    rows = [
        [
            row.name,
            f"{each * row.median:.3g}",
            f"{each * min(row.times):.3g}",
            str(len(row.times)),
            row.remark,
        ]
        for row in (*section.rows, *([beside] if beside else []))
    ]
    return Table(["", f"median {section.timed}, {section.unit}", "least", "of", ""], rows)


def other_program(found: Sequence[Section]) -> Row | None:
    """Return the quicker of the other programs at its plates, if it was measured."""
    plates = (row for one in found if one.key == "plates" for row in one.rows)
    others = [row for row in plates if row.name != "sbafab"]
    if not others:
        return None
    name, times, _ = min(others, key=lambda row: row.median)
    return Row(f"{name} in the same run", times, "40 lobed plates, a DXF each")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m docs.scripts.benchmark_runs")
    parser.add_argument("--before", type=Path, required=True)
    parser.add_argument("--rounds", type=int, default=5)
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
    lacks = [RIVALS[name] for name, module in MODULES.items() if not importable(rivals, module)]
    if lacks:
        parser.error(f"{rivals} lacks {', '.join(lacks)}: run python -m benchmarks --install first")
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
        if not {*only}.isdisjoint(RATES):
            # Rates stand beside what another program took in the same run.
            only.append("plates")
        made = list(sections(Asked(arguments.rounds, arguments.designs, rivals), only))
        other = other_program(made)
        tables |= {
            one.key: told(one, other if one.key in RATES else None)
            for one in made
            if one.power is None
        }
        if any(one.power is not None for one in made):
            tables["growth"] = growth(made)
    if not again or "versions" in again:
        tables["versions"] = versions_table(compared(arguments.before.resolve(), arguments.rounds))
    keep("benchmarks", Record(COMMAND, day, used, tables))


if __name__ == "__main__":
    main()
