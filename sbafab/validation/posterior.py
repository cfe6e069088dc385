"""Posterior of the unknowns and of the models' discrepancy, sampled by emcee.

The logarithm of a measured value is the logarithm of the model's value, plus a discrepancy, plus
the error of the measurement. Discrepancies are normal with one standard deviation for each group of
quantities; half of their variance is shared by the points of a curve. If a source leaves the set-up
open, all candidate set-ups are equally likely.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from sbafab.errors import DesignError
from sbafab.models.calibrated import GROUPS
from sbafab.models.film_elements import Array
from sbafab.models.unknowns import UNKNOWNS
from sbafab.validation.surface import ValueSurface, interpolated

SHARED = 0.5
"""Share of the discrepancy's variance that the points of a curve have in common."""
SCALE_MIDDLE, SCALE_SPREAD = 0.15, 0.7
"""Prior of a group's discrepancy: median of the standard deviation, and standard deviation of its
logarithm. Such models are off by 10 to 20 %."""
LEAST_ERROR = 0.01
"""Least relative error of a measurement, for sources that state none or a scatter of repetitions
on one actuator."""
WALKERS, STEPS, BURN_IN, THINNING = 40, 2000, 800, 20
SEED = 20220085


class SampledCurve(NamedTuple):
    """A curve for the posterior: its surface, logarithms of the measured values and their
    standard errors, (points,), the test that it comes from, the number of its quantity's group in
    GROUPS, and the column in UNKNOWNS of the unknown that its values have as a term (-1: none).
    """

    id: str
    test: str
    group: int
    surface: ValueSurface
    measured: Array
    errors: Array
    term: int

    def logarithms(self, samples: Array) -> Array:
        """Return logarithms of the models' values (n, open set-ups, points)."""
        return self.with_term(self.surface.at(samples), samples)

    def with_term(self, values: Array, samples: Array) -> Array:
        """Return logarithms with the term in them, such as the delay of pump or valve."""
        if self.term < 0:
            return values
        terms = np.exp(samples[:, self.term])[:, None, None]
        return np.asarray(np.log(np.exp(values) + terms))


@dataclass(frozen=True)
class Posterior:
    """Samples of the unknowns' coordinates (n, unknowns), and logarithms of the discrepancies'
    standard deviations (n, groups).
    """

    samples: Array
    scales: Array

    @cached_property
    def mean(self) -> Array:
        """Mean coordinates (unknowns,)."""
        return np.asarray(self.samples.mean(0))

    @cached_property
    def covariance(self) -> Array:
        """Covariance of the coordinates (unknowns, unknowns)."""
        return np.asarray(np.cov(self.samples.T))

    @cached_property
    def discrepancy(self) -> dict[str, float]:
        """Standard deviation of the discrepancy by group: the root of its mean square."""
        squares = np.exp(2 * self.scales).mean(0)
        return dict(zip(GROUPS, np.sqrt(squares).tolist(), strict=True))

    def predicted(self, curve: SampledCurve, generator: np.random.Generator) -> Array:
        """Return drawn logarithms of measured values of a curve (n, points)."""
        values = curve.logarithms(self.samples)
        count, setups, points = values.shape
        chosen = values[np.arange(count), generator.integers(setups, size=count)]
        missed = discrepancies(np.exp(self.scales[:, curve.group]), points, generator)
        return np.asarray(chosen + missed + curve.errors * generator.standard_normal(missed.shape))


def set_up_probabilities(curve: SampledCurve, posterior: Posterior) -> Array:
    """Return the probability of each set-up that a curve's source leaves open, by the fit to it:
    (set-ups,).
    """
    residuals = curve.measured - curve.logarithms(posterior.samples)
    logs = _set_up_densities(residuals, curve.errors, posterior.scales[:, curve.group])
    weights = np.exp(logs - logs.max(-1, keepdims=True))
    return np.asarray((weights / weights.sum(-1, keepdims=True)).mean(0))


def discrepancies(scales: Array, points: int, generator: np.random.Generator) -> Array:
    """Return drawn discrepancies of curves with ``scales`` (n,): (n, points)."""
    count = len(scales)
    common = generator.standard_normal((count, 1)) * math.sqrt(SHARED)
    each = generator.standard_normal((count, points)) * math.sqrt(1 - SHARED)
    return np.asarray(scales[:, None] * (common + each))


def log_prior(coordinates: Array) -> Array:
    """Return the log prior at coordinates (n, unknowns + groups), up to a constant."""
    scales = coordinates[:, len(UNKNOWNS) :]
    total = -0.5 * (((scales - math.log(SCALE_MIDDLE)) / SCALE_SPREAD) ** 2).sum(-1)
    for column, unknown in enumerate(UNKNOWNS):
        place = coordinates[:, column]
        middle = unknown.coordinate(unknown.middle)
        total = total - 0.5 * ((place - middle) / unknown.spread) ** 2
        low = unknown.coordinate(unknown.least)
        high = unknown.coordinate(unknown.most)
        total = np.where((place < low) | (place > high), -np.inf, total)
    return np.asarray(total)


class Likelihood:
    """The likelihood of curves, their surfaces joined in one table."""

    def __init__(self, curves: Sequence[SampledCurve]) -> None:
        self.curves = curves
        tables = [curve.surface.table for curve in curves]
        self.shapes = [table.shape[-2:] for table in tables]
        self.flat = np.concatenate(
            [
                table.reshape(-1, math.prod(shape))
                for table, shape in zip(tables, self.shapes, strict=True)
            ],
            axis=1,
        )

    def __call__(self, coordinates: Array) -> Array:
        """Return the log likelihood at coordinates (n, unknowns + groups): (n,)."""
        values = interpolated(self.flat, coordinates)
        scales = coordinates[:, len(UNKNOWNS) :]
        total, start = np.zeros(len(coordinates)), 0
        for curve, shape in zip(self.curves, self.shapes, strict=True):
            end = start + math.prod(shape)
            block = values[:, start:end].reshape(-1, *shape)
            residuals = curve.measured - curve.with_term(block, coordinates)
            total = total + _curve_likelihood(residuals, curve.errors, scales[:, curve.group])
            start = end
        return total


def _curve_likelihood(residuals: Array, errors: Array, log_scales: Array) -> Array:
    """Return the log density of residuals (n, set-ups, points), set-ups averaged."""
    logs = _set_up_densities(residuals, errors, log_scales)
    most = logs.max(-1)
    return np.asarray(most + np.log(np.exp(logs - most[:, None]).mean(-1)))


def _set_up_densities(residuals: Array, errors: Array, log_scales: Array) -> Array:
    """Return the log density of residuals (n, set-ups, points) by set-up (n, set-ups).

    A normal whose covariance is the discrepancy's plus the measurement's: a diagonal and one shared
    part, whose inverse and determinant have closed forms (Sherman and Morrison).
    """
    squares = np.exp(2 * log_scales)[:, None]
    each = (1 - SHARED) * squares + errors**2
    weighted = residuals / each[:, None]
    shared = SHARED * squares
    growth = 1 + shared * (1 / each).sum(-1, keepdims=True)
    quadratic = (weighted * residuals).sum(-1) - shared / growth * weighted.sum(-1) ** 2
    halves = (np.log(each).sum(-1) + np.log(growth[:, 0])) / 2
    return np.asarray(-0.5 * quadratic - halves[:, None])


def sampled(curves: Sequence[SampledCurve], seed: int = SEED, steps: int = STEPS) -> Posterior:
    """Return the posterior of curves. Raises DesignError without emcee."""
    try:
        import emcee  # Optional: only calibration needs a sampler.
    except ImportError:
        raise DesignError(
            'a calibration needs emcee, which is not installed; pip install "sbafab[calibrate]"'
        ) from None

    def log_posterior(coordinates: Array) -> Array:
        prior = log_prior(coordinates)
        inside = np.isfinite(prior)
        total = np.full(len(prior), -np.inf)
        if inside.any():
            total[inside] = prior[inside] + likelihood(coordinates[inside])
        return total

    likelihood = Likelihood(curves)
    generator = np.random.RandomState(seed)
    start = _start(generator)
    sampler = emcee.EnsembleSampler(WALKERS, start.shape[1], log_posterior, vectorize=True)
    sampler.random_state = generator.get_state()
    sampler.run_mcmc(start, steps)
    chain = sampler.get_chain(discard=min(BURN_IN, steps // 2), thin=THINNING, flat=True)
    return Posterior(chain[:, : len(UNKNOWNS)], chain[:, len(UNKNOWNS) :])


def _start(generator: np.random.RandomState) -> Array:
    """Return places within the prior to start from: (walkers, unknowns + groups)."""
    columns = []
    for unknown in UNKNOWNS:
        low, high = unknown.coordinate(unknown.least), unknown.coordinate(unknown.most)
        drawn = unknown.coordinate(unknown.middle) + 0.5 * unknown.spread * generator.randn(WALKERS)
        columns.append(np.clip(drawn, low + 1e-3 * (high - low), high - 1e-3 * (high - low)))
    scales = math.log(SCALE_MIDDLE) + 0.5 * SCALE_SPREAD * generator.randn(WALKERS, len(GROUPS))
    return np.concatenate([np.stack(columns, -1), scales], -1)


def correlations(covariance: Array, least: float) -> list[Mapping[str, object]]:
    """Return pairs of unknowns whose correlation is at least ``least`` either way."""
    deviations = np.sqrt(np.diag(covariance))
    table = covariance / np.outer(deviations, deviations)
    return [
        {"first": UNKNOWNS[i].title, "second": UNKNOWNS[j].title, "correlation": float(table[i, j])}
        for i in range(len(UNKNOWNS))
        for j in range(i + 1, len(UNKNOWNS))
        if abs(table[i, j]) >= least
    ]
