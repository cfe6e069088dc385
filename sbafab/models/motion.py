"""A stack in time: chambers that fill through their lines, in balance at every instant."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from sbafab.errors import DesignError
from sbafab.models.pneumatics import Line

if TYPE_CHECKING:
    from sbafab.models.film_elements import Array
    from sbafab.models.stack import Pose, Stack

MOST_ROUNDS = 40
HALVINGS = 8
DAMPED, LEAST_DAMPING = 10.0, 0.05
"""By what steps are damped more where they do not help, and what is none."""
SOFTEST = 0.01
"""Pressure in kPa below which volumes are nearly straight in pressure, above in its logarithm."""
FARTHEST = 1.0
CLOSE = 1e-5
"""Share of a chamber's content by which it may be missed."""


@dataclass
class Motion:
    """A stack that moves: call ``step``, look at ``pose``, ``time`` and ``sources``.

    ``time`` is in s, ``sources`` the pressure in kPa at each chamber's valve or pump; ``line`` is
    what feeds them. Quasi-static: film and fluid have no inertia. ``load`` holds what
    ``Stack.pose`` takes beside pressures. A gas that is pumped fills the line's dead volume and
    tube as well.
    """

    stack: Stack
    line: Line
    load: dict[str, Any]
    pose: Pose
    time: float = 0.0
    sources: tuple[float, ...] = ()

    @property
    def pressures(self) -> tuple[float, ...]:
        """KPa in the chambers."""
        return self.pose.pressures

    def step(
        self,
        dt: float,
        pressures: Sequence[float] | None = None,
        flows: Sequence[float] | None = None,
    ) -> Pose:
        """The pose ``dt`` s later, with pressures (kPa) at the valves or flows (ul/s, of a gas at
        the atmosphere) of the pumps, one a chamber. Raises DesignError.
        """
        if not (np.isfinite(dt) and dt > 0):
            raise DesignError(f"dt = {dt:g} s must be above 0 s")
        if (pressures is None) == (flows is None):
            raise DesignError("a step takes either pressures or flows, one a chamber")
        given = np.asarray(pressures if flows is None else flows, dtype=float)
        if given.shape != (self.stack.chambers,) or not np.isfinite(given).all():
            raise DesignError(f"a step takes {self.stack.chambers} finite numbers, one a chamber")
        before = self._contents(self.pose)
        acts = max(0.0, min(dt, self.time + dt - self.line.delay))
        if flows is None:
            self.pose = self._fed(before, acts, given)
            self.sources = tuple(given.tolist())
        else:
            self.pose = self._filled(before + acts * given)
            self.sources = tuple(
                self.line.source_pressure(float(q), p) if q > 0 else p
                for q, p in zip(given, self.pose.pressures, strict=True)
            )
        self.time += dt
        return self.pose

    def _contents(self, pose: Pose) -> Array:
        more = self.line.dead_volume + self.line.tube_volume if self.line.fluid.is_gas else 0.0
        pairs = zip(pose.volumes, pose.pressures, strict=True)
        return np.array([self.line.content(volume + more, p) for volume, p in pairs])

    def _fed(self, before: Array, dt: float, sources: Array) -> Pose:
        def missed(pose: Pose) -> Array:
            pairs = zip(sources, pose.pressures, strict=True)
            flow = np.array([self.line.flow(float(source), p) for source, p in pairs])
            return np.asarray(self._contents(pose) - before - dt * flow)

        return self._solved(missed, before)

    def _filled(self, wanted: Array) -> Pose:
        return self._solved(lambda pose: np.asarray(self._contents(pose) - wanted), wanted)

    def _solved(self, missed: Callable[[Pose], Array], scale: Array) -> Pose:
        """The pose at which nothing is missed: Newton's method in asinh(p / SOFTEST), in which
        volumes are nearly straight. A chamber that would need less than no pressure draws in what
        it lacks.
        """
        most = math.asinh(self.stack.most_pressure / SOFTEST)
        x = np.arcsinh(np.asarray(self.pose.pressures) / SOFTEST)
        pose = self._at(x)
        wrong = missed(pose)
        close = CLOSE * np.maximum(np.abs(scale), 1.0)
        damping = 0.0
        for _ in range(MOST_ROUNDS):
            counts = ~((x <= 0) & (wrong >= 0))
            if (np.abs(wrong) <= close)[counts].all():
                return pose
            if (counts & (x >= most) & (wrong < 0)).any():
                break
            slopes = self._slopes(missed, x, wrong)[np.ix_(counts, counts)]
            # Below some 0.05 kPa maps may give a chamber less for more pressure.
            slopes += damping * np.diag(np.abs(slopes).sum(-1))
            move = np.zeros_like(x)
            move[counts] = np.clip(-np.linalg.solve(slopes, wrong[counts]), -FARTHEST, FARTHEST)
            for _ in range(HALVINGS):
                tried_x = np.clip(x + move, 0.0, most)
                tried = self._at(tried_x)
                left = missed(tried)
                still = ~((tried_x <= 0) & (left >= 0))
                if np.abs(left / close)[still].max(initial=0) < np.abs(wrong / close)[counts].max():
                    x, pose, wrong, damping = tried_x, tried, left, damping / DAMPED
                    break
                move = move / 2
            else:
                damping = max(DAMPED * damping, 1.0)
            damping = damping if damping > LEAST_DAMPING else 0.0
        raise DesignError(
            f"the chambers would need more than {self.stack.most_pressure:g} kPa; ask for less, or "
            "make the stack with a larger most_pressure"
        )

    def _slopes(self, missed: Callable[[Pose], Array], x: Array, wrong: Array) -> Array:
        found = np.empty((len(x), len(x)))
        for chamber in range(len(x)):
            step = 1e-3 if x[chamber] < 1 else -1e-3
            moved = x.copy()
            moved[chamber] += step
            found[:, chamber] = (missed(self._at(moved)) - wrong) / step
        return found

    def _at(self, x: Array) -> Pose:
        pressures = np.minimum(SOFTEST * np.sinh(x), self.stack.most_pressure)
        return self.stack.pose(tuple(pressures.tolist()), near=self.pose, **self.load)
