"""Intervals at the points of measured curves, by hand."""

from __future__ import annotations

import math

import pytest

from sbafab.models.calibration import ModelCalibration, Uncertainty, load_calibration
from sbafab.models.figures import Factors
from sbafab.validation.comparison import (
    curve_intervals,
    mixture_interval,
    uncertainty_for,
    widened,
)
from sbafab.validation.evidence import MeasuredCurve, Setup, StatedError
from sbafab.validation.model_values import ModelValues

FILMS, MASKS = 12 * 0.038, 11 * 0.025
"""mm: twelve films of the 1-DoF and eleven masks between them."""
DEVIATIONS = 1.6448536
"""Half width of the middle 90 % of a normal distribution."""


@pytest.fixture(scope="module")
def paper() -> ModelCalibration:
    calibration = load_calibration("paper")
    assert calibration is not None
    return calibration


def curve(quantity: str, setup: Setup | None = None, y: float = 1.0) -> MeasuredCurve:
    return MeasuredCurve(
        id="bench",
        quantity=quantity,
        place="bench",
        y=(y,),
        design="1dof-5mm",
        setup=setup or Setup(),
        error=StatedError(absolute=(0.2 * y,), source="scale"),
    )


def test_a_flat_height_by_hand(paper: ModelCalibration) -> None:
    """What melts is in proportion to the press factor, masks are not: variance of its logarithm,
    miss, what is assumed for 6 balloons in place of 15, and error, summed.
    """
    flat = curve("flat_height_mm", y=0.4)
    intervals = curve_intervals(flat, uncertainty_for(flat, paper))
    assert intervals is not None
    assert intervals[0] is not None
    low, high = intervals[0]
    factor = paper.values["press_factor"]
    height = MASKS + FILMS * factor
    assert math.sqrt(low * high) == pytest.approx(height)
    change, moved = paper.shifted()[2]
    slope = math.log((MASKS + FILMS * moved.press_factor) / height) / change
    assumed = 0.05 * math.log2(15 / 6)
    spread = slope**2 * paper.covariance[2][2] + paper.discrepancy["flat height"] ** 2
    spread += assumed**2 + 0.2**2
    assert math.log(high / low) == pytest.approx(2 * DEVIATIONS * math.sqrt(spread), rel=1e-6)


def test_what_a_source_leaves_open_widens_the_interval(
    paper: ModelCalibration, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two set-ups far from each other, alike likely: from the tenth part of the lower one's
    distribution to nine tenths of the upper one's. With the fit's probabilities, by those.
    """

    def model(_: MeasuredCurve, factors: Factors) -> ModelValues:
        series = {"10 kPa": (factors.modulus_ratio,), "100 kPa": (4000.0,), "300 kPa": (None,)}
        return ModelValues("m", series)

    monkeypatch.setattr("sbafab.validation.comparison.model_values", model)
    of = curve("height_mm", y=7.0)
    intervals = curve_intervals(of, uncertainty_for(of, paper))
    assert intervals is not None
    assert intervals[0] is not None
    missed = paper.discrepancy["motion"] ** 2 + 0.2**2
    least = math.sqrt(paper.covariance[0][0] + missed)
    tenth = 1.2815516
    assert intervals[0] == pytest.approx(
        (
            paper.values["modulus_ratio"] * math.exp(-tenth * least),
            4000 * math.exp(tenth * math.sqrt(missed)),
        ),
        rel=1e-4,
    )
    weighted = paper.model_copy(update={"set_ups": {of.id: {"10 kPa": 0.0, "100 kPa": 1.0}}})
    intervals = curve_intervals(of, uncertainty_for(of, weighted))
    assert intervals is not None
    assert intervals[0] is not None
    assert math.log(intervals[0][1] / intervals[0][0]) == pytest.approx(
        2 * DEVIATIONS * math.sqrt(missed), rel=1e-4
    )


def test_a_mixture_of_one_is_that_one() -> None:
    assert mixture_interval([(0.3, 2.0, (1.0, 4.0))]) == pytest.approx((1.0, 4.0))
    assert mixture_interval([(0.3, 1.0, (-1.0, 3.0))] * 2) == pytest.approx((-1.0, 3.0))


def test_a_time_counts_its_delay(paper: ModelCalibration) -> None:
    """A time of 1 s beside the delay: its logarithm changes by the delay's share."""
    delay = paper.values["water_delay"]
    uncertainty = Uncertainty(paper)
    time, ends = uncertainty.interval_of("time", lambda f: 1 + f.water_delay, term="water_delay")
    assert time == 1 + delay
    spread = (delay / time) ** 2 * paper.covariance[4][4] + paper.discrepancy["time"] ** 2
    assert math.log(ends[1] / time) == pytest.approx(DEVIATIONS * math.sqrt(spread))


def test_a_value_that_vanishes_with_other_factors_may_be_nothing(paper: ModelCalibration) -> None:
    def force(factors: Factors) -> float:
        return 1.0 if factors.modulus_ratio == paper.values["modulus_ratio"] else 1e-4

    value, (low, high) = Uncertainty(paper).interval_of("force", force)
    assert (value, low) == (1.0, 0.0)
    assert 1.5 < high < 4.0


def test_an_error_is_added_as_an_independent_one() -> None:
    low, high = widened(2.0, (1.0, 4.0), 0.5)
    half = math.hypot(math.log(2), DEVIATIONS * 0.5)
    assert (low, high) == pytest.approx((2 * math.exp(-half), 2 * math.exp(half)))
    low, high = widened(1.0, (-1.0, 3.0), 0.5)
    assert (low, high) == pytest.approx((1 - math.hypot(2, 0.5 * DEVIATIONS), 2 - low))


def test_a_quantity_that_no_unknown_changes_has_none(paper: ModelCalibration) -> None:
    mass = curve("mass_g")
    assert curve_intervals(mass, uncertainty_for(mass, paper)) is None
    undescribed = curve("force_n").model_copy(update={"design": ""})
    assert curve_intervals(undescribed, uncertainty_for(undescribed, paper)) is None
