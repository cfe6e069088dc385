"""A start a little off flat, from which films know which way to wrinkle."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

WAVES = tuple((0.2 + 0.52 * n, (1.0, 1.7, 2.9)[n % 3], 2.4 * n**2) for n in range(12))
"""Direction, length from crest to crest in mm, and phase of the waves it is the sum of: lengths
that a mesh of 0.35 can follow and that films of 0.038 wrinkle at, in directions that no round
pocket is symmetric to."""


def uneven(points: NDArray[np.float64], height: float) -> NDArray[np.float64]:
    """Points (n, 3) of a stack that lies on a wavy plate, up to ``height`` mm up or down.

    Films and bonds above each other move as one: they stay as thick as they are, and apart.
    """
    x, y = points[:, 0], points[:, 1]
    waves = np.zeros(len(points))
    for direction, length, phase in WAVES:
        along = x * np.cos(direction) + y * np.sin(direction)
        waves += np.cos(2 * np.pi * along / length + phase)
    moved = points.copy()
    # The sum seldom comes near what all crests together would give: half of it is its height.
    moved[:, 2] += height * np.clip(2 * waves / len(WAVES), -1.0, 1.0)
    return moved
