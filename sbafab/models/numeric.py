"""What the formulas share: arrays in and out, ranges that are said, inverses by bisection."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from sbafab.errors import DesignError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

ROUNDS = 60
ROUNDING = 1e-9
"""Share of a range's end by which a value may lie past it: what arithmetic loses."""


def within(values: ArrayLike, most: float, what: str, unit: str, model: str) -> NDArray[np.float64]:
    """The values as an array, if each lies from 0 to ``most``.

    Raises DesignError with the first that does not and the range; its upper end is rounded down,
    so that it is itself allowed.
    """
    found = np.asarray(values, dtype=float)
    good = (found >= 0) & (found <= most * (1 + ROUNDING))
    if not good.all():
        worst = float(found[~good].flat[0])
        digits = max(0, 3 - math.floor(math.log10(most)))
        shown = math.floor(most * 10**digits) / 10**digits
        raise DesignError(
            f"{what} = {worst:g} {unit} is outside the range of {model}; "
            f"give 0 to {shown:.{digits}f} {unit}"
        )
    return np.asarray(np.minimum(found, most))


def inverse(
    rising: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    wanted: NDArray[np.float64],
    most: float,
) -> NDArray[np.float64]:
    """Where a function that rises from 0 to ``most`` has the wanted values."""
    low = np.zeros_like(wanted)
    high = np.full_like(wanted, most)
    for _ in range(ROUNDS):
        middle = (low + high) / 2
        is_low = rising(middle) < wanted
        low, high = np.where(is_low, middle, low), np.where(is_low, high, middle)
    return np.where(wanted == 0, 0.0, high)
