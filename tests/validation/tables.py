"""Measured curves written as a table, which ``sbafab.validation`` reads."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sbafab.spreadsheet import csv_text
from sbafab.validation.evidence import COLUMNS, OF_CURVE, OF_ERROR, OF_SETUP, MeasuredCurve


def evidence_csv(curves: Sequence[MeasuredCurve]) -> str:
    """Return curves as the text of a table that ``read_csv`` reads; changed keys of a design and a
    relative error have no column and are left out.
    """
    rows: list[Sequence[Any]] = [COLUMNS]
    for curve in curves:
        cells = {key: getattr(curve, key) for key in OF_CURVE}
        cells |= {key: getattr(curve.setup, key) for key in OF_SETUP}
        cells |= {column: getattr(curve.error, key) for column, key in OF_ERROR.items()}
        cells |= {"comparable": "yes" if curve.comparable else "no"}
        cells |= {"unknown": " | ".join(curve.unknown)}
        errors = curve.error.absolute or (None,) * len(curve.y)
        none = (None,) * len(curve.y)
        names = curve.actuators if len(curve.actuators) == len(curve.y) else none
        for x, y, error, name in zip(curve.x or errors, curve.y, errors, names, strict=True):
            values = {"curve": curve.id, "x": x if curve.x else None, "y": y, "error": error}
            values["actuator"] = curve.actuators[0] if len(curve.actuators) == 1 else name
            rows.append([{**cells, **values}[key] for key in COLUMNS])
            cells = dict.fromkeys(COLUMNS)
    return csv_text(rows)
