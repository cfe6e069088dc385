"""Posterior of the unknowns and of the models' discrepancy, sampled by emcee.

The logarithm of a measured value is the logarithm of the model's value, plus a discrepancy, plus
the error of the measurement. Discrepancies are normal with one standard deviation for each group of
quantities; half of their variance is shared by the points of a curve. If a source leaves the set-up
open, all candidate set-ups are equally likely.

Pockets differ between pressings: the pocket loss of an actuator is normal about the lab's mean,
with its own spread.

Logarithms of the models' values are interpolated linearly in the coordinates of the unknowns.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from sbafab.errors import DesignError
from sbafab.models.calibration import FIELDS, GROUPS, SHARED, UNKNOWNS
from sbafab.models.film_elements import Array

SCALE_MIDDLE, SCALE_SPREAD = 0.15, 0.7
"""Prior of a group's discrepancy: median of the standard deviation, and standard deviation of its
logarithm. Such models are off by 10 to 20 %."""
PRESSING_MIDDLE, PRESSING_SPREAD = 0.07, 0.7
"""Prior of the standard deviation in mm of pocket losses by one lab's pressing: its median, and the
standard deviation of its logarithm. Assumed: molten film creeps by some tenths of a mm."""
LEAST_ERROR = 0.01
"""Least relative error of a measurement, for sources that state none or a scatter of repetitions
on one actuator."""
WALKERS, STEPS, BURN_IN, THINNING = 64, 3000, 1000, 20
LONG = 16_000
"""Steps of a fit that is kept: fits of two seeds then agree within 3 %."""
SEED = 20220085
LOSS = FIELDS.index("pocket_loss")

MIDDLES, LEAST, MOST = (
    np.array([unknown.coordinate(getattr(unknown, name)) for unknown in UNKNOWNS])
    for name in ("middle", "least", "most")
)
SPREADS = np.array([unknown.spread for unknown in UNKNOWNS])
"""Means, bounds and standard deviations of the unknowns' coordinates by the priors."""
NODES = (11, 6, 6, 6)
"""Nodes of a curve's table by modulus ratio, pocket loss, press factor and tip load."""
NODE_COORDINATES = [np.linspace(*ends) for ends in zip(LEAST, MOST, NODES, strict=False)]
"""The nodes' coordinates by each of these unknowns, evenly spaced."""


def interpolated(table: Array, axes: Sequence[int], coordinates: Array) -> Array:
    """Return values interpolated linearly between the nodes of a table (nodes of each of ``axes``,
    ...), columns of UNKNOWNS, at coordinates (n, unknowns): (n, ...).
    """
    row = np.zeros((1, len(coordinates)), dtype=np.int_)
    weight = np.ones((1, len(coordinates)))
    for axis in axes:
        nodes = NODE_COORDINATES[axis]
        place = (coordinates[:, axis] - nodes[0]) / (nodes[1] - nodes[0])
        place = np.clip(place, 0.0, len(nodes) - 1.0)
        first = np.minimum(place.astype(np.int_), len(nodes) - 2)
        share = place - first
        row = np.concatenate([row * len(nodes) + first, row * len(nodes) + first + 1])
        weight = np.concatenate([weight * (1 - share), weight * share])
    values = table.shape[len(axes) :]
    flat = table.reshape(-1, math.prod(values))
    return np.asarray((weight[..., None] * flat[row]).sum(0).reshape(len(coordinates), *values))


class SampledCurve(NamedTuple):
    """A curve for the posterior. It has its ``test``, the ``actuators`` of its points, the number
    of its quantity's ``group`` in GROUPS, a ``table`` of logarithms of the models' values (nodes of
    each of ``axes``, open set-ups, points) by the columns ``axes`` of UNKNOWNS, logarithms of the
    ``measured`` values and their standard ``errors``, (points,), and the column in UNKNOWNS of the
    unknown that is a ``term`` of its values (-1: none).
    """

    test: str
    actuators: tuple[str, ...]
    group: int
    axes: tuple[int, ...]
    table: Array
    measured: Array
    errors: Array
    term: int = -1

    def logarithms(self, unknowns: Array, losses: Mapping[str, Array]) -> Array:
        """Return logarithms of the models' values (n, open set-ups, points) at ``unknowns`` (n,
        unknowns) with the pocket losses (n,) of the actuators. The curve's term, such as the delay
        of a pump or valve, is included.
        """
        values = np.empty((len(unknowns), *self.table.shape[len(self.axes) :]))
        for actuator in dict.fromkeys(self.actuators):
            places = unknowns.copy()
            places[:, LOSS] = losses[actuator]
            points = np.array([each == actuator for each in self.actuators])
            values[..., points] = interpolated(self.table, self.axes, places)[..., points]
        if self.term < 0:
            return values
        return np.asarray(np.log(np.exp(values) + np.exp(unknowns[:, self.term])[:, None, None]))

    def densities(self, values: Array, log_scales: Array) -> Array:
        """Return the log density of the measured values by set-up (n, set-ups) for logarithms of
        the models' values (n, set-ups, points), with standard deviations of the discrepancies
        (logarithms, n).

        It is normal with the covariance of discrepancy plus measurement: a diagonal and one shared
        part, whose inverse and determinant have closed forms (Sherman and Morrison).
        """
        residuals = self.measured - values
        squares = np.exp(2 * log_scales)[:, None]
        each = (1 - SHARED) * squares + self.errors**2
        weighted = residuals / each[:, None]
        shared = SHARED * squares
        growth = 1 + shared * (1 / each).sum(-1, keepdims=True)
        quadratic = (weighted * residuals).sum(-1) - shared / growth * weighted.sum(-1) ** 2
        halves = (np.log(2 * np.pi * each).sum(-1) + np.log(growth[:, 0])) / 2
        return np.asarray(-0.5 * quadratic - halves[:, None])


@dataclass(frozen=True)
class Posterior:
    """Samples of the posterior. ``unknowns`` (n, unknowns) are coordinates whose pocket loss is the
    lab's mean; ``spread`` (n,) of losses is in mm; ``losses`` (n,) are those of the fitted
    actuators; ``scales`` (n, groups) are logarithms of the discrepancies' standard deviations;
    ``departure`` (n,) is the deviation of an unmeasured actuator's loss, in spreads.
    """

    unknowns: Array
    spread: Array
    losses: Mapping[str, Array]
    scales: Array
    departure: Array

    @classmethod
    def of(cls, chain: Array, actuators: Sequence[str], departure: Array) -> Posterior:
        """Return the samples of a chain (n, unknowns + 1 + actuators + groups)."""
        ends = np.cumsum([len(UNKNOWNS), 1, len(actuators)])
        unknowns, spread, departures, scales = np.split(chain, ends, axis=-1)
        spread = np.exp(spread[:, 0])
        own = unknowns[:, LOSS, None] + spread[:, None] * departures
        losses = dict(zip(actuators, own.T, strict=True))
        return cls(unknowns, spread, losses, scales, departure)

    @cached_property
    def new_loss(self) -> Array:
        """Pocket losses (n,) of an unmeasured actuator, mm."""
        drawn = self.unknowns[:, LOSS] + self.spread * self.departure
        return np.asarray(np.clip(drawn, LEAST[LOSS], MOST[LOSS]))

    @cached_property
    def coordinates(self) -> Array:
        """Coordinates (n, unknowns) of an unmeasured actuator."""
        places = self.unknowns.copy()
        places[:, LOSS] = self.new_loss
        return places

    @cached_property
    def mean(self) -> Array:
        """Mean coordinates (unknowns,) of an unmeasured actuator."""
        return np.asarray(self.coordinates.mean(0))

    @cached_property
    def covariance(self) -> Array:
        """Covariance of the coordinates (unknowns, unknowns) of an unmeasured actuator."""
        return np.asarray(np.cov(self.coordinates.T))

    @cached_property
    def discrepancy(self) -> dict[str, float]:
        """Standard deviation of the discrepancy by group: the root of its mean square."""
        squares = np.exp(2 * self.scales).mean(0)
        return dict(zip(GROUPS, np.sqrt(squares).tolist(), strict=True))

    def logarithms(self, curve: SampledCurve) -> Array:
        """Return logarithms of the models' values of a curve (n, set-ups, points); its actuators
        are new, with one sampled loss, if they are not in the fit.
        """
        new = dict.fromkeys(curve.actuators, self.new_loss)
        return curve.logarithms(self.unknowns, {**new, **self.losses})

    def predicted(self, curve: SampledCurve, generator: np.random.Generator) -> Array:
        """Return sampled logarithms of the measured values of a curve (n, points)."""
        values = self.logarithms(curve)
        count, setups, points = values.shape
        chosen = values[np.arange(count), generator.integers(setups, size=count)]
        missed = discrepancies(np.exp(self.scales[:, curve.group]), points, generator)
        return np.asarray(chosen + missed + curve.errors * generator.standard_normal(missed.shape))

    def log_score(self, curve: SampledCurve) -> float:
        """Return the log score of a curve's measured values: the logarithm of their density under
        the fit, in units of the logarithms of the values.
        """
        logs = curve.densities(self.logarithms(curve), self.scales[:, curve.group])
        most = float(logs.max())
        return most + math.log(float(np.exp(logs - most).mean()))


def set_up_probabilities(curve: SampledCurve, posterior: Posterior) -> Array:
    """Return the probability of each set-up that a curve's source leaves open, from the fit:
    (set-ups,).
    """
    logs = curve.densities(posterior.logarithms(curve), posterior.scales[:, curve.group])
    weights = np.exp(logs - logs.max(-1, keepdims=True))
    return np.asarray((weights / weights.sum(-1, keepdims=True)).mean(0))


def discrepancies(scales: Array, points: int, generator: np.random.Generator) -> Array:
    """Return sampled discrepancies of curves with ``scales`` (n,): (n, points)."""
    count = len(scales)
    common = generator.standard_normal((count, 1)) * math.sqrt(SHARED)
    each = generator.standard_normal((count, points)) * math.sqrt(1 - SHARED)
    return np.asarray(scales[:, None] * (common + each))


def log_prior(chain: Array, actuators: Sequence[str]) -> Array:
    """Return the log prior of a chain's samples (n, unknowns + 1 + actuators + groups), up to a
    constant.
    """
    ends = np.cumsum([len(UNKNOWNS), 1, len(actuators)])
    places, spread, departures, scales = np.split(chain, ends, axis=-1)
    total = -0.5 * (((places - MIDDLES) / SPREADS) ** 2).sum(-1)
    total -= 0.5 * (((spread - math.log(PRESSING_MIDDLE)) / PRESSING_SPREAD) ** 2).sum(-1)
    total -= 0.5 * (departures**2).sum(-1)
    total -= 0.5 * (((scales - math.log(SCALE_MIDDLE)) / SCALE_SPREAD) ** 2).sum(-1)
    own = places[:, LOSS, None] + np.exp(spread) * departures
    is_inside = ((places >= LEAST) & (places <= MOST)).all(-1)
    is_inside &= ((own >= LEAST[LOSS]) & (own <= MOST[LOSS])).all(-1)
    return np.where(is_inside, total, -np.inf)


def log_likelihood(curves: Sequence[SampledCurve], samples: Posterior) -> Array:
    """Return the log likelihood of samples (n,). Open set-ups are averaged."""
    total = np.zeros(len(samples.unknowns))
    for curve in curves:
        logs = curve.densities(samples.logarithms(curve), samples.scales[:, curve.group])
        most = logs.max(-1)
        total += most + np.log(np.exp(logs - most[:, None]).mean(-1))
    return total


def installed_emcee() -> Any:
    """Return the module emcee. Raises DesignError without it."""
    try:
        import emcee  # Optional: only calibration needs a sampler.
    except ImportError:
        raise DesignError(
            'a calibration needs emcee, which is not installed; pip install "sbafab[calibrate]"'
        ) from None
    return emcee


def sampled(curves: Sequence[SampledCurve], seed: int = SEED, steps: int = STEPS) -> Posterior:
    """Return the posterior of curves. Raises DesignError without emcee."""
    emcee = installed_emcee()
    actuators = list(dict.fromkeys(name for curve in curves for name in curve.actuators))

    def log_posterior(chain: Array) -> Array:
        total = log_prior(chain, actuators)
        inside = np.isfinite(total)
        if inside.any():
            none = np.zeros(int(inside.sum()))
            total[inside] += log_likelihood(curves, Posterior.of(chain[inside], actuators, none))
        return total

    generator = np.random.RandomState(seed)
    start = _start(generator, len(actuators))
    sampler = emcee.EnsembleSampler(WALKERS, start.shape[1], log_posterior, vectorize=True)
    sampler.random_state = generator.get_state()
    sampler.run_mcmc(start, steps)
    burn_in = max(min(BURN_IN, steps // 2), steps // 3)
    chain = sampler.get_chain(discard=burn_in, thin=THINNING, flat=True)
    return Posterior.of(chain, actuators, generator.standard_normal(len(chain)))


def _start(generator: np.random.RandomState, actuators: int) -> Array:
    """Return initial positions within the prior (walkers, coordinates of a chain)."""
    drawn = MIDDLES[:, None] + 0.5 * SPREADS[:, None] * generator.randn(len(UNKNOWNS), WALKERS)
    margin = 1e-3 * (MOST - LEAST)
    margin[LOSS] = PRESSING_MIDDLE
    places = np.clip(drawn.T, LEAST + margin, MOST - margin)
    spread = math.log(PRESSING_MIDDLE / 2) + 0.2 * generator.randn(WALKERS, 1)
    departures = np.clip(0.5 * generator.randn(WALKERS, actuators), -1.0, 1.0)
    scales = math.log(SCALE_MIDDLE) + 0.5 * SCALE_SPREAD * generator.randn(WALKERS, len(GROUPS))
    return np.concatenate([places, spread, departures, scales], -1)
