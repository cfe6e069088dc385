"""Stacks in time: chambers that fill through their lines, in equilibrium at every instant.

Freedoms and pressures of many states are found together by Newton's method. States that it does not
solve soon go from equilibrium to equilibrium one by one, like all states against an outer plate.
Lengths mm, pressures kPa, volumes ul. Arrays have one row per state.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sbafab.errors import DesignError
from sbafab.models.derivatives import derivatives, tangent
from sbafab.models.film_elements import Array
from sbafab.models.pneumatics import ATMOSPHERE_KPA, Line
from sbafab.models.stack_balance import (
    CHUNK,
    LOADED_CHUNK,
    Balance,
    BatchPoses,
    Equilibria,
    Pose,
    bounded_solutions,
    is_positive_definite,
    put,
    step_limit,
)
from sbafab.models.stack_loads import Load
from sbafab.runtime import one_blas_thread

if TYPE_CHECKING:
    from sbafab.models.stack import Stack


MOTION_STEPS = 16
"""Maximum Newton steps of freedoms and pressures together."""
MOTION_ERRORS = np.array([1e-6, 1e-5])
"""Errors at which these end: mm and rad, and the share of a pressure."""
VOLUME_POWER = 0.3
"""Power of the pressure that volumes grow by, about: of balloons that stretch."""
ROUNDS = 2
"""Newton's steps of flows and contents in the first step of films."""
MOST_STEPS = 40
HALVINGS = 20
OVERSHOT = 0.5
"""Share of a step's first slope that its last one may rise to, in the line search."""
SCALE_PRESSURE = 0.01
"""Pressure in kPa below which volumes are nearly linear in pressure, above in its logarithm."""
LONGEST_STEP = 2.0
SUCTION = 90.0
"""Limit of suction in kPa for a shut chamber, before its fluid boils or leaks."""
TOLERANCE = 1e-5
LEAST_CONTENT = 20.0
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
    def _more(self) -> float:
        """Volume of a gas in the line."""
        return self.line.dead_volume + self.line.tube_volume if self.line.fluid.is_gas else 0.0

    def squeezed(self, pressures: Array) -> Array:
        """Return contents by volumes: a gas is counted at the atmosphere."""
        is_gas = self.line.fluid.is_gas
        return 1 + pressures / ATMOSPHERE_KPA if is_gas else np.ones_like(pressures)

    def with_volumes(self, volumes: Array, pressures: Array) -> Supply:
        """Return the supply of chambers that have volumes in ul at pressures before the step."""
        held = (volumes + self._more) * self.squeezed(pressures)
        return self._replace(contents=self.contents + held)

    def excess(self, volumes: Array, pressures: Array) -> tuple[Array, Array]:
        """Return by how many ul the volumes are too large, and this by pressure at equal volumes:
        (n, chambers) each.
        """
        flow = rate = np.zeros_like(pressures)
        if self.sources is not None:
            flow, rate = self.line.flows(self.sources, pressures)
        squeezed, whole = self.squeezed(pressures), volumes + self._more
        own = -self.acts * rate
        if self.line.fluid.is_gas:
            own = own + whole / ATMOSPHERE_KPA
        return whole - (self.contents + self.acts * flow) / squeezed, own / squeezed

    def at(self, where: Any) -> Supply:
        """Return that of some of the states."""
        sources = None if self.sources is None else self.sources[where]
        return self._replace(contents=self.contents[where], acts=self.acts[where], sources=sources)


class SupplyStep(NamedTuple):
    """States of a ``stack`` under a ``load`` that take in a supply."""

    stack: Stack
    load: Load | None

    def after(self, begin: Balance, pressures: Array, supply: Supply) -> tuple[Balance, Array]:
        """Return the balance and the pressures (n, chambers) in kPa after a step. Raises
        DesignError for the first state that has no pose.
        """
        stack, at, p = self.stack, begin.freedoms.copy(), pressures.copy()
        is_solved = np.zeros(len(p), dtype=bool)
        if self.load is None or self.load.wall is None:
            size = CHUNK if self.load is None else LOADED_CHUNK
            for first in range(0, len(p), size):
                part = slice(first, first + size)
                is_solved[part] = self._together(at[part], p[part], supply.at(part))
        is_solved &= stack.excess(at, self.load) <= 0
        found = Balance.of(at)
        for number in np.flatnonzero(~is_solved):
            one = slice(number, number + 1)
            start = stack.by_level(begin.freedoms[one])
            # Pumps may have left chambers under suction.
            old = stack.equilibria(pressures[one], self.load, start, sucked=True)
            alone = supply.at(one).with_volumes(old.volumes, old.pressures)
            states = stack.states_of(self._alone(stack.pose_of(old), alone), self.load)
            put(found, one, states.balance)
            p[one] = states.pressures
        return found, p

    @np.errstate(over="ignore", invalid="ignore")
    def _together(self, at: Array, p: Array, supply: Supply) -> NDArray[np.bool_]:
        """Write the freedoms (n, rows, 3) and pressures (n, chambers) after a step; return which
        states (n) are solved.

        Pressures stay at or above the least, and a chamber that would need less draws in the rest.
        """
        is_solved, live, ends = np.zeros(len(p), dtype=bool), np.arange(len(p)), (at, p)
        y, before, most = _place_of(p), np.zeros((len(p), 2)), self.stack.most_pressure
        least = float(_place_of(np.array(supply.least)))
        for number in range(MOTION_STEPS):
            try:
                now = self._linearised(at, p)
                if not number:
                    supply = supply.with_volumes(now.volumes, p)
                dy, dp = _pressure_step(now, p, y, supply, 1 if number else ROUNDS)
            except np.linalg.LinAlgError:
                break
            columns = np.concatenate([dp, np.ones((len(p), 1))], axis=1)
            move = (now.moves @ columns[..., None]).reshape(at.shape)
            share = np.minimum(1.0, LONGEST_STEP / np.maximum(np.abs(dy).max(1), 1e-12))
            share = np.minimum(share, step_limit(move).min(-1))
            at = at + share[:, None, None] * move
            y = np.maximum(y + share[:, None] * dy, least)
            after = np.minimum(_pressure_at(y), most)
            change = np.abs(after - p) / (np.abs(p) + SCALE_PRESSURE)
            largest, p = np.stack([np.abs(move).max((1, 2)), change.max(1)], axis=1), after
            is_over = (largest < MOTION_ERRORS).all(1)
            is_over |= (largest * largest < MOTION_ERRORS * before).all(1)
            goes = ~is_over & np.isfinite(largest).all(1)
            if not goes.all():
                which = live[is_over]
                ends[0][which], ends[1][which] = at[is_over], p[is_over]
                is_firm = is_positive_definite(now.matrix[is_over])
                is_solved[which] = is_firm.all(1) & (p[is_over] < most).all(1)
                if not goes.any():
                    break
                live, at, y, p, supply = live[goes], at[goes], y[goes], p[goes], supply.at(goes)
                largest, share = largest[goes], share[goes]
            before = np.where((share == 1.0)[:, None], largest, 0.0)
        return is_solved

    def _linearised(self, at: Array, p: Array) -> Linear:
        stack, count = self.stack, len(p)
        springs = stack.springs(p, True, by_level=self.load is not None, orders=3)
        now = tangent(stack, springs, self.load, at)
        volumes, filling = springs.order(at, 1)
        swelling, _ = springs.order(at, 2, with_rates=False)
        pulls = np.concatenate([filling, -now.gradient.reshape(*at.shape[:2], 1, 3)], axis=2)
        moves = now.solved(pulls.swapaxes(2, 3).reshape(count, now.gradient.shape[1], -1))
        counts = stack.row_counts[self.load is None]
        by_row = (counts[:, None, None] * filling).transpose(0, 2, 1, 3)
        filled = by_row.reshape(count, p.shape[1], -1) @ moves
        rates = filled[..., :-1] + (counts @ swelling)[..., None] * np.eye(p.shape[1])
        return Linear(now.matrix, moves, counts @ volumes, filled[..., -1], rates)

    def _alone(self, pose: Pose, supply: Supply) -> Pose:
        """Return the pose of one state after a step, from equilibrium to equilibrium.

        The excess is the gradient of one function of the pressures, whose minimum is sought:
        volumes are slopes of a concave potential, and more pressure lets less in. Newton's method
        with a line search in asinh(p / SCALE_PRESSURE), in which volumes are nearly linear.
        """
        top = self.stack.most_pressure
        ends = math.asinh(supply.least / SCALE_PRESSURE), math.asinh(top / SCALE_PRESSURE)
        close = TOLERANCE * np.maximum(np.abs(supply.contents[0]), LEAST_CONTENT)
        start = np.maximum(np.arcsinh(np.asarray(pose.pressures) / SCALE_PRESSURE), ends[0])
        now = self._tried(start, supply, pose)
        for _ in range(MOST_STEPS):
            lacks = (now.x >= ends[1]) & (now.wrong < 0)
            counts = ~((now.x <= ends[0]) & (now.wrong >= 0)) & ~lacks
            if (np.abs(now.wrong) <= close)[counts].all():
                if lacks.any():
                    raise DesignError(
                        f"the chambers would need more than {top:g} kPa; ask for less"
                    )
                return now.pose
            ahead = self._newton_step(now, counts, ends[0])
            ahead *= min(1.0, LONGEST_STEP / max(float(np.abs(ahead).max()), 1e-12))
            now = self._downhill(now, ahead, ends, supply)
        raise DesignError(
            "no equilibrium of the stack found at the end of this step; try a shorter one"
        )

    def _downhill(
        self, now: PoseTrial, ahead: Array, ends: tuple[float, float], supply: Supply
    ) -> PoseTrial:
        """Return the trial at the end of a step's descent, by a line search."""
        steep = float(now.wrong @ (now.rates * ahead))
        share = 1.0
        for _ in range(HALVINGS):
            x = np.clip(now.x + share * ahead, *ends)
            try:
                tried = self._tried(x, supply, now.pose)
            except DesignError:
                share /= 2
                continue
            still = (x > ends[0]) & (x < ends[1])
            slope = float((tried.wrong * tried.rates * ahead)[still].sum())
            if slope <= -OVERSHOT * steep:
                return tried
            share *= min(max(steep / (steep - slope), 0.1), 0.7)
        return tried

    def _tried(self, x: Array, supply: Supply, near: Pose) -> PoseTrial:
        pressures = np.minimum(SCALE_PRESSURE * np.sinh(x), self.stack.most_pressure)[None]
        start = near.freedoms[None]
        states = self.stack.equilibria(pressures, self.load, start, sucked=True)
        wrong, own = supply.excess(states.volumes, pressures)
        pose = self.stack.pose_of(states)
        return PoseTrial(x, pose, wrong[0], own[0], SCALE_PRESSURE * np.cosh(x))

    def _newton_step(self, now: PoseTrial, counts: NDArray[np.bool_], least: float) -> Array:
        """Return Newton's step by x of the active chambers; 0 of the others."""
        rates = derivatives(self.stack, now.pose, self.load, sucked=True).by_pressure.volumes
        slopes, which = rates + np.diag(now.own), np.flatnonzero(counts)
        while True:
            ahead = np.zeros_like(now.x)
            matrix = slopes[np.ix_(which, which)]
            values, vectors = np.linalg.eigh((matrix + matrix.T) / 2)
            values = np.maximum(np.abs(values), 1e-9 * np.abs(values).max(initial=0.0) + 1e-12)
            step = -(vectors @ ((vectors.T @ now.wrong[which]) / values))
            ahead[which] = step / now.rates[which]
            may = (now.x[which] > least) | (ahead[which] >= 0)
            if may.all():
                return ahead
            # Chambers at their least pressure stay; only the others move.
            which = which[may]


class Linear(NamedTuple):
    """n states linearised: the tangent stiffness (n, groups, size, size), the ``moves`` (n,
    freedoms, chambers + 1) by each pressure and to equilibrium, the volumes (n, chambers) in ul and
    their changes to equilibrium, and the rates of these by pressures (n, chambers, chambers).
    """

    matrix: Array
    moves: Array
    volumes: Array
    settling: Array
    rates: Array


class PoseTrial(NamedTuple):
    """A trial pose: ``x``, asinh(p / SCALE_PRESSURE) of the chambers; the excess of their volumes
    in ul (``wrong``), its rates by pressure at equal volumes (``own``); and kPa by x (``rates``).
    """

    x: Array
    pose: Pose
    wrong: Array
    own: Array
    rates: Array


def _place_of(pressures: Array) -> Array:
    """Return the coordinate of pressures in which volumes are nearly linear."""
    return np.sinh(VOLUME_POWER * np.arcsinh(pressures / SCALE_PRESSURE))


def _pressure_at(places: Array) -> Array:
    """Return the pressures of coordinates."""
    return SCALE_PRESSURE * np.sinh(np.arcsinh(places) / VOLUME_POWER)


def _pressure_rate(pressures: Array, places: Array) -> Array:
    """Return the rates of pressures by their coordinates."""
    return np.hypot(pressures, SCALE_PRESSURE) / (VOLUME_POWER * np.hypot(1.0, places))


def _pressure_step(
    now: Linear, p: Array, y: Array, supply: Supply, rounds: int
) -> tuple[Array, Array]:
    """Return the step of the pressures' coordinates (n, chambers), and of the pressures to first
    order.

    With the freedoms' own steps put in, the volumes' rates by pressure are a matrix that is
    symmetric and positive definite.
    """
    first_rate = rate = _pressure_rate(p, y)
    total, at, place, ahead = np.zeros_like(p), p, y, now.volumes + now.settling
    for number in range(rounds):
        if number:
            place = np.maximum(y + total / first_rate, float(_place_of(np.array(supply.least))))
            at = _pressure_at(place)
            rate = _pressure_rate(at, place)
            total = (place - y) * first_rate
            ahead = now.volumes + now.settling + (now.rates @ total[..., None])[..., 0]
        wrong, own = supply.excess(ahead, at)
        whole = now.rates + (own * (rate / first_rate))[..., None] * np.eye(p.shape[1])
        least = np.where(at <= supply.least, 0.0, -np.inf)
        total = total + bounded_solutions(whole, -wrong, least, np.full_like(least, np.inf))
    return total / first_rate, total


@dataclass
class Motion:
    """A moving stack: ``step`` it, then read ``pose``, ``time`` and ``sources``.

    ``time`` is in s, ``sources`` the pressure in kPa at each chamber's valve or pump; ``line``
    feeds each chamber. Quasi-static: film and fluid have no inertia. ``load`` are keyword arguments
    of ``Stack.pose`` beside pressures. A gas that is pumped fills the line's dead volume and tube
    as well.
    """

    stack: Stack
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
        stack, load = self.stack, self.stack.acting(self.load)
        begin = stack.states_of(self.pose, load)
        found, p = SupplyStep(stack, load).after(begin.balance, begin.pressures, supply)
        self.pose = stack.pose_of(stack.settled(p, found, load, sucked=True))
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
    """N moving stacks, as ``Motion``: ``step`` them, then read ``pressures``, ``tips``, ``times``.

    ``balance`` and ``pressures`` (N, chambers) in kPa are their states, ``start`` the first one;
    ``times`` (N,) in s; ``line`` feeds each chamber.
    """

    stack: Stack
    line: Line
    load: Load | None
    start: Equilibria
    balance: Balance
    pressures: Array
    times: Array

    def restart(self, where: Any) -> None:
        """Put some of the states (a mask, their numbers or a slice) at the start, at 0 s."""
        self.times[where] = 0.0
        put(self.balance, where, self.start.balance)
        self.pressures[where] = self.start.pressures

    @property
    def tips(self) -> Array:
        """Middles of the top plates in mm: (N, 3)."""
        return self.stack.tips(self.balance.freedoms)

    @property
    def poses(self) -> BatchPoses:
        """The poses now."""
        return self.stack.poses_of(self.stack.settled(self.pressures, self.balance, self.load))

    @one_blas_thread
    def step(self, dt: float, pressures: ArrayLike) -> None:
        """Move on by ``dt`` s with pressures (N, chambers) in kPa at the valves. Raises
        DesignError as ``Motion.step`` does, for the first state that has no pose.
        """
        _refuse_time(dt)
        sources = self.stack.table(pressures, len(self.times))
        acts = np.clip(self.times + dt - self.line.delay, 0.0, dt)[:, None]
        supply = Supply(self.line, np.zeros_like(sources), acts, sources, 0.0)
        step = SupplyStep(self.stack, self.load)
        self.balance, self.pressures = step.after(self.balance, self.pressures, supply)
        self.times += dt


def _refuse_time(dt: float) -> None:
    if not (np.isfinite(dt) and dt > 0):
        raise DesignError(f"dt = {dt:g} s must be above 0 s")
