"""Tables kept as CSV in docs/measured: read, written, summarised, and each shown whole on a page.

``validation`` holds every figure of the paper beside its prediction, ``calibrated`` those of the
calibrated models with their intervals, ``sensitivity`` the calibrated forces with one assumption
changed, ``candidates`` those of other physics, ``balloons`` the elastic balloon beside CalculiX,
``faults`` what each rule says of each faulty folder.
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

FOLDER = Path(__file__).parents[1] / "measured"


class Table(NamedTuple):
    """A table as its page shows it: texts, a line a row."""

    columns: Sequence[str]
    rows: Sequence[Sequence[str]]

    @property
    def markdown(self) -> str:
        """The table as a page has it."""
        rule = ["---"] * len(self.columns)
        return "\n".join("| " + " | ".join(row) + " |" for row in (self.columns, rule, *self.rows))

    def cell(self, row: str, column: str) -> str:
        """One cell, by the first cell of its row and its column's head."""
        (cells,) = (cells for cells in self.rows if cells[0] == row)
        return cells[list(self.columns).index(column)]

    @property
    def csv(self) -> str:
        """The table as a CSV file has it."""
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows((self.columns, *self.rows))
        return text.getvalue()


def from_csv(text: str) -> Table:
    """Return the table of a CSV text, its first line the columns."""
    columns, *rows = csv.reader(io.StringIO(text))
    return Table(columns, rows)


def table(name: str) -> Table:
    """Return the table ``docs/measured/NAME.csv``."""
    return from_csv((FOLDER / f"{name}.csv").read_text(encoding="utf-8"))


def markdown_rows(text: str, heading: str = "") -> Iterator[list[str]]:
    """Yield the rows of all Markdown tables of a text, each after the heading it stands below."""
    header: list[str] = []
    for line in text.splitlines():
        if line.startswith("## "):
            heading = line.removeprefix("## ")
        if not line.startswith("|"):
            header = []
            continue
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        if header and not set(cells[0]) <= {"-"}:
            yield [heading, *cells]
        header = header or cells


CALIBRATED = (
    # Curve and place of the CSV, and the figure's name in the summary.
    ("(force-1dof), height share 0.75", "blocked force, 1-DoF, 75 % of stroke"),
    ("(force-3dof), height share 0", "blocked force, 3-DoF, flat"),
    ("(force-3dof), height share 0.75", "blocked force, 3-DoF, 75 % of stroke"),
    ("(flat-height)", "deflated height of the 3-DoF"),
    ("(full-height)", "height of the 3-DoF"),
    ("(largest-bend)", "largest bend"),
    ("(time-water), pressure 10 kPa", "time to fill, water"),
    ("(modulus-3dof)", "lateral modulus, 3-DoF"),
)


def calibrated_summary() -> Table:
    """Return the paper's main figures beside the calibrated models and their intervals."""
    every = table("calibrated")
    shown = ("paper", "calibrated", "90 % interval", "inside")
    rows = []
    for ending, name in CALIBRATED:
        (figure,) = (row[0] for row in every.rows if row[0].endswith(ending))
        rows.append([name, *(every.cell(figure, column) for column in shown)])
    return Table(["figure", *shown], rows)


def balloons_summary() -> Table:
    """Return the largest differences of stroke and air by pocket and how its rim was held."""
    every = table("balloons")
    largest: dict[tuple[str, str], list[float]] = {}
    for name, *cells in every.rows:
        size, _, rim = name.split(", ", 2)
        rim = "even ripples" if "ripples" in rim else rim
        off = [max(abs(float(value)) for value in cells[k].split(",")) for k in (3, 6)]
        before = largest.get((rim, size), [0.0, 0.0])
        largest[rim, size] = [max(pair) for pair in zip(before, off, strict=True)]
    rows = [
        [size.replace("d = ", "") + " mm", rim, f"{stroke:.1f} %", f"{air:.1f} %"]
        for (rim, size), (stroke, air) in largest.items()
    ]
    return Table(["pocket", "rim", "stroke within", "air within"], rows)


def faults_summary() -> Table:
    """Return the number of kinds, of faults and of faulty folders."""
    rows = table("faults").rows
    folders = sum(not cell.startswith("n/a") for row in rows for cell in row[4:])
    counts = (len({row[0] for row in rows}), len(rows), folders)
    return Table(["kinds", "faults", "faulty folders"], [[str(count) for count in counts]])


def sofa_summary() -> Table:
    """Return height in mm and tilt in degrees of SOFA's scenes at 5 kPa, and their steps a second."""
    columns, rows = json.loads((FOLDER / "sofa.json").read_text(encoding="utf-8"))["tables"][
        "pressures"
    ].values()
    return Table(columns, [row for row in rows if row[0].startswith(("5, ", "steps"))])


SUMMARIES: Mapping[tuple[str, str], Callable[[], Table]] = {
    ("calibrated", "summary"): calibrated_summary,
    ("balloons", "summary"): balloons_summary,
    ("faults", "summary"): faults_summary,
    ("sofa", "summary"): sofa_summary,
}
"""What a page may name in ``<!-- measured: NAME TABLE -->`` beside the tables of the records."""
