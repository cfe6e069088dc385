"""``docs/measured/faults.csv``: what the checks find of every fault, and the cells read back."""

from __future__ import annotations

from collections.abc import Mapping

from docs.scripts.tables import FOLDER, Table, from_csv
from tests.faults.catalogue import FAULTS, KINDS, TEMPLATES

PAGE = FOLDER / "faults.csv"
Cells = Mapping[tuple[str, str], str]
"""By fault and template."""
COLUMNS = ("section", "note", "fault", "rule", *TEMPLATES)


def text(cells: Cells) -> str:
    """Return the file for what was found."""
    rows = [
        [kind.title, kind.note, fault.name, f"`{fault.rule}`"]
        + [cells[fault.name, template] for template in TEMPLATES]
        for kind in KINDS
        for fault in kind.faults
    ]
    return Table(COLUMNS, rows).csv


def cells_of(page: str) -> Cells:
    """Return the cells that the file holds."""
    names = {fault.name for fault in FAULTS}
    return {
        (row[2], template): cell
        for row in from_csv(page).rows
        if row[2] in names
        for template, cell in zip(TEMPLATES, row[4:], strict=True)
    }
