"""The sentence of README on processor times, from the record.

``measured`` puts them where a page names them; which statistic they give, the table's head says.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from docs.scripts.measured import Record
    from docs.scripts.tables import Table


def statistic(table: Table) -> str:
    """Return which of a row's times the table gives: ``median`` or ``least``."""
    return next(head for head in table.columns if head).split()[0]


def seconds(table: Table, row: str) -> str:
    """Return a row's time with two digits."""
    return f"{float(_cells(table, row)[1]):.2g}"


def speed(record: Record) -> str:
    """Return README's sentence on two commands, the statistic named."""
    versions, commands = record.tables["versions"], record.tables["commands"]
    generate = f"{float(versions.cell('generate 3dof-15mm', 'now')):.2g}"
    return (
        "On one core of a 2-core virtual machine, imports included, "
        f"{statistic(versions)} processor time of several rounds:\n"
        f"`sbafab generate 3dof-15mm` takes {generate} s, `sbafab --help` "
        f"{seconds(commands, 'sbafab --help')} s ([benchmarks](docs/testing.md#benchmarks))."
    )


def _cells(table: Table, row: str) -> list[str]:
    (cells,) = (list(cells) for cells in table.rows if cells[0] == row)
    return cells


WORDS: Mapping[str, Callable[[Record], str]] = {"speed": speed}
"""What a page may name in place of a table of the record ``benchmarks``."""
