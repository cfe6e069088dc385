"""Linearised stacks: derivatives of poses with respect to pressures, forces and moments on the tip,
and an outer plate; and Newton's method for freedoms and pressures together.

In equilibrium the gradient g(q, x) of the energy is 0, so the freedoms q follow a change of x by
dq/dx = -H^-1 dg/dx, with the second derivatives H of the energy at fixed contacts (implicit
function theorem). If a contact is just closing or opening, the derivatives are one-sided. The first
axis of arrays is that of states.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from sbafab.errors import DesignError
from sbafab.models.column import BatchPoses, Column, Pose
from sbafab.models.film_elements import Array
from sbafab.models.stack_balance import is_positive_definite, step_limit
from sbafab.models.stack_loads import (
    WALL_POINTS,
    Energy,
    Load,
    PlateContact,
    Springs,
    crossing,
    energy,
    plate_chain,
)

RIGID = 1e-9
"""Share of the largest compliance below which a motion of the tip counts as impossible."""
RESIDUAL = 1e-7
"""Tolerance of the residual, mN or mN mm: poses are in equilibrium to about 1e-6 mm."""
CORRECTIONS = 6
"""Maximum Newton steps to reach it; one suffices unless contacts open or close."""
P0 = 0.1
"""Pressure in kPa below which pressures are counted evenly, above in their logarithm."""
LAST_ERROR = 1e-6
"""Error (mm, rad, asinh) at which freedoms and pressures together are solved."""
TURNED_BACK = 0.5
"""Share of a pressure step reversed by the next step, above which that one is halved."""
CONTACT_ROUNDS = 8
"""Rounds in which a step's contacts with an outer plate are found."""


class Linearised(NamedTuple):
    """n states linearised at freedoms ``at`` (n, rows, 3): their ``springs`` and ``energy``.

    ``counts`` (freedoms,) is the number of levels that each freedom represents. ``volumes`` (n,
    chambers) in ul have the derivatives ``filling`` (n, freedoms, chambers) with respect to a
    level's freedoms and ``swelling`` (n, chambers) with respect to pressures with all plates held.
    """

    column: Column
    at: Array
    springs: Springs
    energy: Energy
    counts: Array
    volumes: Array
    filling: Array
    swelling: Array

    def top(self) -> tuple[Array, Array]:
        """Return tips (n, 3) in mm, and the rotation and translation of the top per unit of the
        freedoms (n, freedoms, 6), as in ``Chain.motions``.
        """
        if self.energy.plates is not None and self.energy.motions is not None:
            return self.energy.plates.tip, self.energy.motions
        levels, (count, rows, _) = self.column.levels, self.at.shape
        is_by_level = rows == len(levels)
        plates = plate_chain(self.at if is_by_level else self.at[:, levels], self.column.pitch)
        motions = plates.motions().reshape(count, len(levels), 18)
        if not is_by_level:
            motions = (levels == np.arange(rows)[:, None]).astype(float) @ motions
        return plates.tip, motions.reshape(count, -1, 6)

    def tip_motion(self) -> tuple[Array, Array]:
        """Return tips (n, 3) in mm, and the motion of the tip, then the rotation of the top, per
        unit of the freedoms: (n, 6, freedoms).
        """
        tip, motions = self.top()
        turns = motions[..., :3]
        motion = np.concatenate([motions[..., 3:] - turns @ crossing(tip), turns], axis=-1)
        return tip, motion.swapaxes(1, 2)

    def filled(self, moves: Array) -> Array:
        """Return the changes of volumes (n, chambers, k) due to moves (n, freedoms, k)."""
        return np.asarray((self.filling * self.counts[:, None]).swapaxes(1, 2) @ moves)

    def pushed(self) -> tuple[Array, Array]:
        """Return the derivatives of the force in mN on an outer plate with respect to the freedoms
        (n, freedoms) and to a shift of the plate (n).
        """
        touch = self.energy.touch
        if touch is None:
            return np.zeros(self.filling.shape[:2]), np.zeros(len(self.at))
        stiff = touch.stiff_touches[:, :WALL_POINTS]
        pushes = (stiff[:, None] @ self.energy.deeper()[:, :WALL_POINTS])[:, 0]
        return pushes, stiff.sum(1)

    def moves(self, pulls: Array) -> Array:
        """Return the moves of the freedoms (n, freedoms, k) under generalised forces (n, freedoms,
        k) in mN or mN mm. Raises DesignError for a pose that is about to buckle.
        """
        try:
            return self.energy.solved(pulls)
        except np.linalg.LinAlgError:
            raise DesignError(
                "the stack is about to buckle and has no derivatives; change a pressure or load"
            ) from None


def linearised(
    column: Column,
    load: Load | None,
    pressures: Array,
    at: Array,
    forces: Array | None = None,
) -> Linearised:
    """Return n states linearised at pressures (n, chambers) in kPa and freedoms (n, rows, 3) of
    levels, or of kinds of balloons without a load; ``forces`` of an outer plate as in ``energy``.
    """
    by_level = at.shape[1] == len(column.levels)
    springs = column.springs(pressures, sucked=True, by_level=by_level, orders=3)
    now = energy(springs, column.pitch, load, at, forces)
    volumes, filling = springs.order(at, 1)
    swelling, _ = springs.order(at, 2, with_rates=False)
    counts = np.ones(at.shape[1]) if by_level else column.counts(load)
    flat = filling.swapaxes(2, 3).reshape(*now.gradient.shape, -1)
    return Linearised(
        column, at, springs, now, counts.repeat(3), counts @ volumes, flat, counts @ swelling
    )


def linearised_poses(poses: BatchPoses) -> Linearised:
    """Return poses linearised by level, in equilibrium to rounding accuracy. Raises DesignError for
    a pose that is about to buckle.
    """
    at = poses.freedoms
    for _ in range(CORRECTIONS):
        now = linearised(poses.column, poses.load, poses.pressures, at)
        room = RESIDUAL * (1 + 1e-3 * now.energy.push)
        if (np.abs(now.energy.gradient).max(1) < room).all():
            break
        at = at + now.moves(-now.energy.gradient[..., None]).reshape(at.shape)
    return now


class Rates(NamedTuple):
    """Derivatives of a pose with respect to n quantities: of the middle of the ``tip`` (3, n) in
    mm, the rotation ``turn`` of the top (3, n) in rad about x, y and z, ``volumes`` (chambers, n)
    in ul, and the ``force`` (n) in N on an outer plate.
    """

    tip: Array
    turn: Array
    volumes: Array
    force: Array

    def by(self, quantities: slice) -> Rates:
        """Return those for some of the quantities."""
        return Rates(*(part[..., quantities] for part in self))


@dataclass(frozen=True, eq=False)
class Derivatives:
    """A ``pose`` with its derivatives ``by_pressure`` (per kPa in each chamber), ``by_wrench`` (per
    N along x, y and z on the middle of the top, then per N mm), and ``by_plate`` (per mm of an
    outer plate along its normal; None without one).
    """

    pose: Pose
    by_pressure: Rates
    by_wrench: Rates
    by_plate: Rates | None

    @property
    def compliance(self) -> Array:
        """The motion of the tip per force and moment on it: (6, 6), mm and rad per N and N mm."""
        return np.concatenate([self.by_wrench.tip, self.by_wrench.turn])

    @property
    def stiffness(self) -> Array:
        """The forces and moments on the tip per motion: (6, 6), N and N mm per mm and rad.

        Inverse of the compliance over the motions that the levels allow, 0 along others, such as
        the twist of a straight stack: balloons carry no shear.
        """
        compliance = self.compliance
        length = max(self.pose.height, 1.0)
        # As if all were lengths, so that motions are compared with each other.
        scale = np.repeat([1.0, length], 3)
        values, vectors = np.linalg.eigh((compliance + compliance.T) / 2 * np.outer(scale, scale))
        free = np.abs(values) > RIGID * np.abs(values).max()
        inverse = np.zeros_like(values)
        inverse[free] = 1 / values[free]
        return np.asarray((vectors * inverse) @ vectors.T * np.outer(scale, scale))


def derivatives(poses: BatchPoses) -> Derivatives:
    """Return the derivatives of the first of the poses under its load. Raises DesignError for a
    pose that is about to buckle.
    """
    now, chambers = linearised_poses(poses.part(slice(1))), poses.column.chambers
    pushed, hardness = now.pushed()
    motion, has_plate = now.tip_motion()[1], now.energy.touch is not None
    pulls = [now.filling, 1000 * motion.swapaxes(1, 2), *([pushed[..., None]] * has_plate)]
    (moves,) = now.moves(np.concatenate(pulls, axis=-1))
    tip, volumes, force = motion[0] @ moves, now.filled(moves[None])[0], pushed[0] @ moves
    volumes += now.swelling[0, :, None] * np.eye(chambers, moves.shape[-1])
    force[chambers + 6 :] -= hardness[0]
    rates = Rates(tip[:3], tip[3:], volumes, force / 1000)
    by_plate = rates.by(slice(chambers + 6, None)) if has_plate else None
    by_wrench = rates.by(slice(chambers, chambers + 6))
    return Derivatives(poses.pose(), rates.by(slice(chambers)), by_wrench, by_plate)


# Freedoms and pressures together.


def place_of(pressures: ArrayLike) -> Array:
    """Return the coordinate of pressures in kPa in which heights are nearly linear."""
    return np.asarray(np.arcsinh(np.asarray(pressures) / P0))


def pressure_at(places: ArrayLike) -> Array:
    """Return the pressures in kPa of coordinates."""
    return np.asarray(P0 * np.sinh(places))


def pressure_rate(places: Array) -> Array:
    """Return the derivatives of pressures in kPa with respect to their coordinates."""
    return np.asarray(P0 * np.cosh(places))


class Unknowns(NamedTuple):
    """Coordinates of pressures (n, chambers), freedoms (n, rows, 3) and contact forces (n, points)
    in mN, NaN if they follow from a plate's stiffness.
    """

    x: Array
    at: Array
    forces: Array


Ahead = Callable[[Any, Linearised, Array, Array], Array]
"""The steps of the pressures' coordinates (n, chambers) of some of the states, by the states
linearised, the coordinates, and the moves of the freedoms to equilibrium and by each coordinate:
(n, freedoms, 1 + chambers)."""


@np.errstate(over="ignore", invalid="ignore")
def together(
    begin: BatchPoses,
    ahead: Ahead,
    ends: tuple[float, float],
    steps: int,
    enough: float = LAST_ERROR,
    forces: Array | None = None,
) -> tuple[Array, BatchPoses]:
    """Return the states after Newton's method for freedoms and pressures together, with an outer
    plate's contact forces (n, points) in mN.

    States count as found if their steps become smaller than ``enough``. Coordinates of pressures
    stay within ``ends``. Contact ``forces`` are additional unknowns.
    """
    column, load = begin.column, begin.load
    if forces is None:
        points = 0 if load is None or load.wall is None else len(load.wall.local)
        forces = np.full((len(begin), points), np.nan)
    run = Unknowns(place_of(begin.pressures), column.rows_of(begin.freedoms, load), forces)
    end, live = Unknowns(*(part.copy() for part in run)), np.arange(len(begin))
    before, last = np.zeros_like(run.x), np.zeros(len(begin))
    is_found, is_stable = np.zeros((2, len(begin)), dtype=bool)
    for _ in range(steps if len(live) else 0):
        known = None if np.isnan(run.forces).any() else run.forces
        now = linearised(column, load, pressure_at(run.x), run.at, known)
        try:
            move, dx, deeper = _step(run, now, lambda *parts, live=live: ahead(live, *parts))
        except np.linalg.LinAlgError:
            break
        # Oscillation at the limits of pressures and at contact changes.
        turns = (dx * before).sum(-1) < -TURNED_BACK * (before * before).sum(-1)
        share = np.where(turns, 0.5, 1.0) * step_limit(move)
        pushes, touch = run.forces, now.energy.touch
        if touch is not None:
            pushes = touch.resists(touch.deep + share[:, None] * deeper)
        x = np.clip(run.x + share[:, None] * dx, *ends)
        run, before = Unknowns(x, run.at + share[:, None, None] * move, pushes), dx
        largest = np.maximum(np.abs(move).max((1, 2)), np.abs(dx).max(1))
        is_over = largest < enough
        if touch is None:
            is_over |= largest * largest < enough * last
        for mine, its in zip(end, run, strict=True):
            mine[live] = its
        is_found[live] = is_over
        is_stable[live[is_over]] = is_positive_definite(now.energy.matrix[is_over]).all(1)
        goes = ~is_over & np.isfinite(largest)
        if not goes.any():
            break
        last = np.where(share == 1, largest, 0.0)[goes]
        run, live, before = Unknowns(*(part[goes] for part in run)), live[goes], before[goes]
    freedoms = end.at if load is not None else end.at[:, column.levels]
    pushes = end.forces[:, :WALL_POINTS].sum(1)
    pressures = pressure_at(end.x)
    return end.forces, BatchPoses(column, load, pressures, freedoms, pushes, is_stable, is_found)


def _step(
    run: Unknowns, now: Linearised, ahead: Callable[[Linearised, Array, Array], Array]
) -> tuple[Array, Array, Array]:
    """Return the steps of freedoms (n, rows, 3) and of the pressures' coordinates (n, chambers) to
    the linearised equilibria, and the increase in mm of the depth of a plate's points (n, points).

    A plate's contacts are those at the step's end. They act on the freedoms only through the six
    rotations and translations of the top, so that changed contacts need no further solution of all
    levels (Woodbury).
    """
    filling = now.filling * pressure_rate(run.x)[:, None]
    pulls, touch = [-now.energy.gradient[..., None], filling], now.energy.touch
    if touch is None:
        moves = now.energy.solved(np.concatenate(pulls, axis=-1))
        dx = ahead(now, run.x, moves)
        return _sum(moves, dx).reshape(run.at.shape), dx, run.forces
    motions = now.top()[1]
    pulls[0] = pulls[0] + motions @ (touch.forces[:, None] @ touch.lines).swapaxes(1, 2)
    first = now.energy.solved(np.concatenate([*pulls, motions], axis=-1))
    begin, by_pull = np.split(motions.swapaxes(1, 2) @ first, [-6], axis=-1)
    before = is_in = touch.deep > touch.least
    stiffness, live = _contact_top(touch, is_in)[0], np.ones(len(run.x), dtype=bool)
    for number in range(CONTACT_ROUNDS):
        more, pull = _contact_top(touch, is_in)
        more, pulled = more - stiffness, begin.copy()
        pulled[..., 0] -= (by_pull @ pull[..., None])[..., 0]
        tops = np.linalg.solve(np.eye(6) + by_pull @ more, pulled).astype(float, copy=False)
        back = more @ tops
        back[..., 0] += pull
        moves = first[..., :-6] - first[..., -6:] @ back
        dx = ahead(now, run.x, moves)
        deeper = (touch.lines @ _sum(tops, dx)[..., None])[..., 0]
        after = touch.deep + deeper > touch.least
        live &= (after != is_in).any(1)
        if number and (CONTACT_ROUNDS - 1 - number) % 2 == 0:
            # Later rounds would repeat an oscillation between two sets of contacts.
            live &= (after != before).any(1)
        if not live.any():
            break
        before, is_in = is_in, np.where(live[:, None], after, is_in)
    return _sum(moves, dx).reshape(run.at.shape), dx, deeper


def _sum(moves: Array, dx: Array) -> Array:
    """Return the moves (n, k) to equilibrium at the pressures' coordinates ``dx`` ahead."""
    return np.asarray(moves[..., 0] + (moves[..., 1:] @ dx[..., None])[..., 0])


def _contact_top(touch: PlateContact, is_in: Any) -> tuple[Array, Array]:
    """Return the stiffness (n, 6, 6) and the force (n, 6) of points in contact (n, points) on the
    rotations and translations of the top.
    """
    stiff = touch.stiff * is_in
    lines = touch.lines.swapaxes(1, 2)
    return (lines * stiff[:, None]) @ touch.lines, (lines @ (stiff * touch.deep)[..., None])[..., 0]
