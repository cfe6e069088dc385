"""Figures that were measured once: docs/measured/NAME.json holds them, the pages show them.

A page names a table between ``<!-- measured: NAME TABLE -->`` and ``<!-- end -->``, and ``how`` in
place of a table says when and with what it was measured; a sentence of ``rates`` or a summary of
``tables`` stands in a page likewise. ``python -m docs.scripts.measured`` writes all of them; scripts
that measure do so themselves. A test compares pages and records.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple

from docs.scripts.rates import WORDS
from docs.scripts.tables import SUMMARIES, Table

DOCS = Path(__file__).parents[1]
README = DOCS.parent / "README.md"
FOLDER = DOCS / "measured"
BLOCK = re.compile(r"(<!-- measured: (\w+) ([\w-]+) -->)(?:(?!<!--).)*(<!-- end -->)", re.DOTALL)
SPLIT = re.compile(r",\s*\n\s*")
HOW = "how"


class Record(NamedTuple):
    """What one command measured: the day, the programs' versions, and its tables by name."""

    command: str
    day: str
    versions: Mapping[str, str]
    tables: Mapping[str, Table]

    @property
    def how(self) -> str:
        """The line that says where the figures come from."""
        told = ", ".join(f"{name} {version}" for name, version in self.versions.items())
        used = f" with {told}" if told else ""
        return f"*Measured on {self.day}{used}: `{self.command}`.*"


def record(name: str) -> Record:
    """The record of that name."""
    data = json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8"))
    tables = {key: Table(**table) for key, table in data.pop("tables").items()}
    return Record(**data, tables=tables)


def keep(name: str, measured: Record) -> None:
    """Writes a record, and the tables of all pages."""
    tables = {key: table._asdict() for key, table in measured.tables.items()}
    FOLDER.mkdir(exist_ok=True)
    text = json.dumps({**measured._asdict(), "tables": tables}, indent=1, ensure_ascii=False)
    # A row a line.
    text = re.sub(r"\[\s+([^][{}]*?)\s+\]", lambda m: f"[{SPLIT.sub(', ', m[1])}]", text)
    (FOLDER / f"{name}.json").write_text(text + "\n", encoding="utf-8", newline="\n")
    for page in pages():
        page.write_text(filled(page.read_text(encoding="utf-8")), encoding="utf-8", newline="\n")


def pages() -> Iterator[Path]:
    """The pages that show a record."""
    for page in (README, *sorted(DOCS.glob("*.md"))):
        if BLOCK.search(page.read_text(encoding="utf-8")):
            yield page


def filled(text: str) -> str:
    """A page's text with every block as the records have it."""
    return BLOCK.sub(lambda m: f"{m[1]}\n{_said(m[2], m[3])}\n{m[4]}", text)


def _said(name: str, table: str) -> str:
    if (name, table) in SUMMARIES:
        return f"\n{SUMMARIES[name, table]().markdown}\n"
    found = record(name)
    if table == HOW:
        text = found.how
    elif name == "benchmarks" and table in WORDS:
        text = WORDS[table](found)
    else:
        text = found.tables[table].markdown
    # Blank lines part a table from the remarks round it, as Markdown asks.
    return f"\n{text}\n"


def versions(**distributions: str) -> dict[str, str]:
    """Versions of installed distributions, by the names that the page gives them."""
    return {name: metadata.version(dist) for name, dist in distributions.items()}


def texts(rows: Sequence[Sequence[Any]]) -> list[list[str]]:
    """Cells as texts."""
    return [[str(cell) for cell in row] for row in rows]


def main() -> None:
    for page in pages():
        page.write_text(filled(page.read_text(encoding="utf-8")), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
