"""A stack in time: chambers that fill through their lines, in balance at every instant."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from sbafab.errors import DesignError
from sbafab.models.pneumatics import Line

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from sbafab.models.film_elements import Array
    from sbafab.models.stack import Pose, Stack

MOST_ROUNDS = 40
HALVINGS = 20
OVERSHOT = 0.5
"""Share of a step's first slope that its last one may rise to."""
STEP = 1e-3
"""By which slopes are found."""
SOFTEST = 0.01
"""Pressure in kPa below which volumes are nearly straight in pressure, above in its logarithm."""
FARTHEST = 2.0
SUCTION = 90.0
"""kPa below the atmosphere to which a shut chamber may come before its fluid boils or leaks."""
CLOSE = 1e-5
LITTLE = 20.0
"""Share of a chamber's content by which it may be missed; in ul, the content that is least."""


class _Tried(NamedTuple):
    """A pose that is tried: at asinh(p / SOFTEST) of the chambers; what their volumes are too large
    by in ul; and kPa by x.
    """

    x: Array
    pose: Pose
    wrong: Array
    rates: Array


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
        """The pose with these contents. A pump that stands still is shut: what would bend its
        chamber open stands against suction.
        """
        return self._solved(lambda pose: np.asarray(self._contents(pose) - wanted), wanted, SUCTION)

    def _solved(self, missed: Callable[[Pose], Array], scale: Array, suction: float = 0.0) -> Pose:
        """The pose at which nothing is missed, at ``suction`` kPa below the atmosphere at most. A
        chamber that would need less draws in what it lacks.

        What is missed, as volume, is the slope of one function of the pressures, whose least is
        sought: volumes are slopes of a potential that bends one way, and more pressure lets less
        in. Newton's method in asinh(p / SOFTEST), in which volumes are nearly straight; a step is
        as long as it leads downhill.
        """
        most = math.asinh(self.stack.most_pressure / SOFTEST)
        least = -math.asinh(suction / SOFTEST)
        close = CLOSE * np.maximum(np.abs(scale), LITTLE)
        start = np.maximum(np.arcsinh(np.asarray(self.pose.pressures) / SOFTEST), least)
        now = self._tried(start, missed, self.pose)
        for _ in range(MOST_ROUNDS):
            lacks = (now.x >= most) & (now.wrong < 0)
            counts = ~((now.x <= least) & (now.wrong >= 0)) & ~lacks
            if (np.abs(now.wrong) <= close)[counts].all():
                if lacks.any():
                    raise DesignError(
                        f"the chambers would need more than {self.stack.most_pressure:g} kPa; ask "
                        "for less, or make the stack with a larger most_pressure"
                    )
                return now.pose
            ahead = self._ahead(missed, now, counts, least)
            ahead *= min(1.0, FARTHEST / max(float(np.abs(ahead).max()), 1e-12))
            now = self._downhill(missed, now, ahead, (least, most))
        raise DesignError("the stack finds no balance at the end of this step; try a shorter one")

    def _downhill(
        self,
        missed: Callable[[Pose], Array],
        now: _Tried,
        ahead: Array,
        ends: tuple[float, float],
    ) -> _Tried:
        """What is found along a step, as far as it leads downhill."""
        steep = float(now.wrong @ (now.rates * ahead))
        share = 1.0
        for _ in range(HALVINGS):
            x = np.clip(now.x + share * ahead, *ends)
            try:
                tried = self._tried(x, missed, now.pose)
            except DesignError:
                share /= 2
                continue
            still = (x > ends[0]) & (x < ends[1])
            slope = float((tried.wrong * tried.rates * ahead)[still].sum())
            if slope <= -OVERSHOT * steep:
                return tried
            share *= min(max(steep / (steep - slope), 0.1), 0.7)
        return tried

    def _tried(self, x: Array, missed: Callable[[Pose], Array], near: Pose) -> _Tried:
        pressures = np.minimum(SOFTEST * np.sinh(x), self.stack.most_pressure)
        pose = self.stack.pose(tuple(pressures.tolist()), near=near, sucked=True, **self.load)
        return _Tried(x, pose, missed(pose) / self._dense(pose), SOFTEST * np.cosh(x))

    def _dense(self, pose: Pose) -> Array:
        """How much fluid a volume holds in each chamber."""
        return np.array([self.line.content(1.0, p) for p in pose.pressures])

    def _ahead(
        self,
        missed: Callable[[Pose], Array],
        now: _Tried,
        counts: NDArray[np.bool_],
        least: float,
    ) -> Array:
        """Newton's step by x of the chambers that count; 0 of the others."""
        found = []
        for chamber in np.flatnonzero(counts):
            moved = now.x.copy()
            moved[chamber] += STEP if moved[chamber] < 1 else -STEP
            tried = self._tried(moved, missed, now.pose)
            found.append((tried.wrong - now.wrong)[counts] / (tried.x - now.x)[chamber])
        which, slopes = np.flatnonzero(counts), np.array(found).T
        while True:
            ahead = np.zeros_like(now.x)
            ahead[which] = _newton(slopes, now.wrong[which], now.rates[which])
            may = (now.x[which] > least) | (ahead[which] >= 0)
            if may.all():
                return ahead
            # What has no less pressure to give stays: the others move alone.
            which, slopes = which[may], slopes[np.ix_(may, may)]


def _newton(slopes: Array, wrong: Array, rates: Array) -> Array:
    """The step by x, its matrix made symmetric and firm by pressure, as that of a least is."""
    matrix = slopes / rates
    values, vectors = np.linalg.eigh((matrix + matrix.T) / 2)
    values = np.maximum(np.abs(values), 1e-9 * np.abs(values).max(initial=0.0) + 1e-12)
    return np.asarray(-(vectors @ ((vectors.T @ wrong) / values)) / rates)
