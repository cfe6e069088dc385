"""The reproduction as files: page, table for programs, charts."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from sbafab.errors import OutputError
from sbafab.output.printed import REPRODUCTION_SCHEMA
from sbafab.reproduction.page import charts, page_of, tables
from sbafab.reproduction.records import Row, predicted


def reproduce(folder: Path) -> dict[str, list[Row]]:
    """All rows, as ``reproduction.md`` and ``reproduction.json`` with charts in a folder.

    Raises OutputError where the folder cannot be written.
    """
    from sbafab.reports.relation_svg import relation_svg

    one, three = predicted("1dof-5mm"), predicted("3dof-15mm")
    found = tables(one, three)
    files = {
        "reproduction.md": page_of(found, one, three),
        "reproduction.json": json.dumps(as_json(found), indent=1) + "\n",
    }
    for name, relation in charts(one, three):
        files[f"{name}.svg"] = relation_svg(name, relation)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for file, text in files.items():
            (folder / file).write_text(text, encoding="utf-8", newline="\n")
    except OSError as error:
        raise OutputError(f"{folder} cannot be written: {error.strerror}") from None
    return found


def as_json(found: dict[str, list[Row]]) -> dict[str, Any]:
    """What ``reproduction.json`` holds."""
    return {
        "schema": REPRODUCTION_SCHEMA,
        "rows": [
            {
                "section": section,
                "figure": row.what,
                "unit": row.measured.unit,
                "where": row.measured.where,
                "paper": row.measured.value if row.measured.unit else None,
                "error": row.measured.error or None,
                "predicted": None if row.predicted is None else float(f"{row.predicted:.7g}"),
                "model": row.model,
                "why": row.why,
            }
            for section, rows in found.items()
            for row in rows
        ],
    }
