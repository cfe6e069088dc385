"""Balloons set on each other by the planes of their neck discs."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.errors import DesignError

if TYPE_CHECKING:
    from numpy.typing import NDArray

FLATNESS = 0.01
"""Part of the lift by which necks may miss a common plane."""


class RigidMotion(NamedTuple):
    """A rigid motion: ``turn`` (3, 3) first, then ``shift`` (3,) in mm."""

    turn: NDArray[np.float64]
    shift: NDArray[np.float64]


UPRIGHT = RigidMotion(np.eye(3), np.zeros(3))


def slopes_of(centres: NDArray[np.float64], heights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Slopes along x and y of the plane through the heights at the centres (n, 2).

    Raises DesignError where they have no common plane.
    """
    offsets = centres - centres.mean(axis=0)
    rises = heights - heights.mean()
    slopes: NDArray[np.float64] = np.linalg.lstsq(offsets, rises, rcond=1e-9)[0]
    worst = float(np.abs(rises - offsets @ slopes).max())
    if worst > FLATNESS * float(np.abs(heights).max()):
        raise DesignError(
            f"the fills asked for lift the chambers {worst:.3f} mm off a common plane; fill more "
            "than three chambers, or chambers in one row, alike"
        )
    return slopes


def set_on(
    below: RigidMotion,
    centres: NDArray[np.float64],
    top: NDArray[np.float64],
    bottom: NDArray[np.float64],
    gap: float,
) -> RigidMotion:
    """The pose of a balloon whose neck discs at heights ``bottom`` meet those at ``top`` of the
    balloon below, ``gap`` mm apart.
    """
    middle = centres.mean(axis=0)
    turn = below.turn @ _frame(slopes_of(centres, top)) @ _frame(slopes_of(centres, bottom)).T
    meeting = below.turn @ np.array([*middle, top.mean()]) + below.shift
    normal = below.turn @ _frame(slopes_of(centres, top))[:, 2]
    start = turn @ np.array([*middle, bottom.mean()])
    return RigidMotion(turn, meeting + gap * normal - start)


def _frame(slopes: NDArray[np.float64]) -> NDArray[np.float64]:
    """The turn (3, 3) by the least angle of the upright axis onto the normal of a plane."""
    normal = np.array([-slopes[0], -slopes[1], 1.0])
    normal /= np.linalg.norm(normal)
    x, y, z = normal.tolist()
    return np.array(
        [
            [1 - x * x / (1 + z), -x * y / (1 + z), x],
            [-x * y / (1 + z), 1 - y * y / (1 + z), y],
            [-x, -y, z],
        ]
    )
