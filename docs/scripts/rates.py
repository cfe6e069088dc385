"""Sentences of the pages that tell how fast sbafab is, in the figures of the record.

``measured`` puts them where a page names them; which statistic they give, the table's head says.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from docs.scripts.measured import Record, Table

RIVALS = {"foldable": "foldable_robotics", "build123d": "build123d"}


def statistic(table: Table) -> str:
    """Return which of a row's times the table gives: ``median`` or ``least``."""
    return next(head for head in table.columns if head).split()[0]


def seconds(table: Table, row: str) -> str:
    """Return a row's time with two digits."""
    return f"{float(_cells(table, row)[1]):.2g}"


def speed(record: Record) -> str:
    """Return README's paragraph on commands and on plates, with the other programs' times."""
    versions, commands, plates = (record.tables[n] for n in ("versions", "commands", "plates"))
    generate = f"{float(versions.cell('generate 3dof-15mm', 'now')):.2g}"
    others = " and ".join(
        f"{seconds(plates, row[0])} s in {RIVALS[row[0]]}"
        for row in plates.rows
        if row[0] in RIVALS
    )
    return (
        "On one core of an idle 2-core virtual machine, imports included, "
        f"{statistic(versions)} processor time of several rounds:\n"
        "`sbafab generate 3dof-15mm`, all of the above but meshes and decks for simulators, takes "
        f"{generate} s, `sbafab --help`\n{seconds(commands, 'sbafab --help')} s. Forty lobed "
        "plates, each built anew and written as one DXF, take "
        f"{seconds(plates, 'sbafab')} s, and in the same run\n{others}."
    )


def poses(record: Record) -> str:
    """Return README's sentence on equilibria a second, the slowest named."""
    table = record.tables["poses"]
    rates = {row[0]: _rate(row) for row in table.rows if row[0].endswith("at random")}
    least = min(rates, key=lambda name: rates[name])
    return (
        "The stack also answers in real time, also under a tip load, gravity or a level plate. "
        f"Poses from nothing,\nat random, by the {statistic(table)} time of several rounds on one core: "
        f"{rates['no load, at random']:,} a second without a load, {rates[least]:,} in the slowest "
        f"case\n({_case(least)}):"
    )


def _case(name: str) -> str:
    load = name.removesuffix(", at random")
    return "tip load and gravity" if load == "both" else load


def _rate(row: Sequence[str]) -> int:
    return int(row[-1].split()[0].replace(",", ""))


def _cells(table: Table, row: str) -> list[str]:
    (cells,) = (list(cells) for cells in table.rows if cells[0] == row)
    return cells


WORDS: Mapping[str, Callable[[Record], str]] = {"speed": speed, "poses-a-second": poses}
"""What a page may name in place of a table of the record ``benchmarks``."""
