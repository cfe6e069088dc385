"""Measured curves compared with the models, point by point with 90 % intervals."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import starmap
from statistics import NormalDist
from typing import Any

from sbafab.documents import Document, Short, attribute
from sbafab.errors import DesignError
from sbafab.models.calibration import (
    SHARE,
    Ends,
    ModelCalibration,
    Uncertainty,
    bonding_products,
    deviations,
)
from sbafab.models.figures import Factors
from sbafab.validation.evidence import Evidence, MeasuredCurve
from sbafab.validation.fit import MIDDLES, relative_errors, term_of
from sbafab.validation.model_values import ModelledActuator, ModelValue, model_values

ShortEnds = tuple[Short, Short] | None


class ComparedPoint(Document):
    """A measured value and the models' range over the set-ups that its source leaves open."""

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
    within: bool | None

    @classmethod
    def at(
        cls,
        x: float | None,
        measured: float,
        error: float | None,
        model: Ends | None = None,
        interval: Ends | None = None,
    ) -> ComparedPoint:
        """Return a point; without a model or an interval there is no comparison."""
        return cls(
            x=x,
            measured=measured,
            error=error,
            model=model,
            deviation=model and (model[0] - measured, model[1] - measured),
            interval=interval,
            within=interval and interval[0] <= measured <= interval[1],
        )

    def texts(self, unit: str) -> tuple[str, str, str, str, str]:
        """Return as text the measured value with its error, the model's range, the relative
        deviation, the interval, and whether it contains the value.
        """
        shares = self.deviation and tuple(end / self.measured for end in self.deviation)
        return (
            f"{self.measured:g}{f' +- {self.error:.2g}' if self.error else ''} {unit}".rstrip(),
            (self.model and f"{_span(self.model, '.4g')} {unit}".rstrip()) or "-",
            _span(shares, "+.0%") if self.measured else _span(self.deviation, "+.4g"),
            _span(self.interval, ".3g"),
            {True: "yes", False: "no", None: "-"}[self.within],
        )


def _span(ends: tuple[float, ...] | None, form: str) -> str:
    """Return a range as text, or one number if its ends print alike; "" for None."""
    return " to ".join(dict.fromkeys(format(end, form) for end in ends or ()))


class ComparedCurve(Document):
    """A measured curve with its points.

    ``assumptions`` are the assumptions behind the model's range; ``no_model`` explains a missing
    model.
    """

    source: str
    curve: str = attribute("id")
    quantity: str
    unit: str = attribute("y_unit")
    place: str
    x_name: str
    comparable: bool
    reason: str
    unknown: list[str]
    model: str
    assumptions: list[str]
    no_model: str
    points: list[ComparedPoint] = attribute("compared")


def compare(evidence: Evidence, calibration: ModelCalibration | None = None) -> list[ComparedCurve]:
    """Return the curves of a source compared with the models, with a calibration also with the
    calibrated models and their 90 % intervals, which span the set-ups that the source leaves open.
    """
    return [
        ComparedCurve.read(curve, source=evidence.id, **_beside_models(curve, calibration))
        for curve in evidence.curves
    ]


def _beside_models(curve: MeasuredCurve, calibration: ModelCalibration | None) -> dict[str, Any]:
    uncertainty = calibration and uncertainty_for(curve, calibration)
    points = list(curve.points())
    try:
        answer = model_values(curve, uncertainty.factors if uncertainty else None)
    except DesignError as error:
        plain = list(starmap(ComparedPoint.at, points))
        return {"compared": plain, "model": "", "assumptions": [], "no_model": str(error)}
    intervals = (uncertainty and curve_intervals(curve, uncertainty)) or [None] * len(points)
    compared = [
        ComparedPoint.at(*point, model, interval)
        for point, model, interval in zip(points, answer.ranges(), intervals, strict=True)
    ]
    assumed = [*filter(None, answer.series)]
    return {"compared": compared, "model": answer.model, "assumptions": assumed, "no_model": ""}


def uncertainty_for(curve: MeasuredCurve, calibration: ModelCalibration) -> Uncertainty:
    """Return a calibration adapted to the measured actuator."""
    tip_load = None if curve.setup.tip == "probed" else 0.0
    if not curve.is_described:
        return Uncertainty(calibration, tip_load=tip_load)
    of = ModelledActuator(curve, Factors(**MIDDLES))
    try:
        films, form, laminate = bonding_products(of.laminate), of.design.form, of.laminate
    except DesignError:
        return Uncertainty(calibration, tip_load=tip_load)
    return Uncertainty(calibration.for_films(films), laminate, form, tip_load)


def curve_intervals(curve: MeasuredCurve, uncertainty: Uncertainty) -> list[Ends | None] | None:
    """Return the interval of the measured value at each point of a curve, in its unit.

    It is that of the mixture over the set-ups that the source leaves open, each with its
    probability from the calibration's fit (equal ones for a curve that was not fitted), and
    includes the calibration's uncertainty, the models' discrepancy and the measurement error.
    Returns None if the calibration does not cover the quantity. A point's interval is None if a
    set-up reaches the point with the median factors, but not with factors one standard deviation
    away; set-ups with a probability under LEAST_SHARE do not count.
    """
    group = curve.discrepancy_group
    if not group:
        return None
    series: dict[Factors, Mapping[str, tuple[ModelValue, ...]]] = {}
    for factors in (uncertainty.factors, *uncertainty.moved):
        try:
            series[factors] = model_values(curve, factors).series
        except DesignError:
            series[factors] = {}
    median = series[uncertainty.factors]
    if not median:
        return None
    shares = uncertainty.calibration.set_ups.get(curve.id, {})
    likely = [name for name in median if shares.get(name, 1.0) >= LEAST_SHARE]
    unreached = (None,) * len(curve.y)
    intervals: list[Ends | None] = []
    for point, error in enumerate(relative_errors(curve).tolist()):
        parts: list[tuple[float, float, Ends]] = []
        for phrase in (name for name in likely if median[name][point] is not None):
            answered = {of: values.get(phrase, unreached)[point] for of, values in series.items()}
            reached = {of: value for of, value in answered.items() if value is not None}
            if len(reached) < len(answered):
                parts = []
                break
            value, ends = uncertainty.interval_of(group, reached.__getitem__, term=term_of(curve))
            parts.append((shares.get(phrase, 1.0), value, widened(value, ends, error)))
        intervals.append(mixture_interval(parts) if parts else None)
    return intervals


LEAST_SHARE = 0.01
"""Probability below which an open set-up does not count."""


def mixture_interval(parts: Sequence[tuple[float, float, Ends]]) -> Ends:
    """Return the 90 % interval of a mixture of distributions, each given by its weight, median and
    90 % interval; they are normal in the logarithm if all ends are positive, else in the value.
    """
    is_log = min(low for _, _, (low, _) in parts) > 0
    into, back = (math.log, math.exp) if is_log else (float, float)
    total = sum(weight for weight, _, _ in parts)
    normals = [
        (weight / total, into(low), (into(high) - into(low)) / (2 * deviations(SHARE)))
        for weight, _, (low, high) in parts
    ]
    quantiles = []
    for share in ((1 - SHARE) / 2, (1 + SHARE) / 2):
        low = min(into(ends[0]) for _, _, ends in parts)
        high = max(into(ends[1]) for _, _, ends in parts)
        for _ in range(60):
            middle = (low + high) / 2
            below = sum(
                weight * NormalDist(start + deviations(SHARE) * spread, spread).cdf(middle)
                for weight, start, spread in normals
            )
            low, high = (middle, high) if below < share else (low, middle)
        quantiles.append(back((low + high) / 2))
    return quantiles[0], quantiles[1]


def widened(value: float, ends: Ends, error: float) -> Ends:
    """Return an interval combined with an independent relative standard error."""
    low, high = ends
    half = deviations(SHARE) * error
    if low > 0:
        span = math.hypot(math.log(high / value), half)
        return value * math.exp(-span), value * math.exp(span)
    span = math.hypot(high - value, half * abs(value))
    return value - span, value + span


# The documents.


class SourceDocument(Document):
    """A source of evidence, and the parts of it that are missing."""

    id: str
    citation: str
    doi: str
    missing: list[str]


class ComparisonDocument(Document, schema="sbafab/comparison@1"):
    """Curves of sources compared with the models."""

    calibration: str
    """name of the models' calibration, or none"""
    sources: list[SourceDocument]
    curves: list[ComparedCurve]
