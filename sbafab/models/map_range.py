"""Valid range of a balloon's map: within 3 % of balloons computed between its support points.

Lengths mm, pressures kPa.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sbafab.models.balloon import distinct
from sbafab.models.balloon_map import LEAST_HEIGHT, LOW_PRESSURE, BalloonMap
from sbafab.models.film_elements import Array
from sbafab.models.rippled import compressed_shapes

MOST_ERROR, CELL_ERROR = 0.03, 0.02
"""Allowed relative error of a map, and the stricter limit where a cell is checked, since errors
between these places may be larger: free heights jump where another wave begins.
"""
FLAT = 1e-3
"""Height in mm that represents 0."""
PRESSURE_CHECKS, HEIGHT_CHECKS = 37, 25
"""Balloons computed by pressure and by height."""
PLACE_DIGITS = 6
"""Decimals to which places in kPa and mm are distinguished."""


@dataclass(frozen=True, eq=False)
class MapRange:
    """Cells of a map between ``pressures`` (n) and ``heights`` (m), and which of them hold:
    ``within`` (n - 1, m - 1), true where the map does at all four corners and in the middle.
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


@lru_cache(maxsize=64)
def map_range(made: BalloonMap) -> MapRange:
    """Return where a map is within CELL_ERROR of balloons between plates, as far as checked, by the
    map that it was stiffened from: heights are equal at equal pressure over modulus.
    """
    base, ratio = _base(made)
    pressures, heights = _grid(base, 0.0)
    corners = _is_near(base, pressures, heights)
    rows = corners[:-1] & corners[1:]
    middles = _is_near(base, *(places[:-1] for places in _grid(base, 0.5)))
    within = rows[:, :-1] & rows[:, 1:] & middles
    return MapRange(ratio * pressures, heights, within)


def _base(made: BalloonMap) -> tuple[BalloonMap, float]:
    """Return the map that one was stiffened from, and the ratio of their moduli."""
    base = made.base or made
    return base, made.scale_pressure / base.scale_pressure


def _grid(made: BalloonMap, offset: float) -> tuple[Array, Array]:
    """Return the pressures and the heights of the checks, ``offset`` cells further."""
    x = (np.arange(PRESSURE_CHECKS) + offset) / (PRESSURE_CHECKS - 1)
    scale = made.scale_pressure
    pressures = scale * np.sinh(x * math.asinh(made.most_pressure / scale))
    y = (np.arange(HEIGHT_CHECKS) + offset) / (HEIGHT_CHECKS - 1)
    return np.minimum(pressures, made.most_pressure), made.most_height * (y + y**2) / 2


def _is_near(made: BalloonMap, pressures: Array, heights: Array) -> NDArray[np.bool_]:
    """Return where a map is within CELL_ERROR: (pressures, heights)."""
    grids = np.meshgrid(pressures, np.maximum(heights, FLAT), indexing="ij")
    p, h = (grid.ravel() for grid in grids)
    return (relative_errors(made, p, h) <= CELL_ERROR).reshape(grids[0].shape)


def relative_errors(made: BalloonMap, pressure: Array, height: Array) -> Array:
    """Return the larger relative error of a map in force and volume, against balloons between
    plates computed at its places (n,), heights above 0. Raises DesignError if one has no
    equilibrium.

    Forces are compared as shares of pressure (and 0.1 kPa) times pocket, and the force; volumes as
    shares of the volume and of what a pocket holds at the least height computed.
    """
    exact = compressed_shapes(made.balloon, pressure, height, tied=True)
    area = math.pi * made.balloon.pocket**2
    push = area * (pressure + LOW_PRESSURE) + np.abs(exact.force)
    room = exact.volume + area * LEAST_HEIGHT
    force = np.abs(made.force(pressure, height) - exact.force) / push
    return np.maximum(force, np.abs(made.volume(pressure, height) - exact.volume) / room)


def holds_at(made: BalloonMap, pressure: Array, height: Array) -> NDArray[np.bool_]:
    """Return where a map is within MOST_ERROR of the balloons computed at places (n,); not where
    one lies outside the map.

    Suction counts as no pressure, and heights below FLAT as FLAT. The balloons belong to the map
    that this one was stiffened from. Raises DesignError if one has no equilibrium.
    """
    base, ratio = _base(made)
    places = np.stack([np.maximum(pressure / ratio, 0.0), np.maximum(height, FLAT)], -1)
    unique, back = distinct(places.round(PLACE_DIGITS))
    p, h = np.minimum(unique[:, 0], base.most_pressure), unique[:, 1]
    holds, inside = np.zeros(len(h), bool), h <= base.most_height
    if inside.any():
        holds[inside] = relative_errors(base, p[inside], h[inside]) <= MOST_ERROR
    return holds[back]
