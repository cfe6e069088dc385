"""The posterior of synthetic labs, whose truth is known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from docs.scripts.measured import FOLDER, record
from sbafab.models.calibration import GROUPS, SHARED, UNKNOWNS
from sbafab.validation.fit import correlated
from sbafab.validation.posterior import (
    LOSS,
    MIDDLES,
    MOST,
    NODE_COORDINATES,
    Posterior,
    SampledCurve,
    discrepancies,
    interpolated,
    log_likelihood,
    log_prior,
    sampled,
    set_up_probabilities,
)
from tests.validation.synthetic import held_out_inside, lab, share_and_error, surface


def curve(rates: np.ndarray, measured: list[float], errors: list[float]) -> SampledCurve:  # type: ignore[type-arg]
    names = ("a",) * len(measured)
    axes = (0, 1, 2)
    return SampledCurve("c", names, 0, axes, surface(rates), np.array(measured), np.array(errors))


def at(scale: float) -> Posterior:
    """One sample in the middle of the priors, with one actuator."""
    places, loss = MIDDLES[None], MIDDLES[LOSS : LOSS + 1]
    scales = np.full((1, len(GROUPS)), math.log(scale))
    return Posterior(places, np.full(1, 0.1), {"a": loss}, scales, np.zeros(1))


def test_a_surface_is_exact_between_its_nodes_where_it_is_linear() -> None:
    rates = np.arange(6.0).reshape(3, 1, 2)
    place = np.array([[nodes[0] * 0.3 + nodes[1] * 0.7 for nodes in NODE_COORDINATES[:3]]])
    values = interpolated(surface(rates), (0, 1, 2), place)
    assert values[0, 0] == pytest.approx(place[0] @ rates[:, 0])


def test_points_have_the_losses_of_their_actuators() -> None:
    """Values that grow by 2 for each mm of loss, of two actuators of 0.1 and 0.3 mm."""
    rates = np.zeros((3, 1, 2))
    rates[LOSS] = 2.0
    both = curve(rates, [0.0, 0.0], [0.1, 0.1])._replace(actuators=("a", "b"))
    losses = {"a": np.array([0.1]), "b": np.array([0.3])}
    assert both.logarithms(MIDDLES[None], losses)[0, 0] == pytest.approx([0.2, 0.6])


def test_a_new_actuator_has_the_spread_of_the_pressing() -> None:
    """Mean 0.3 mm exactly and a spread of 0.05 mm: the variance of a new one's loss is its square;
    an actuator that was fitted has its own.
    """
    count = 20000
    departure = np.random.default_rng(2).standard_normal(count)
    places = np.tile(MIDDLES, (count, 1))
    places[:, LOSS] = 0.3
    own = {"a": np.full(count, 0.25)}
    scales = np.full((count, len(GROUPS)), math.log(0.1))
    posterior = Posterior(places, np.full(count, 0.05), own, scales, departure)
    assert posterior.mean[LOSS] == pytest.approx(0.3, abs=1e-3)
    assert posterior.covariance[LOSS, LOSS] == pytest.approx(0.05**2, rel=0.03)
    rates = np.zeros((3, 1, 1))
    rates[LOSS] = 2.0
    of = curve(rates, [0.0], [0.1])
    assert posterior.logarithms(of) == pytest.approx(0.5)
    new = posterior.logarithms(of._replace(actuators=("b",)))
    assert new.std() == pytest.approx(0.1, rel=0.03)


def test_the_likelihood_is_that_of_a_normal_with_shared_discrepancy() -> None:
    """Two points: the density by hand, from the determinant and the inverse of a 2 x 2 matrix."""
    scale, errors, residuals = 0.2, (0.05, 0.1), (0.3, -0.1)
    rates = np.zeros((3, 1, 2))
    a, d = (scale**2 + error**2 for error in errors)
    b = SHARED * scale**2
    det = a * d - b * b
    x, y = residuals
    square = (d * x * x - 2 * b * x * y + a * y * y) / det
    expected = -0.5 * square - 0.5 * math.log(det) - math.log(2 * math.pi)
    of = curve(rates, list(residuals), list(errors))
    assert log_likelihood([of], at(scale))[0] == pytest.approx(expected)
    assert at(scale).log_score(of) == pytest.approx(expected)


def test_open_set_ups_are_averaged() -> None:
    """One set-up right, the other far off: the density is half of that of the right one alone."""
    one, both = np.zeros((3, 1, 1)), np.zeros((3, 2, 1))
    both[0, 1] = 50.0
    alone = log_likelihood([curve(one, [0.1], [0.1])], at(0.1))
    averaged = log_likelihood([curve(both, [0.1], [0.1])], at(0.1))
    assert averaged[0] == pytest.approx(alone[0] - math.log(2))


def test_drawn_discrepancies_have_their_variance_and_share_half_of_it() -> None:
    drawn = discrepancies(np.full(40000, 0.3), 2, np.random.default_rng(1))
    assert drawn.std(0) == pytest.approx([0.3, 0.3], rel=0.02)
    assert np.corrcoef(drawn.T)[0, 1] == pytest.approx(SHARED, abs=0.02)


def test_no_unknown_leaves_its_bounds() -> None:
    def chain(loss: float, departure: float) -> np.ndarray:  # type: ignore[type-arg]
        places = MIDDLES.copy()
        places[LOSS] = loss
        return np.array([[*places, math.log(0.1), departure, *[math.log(0.1)] * len(GROUPS)]])

    assert np.isfinite(log_prior(chain(0.2, 1.0), ["a"])[0])
    assert log_prior(chain(-0.01, 1.0), ["a"])[0] == -np.inf
    # Nor does the loss of an actuator.
    assert log_prior(chain(MOST[LOSS] - 0.05, 1.0), ["a"])[0] == -np.inf


def test_a_fit_finds_unknowns_that_curves_tell_apart() -> None:
    """Three curves, each the logarithm of one unknown, nearly without error."""
    truth = np.array([UNKNOWNS[0].coordinate(3.0), 0.15, UNKNOWNS[2].coordinate(0.6)])
    curves = []
    for axis in range(3):
        rates = np.zeros((3, 1, 1))
        rates[axis] = 1.0 if axis != 1 else 10.0
        value = float(truth[axis] * rates[axis, 0, 0])
        curves.append(curve(rates, [value], [0.02])._replace(test=str(axis), group=axis))
    posterior = sampled(curves, 3, 1000)
    spreads = np.sqrt(np.diag(posterior.covariance))[:3]
    assert (np.abs(posterior.mean[:3] - truth) < 2 * spreads).all()
    (own,) = posterior.losses.values()
    assert own.mean() == pytest.approx(truth[LOSS], abs=2 * own.std())
    assert own.std() < posterior.new_loss.std()
    assert spreads[0] < 0.6 * UNKNOWNS[0].spread


def test_correlated_unknowns_are_named() -> None:
    covariance = np.eye(len(UNKNOWNS))
    covariance[0, 1] = covariance[1, 0] = -0.8
    assert list(correlated(covariance)) == ["modulus ratio and pocket loss: correlation -0.80"]


def test_the_same_curves_give_the_same_samples() -> None:
    curves = lab(1).curves
    assert (sampled(curves, 1, 60).unknowns == sampled(curves, 1, 60).unknowns).all()


@pytest.mark.long
def test_intervals_of_synthetic_labs_hold_nine_points_in_ten() -> None:
    """Ten labs; ``python -m docs.scripts.synthetic_labs`` takes 300."""
    inside = [held_out_inside(number) for number in range(10)]
    share, error = share_and_error(inside)
    # Where all lie inside, labs do not differ: chance alone has the binomial's error.
    error = max(error, math.sqrt(0.9 * 0.1 / sum(map(len, inside))))
    assert abs(share - 0.9) < 3 * error + 0.02


def test_the_record_of_300_labs_holds_nine_points_in_ten_and_the_page_says_so() -> None:
    *rows, every = record("synthetic_labs").tables["coverage"].rows
    labs = [row[0].split(" to ") for row in rows]
    assert [int(first) for first, _ in labs] == [0, *(int(last) + 1 for _, last in labs[:-1])]
    assert int(labs[-1][1]) == 299
    points, inside = (sum(int(row[column]) for row in rows) for column in (1, 2))
    assert every[1:3] == [str(points), str(inside)]
    share, error = (float(text) for text in every[3].removesuffix(" %").split(" +- "))
    assert share == pytest.approx(100 * inside / points, abs=0.05)
    assert abs(share - 90) < 2
    # Values of one lab are not independent: the error is no less than chance alone would have it.
    assert error >= math.sqrt(share * (100 - share) / points)
    page = " ".join((FOLDER.parent / "prediction.md").read_text(encoding="utf-8").split())
    assert f"In 300 synthetic labs {every[3]} of {points} left-out values lay in" in page


def test_probabilities_of_set_ups_are_their_densities() -> None:
    """Two set-ups, one right and one off by two standard deviations, at unknowns that are known."""
    scale, error = 0.3, 0.4
    both = np.zeros((3, 2, 1))
    open_curve = curve(both, [0.0], [error])
    off = np.array([0.0, 2 * math.hypot(scale, error)])
    open_curve = open_curve._replace(table=open_curve.table + off[:, None])
    right, wrong = set_up_probabilities(open_curve, at(scale))
    assert wrong / right == pytest.approx(math.exp(-2))
    assert right + wrong == pytest.approx(1)
