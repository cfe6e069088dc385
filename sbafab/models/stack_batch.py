"""Many states of one stack at once: poses, inverse kinematics, and motions as chambers fill through
their lines.

The same equilibria as in ``Stack.pose`` and ``Motion``, by Newton's method for all states at once;
states that it does not solve soon are solved one by one, like all states against an outer plate.
Without a load levels of equal balloons are equal, and a state has one row per kind of balloon;
under a load it has one row per level. Lengths mm, pressures kPa, volumes ul.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sbafab.errors import DesignError
from sbafab.models.balloon_map import refuse_outside
from sbafab.models.batch_balance import Levels, LevelsAt, descended, step_share
from sbafab.models.batch_loads import STRAIGHT, chain_of, solved
from sbafab.models.batch_reach import BatchReach
from sbafab.models.film_elements import Array
from sbafab.models.pneumatics import ATMOSPHERE_KPA, Line
from sbafab.models.reach import P0
from sbafab.models.stack import LONGEST_STEP, SCALE_PRESSURE, Motion, Stack
from sbafab.models.stack_loads import Load
from sbafab.models.stack_poses import NO_LOAD, Pose
from sbafab.process import one_blas_thread

MOTION_STEPS = 16
"""Maximum Newton steps for a motion before a state is solved alone."""
MOTION_ERRORS = np.array([[1e-6], [1e-5]])
"""Errors at which a step of a motion ends: mm and rad, and the share of a pressure."""
VOLUME_POWER = 0.3
"""Power of the pressure that volumes grow by, about: of balloons that stretch."""
ROUNDS = 2
"""Newton's steps of flows and contents in the first step of films."""
CHUNK, LOADED_CHUNK = 1024, 512
"""States solved together, without and with a load: more bring no speed, and cost memory."""


class LevelRun(NamedTuple):
    """Neighbouring levels with equal freedoms: the row of these, and the number of ``levels``."""

    row: int
    levels: int


@dataclass(frozen=True, eq=False)
class BatchPoses:
    """N poses of a stack at ``pressures`` (N, chambers) in kPa.

    ``freedoms`` (N, levels, 3) are rise in mm and tilt in rad of each level; ``volumes``
    (N, chambers) ul; ``tips`` (N, 3) the middles of the top plates in mm; ``forces`` (N,) N on an
    outer plate.
    """

    pressures: Array
    freedoms: Array
    volumes: Array
    tips: Array
    forces: Array

    @property
    def heights(self) -> Array:
        """Heights of the middles of the top plates above the base in mm: (N,)."""
        return np.asarray(self.tips[:, 2])

    @cached_property
    def bends(self) -> Array:
        """Degrees from base to top, along the stack: (N,)."""
        return np.asarray(np.degrees(np.hypot(*self.freedoms[:, :, 1:].sum(1).T)))


class _State(NamedTuple):
    """N states in columns: freedoms (rows, 3, N) and pressures (chambers, N)."""

    freedoms: Array
    pressures: Array

    def at(self, where: Any) -> _State:
        """Return some of the states."""
        return _State(self.freedoms[:, :, where], self.pressures[:, where])


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
        asked = self.table(pressures)
        if asked.size:
            refuse_outside(asked, self.stack.most_pressure)
        if near is not None and len(near.freedoms) != len(asked):
            raise DesignError(
                f"near has {len(near.freedoms)} poses for {len(asked)} states; give one a state"
            )
        acting = self.load(load)
        if acting is not None:
            return self._loaded_poses(asked, near, load, acting)
        p = np.ascontiguousarray(asked.T)
        if near is None:
            rises = [kind.rises(p).T @ self.stack.planes for kind in self.stack.maps]
            start = np.stack([rise.T for rise in rises])
        else:
            start = near.freedoms[:, self.stack.first_levels].transpose(1, 2, 0)
        freedoms = np.empty((len(self.stack.maps), 3, len(asked)))
        volumes = np.empty((self.stack.chambers, len(asked)))

        for part in _parts(len(asked)):
            freedoms[:, :, part], volumes[:, part] = self._free_poses(p[:, part], start[:, :, part])
        for number in np.flatnonzero(np.isnan(volumes[0])):
            alone = self.stack.pose(tuple(asked[number].tolist()))
            freedoms[:, :, number] = alone.freedoms[self.stack.first_levels]
            volumes[:, number] = alone.volumes
        tips, none = self.tips(freedoms), np.zeros(len(asked))
        return BatchPoses(asked, self.every_level(freedoms), volumes.T, tips, none)

    @one_blas_thread
    def reach(self, tips: ArrayLike, most_pressure: float | None = None, **load: Any) -> BatchPoses:
        """Return poses whose tips stand at places (N, 3) in mm, those that ``Stack.reach`` finds
        one by one, with pressures from 0 to ``most_pressure`` in kPa.

        ``load`` are keyword arguments of ``Stack.pose`` beside pressures. Raises UnreachableError
        and DesignError as ``Stack.reach`` does, for the first place that is not met.
        """
        places = _places(tips)
        most, acting = self.stack.reach_limit(most_pressure), self.load(load)
        found = BatchReach(self.stack, acting, math.asinh(most / P0)).reached(places)
        freedoms, pressures, volumes, pushes = found
        for number in np.flatnonzero(np.isnan(volumes[0])).tolist():
            pose = self.stack.reach(places[number].tolist(), most, **load)
            freedoms[..., number], pushes[number] = pose.freedoms, 1000 * pose.force
            pressures[:, number], volumes[:, number] = pose.pressures, pose.volumes
        return BatchPoses(
            pressures.T,
            freedoms.transpose(2, 0, 1),
            volumes.T,
            chain_of(freedoms, self.stack.pitch).tip.T,
            pushes / 1000,
        )

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
        start = self.stack.pose((0.0,) * self.stack.chambers if pressures is None else pressures)
        return BatchMotion.of(self, line or Line(), load, start, count)

    @cached_property
    def levels(self) -> Levels:
        """The rows of a state without a load."""
        return Levels.of(self.stack, None)

    @cached_property
    def runs(self) -> tuple[LevelRun, ...]:
        """Runs of equal levels, bottom to top."""
        each = groupby(self.stack.levels.tolist())
        return tuple(LevelRun(kind, sum(1 for _ in levels)) for kind, levels in each)

    def load(self, arguments: dict[str, Any]) -> Load | None:
        """Return the load that arguments of ``Stack.pose`` are. Raises DesignError."""
        unknown = sorted(set(arguments) - set(NO_LOAD))
        if unknown:
            raise DesignError(
                f"a load has no {unknown[0]}; give tip_load, gravity or plate, as of Stack.pose"
            )
        return self.stack.load(*(arguments.get(name, value) for name, value in NO_LOAD.items()))

    def tips(self, freedoms: Array) -> Array:
        """Return the middles of the top plates in mm of freedoms (kinds, 3, N): (N, 3).

        Equal levels turn about one axis: their plates stand on a circle, whose sums are closed.
        """
        tip = np.zeros((3, freedoms.shape[2]))
        # From the top down: each run carries and turns all beyond it.
        for number, run in enumerate(reversed(self.runs)):
            rise, x, y = freedoms[run.row]
            square = np.maximum(x * x + y * y, STRAIGHT)
            angle = np.sqrt(square)
            whole = run.levels * angle
            sine, cosine = np.sin(whole), np.cos(whole)
            if number:
                # Rodrigues' formula.
                along, less = (x * tip[0] + y * tip[1]) / square, 1 - cosine
                turned = sine / angle
                tip = np.stack(
                    [
                        cosine * tip[0] + turned * y * tip[2] + less * along * x,
                        cosine * tip[1] - turned * x * tip[2] + less * along * y,
                        cosine * tip[2] + turned * (x * tip[1] - y * tip[0]),
                    ]
                )
            share = (rise + self.stack.pitch) / (2 * np.sin(angle / 2))
            aside = share * 2 * np.sin(whole / 2) ** 2 / angle
            tip[0] += y * aside
            tip[1] -= x * aside
            tip[2] += share * sine
        return tip.T

    def every_level(self, freedoms: Array) -> Array:
        """Return freedoms (kinds, 3, N) as (N, levels, 3)."""
        return np.asarray(freedoms.transpose(2, 0, 1)[:, self.stack.levels])

    def table(self, pressures: ArrayLike, rows: int | None = None) -> Array:
        """Return pressures (rows, chambers) in kPa. Raises DesignError if they are invalid."""
        try:
            table = np.asarray(pressures, dtype=float)
        except (TypeError, ValueError):
            table = np.zeros(0)
        shape = (len(table) if rows is None and table.ndim else rows, self.stack.chambers)
        if table.shape != shape or not np.isfinite(table).all():
            states = "a row a state" if rows is None else f"{rows} rows"
            raise DesignError(
                f"pressures in kPa must be finite numbers, {states} of {self.stack.chambers}"
            )
        return table

    def _loaded_poses(
        self, pressures: Array, near: BatchPoses | None, load: dict[str, Any], acting: Load
    ) -> BatchPoses:
        """Return the poses under a load; against an outer plate one by one."""
        count, levels = len(pressures), len(self.stack.levels)
        freedoms, volumes = (
            np.empty((levels, 3, count)),
            np.full((count, self.stack.chambers), np.nan),
        )
        rows, forces = Levels.of(self.stack, acting), np.zeros(count)
        if acting.wall is None:
            start = self._starts(pressures) if near is None else near.freedoms
            for part in _parts(count, LOADED_CHUNK):
                p = np.ascontiguousarray(pressures[part].T)
                weights = rows.weights(p, 2)
                end = freedoms[:, :, part]
                begin = np.ascontiguousarray(start[part].transpose(1, 2, 0))
                is_solved = descended(rows, weights[:, :1], begin, end)
                is_solved &= rows.fits(self.stack.centres, end)
                found = rows.at(weights, end).volumes.T
                volumes[part] = np.where(is_solved[:, None], found, np.nan)
        for number in np.flatnonzero(np.isnan(volumes[:, 0])):
            like = None if near is None else self.stack.pose_like(near.freedoms[number])
            alone = self.stack.pose(pressures[number].tolist(), near=like, **load)
            freedoms[:, :, number], volumes[number] = alone.freedoms, alone.volumes
            forces[number] = alone.force
        tips = rows.tips(freedoms)
        return BatchPoses(pressures, freedoms.transpose(2, 0, 1), volumes, tips, forces)

    def _starts(self, pressures: Array) -> Array:
        """Return freedoms (N, levels, 3) to start from, as of ``Stack.pose``."""
        rises = [kind.rises(pressures.T).T @ self.stack.planes for kind in self.stack.maps]
        return np.stack(rises, axis=1)[:, self.stack.levels]

    def _free_poses(self, pressures: Array, start: Array) -> tuple[Array, Array]:
        """Return freedoms (kinds, 3, n) and volumes (chambers, n), NaN where none are found."""
        freedoms, total = np.empty_like(start), np.zeros_like(pressures)
        weights = self.levels.weights(pressures, 2)
        for kind, count in enumerate(self.levels.counts):
            one, end = self.levels.alone(kind), freedoms[kind : kind + 1]
            is_solved = descended(one, weights[:, :1], start[kind : kind + 1], end)
            volumes = one.at(weights, end).volumes
            is_solved &= one.fits(self.stack.centres, end)
            total += count * np.where(is_solved, volumes, np.nan)
        total[:, np.isnan(total[0])] = np.nan
        return freedoms, total


def _parts(count: int, size: int = CHUNK) -> list[slice]:
    """Return the parts of ``count`` states that are solved together."""
    return [slice(begin, begin + size) for begin in range(0, count, size)]


def batch_of(pressures: Array, poses: Sequence[Pose]) -> BatchPoses:
    """Return poses as a batch."""
    levels = len(poses[0].freedoms) if poses else 0
    return BatchPoses(
        pressures,
        np.array([pose.freedoms for pose in poses]).reshape(-1, levels, 3),
        np.array([pose.volumes for pose in poses]).reshape(pressures.shape),
        np.array([pose.tip for pose in poses]).reshape(-1, 3),
        np.array([pose.force for pose in poses]),
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


@dataclass(eq=False)
class BatchMotion:
    """N moving stacks, as ``Motion``: ``step`` them, then read ``pressures``, ``tips``, ``times``.

    ``state`` are freedoms (rows, 3, N) of ``levels`` and pressures (chambers, N); ``times`` (N,) in
    s; ``line`` feeds each chamber. Against an outer plate the states are ``alone``, a motion each.
    """

    batch: StackBatch
    line: Line
    load: dict[str, Any]
    start: Pose
    state: _State
    times: Array
    levels: Levels
    alone: list[Motion]

    @classmethod
    def of(
        cls, batch: StackBatch, line: Line, load: dict[str, Any], start: Pose, count: int
    ) -> BatchMotion:
        """Return ``count`` motions from a pose without load."""
        stack, levels, alone = batch.stack, batch.levels, []
        acting = batch.load(load)
        if acting is not None:
            start = stack.pose(start.pressures, **load)
            levels = Levels.of(stack, acting)
            if acting.wall is not None:
                alone = [Motion(stack, line, load, start) for _ in range(count)]
        shape = (len(levels.kinds), 3, count), (stack.chambers, count)
        state = _State(np.empty(shape[0]), np.empty(shape[1]))
        motion = cls(batch, line, load, start, state, np.zeros(count), levels, alone)
        motion.restart(slice(None))
        return motion

    def restart(self, where: Any) -> None:
        """Put some of the states (a mask, their numbers or a slice) at the start, at 0 s."""
        self.times[where] = 0.0
        self.state.freedoms[:, :, where] = self._rows(self.start)[:, :, None]
        self.state.pressures[:, where] = np.array(self.start.pressures)[:, None]
        if self.alone:
            for number in np.arange(len(self.times))[where].tolist():
                self.alone[number] = Motion(self.batch.stack, self.line, self.load, self.start)

    def _rows(self, pose: Pose) -> Array:
        """Return the freedoms (rows, 3) of a pose."""
        is_free = self.levels.load is None
        return pose.freedoms[self.batch.stack.first_levels] if is_free else pose.freedoms

    @property
    def pressures(self) -> Array:
        """Pressures in the chambers in kPa: (N, chambers)."""
        if self.alone:
            return np.array([motion.pressures for motion in self.alone])
        return self.state.pressures.T.copy()

    @property
    def tips(self) -> Array:
        """Middles of the top plates in mm: (N, 3)."""
        if self.alone:
            return np.array([motion.pose.tip for motion in self.alone])
        if self.levels.load is not None:
            return self.levels.tips(self.state.freedoms)
        return self.batch.tips(self.state.freedoms)

    @property
    def poses(self) -> BatchPoses:
        """The poses now."""
        if self.alone:
            return batch_of(self.pressures, [motion.pose for motion in self.alone])
        freedoms, pressures = self.state
        volumes = self.levels.at(self.levels.weights(pressures, 2), freedoms).volumes
        if self.levels.load is None:
            each = self.batch.every_level(freedoms)
        else:
            each = freedoms.transpose(2, 0, 1)
        return BatchPoses(self.pressures, each, volumes.T, self.tips, np.zeros(len(self.times)))

    @one_blas_thread
    def step(self, dt: float, pressures: ArrayLike) -> None:
        """Move on by ``dt`` s with pressures (N, chambers) in kPa at the valves. Raises
        DesignError as ``Motion.step`` does, for the first state that has no pose.
        """
        if not (np.isfinite(dt) and dt > 0):
            raise DesignError(f"dt = {dt:g} s must be above 0 s")
        count = len(self.times)
        valves = self.batch.table(pressures, count)
        if self.alone:
            for motion, row in zip(self.alone, valves.tolist(), strict=True):
                motion.step(dt, pressures=row)
            self.times += dt
            return
        sources = np.ascontiguousarray(valves.T)
        acts = np.clip(self.times + dt - self.line.delay, 0.0, dt)
        is_solved = np.zeros(count, dtype=bool)
        ahead = _State(np.empty_like(self.state.freedoms), np.empty_like(self.state.pressures))

        for part in _parts(count, CHUNK if self.levels.load is None else LOADED_CHUNK):
            state = self.state.at(part)
            is_solved[part], after = self._stepped(state, acts[part], sources[:, part])
            ahead.freedoms[:, :, part], ahead.pressures[:, part] = after
        for number in np.flatnonzero(~is_solved).tolist():
            pose = self._pose_after(number, dt, valves[number])
            ahead.freedoms[:, :, number] = self._rows(pose)
            ahead.pressures[:, number] = pose.pressures
        self.state = ahead
        self.times += dt

    def _pose_after(self, number: int, dt: float, valves: Array) -> Pose:
        """Return the pose of one state after a step, solved alone."""
        stack = self.batch.stack
        state = self.state.at(number)
        is_free = self.levels.load is None
        like = stack.pose_like(state.freedoms[stack.levels] if is_free else state.freedoms)
        begin = stack.pose(tuple(state.pressures.tolist()), near=like, **self.load)
        motion = Motion(stack, self.line, self.load, begin, float(self.times[number]))
        return motion.step(dt, pressures=valves.tolist())

    def _stepped(
        self, begin: _State, acts: Array, sources: Array
    ) -> tuple[NDArray[np.bool_], _State]:
        """Return True (n) where states are solved, and the states (n) after ``acts`` s with
        pressures (chambers, n) at the valves.

        Newton's method for freedoms and pressures at once, as in ``Motion``: pressures stay at or
        above 0, and a chamber that would need less draws in the rest.
        """
        count, most = len(acts), self.batch.stack.most_pressure
        end = _State(begin.freedoms.copy(), begin.pressures.copy())
        is_solved, live = np.zeros(count, dtype=bool), np.arange(count)
        (at, p), before = begin, np.zeros((2, count))
        y = _place_of(p)
        contents = np.zeros(0)
        for number in range(MOTION_STEPS):
            now = self.levels.at(self.levels.weights(p, 3), at)
            if not number:
                contents = self._volumes(now) * self._squeezed(p)
            moves, dy, is_firm = self._newton_step(
                now, p, y, contents, acts, sources, 1 if number else ROUNDS
            )
            share = np.minimum(1.0, LONGEST_STEP / np.maximum(np.abs(dy).max(0), 1e-12))
            share = np.minimum(share, step_share(moves))
            at = at + share * moves
            y = np.maximum(y + share * dy, 0.0)
            after = np.minimum(_pressure_at(y), most)
            change = np.abs(after - p) / (p + SCALE_PRESSURE)
            largest = np.stack([np.abs(moves).max((0, 1)), change.max(0)])
            p = after
            still = (largest < MOTION_ERRORS).all(0)
            if self.levels.load is None:
                # Under a load the error falls linearly (``LOADED_STEP``).
                still |= (largest * largest < MOTION_ERRORS * before).all(0)
            still &= is_firm
            rest = ~still & is_firm
            if not rest.all():
                which = live[still]
                end.freedoms[:, :, which] = at[:, :, still]
                end.pressures[:, which] = p[:, still]
                is_solved[which] = self._fits(at[:, :, still], p[:, still])
                if not rest.any():
                    break
                live, at, y, p = live[rest], at[:, :, rest], y[:, rest], p[:, rest]
                contents, acts, sources = contents[:, rest], acts[rest], sources[:, rest]
                largest, share = largest[:, rest], share[rest]
            before = np.where(share == 1.0, largest, 0.0)
        return is_solved, end

    def _fits(self, freedoms: Array, pressures: Array) -> NDArray[np.bool_]:
        """Return True (n) if balloons are within their maps' heights, pressures below the end."""
        fits = (pressures < self.batch.stack.most_pressure).all(0)
        return np.asarray(fits & self.levels.fits(self.batch.stack.centres, freedoms))

    def _volumes(self, now: LevelsAt) -> Array:
        """Return the volumes of the chambers in ul, of a gas with its line: (chambers, n)."""
        more = self.line.dead_volume + self.line.tube_volume if self.line.fluid.is_gas else 0.0
        return now.volumes + more

    def _squeezed(self, pressures: Array) -> Array | float:
        """Return contents by volumes: a gas is counted at the atmosphere."""
        return 1 + pressures / ATMOSPHERE_KPA if self.line.fluid.is_gas else 1.0

    def _newton_step(
        self,
        at: LevelsAt,
        p: Array,
        y: Array,
        contents: Array,
        acts: Array,
        sources: Array,
        rounds: int,
    ) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Return the step of freedoms (rows, 3, n) and of pressures (chambers, n), and True (n)
        where the tangent stiffness is positive definite.

        With the freedoms' own steps put in, the volumes' rates by pressure are a matrix that is
        symmetric and positive definite.
        """
        filling = at.filling.transpose(0, 2, 1, 3)
        pulls = np.concatenate([filling, -at.gradient[:, :, None]], axis=2)
        moved, is_firm = at.solved(pulls)
        counts = self.levels.counts[:, None, None, None]
        filled = np.einsum("ricn,rijn->cjn", counts * filling, moved)
        matrix, settled = filled[:, :-1], filled[:, -1]
        np.einsum("iin->in", matrix)[:] += at.swelling
        total = np.zeros_like(p)
        now, place, rate = p, y, _pressure_rate(p, y)
        first_rate, volumes = rate, self._volumes(at) + settled
        ahead = volumes
        for number in range(rounds):
            if number:
                place = np.maximum(y + total / first_rate, 0.0)
                now = _pressure_at(place)
                rate = _pressure_rate(now, place)
                total = (place - y) * first_rate
                ahead = volumes + np.einsum("cdn,dn->cn", matrix, total)
            flow, flow_rate = self.line.flows(sources, now)
            squeezed, own = self._squeezed(now), -acts * flow_rate
            if self.line.fluid.is_gas:
                own += ahead / ATMOSPHERE_KPA
            wrong = ahead - (contents + acts * flow) / squeezed
            more = own / squeezed * (rate / first_rate)
            total = total + _free_step(matrix, more, -wrong, now <= 0)
        moves = moved[:, :, -1] + np.einsum("rijn,jn->rin", moved[:, :, :-1], total)
        return moves, total / first_rate, is_firm


def _place_of(pressures: Array) -> Array:
    """Return the coordinate of pressures in which volumes are nearly linear."""
    return np.sinh(VOLUME_POWER * np.arcsinh(pressures / SCALE_PRESSURE))


def _pressure_at(places: Array) -> Array:
    """Return the pressures of coordinates."""
    return SCALE_PRESSURE * np.sinh(np.arcsinh(places) / VOLUME_POWER)


def _pressure_rate(pressures: Array, places: Array) -> Array:
    """Return the rates of pressures by their coordinates."""
    return np.hypot(pressures, SCALE_PRESSURE) / (VOLUME_POWER * np.hypot(1.0, places))


def _free_step(matrix: Array, more: Array, right: Array, at_end: NDArray[np.bool_]) -> Array:
    """Return the solutions (size, n) of matrices with ``more`` on their diagonals; entries
    ``at_end`` (size, n) may not fall.
    """
    whole = matrix.copy()
    np.einsum("iin->in", whole)[:] += more
    step = solved(whole, right[:, None])[0][:, 0]
    if not at_end.any():
        return step
    held = np.zeros_like(at_end)
    for _ in range(len(more)):
        falls = at_end & ~held & ((step < 0) | (right <= 0))
        if not falls.any():
            break
        held |= falls
        free = ~held
        reduced = whole * (free[:, None] & free[None])
        np.einsum("iin->in", reduced)[held] = 1.0
        step = solved(reduced, np.where(free, right, 0.0)[:, None])[0][:, 0]
    return step
