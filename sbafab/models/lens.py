"""Oblong pockets (radial designs): a section of two arcs whose films keep their length.

A slot ``width`` wide, with a straight ``run`` and half discs at its ends, becomes two films of
equal half angle b: each arc is R = width / 2b in radius and keeps its length. The straight run is
then a prism of that lens, and the ends together one body of revolution with the same meridian: two
spherical caps. At b = pi/2 the run is a cylinder of diameter 2 width / pi, what the paper's "about
28" answers to (Sec. 2.1); with its ends a balloon holds most a little earlier, and no air drives it
farther. Lengths mm, volumes ul.
"""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sbafab.models.parabola import BISECTIONS, inverse, within

MODEL = "the lens of two arcs"
SHALLOW = 1e-3
"""Half angle below which volume is proportional to height, to 1e-6."""


class Fullest(NamedTuple):
    """The balloon that holds most: half angle of its arcs, height (mm), volume (ul)."""

    angle: float
    stroke: float
    volume: float


@cache
def fullest(width: float, run: float) -> Fullest:
    """Return the balloon at which dv/dh has come down to 0."""
    low, high = SHALLOW, math.pi / 2
    for _ in range(BISECTIONS):
        b = (low + high) / 2
        low, high = (b, high) if _rate(np.asarray(b), width, run) > 0 else (low, b)
    angle = np.asarray(low)
    return Fullest(low, float(_stroke(angle, width)), float(_volume(angle, width, run)))


def stroke(v: ArrayLike, width: float, run: float) -> NDArray[np.float64]:
    """Return the height (mm) of a balloon that holds ``v`` ul. Raises DesignError out of range."""
    most = fullest(width, run)
    volumes = within(v, most.volume, "volume of a balloon", "ul", MODEL)
    return _stroke(inverse(lambda b: _volume(b, width, run), volumes, most.angle), width)


def volume(h: ArrayLike, width: float, run: float) -> NDArray[np.float64]:
    """Return the volume (ul) of a balloon ``h`` mm high. Raises DesignError out of range."""
    return _volume(_angle(h, width, run), width, run)


def rate(h: ArrayLike, width: float, run: float) -> NDArray[np.float64]:
    """Return dv/dh in mm2 of a balloon ``h`` mm high."""
    return _rate(_angle(h, width, run), width, run)


def _angle(h: ArrayLike, width: float, run: float) -> NDArray[np.float64]:
    most = fullest(width, run)
    heights = within(h, most.stroke, "stroke of a balloon", "mm", MODEL)
    return inverse(lambda b: _stroke(b, width), heights, most.angle)


def _stroke(b: NDArray[np.float64], width: float) -> NDArray[np.float64]:
    # 2 sin^2(b/2) is 1 - cos b without its cancellation.
    safe = np.where(b > 0, b, 1.0)
    return np.where(b > 0, 2 * width * np.sin(safe / 2) ** 2 / safe, 0.0)


def _volume(b: NDArray[np.float64], width: float, run: float) -> NDArray[np.float64]:
    safe = np.maximum(b, SHALLOW)
    radius = width / (2 * safe)
    content = radius**2 * (2 * safe - np.sin(2 * safe)) * run + radius**3 * _caps(safe)
    return np.asarray(np.where(b > SHALLOW, content, content * b / SHALLOW))


def _rate(b: NDArray[np.float64], width: float, run: float) -> NDArray[np.float64]:
    safe = np.maximum(b, SHALLOW)
    radius = width / (2 * safe)
    # Derivatives by b, in which R falls by R / b.
    rise = 2 * radius * (np.sin(safe) - 2 * np.sin(safe / 2) ** 2 / safe)
    lens = radius**2 * (2 - 2 * np.cos(2 * safe) - 2 * (2 * safe - np.sin(2 * safe)) / safe)
    ends = radius**3 * (2 * math.pi * np.sin(safe) ** 3 - 3 * _caps(safe) / safe)
    return np.asarray((lens * run + ends) / rise)


def _caps(b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the volume of two caps of half angle ``b`` of a sphere of radius 1."""
    rise = 2 * np.sin(b / 2) ** 2
    return np.asarray(2 * math.pi / 3 * rise**2 * (3 - rise))
