"""CSV for spreadsheets, in which no text is read as a formula."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Sequence
from io import StringIO
from typing import IO, Any

# The start of a formula (CWE-1236; OWASP ASVS 5.0, 1.2.10), also in the wide forms of CJK fonts,
# where a cell begins: at the start, or after the separator of another locale.
_FORMULA = re.compile(r"(^|[;\t\n])([^\S\t\n]*)(?=([=+\-@\uff1d\uff0b\uff0d\uff20][^;\t\n]*))")
_NUMBER = re.compile(r"[+-]?(?:(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?|inf|nan)\s*", re.ASCII | re.I)
TEXT_MARK = "'"
"""Written before a text that a spreadsheet would read as a formula."""


def csv_text(rows: Iterable[Sequence[Any]]) -> str:
    """Return rows as the text of a CSV file."""
    text = StringIO()
    write_rows(text, rows)
    return text.getvalue()


def write_rows(opened: IO[str], rows: Iterable[Sequence[Any]]) -> None:
    """Write rows as CSV: commas, a line feed after each, None as an empty cell.

    Numbers are written as they are; a text that would be a formula gets TEXT_MARK before it.
    """
    writer = csv.writer(opened, lineterminator="\n")
    writer.writerows([_cell(value) for value in row] for row in rows)


def _cell(value: Any) -> Any:
    return plain_text(value) if isinstance(value, str) else value


def plain_text(text: str) -> str:
    """Return the text with TEXT_MARK before what a spreadsheet would read as a formula.

    Its lines end with a line feed: Python 3.11 writes a lone carriage return without quotes.
    """

    def marked(place: re.Match[str]) -> str:
        is_number = _NUMBER.fullmatch(place[3]) is not None
        return place[0] if is_number else f"{place[1]}{place[2]}{TEXT_MARK}"

    return _FORMULA.sub(marked, text.replace("\r\n", "\n").replace("\r", "\n"))
