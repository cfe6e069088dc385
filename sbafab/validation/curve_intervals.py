"""The 90 % intervals that a calibration predicts at the points of a measured curve."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache

from sbafab.errors import DesignError
from sbafab.models.calibrated import SHARE, Ends, ModelCalibration, deviations
from sbafab.models.figures import Factors
from sbafab.models.intervals import ActuatorSizes, Uncertainty, for_film
from sbafab.models.unknowns import factors_at
from sbafab.validation.fit import GROUP_OF, MIDDLES, relative_errors, term_of
from sbafab.validation.model_values import ModelledActuator, ModelValue, NoModel, model_values
from sbafab.validation.records import MeasuredCurve

"""Least and largest value."""


def uncertainty_for(curve: MeasuredCurve, calibration: ModelCalibration) -> Uncertainty:
    """Return a calibration as it holds for the actuator that was measured."""
    if not curve.actuator.is_described:
        return Uncertainty(calibration, {})
    of = ModelledActuator(curve.actuator, factors_at(MIDDLES))
    try:
        subject = ActuatorSizes.of(of.design.form, of.laminate, calibration.film)
    except DesignError:
        return Uncertainty(calibration, {})
    return Uncertainty(for_film(calibration, of.design.films.tpe.product), {}, subject)


def curve_intervals(curve: MeasuredCurve, uncertainty: Uncertainty) -> list[Ends | None] | None:
    """Return the interval of the measured value at each point of a curve, in its unit.

    The interval spans every assumption on the set-up that the source leaves open. It includes the
    calibration's uncertainty, the models' discrepancy and the error of the measurement. Returns
    None if the calibration does not cover the quantity. A point's interval is None if an
    assumption reaches the point with the median factors, but not with factors one standard
    deviation away.
    """
    group = GROUP_OF.get(curve.quantity)
    if group is None or isinstance(model_values(curve, uncertainty.factors), NoModel):
        return None

    @cache
    def series_with(factors: Factors) -> Mapping[str, tuple[ModelValue, ...]]:
        answer = model_values(curve, factors)
        return {} if isinstance(answer, NoModel) else answer.series

    term = term_of(curve)
    errors = relative_errors(curve).tolist()

    def interval(phrase: str, point: int) -> Ends:
        def value(factors: Factors) -> float:
            reached = series_with(factors)[phrase][point]
            if reached is None:
                raise UnreachedError
            return reached

        return widened(*uncertainty.interval_of(group, value, term=term), errors[point])

    def union(point: int) -> Ends | None:
        phrases = [
            phrase
            for phrase, values in series_with(uncertainty.factors).items()
            if values[point] is not None
        ]
        try:
            ends = [interval(phrase, point) for phrase in phrases]
        except (UnreachedError, KeyError):
            return None
        return (min(low for low, _ in ends), max(high for _, high in ends)) if ends else None

    return [union(point) for point in range(len(curve.y))]


def widened(value: float, ends: Ends, error: float) -> Ends:
    """Return an interval with a relative standard error added to it as an independent one."""
    low, high = ends
    half = deviations(SHARE) * error
    if low > 0:
        span = math.hypot(math.log(high / value), half)
        return value * math.exp(-span), value * math.exp(span)
    span = math.hypot(high - value, half * abs(value))
    return value - span, value + span


class UnreachedError(Exception):
    """A state that the actuator does not reach with other factors."""
