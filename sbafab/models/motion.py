"""Stacks in time: chambers that fill through their lines, in equilibrium at every instant.

Freedoms and pressures of many states are found together by Newton's method; a step that it does not
solve is gone in parts. Lengths mm, pressures kPa, volumes ul. Arrays have one row per state.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from sbafab.errors import DesignError
from sbafab.models.column import CHUNK, LOADED_CHUNK, BatchPoses, Column, Pose
from sbafab.models.derivatives import (
    Linearised,
    Unknowns,
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
MOTION_STEPS = 16
"""Maximum Newton steps of freedoms and pressures together."""
LONGEST_STEP = 2.0
"""Largest change of the pressures' coordinates in one of them."""
SUCTION = 90.0
"""Limit of suction in kPa for a shut chamber, before its fluid boils or leaks."""
MOST_STEPS, HALVINGS = 40, 20
OVERSHOT = 0.5
"""Share of a step's first slope that its last one may rise to, in the line search."""
TOLERANCE, LEAST_CONTENT = 1e-5, 20.0
"""Tolerance as a share of a chamber's content; in ul, the least content it is taken of."""


class Supply(NamedTuple):
    """What n states take in during a step: the ``contents`` (n, chambers) that they then have in ul
    (of a gas at the atmosphere) but for the flow of ``acts`` (n, 1) s from ``sources`` (n,
    chambers) in kPa, if these are valves; pumps may suck down to ``least`` kPa.

    The content of a chamber's ``line`` counts as its own.
    """

    line: Line
    contents: Array
    acts: Array
    sources: Array | None
    least: float

    @property
    def more(self) -> float:
        """Volume of a gas in the line."""
        return self.line.dead_volume + self.line.tube_volume if self.line.fluid.is_gas else 0.0

    def squeezed(self, pressures: Array) -> Array:
        """Return contents by volumes: a gas is counted at the atmosphere."""
        is_gas = self.line.fluid.is_gas
        return 1 + pressures / ATMOSPHERE_KPA if is_gas else np.ones_like(pressures)

    def excess(self, volumes: Array, pressures: Array) -> tuple[Array, Array]:
        """Return by how many ul the volumes are too large, and this by pressure at equal volumes:
        (n, chambers) each.
        """
        flow = rate = np.zeros_like(pressures)
        if self.sources is not None:
            flow, rate = self.line.flows(self.sources, pressures)
        squeezed, whole = self.squeezed(pressures), volumes + self.more
        own = -self.acts * rate
        if self.line.fluid.is_gas:
            own = own + whole / ATMOSPHERE_KPA
        return whole - (self.contents + self.acts * flow) / squeezed, own / squeezed

    def at(self, where: Any) -> Supply:
        """Return that of some of the states."""
        sources = None if self.sources is None else self.sources[where]
        return self._replace(contents=self.contents[where], acts=self.acts[where], sources=sources)


def moved(begin: BatchPoses, supply: Supply) -> BatchPoses:
    """Return the poses after a step. Raises DesignError for the first state that has none.

    Freedoms and pressures together first; then, where that does not converge, from equilibrium to
    equilibrium.
    """
    held = (begin.volumes + supply.more) * supply.squeezed(begin.pressures)
    supply, found = supply._replace(contents=supply.contents + held), begin
    size = CHUNK if begin.load is None else LOADED_CHUNK
    for first in range(0, len(begin), size):
        part = np.arange(len(begin))[first : first + size]
        step = Intake(begin.part(part), supply.at(part))
        found = found.replaced(part, step.together())
    rest = np.flatnonzero(~found.is_met)
    if rest.size:
        found = found.replaced(rest, Intake(begin.part(rest), supply.at(rest)).descent())
    return found


class Intake(NamedTuple):
    """States that take in a supply from where they ``begin``.

    The excess of volumes is the gradient of one function of the pressures, whose minimum is sought:
    volumes are slopes of a concave potential, and more pressure lets less in. Pressures stay at or
    above the least, and a chamber that would need less draws in the rest.
    """

    begin: BatchPoses
    supply: Supply

    @property
    def ends(self) -> tuple[float, float]:
        """Least and largest the pressures' coordinates."""
        top = self.begin.column.most_pressure
        return float(place_of(self.supply.least)), float(place_of(top))

    def ahead(self, which: Any, now: Linearised, x: Array, moves: Array) -> Array:
        """Return Newton's steps of the pressures' coordinates (n, chambers) of some of the states,
        as of ``derivatives.together``.

        With the freedoms' own steps put in, the volumes' rates by pressure are a matrix that is
        symmetric and positive definite.
        """
        rate, filled = pressure_rate(x), now.filled(moves)
        wrong, own = self.supply.at(which).excess(now.volumes + filled[..., 0], pressure_at(x))
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
        begin = self.begin
        run = Unknowns.of(begin.column, begin.load, place_of(begin.pressures), begin.freedoms)
        _, found = together(begin.column, begin.load, run, self.ahead, self.ends, MOTION_STEPS)
        top = begin.column.most_pressure
        return replace(
            found, is_found=found.is_found & found.is_stable & (found.pressures < top).all(1)
        )

    def descent(self) -> BatchPoses:
        """Return the states, from equilibrium to equilibrium. Raises DesignError for the first that
        has none.
        """
        begin, top = self.begin, self.begin.column.most_pressure
        x = np.maximum(place_of(begin.pressures), self.ends[0])
        now = self._equilibria(x, begin.freedoms).met()
        live = np.arange(len(x))
        for _ in range(MOST_STEPS):
            wrong, lin = self._excess(now), linearised_poses(now)
            lacks = (x >= self.ends[1]) & (wrong < 0)
            counts = ~((x <= self.ends[0]) & (wrong >= 0)) & ~lacks
            close = TOLERANCE * np.maximum(np.abs(self.supply.contents), LEAST_CONTENT)
            goes = ((np.abs(wrong) > close) & counts).any(1)
            if not goes.any():
                if lacks.any():
                    raise DesignError(
                        f"the chambers would need more than {top:g} kPa; ask for less"
                    )
                return now
            filling = lin.filling * pressure_rate(x)[:, None]
            moves = lin.energy.solved(filling)
            still = np.zeros((*moves.shape[:2], 1))
            ahead = self.ahead(live, lin, x, np.concatenate([still, moves], axis=-1))
            ahead[~goes] = 0.0
            x, now = self._downhill(x, now, wrong, ahead)
        raise DesignError(
            "no equilibrium of the stack found at the end of this step; try a shorter one"
        )

    def _downhill(
        self, x: Array, now: BatchPoses, wrong: Array, ahead: Array
    ) -> tuple[Array, BatchPoses]:
        """Return the states at the end of steps, by a line search."""
        steep = (wrong * pressure_rate(x) * ahead).sum(1)
        share, begin = np.ones(len(x)), x
        rest = np.flatnonzero(ahead.any(1))
        for _ in range(HALVINGS):
            tried = np.clip(begin + share[:, None] * ahead, *self.ends)[rest]
            found = Intake(now.part(rest), self.supply.at(rest))._equilibria(
                tried, now.freedoms[rest]
            )
            good = found.is_met
            slope = np.zeros(len(rest))
            alone = Intake(found, self.supply.at(rest))
            still = (tried > self.ends[0]) & (tried < self.ends[1])
            parts = alone._excess(found) * pressure_rate(tried) * ahead[rest]
            slope = np.where(still, parts, 0.0).sum(1)
            over = steep[rest] / np.minimum(steep[rest] - slope, -1e-300)
            good &= slope <= -OVERSHOT * steep[rest]
            x = x.copy()
            x[rest[good]] = tried[good]
            now = now.replaced(rest[good], found.part(good))
            less = np.where(found.is_met, np.clip(over, 0.1, 0.7), 0.5)
            share[rest] *= np.where(good, 1.0, less)
            rest = rest[~good]
            if not rest.size:
                break
        return x, now

    def _equilibria(self, x: Array, start: Array) -> BatchPoses:
        p = np.minimum(pressure_at(x), self.begin.column.most_pressure)
        return self.begin.column.equilibria(p, self.begin.load, start, sucked=True)

    def _excess(self, poses: BatchPoses) -> Array:
        return self.supply.excess(poses.volumes, poses.pressures)[0]


@dataclass
class Motion:
    """A moving stack: ``step`` it, then read ``pose``, ``time`` and ``sources``.

    ``time`` is in s, ``sources`` the pressure in kPa at each chamber's valve or pump; ``line``
    feeds each chamber. Quasi-static: film and fluid have no inertia. ``load`` are keyword arguments
    of ``Stack.pose`` beside pressures. A gas that is pumped fills the line's dead volume and tube
    as well.
    """

    stack: Column
    line: Line
    load: dict[str, Any]
    pose: Pose
    time: float = 0.0
    sources: tuple[float, ...] = ()

    @property
    def pressures(self) -> tuple[float, ...]:
        """Pressures in the chambers, kPa."""
        return self.pose.pressures

    def step(
        self,
        dt: float,
        pressures: Sequence[float] | None = None,
        flows: Sequence[float] | None = None,
    ) -> Pose:
        """Return the pose ``dt`` s later, with pressures (kPa) at the valves or flows (ul/s, of a
        gas at the atmosphere) of the pumps, one a chamber. Raises DesignError.
        """
        _refuse_time(dt)
        if (pressures is None) == (flows is None):
            raise DesignError("a step takes either pressures or flows, one a chamber")
        values = np.asarray(pressures if flows is None else flows, dtype=float)
        if values.shape != (self.stack.chambers,) or not np.isfinite(values).all():
            raise DesignError(f"a step takes {self.stack.chambers} finite numbers, one a chamber")
        acts = np.array([[max(0.0, min(dt, self.time + dt - self.line.delay))]])
        if flows is None:
            supply = Supply(self.line, np.zeros((1, len(values))), acts, values[None], 0.0)
        else:
            # A pump that stands still is shut: its chamber may come to suction where a load bends
            # it open.
            supply = Supply(self.line, acts * values, acts, None, -SUCTION)
        begin = self.stack.states_of(self.pose, self.stack.acting(self.load))
        self.pose = moved(begin, supply).pose()
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
        """Put some of the states (a mask, their numbers or a slice) at the start, at 0 s."""
        self.times[where] = 0.0
        self.poses = self.poses.replaced(where, self.start)

    @property
    def tips(self) -> Array:
        """Middles of the top plates in mm: (N, 3)."""
        return self.poses.tips

    @property
    def pressures(self) -> Array:
        """Pressures in the chambers, kPa: (N, chambers)."""
        return self.poses.pressures

    @one_blas_thread
    def step(self, dt: float, pressures: ArrayLike) -> None:
        """Move on by ``dt`` s with pressures (N, chambers) in kPa at the valves. Raises
        DesignError as ``Motion.step`` does, for the first state that has no pose.
        """
        _refuse_time(dt)
        sources = self.poses.column.table(pressures, len(self.times))
        acts = np.clip(self.times + dt - self.line.delay, 0.0, dt)[:, None]
        supply = Supply(self.line, np.zeros_like(sources), acts, sources, 0.0)
        self.poses = moved(self.poses, supply)
        self.times = self.times + dt


def _refuse_time(dt: float) -> None:
    if not (np.isfinite(dt) and dt > 0):
        raise DesignError(f"dt = {dt:g} s must be above 0 s")
