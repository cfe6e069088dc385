"""Synthetic labs: curves whose truth is drawn from the priors, on surfaces that are linear in the
unknowns' coordinates.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sbafab.models.calibration import GROUPS, UNKNOWNS
from sbafab.validation.posterior import (
    LEAST,
    LOSS,
    MOST,
    NODE_COORDINATES,
    PRESSING_MIDDLE,
    PRESSING_SPREAD,
    SCALE_MIDDLE,
    SCALE_SPREAD,
    SampledCurve,
    discrepancies,
    sampled,
)

Array = NDArray[np.float64]
ERROR = 0.02
CURVES, ACTUATORS = 10, 4


class SyntheticLab(NamedTuple):
    """The true coordinates of the unknowns, the pocket losses of the actuators in mm, and the
    curves that were measured.
    """

    truth: Array
    losses: dict[str, Array]
    curves: list[SampledCurve]


def surface(rates: Array) -> Array:
    """A table whose logarithms grow by ``rates`` (3, set-ups, points) by coordinate."""
    grid = np.stack(np.meshgrid(*NODE_COORDINATES[:3], indexing="ij"), -1)
    return np.asarray(np.tensordot(grid, rates, axes=([-1], [0])))


def lab(number: int) -> SyntheticLab:
    """The lab of a number: unknowns, pressing, discrepancies and errors as the priors have them."""
    generator = np.random.default_rng(number)
    truth = np.array([_drawn(unknown, generator) for unknown in UNKNOWNS])
    spread = PRESSING_MIDDLE * math.exp(PRESSING_SPREAD * generator.standard_normal())
    losses = {str(count): _loss(truth[LOSS], spread, generator) for count in range(ACTUATORS)}
    scales = SCALE_MIDDLE * np.exp(SCALE_SPREAD * generator.standard_normal(len(GROUPS)))
    curves = []
    for count in range(CURVES):
        points = int(generator.integers(1, 4))
        group = int(generator.integers(len(GROUPS)))
        actuator = str(generator.integers(ACTUATORS))
        rates = generator.normal(0.0, [[[0.8]], [[2.0]], [[0.8]]], (3, 1, points))
        plain = SampledCurve(
            str(count), (actuator,) * points, group, (0, 1, 2), surface(rates), np.zeros(points),
            np.full(points, ERROR),
        )  # fmt: skip
        values = plain.logarithms(truth[None], losses)[0, 0]
        missed = discrepancies(scales[group : group + 1], points, generator)[0]
        noise = ERROR * generator.standard_normal(points)
        curves.append(plain._replace(measured=values + missed + noise))
    return SyntheticLab(truth, losses, curves)


def _loss(mean: float, spread: float, generator: np.random.Generator) -> Array:
    while True:
        drawn = generator.normal(mean, spread)
        if LEAST[LOSS] < drawn < MOST[LOSS]:
            return np.array([drawn])


def _drawn(unknown, generator: np.random.Generator) -> float:  # type: ignore[no-untyped-def]
    low, high = unknown.coordinate(unknown.least), unknown.coordinate(unknown.most)
    while True:
        drawn = generator.normal(unknown.coordinate(unknown.middle), unknown.spread)
        if low < drawn < high:
            return float(drawn)


def held_out_inside(number: int, steps: int = 1200) -> list[bool]:
    """Whether each point of a lab's last curve lies in its 90 % interval by a fit to the others."""
    drawn = lab(number)
    *fitted, held = drawn.curves
    posterior = sampled(fitted, number, steps)
    predicted = posterior.predicted(held, np.random.default_rng(number))
    low, high = np.quantile(predicted, (0.05, 0.95), axis=0)
    return [bool(a <= y <= b) for a, y, b in zip(low, held.measured, high, strict=True)]


def share_and_error(inside: list[list[bool]]) -> tuple[float, float]:
    """The share of points inside, and its standard error by labs."""
    points = sum(map(len, inside))
    share = sum(map(sum, inside)) / points
    spread = sum((sum(row) - share * len(row)) ** 2 for row in inside)
    return share, math.sqrt(spread) / points
