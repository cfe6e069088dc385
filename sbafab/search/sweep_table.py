"""The rows of a sweep as CSV and Parquet: a design a row, in the order in which they were asked.

Both hold the same columns and the same bytes whoever measured the rows, and when; how long each
took is in a file of its own.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import IO, Any, NamedTuple

from sbafab.errors import OutputError
from sbafab.rules.deck import rule_names
from sbafab.search.measure import SweepRow
from sbafab.search.vary import Values
from sbafab.spreadsheet import write_rows

PARTS = (("verdict", 0), ("margin", 1), ("measured", 2), ("limit", 3))
"""Columns of each rule, and where they stand in its list."""
HEAD = ("number", "sha256", "outcome", "reason")
"""The first columns, whatever is varied."""
FIRST = (
    "outline diameter",
    "overall diameter",
    "deflated diameter",
    "reached diameter",
    "deflated height",
    "mass",
    "full stroke",
)
"""Figures that are looked for first, whatever the pressure."""
MOVED = ("free stroke", "bend", "blocked force", "blocked force of one SBA")
"""Those at a pressure."""
YIELD = "registration-yield.measured"
LITTLE = 0.005
"""Share of a limit that is nothing to spare."""
BATCH = 1000
"""Rows in memory at a time."""


class Column(NamedTuple):
    """A column: its name, and whether it holds nothing but numbers."""

    name: str
    is_number: bool


class Table:
    """Rows of a sweep, read again each time, so that as many fit as the disk holds.

    Files get the columns that a reader looks for first; ``is_whole``: all of them.
    """

    def __init__(
        self,
        rows: Callable[[], Iterator[SweepRow]],
        values: Sequence[Values],
        pressures_kpa: Sequence[float] = (),
        is_whole: bool = False,
    ) -> None:
        self.rows = rows
        self.values = values
        self.pressures_kpa = pressures_kpa
        self.is_whole = is_whole

    def __len__(self) -> int:
        return len(self.values)

    @cached_property
    def columns(self) -> tuple[Column, ...]:
        """Columns of all rows: keys, the varied ones first, then rules, then figures.

        A column with a text in any row holds texts.
        """
        kinds: dict[str, bool] = {}
        order: tuple[dict[str, None], ...] = ({}, {}, {}, {})
        for row in self._flat():
            for part, cells in zip(order, row, strict=True):
                for name, cell in cells.items():
                    part[name] = None
                    if cell is not None:
                        is_number = isinstance(cell, int | float) and not isinstance(cell, bool)
                        kinds[name] = kinds.get(name, True) and is_number
        names = [name for part in order for name in part]
        return tuple(Column(name, kinds.get(name, True)) for name in names)

    @cached_property
    def written(self) -> tuple[Column, ...]:
        """Columns of the files: varied keys, leading figures, binding rules; or all."""
        by_name = {column.name: column for column in self.columns}
        varied = [name for values in self.values for name in values]
        first = [*HEAD, *varied, *self._leading(list(by_name)), *self._binding()]
        rest = by_name if self.is_whole else ()
        return tuple(by_name[name] for name in dict.fromkeys([*first, *rest]) if name in by_name)

    def _leading(self, names: Sequence[str]) -> Iterator[str]:
        """Yield each leading figure's first column, by the model to design with."""
        each = [f"{figure} at {kpa:g} kPa" for kpa in self.pressures_kpa for figure in MOVED]
        for begins in (*FIRST, *each):
            yield from [name for name in names if name.startswith(begins)][:1]
        yield YIELD

    def _binding(self) -> Iterator[str]:
        """Yield verdict and margin of the rules that fail, warn or pass without margin anywhere."""
        not_passing = {
            name
            for row in self.rows()
            for name, (verdict, margin, _, limit, _) in row.get("rules", {}).items()
            if verdict != "pass"
            or (margin is not None and limit and abs(margin) < LITTLE * abs(limit))
        }
        for name in rule_names():
            if name in not_passing:
                yield from (f"{name}.verdict", f"{name}.margin")

    def cells(self, columns: Sequence[Column] | None = None) -> Iterator[list[Any]]:
        """The cells of every row in these columns, or in all; None where there is nothing."""
        chosen = self.columns if columns is None else columns
        for row in self._flat():
            every = {name: cell for part in row for name, cell in part.items()}
            yield [_cell(every.get(name), is_number) for name, is_number in chosen]

    def _flat(self) -> Iterator[tuple[dict[str, Any], ...]]:
        for number, (row, values) in enumerate(zip(self.rows(), self.values, strict=True), 1):
            cells = (number, row.get("sha256", ""), row["outcome"], row["reason"])
            head = dict(zip(HEAD, cells, strict=True))
            # What was asked stands there even where no design came of it.
            yield head, {**values, **row.get("keys", {})}, _rules(row), row.get("figures", {})

    @staticmethod
    @contextmanager
    def replacing(path: Path) -> Iterator[IO[str]]:
        """A file that takes its place when it is whole."""
        begun = path.with_name(f".{path.name}.part")
        with begun.open("w", encoding="utf-8", newline="") as opened:
            yield opened
        begun.replace(path)


def _rules(row: SweepRow) -> dict[str, Any]:
    rules = row.get("rules", {})
    return {
        f"{name}.{part}": rules[name][place]
        for name in rule_names()
        if name in rules
        for part, place in PARTS
    }


def _cell(value: Any, is_number: bool) -> Any:
    if value is None or is_number or isinstance(value, str):
        return value
    return json.dumps(value, ensure_ascii=False)


def write_csv(table: Table, path: Path) -> None:
    """Writes every row in the table's ``written`` columns; empty cells are what is not known."""
    with table.replacing(path) as opened:
        names = [column.name for column in table.written]
        write_rows(opened, chain([names], table.cells(table.written)))


def write_times(table: Table, path: Path) -> None:
    """Writes the seconds that each design took."""
    with table.replacing(path) as opened:
        rows = (
            [number, row.get("sha256", ""), row.get("seconds")]
            for number, row in enumerate(table.rows(), 1)
        )
        write_rows(opened, chain([["number", "sha256", "seconds"]], rows))


def write_parquet(table: Table, path: Path) -> bool:
    """Writes the same as Parquet, numbers as doubles; False where pyarrow is not installed."""
    try:
        import pyarrow as pa
        from pyarrow import parquet
    except ImportError:
        return False
    schema = pa.schema(
        [(name, pa.float64() if is_number else pa.string()) for name, is_number in table.written]
    )
    begun = path.with_name(f".{path.name}.part")
    with parquet.ParquetWriter(begun, schema) as written:
        for rows in _batches(table.cells(table.written)):
            columns = [
                pa.array(column, field.type)
                for column, field in zip(zip(*rows, strict=True), schema, strict=True)
            ]
            written.write_table(pa.table(columns, schema=schema))
    begun.replace(path)
    return True


def _batches(rows: Iterator[list[Any]]) -> Iterator[list[list[Any]]]:
    batch: list[list[Any]] = []
    for row in rows:
        batch.append(row)
        if len(batch) == BATCH:
            yield batch
            batch = []
    if batch:
        yield batch


# The tables of an earlier sweep in the folder.


def refuse_foreign(path: Path) -> None:
    """Raises OutputError where a table stands that no sweep has written."""
    if not path.exists():
        return
    with path.open(newline="", encoding="utf-8", errors="replace") as opened:
        first = opened.readline(200)
    if not first.startswith(",".join(HEAD)):
        raise OutputError(
            f"{path} was not written by sbafab sweep; move it away, or choose another folder "
            "with -o"
        )


def stale_designs(path: Path, table: Table) -> int:
    """Return the number of designs in the CSV file at the path that are not in the table."""
    if not path.exists():
        return 0
    now = {row.get("sha256", "") for row in table.rows()}
    with path.open(newline="", encoding="utf-8") as opened:
        before = {row.get("sha256", "") for row in csv.DictReader(opened)}
    return len(before - now - {""})
