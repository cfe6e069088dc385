"""Balance of a stack by Newton's method: levels on their own, or all together under a load."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.errors import DesignError
from sbafab.models.balloon_map import along
from sbafab.models.chain import chain, crossing, felt, twists

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from sbafab.models.chain import Chain
    from sbafab.models.film_elements import Array

SHUT = 2e4
"""mN/mm with which a flat balloon resists being flattened further: no film gives way visibly."""
WALL = 1e6
"""mN/mm of an outer plate."""
WALLS = (1e3, 1e5)
"""The same on the way there."""
TOUCHES = 12
"""Points round the top's outline that may touch the outer plate."""
TURN = np.arange(TOUCHES) * math.tau / TOUCHES
RIM = np.stack([np.cos(TURN), np.sin(TURN), 0 * TURN], -1)
MOST_STEPS = 300
CLOSE = 1e-5
"""Out of balance in mN (or mN mm) that is none."""
FARTHEST = np.array([0.4, 0.15, 0.15])
"""The most by which one step moves rise (mm) and tilt (rad)."""
FINE = 1e-6
"""A step (mm, rad) that need not be made."""
CLOSELY, LITTLE = 3e-5, 1e-7
"""Largest last step (mm, rad) against an outer plate, and the energy (uJ) that it may gain: the
plate's force is to be right as well."""
ROUGH = 0.01
"""The same on the way to an outer plate."""
ROUNDS = 2
"""How often a step is held off by rims that it would meet."""
FEW_STEPS = 12
"""Steps in which a start far away meets an outer plate, or never does."""


class Load(NamedTuple):
    """What acts from outside, in mN: force on the tip, weight of each level; and the outer plate:
    the line (a point and the normal) on which the tip meets it, whether it sticks to that line, the
    radius of the top that meets it, and the plate's stiffness.
    """

    tip: Array
    weight: Array
    point: Array | None
    normal: Array
    sticks: bool
    outline: float
    wall: float = WALL


@dataclass(frozen=True, eq=False)
class Springs:
    """What levels do at given pressures: a row a level or a kind of balloon.

    ``table`` holds the ``derivatives`` of the potentials of all splines, then of their volumes.
    ``begins`` (rows, chambers x points) is where the potential of each point begins in it,
    ``volumes`` by how many rows later its volume does; ``gap_of`` (rows, chambers x points, 3) are
    the gaps by rise and tilt, ``squares`` (rows, chambers x points, 9) their products, ``spans``
    (rows, 1) pieces of the spline a mm and ``top`` (rows) its end in mm; ``ring`` is the number of
    points a balloon. ``rims`` (rows, points, 3) are the gaps by rise and tilt round the outline.
    """

    table: Array
    begins: NDArray[np.int_]
    volumes: int
    gap_of: Array
    squares: Array
    spans: Array
    top: Array
    ring: int
    rims: Array

    def of(self, levels: NDArray[np.int_]) -> Springs:
        """A row for each of these."""
        return replace(
            self,
            begins=self.begins[levels],
            gap_of=self.gap_of[levels],
            squares=self.squares[levels],
            spans=self.spans[levels],
            top=self.top[levels],
            rims=self.rims[levels],
        )

    def energy(self, freedoms: Array) -> tuple[Array, Array, Array]:
        """Energy (rows) in uJ with its gradient (rows, 3) and second derivatives (rows, 3, 3)."""
        gaps = (self.gap_of @ freedoms[..., None])[..., 0]
        found = along(self.table, self.begins, gaps * self.spans)
        value, slope = found.value, found.first * self.spans
        curve = found.second * (self.spans * self.spans)
        shut = np.minimum(gaps, 0.0)
        if shut.any():
            value = value + SHUT * shut**2 / 2
            slope = slope + SHUT * shut
            curve = curve + np.where(gaps < 0, SHUT, 0.0)
        value = value.sum(-1)
        gradient = (slope[:, None] @ self.gap_of)[:, 0]
        matrix = (curve[:, None] @ self.squares).reshape(-1, 3, 3)
        rims = (self.rims @ freedoms[..., None])[..., 0]
        if rims.min() < 0:
            shut = np.minimum(rims, 0.0)
            value = value + SHUT * (shut**2).sum(-1) / 2
            gradient = gradient + SHUT * (shut[:, None] @ self.rims)[:, 0]
            touch = np.where(rims < 0, SHUT, 0.0)[..., None] * self.rims
            matrix = matrix + touch.transpose(0, 2, 1) @ self.rims
        return value / self.ring, gradient / self.ring, matrix / self.ring

    def contents(self, freedoms: Array) -> tuple[Array, Array]:
        """Volume in ul of each balloon (rows, chambers), and the potential of each row."""
        gaps = (self.gap_of @ freedoms[..., None])[..., 0] * self.spans
        both = self.begins + np.array([[[0]], [[self.volumes]]])
        stored, held = along(self.table, both, gaps).value
        volumes = held.reshape(len(held), -1, self.ring).sum(-1) / self.ring
        return volumes, stored.sum(-1) / self.ring


def free(springs: Springs, start: Array) -> Array:
    """Rise and tilt of each row with nothing outside acting: (rows, 3). Raises DesignError."""
    at, before = start, FINE
    value, gradient, matrix = springs.energy(at)
    for _ in range(MOST_STEPS):
        if np.abs(gradient).max() < CLOSE:
            return at
        move, is_firm = _towards(gradient, matrix)
        largest = float(np.abs(move).max())
        if is_firm and _ends(largest, before):
            return at + move
        share = _limited(move)
        slope = (move * gradient).sum(-1)
        for _ in range(12):
            step = share[:, None] * move
            tried = springs.energy(at + step)
            good = tried[0] <= value + 1e-4 * share * slope + 1e-11 * (1 + np.abs(value))
            if good.all():
                break
            share = np.where(good, share, share / 2)
        before = largest if (share == 1.0).all() else 0.0
        at = at + step
        value, gradient, matrix = tried
    raise DesignError("the stack finds no balance at these pressures; try others")


def _ends(largest: float, before: float) -> bool:
    """Whether a step is the last: what would follow it, if steps go on to shrink as they did since
    the whole step before, is none.
    """
    return largest * largest < FINE * before


def _towards(gradient: Array, matrix: Array) -> tuple[Array, bool]:
    """Newton's step of each row, kept downhill where the energy curves the wrong way, and whether
    it curves the right way everywhere.
    """
    if not _is_firm(matrix):
        values, vectors = np.linalg.eigh(matrix)
        least = 1e-6 * np.abs(values).max(-1, keepdims=True) + 1e-9
        values = np.maximum(np.abs(values), least)
        within = (vectors.transpose(0, 2, 1) @ gradient[..., None])[..., 0]
        return np.asarray(-(vectors @ (within / values)[..., None])[..., 0]), False
    return np.asarray(-np.linalg.solve(matrix, gradient[..., None])[..., 0]), True


def _limited(move: Array) -> Array:
    """Share of each row's step that stays within what one step may do."""
    return np.asarray(np.minimum(1.0, (FARTHEST / np.maximum(np.abs(move), 1e-12)).min(-1)))


def held(
    kinds: Springs, levels: NDArray[np.int_], pitch: float, load: Load, start: Array, is_near: bool
) -> tuple[Array, float, bool]:
    """Rise and tilt of each level (levels, 3) under a load, the force in mN on the plate, and
    whether the balance is stable.

    An outer plate that is not met soon stiffens by and by, for steps that do not see it yet would
    run far into it; ``is_near`` tells a start that may be met as it is. Raises DesignError where no
    balance is found.
    """
    springs = kinds.of(levels)
    if load.point is None:
        found = _settled(springs, pitch, load, start, MOST_STEPS)
    else:
        at = start if is_near else _under(start, pitch, load, load.point)
        found = _settled(springs, pitch, load, at, MOST_STEPS if is_near else FEW_STEPS)
        if found is None:
            found = _met(springs, pitch, load, at)
    if found is None:
        raise DesignError("the stack finds no balance under this load; try a smaller one")
    return found


def _met(
    springs: Springs, pitch: float, load: Load, start: Array
) -> tuple[Array, float, bool] | None:
    """What ``held`` gives against a plate that is soft at first."""
    at = start
    for wall in WALLS:
        soft = _settled(springs, pitch, load._replace(wall=wall), at, MOST_STEPS, ROUGH)
        if soft is None:
            return None
        at, _, _ = soft
    return _settled(springs, pitch, load, at, MOST_STEPS)


def _under(start: Array, pitch: float, load: Load, point: Array) -> Array:
    """The same start below a level plate."""
    at = start.copy()
    if load.normal[2] > 0.999:
        # A little past it, so that it is met all round: what is alike on all sides stays so.
        room = max(point[2] / len(at) - pitch, 0.0)
        at[:, 0] = np.where(at[:, 0] > room, room + 1e-4, at[:, 0])
        straight = load.sticks | (np.abs(at[:, 1:]) < 1e-9)
        at[:, 1:] = np.where(straight, 0.0, at[:, 1:])
    return at


def _settled(
    springs: Springs, pitch: float, load: Load, start: Array, most: int, enough: float = 0.0
) -> tuple[Array, float, bool] | None:
    """What ``held`` gives, or None where so many steps do not get there. A step that is no larger
    than ``enough`` ends it.
    """
    at, before = start, FINE
    value, gradient, matrix, push = _loaded(springs, pitch, load, at)
    for _ in range(most):
        if np.abs(gradient).max() < CLOSE * (1 + 1e-3 * push):
            return at, push, _is_firm(matrix)
        flat, is_firm = _towards(gradient[None], matrix[None])
        flat = _held_off(springs, at, flat, gradient, matrix)
        move = flat.reshape(-1, 3)
        largest = float(np.abs(move).max())
        slope = float((flat @ gradient)[0])
        fits = load.point is None or (largest < CLOSELY and slope > -LITTLE)
        if is_firm and (largest <= enough or (fits and _ends(largest, before))):
            at = at + move
            if load.point is not None:
                push = _acting(chain(at, pitch), load).push
            return at, push, True
        share = float(_limited(move).min())
        for _ in range(14):
            tried = _loaded(springs, pitch, load, at + share * move)
            if tried[0] <= value + 1e-4 * share * slope + 1e-11 * (1 + abs(value)):
                break
            share /= 2
        before = largest if share == 1.0 else 0.0
        at = at + share * move
        value, gradient, matrix, push = tried
        if abs(slope) < 1e-11 * (1 + abs(value)):
            return at, push, _is_firm(matrix)
    return None


def _held_off(springs: Springs, at: Array, flat: Array, gradient: Array, matrix: Array) -> Array:
    """The step to where rims just touch which it would drive into each other.

    A step that does not see them yet would run far past them (a primal-dual active set).
    """
    rims = (springs.rims @ at[..., None])[..., 0]
    for _ in range(ROUNDS):
        ahead = rims + (springs.rims @ flat.reshape(-1, 3, 1))[..., 0]
        met = (ahead < 0) & (rims >= 0)
        if not met.any():
            break
        each = springs.rims * met[..., None]
        push = SHUT / springs.ring * (rims[:, None] @ each)[:, 0]
        stiffer = matrix.copy()
        diagonal = np.einsum("iaib->iab", stiffer.reshape(len(at), 3, len(at), 3))
        diagonal += SHUT / springs.ring * (each.transpose(0, 2, 1) @ each)
        tried, _ = _towards((gradient + push.ravel())[None], stiffer[None])
        if float((tried @ gradient)[0]) >= 0:
            break  # it would lead uphill
        flat = tried
    return flat


def _is_firm(matrix: Array) -> bool:
    """Whether the energy rises every way."""
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        return False
    return True


class _Acting(NamedTuple):
    """What acts on the plates: the sum of the forces f beyond each level (n, 3), that of x f over
    the points x they act on (n, 3, 3), and their energy; n is 1 where all levels carry the same.

    ``stiffness`` (6, 6) is the outer plate's, by turn and move of the tip as of ``twists``;
    ``push`` is its force.
    """

    forces: Array
    arms: Array
    energy: float
    stiffness: Array | None = None
    push: float = 0.0


def _acting(plates: Chain, load: Load) -> _Acting:
    tip = plates.places[-1]
    found = _Acting(load.tip[None], np.multiply.outer(tip, load.tip)[None], -float(load.tip @ tip))
    if load.point is not None:
        found = _pressed(found, plates, load, load.point)
    if load.weight.any():
        above = plates.places[:0:-1].cumsum(0)[::-1]
        number = np.arange(len(above), 0, -1)[:, None]
        found = found._replace(
            forces=found.forces + number * load.weight,
            arms=found.arms + above[:, :, None] * load.weight,
            energy=found.energy - float(above[0] @ load.weight),
        )
    return found


def _pressed(found: _Acting, plates: Chain, load: Load, point: Array) -> _Acting:
    """With what the outer plate does to the tip."""
    tip, normal = plates.places[-1], load.normal
    touching = tip + load.outline * RIM @ plates.axes[-1].T
    into = np.maximum((touching - point) @ normal, 0.0)
    each = load.wall / TOUCHES * into
    push = float(each.sum())
    lines = np.empty((TOUCHES, 6))
    lines[:, :3] = -touching @ crossing(normal)
    lines[:, 3:] = normal
    touched = lines[into > 0]
    stiffness = load.wall / TOUCHES * touched.T @ touched
    force, arms = -push * normal, -np.multiply.outer(each @ touching, normal)
    energy = float(each @ into) / 2
    if load.sticks:
        across = load.wall * (np.eye(3) - np.multiply.outer(normal, normal))
        aside = across @ (tip - point)
        follows = np.concatenate([-crossing(tip).T, np.eye(3)], axis=1)
        stiffness += follows.T @ across @ follows
        force = force - aside
        arms -= np.multiply.outer(tip, aside)
        energy += float(aside @ (tip - point)) / 2
    return _Acting(found.forces + force, found.arms + arms, found.energy + energy, stiffness, push)


def _loaded(
    springs: Springs, pitch: float, load: Load, at: Array
) -> tuple[float, Array, Array, float]:
    """Energy with its gradient and second derivatives by all freedoms, and the plate's force.

    A level nearer the base turns all movements beyond it. What the tilts of one level do to each
    other is taken at their mean: enough to descend by.
    """
    size = at.size
    value, gradient, blocks = springs.energy(at)
    plates = chain(at, pitch)
    acting = _acting(plates, load)
    moved = twists(plates)
    works = moved @ felt(acting.arms, acting.forces)
    gradient = gradient - works[..., 3]
    flat = moved.reshape(size, 6)
    half = flat[:, :3] @ works[..., :3].reshape(size, 3).T
    half *= _nearer(len(at))
    matrix = -(half + half.T)
    if acting.stiffness is not None:
        matrix += flat @ acting.stiffness @ flat.T
    diagonal = np.einsum("iaib->iab", matrix.reshape(len(at), 3, len(at), 3))
    diagonal += blocks
    return float(value.sum()) + acting.energy, gradient.ravel(), matrix, acting.push


@lru_cache(maxsize=16)
def _nearer(count: int) -> Array:
    """1 where the row's level is nearer the base than the column's, half where it is the same."""
    level = np.repeat(np.arange(count), 3)
    return np.asarray(np.heaviside(level[None, :] - level[:, None], 0.5))
