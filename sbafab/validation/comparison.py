"""Measured curves beside the models, point by point with 90 % intervals, and as a table."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from sbafab.documents import Document, Short, attribute
from sbafab.errors import DesignError
from sbafab.models.calibration import SHARE, Ends, ModelCalibration, Uncertainty, deviations
from sbafab.models.figures import Factors
from sbafab.validation.evidence import Evidence, MeasuredCurve
from sbafab.validation.fit import GROUP_OF, MIDDLES, relative_errors, term_of
from sbafab.validation.model_values import ModelledActuator, ModelValues, NoModel, model_values

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


def compare(evidence: Evidence, calibration: ModelCalibration | None = None) -> list[ComparedCurve]:
    """Return the curves of a source beside the models, with a calibration beside the calibrated
    ones and their 90 % intervals, which span the set-ups that the source leaves open.
    """
    return [_compared(evidence.id, curve, calibration) for curve in evidence.curves]


def _compared(
    source: str, curve: MeasuredCurve, calibration: ModelCalibration | None
) -> ComparedCurve:
    uncertainty = None if calibration is None else uncertainty_for(curve, calibration)
    answer = model_values(curve, uncertainty.factors if uncertainty else None)
    if isinstance(answer, NoModel):
        points = tuple(ComparedPoint(*point, None, None) for point in curve.points())
        return ComparedCurve(source, curve, points, "", (), answer.reason)
    intervals = curve_intervals(curve, uncertainty) if uncertainty else None
    points = tuple(
        ComparedPoint(*point, model, interval)
        for point, model, interval in zip(
            curve.points(), answer.ranges(), intervals or [None] * len(curve.y), strict=True
        )
    )
    return ComparedCurve(source, curve, points, answer.model, (*filter(None, answer.series),), "")


def uncertainty_for(curve: MeasuredCurve, calibration: ModelCalibration) -> Uncertainty:
    """Return a calibration as it holds for the actuator that was measured."""
    if not curve.is_described:
        return Uncertainty(calibration)
    of = ModelledActuator(curve, Factors(**MIDDLES))
    try:
        film, form, laminate = of.design.films.tpe.product, of.design.form, of.laminate
    except DesignError:
        return Uncertainty(calibration)
    return Uncertainty(calibration.for_film(film), {}, laminate, form)


def curve_intervals(curve: MeasuredCurve, uncertainty: Uncertainty) -> list[Ends | None] | None:
    """Return the interval of the measured value at each point of a curve, in its unit.

    The interval spans every assumption on the set-up that the source leaves open. It includes the
    calibration's uncertainty, the models' discrepancy and the error of the measurement. Returns
    None if the calibration does not cover the quantity. A point's interval is None if an
    assumption reaches the point with the median factors, but not with factors one standard
    deviation away.
    """
    group = GROUP_OF.get(curve.quantity)
    median = None if group is None else model_values(curve, uncertainty.factors)
    if group is None or not isinstance(median, ModelValues):
        return None
    series = {uncertainty.factors: median.series}
    for change, factors in uncertainty.shifted():
        moved = model_values(curve, factors) if change else median
        series[factors] = moved.series if isinstance(moved, ModelValues) else {}
    unreached = (None,) * len(curve.y)
    intervals: list[Ends | None] = []
    for point, error in enumerate(relative_errors(curve).tolist()):
        ends: list[Ends] = []
        for phrase in (name for name, values in median.series.items() if values[point] is not None):
            answered = {of: values.get(phrase, unreached)[point] for of, values in series.items()}
            reached = {of: value for of, value in answered.items() if value is not None}
            if len(reached) < len(answered):
                ends = []
                break
            wide = uncertainty.interval_of(group, reached.__getitem__, term=term_of(curve))
            ends.append(widened(*wide, error))
        intervals.append((min(a for a, _ in ends), max(b for _, b in ends)) if ends else None)
    return intervals


def widened(value: float, ends: Ends, error: float) -> Ends:
    """Return an interval with a relative standard error added to it as an independent one."""
    low, high = ends
    half = deviations(SHARE) * error
    if low > 0:
        span = math.hypot(math.log(high / value), half)
        return value * math.exp(-span), value * math.exp(span)
    span = math.hypot(high - value, half * abs(value))
    return value - span, value + span


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
                "" if point.x is None else f"{point.x:g} {curve.x_unit}".rstrip(),
                measured_text(point),
                span(point.model) or "-",
                _deviation(point),
                {None: "-", True: "yes", False: "no"}[point.is_within],
            ).rstrip()
        yield from _remarks(compared)


def measured_text(point: ComparedPoint) -> str:
    """Return a measured value with its standard error."""
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
    notes = []
    if compared.reason:
        notes.append(f"{compared.reason[:1].upper()}{compared.reason[1:]}.")
    if compared.assumptions:
        notes.append(f"Not stated, so assumed: {'; '.join(compared.assumptions)}.")
    if not compared.curve.comparable:
        notes.append(f"Not comparable: {compared.curve.reason}")
    indent = " " * 4
    for note in notes:
        yield from textwrap.wrap(note, WIDTH, initial_indent=indent, subsequent_indent=indent)


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
