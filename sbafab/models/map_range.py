"""Where a balloon's map holds: within 3 % of balloons computed beside those it was made from.

Lengths mm, pressures kPa.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from sbafab.models.balloon_map import LEAST_HEIGHT, LOW_PRESSURE
from sbafab.models.rippled import compressed_shapes

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from sbafab.models.balloon_map import BalloonMap
    from sbafab.models.film_elements import Array

MOST_ERROR = 0.03
"""Share by which a map may miss."""
FLAT = 1e-3
"""Height in mm that stands for 0."""
PRESSURE_CHECKS, HEIGHT_CHECKS = 37, 25
"""Balloons computed by pressure and by height."""


@dataclass(frozen=True, eq=False)
class MapRange:
    """Cells of a map between ``pressures`` (n) and ``heights`` (m), and which of them hold:
    ``within`` (n - 1, m - 1), true where the map does at all four corners.
    """

    pressures: Array
    heights: Array
    within: NDArray[np.bool_]

    def holds(self, pressure: ArrayLike, height: ArrayLike) -> NDArray[np.bool_]:
        """Return whether the map holds at pressures and heights inside it."""
        cells = []
        for ends, places in ((self.pressures, pressure), (self.heights, height)):
            cell = np.searchsorted(ends, places, side="right") - 1
            cells.append(np.clip(cell, 0, len(ends) - 2))
        return np.asarray(self.within[cells[0], cells[1]])


def scaled_range(made: BalloonMap) -> MapRange:
    """Return where a map holds, by the map that it was stiffened from: heights are equal at equal
    pressure over modulus.
    """
    base = made.base or made
    covered = map_range(base)
    ratio = made.scale_pressure / base.scale_pressure
    return MapRange(ratio * covered.pressures, covered.heights, covered.within)


@lru_cache(maxsize=64)
def map_range(made: BalloonMap) -> MapRange:
    """Return where a map is within MOST_ERROR of balloons between plates, as far as checked.

    Forces are compared as shares of pressure (and 0.1 kPa) times pocket, and the force; volumes as
    shares of the volume and of what a pocket holds at the least height computed.
    """
    even = np.linspace(0, 1, PRESSURE_CHECKS)
    scale = made.scale_pressure
    pressures = scale * np.sinh(even * math.asinh(made.most_pressure / scale))
    pressures[-1] = made.most_pressure
    even = np.linspace(0, 1, HEIGHT_CHECKS)
    heights = made.most_height * (even + even**2) / 2
    grids = np.meshgrid(pressures, np.maximum(heights, FLAT), indexing="ij")
    p, h = (grid.ravel() for grid in grids)
    exact = compressed_shapes(made.balloon, p, h, tied=True)
    area = math.pi * made.balloon.pocket**2
    push = area * (p + LOW_PRESSURE) + np.abs(exact.force)
    room = exact.volume + area * LEAST_HEIGHT
    near = np.abs(made.force(p, h) - exact.force) <= MOST_ERROR * push
    near &= np.abs(made.volume(p, h) - exact.volume) <= MOST_ERROR * room
    corners = near.reshape(grids[0].shape)
    rows = corners[:-1] & corners[1:]
    return MapRange(pressures, heights, rows[:, :-1] & rows[:, 1:])
