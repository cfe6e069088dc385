"""Stacks in time: chambers that fill through their lines, in equilibrium at every instant.

Freedoms and pressures of many states are solved together by Newton's method; states that do not
converge soon go from equilibrium to equilibrium. Lengths mm, pressures kPa, volumes ul. Arrays have
one row per state.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from sbafab.errors import DesignError
from sbafab.models.column import CHUNK, LOADED_CHUNK, BatchPoses, Column, Pose, numbers_of
from sbafab.models.derivatives import (
    Linearised,
    linearised_poses,
    place_of,
    pressure_at,
    pressure_rate,
    together,
)
from sbafab.models.film_elements import Array
from sbafab.models.pneumatics import ATMOSPHERE_KPA, Line
from sbafab.models.stack_balance import bounded_solutions, definite
from sbafab.runtime import one_blas_thread

ROUNDING = 1e-11
"""Rounding of volumes in ul."""
MOTION_STEPS, TRIALS = 16, 100
"""Maximum Newton steps of freedoms and pressures together, and equilibria thereafter."""
LONGEST_STEP = 2.0
"""Largest change of the pressures' coordinates in one step."""
OVERSHOT, LEAST_SHARE = 0.5, 1e-5
"""Share of a step's first slope that its last one may rise to, unless so small a share of the step
is left."""
SUCTION = 90.0
"""Limit of suction in kPa for a shut chamber, before its fluid boils or leaks."""
TOLERANCE, LEAST_CONTENT = 1e-5, 20.0
"""Tolerance as a share of a chamber's content; in ul, the least content it is taken of."""


class Intake(NamedTuple):
    """The fluid that n states take in from their start ``begin``.

    ``contents`` (n, chambers) are in ul at the end (for a gas, at atmospheric pressure) without the
    flow during ``acts`` (n, 1) s from ``sources`` (n, chambers) in kPa, if these are valves; pumps
    may draw down to ``least`` kPa.

    The content of a chamber's ``line`` counts as its own. The excess of volumes is the gradient of
    one function of the pressures, whose minimum is sought: volumes are slopes of a concave
    potential, and a higher pressure admits less. Pressures stay at or above the least, and a
    chamber that would need less draws in the rest.
    """

    begin: BatchPoses
    line: Line
    contents: Array
    acts: Array
    sources: Array | None
    least: float

    @classmethod
    def of(
        cls, begin: BatchPoses, line: Line, acts: Array, sources: Array | None, flows: Any = 0.0
    ) -> Intake:
        """The intake from valves at sources, or from pumps with ``flows`` (n, chambers) in ul/s."""
        # A pump that stands still is shut: its chamber may come to suction where a load bends it
        # open.
        least = -SUCTION if sources is None else 0.0
        empty = cls(begin, line, np.zeros_like(begin.pressures), acts, sources, least)
        held = (begin.volumes + empty.more) * empty.squeezed(begin.pressures)
        return empty._replace(contents=held + acts * flows)

    @property
    def more(self) -> float:
        """The volume of a gas in the line."""
        return self.line.dead_volume + self.line.tube_volume if self.line.fluid.is_gas else 0.0

    def squeezed(self, pressures: Array) -> Array:
        """Return contents from volumes: a gas is measured at atmospheric pressure."""
        is_gas = self.line.fluid.is_gas
        return 1 + pressures / ATMOSPHERE_KPA if is_gas else np.ones_like(pressures)

    def excess(self, volumes: Array, pressures: Array) -> tuple[Array, Array]:
        """Return the excess of the volumes in ul, and its derivative with respect to pressure at
        equal volumes: (n, chambers) each.
        """
        flow = rate = np.zeros_like(pressures)
        if self.sources is not None:
            flow, rate = self.line.flows(self.sources, pressures)
        squeezed, whole = self.squeezed(pressures), volumes + self.more
        own = -self.acts * rate
        if self.line.fluid.is_gas:
            own = own + whole / ATMOSPHERE_KPA
        return whole - (self.contents + self.acts * flow) / squeezed, own / squeezed

    def at(self, where: Any) -> Intake:
        """Return the intake of some of the states."""
        sources = None if self.sources is None else self.sources[where]
        contents, acts = self.contents[where], self.acts[where]
        return Intake(self.begin.part(where), self.line, contents, acts, sources, self.least)

    @property
    def ends(self) -> tuple[float, float]:
        """The least and largest coordinate of a pressure."""
        return float(place_of(self.least)), float(place_of(self.begin.column.most_pressure))

    def taken(self) -> BatchPoses:
        """Return the poses at the end. Raises DesignError for the first state without one."""
        size = CHUNK if self.begin.load is None else LOADED_CHUNK
        parts = [slice(first, first + size) for first in range(0, len(self.begin), size)]
        states = BatchPoses.joined([self.at(part).together() for part in parts])
        rest = np.flatnonzero(~states.is_met)
        return states.replaced(rest, self.at(rest).descent()) if rest.size else states

    def ahead(self, which: Any, now: Linearised, x: Array, moves: Array) -> Array:
        """Return Newton's steps of the pressure coordinates (n, chambers) of some of the states, as
        for ``derivatives.together``.

        With the freedoms' own steps inserted, the derivatives of volumes with respect to pressure
        are a symmetric positive definite matrix.
        """
        rate, filled = pressure_rate(x), now.filled(moves)
        wrong, own = self.at(which).excess(now.volumes + filled[..., 0], pressure_at(x))
        # A shut valve leaves a pressure of exactly 0.
        wrong[np.abs(wrong) < ROUNDING] = 0.0
        matrix = filled[..., 1:] / rate[:, None]
        matrix = matrix + (now.swelling + own)[..., None] * np.eye(x.shape[1])
        # Chambers at an end stay; the others may pass one within a step.
        least = np.where(x <= self.ends[0], 0.0, -np.inf)
        most = np.where(x >= self.ends[1], 0.0, np.inf)
        dx = bounded_solutions(definite(matrix), -wrong, least, most) / rate
        longest = np.maximum(np.abs(dx).max(1, keepdims=True), LONGEST_STEP)
        return np.asarray(dx * (LONGEST_STEP / longest))

    def together(self) -> BatchPoses:
        """Return the states by Newton's method for freedoms and pressures together."""
        _, states = together(self.begin, self.ahead, self.ends, MOTION_STEPS)
        is_within = (states.pressures < self.begin.column.most_pressure).all(1)
        return replace(states, is_found=states.is_found & states.is_stable & is_within)

    def descent(self) -> BatchPoses:
        """Return the states, from equilibrium to equilibrium by Newton's method with a line search.
        Raises DesignError for the first without one.
        """
        ends, top = self.ends, self.begin.column.most_pressure
        x, share = np.maximum(place_of(self.begin.pressures), ends[0]), np.ones(len(self.begin))
        now = self._equilibria(x, self.begin.freedoms).met()
        close = TOLERANCE * np.maximum(np.abs(self.contents), LEAST_CONTENT)
        for _ in range(TRIALS):
            wrong, _ = self.excess(now.volumes, now.pressures)
            lacks = (x >= ends[1]) & (wrong < 0)
            rests: Any = (np.abs(wrong) <= close) | (x <= ends[0]) & (wrong >= 0) | lacks
            if rests.all() and lacks.any():
                raise DesignError(
                    f"the chambers would need more than {top:g} kPa; reduce the volumes"
                )
            if rests.all():
                return now
            at, rate = linearised_poses(now), pressure_rate(x)
            moves = at.energy.solved(at.filling * rate[:, None])
            moves = np.concatenate([np.zeros((*moves.shape[:2], 1)), moves], axis=-1)
            ahead = self.ahead(slice(None), at, x, moves) * ~rests.all(1)[:, None]
            tried = np.clip(x + share[:, None] * ahead, *ends)
            candidates = self._equilibria(tried, now.freedoms)
            missed, _ = self.excess(candidates.volumes, candidates.pressures)
            still = (tried > ends[0]) & (tried < ends[1])
            slope = np.where(still, missed * pressure_rate(tried) * ahead, 0.0).sum(1)
            steep = (wrong * rate * ahead).sum(1)
            good = candidates.is_met & ((slope <= -OVERSHOT * steep) | (share < LEAST_SHARE))
            less = np.clip(steep / np.minimum(steep - slope, -1e-100), 0.1, 0.7)
            share = np.where(good, 1.0, share * np.where(candidates.is_met, less, 0.5))
            x, now = np.where(good[:, None], tried, x), now.replaced(good, candidates.part(good))
        raise DesignError(
            "no equilibrium of the stack found at the end of this step; try a shorter one"
        )

    def _equilibria(self, x: Array, start: Array) -> BatchPoses:
        p = np.minimum(pressure_at(x), self.begin.column.most_pressure)
        return self.begin.column.equilibria(p, self.begin.load, start, sucked=True)


@dataclass
class Motion:
    """A moving stack: ``step`` it, then read ``pose``, ``time`` and ``sources``.

    ``time`` is in s, ``sources`` the pressure in kPa at each chamber's valve or pump; ``line``
    feeds each chamber. Quasi-static: film and fluid have no inertia. ``load`` holds keyword
    arguments of ``Stack.pose`` other than pressures. A pumped gas also fills the line's dead volume
    and tube.
    """

    stack: Column
    line: Line
    load: dict[str, Any]
    pose: Pose
    time: float = 0.0
    sources: tuple[float, ...] = ()

    @property
    def pressures(self) -> tuple[float, ...]:
        """The pressures in the chambers, kPa."""
        return self.pose.pressures

    def step(
        self,
        dt: float,
        pressures: Sequence[float] | None = None,
        flows: Sequence[float] | None = None,
    ) -> Pose:
        """Return the pose ``dt`` s later, with one pressure (kPa) at the valve or one flow (ul/s,
        of a gas at atmospheric pressure) of the pump per chamber. Raises DesignError.
        """
        _refuse_time(dt)
        if (pressures is None) == (flows is None):
            raise DesignError("a step takes either pressures or flows, one per chamber")
        count, given = self.stack.chambers, flows if pressures is None else pressures
        assert given is not None
        sentence = f"a step takes {count} finite numbers, one a chamber"
        values = numbers_of(given, (count,), sentence)
        acts = np.array([[max(0.0, min(dt, self.time + dt - self.line.delay))]])
        begin = self.stack.states_of(self.pose, self.stack.acting(self.load))
        asked = (values[None], 0.0) if flows is None else (None, values)
        self.pose = Intake.of(begin, self.line, acts, *asked).taken().pose()
        self.sources = tuple(values.tolist())
        if flows is not None:
            self.sources = tuple(
                self.line.source_pressure(float(q), p) if q > 0 else p
                for q, p in zip(values, self.pose.pressures, strict=True)
            )
        self.time += dt
        return self.pose


@dataclass(eq=False)
class BatchMotion:
    """N moving stacks, as ``Motion``: ``step`` them, then read ``poses`` and ``times``.

    ``start`` is the first pose; ``times`` (N,) in s; ``line`` feeds each chamber.
    """

    line: Line
    start: BatchPoses
    poses: BatchPoses
    times: Array

    def restart(self, where: Any) -> None:
        """Reset some of the states (a mask, their numbers or a slice) to the start, at 0 s."""
        self.times[where] = 0.0
        self.poses = self.poses.replaced(where, self.start)

    @property
    def tips(self) -> Array:
        """The middles of the top plates in mm: (N, 3)."""
        return self.poses.tips

    @property
    def pressures(self) -> Array:
        """The pressures in the chambers, kPa: (N, chambers)."""
        return self.poses.pressures

    @one_blas_thread
    def step(self, dt: float, pressures: ArrayLike) -> None:
        """Advance by ``dt`` s with pressures (N, chambers) in kPa at the valves. Raises DesignError
        like ``Motion.step``, for the first state without a pose.
        """
        _refuse_time(dt)
        sources = self.poses.column.table(pressures, len(self.times))
        acts = np.clip(self.times + dt - self.line.delay, 0.0, dt)[:, None]
        self.poses = Intake.of(self.poses, self.line, acts, sources).taken()
        self.times = self.times + dt


def _refuse_time(dt: float) -> None:
    if not (np.isfinite(dt) and dt > 0):
        raise DesignError(f"dt = {dt:g} s must be above 0 s")
