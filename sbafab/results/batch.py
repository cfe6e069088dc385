"""A batch's table as it was filled in: a row an actuator, all rows or none."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from pathlib import Path

from sbafab.cutting.measured_table import table_text
from sbafab.errors import DesignError
from sbafab.results.records import COLUMNS, ERRORS, NUMBERS, TEXTS, LabResult, checked

_NUMBER = re.compile(r"\d+(?:[.,]\d*)?|[.,]\d+", re.ASCII)


def read_batch(path: Path) -> list[LabResult]:
    """A result a row, of a table with some of COLUMNS, "serial" among them.

    Columns are parted by commas, semicolons or tabs, the latter two also with decimal commas;
    several errors stand in one cell, parted by blanks. Raises DesignError with the line.
    """
    lines = [
        (f"{path}, line {number}", line)
        for number, line in enumerate(table_text(path).splitlines(), start=1)
        if line.strip(' ,;\t"') and not line.lstrip(' "').startswith("#")
    ]
    if not lines:
        raise DesignError(f"{path} is empty; its first line names columns: {', '.join(COLUMNS)}")
    separator = max(",;\t", key=lines[0][1].count)
    names = [name.lower() for name in _cells(lines[0], separator)]
    _check_names(names, path)
    found = [_result(_row(line, names, separator), line[0]) for line in lines[1:]]
    if not found:
        raise DesignError(f"{path} has no row below its columns; fill in one for each actuator")
    return found


def _check_names(names: Sequence[str], path: Path) -> None:
    for name in names:
        if name and name not in COLUMNS:
            raise DesignError(f"{path} has a column {name[:40]!r}; known are {', '.join(COLUMNS)}")
        if name and names.count(name) > 1:
            raise DesignError(f"{path} has two columns {name}; keep one")
    if "serial" not in names:
        raise DesignError(f"{path} has no column serial; each actuator needs one")


def _cells(line: tuple[str, str], separator: str) -> list[str]:
    try:
        return [cell.strip() for cell in next(csv.reader([line[1]], delimiter=separator))]
    except csv.Error as error:
        raise DesignError(f"{line[0]} cannot be read ({error}); save the table as CSV") from None


def _row(line: tuple[str, str], names: Sequence[str], separator: str) -> dict[str, str]:
    cells = _cells(line, separator)
    while len(cells) > len(names) and not cells[-1]:
        cells.pop()
    if len(cells) != len(names):
        raise DesignError(
            f"{line[0]} has {len(cells)} cells where the header has {len(names)}; write decimal "
            "points, or part columns by semicolons"
        )
    return {name: cell for name, cell in zip(names, cells, strict=True) if name and cell}


def _result(row: dict[str, str], where: str) -> LabResult:
    if "serial" not in row:
        raise DesignError(f"{where} has no serial")
    serial, operator, kit, note = (row.get(name, "") for name in TEXTS)
    result = LabResult(
        serial=serial,
        operator=operator,
        kit=kit,
        note=note,
        leak=row.get("leak", "").lower(),
        numbers={q.name: _number(row[q.name], q.name, where) for q in NUMBERS if q.name in row},
        errors={
            q.name: tuple(_number(text, q.name, where) for text in row[q.name].split())
            for q in ERRORS
            if q.name in row
        },
    )
    if result.is_empty:
        raise DesignError(
            f"{where}: nothing is said of {result.serial}; fill in a cell or remove it"
        )
    return checked(result, where)


def _number(text: str, column: str, where: str) -> float:
    if _NUMBER.fullmatch(text) is None:
        raise DesignError(f"{where}: {column} is {text[:40]!r}, not a number such as 16.8")
    return float(text.replace(",", "."))
