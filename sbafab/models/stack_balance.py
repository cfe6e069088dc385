"""Equilibrium of a stack at given pressures by Newton's method with a line search, of many states
at once: levels that do not act on each other, all levels under a load, and against an outer plate.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sbafab.models.film_elements import Array
from sbafab.models.stack_loads import (
    Chain,
    Load,
    OuterPlate,
    Springs,
    loaded_energy,
    plate_chain,
    with_diagonal_blocks,
)

CHUNK, LOADED_CHUNK = 512, 48
"""States solved together, without and with a load: more bring no speed, and cost memory."""
LARGEST_MOVE = np.array([0.4, 0.15, 0.15])
"""Largest rise (mm) and tilts (rad) in one step."""
FINE = 5e-8
"""Error (mm, rad) at which a descent ends; those of all levels add up."""
NEAR_FINE = 1e-6
"""The same for loaded states from a start nearby, and against a plate."""
SOFT_PLATES = ((2e3, 6e4), (1e3, 1e4, 1e5), (1e4,))
"""Stiffness in mN/mm of an outer plate in the first solutions, for paths tried in turn."""
MOST_STEPS, HALVINGS = 300, 14
FEW_STEPS = 3
"""Steps in which a start that is met all round comes to balance against a plate."""
RESIDUAL = 1e-7
"""Tolerance of the residual, mN or mN mm."""
PLATE_LAST_STEP, PLATE_LAST_GAIN = 3e-5, 1e-7
"""Largest last step (mm, rad) against an outer plate, and its energy (uJ): the plate's force is to
converge as well.
"""
RIM_ROUNDS = 2
"""Times that a step is limited by rims that it would meet."""
ROUGH_STEP = 0.01
"""Last step (mm, rad) against a soft plate."""


class Balance(NamedTuple):
    """Equilibria of n states: ``freedoms`` (n, rows, 3), ``pushes`` (n) in mN on an outer plate,
    and which are stable and which have been found (n).
    """

    freedoms: Array
    pushes: Array
    is_stable: NDArray[np.bool_]
    is_found: NDArray[np.bool_]

    @classmethod
    def of(cls, freedoms: Array, pushes: Array | None = None, is_found: bool = True) -> Balance:
        """Return stable equilibria, or as many that are not found."""
        count = len(freedoms)
        each = np.zeros(count) if pushes is None else pushes
        return cls(freedoms.copy(), each, *np.full((2, count), is_found))

    def part(self, which: Any) -> Balance:
        """Return some of the states."""
        return Balance(*(part[which] for part in self))


@dataclass(frozen=True)
class Plate:
    """An outer plate that the tip may push on: through ``point`` (mm), ``normal`` pointing away.

    ``Plate.at(height)`` lies level. With ``sticks`` friction holds the middle of the tip on the
    line through the point along the normal; without, it slides along the plate.
    """

    point: tuple[float, float, float]
    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)
    sticks: bool = True

    @classmethod
    def at(cls, height: float) -> Plate:
        """Return a level plate at a height in mm above the base."""
        return cls((0.0, 0.0, height))


@dataclass(frozen=True, eq=False)
class Pose:
    """A stack in equilibrium at ``pressures`` (kPa, one a chamber).

    ``pitch`` is the height of a flat level in mm, ``freedoms`` (levels, 3) are rise in mm and tilt
    in rad of each level; ``gaps`` (levels, chambers) by how many mm each balloon has risen at its
    own centre; ``volumes`` ul a chamber; ``force`` N on the outer plate; ``energy`` uJ stored in
    the films. A pose that is not ``stable`` is an unstable equilibrium, such as a straight column
    that would buckle.
    """

    pressures: tuple[float, ...]
    freedoms: Array
    gaps: Array
    volumes: Array
    force: float
    energy: float
    stable: bool
    pitch: float

    @cached_property
    def _chain(self) -> Chain:
        return plate_chain(self.freedoms, self.pitch)

    @property
    def frames(self) -> tuple[Array, Array]:
        """Origins (n, 3) in mm and axes (n, 3, 3) of the plates, the base first; the columns of
        ``axes[i]`` are the x, y and z of plate i.
        """
        return self._chain.places, self._chain.axes

    @property
    def tip(self) -> Array:
        """Middle of the top plate (3,) in mm."""
        return np.asarray(self._chain.places[-1])

    @property
    def height(self) -> float:
        """Height of the middle of the top plate above the base, mm."""
        return float(self.tip[2])

    @property
    def bend(self) -> float:
        """Degrees from base to top; along the stack, so that it may be more than half a turn."""
        return math.degrees(math.hypot(*self.freedoms[:, 1:].sum(0)))

    @property
    def direction(self) -> float:
        """Degrees round the base, from x, towards which it bends; 0 where it stands straight."""
        x, y = self.freedoms[:, 1:].sum(0)
        return math.degrees(math.atan2(-x, y)) if math.hypot(x, y) > 1e-9 else 0.0


class Equilibria(NamedTuple):
    """States of a stack: ``pressures`` (n, chambers) in kPa and ``freedoms`` (n, rows, 3), a row
    per kind of balloon without a load and per level under one; ``volumes`` (n, chambers) ul,
    ``energies`` (n) uJ in the films, ``pushes`` (n) mN on an outer plate, which are stable and
    which have been found (n); ``excess`` (n) mm by which a balloon rises above its map.
    """

    pressures: Array
    freedoms: Array
    volumes: Array
    energies: Array
    pushes: Array
    is_stable: NDArray[np.bool_]
    is_found: NDArray[np.bool_]
    excess: Array

    def part(self, which: Any) -> Equilibria:
        """Return some of the states."""
        return Equilibria(*(part[which] for part in self))

    @property
    def balance(self) -> Balance:
        """The freedoms in balance."""
        return Balance(self.freedoms, self.pushes, self.is_stable, self.is_found)

    @property
    def is_met(self) -> NDArray[np.bool_]:
        """Which have been found, with all balloons on their maps: (n)."""
        return np.asarray(self.is_found & (self.excess <= 0))


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


class LocalEnergy(NamedTuple):
    """Energies (n, groups) of groups of levels that do not act on each other, with gradients (n,
    groups, size), second derivatives (n, groups, size, size), and the push on a plate (n).
    """

    value: Array
    gradient: Array
    matrix: Array
    push: Array


Energies = Callable[[Any, Array], LocalEnergy]
"""The energies of some of the states, by freedoms (n, groups, size)."""


def put(record: Any, which: Any, other: Any) -> None:
    """Replace some of the states of a record of arrays by another's."""
    for mine, its in zip(record, other, strict=True):
        mine[which] = its


def free_equilibrium(springs: Springs, start: Array) -> Balance:
    """Return the equilibria without external load of n states, (n, rows, 3), whose rows do not act
    on each other: the energy of a level alone is convex.
    """

    def energies(which: Any, at: Array) -> LocalEnergy:
        some = springs if len(at) == len(start) else springs.at(which)
        return LocalEnergy(*some.energy(at), np.zeros(len(at)))

    return _descent(energies, start)


def loaded_equilibrium(
    springs: Springs, pitch: float, load: Load, start: Array, is_near: bool
) -> Balance:
    """Return the equilibria under a load of n states, (n, levels, 3).

    An outer plate is stiffened gradually unless the start, which ``is_near``, may be in contact:
    steps without contact would run far into it.
    """
    wall = load.wall
    if wall is None or is_near:
        found = _loaded(springs, pitch, load, start, NEAR_FINE if is_near else FINE)
    else:
        start = start_below(springs, start, pitch, wall, load.stiffness)
        found = _loaded(springs, pitch, load, start, most=FEW_STEPS)
    for path in () if wall is None else SOFT_PLATES:
        rest = np.flatnonzero(~found.is_found)
        at = start[rest]
        for stiffness in path if rest.size else ():
            softer = load._replace(stiffness=stiffness)
            soft = _loaded(springs.at(rest), pitch, softer, at, enough=ROUGH_STEP)
            rest, at = rest[soft.is_found], soft.freedoms[soft.is_found]
        put(found, rest, _loaded(springs.at(rest), pitch, load, at))
    return found


def _loaded(
    springs: Springs,
    pitch: float,
    load: Load,
    start: Array,
    fine: float = NEAR_FINE,
    enough: float = 0.0,
    most: int = MOST_STEPS,
) -> Balance:
    """Return the ``_descent`` of n states under a load."""

    def energies(which: Any, at: Array) -> LocalEnergy:
        some = springs if len(at) == len(start) else springs.at(which)
        now = loaded_energy(some, pitch, load, at.reshape(len(at), -1, 3))
        matrix = with_diagonal_blocks(now.rest(), now.blocks)
        return LocalEnergy(now.value[:, None], now.gradient[:, None], matrix[:, None], now.push)

    def limited(which: Any, at: Array, move: Array, now: LocalEnergy) -> Array:
        """Limit steps to where rims just meet that they would drive into each other: without their
        contact a step would run far past them (a primal-dual active set).
        """
        for _ in range(RIM_ROUNDS):
            levels = (len(at), *start.shape[1:])
            some = springs if len(at) == len(start) else springs.at(which)
            met = some.meeting(at.reshape(levels), move.reshape(levels))
            if met is None:
                break
            closing = np.flatnonzero(met[1].any((1, 2, 3)))
            push, stiffer = (part[closing] for part in met)
            matrix = with_diagonal_blocks(now.matrix[closing, 0], stiffer)
            gradient = now.gradient[closing, 0]
            tried = newton_step(gradient + push.reshape(gradient.shape), matrix)
            is_downhill = (tried * gradient).sum(-1) < 0
            move[closing[is_downhill], 0] = tried[is_downhill]
        return move

    begin = start.reshape(len(start), 1, 3 * start.shape[1])
    is_at_plate = load.wall is not None
    found = _descent(energies, begin, fine, enough, is_at_plate, limited, most)
    return found._replace(freedoms=found.freedoms.reshape(start.shape))


def _descent(
    energies: Energies,
    start: Array,
    fine: float = FINE,
    enough: float = 0.0,
    is_at_plate: bool = False,
    limited: Callable[[Any, Array, Array, LocalEnergy], Array] | None = None,
    most: int = MOST_STEPS,
) -> Balance:
    """Return the equilibria downhill of freedoms (n, groups, size), once their
    errors are below ``fine`` or a step is no larger than ``enough``; steps may be ``limited``.
    """
    found = Balance.of(start, is_found=False)
    if not len(start):
        return found
    live, at, now = np.arange(len(start)), start, energies(slice(None), start)
    before = np.full(len(at), fine)
    for _ in range(most):
        is_firm = is_positive_definite(now.matrix) if is_at_plate else None
        move = newton_step(now.gradient, now.matrix, is_firm)
        if limited is not None:
            move = limited(live, at, move, now)
        largest, value = np.abs(move).max((1, 2)), now.value
        slope = (move * now.gradient).sum(-1) if is_at_plate else value
        is_last = largest * largest < fine * before
        is_still = np.abs(now.gradient).max((1, 2)) < RESIDUAL * (1 + 1e-3 * now.push)
        if is_at_plate:
            is_last &= (largest < PLATE_LAST_STEP) & (slope[:, 0] > -PLATE_LAST_GAIN)
            is_still |= slope[:, 0] > -1e-12 * (1 + np.abs(value[:, 0]))
        is_over = is_last | is_still | (largest <= enough)
        if is_over.any():
            is_stable = is_over.copy()
            is_stable[is_over] = is_positive_definite(now.matrix[is_over]).all(1)
            is_over &= is_still | is_stable
            end, pushes = at + np.where(is_stable[:, None, None], move, 0.0), now.push
            if is_at_plate and is_over.any():
                pushes = pushes.copy()
                pushes[is_over] = energies(live[is_over], end[is_over]).push
            ends = Balance.of(end[is_over], pushes[is_over])
            ends.is_stable[:] = is_stable[is_over]
            put(found, live[is_over], ends)
            goes = ~is_over
            if not goes.any():
                break
            live, at, move = live[goes], at[goes], move[goes]
            largest, value, slope = largest[goes], value[goes], slope[goes]
        share = step_limit(move.reshape(*move.shape[:2], -1, 3), largest).min(-1)
        now = energies(live, at + share[..., None] * move)
        for _ in range(HALVINGS):
            is_far = ~(now.value <= value + 1e-11 * (1 + np.abs(value)))
            if not is_far.any():
                break
            less: Any = 0.5
            if is_at_plate:
                # To where the parabola through both energies and the first slope is least.
                over = 2 * (now.value - value - share * slope)
                less = np.clip(-share * slope / np.maximum(over, 1e-300), 0.1, 0.5)
            share, far = np.where(is_far, less * share, share), np.flatnonzero(is_far.any(1))
            put(now, far, energies(live[far], (at + share[..., None] * move)[far]))
        before = largest * (share == 1).all(1)
        at = at + share[..., None] * move
    return found


def start_below(
    springs: Springs, start: Array, pitch: float, wall: OuterPlate, stiffness: float
) -> Array:
    """Return starts (n, levels, 3) a little past a level plate, so that it is met all round."""
    if not wall.is_level:
        return start
    at = start.copy()
    room = max(wall.point[2] / at.shape[1] - pitch, 0.0)
    is_high = at[..., 0] > room
    if wall.sticks:
        at[..., 1:] = 0.0
    at[..., 1:][np.abs(at[..., 1:]) < 1e-9] = 0.0
    at[..., 0] = np.minimum(at[..., 0], room)
    # As far as the plate gives way to them.
    push = np.maximum(-springs.energy(at)[1][..., 0].mean(-1, keepdims=True), 0.0)
    past = np.where(wall.sticks & is_high.all(-1, keepdims=True), push / stiffness, 0.0)
    at[..., 0] += np.where(is_high, np.maximum(past / at.shape[1] + 1e-9, 0.0), 0.0)
    return at


def newton_step(gradient: Array, matrix: Array, is_firm: NDArray[np.bool_] | None = None) -> Array:
    """Return Newton's step of each row (..., size), a descent direction even where the tangent
    stiffness (..., size, size) is not positive definite, ``is_firm``; by default, where the plain
    step leads uphill.
    """
    step = np.asarray(-np.linalg.solve(matrix, gradient[..., None])[..., 0])
    if is_firm is None:
        is_firm = (step * gradient).sum(-1) < 0
    uphill = ~is_firm
    if uphill.any():
        values, vectors = np.linalg.eigh(matrix[uphill])
        least = 1e-6 * np.abs(values).max(-1, keepdims=True) + 1e-9
        values = np.maximum(np.abs(values), least)
        within = (vectors.swapaxes(-1, -2) @ gradient[uphill][..., None])[..., 0]
        step[uphill] = -(vectors @ (within / values)[..., None])[..., 0]
    return step


def step_limit(move: Array, largest: Array | None = None) -> Array:
    """Return the share of each row's step (..., 3) that stays within ``LARGEST_MOVE``; ``largest``
    are the largest components of the steps, if they are known.
    """
    if largest is not None and largest.max() <= LARGEST_MOVE.min():
        return np.ones(move.shape[:-1])
    return np.asarray(np.minimum(1.0, (LARGEST_MOVE / np.maximum(np.abs(move), 1e-12)).min(-1)))


def is_positive_definite(matrix: Array) -> NDArray[np.bool_]:
    """Return which matrices (..., size, size) are positive definite: (...)."""
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        if matrix.ndim == 2:
            return np.zeros((), dtype=bool)
        return np.array([is_positive_definite(each) for each in matrix])
    return np.ones(matrix.shape[:-2], dtype=bool)


def bounded_solutions(matrix: Array, right: Array, least: Array, most: Array) -> Array:
    """Return the minima (n, size) of x @ matrix @ x / 2 - right @ x from ``least`` to ``most``.

    Components beyond are clamped until the rest stays within: an active set that only grows,
    sufficient for one of many steps.
    """
    size = matrix.shape[-1]
    tried = np.linalg.solve(matrix, right[..., None])[..., 0]
    x = np.clip(tried, least, most)
    is_free = x == tried
    live = ~is_free.all(1)
    for _ in range(size):
        if not live.any():
            break
        held = np.where(is_free, 0.0, x)
        reduced = np.where(is_free, right - (matrix @ held[..., None])[..., 0], x)
        both = is_free[:, None] & is_free[..., None]
        tried = np.linalg.solve(np.where(both, matrix, np.eye(size)), reduced[..., None])[..., 0]
        within = np.clip(tried, least, most)
        still = is_free & (within == tried)
        x = np.where(live[:, None], within, x)
        live &= (still != is_free).any(1) & still.any(1)
        is_free = still
    return np.asarray(x)
