"""Rows of the paper's figures beside ours, and how they are written."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from sbafab.actuators import load_design
from sbafab.models import paper
from sbafab.models.figures import Asked, Factors, Prediction
from sbafab.models.prediction import predict

NONE = "none"
"""The model of what none predicts."""


class Row(NamedTuple):
    """A figure of the paper; ``predicted`` None where no model knows it."""

    what: str
    measured: paper.Measured
    predicted: float | None
    model: str
    why: str


def exact(value: float, unit: str, where: str) -> paper.Measured:
    return paper.Measured(value, 0.0, unit, where)


def table(title: str, rows: Sequence[Row]) -> Iterator[str]:
    yield f"## {title}\n"
    yield "| figure | paper | | predicted | residual | model | why they part |"
    yield "|---|---|---|---|---|---|---|"
    for row in rows:
        measured = str(row.measured) if row.measured.unit else ""
        yield (
            f"| {row.what} | {measured} | {row.measured.where} | {_predicted(row)} | "
            f"{_residual(row)} | {row.model} | {row.why} |"
        )
    yield ""


def _predicted(row: Row) -> str:
    return "not" if row.predicted is None else f"{row.predicted:.4g} {row.measured.unit}"


def _residual(row: Row) -> str:
    if row.predicted is None:
        return ""
    apart = row.predicted - row.measured.value
    share = f"{apart:+.3g}, {apart / row.measured.value:+.1%}"
    errors = f" ({abs(apart) / row.measured.error:.1f} errors)" if row.measured.error else ""
    return f"{share}{errors}"


def predicted(
    template: str, factors: Factors | None = None, pressures: tuple[float, ...] = (10.0, 100.0)
) -> Prediction:
    """What is predicted of a template."""
    return predict(load_design(template), Asked(pressures, calibration=factors or Factors()))
