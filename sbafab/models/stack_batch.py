"""Many states of one stack at once: poses, inverse kinematics, and motions as chambers fill through
their lines. The same equations as of ``Stack`` and ``Motion``; states against an outer plate are
solved one by one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sbafab.errors import DesignError
from sbafab.models.film_elements import Array
from sbafab.models.motion import BatchMotion
from sbafab.models.pneumatics import Line
from sbafab.models.reach import P0, Search
from sbafab.models.stack import Stack
from sbafab.models.stack_poses import BatchPoses, Equilibria
from sbafab.process import one_blas_thread

__all__ = ["BatchMotion", "BatchPoses", "StackBatch"]


@dataclass(frozen=True, eq=False)
class StackBatch:
    """Many states of one ``stack``, solved together."""

    stack: Stack

    @one_blas_thread
    def poses(
        self, pressures: ArrayLike, near: BatchPoses | None = None, **load: Any
    ) -> BatchPoses:
        """Return the equilibrium poses at pressures (N, chambers) in kPa.

        ``near`` are N poses to start from; ``load`` are keyword arguments of ``Stack.pose`` beside
        pressures. Raises DesignError as ``Stack.pose`` does, for the first state that has no pose.
        """
        asked = self.stack.table(pressures)
        if near is not None and len(near.freedoms) != len(asked):
            raise DesignError(
                f"near has {len(near.freedoms)} poses for {len(asked)} states; give one a state"
            )
        start = None if near is None else near.freedoms
        return self.stack.poses_of(self.stack.equilibria(asked, self.stack.acting(load), start))

    @one_blas_thread
    def reach(self, tips: ArrayLike, most_pressure: float | None = None, **load: Any) -> BatchPoses:
        """Return poses whose tips stand at places (N, 3) in mm, those that ``Stack.reach`` finds
        one by one, with pressures from 0 to ``most_pressure`` in kPa.

        ``load`` are keyword arguments of ``Stack.pose`` beside pressures. Raises UnreachableError
        and DesignError as ``Stack.reach`` does, for the first place that is not met.
        """
        places, most = _places(tips), self.stack.reach_limit(most_pressure)
        search = Search(self.stack, self.stack.acting(load), math.asinh(most / P0))
        return self.stack.poses_of(search.reached(places, None))

    def motion(
        self,
        count: int,
        line: Line | None = None,
        pressures: Sequence[float] | None = None,
        **load: Any,
    ) -> BatchMotion:
        """Return ``count`` motions that start at pressures (kPa, by default 0); ``line`` feeds each
        chamber, and ``load`` are keyword arguments of ``Stack.pose`` beside pressures.
        """
        if count < 1:
            raise DesignError(f"count = {count} must be at least 1")
        acting = self.stack.acting(load)
        begin = (0.0,) * self.stack.chambers if pressures is None else pressures
        start = self.stack.states_of(self.stack.pose(begin, **load), acting)
        parts: list[Any] = [part.repeat(count, axis=0) for part in start]
        states = Equilibria(*parts)
        return BatchMotion(
            self.stack,
            line or Line(),
            acting,
            start,
            states.balance,
            states.pressures,
            np.zeros(count),
        )


def _places(tips: ArrayLike) -> Array:
    """Return places (N, 3) in mm. Raises DesignError if they are invalid."""
    try:
        places = np.asarray(tips, dtype=float)
    except (TypeError, ValueError):
        places = np.zeros(0)
    if places.ndim != 2 or places.shape[1] != 3 or not np.isfinite(places).all():
        raise DesignError("places of the tip in mm must be finite numbers, a row of three a place")
    return places
