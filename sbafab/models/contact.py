"""Where an inflated stack touches itself, and how much room is left where it does not.

Balloons on each other meet at the plate between them, which the elastic balloon has; levels that
lean meet at their rims, which the stack has. Balloons side by side never do where the room below
is more than 0. Lengths mm.
"""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from sbafab.models.balloon import inflate

if TYPE_CHECKING:
    from sbafab.models.film_elements import Array
    from sbafab.models.stack import Pose, Stack

OPEN = 0.02
"""mm that a balloon is taken to be open at least."""


def rim_gap(stack: Stack, pose: Pose) -> float:
    """Mm by which rims of neighbouring levels have left each other where they are nearest.

    Flat ones lie on each other; 0 where levels lean so far that their rims do again.
    """
    gaps = stack.rims[stack.levels] @ pose.freedoms[..., None]
    return max(float(gaps.min()), 0.0)


def chamber_gap(stack: Stack, pose: Pose) -> float:
    """Mm between the films of balloons side by side where they are nearest.

    Below 0 they would pass through each other. Both stand in the frame of their level, and those
    of other levels lie beyond a plate, so that axes and largest radii tell. Raises DesignError for
    a balloon without a balance.
    """
    widest = _radii(stack, pose)
    nearest = []
    for one, other in combinations(range(stack.chambers), 2):
        apart = float(np.hypot(*(stack.axes[one] - stack.axes[other])))
        nearest.append(apart - float((widest[:, one] + widest[:, other]).max()))
    thick = max(one.balloon.thickness for one in stack.maps)
    return min(nearest) - thick


def _radii(stack: Stack, pose: Pose) -> Array:
    """Largest radius of the middle of each balloon's films: (levels, chambers)."""
    found = np.empty_like(pose.gaps)
    pressures = np.broadcast_to(np.array(pose.pressures), pose.gaps.shape)
    for kind, one in enumerate(stack.maps):
        own = stack.levels == kind
        asked = np.stack([pressures[own], np.maximum(pose.gaps[own], OPEN).round(4)], -1)
        alike, back = np.unique(asked.reshape(-1, 2), axis=0, return_inverse=True)
        shapes = inflate(one.balloon, alike[:, 0], alike[:, 1], tied=True)
        within = shapes.r[:, one.balloon.held : one.balloon.edge + 1].max(-1)
        found[own] = within[back].reshape(asked.shape[:2])
    return found
