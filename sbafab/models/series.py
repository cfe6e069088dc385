"""Balloons on top of each other: all carry the same force, and their strokes add up."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from sbafab.models.balloon_map import BalloonMap
    from sbafab.models.film_elements import Array
    from sbafab.models.stack import Stack

SAMPLES = 401


def blocked(stack: Stack, pressure: float, stroke: ArrayLike) -> Array:
    """Force in N of one straight chamber that is held at strokes in mm; 0 where it does not reach.

    At most what its weakest balloon pushes with when flat. Below the stroke at which that one
    shuts, its solid films may carry more; they are not counted.
    """
    curves = [_curve(one, pressure) for one in stack.maps]
    counts = np.bincount(stack.levels, minlength=len(stack.maps))
    force = np.linspace(0.0, min(push[0] for _, push in curves), SAMPLES)
    total = np.zeros(SAMPLES)
    for count, (heights, push) in zip(counts, curves, strict=True):
        total += count * np.interp(force, push[::-1], heights[::-1])
    return np.asarray(
        np.interp(np.asarray(stroke, dtype=float), total[::-1], force[::-1], right=0.0) / 1000
    )


def _curve(one: BalloonMap, pressure: float) -> tuple[Array, Array]:
    """Heights in mm and the force in mN there, made to fall."""
    heights = np.linspace(0.0, one.most_height, SAMPLES)
    return heights, np.minimum.accumulate(one.force(pressure, heights))
