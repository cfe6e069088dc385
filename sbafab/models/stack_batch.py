"""Many states of one stack at once: poses, and motions as chambers fill through their lines.

The same equilibria as of ``Stack.pose`` and ``Motion``, by Newton's method for all states in one
step; states that it does not solve soon are solved one by one. Without a load levels of equal
balloons are equal, and a state has a row a kind of balloon. Under a load states are solved one by
one. Lengths mm, pressures kPa, volumes ul.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from sbafab.errors import DesignError
from sbafab.models.balloon_map import (
    CURVES,
    DEGREE,
    PIECES,
    PIECES_IN_ALL,
    PRESSURE_SPANS,
    SLOPES,
    pieces,
)
from sbafab.models.least_energy import LARGEST_MOVE
from sbafab.models.pneumatics import ATMOSPHERE_KPA, Line
from sbafab.models.stack import LONGEST_STEP, SCALE_PRESSURE, Motion
from sbafab.models.stack_loads import RING_POINTS
from sbafab.models.stack_poses import NO_LOAD, Pose

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from sbafab.models.balloon_map import BalloonMap
    from sbafab.models.film_elements import Array
    from sbafab.models.stack import Stack
    from sbafab.models.stack_poses import PosedStack

POSE_STEPS, MOTION_STEPS = 40, 16
"""Most of Newton's steps of a pose and of a motion before a state is solved alone."""
RESIDUAL = 1e-7
"""Residual in mN (or mN mm) that counts as none."""
POSE_ERROR = 1e-9
"""Error (mm, rad) at which a pose ends."""
MOTION_ERRORS = np.array([[1e-6], [1e-5]])
"""Errors at which a step of a motion ends: mm and rad, and the share of a pressure."""
HALVINGS = 12
VOLUME_POWER = 0.3
"""Power of the pressure that volumes grow by, about: of balloons that stretch."""
ROUNDS = 2
"""Newton's steps of flows and contents in the first step of films."""
STRAIGHT = 1e-24
"""Square of a tilt in rad that is taken for 0."""
CHUNK = 1024
"""States solved together: more are no faster, and take more memory."""
BY_PRESSURE = np.zeros((3, DEGREE + 1, DEGREE + 1))
BY_PRESSURE[0], BY_PRESSURE[1, :, :-1], BY_PRESSURE[2, :, :-2] = PIECES, SLOPES, CURVES
"""Splines' weights by pressure: of values, first and second derivatives."""
LEAST_PIVOT = 1e-12
"""Pivot, as a share of the largest, below which a matrix counts as indefinite."""


class LevelRun(NamedTuple):
    """Neighbouring levels with equal freedoms: the row of these, and the number of ``levels``."""

    row: int
    levels: int


@dataclass(frozen=True, eq=False)
class BatchPoses:
    """N poses of a stack at ``pressures`` (N, chambers) in kPa.

    ``freedoms`` (N, levels, 3) are rise in mm and tilt in rad of each level; ``volumes``
    (N, chambers) ul; ``tips`` (N, 3) the middles of the top plates in mm.
    """

    pressures: Array
    freedoms: Array
    volumes: Array
    tips: Array

    @property
    def heights(self) -> Array:
        """Heights of the middles of the top plates above the base in mm: (N,)."""
        return np.asarray(self.tips[:, 2])

    @cached_property
    def bends(self) -> Array:
        """Degrees from base to top, along the stack: (N,)."""
        return np.asarray(np.degrees(np.hypot(*self.freedoms[:, :, 1:].sum(1).T)))


class _State(NamedTuple):
    """N states in columns: freedoms (kinds, 3, N) and pressures (chambers, N)."""

    freedoms: Array
    pressures: Array

    def at(self, where: Any) -> _State:
        """Return some of the states."""
        return _State(self.freedoms[:, :, where], self.pressures[:, where])


@dataclass(frozen=True, eq=False)
class StackBatch:
    """Many states of one ``stack``, solved together."""

    stack: Stack

    def poses(
        self, pressures: ArrayLike, near: BatchPoses | None = None, **load: Any
    ) -> BatchPoses:
        """Return the equilibrium poses at pressures (N, chambers) in kPa.

        ``near`` are N poses to start from; ``load`` are keyword arguments of ``Stack.pose`` beside
        pressures. Raises DesignError as ``Stack.pose`` does, for the first state that has no pose.
        """
        asked = self.table(pressures)
        most = self.stack.most_pressure
        if asked.size and not (asked.min() >= 0 and asked.max() <= most):
            worst = asked.max() if asked.min() >= 0 else asked.min()
            raise DesignError(
                f"a pressure of {float(worst):g} kPa is outside the balloon's map; give 0 to "
                f"{self.stack.most_pressure:g} kPa"
            )
        if near is not None and len(near.freedoms) != len(asked):
            raise DesignError(
                f"near has {len(near.freedoms)} poses for {len(asked)} states; give one a state"
            )
        if self.is_loaded(load):
            return self._one_by_one(asked, near, load)
        p = np.ascontiguousarray(asked.T)
        if near is None:
            rises = [kind.rises(p).T @ self.stack.planes for kind in self.stack.maps]
            start = np.stack([rise.T for rise in rises])
        else:
            start = near.freedoms[:, self.stack.first_levels].transpose(1, 2, 0)
        freedoms = np.empty((len(self.springs), 3, len(asked)))
        volumes = np.empty((self.stack.chambers, len(asked)))

        for part in _parts(len(asked)):
            freedoms[:, :, part], volumes[:, part] = self._free_poses(p[:, part], start[:, :, part])
        for number in np.flatnonzero(np.isnan(volumes[0])):
            alone = self.stack.pose(tuple(asked[number].tolist()))
            freedoms[:, :, number] = alone.freedoms[self.stack.first_levels]
            volumes[:, number] = alone.volumes
        return BatchPoses(asked, self.every_level(freedoms), volumes.T, self.tips(freedoms))

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
    def springs(self) -> tuple[BatchSprings, ...]:
        """Springs of each kind of balloon."""
        return tuple(BatchSprings.of(self.stack, kind) for kind in range(len(self.stack.maps)))

    @cached_property
    def counts(self) -> NDArray[np.int_]:
        """Number of levels of each kind of balloon."""
        return np.bincount(self.stack.levels, minlength=len(self.stack.maps))

    @cached_property
    def runs(self) -> tuple[LevelRun, ...]:
        """Runs of equal levels, bottom to top."""
        each = groupby(self.stack.levels.tolist())
        return tuple(LevelRun(kind, sum(1 for _ in levels)) for kind, levels in each)

    def is_loaded(self, load: dict[str, Any]) -> bool:
        """Return True if the arguments of ``Stack.pose`` are a load. Raises DesignError."""
        unknown = sorted(set(load) - set(NO_LOAD))
        if unknown:
            raise DesignError(
                f"a load has no {unknown[0]}; give tip_load, gravity or plate, as of Stack.pose"
            )
        values = (load.get(name, value) for name, value in NO_LOAD.items())
        return self.stack.load(*values) is not None

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
        """Return pressures (rows, chambers) in kPa. Raises DesignError where they are no such."""
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

    def _one_by_one(
        self, pressures: Array, near: BatchPoses | None, load: dict[str, Any]
    ) -> BatchPoses:
        poses = []
        for number, row in enumerate(pressures.tolist()):
            start = None if near is None else self.pose_like(near.freedoms[number])
            poses.append(self.stack.pose(row, near=start, **load))
        return batch_of(pressures, poses)

    def pose_like(self, freedoms: Array, pressures: Sequence[float] = ()) -> Pose:
        """Return a pose with freedoms (levels, 3) to start from: not in equilibrium."""
        none = np.zeros(0)
        return Pose(tuple(pressures), freedoms, none, none, 0.0, 0.0, True, self.stack.pitch)

    def _free_poses(self, pressures: Array, start: Array) -> tuple[Array, Array]:
        """Return freedoms (kinds, 3, n) and volumes (chambers, n), NaN where none are found."""
        freedoms, total = np.empty_like(start), np.zeros_like(pressures)
        for springs, count, begin, end in zip(
            self.springs, self.counts, start, freedoms, strict=True
        ):
            weights = springs.weights(pressures, 2)
            is_solved = _descended(springs, weights[:1], begin, end)
            volumes = springs.at(weights, end).volumes
            is_solved &= (self.stack.centres.T @ end <= springs.kind.most_height).all(0)
            total += count * np.where(is_solved, volumes, np.nan)
        total[:, np.isnan(total[0])] = np.nan
        return freedoms, total


def _parts(count: int) -> list[slice]:
    """Return the parts of so many states that are solved together."""
    return [slice(begin, begin + CHUNK) for begin in range(0, count, CHUNK)]


def batch_of(pressures: Array, poses: Sequence[Pose]) -> BatchPoses:
    """Return poses as a batch."""
    levels = len(poses[0].freedoms) if poses else 0
    return BatchPoses(
        pressures,
        np.array([pose.freedoms for pose in poses]).reshape(-1, levels, 3),
        np.array([pose.volumes for pose in poses]).reshape(pressures.shape),
        np.array([pose.tip for pose in poses]).reshape(-1, 3),
    )


def _step_share(move: Array) -> Array:
    """Return the share (n) of steps (3, n) that stays within ``LARGEST_MOVE``."""
    limits = LARGEST_MOVE[:, None] / np.maximum(np.abs(move), 1e-12)
    return np.asarray(np.minimum(1.0, limits.min(0)))


def _descended(
    springs: BatchSprings, weights: Array, start: Array, end: Array
) -> NDArray[np.bool_]:
    """Write the freedoms (3, n) of least energy; return True (n) where they are found.

    Newton's method with a line search, of which finished states take no further part: the energy
    of a level alone is convex.
    """
    count = start.shape[1]
    is_solved = np.zeros(count, dtype=bool)
    live, at, before = np.arange(count), start.copy(), np.zeros(count)
    end[:] = start
    now = springs.at(weights, at)
    for _ in range(POSE_STEPS):
        moves, is_firm = solved(now.matrix, -now.gradient[:, None])
        move = moves[:, 0]
        largest = np.abs(move).max(0)
        still = np.abs(now.gradient).max(0) < RESIDUAL
        still |= is_firm & (largest * largest < POSE_ERROR * before)
        if still.any():
            end[:, live[still]] = (at + np.where(is_firm & (largest < 1e-3), move, 0.0))[:, still]
            is_solved[live[still]] = True
        rest = ~still & is_firm
        if not rest.any():
            break
        live, at, move, largest = live[rest], at[:, rest], move[:, rest], largest[rest]
        value, slope = now.energy[rest], (move * now.gradient[:, rest]).sum(0)
        weights = weights[..., rest]
        share = full = _step_share(move)
        for _ in range(HALVINGS):
            now = springs.at(weights, at + share * move)
            good = now.energy <= value + 1e-4 * share * slope + 1e-11 * (1 + np.abs(value))
            if good.all():
                break
            share = np.where(good, share, share / 2)
        at = at + share * move
        before = np.where((full == 1.0) & (share == 1.0), largest, 0.0)
    return is_solved


@dataclass(eq=False)
class BatchMotion:
    """N moving stacks, as ``Motion``: ``step`` them, then read ``pressures``, ``tips``, ``times``.

    ``state`` are freedoms (kinds, 3, N) and pressures (chambers, N); ``times`` (N,) in s; ``line``
    feeds each chamber. Under a ``load`` the states are ``alone``, a motion each.
    """

    batch: StackBatch
    line: Line
    load: dict[str, Any]
    start: Pose
    state: _State
    times: Array
    alone: list[Motion]

    @classmethod
    def of(
        cls, batch: StackBatch, line: Line, load: dict[str, Any], start: Pose, count: int
    ) -> BatchMotion:
        """Return ``count`` motions from a pose without load."""
        stack, alone = batch.stack, []
        if batch.is_loaded(load):
            begin = stack.pose(start.pressures, **load)
            alone = [Motion(stack, line, load, begin) for _ in range(count)]
        shape = (len(batch.springs), 3, count), (stack.chambers, count)
        state = _State(np.empty(shape[0]), np.empty(shape[1]))
        motion = cls(
            batch, line, load, alone[0].pose if alone else start, state, np.zeros(count), alone
        )
        motion.restart(slice(None))
        return motion

    def restart(self, where: Any) -> None:
        """Put some of the states (a mask, their numbers or a slice) at the start, at 0 s."""
        self.times[where] = 0.0
        self.state.freedoms[:, :, where] = self.start.freedoms[self.batch.stack.first_levels][
            :, :, None
        ]
        self.state.pressures[:, where] = np.array(self.start.pressures)[:, None]
        if self.alone:
            for number in np.arange(len(self.times))[where].tolist():
                self.alone[number] = Motion(self.batch.stack, self.line, self.load, self.start)

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
        return self.batch.tips(self.state.freedoms)

    @property
    def poses(self) -> BatchPoses:
        """The poses now."""
        if self.alone:
            return batch_of(self.pressures, [motion.pose for motion in self.alone])
        freedoms, pressures = self.state
        volumes = sum(
            count * springs.at(springs.weights(pressures, 2), at).volumes
            for springs, count, at in zip(
                self.batch.springs, self.batch.counts, freedoms, strict=True
            )
        )
        return BatchPoses(
            self.pressures, self.batch.every_level(freedoms), np.asarray(volumes).T, self.tips
        )

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

        for part in _parts(count):
            state = self.state.at(part)
            is_solved[part], after = self._stepped(state, acts[part], sources[:, part])
            ahead.freedoms[:, :, part], ahead.pressures[:, part] = after
        for number in np.flatnonzero(~is_solved).tolist():
            pose = self._pose_after(number, dt, valves[number])
            ahead.freedoms[:, :, number] = pose.freedoms[self.batch.stack.first_levels]
            ahead.pressures[:, number] = pose.pressures
        self.state = ahead
        self.times += dt

    def _pose_after(self, number: int, dt: float, valves: Array) -> Pose:
        """Return the pose of one state after a step, solved alone."""
        stack = self.batch.stack
        state = self.state.at(number)
        like = self.batch.pose_like(state.freedoms[stack.levels])
        begin = stack.pose(tuple(state.pressures.tolist()), near=like)
        motion = Motion(stack, self.line, {}, begin, float(self.times[number]))
        return motion.step(dt, pressures=valves.tolist())

    def _stepped(
        self, begin: _State, acts: Array, sources: Array
    ) -> tuple[NDArray[np.bool_], _State]:
        """Return True (n) where states are solved, and the states (n) after ``acts`` s with
        pressures (chambers, n) at the valves.

        Newton's method for freedoms and pressures at once, as of ``Motion``: less pressure than 0
        is none, and a chamber that would need it draws in the rest.
        """
        count, most = len(acts), self.batch.stack.most_pressure
        end = _State(begin.freedoms.copy(), begin.pressures.copy())
        is_solved, live = np.zeros(count, dtype=bool), np.arange(count)
        (at, p), before = begin, np.zeros((2, count))
        y = _place_of(p)
        contents = np.zeros(0)
        for number in range(MOTION_STEPS):
            each = [
                springs.at(springs.weights(p, 3), one)
                for springs, one in zip(self.batch.springs, at, strict=True)
            ]
            if not number:
                contents = self._volumes(each) * self._squeezed(p)
            moves, dy = self._newton_step(
                each, p, y, contents, acts, sources, 1 if number else ROUNDS
            )
            share = np.minimum(1.0, LONGEST_STEP / np.maximum(np.abs(dy).max(0), 1e-12))
            for move in moves:
                share = np.minimum(share, _step_share(move))
            at = at + share * moves
            y = np.maximum(y + share * dy, 0.0)
            after = np.minimum(_pressure_at(y), most)
            change = np.abs(after - p) / (p + SCALE_PRESSURE)
            largest = np.stack([np.abs(moves).max((0, 1)), change.max(0)])
            p = after
            still = (largest * largest < MOTION_ERRORS * before).all(0)
            still |= (largest < MOTION_ERRORS).all(0)
            if still.any():
                which = live[still]
                end.freedoms[:, :, which] = at[:, :, still]
                end.pressures[:, which] = p[:, still]
                is_solved[which] = self._fits(at[:, :, still], p[:, still])
                rest = ~still
                if not rest.any():
                    break
                live, at, y, p = live[rest], at[:, :, rest], y[:, rest], p[:, rest]
                contents, acts, sources = contents[:, rest], acts[rest], sources[:, rest]
                largest, share = largest[:, rest], share[rest]
            before = np.where(share == 1.0, largest, 0.0)
        return is_solved, end

    def _fits(self, freedoms: Array, pressures: Array) -> NDArray[np.bool_]:
        """Return True (n) where no balloon is higher than its map, nor a pressure at its end."""
        fits = (pressures < self.batch.stack.most_pressure).all(0)
        for springs, at in zip(self.batch.springs, freedoms, strict=True):
            fits &= (self.batch.stack.centres.T @ at <= springs.kind.most_height).all(0)
        return np.asarray(fits)

    def _volumes(self, each: Sequence[SpringBatch]) -> Array:
        """Return the volumes of the chambers in ul, of a gas with its line: (chambers, n)."""
        volumes = np.zeros_like(each[0].volumes)
        if self.line.fluid.is_gas:
            volumes += self.line.dead_volume + self.line.tube_volume
        for count, springs in zip(self.batch.counts, each, strict=True):
            volumes += count * springs.volumes
        return volumes

    def _squeezed(self, pressures: Array) -> Array | float:
        """Return contents by volumes: a gas is counted at the atmosphere."""
        return 1 + pressures / ATMOSPHERE_KPA if self.line.fluid.is_gas else 1.0

    def _newton_step(
        self,
        each: Sequence[SpringBatch],
        p: Array,
        y: Array,
        contents: Array,
        acts: Array,
        sources: Array,
        rounds: int,
    ) -> tuple[Array, Array]:
        """Return the step of freedoms (kinds, 3, n) and of pressures (chambers, n).

        With the freedoms' own steps put in, the volumes' rates by pressure are a matrix that is
        symmetric and positive definite.
        """
        chambers, count = p.shape
        matrix = np.zeros((chambers, chambers, count))
        settled, parts = np.zeros_like(p), []
        for number, springs in zip(self.batch.counts, each, strict=True):
            pulls = np.concatenate(
                [springs.filling.transpose(1, 0, 2), -springs.gradient[:, None]], axis=1
            )
            moved, _ = solved(springs.matrix, pulls)
            filled = number * np.einsum("cin,ijn->cjn", springs.filling, moved)
            matrix += filled[:, :-1]
            settled += filled[:, -1]
            np.einsum("iin->in", matrix)[:] += number * springs.swelling
            parts.append(moved)
        total = np.zeros_like(p)
        now, place, rate = p, y, _pressure_rate(p, y)
        first_rate, volumes = rate, self._volumes(each) + settled
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
        moves = [moved[:, -1] + np.einsum("ijn,jn->in", moved[:, :-1], total) for moved in parts]
        return np.stack(moves), total / first_rate


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
    """Return the solutions (size, n) of matrices with ``more`` on their diagonals, of which those
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


# Springs, a state a column.


class SpringBatch(NamedTuple):
    """Springs of n states of one kind of balloon: ``energy`` (n), ``gradient`` (3, n) and
    ``matrix`` (3, 3, n) by rise and tilt; ``volumes`` (chambers, n), their rates by rise and tilt,
    ``filling`` (chambers, 3, n), and by pressure, ``swelling`` (chambers, n).
    """

    energy: Array
    gradient: Array
    matrix: Array
    volumes: Array
    filling: Array
    swelling: Array


@dataclass(frozen=True, eq=False)
class BatchSprings:
    """Springs of one kind of balloon for many states at once, by pressures of their own.

    As ``stack_loads.Springs`` with a state a column: numpy is the faster the longer its last axis.

    ``table`` (powers, pieces, coefficients by pressure) are the pieces of its potential, a ring's
    point's share of it; ``meet`` (points, 3), ``squares`` (9, points), ``shut`` (9, points) as of
    ``GapPlaces``, ``tilts`` (chambers x 3, points) sum the ring's gaps by chamber.
    """

    kind: BalloonMap
    table: Array
    meet: Array
    squares: Array
    shut: Array
    tilts: Array

    @classmethod
    def of(cls, stack: PosedStack, number: int) -> BatchSprings:
        """Return the springs of a stack's kind of balloon."""
        kind, places = stack.maps[number], stack.places
        ring = places.ring[number]
        tilts = np.zeros((stack.chambers, 3, len(ring)))
        for chamber in range(stack.chambers):
            part = slice(chamber * RING_POINTS, (chamber + 1) * RING_POINTS)
            tilts[chamber, :, part] = ring[part].T
        return cls(
            kind,
            np.ascontiguousarray(pieces(kind.coefficients).transpose(2, 1, 0) / RING_POINTS),
            np.ascontiguousarray(places.meet[number].T),
            np.ascontiguousarray(places.squares[number].T),
            np.ascontiguousarray(places.shut[number].T),
            tilts.reshape(-1, len(ring)),
        )

    def weights(self, pressures: Array, orders: int) -> Array:
        """Return the splines' weights at pressures (chambers, n) of values and of derivatives by
        pressure: (orders, coefficients, chambers, n).
        """
        x, rate = self.kind.scaled(pressures)
        first = x.astype(np.int_)
        powers = np.empty((DEGREE + 1, x.size))
        powers[0] = 1.0
        powers[1] = (x - first).ravel()
        for k in range(2, DEGREE + 1):
            np.multiply(powers[k - 1], powers[1], out=powers[k])
        each = (BY_PRESSURE[:orders].reshape(-1, DEGREE + 1) @ powers).reshape(orders, -1, x.size)
        if orders > 1:
            rate = rate.ravel()
            if orders > 2:
                p = pressures.ravel()
                each[2] *= rate * rate
                each[2] -= each[1] * (rate * p / (p * p + self.kind.scale_pressure**2))
            each[1] *= rate
        whole = np.zeros((orders, PRESSURE_SPANS + DEGREE, x.size))
        places = first.ravel() * x.size + np.arange(x.size)
        where = places + (np.arange(DEGREE + 1) * x.size)[:, None]
        for one, weights in zip(whole, each, strict=True):
            one.reshape(-1)[where] = weights
        return whole.reshape(orders, -1, *x.shape)

    def at(self, weights: Array, freedoms: Array) -> SpringBatch:
        """Return the springs at pressures of ``weights`` and freedoms (3, n)."""
        orders, _, chambers, count = weights.shape
        points = chambers * RING_POINTS
        gaps = self.meet @ freedoms
        after = gaps[:points] + 1.0
        piece = np.minimum(np.maximum(after, 0.0), PIECES_IN_ALL - 1).astype(np.int_)
        u = after - piece
        low, high = int(piece.min()), int(piece.max()) + 1
        size = chambers * count
        part = self.table[:, low:high].reshape(-1, self.table.shape[2])
        # (orders, powers, pieces x chambers x n)
        rows = (part @ weights.reshape(orders, -1, size)).reshape(orders, DEGREE + 1, -1)
        piece -= low
        piece *= size
        begin = piece.reshape(chambers, RING_POINTS, count)
        begin += np.arange(chambers * count).reshape(chambers, 1, count)
        value, ahead = np.empty((2, orders, points, count))
        for one, table in zip(value, rows, strict=True):
            table[DEGREE].take(piece, out=one, mode="clip")
        first, second = np.zeros((min(orders, 2), points, count)), np.zeros_like(u)
        for k in range(DEGREE - 1, -1, -1):
            if k < DEGREE - 2:
                second *= u
            if k < DEGREE - 1:
                second += first[0]
                first *= u
            first += value[:2]
            for one, table in zip(ahead, rows, strict=True):
                table[k].take(piece, out=one, mode="clip")
            value *= u
            value += ahead
        energy = value[0].sum(0)
        gradient = self.tilts.reshape(chambers, 3, points).sum(0) @ first[0]
        matrix = self.squares @ (2 * second)
        meets = gaps < 0
        if meets.any():
            stiffer = self.shut @ meets
            push = (stiffer.reshape(3, 3, count) * freedoms).sum(1)
            energy += (push * freedoms).sum(0) / 2
            gradient += push
            matrix += stiffer
        sums = [-each.reshape(chambers, RING_POINTS, count).sum(1) for each in value[1:]]
        none = np.zeros((chambers, 0))
        return SpringBatch(
            energy,
            gradient,
            matrix.reshape(3, 3, count),
            sums[0] if orders > 1 else none,
            (self.tilts @ -first[1]).reshape(chambers, 3, count) if orders > 1 else none,
            sums[1] if orders > 2 else none,
        )


def solved(matrices: Array, right: Array) -> tuple[Array, Array]:
    """Return the solutions (size, k, n) of symmetric matrices (size, size, n) by right sides (size,
    k, n), and True (n) where a matrix is positive definite: others have no solution.
    """
    size = len(matrices)
    a, b = matrices.copy(), right.copy()
    least = LEAST_PIVOT * np.abs(np.einsum("iin->in", matrices)).max(0)
    is_firm = np.ones(matrices.shape[2], dtype=bool)
    inverse = []
    for i in range(size):
        fits = a[i, i] > least
        is_firm &= fits
        inverse.append(1 / np.where(fits, a[i, i], 1.0))
        for j in range(i + 1, size):
            share = a[j, i] * inverse[i]
            a[j, i + 1 :] -= share * a[i, i + 1 :]
            b[j] -= share * b[i]
    for i in range(size - 1, -1, -1):
        for j in range(i + 1, size):
            b[i] -= a[i, j] * b[j]
        b[i] *= inverse[i]
    return b, is_firm
