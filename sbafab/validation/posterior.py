"""Posterior of the unknowns and of the models' discrepancy, sampled by emcee.

Logarithms of the models' values are interpolated linearly in modulus ratio (its logarithm), pocket
loss and press factor.

The logarithm of a measured value is the logarithm of the model's value, plus a discrepancy, plus
the error of the measurement. Discrepancies are normal with one standard deviation for each group of
quantities; half of their variance is shared by the points of a curve. If a source leaves the set-up
open, all candidate set-ups are equally likely.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from sbafab.errors import DesignError
from sbafab.models.calibration import GROUPS, UNKNOWNS
from sbafab.models.film_elements import Array

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


MIDDLES, LEAST, MOST = (
    np.array([unknown.coordinate(getattr(unknown, name)) for unknown in UNKNOWNS])
    for name in ("middle", "least", "most")
)
SPREADS = np.array([unknown.spread for unknown in UNKNOWNS])
"""Means, bounds and standard deviations of the unknowns' coordinates by the priors."""
NODES = (11, 6, 6)
"""Nodes of a curve's table by modulus ratio, pocket loss and press factor."""
NODE_COORDINATES = [np.linspace(*ends) for ends in zip(LEAST, MOST, NODES, strict=False)]
"""The nodes' coordinates by each design unknown, evenly spaced."""


def interpolated(table: Array, coordinates: Array) -> Array:
    """Return values linear between the nodes of a table (*NODES, ...) at coordinates (n, unknowns):
    (n, ...).
    """
    row = np.zeros((1, len(coordinates)), dtype=np.int_)
    weight = np.ones((1, len(coordinates)))
    for axis, nodes in enumerate(NODE_COORDINATES):
        place = (coordinates[:, axis] - nodes[0]) / (nodes[1] - nodes[0])
        place = np.clip(place, 0.0, len(nodes) - 1.0)
        first = np.minimum(place.astype(np.int_), len(nodes) - 2)
        share = place - first
        row = np.concatenate([row * len(nodes) + first, row * len(nodes) + first + 1])
        weight = np.concatenate([weight * (1 - share), weight * share])
    flat = table.reshape(math.prod(NODES), -1)
    values = (weight[..., None] * flat[row]).sum(0)
    return np.asarray(values.reshape(len(coordinates), *table.shape[len(NODES) :]))


class SampledCurve(NamedTuple):
    """A curve for the posterior: the ``test`` that it comes from, the number of its quantity's
    ``group`` in GROUPS, a ``table`` of logarithms of the models' values (*NODES, open set-ups,
    points), logarithms of the ``measured`` values and their standard ``errors``, (points,), and the
    column in UNKNOWNS of the unknown that its values have as a ``term`` (-1: none).
    """

    test: str
    group: int
    table: Array
    measured: Array
    errors: Array
    term: int

    def logarithms(self, samples: Array) -> Array:
        """Return logarithms of the models' values (n, open set-ups, points), with the term in them,
        such as the delay of pump or valve.
        """
        values = interpolated(self.table, samples)
        if self.term < 0:
            return values
        return np.asarray(np.log(np.exp(values) + np.exp(samples[:, self.term])[:, None, None]))

    def densities(self, samples: Array, log_scales: Array) -> Array:
        """Return the log density of the measured values by set-up (n, set-ups), with standard
        deviations of the discrepancies (logarithms, n).

        A normal whose covariance is the discrepancy's plus the measurement's: a diagonal and one
        shared part, whose inverse and determinant have closed forms (Sherman and Morrison).
        """
        residuals = self.measured - self.logarithms(samples)
        squares = np.exp(2 * log_scales)[:, None]
        each = (1 - SHARED) * squares + self.errors**2
        weighted = residuals / each[:, None]
        shared = SHARED * squares
        growth = 1 + shared * (1 / each).sum(-1, keepdims=True)
        quadratic = (weighted * residuals).sum(-1) - shared / growth * weighted.sum(-1) ** 2
        halves = (np.log(each).sum(-1) + np.log(growth[:, 0])) / 2
        return np.asarray(-0.5 * quadratic - halves[:, None])


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
    logs = curve.densities(posterior.samples, posterior.scales[:, curve.group])
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
    places, scales = np.split(coordinates, [len(UNKNOWNS)], axis=-1)
    total = -0.5 * (((scales - math.log(SCALE_MIDDLE)) / SCALE_SPREAD) ** 2).sum(-1)
    # One after the other: another order of rounding leads the chains elsewhere.
    for square in (((places - MIDDLES) / SPREADS) ** 2).T:
        total = total - 0.5 * square
    is_inside = ((places >= LEAST) & (places <= MOST)).all(-1)
    return np.where(is_inside, total, -np.inf)


def log_likelihood(curves: Sequence[SampledCurve], coordinates: Array) -> Array:
    """Return the log likelihood at coordinates (n, unknowns + groups): (n,). Open
    set-ups are averaged.
    """
    total = np.zeros(len(coordinates))
    for curve in curves:
        logs = curve.densities(coordinates, coordinates[:, len(UNKNOWNS) + curve.group])
        most = logs.max(-1)
        total += most + np.log(np.exp(logs - most[:, None]).mean(-1))
    return total


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
            total[inside] = prior[inside] + log_likelihood(curves, coordinates[inside])
        return total

    generator = np.random.RandomState(seed)
    start = _start(generator)
    sampler = emcee.EnsembleSampler(WALKERS, start.shape[1], log_posterior, vectorize=True)
    sampler.random_state = generator.get_state()
    sampler.run_mcmc(start, steps)
    chain = sampler.get_chain(discard=min(BURN_IN, steps // 2), thin=THINNING, flat=True)
    return Posterior(chain[:, : len(UNKNOWNS)], chain[:, len(UNKNOWNS) :])


def _start(generator: np.random.RandomState) -> Array:
    """Return places within the prior to start from: (walkers, unknowns + groups)."""
    drawn = MIDDLES[:, None] + 0.5 * SPREADS[:, None] * generator.randn(len(UNKNOWNS), WALKERS)
    margin = 1e-3 * (MOST - LEAST)
    places = np.clip(drawn.T, LEAST + margin, MOST - margin)
    scales = math.log(SCALE_MIDDLE) + 0.5 * SCALE_SPREAD * generator.randn(WALKERS, len(GROUPS))
    return np.concatenate([places, scales], -1)
