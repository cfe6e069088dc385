"""CSV for spreadsheets, in which no text is read as a formula; and filled-in tables, which are read
if they are unambiguous, or refused.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Collection, Iterable, Iterator, Sequence
from io import StringIO
from pathlib import Path
from typing import Any

from sbafab.errors import DesignError

# The start of a formula (CWE-1236; OWASP ASVS 5.0, 1.2.10), also in the wide forms of CJK fonts,
# where a cell begins: at the start, or after the separator of another locale.
_FORMULA = re.compile(r"(^|[;\t\n])([^\S\t\n]*)(?=([=+\-@\uff1d\uff0b\uff0d\uff20][^;\t\n]*))")
_NUMBER = re.compile(r"[+-]?(?:(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?|inf|nan)\s*", re.ASCII | re.I)
TEXT_MARK = "'"
"""Written before a text that a spreadsheet would read as a formula."""


def csv_text(rows: Iterable[Sequence[Any]]) -> str:
    """Return rows as the text of a CSV file: commas, a line feed after each, None as an empty cell.

    Numbers are written unchanged; a text that would be a formula gets the prefix TEXT_MARK.
    """
    text = StringIO()
    csv.writer(text, lineterminator="\n").writerows([_cell(value) for value in row] for row in rows)
    return text.getvalue()


def _cell(value: Any) -> Any:
    return plain_text(value) if isinstance(value, str) else value


def plain_text(text: str) -> str:
    """Return the text with TEXT_MARK as prefix if a spreadsheet would read it as a formula.

    Its lines end with a line feed: Python 3.11 writes a lone carriage return without quotes.
    """

    def marked(place: re.Match[str]) -> str:
        is_number = _NUMBER.fullmatch(place[3]) is not None
        return place[0] if is_number else f"{place[1]}{place[2]}{TEXT_MARK}"

    return _FORMULA.sub(marked, text.replace("\r\n", "\n").replace("\r", "\n"))


# Filled-in tables.


MOST_BYTES = 1_000_000
SEPARATORS = ",;\t"
_WHOLE = re.compile(r"\d+", re.ASCII)


def table_text(path: Path) -> str:
    """Return the text of a filled-in table. Raises DesignError if the file is not a table."""
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


def table_rows(
    path: Path, columns: Collection[str] = (), numbers: Collection[str] = ()
) -> Iterator[tuple[str, dict[str, str]]]:
    """Yield the filled rows below the header, by column, with their places; ``#`` starts a comment.

    Columns are separated by commas, semicolons or tabs; numbers have a decimal point or comma. A
    spreadsheet that separates columns by semicolons leaves our commas in its first cell, which is
    also read. Raises DesignError if one of ``columns`` is missing, and if decimal commas of
    ``numbers`` cannot be distinguished from column separators.
    """
    lines = [
        (f"{path}, line {number}", line)
        for number, line in enumerate(table_text(path).splitlines(), start=1)
        if line.strip(' ,;\t"') and not line.lstrip(' "').startswith("#")
    ]
    where, header = lines[0] if lines else ("", "")
    separator = max(SEPARATORS, key=header.count)
    names = [name.lower() for name in _stripped(_cells(header, separator, where), 0)]
    for column in columns or filter(None, names):
        if names.count(column) != 1:
            many = "two columns" if column in names else "no column"
            wanted = f"keep the columns {', '.join(columns)}, once each" if columns else "keep one"
            raise DesignError(f"{path} has {many} {column}; {wanted}")
    for where, line in lines[1:]:
        may_mix = bool(numbers) and separator == "," and ";" in line
        cells = _mixed(line, len(names), where) if may_mix else None
        cells = cells or _row(line, separator, len(names), where)
        _refuse_two_ways(cells, names, separator, numbers, where)
        yield where, dict(zip(names, cells, strict=True))


def _cells(line: str, separator: str, where: str) -> list[str]:
    """Return the cells of a row without surrounding spaces."""
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=separator, strict=True))]
    except StopIteration:
        return []
    except csv.Error:
        raise DesignError(f"{where} has an unmatched quotation mark; remove it") from None


def _stripped(cells: list[str], least: int) -> list[str]:
    """Return the cells without trailing empty ones, down to ``least`` of them."""
    while len(cells) > least and not cells[-1]:
        cells = cells[:-1]
    return cells


def _mixed(line: str, count: int, where: str) -> list[str] | None:
    """Return the cells of a row separated by semicolons, under a header with commas."""
    parted = _stripped(_cells(line, ";", where), 1)
    first = _cells(parted[0], ",", where)
    if len(parted) == count:
        return parted
    return (
        [*first[:-1], parted[1]]
        if len(parted) == 2 and [len(first), first[-1]] == [count, ""]
        else None
    )


def _row(line: str, separator: str, count: int, where: str) -> list[str]:
    cells = _stripped(_cells(line, separator, where), count)
    if len(cells) != count:
        raise DesignError(
            f"{where} has {len(cells)} cells, but the header has {count}{_remedy(separator)}"
        )
    return cells


def _remedy(separator: str) -> str:
    if separator != ",":
        return "; fill in one cell a column"
    return "; write decimal points, or part the columns by semicolons where commas are decimal"


def _refuse_two_ways(
    cells: list[str], names: list[str], separator: str, numbers: Collection[str], where: str
) -> None:
    """Raise DesignError for a number that may continue, after its comma, in the next cell."""
    for place, (name, after) in enumerate(zip(names, names[1:], strict=False)):
        whole, part = cells[place : place + 2]
        is_split = separator == "," and name in numbers and after not in numbers
        if is_split and _WHOLE.fullmatch(whole) and _WHOLE.fullmatch(part):
            raise DesignError(
                f"{where} may mean {whole} or {whole},{part} for {name}{_remedy(separator)}"
            )
