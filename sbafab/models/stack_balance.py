"""Balance of a stack by Newton's method: levels on their own, or all together under a load."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.errors import DesignError
from sbafab.models.balloon_map import along
from sbafab.models.chain import chain, moves, stiffening

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from sbafab.models.chain import Chain
    from sbafab.models.film_elements import Array

SHUT = 2e4
"""mN/mm with which a flat balloon resists being flattened further: no film gives way visibly."""
WALL = 1e6
"""mN/mm of an outer plate."""
TOUCHES = 12
"""Points round the top's outline that may touch the outer plate."""
MOST_STEPS = 300
CLOSE = 1e-5
"""Out of balance in mN (or mN mm) that is none."""
FARTHEST = np.array([0.4, 0.15, 0.15])
"""The most by which one step moves rise (mm) and tilt (rad)."""


class Load(NamedTuple):
    """What acts from outside, in mN: force on the tip, weight of each level; and the outer plate:
    the line (a point and the normal) on which the tip meets it, whether it sticks to that line, and
    the radius of the top that meets it.
    """

    tip: Array
    weight: Array
    point: Array | None
    normal: Array
    sticks: bool
    outline: float


@dataclass(frozen=True, eq=False)
class Springs:
    """What levels do at given pressures: a row a level or a kind of balloon.

    ``potentials`` and ``volumes`` (pieces of all splines, powers) are polynomials by height, and
    ``begins`` (rows, chambers x points) where those of each point begin; ``gap_of`` (rows,
    chambers x points, 3) are the gaps by rise and tilt, ``spans`` (rows, 1) pieces of the spline a
    mm and ``top`` (rows) its end in mm; ``ring`` is the number of points a balloon.
    """

    potentials: Array
    volumes: Array
    begins: NDArray[np.int_]
    gap_of: Array
    spans: Array
    top: Array
    ring: int

    def of(self, levels: NDArray[np.int_]) -> Springs:
        """A row for each of these."""
        return replace(
            self,
            begins=self.begins[levels],
            gap_of=self.gap_of[levels],
            spans=self.spans[levels],
            top=self.top[levels],
        )

    def energy(self, freedoms: Array) -> tuple[Array, Array, Array]:
        """Energy (rows) in uJ with its gradient (rows, 3) and second derivatives (rows, 3, 3)."""
        gaps = (self.gap_of @ freedoms[..., None])[..., 0]
        found = along(self.potentials, self.begins, gaps * self.spans)
        value, slope = found.value, found.first * self.spans
        curve = found.second * self.spans**2
        shut = np.minimum(gaps, 0.0)
        if shut.any():
            value = value + SHUT * shut**2 / 2
            slope = slope + SHUT * shut
            curve = curve + np.where(gaps < 0, SHUT, 0.0)
        by_gap = self.gap_of.transpose(0, 2, 1) / self.ring
        gradient = (by_gap @ slope[..., None])[..., 0]
        matrix = (by_gap * curve[:, None]) @ self.gap_of
        return value.sum(-1) / self.ring, gradient, matrix

    def contents(self, freedoms: Array) -> tuple[Array, Array]:
        """Volume in ul of each balloon (rows, chambers), and the potential of each row."""
        gaps = (self.gap_of @ freedoms[..., None])[..., 0] * self.spans
        held = along(self.volumes, self.begins, gaps).value
        stored = along(self.potentials, self.begins, gaps).value
        volumes = held.reshape(len(held), -1, self.ring).mean(-1)
        return volumes, stored.sum(-1) / self.ring


def free(springs: Springs, start: Array | None) -> Array:
    """Rise and tilt of each row with nothing outside acting: (rows, 3). Raises DesignError."""
    rows = len(springs.spans)
    at = np.zeros((rows, 3)) if start is None else start.copy()
    if start is None:
        at[:, 0] = 0.3 * springs.top
    value, gradient, matrix = springs.energy(at)
    for _ in range(MOST_STEPS):
        if np.abs(gradient).max() < CLOSE:
            return at
        move = _towards(gradient, matrix)
        share = _limited(move)
        slope = (move * gradient).sum(-1)
        for _ in range(12):
            step = share[:, None] * move
            tried = springs.energy(at + step)
            good = tried[0] <= value + 1e-4 * share * slope + 1e-11 * (1 + np.abs(value))
            if good.all():
                break
            share = np.where(good, share, share / 2)
        at = at + step
        value, gradient, matrix = tried
    raise DesignError("the stack finds no balance at these pressures; try others")


def _towards(gradient: Array, matrix: Array) -> Array:
    """Newton's step of each row, kept downhill where the energy curves the wrong way."""
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(matrix)
        least = 1e-6 * np.abs(values).max(-1, keepdims=True) + 1e-9
        values = np.maximum(np.abs(values), least)
        within = (vectors.transpose(0, 2, 1) @ gradient[..., None])[..., 0]
        return np.asarray(-(vectors @ (within / values)[..., None])[..., 0])
    return np.asarray(-np.linalg.solve(matrix, gradient[..., None])[..., 0])


def _limited(move: Array) -> Array:
    """Share of each row's step that stays within what one step may do."""
    return np.asarray(np.minimum(1.0, (FARTHEST / np.maximum(np.abs(move), 1e-12)).min(-1)))


def held(
    kinds: Springs, levels: NDArray[np.int_], pitch: float, load: Load, start: Array
) -> tuple[Array, float, bool]:
    """Rise and tilt of each level (levels, 3) under a load, the force in mN on the plate, and
    whether the balance is stable.

    Raises DesignError where no balance is found.
    """
    springs = kinds.of(levels)
    at = start.copy()
    if load.point is not None and load.normal[2] > 0.999:
        # A little past it, so that it is met all round: what is alike on all sides stays so.
        room = max(load.point[2] / len(levels) - pitch, 0.0)
        at[:, 0] = np.where(at[:, 0] > room, room + 1e-4, at[:, 0])
        at[:, 1:] = np.where(np.abs(at[:, 1:]) < 1e-9, 0.0, at[:, 1:])
    value, gradient, matrix, push = _loaded(springs, pitch, load, at)
    for _ in range(MOST_STEPS):
        if np.abs(gradient).max() < CLOSE * (1 + 1e-3 * push):
            return at, push, _is_firm(matrix)
        move = _towards(gradient[None], matrix[None]).reshape(-1, 3)
        share = float(_limited(move).min())
        slope = float((move.ravel() * gradient).sum())
        for _ in range(14):
            tried = _loaded(springs, pitch, load, at + share * move)
            if tried[0] <= value + 1e-4 * share * slope + 1e-11 * (1 + abs(value)):
                break
            share /= 2
        at = at + share * move
        value, gradient, matrix, push = tried
        if abs(slope) < 1e-11 * (1 + abs(value)):
            return at, push, _is_firm(matrix)
    raise DesignError("the stack finds no balance under this load; try a smaller one")


def _is_firm(matrix: Array) -> bool:
    """Whether the energy rises every way."""
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        return False
    return True


class _Acting(NamedTuple):
    """Forces (k, 3) on points (k, 3) of plates (k), their energy, and of the outer plate each
    point's stiffness (k, 3, 3); ``push`` is the plate's force.
    """

    points: Array
    plates: NDArray[np.int_]
    forces: Array
    stiffness: Array
    energy: float
    push: float


def _acting(plates: Chain, load: Load) -> _Acting:
    count = len(plates.rises)
    tip = plates.places[-1]
    points, places = [tip[None]], [np.array([count])]
    forces, stiffness = [load.tip[None]], [np.zeros((1, 3, 3))]
    energy, push = -float(load.tip @ tip), 0.0
    if load.weight.any():
        points.append(plates.places[1:])
        forces.append(np.tile(load.weight, (count, 1)))
        places.append(np.arange(count) + 1)
        stiffness.append(np.zeros((count, 3, 3)))
        energy -= float((points[-1] @ load.weight).sum())
    if load.point is not None:
        turn = np.arange(TOUCHES) * math.tau / TOUCHES
        rim = load.outline * np.stack([np.cos(turn), np.sin(turn), 0 * turn], -1)
        touching = tip + rim @ plates.axes[-1].T
        into = (touching - load.point) @ load.normal
        each = np.where(into > 0, WALL / TOUCHES, 0.0)
        through = np.outer(load.normal, load.normal)
        points.append(touching)
        forces.append(-(each * into)[:, None] * load.normal)
        places.append(np.full(TOUCHES, count))
        stiffness.append(each[:, None, None] * through)
        energy += float((each * into**2).sum()) / 2
        push = float((each * into).sum())
        if load.sticks:
            across = WALL * (np.eye(3) - through)
            aside = across @ (tip - load.point)
            forces[0] = forces[0] - aside
            stiffness[0] = across[None]
            energy += float(aside @ (tip - load.point)) / 2
    return _Acting(
        np.concatenate(points),
        np.concatenate(places),
        np.concatenate(forces),
        np.concatenate(stiffness),
        energy,
        push,
    )


def _loaded(
    springs: Springs, pitch: float, load: Load, at: Array
) -> tuple[float, Array, Array, float]:
    """Energy with its gradient and second derivatives by all freedoms, and the plate's force."""
    count = len(at)
    value, gradient, blocks = springs.energy(at)
    plates = chain(at, pitch)
    acting = _acting(plates, load)
    sparse = np.zeros((count, 3, count, 3))
    level = np.arange(count)
    sparse[level, :, level] = blocks
    matrix = sparse.reshape(3 * count, 3 * count)
    does = (np.abs(acting.forces).max(-1) > 0) | acting.stiffness.any((1, 2))
    total = float(value.sum()) + acting.energy
    if not does.any():
        return total, gradient.ravel(), matrix, acting.push
    moved = moves(plates, acting.points[does], acting.plates[does])
    slope = gradient.ravel() - np.einsum("kd,kdj->j", acting.forces[does], moved)
    matrix -= stiffening(plates, moved, acting.forces[does])
    if acting.stiffness.any():
        flat = moved.reshape(-1, 3 * count)
        matrix += flat.T @ (acting.stiffness[does] @ moved).reshape(-1, 3 * count)
    return total, slope, matrix, acting.push
