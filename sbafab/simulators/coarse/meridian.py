"""The inflated shape the scenes start from: the paper's parabola, with a flat neck disc.

The paper's balloon is a parabola revolved whose meridian keeps the length l of the flat pocket's
radius (paper, Eqs. 1-3). Here the parabola begins at the neck disc, which stays flat; with a neck
of radius 0 it is the paper's own. Lengths mm, volumes ul.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

STEEPEST = 40.0
ROUNDS = 80
SPARE = 0.95
"""Share of the largest volume to start from at most: there the edge is not upright yet."""


@dataclass(frozen=True)
class Meridian:
    """One film of a balloon: flat to ``neck``, then down to its edge at ``edge``, 0 high.

    ``length`` is the meridian from neck to edge, ``slope`` what it falls by at the edge.
    """

    neck: float
    length: float
    slope: float

    @property
    def run(self) -> float:
        """Distance from the neck to the edge, seen from above."""
        k = self.slope
        return self.length if k == 0 else 2 * self.length / (math.hypot(1, k) + math.asinh(k) / k)

    @property
    def edge(self) -> float:
        """Radius of the bonded edge, drawn in from the flat pocket's."""
        return self.neck + self.run

    @property
    def height(self) -> float:
        """Height of the neck disc over the edge; a balloon is twice as high."""
        return self.slope * self.run / 2

    @property
    def volume(self) -> float:
        """Of a balloon, both films, if it is round."""
        run, neck = self.run, self.neck
        return 2 * math.pi * self.height * (neck * neck + 4 * neck * run / 3 + run * run / 2)

    def point(self, distance: float) -> tuple[float, float]:
        """Radius and height of the film ``distance`` along the meridian from the neck."""
        if self.slope == 0:
            return self.neck + distance, 0.0
        scale = self.run / (2 * self.slope)
        low, high = 0.0, self.slope
        for _ in range(ROUNDS):
            m = (low + high) / 2
            longer = scale * (m * math.hypot(1, m) + math.asinh(m)) > distance
            low, high = (low, m) if longer else (m, high)
        share = low / self.slope
        return self.neck + share * self.run, self.height * (1 - share * share)


Start = Callable[[float, float], Meridian]
"""What a pocket of a radius with a neck of a radius (mm) starts from."""


def fullest(pocket: float, neck: float) -> Meridian:
    """As much as the paper's parabola can hold, 16.95 ul in a pocket of 5 mm.

    Less where a wide neck leaves too little free film for that.
    """
    most = _holding_most(0.0, pocket).volume
    spare = SPARE * _holding_most(neck, pocket - neck).volume
    return holding(neck, pocket - neck, min(most, spare))


def partly(pocket: float, neck: float) -> Meridian:
    """About half of what 5 kPa holds: 6.4 ul in a pocket of 5 mm."""
    return holding(neck, pocket - neck, 6.4 * (pocket / 2.5) ** 3)


def standing(balloon: float) -> Start:
    """Balloons so many mm high, or as high as their film allows."""

    def start(pocket: float, neck: float) -> Meridian:
        return _bisected(neck, pocket - neck, STEEPEST, lambda m: 2 * m.height < balloon)

    return start


def holding(neck: float, length: float, volume: float) -> Meridian:
    """The shape of this volume, or the one that holds most."""
    most = _holding_most(neck, length).slope
    return _bisected(neck, length, most, lambda m: m.volume < volume)


def _bisected(
    neck: float, length: float, steepest: float, is_low: Callable[[Meridian], bool]
) -> Meridian:
    low, high = 0.0, steepest
    for _ in range(ROUNDS):
        middle = (low + high) / 2
        if is_low(Meridian(neck, length, middle)):
            low = middle
        else:
            high = middle
    return Meridian(neck, length, high)


@cache
def _holding_most(neck: float, length: float) -> Meridian:
    low, high = 0.0, STEEPEST
    for _ in range(ROUNDS):
        third = (high - low) / 3
        a, b = low + third, high - third
        if Meridian(neck, length, a).volume < Meridian(neck, length, b).volume:
            low = a
        else:
            high = b
    return Meridian(neck, length, low)
