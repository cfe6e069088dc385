"""Writes docs/measured/validation.csv, calibrated.csv, sensitivity.csv and candidates.csv:
python -m docs.scripts.validate
"""

from __future__ import annotations

from docs.scripts import candidates, measured, sensitivity
from docs.scripts.tables import FOLDER, Table, markdown_rows
from sbafab.validation.paper_table import CALIBRATED_COLUMNS, TITLE, PaperTable

PATH = FOLDER / "validation.csv"
COLUMNS = ("section", "figure", "paper", "where", "predicted", "residual", "model", "why")


def validation() -> tuple[Table, Table]:
    """Return every figure of the paper beside its prediction, and the values beside the calibrated
    models, as `sbafab reproduce` writes them.
    """
    rows = list(markdown_rows(PaperTable().page()))
    return (
        Table(COLUMNS, [row for row in rows if row[0] != TITLE and len(row) == len(COLUMNS)]),
        Table(CALIBRATED_COLUMNS, [row[1:] for row in rows if row[0] == TITLE]),
    )


if __name__ == "__main__":
    names = ("validation", "calibrated", "sensitivity", "candidates")
    tables = (*validation(), sensitivity.table(), candidates.table())
    for name, table in zip(names, tables, strict=True):
        path = PATH.with_name(f"{name}.csv")
        path.write_text(table.csv, encoding="utf-8", newline="\n")
    measured.main()
