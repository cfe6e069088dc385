"""The tables that an earlier sweep left in the folder: whose they are, and what they held."""

from __future__ import annotations

import csv
from pathlib import Path

from sbafab.errors import OutputError
from sbafab.search.table import HEAD, Table


def refuse_foreign(path: Path) -> None:
    """Raises OutputError where a table stands that no sweep has written."""
    if not path.exists():
        return
    with path.open(newline="", encoding="utf-8", errors="replace") as opened:
        first = opened.readline(200)
    if not first.startswith(",".join(HEAD)):
        raise OutputError(
            f"{path} is the table of no sweep; move it away, or choose another folder with -o"
        )


def no_longer_asked(path: Path, table: Table) -> int:
    """How many designs of the CSV file at the path are none of the table's."""
    if not path.exists():
        return 0
    now = {row.get("sha256", "") for row in table.rows()}
    with path.open(newline="", encoding="utf-8") as opened:
        before = {row.get("sha256", "") for row in csv.DictReader(opened)}
    return len(before - now - {""})
