"""The rows of a sweep as CSV and Parquet: a design a row, in the order in which they were asked.

Both hold the same columns and the same bytes whoever measured the rows, and when; how long each
took is in a file of its own.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import IO, Any, NamedTuple

from sbafab.rules.deck import rule_names
from sbafab.search.measure import SweepRow
from sbafab.search.vary import Values
from sbafab.spreadsheet import write_rows

PARTS = (("verdict", 0), ("margin", 1), ("measured", 2), ("limit", 3))
"""Columns of each rule, and where they stand in its list."""
HEAD = ("number", "sha256", "outcome", "reason")
"""The first columns, whatever is varied."""
BATCH = 1000
"""Rows in memory at a time."""


class Column(NamedTuple):
    """A column: its name, and whether it holds nothing but numbers."""

    name: str
    is_number: bool


class Table:
    """Rows that are read anew each time, so that as many fit as the disk holds."""

    def __init__(self, rows: Callable[[], Iterator[SweepRow]], values: Sequence[Values]) -> None:
        self.rows = rows
        self.values = values

    def __len__(self) -> int:
        return len(self.values)

    @cached_property
    def columns(self) -> tuple[Column, ...]:
        """Those of all rows: keys, the varied ones first, then rules, then figures.

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

    def cells(self) -> Iterator[list[Any]]:
        """The cells of every row, None where there is nothing."""
        for row in self._flat():
            every = {name: cell for part in row for name, cell in part.items()}
            yield [_cell(every.get(name), is_number) for name, is_number in self.columns]

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
    found = row.get("rules", {})
    return {
        f"{name}.{part}": found[name][place]
        for name in rule_names()
        if name in found
        for part, place in PARTS
    }


def _cell(value: Any, is_number: bool) -> Any:
    if value is None or is_number or isinstance(value, str):
        return value
    return json.dumps(value, ensure_ascii=False)


def write_csv(table: Table, path: Path) -> None:
    """Writes every row; empty cells are what is not known."""
    with table.replacing(path) as opened:
        write_rows(opened, chain([[column.name for column in table.columns]], table.cells()))


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
        [(name, pa.float64() if is_number else pa.string()) for name, is_number in table.columns]
    )
    begun = path.with_name(f".{path.name}.part")
    with parquet.ParquetWriter(begun, schema) as written:
        for rows in _batches(table.cells()):
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
