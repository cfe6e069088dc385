"""A chain of plates: where tilting and rising levels put each plate, and how it moves with them.

A level has three freedoms: its rise (mm) and the tilt of its upper plate, a rotation vector in the
lower plate's plane (rad). Half of the tilt comes before the rise and half after: what constant
curvature within a level does. Arrays have a row a level.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.errors import DesignError
from sbafab.models.balloon_map import DEGREE, PIECES_IN_ALL, derivatives, horner

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from sbafab.models.balloon_map import BalloonMap
    from sbafab.models.film_elements import Array

SMALL = 1e-8
"""Square of the angle below which its functions are those at this one."""
BASE = np.eye(3)
SIGNS = np.zeros((3, 3, 3))
"""The Levi-Civita symbol."""
SIGNS[[0, 1, 2], [1, 2, 0], [2, 0, 1]] = 1.0
SIGNS[[0, 2, 1], [2, 1, 0], [1, 0, 2]] = -1.0
CROSS = SIGNS.transpose(1, 2, 0).reshape(3, 9)


def _felt() -> Array:
    """Matrix (12, 24) behind ``felt``."""
    found = np.zeros((12, 6, 4))
    arms, forces = found[:9].reshape(3, 3, 6, 4), found[9:]
    one = np.eye(3)
    # (turn x x) x f is x (turn . f) less turn (x . f).
    arms[:, :, :3, :3] = np.einsum("kc,lr->klrc", one, one) - np.einsum("kl,rc->klrc", one, one)
    arms[:, :, :3, 3] = SIGNS.transpose(1, 2, 0)
    forces[:, 3:, :3] = -SIGNS.transpose(1, 2, 0)
    forces[:, 3:, 3] = one
    return found.reshape(12, 24)


FELT = _felt()


def _turned() -> Array:
    """Matrix (12, 13) behind ``_rotations``: of 1, x, y, xx, xy, yx, yy, 1, then xx, xy, yx, yy."""
    found = np.zeros((12, 13))
    turn, rate = found[:, :9].reshape(12, 3, 3), found[:, 9:].reshape(12, 2, 2)
    turn[0] = BASE
    # The vector (x, y, 0) as a cross product, then that twice.
    turn[1:3] = SIGNS[:, :2].transpose(1, 0, 2)
    turn[3:7] = (turn[1:3, None] @ turn[None, 1:3]).reshape(4, 3, 3)
    rate[7] = BASE[:2, :2]
    rate[8:] = np.eye(4).reshape(4, 2, 2)
    return found


TURNED = _turned()


class Chain(NamedTuple):
    """Plates of a chain, the base first: places (n + 1, 3) in mm and axes (n + 1, 3, 3), whose
    columns are the plates' x, y and z; ``rises`` (n, 3) are the levels' directions.

    A level's tilt turns all beyond it about its middle: ``middles`` (n, 3) in mm; ``turns``
    (n, 2, 3) is what a unit of either turns it by.
    """

    places: Array
    axes: Array
    rises: Array
    middles: Array
    turns: Array


def chain(freedoms: Array, pitch: float) -> Chain:
    """The plates of levels with freedoms (n, 3), each ``pitch`` mm high when flat."""
    count = len(freedoms)
    turned, rates = _rotations(freedoms[:, 1:] / 2)
    axes = np.empty((count + 1, 3, 3))
    axes[0] = BASE
    np.matmul(turned, turned, out=axes[1:])
    reach = 1
    while reach < count:
        # Each is already the product of ``reach`` levels up to its own.
        axes[reach + 1 :] = axes[1:-reach] @ axes[reach + 1 :]
        reach *= 2
    middle = axes[:-1] @ turned
    rises = middle[:, :, 2]
    steps = rises * (freedoms[:, :1] + pitch)
    places = _sums(count) @ steps
    # What the first half of a tilt turns by and what the second does differ along the plates
    # between them alone, across which the level rises: together they turn about its middle.
    turns = rates @ middle[:, :, :2].transpose(0, 2, 1)
    return Chain(places, axes, rises, places[1:] - steps / 2, turns)


@lru_cache(maxsize=16)
def _sums(count: int) -> Array:
    """Matrix (count + 1, count) that adds up the rows before each place."""
    return np.tri(count + 1, count, -1)


def _rotations(vectors: Array) -> tuple[Array, Array]:
    """Rotations (n, 3, 3) by vectors (n, 2) in the xy plane, and what a unit of each component,
    half before and half after, turns by in the xy plane between (n, 2, 2): Rodrigues' formula, and
    the mean of the left and the right Jacobian.
    """
    count = len(vectors)
    # A column a level: numpy is the faster the longer its last axis.
    each = vectors.T
    pairs = (each[:, None] * each).reshape(4, count)
    safe = np.maximum(pairs[0] + pairs[3], SMALL)
    angle = np.sqrt(safe)
    sine = np.sin(angle) / angle
    parts = np.empty((12, count))
    parts[0] = 1.0
    np.multiply(sine, each, out=parts[1:3])
    np.multiply((1 - np.cos(angle)) / safe, pairs, out=parts[3:7])
    parts[7] = sine
    np.multiply((1 - sine) / safe, pairs, out=parts[8:])
    found = parts.T @ TURNED
    return found[:, :9].reshape(count, 3, 3), found[:, 9:].reshape(count, 2, 2)


def crossing(vectors: Array) -> Array:
    """Matrices (..., 3, 3) that make of a row its vector product, the vectors (..., 3) first."""
    return np.asarray((vectors @ CROSS).reshape(*vectors.shape, 3))


def felt(arms: Array, forces: Array) -> Array:
    """What movements as of ``twists`` do with forces f at points x: (n, 6, 4).

    Of the sum of x f (n, 3, 3) and of f (n, 3) over the points. The first three of the last axis
    are the sum of (movement of x) x f, the fourth is that of (movement of x) . f.
    """
    both = np.concatenate([arms.reshape(-1, 9), forces], axis=1)
    return np.asarray((both @ FELT).reshape(-1, 6, 4))


def twists(at: Chain) -> Array:
    """What a unit of each freedom does to all plates beyond its level: (n, 3, 6).

    The first three turn, the others move: a point x of these plates moves by turn x x + move.
    """
    found = np.zeros((len(at.rises), 3, 6))
    found[:, 0, 3:] = at.rises
    found[:, 1:, :3] = at.turns
    np.matmul(at.turns, crossing(at.middles), out=found[:, 1:, 3:])
    return found


# What the levels of a stack do on their own: energy of balloons and of rims that meet.
#
# Arrays have a row a level, or a row a kind of balloon; lengths mm, energies uJ, volumes ul.


RING = 6
"""Points of each balloon at which its gap is looked at."""
SHUT = 2e4
"""mN/mm with which a flat balloon resists being flattened further: no film gives way visibly."""


class GapPlaces(NamedTuple):
    """Where levels are looked at, whatever the pressures.

    ``begins`` (rows, chambers x points) is where the potential of each point begins in the table of
    springs. ``ring`` (rows, chambers x points, 3) are the gaps there, in pieces of the spline, by
    rise and tilt, ``squares`` (rows, chambers x points, 9) their products. ``meet`` (rows, 3,
    points) are the gaps at all that may be shut: the same, then the rims in mm; ``shut`` (rows,
    points, 9) their products by how hard each resists.
    """

    begins: NDArray[np.int_]
    ring: Array
    squares: Array
    meet: Array
    shut: Array

    @classmethod
    def of(cls, maps: Sequence[BalloonMap], gaps: Array, rims: Array) -> GapPlaces:
        """A row a kind of balloon, with gaps at its ring and round its rim, in mm."""
        count = gaps.shape[1]
        begins = np.arange(len(maps) * count // RING).reshape(len(maps), -1) * PIECES_IN_ALL
        spans = np.array([[one.spans] for one in maps])
        ring = gaps * spans[..., None]
        stiff = np.full((len(maps), count + rims.shape[1]), SHUT / RING)
        stiff[:, :count] /= spans * spans
        meet = np.concatenate([ring, rims], axis=1)
        squares = (meet[..., :, None] * meet[..., None, :]).reshape(*meet.shape[:2], 9)
        return cls(
            np.repeat(begins, RING, axis=1),
            ring,
            squares[:, :count],
            np.ascontiguousarray(meet.transpose(0, 2, 1)),
            squares * stiff[..., None],
        )

    def at(self, levels: NDArray[np.int_]) -> GapPlaces:
        """A row for each of these; one row for all where they are alike."""
        if len(self.begins) == 1:
            return self
        begins, ring, squares, meet, shut = self
        return GapPlaces(begins[levels], ring[levels], squares[levels], meet[levels], shut[levels])


@dataclass(frozen=True, eq=False)
class Springs:
    """What levels do at given pressures, looked at in ``places``.

    ``table`` holds the ``derivatives`` of the potentials of all splines, then of their volumes.
    """

    table: Array
    places: GapPlaces

    @classmethod
    def pressed(
        cls,
        maps: Sequence[BalloonMap],
        pressures: Array,
        places: GapPlaces,
        sucked: bool = False,
    ) -> Springs:
        """Those of kinds of balloons at pressures, one a chamber, below 0 only where ``sucked``."""
        found = np.stack([one.pressed(pressures, sucked) for one in maps])
        # Each point has its share of its balloon.
        rows = found.transpose(2, 0, 1, 3, 4).reshape(-1, DEGREE + 1) / RING
        return cls(derivatives(rows), places)

    def meeting(self, freedoms: Array, move: Array) -> tuple[Array, Array] | None:
        """What rims would do, by gradient (rows, 3) and second derivatives (rows, 3, 3), if those
        which a move closes were shut from where they are; None where it closes none.
        """
        first = self.places.begins.shape[1]
        rims = self.places.meet[:, :, first:]
        ends = ((freedoms + move)[:, None] @ rims)[:, 0]
        if ends.min() >= 0:
            return None
        met = (ends < 0) & ((freedoms[:, None] @ rims)[:, 0] >= 0)
        if not met.any():
            return None
        stiffer = self._shut(met, first)
        return (stiffer @ freedoms[..., None])[..., 0], stiffer

    def _shut(self, met: NDArray[np.bool_], first: int = 0) -> Array:
        """Second derivatives (rows, 3, 3) of what resists where ``met`` (rows, points)."""
        each = met.astype(float)[:, None] @ self.places.shut[:, first:]
        return np.asarray(each.reshape(-1, 3, 3))

    def energy(self, freedoms: Array) -> tuple[Array, Array, Array]:
        """Energy (rows) in uJ with its gradient (rows, 3) and second derivatives (rows, 3, 3)."""
        begins, ring, squares, meet, _ = self.places
        gaps = (freedoms[:, None] @ meet)[:, 0]
        value, first, second = horner(self.table, begins, gaps[:, : begins.shape[1]])
        value = value @ np.ones(value.shape[-1])
        gradient = (first[:, None] @ ring)[:, 0]
        matrix = (second[:, None] @ squares).reshape(-1, 3, 3)
        if gaps.min() < 0:
            stiffer = self._shut(gaps < 0)
            push = (stiffer @ freedoms[..., None])[..., 0]
            value += (push * freedoms).sum(-1) / 2
            gradient += push
            matrix += stiffer
        return value, gradient, matrix

    def contents(self, freedoms: Array) -> tuple[Array, Array]:
        """Volume in ul of each balloon (rows, chambers), and the potential of each row."""
        begins, ring = self.places.begins, self.places.ring
        gaps = (ring @ freedoms[..., None])[..., 0]
        both = begins + np.array([[[0]], [[self.table.shape[2] // 2]]])
        stored, held = horner(self.table[:, 0], both, gaps)
        return held.reshape(len(held), -1, RING).sum(-1), stored.sum(-1)


# What acts on a stack from outside, and what the stack's energy then does.


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
