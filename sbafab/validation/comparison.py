"""Measured curves beside the models, point by point, as values and as lines of a table."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from sbafab.documents import Document, Short, attribute
from sbafab.models.calibrated import Ends, ModelCalibration
from sbafab.models.figures import Factors
from sbafab.validation.curve_intervals import curve_intervals, uncertainty_for
from sbafab.validation.model_values import NoModel, model_values
from sbafab.validation.records import Evidence, MeasuredCurve

Intervals = Callable[[MeasuredCurve], Sequence[Ends | None] | None]
"""Intervals of a prediction at the points of a curve; None for a point or a curve without any."""
WIDTH = 100


@dataclass(frozen=True)
class ComparedPoint:
    """A measured value beside the models' range over the set-ups that its source leaves open.

    ``error`` is the measured value's standard error. ``model`` is None if no model has a value;
    ``interval`` is the prediction's, None if it has no interval.
    """

    x: float | None
    measured: float
    error: float | None
    model: Ends | None
    interval: Ends | None

    @property
    def deviation(self) -> Ends | None:
        """Least and largest of model minus measured."""
        if self.model is None:
            return None
        return self.model[0] - self.measured, self.model[1] - self.measured

    @property
    def is_within(self) -> bool | None:
        """True if the measured value lies in the interval; None without one."""
        if self.interval is None:
            return None
        return self.interval[0] <= self.measured <= self.interval[1]


@dataclass(frozen=True)
class ComparedCurve:
    """A measured curve with its points.

    ``assumptions`` are the assumptions behind the model's range; ``reason`` explains a missing
    model.
    """

    source: str
    curve: MeasuredCurve
    points: tuple[ComparedPoint, ...]
    model: str
    assumptions: tuple[str, ...]
    reason: str


def compare(
    evidence: Evidence, factors: Factors | None = None, intervals: Intervals | None = None
) -> list[ComparedCurve]:
    """Return the curves of a source beside the models with a calibration's factors."""
    return [_compared(evidence.id, curve, factors, intervals) for curve in evidence.curves]


def compare_calibrated(evidence: Evidence, calibration: ModelCalibration) -> list[ComparedCurve]:
    """Return the curves of a source beside the calibrated models and their 90 % intervals, which
    span the set-ups that the source leaves open.
    """
    compared = []
    for curve in evidence.curves:
        uncertainty = uncertainty_for(curve, calibration)
        compared.append(
            _compared(
                evidence.id,
                curve,
                uncertainty.factors,
                lambda each, of=uncertainty: curve_intervals(each, of),  # type: ignore[misc]
            )
        )
    return compared


def _compared(
    source: str, curve: MeasuredCurve, factors: Factors | None, intervals: Intervals | None
) -> ComparedCurve:
    count = len(curve.y)
    answer = model_values(curve, factors)
    has_model = not isinstance(answer, NoModel)
    ranges = [None] * count if isinstance(answer, NoModel) else answer.ranges()
    of_prediction = intervals(curve) if intervals and has_model else None
    points = [
        ComparedPoint(point.x, point.y, point.error, model, interval)
        for point, model, interval in zip(
            curve.points(), ranges, of_prediction or [None] * count, strict=True
        )
    ]
    if isinstance(answer, NoModel):
        return ComparedCurve(source, curve, tuple(points), "", (), answer.reason)
    return ComparedCurve(
        source, curve, tuple(points), answer.model, tuple(filter(None, answer.series)), ""
    )


# The table.


HEADER = ("curve", "x", "measured", "model", "deviation", "within interval")
COLUMN = "{:<8}{:>12}{:>20}{:>22}{:>18}  {}"


def table_lines(curves: Sequence[ComparedCurve]) -> Iterator[str]:
    """Yield the lines of the table, and below it the notes on its curves."""
    yield COLUMN.format(*HEADER)
    for compared in curves:
        curve = compared.curve
        yield f"{curve.id}: {curve.y_name} [{curve.y_unit or '-'}], {curve.place}"
        for point in compared.points:
            yield COLUMN.format(
                "",
                _axis(compared, point),
                _measured(point),
                span(point.model) or "-",
                _deviation(point),
                {None: "-", True: "yes", False: "no"}[point.is_within],
            ).rstrip()
        yield from _remarks(compared)


def _axis(compared: ComparedCurve, point: ComparedPoint) -> str:
    return "" if point.x is None else f"{point.x:g} {compared.curve.x_unit}".rstrip()


def _measured(point: ComparedPoint) -> str:
    return f"{point.measured:g}" + (f" +- {point.error:.2g}" if point.error else "")


def span(ends: Ends | None, sign: str = "", digits: int = 4) -> str:
    """Return a range as text, or one number if its ends look the same; "" for None."""
    if ends is None:
        return ""
    low, high = (f"{end:{sign}.{digits}g}" for end in ends)
    return low if low == high else f"{low} to {high}"


def _deviation(point: ComparedPoint) -> str:
    if point.deviation is None:
        return "-"
    if point.measured == 0:
        return span(point.deviation, "+")
    low, high = (f"{end / point.measured:+.0%}" for end in point.deviation)
    return low if low == high else f"{low} to {high}"


def _remarks(compared: ComparedCurve) -> Iterator[str]:
    if compared.reason:
        reason = compared.reason
        yield from _wrapped(f"{reason[:1].upper()}{reason[1:]}.")
    if compared.assumptions:
        yield from _wrapped(f"Not stated, so assumed: {'; '.join(compared.assumptions)}.")
    if not compared.curve.comparable:
        yield from _wrapped(f"Not comparable: {compared.curve.reason}")


def _wrapped(text: str) -> list[str]:
    indent = "    "
    return textwrap.wrap(text, WIDTH, initial_indent=indent, subsequent_indent=indent)


ShortEnds = tuple[Short, Short] | None


class PointDocument(Document):
    """A measured value beside the model's."""

    x: float | None
    measured: float
    error: Short | None
    """standard error"""
    model: ShortEnds
    """least and largest over the assumptions"""
    deviation: ShortEnds
    """model minus measured"""
    interval: ShortEnds
    """90 % interval of the measured value"""
    within: bool | None = attribute("is_within")


class CurveDocument(Document):
    """A curve with its points."""

    source: str
    curve: str = attribute("curve.id")
    quantity: str = attribute("curve.quantity")
    unit: str = attribute("curve.y_unit")
    place: str = attribute("curve.place")
    x_name: str = attribute("curve.x_name")
    comparable: bool = attribute("curve.comparable")
    reason: str = attribute("curve.reason")
    unknown: list[str] = attribute("curve.unknown")
    model: str
    assumptions: list[str]
    no_model: str = attribute("reason")
    points: list[PointDocument]


class SourceDocument(Document):
    """A source of evidence, and the parts of it that are missing."""

    id: str
    citation: str
    doi: str
    missing: list[str]


class ComparisonDocument(Document, schema="sbafab/comparison@1"):
    """Curves of sources beside the models."""

    calibration: str
    """name of the models' calibration, or none"""
    sources: list[SourceDocument]
    curves: list[CurveDocument]
