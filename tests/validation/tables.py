"""Measured curves written as a table, which ``sbafab.validation`` reads."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sbafab.spreadsheet import csv_text
from sbafab.validation.files import COLUMNS, NUMBERS
from sbafab.validation.records import MeasuredCurve


def evidence_csv(curves: Sequence[MeasuredCurve]) -> str:
    """Return curves as the text of a table that ``read_csv`` reads; changed keys of a design and a
    relative error have no column and are left out.
    """
    rows: list[Sequence[Any]] = [COLUMNS]
    for curve in curves:
        cells = _cells_to_write(curve)
        errors = curve.error.absolute or (None,) * len(curve.y)
        for x, y, error in zip(curve.x or (None,) * len(curve.y), curve.y, errors, strict=True):
            rows.append([{**cells, "x": x, "y": y, "error": error}[key] for key in COLUMNS])
            cells = dict.fromkeys(COLUMNS) | {"curve": curve.id}
    return csv_text(rows)


def _cells_to_write(curve: MeasuredCurve) -> dict[str, Any]:
    setup, error = curve.setup, curve.error
    texts = ("supply", "fluid", "chambers", "tip", "note")
    return {
        "curve": curve.id,
        "quantity": curve.quantity,
        "design": curve.actuator.design,
        "x_name": curve.x_name,
        "place": curve.place,
        "group": curve.group,
        "kind": error.kind,
        "runs": error.runs,
        "error_source": error.source,
        **{key: getattr(setup, key) for key in (*texts, *NUMBERS)},
        "comparable": "yes" if curve.comparable else "no",
        "reason": curve.reason,
        "unknown": " | ".join(curve.unknown),
    }
