"""Intervals of 95 % for what a few measurements say, by closed formulas."""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import mean, stdev
from typing import NamedTuple

from sbafab.cutting.calibration import Value, student_t

DOUBT = 0.05


class Most(NamedTuple):
    """The largest of some errors, and the most that it leaves room for (95 %).

    An error is never larger than its tolerance, so the tolerance lies between both.
    """

    errors: int
    largest: float
    highest: float


def mean_of(values: Sequence[float]) -> Value | None:
    """The mean with Student's interval; None for fewer than two values."""
    if len(values) < 2:
        return None
    uncertainty = stdev(values) / math.sqrt(len(values))
    return Value(mean(values), uncertainty, student_t(len(values) - 1) * uncertainty)


def most_of(errors: Sequence[float], dimensions: int) -> Most:
    """The bound of errors that are spread evenly within it, as registration-yield assumes.

    On a line (1 dimension) the largest of n stays below m with (m / bound) ** n, over a disc (2)
    with (m / bound) ** 2n; the highest bound is the one under which that is 5 %.
    """
    largest = max(errors)
    return Most(len(errors), largest, largest / DOUBT ** (1 / (dimensions * len(errors))))
