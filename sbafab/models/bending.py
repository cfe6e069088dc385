"""Bending of parallel chambers: constant curvature from their lengths.

A plane through the chambers' ends, the nearest one where there are more than three, gives the
length on the axis and the gradient across it; the axis is then an arc.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


class Bend(NamedTuple):
    """Angle of the top (radians), where it leans to (radians from x), length of the axis (mm),
    tip (..., 3) in mm, from the middle of the base.
    """

    angle: NDArray[np.float64]
    towards: NDArray[np.float64]
    length: NDArray[np.float64]
    tip: NDArray[np.float64]


def bend(lengths: ArrayLike, axes: ArrayLike) -> Bend:
    """The bend of chambers with ``lengths`` (..., n) mm at ``axes`` (n, 2) mm, n >= 2.

    Valid to about half a turn: past pi the tip would come down through the base.
    """
    places = np.asarray(axes, dtype=float)
    to_plane = np.linalg.pinv(np.column_stack([np.ones(len(places)), places]))
    plane = np.asarray(lengths, dtype=float) @ to_plane.T
    length, across = plane[..., 0], plane[..., 1:]
    angle = np.hypot(across[..., 0], across[..., 1])
    # It leans away from its long side.
    towards = np.arctan2(-across[..., 1], -across[..., 0])
    safe = np.where(angle > 0, angle, 1.0)
    # 2 sin^2(x/2) is 1 - cos x without its cancellation.
    aside = np.where(angle > 0, length * 2 * np.sin(safe / 2) ** 2 / safe, 0.0)
    up = np.where(angle > 0, length * np.sin(safe) / safe, length)
    tip = np.stack([aside * np.cos(towards), aside * np.sin(towards), up], axis=-1)
    return Bend(angle, towards, length, tip)
