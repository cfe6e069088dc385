"""Writes docs/measured/validation.csv and sensitivity.csv: python -m docs.scripts.validate"""

from __future__ import annotations

from docs.scripts import measured, sensitivity
from docs.scripts.tables import FOLDER, Table, markdown_rows
from sbafab.reproduction.page import page

PATH = FOLDER / "validation.csv"
COLUMNS = ("section", "figure", "paper", "where", "predicted", "residual", "model", "why")


def validation() -> Table:
    """Return every figure of the paper beside its prediction, as `sbafab reproduce` writes them."""
    return Table(COLUMNS, [row for row in markdown_rows(page()) if len(row) == len(COLUMNS)])


if __name__ == "__main__":
    PATH.write_text(validation().csv, encoding="utf-8", newline="\n")
    text = sensitivity.table().csv
    PATH.with_name("sensitivity.csv").write_text(text, encoding="utf-8", newline="\n")
    measured.main()
