"""The coupon's table as it was filled in: read where it can be read in one way, or refused."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator
from pathlib import Path

from sbafab.cutting.calibration import RESOLUTIONS, Kind, Measurement
from sbafab.cutting.coupon import COLUMNS
from sbafab.errors import DesignError

MOST_BYTES = 1_000_000
LONGEST = 10_000.0
"""mm."""
SEPARATORS = (",", ";", "\t")
NUMBERS = ("nominal_mm", "measured_mm")
INSTRUMENT = "instrument"
"""A column that may be there: what the size was measured with."""
KINDS: dict[str, Kind] = {"outer": "outer", "window": "window", "piece": "outer"}
"""Last words of a feature; a piece fell out of a window."""
_NUMBER = re.compile(r"[-+]?(?:\d+(?:[.,]\d*)?|[.,]\d+)", re.ASCII)
_WHOLE = re.compile(r"\d+", re.ASCII)


def read_measurements(path: Path, instrument: str = "") -> list[Measurement]:
    """The filled rows of a table with the coupon's columns; ``#`` begins a remark.

    ``instrument`` is what all was measured with, unless a column of that name says so row by row.
    Columns are parted by commas, semicolons or tabs; numbers have a decimal point or comma. A
    spreadsheet that parts columns by semicolons leaves our commas in its first cell; that is read
    too. Raises DesignError, also for a row whose decimal commas cannot be told from those between
    columns.
    """
    lines = [
        (f"{path}, line {number}", line)
        for number, line in enumerate(table_text(path).splitlines(), start=1)
        if line.strip(' ,;\t"') and not line.lstrip(' "').startswith("#")
    ]
    separator, names = _header(path, lines[0] if lines else ("", ""))
    found = []
    for where, line in lines[1:]:
        cells = _row(line, separator, len(names), where)
        _refuse_two_ways(cells, names, separator, where)
        row = dict(zip(names, cells, strict=False))
        if row["measured_mm"]:
            found.append(_measurement(row, where, instrument))
    return found


def table_text(path: Path) -> str:
    """The text of a table that someone filled in. Raises DesignError where it is none."""
    try:
        if path.stat().st_size > MOST_BYTES:
            raise DesignError(
                f"{path} is larger than {MOST_BYTES:,} bytes; give the table that was filled in"
            )
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise DesignError(f"{path} cannot be read: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise DesignError(f"{path} is not a text file in UTF-8; save it as CSV") from None


def _header(path: Path, first: tuple[str, str]) -> tuple[str, list[str]]:
    """What parts the columns, and their names in small letters."""
    where, line = first
    separator = max(SEPARATORS, key=line.count)
    names = [name.lower() for name in _cells(line, separator, where)]
    while names and not names[-1]:
        names.pop()
    for column in COLUMNS:
        if names.count(column) != 1:
            many = "two columns" if column in names else "no column"
            raise DesignError(
                f"{path} has {many} {column}; keep the columns {', '.join(COLUMNS)}, once each"
            )
    return separator, names


def _row(line: str, separator: str, count: int, where: str) -> list[str]:
    """The cells of a row: parted like the header, or what stands behind a semicolon is the last."""
    cells = _cells(line, separator, where)
    if separator != "," or ";" not in line:
        return cells
    parted = _cells(line, ";", where)
    while len(parted) > 1 and not parted[-1]:
        parted.pop()
    if len(parted) == count:
        return parted
    first = _cells(parted[0], ",", where)
    if len(parted) == 2 and len(first) == count and not first[-1]:
        return [*first[:-1], parted[1]]
    return cells


def _cells(line: str, separator: str, where: str) -> list[str]:
    try:
        row: Iterator[list[str]] = csv.reader([line], delimiter=separator, strict=True)
        return [cell.strip() for cell in next(row)]
    except csv.Error:
        raise DesignError(f"{where} has a quotation mark without its other; remove it") from None


def _refuse_two_ways(cells: list[str], names: list[str], separator: str, where: str) -> None:
    """Raises DesignError for a row that fits the header not at all, or in more than one way."""
    remedy = (
        "; write decimal points, or part the columns by semicolons where commas are decimal"
        if separator == ","
        else "; fill in one cell a column"
    )
    while len(cells) > len(names) and not cells[-1]:
        cells = cells[:-1]
    if len(cells) != len(names):
        raise DesignError(
            f"{where} has {len(cells)} cells where the header has {len(names)}{remedy}"
        )
    if separator != ",":
        return
    for place, name in enumerate(names[:-1]):
        after = names[place + 1]
        is_split = name in NUMBERS and after not in NUMBERS and _WHOLE.fullmatch(cells[place])
        if is_split and _WHOLE.fullmatch(cells[place + 1]):
            raise DesignError(
                f"{where} may say {cells[place]} or {cells[place]},{cells[place + 1]} for "
                f"{name}{remedy}"
            )


def _measurement(row: dict[str, str], where: str, instrument: str) -> Measurement:
    words = row["feature"].lower().split()
    axis = row["axis"].lower()
    kinds = {KINDS[word] for word in words if word in KINDS}
    if len(kinds) != 1:
        raise DesignError(f"{where}: feature must end in outer, window or piece")
    (kind,) = kinds
    used = row.get(INSTRUMENT, "").lower() or instrument
    if used and used not in RESOLUTIONS:
        known = ", ".join(RESOLUTIONS)
        raise DesignError(f"{where}: instrument is {used[:40]!r}; it must be one of {known}")
    if axis not in ("x", "y"):
        raise DesignError(f"{where}: axis must be x or y")
    nominal, measured = (_size(row[name], name, where) for name in NUMBERS)
    return Measurement(kind, "x" if axis == "x" else "y", nominal, measured, where, used)


def _size(text: str, column: str, where: str) -> float:
    if _NUMBER.fullmatch(text) is None:
        raise DesignError(
            f"{where}: {column} is {text[:40]!r}, not a number; write it in mm, for example 23.9"
        )
    size = float(text.replace(",", "."))
    if not 0 < size <= LONGEST:
        raise DesignError(f"{where}: {column} is {text[:40]}; it must be a size in mm above 0")
    return size
