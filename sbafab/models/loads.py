"""What acts on a stack from outside, and what the stack's energy then does."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.errors import DesignError
from sbafab.models.chain import chain, crossing, felt, twists

if TYPE_CHECKING:
    from collections.abc import Sequence

    from sbafab.models.chain import Chain
    from sbafab.models.film_elements import Array
    from sbafab.models.springs import Springs

STIFF = 1e6
"""mN/mm of an outer plate."""
TOUCHES = 12
"""Points round the top's outline that may touch the outer plate."""
TURN = np.arange(TOUCHES) * math.tau / TOUCHES
RIM = np.stack([np.cos(TURN), np.sin(TURN), 0 * TURN], -1)


def three(values: Sequence[float], what: str) -> Array:
    """Three numbers (3,). Raises DesignError where they are not three, or not finite."""
    try:
        found = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        found = np.zeros(0)
    if found.shape != (3,) or not np.isfinite(found).all():
        raise DesignError(f"{what} must be three finite numbers, such as (0, 0, -0.1)")
    return found


def directed(values: Sequence[float], what: str) -> Array:
    """The direction (3,) of three numbers. Raises DesignError where they have none."""
    found = three(values, what)
    length = float(np.linalg.norm(found))
    if not length:
        raise DesignError(f"{what} has no direction; give three numbers that are not all 0")
    return found / length


class OuterPlate(NamedTuple):
    """An outer plate: the line (``point`` and ``normal``) on which the tip meets it, whether it
    ``sticks`` to that line, and how.

    Points fixed to the top are kept from going beyond: those round its rim, then, where it sticks,
    its middle either way across the line. ``local`` (points, 3) are their places on the top in mm,
    ``ways`` (points, 3) the directions in which they are kept, ``crosses`` (points, 3, 3) what
    makes of a place its vector product with that; ``least`` (points) how deep in mm each is at
    least when it is kept.
    """

    point: Array
    normal: Array
    sticks: bool
    local: Array
    ways: Array
    crosses: Array
    least: Array

    @classmethod
    def of(cls, point: Array, normal: Array, sticks: bool, outline: float) -> OuterPlate:
        """That which a top meets whose rim has the radius ``outline`` in mm."""
        local, ways, least = outline * RIM, np.tile(normal, (TOUCHES, 1)), np.zeros(TOUCHES)
        if sticks:
            aside = np.eye(3)[np.argmin(np.abs(normal))]
            aside = aside - (normal @ aside) * normal
            aside /= np.linalg.norm(aside)
            both = np.stack([aside, np.cross(normal, aside)])
            local = np.concatenate([local, np.zeros((2, 3))])
            ways = np.concatenate([ways, both])
            least = np.concatenate([least, [-np.inf, -np.inf]])
        return cls(point, normal, sticks, local, ways, -crossing(ways), least)

    @property
    def is_level(self) -> bool:
        """Whether it lies level."""
        return float(self.normal[2]) > 0.999


@lru_cache(maxsize=256)
def outer_plate(line: tuple[float, ...], sticks: bool, outline: float) -> OuterPlate:
    """That on a line: a point in mm, then the normal."""
    return OuterPlate.of(np.array(line[:3]), np.array(line[3:]), sticks, outline)


class Load(NamedTuple):
    """What acts from outside, in mN: force on the tip, weight of each level, and the outer plate
    with its stiffness in mN/mm.
    """

    tip: Array
    weight: Array | None
    wall: OuterPlate | None
    stiffness: float = STIFF


class PlateContact(NamedTuple):
    """Where the top is against an outer plate: by how many mm its points are too ``deep``, and by
    how many a unit of each turn and move of ``twists`` makes them deeper, ``lines`` (points, 6).

    ``stiff`` and ``least`` (points) say what resists; ``forces`` (points) in mN are those that act.
    """

    deep: Array
    lines: Array
    stiff: Array
    least: Array
    forces: Array

    @property
    def push(self) -> float:
        """Force in mN on the plate."""
        return float(self.forces[:TOUCHES].sum())

    def resists(self, deep: Array) -> Array:
        """Forces in mN at points so deep (mm)."""
        return self.stiff * np.maximum(deep, self.least)


class _Acting(NamedTuple):
    """What acts on the plates: the sum of the forces f beyond each level (n, 3), that of x f over
    the points x they act on (n, 3, 3), and their energy; n is 1 where all levels carry the same.
    """

    forces: Array
    arms: Array
    energy: float
    touch: PlateContact | None = None


def _acting(plates: Chain, load: Load, forces: Array | None) -> _Acting:
    tip = plates.places[-1]
    found = _Acting(load.tip[None], np.multiply.outer(tip, load.tip)[None], -float(load.tip @ tip))
    if load.wall is not None:
        found = _pressed(found, plates, load.wall, load.stiffness, forces)
    if load.weight is not None:
        beyond, number = _beyond(len(plates.rises))
        above = beyond @ plates.places
        found = _Acting(
            found.forces + number * load.weight,
            found.arms + above[:, :, None] * load.weight,
            found.energy - float(above[0] @ load.weight),
            found.touch,
        )
    return found


def _pressed(
    found: _Acting, plates: Chain, wall: OuterPlate, stiffness: float, forces: Array | None
) -> _Acting:
    """With what the outer plate does to the tip: ``forces``, or those of points so deep."""
    points = plates.places[-1] + wall.local @ plates.axes[-1].T
    deep = ((points - wall.point) * wall.ways).sum(-1)
    lines = np.concatenate([(points[:, None] @ wall.crosses)[:, 0], wall.ways], axis=1)
    stiff = np.full(len(deep), stiffness)
    stiff[:TOUCHES] /= TOUCHES
    resists = stiff * np.maximum(deep, wall.least)
    acts = resists if forces is None else forces
    each = acts[:, None] * wall.ways
    return _Acting(
        found.forces - acts @ wall.ways,
        found.arms - points.T @ each,
        found.energy + float(resists @ deep) / 2,
        PlateContact(deep, lines, stiff, wall.least, acts),
    )


@lru_cache(maxsize=16)
def _beyond(count: int) -> tuple[Array, Array]:
    """Which plates (count, count + 1) lie beyond each level, and their number (count, 1)."""
    found = 1.0 - np.tri(count, count + 1)
    return found, found.sum(axis=1, keepdims=True)


class Loaded(NamedTuple):
    """Energy of a stack under a load with its gradient (freedoms).

    ``own`` (levels, 3) and ``blocks`` (levels, 3, 3) are first and second derivatives of the
    springs; ``moved`` (levels, 3, 6) and ``works`` (levels, 3, 6, 4) what each freedom does to
    the plates beyond it, and that with the forces on them; ``touch`` what an outer plate does.
    """

    value: float
    gradient: Array
    own: Array
    blocks: Array
    moved: Array
    works: Array
    touch: PlateContact | None

    @property
    def push(self) -> float:
        """Force in mN on the outer plate."""
        return 0.0 if self.touch is None else self.touch.push

    def turned(self) -> Array:
        """Second derivatives (freedoms, freedoms) by forces alone, without what gives way.

        A level nearer the base turns all movements beyond it. What the tilts of one level do to
        each other is taken at their mean: enough to descend by.
        """
        size = self.gradient.size
        half = self.moved.reshape(size, 6)[:, :3] @ self.works[..., :3].reshape(size, 3).T
        half *= _nearer(size // 3)
        return -(half + half.T)

    def deeper(self, touch: PlateContact) -> Array:
        """Mm by which a unit of each freedom makes the points of a touch deeper: (points,
        freedoms).
        """
        return np.asarray(touch.lines @ self.moved.reshape(-1, 6).T)

    def rest(self) -> Array:
        """Second derivatives (freedoms, freedoms) without those of the springs."""
        found = self.turned()
        if self.touch is not None:
            lines = self.deeper(self.touch)
            found += (lines.T * (self.touch.stiff * (self.touch.deep > self.touch.least))) @ lines
        return found


def with_blocks(rest: Array, blocks: Array) -> Array:
    """A matrix (freedoms, freedoms) with blocks (levels, 3, 3) added on its diagonal."""
    found = rest.copy()
    count = len(blocks)
    diagonal = np.einsum("iaib->iab", found.reshape(count, 3, count, 3))
    diagonal += blocks
    return found


def loaded(
    springs: Springs, pitch: float, load: Load, at: Array, forces: Array | None = None
) -> Loaded:
    """What the energy of a stack under a load does, an outer plate by ``forces`` (mN) of its points
    if they are given: the gradient is then what is missing from a balance with these.
    """
    value, own, blocks = springs.energy(at)
    plates = chain(at, pitch)
    acting = _acting(plates, load, forces)
    moved = twists(plates)
    works = moved @ felt(acting.arms, acting.forces)
    gradient = (own - works[..., 3]).ravel()
    energy = float(value.sum()) + acting.energy
    return Loaded(energy, gradient, own, blocks, moved, works, acting.touch)


@lru_cache(maxsize=16)
def _nearer(count: int) -> Array:
    """1 where the row's level is nearer the base than the column's, half where it is the same."""
    level = np.repeat(np.arange(count), 3)
    return np.asarray(np.heaviside(level[None, :] - level[:, None], 0.5))
