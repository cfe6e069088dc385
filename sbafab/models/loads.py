"""What acts on a stack from outside, and what the stack's energy then does."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.models.chain import chain, crossing, felt, twists

if TYPE_CHECKING:
    from sbafab.models.chain import Chain
    from sbafab.models.film_elements import Array
    from sbafab.models.springs import Springs

WALL = 1e6
"""mN/mm of an outer plate."""
TOUCHES = 12
"""Points round the top's outline that may touch the outer plate."""
TURN = np.arange(TOUCHES) * math.tau / TOUCHES
RIM = np.stack([np.cos(TURN), np.sin(TURN), 0 * TURN], -1)


class Load(NamedTuple):
    """What acts from outside, in mN: force on the tip, weight of each level; and the outer plate:
    the line (a point and the normal) on which the tip meets it, whether it sticks to that line, the
    radius of the top that meets it, and the plate's stiffness.
    """

    tip: Array
    weight: Array | None
    point: Array | None
    normal: Array
    sticks: bool
    outline: float
    wall: float = WALL

    @property
    def is_level(self) -> bool:
        """Whether the outer plate is."""
        return float(self.normal[2]) > 0.999


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
    if load.weight is not None:
        beyond, number = _beyond(len(plates.rises))
        above = beyond @ plates.places
        found = _Acting(
            found.forces + number * load.weight,
            found.arms + above[:, :, None] * load.weight,
            found.energy - float(above[0] @ load.weight),
            found.stiffness,
            found.push,
        )
    return found


@lru_cache(maxsize=16)
def _beyond(count: int) -> tuple[Array, Array]:
    """Which plates (count, count + 1) lie beyond each level, and their number (count, 1)."""
    found = 1.0 - np.tri(count, count + 1)
    return found, found.sum(axis=1, keepdims=True)


def pushed(at: Array, pitch: float, load: Load) -> float:
    """Force in mN on the outer plate."""
    return _acting(chain(at, pitch), load).push


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


class Loaded(NamedTuple):
    """Energy of a stack under a load with its gradient (freedoms), and the outer plate's force.

    ``own`` (levels, 3) and ``blocks`` (levels, 3, 3) are first and second derivatives of the
    springs; ``moved`` (levels, 3, 6) and ``works`` (levels, 3, 6, 4) what each freedom does to
    the plates beyond it, and that with the forces on them.
    """

    value: float
    gradient: Array
    push: float
    own: Array
    blocks: Array
    moved: Array
    works: Array
    stiffness: Array | None

    def rest(self) -> Array:
        """Second derivatives (freedoms, freedoms) without those of the springs.

        A level nearer the base turns all movements beyond it. What the tilts of one level do to
        each other is taken at their mean: enough to descend by.
        """
        size = self.gradient.size
        flat = self.moved.reshape(size, 6)
        half = flat[:, :3] @ self.works[..., :3].reshape(size, 3).T
        half *= _nearer(size // 3)
        found = -(half + half.T)
        if self.stiffness is not None:
            found += flat @ self.stiffness @ flat.T
        return found


def with_blocks(rest: Array, blocks: Array) -> Array:
    """A matrix (freedoms, freedoms) with blocks (levels, 3, 3) added on its diagonal."""
    found = rest.copy()
    count = len(blocks)
    diagonal = np.einsum("iaib->iab", found.reshape(count, 3, count, 3))
    diagonal += blocks
    return found


def loaded(springs: Springs, pitch: float, load: Load, at: Array) -> Loaded:
    """What the energy of a stack under a load does."""
    value, own, blocks = springs.energy(at)
    plates = chain(at, pitch)
    acting = _acting(plates, load)
    moved = twists(plates)
    works = moved @ felt(acting.arms, acting.forces)
    gradient = (own - works[..., 3]).ravel()
    energy = float(value.sum()) + acting.energy
    return Loaded(energy, gradient, acting.push, own, blocks, moved, works, acting.stiffness)


@lru_cache(maxsize=16)
def _nearer(count: int) -> Array:
    """1 where the row's level is nearer the base than the column's, half where it is the same."""
    level = np.repeat(np.arange(count), 3)
    return np.asarray(np.heaviside(level[None, :] - level[:, None], 0.5))
