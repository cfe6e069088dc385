"""Energy of a stack under load: kinematics of its chain of plates, springs of its levels, and
external forces.

A level has three freedoms: its rise (mm) and the tilt of its upper plate, a rotation vector in the
lower plate's plane (rad). Half of the tilt comes before the rise and half after, as with constant
curvature within a level. Arrays have one row per level, and any leading axes: those of many states.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sbafab.errors import DesignError
from sbafab.models.balloon_map import DEGREE, BalloonMap, horner
from sbafab.models.film_elements import Array

SMALL = 1e-8
"""Square of the angle below which functions of the angle are replaced by those at this one."""
BASE = np.eye(3)
LEVI_CIVITA = np.zeros((3, 3, 3))
"""The Levi-Civita symbol."""
LEVI_CIVITA[[0, 1, 2], [1, 2, 0], [2, 0, 1]] = 1.0
LEVI_CIVITA[[0, 2, 1], [2, 1, 0], [1, 0, 2]] = -1.0
CROSS = LEVI_CIVITA.transpose(1, 2, 0).reshape(3, 9)


def _force_motion_matrix() -> Array:
    """Return the matrix (12, 24) behind ``force_motions``."""
    matrix = np.zeros((12, 6, 4))
    arms, forces = matrix[:9].reshape(3, 3, 6, 4), matrix[9:]
    unit = np.eye(3)
    # (turn x x) x f is x (turn . f) less turn (x . f).
    arms[:, :, :3, :3] = np.einsum("kc,lr->klrc", unit, unit) - np.einsum("kl,rc->klrc", unit, unit)
    arms[:, :, :3, 3] = LEVI_CIVITA.transpose(1, 2, 0)
    forces[:, 3:, :3] = -LEVI_CIVITA.transpose(1, 2, 0)
    forces[:, 3:, 3] = unit
    return matrix.reshape(12, 24)


FORCE_MOTION = _force_motion_matrix()


def _rotation_matrix() -> Array:
    """Return the matrix (12, 13) of ``rotations``: by 1, x, y, xx, xy, yx, yy, 1, xx .. yy."""
    matrix = np.zeros((12, 13))
    turn, rate = matrix[:, :9].reshape(12, 3, 3), matrix[:, 9:].reshape(12, 2, 2)
    turn[0] = BASE
    # The vector (x, y, 0) as a cross product, then that twice.
    turn[1:3] = LEVI_CIVITA[:, :2].transpose(1, 0, 2)
    turn[3:7] = (turn[1:3, None] @ turn[None, 1:3]).reshape(4, 3, 3)
    rate[7] = BASE[:2, :2]
    rate[8:] = np.eye(4).reshape(4, 2, 2)
    return matrix


ROTATION = _rotation_matrix()


class Chain(NamedTuple):
    """Plates of a chain, the base first: places (..., n + 1, 3) in mm and axes (..., n + 1, 3, 3),
    whose columns are the plates' x, y and z; ``rises`` (..., n, 3) are the levels' directions.

    A level's tilt turns all beyond it about its middle: ``middles`` (..., n, 3) in mm; ``turns``
    (..., n, 2, 3) are the rotations by a unit of either tilt.
    """

    places: Array
    axes: Array
    rises: Array
    middles: Array
    turns: Array

    @property
    def tip(self) -> Array:
        """Middle of the top plate in mm: (..., 3)."""
        return np.asarray(self.places[..., -1, :])

    def tip_motion(self, motions: Array) -> Array:
        """Return the motion of the tip, then the turn of the top, by freedoms, from the
        ``level_motions``: (..., levels, 3, 6).
        """
        turns = motions[..., :3]
        moves = motions[..., 3:] - turns @ crossing(self.tip)[..., None, :, :]
        return np.concatenate([moves, turns], axis=-1)


def plate_chain(freedoms: Array, pitch: float) -> Chain:
    """Return the plates of levels with freedoms (..., n, 3), each ``pitch`` mm high when flat."""
    *lead, count, _ = freedoms.shape
    turned, rates = rotations(freedoms[..., 1:] / 2)
    axes = np.empty((*lead, count + 1, 3, 3))
    axes[..., 0, :, :] = BASE
    np.matmul(turned, turned, out=axes[..., 1:, :, :])
    reach = 1
    while reach < count:
        # Each is already the product of ``reach`` levels up to its own.
        axes[..., reach + 1 :, :, :] = axes[..., 1:-reach, :, :] @ axes[..., reach + 1 :, :, :]
        reach *= 2
    middle = axes[..., :-1, :, :] @ turned
    rises = middle[..., 2]
    steps = rises * (freedoms[..., :1] + pitch)
    places = _sums(count) @ steps
    # What the first half of a tilt turns by and what the second does differ along the plates
    # between them alone, across which the level rises: together they turn about its middle.
    turns = rates @ middle[..., :2].swapaxes(-1, -2)
    return Chain(places, axes, rises, places[..., 1:, :] - steps / 2, turns)


@lru_cache(maxsize=16)
def _sums(count: int) -> Array:
    """Return the matrix (count + 1, count) that adds up the rows before each place."""
    return np.tri(count + 1, count, -1)


def rotations(vectors: Array) -> tuple[Array, Array]:
    """Return rotations (..., 3, 3) by vectors (..., 2) in the xy plane, and the rotation by a unit
    of each component, half before and half after, in the xy plane between (..., 2, 2): Rodrigues'
    formula, and the mean of the left and the right Jacobian.
    """
    # One column per vector: numpy is faster with a longer last axis.
    each = vectors.reshape(-1, 2).T
    count = each.shape[1]
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
    rows = (parts.T @ ROTATION).reshape(*vectors.shape[:-1], 13)
    turned = rows[..., :9].reshape(*vectors.shape[:-1], 3, 3)
    return turned, rows[..., 9:].reshape(*vectors.shape[:-1], 2, 2)


def crossing(vectors: Array) -> Array:
    """Return matrices (..., 3, 3) of the vector product of vectors (..., 3) with a row."""
    return np.asarray((vectors @ CROSS).reshape(*vectors.shape, 3))


def force_motions(arms: Array, forces: Array) -> Array:
    """Return moments and work of forces f at points x under motions as of ``level_motions``: (...,
    6, 4).

    From the sum of x f (..., 3, 3) and of f (..., 3) over the points. The first three of the last
    axis are the sum of (motion of x) x f, the fourth is the sum of (motion of x) . f.
    """
    both = np.concatenate([arms.reshape(*forces.shape[:-1], 9), forces], axis=-1)
    return np.asarray((both @ FORCE_MOTION).reshape(*forces.shape[:-1], 6, 4))


def level_motions(at: Chain) -> Array:
    """Return the motion of all plates beyond a level by a unit of each of its freedoms: (..., n, 3,
    6).

    The first three turn, the others move: a point x of these plates moves by turn x x + move.
    """
    motions = np.zeros((*at.rises.shape, 6))
    motions[..., 0, 3:] = at.rises
    motions[..., 1:, :3] = at.turns
    np.matmul(at.turns, crossing(at.middles), out=motions[..., 1:, 3:])
    return motions


# Springs of the levels: energy of balloons and of rims that meet.
#
# Arrays have one row per level or per kind of balloon; lengths mm, energies uJ, volumes ul.


RING_POINTS = 6
"""Points of each balloon at which its gap is evaluated."""
RIM_STIFFNESS = 2e4
"""Contact stiffness in mN/mm of a flat balloon, and of rims: films barely yield."""


def by_row(vectors: Array, matrices: Array) -> Array:
    """Return the products of vectors (..., rows, k) with matrices (rows, k, m), or with a single
    one for all rows.
    """
    if len(matrices) == 1:
        return np.asarray(vectors @ matrices[0])
    return np.asarray((vectors[..., None, :] @ matrices)[..., 0, :])


class GapPlaces(NamedTuple):
    """Points at which the gaps of levels are evaluated, at any pressure.

    ``kinds`` (rows, 1) are the rows' kinds of balloon; ``chambers`` and ``shares`` (ring points)
    the chamber of each point of the rings and its share of its balloon. ``meet`` (rows, 3, points)
    are all gaps that may close, by rise and tilt: the rings' gaps, in pieces of the spline, then
    the rims' in mm. ``ring`` (rows, ring points, 3) are the former, ``squares`` (rows, ring points,
    9) their products, both as a point's share of its balloon; ``shut`` (rows, points, 9) are the
    products of all gaps times the contact stiffness.
    """

    kinds: NDArray[np.int_]
    chambers: NDArray[np.int_]
    shares: Array
    meet: Array
    ring: Array
    squares: Array
    shut: Array

    @classmethod
    def of(cls, maps: Sequence[BalloonMap], gaps: Array, rims: Array) -> GapPlaces:
        """Return one row per kind of balloon, with gaps at its ring and round its rim, in mm."""
        count = gaps.shape[1]
        spans = np.array([[kind.spans] for kind in maps])
        ring = gaps * spans[..., None]
        stiff = np.full((len(maps), count + rims.shape[1]), RIM_STIFFNESS / RING_POINTS)
        stiff[:, :count] /= spans * spans
        meet = np.concatenate([ring, rims], axis=1)
        squares = (meet[..., :, None] * meet[..., None, :]).reshape(*meet.shape[:2], 9)
        return cls(
            np.arange(len(maps))[:, None],
            np.repeat(np.arange(count // RING_POINTS), RING_POINTS),
            np.full(count, 1 / RING_POINTS),
            np.ascontiguousarray(meet.transpose(0, 2, 1)),
            ring / RING_POINTS,
            squares[:, :count] / RING_POINTS,
            squares * stiff[..., None],
        )

    def at(self, levels: NDArray[np.int_]) -> GapPlaces:
        """Return a row for each level; a single row if all are equal."""
        if len(self.kinds) == 1:
            return self
        kinds, chambers, shares, *parts = self
        return GapPlaces(kinds[levels], chambers, shares, *(part[levels] for part in parts))

    def closed(self, freedoms: Array) -> NDArray[np.bool_]:
        """Return which contacts of balloons and rims are closed: (..., rows, points)."""
        return np.asarray(by_row(freedoms, self.meet) < 0)


@dataclass(frozen=True, eq=False)
class Springs:
    """Elastic response of rows of levels at given pressures, of any number of states, evaluated in
    ``places``.

    ``table`` (powers, rows) are the pieces of the splines of all potentials, of their volumes and,
    if asked for, of the volumes' rates by pressure; ``begins`` (..., rows, ring points) is the row
    of each point's first piece, ``stride`` leads from a piece to the next and ``step`` from a
    potential to its volume.
    """

    table: Array
    begins: NDArray[np.int_]
    stride: int
    step: int
    places: GapPlaces

    @classmethod
    def pressed(
        cls,
        maps: Sequence[BalloonMap],
        pressures: Array,
        places: GapPlaces,
        sucked: bool = False,
        orders: int = 2,
    ) -> Springs:
        """Return the springs of maps at pressures (..., chambers), below 0 only where ``sucked``;
        rates of volumes by pressure need three ``orders``.
        """
        parts = [kind.splines(pressures, orders, sucked)[:, :, None] for kind in maps]
        table = parts[0] if len(parts) == 1 else np.concatenate(parts, axis=2)
        *lead, chambers = pressures.shape
        states = np.arange(0, pressures.size, chambers).reshape(*lead, 1, 1)
        begins = states + (orders * pressures.size * places.kinds + places.chambers)
        return cls(
            table.reshape(DEGREE + 1, -1),
            begins,
            len(maps) * orders * pressures.size,
            pressures.size,
            places,
        )

    def at(self, where: Any) -> Springs:
        """Return the springs of some of the states."""
        return replace(self, begins=self.begins[where])

    def meeting(self, freedoms: Array, move: Array) -> tuple[Array, Array] | None:
        """Return gradient (..., rows, 3) and second derivatives (..., rows, 3, 3) of the contact of
        the rims that a move closes, as if shut from the start; None if it closes none.
        """
        first = len(self.places.chambers)
        rims = self.places.meet[..., first:]
        ends = by_row(freedoms + move, rims)
        if ends.min() >= 0:
            return None
        met = (ends < 0) & (by_row(freedoms, rims) >= 0)
        if not met.any():
            return None
        stiffer = self._shut(met, first)
        return (stiffer @ freedoms[..., None])[..., 0], stiffer

    def _shut(self, met: NDArray[np.bool_], first: int = 0) -> Array:
        """Return the contact stiffness (..., rows, 3, 3) of the points ``met`` (..., rows,
        points).
        """
        each = by_row(met.astype(float), self.places.shut[:, first:])
        return each.reshape(*met.shape[:-1], 3, 3)

    def energy(self, freedoms: Array) -> tuple[Array, Array, Array]:
        """Return energy (..., rows) in uJ, gradient (..., rows, 3), second derivatives (..., rows,
        3, 3).
        """
        count = len(self.places.chambers)
        gaps = by_row(freedoms, self.places.meet)
        value, first, second = horner(self.table, self.begins, gaps[..., :count], self.stride)
        value = value @ self.places.shares
        gradient = by_row(first, self.places.ring)
        matrix = by_row(second, self.places.squares).reshape(*gradient.shape, 3)
        if gaps.min() < 0:
            stiffer = self._shut(gaps < 0)
            push = (stiffer @ freedoms[..., None])[..., 0]
            value += (push * freedoms).sum(-1) / 2
            gradient += push
            matrix += stiffer
        return value, gradient, matrix

    def order(
        self, freedoms: Array, number: ArrayLike, with_rates: bool = True
    ) -> tuple[Array, Array]:
        """Return of each balloon its potential (order 0), its volume in ul (1) or the volume's rate
        by pressure with all plates held (2), without contacts: (..., rows, chambers); and this by
        its level's freedoms: (..., rows, chambers, 3). Several orders come first.
        """
        gaps = by_row(freedoms, self.places.meet)[..., : len(self.places.chambers)]
        steps = self.step * np.asarray(number)
        begins = self.begins + steps[(..., *(None,) * self.begins.ndim)]
        values, rates, _ = horner(self.table, begins, gaps, self.stride, with_rates)
        value = values.reshape(*values.shape[:-1], -1, RING_POINTS).mean(-1)
        if not with_rates:
            return value, np.zeros(0)
        by_point = rates[..., None] * self.places.ring
        return value, by_point.reshape(*rates.shape[:-1], -1, RING_POINTS, 3).sum(-2)


# External loads, and the energy of a stack under them.


WALL_STIFFNESS = 1e6
"""mN/mm of an outer plate."""
WALL_POINTS = 12
"""Points round the top's outline that may touch the outer plate."""
WALL_TURNS = np.arange(WALL_POINTS) * math.tau / WALL_POINTS
WALL_RIM = np.stack([np.cos(WALL_TURNS), np.sin(WALL_TURNS), 0 * WALL_TURNS], -1)


def vector_of(values: Sequence[float], quantity: str) -> Array:
    """Return three numbers (3,). Raises DesignError if they are not three, or not finite."""
    try:
        vector = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        vector = np.zeros(0)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise DesignError(f"{quantity} must be three finite numbers, such as (0, 0, -0.1)")
    return vector


def direction_of(values: Sequence[float], quantity: str) -> Array:
    """Return the direction (3,) of three numbers. Raises DesignError if they have none."""
    vector = vector_of(values, quantity)
    length = float(np.linalg.norm(vector))
    if not length:
        raise DesignError(f"{quantity} has no direction; give three numbers that are not all 0")
    return vector / length


class OuterPlate(NamedTuple):
    """An outer plate: the line (``point`` and ``normal``) on which the tip meets it; with
    ``sticks`` friction holds the tip on that line.

    Points fixed to the top may not pass the plate: those round its rim, then, where it sticks, its
    middle either way across the line. ``local`` (points, 3) are their places on the top in mm,
    ``ways`` (points, 3) the constrained directions, ``crosses`` (points, 3, 3) the matrices of the
    vector product with these; ``least`` (points) the least depth in mm at which each is in contact.
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
        """Return the plate for a top whose rim has the radius ``outline`` in mm."""
        local, ways, least = (
            outline * WALL_RIM,
            np.tile(normal, (WALL_POINTS, 1)),
            np.zeros(WALL_POINTS),
        )
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
        """True if it lies level."""
        return float(self.normal[2]) > 0.999


@lru_cache(maxsize=256)
def outer_plate(line: tuple[float, ...], sticks: bool, outline: float) -> OuterPlate:
    """Return the plate on a line: a point in mm, then the normal."""
    return OuterPlate.of(np.array(line[:3]), np.array(line[3:]), sticks, outline)


class Load(NamedTuple):
    """External loads: tip force and level weight in mN, outer plate, its stiffness in mN/mm."""

    tip: Array
    weight: Array | None
    wall: OuterPlate | None
    stiffness: float = WALL_STIFFNESS


class PlateContact(NamedTuple):
    """Contact of the top with an outer plate: depth in mm of its points, ``deep`` (..., points),
    and their increase by a unit of each turn and move of ``level_motions``, ``lines`` (..., points,
    6).

    ``stiff`` and ``least`` (points) are their stiffness and least depth; ``forces`` (..., points)
    in mN.
    """

    deep: Array
    lines: Array
    stiff: Array
    least: Array
    forces: Array

    @property
    def push(self) -> Array:
        """Force in mN on the plate: (...)."""
        return np.asarray(self.forces[..., :WALL_POINTS].sum(-1))

    @property
    def touches(self) -> NDArray[np.bool_]:
        """Which points are in contact: (..., points)."""
        return np.asarray(self.deep > self.least)

    def resists(self, deep: Array) -> Array:
        """Return the forces in mN at depths in mm."""
        return np.asarray(self.stiff * np.maximum(deep, self.least))


class ExternalForces(NamedTuple):
    """External forces on the plates: the sum of the forces f beyond each level (..., n, 3), the sum
    of x f over their points x (..., n, 3, 3), and their energy (...); n is 1 if all levels carry
    the same.
    """

    forces: Array
    arms: Array
    energy: Array
    touch: PlateContact | None = None


def external_forces(plates: Chain, load: Load, forces: Array | None) -> ExternalForces:
    tip = plates.tip[..., None, :]
    acting = ExternalForces(
        np.zeros(tip.shape) + load.tip, tip[..., None] * load.tip, -(tip @ load.tip)[..., 0]
    )
    if load.wall is not None:
        acting = _with_contact(acting, plates, load.wall, load.stiffness, forces)
    if load.weight is not None:
        beyond, number = plates_beyond(plates.rises.shape[-2])
        above = beyond @ plates.places
        acting = ExternalForces(
            acting.forces + number * load.weight,
            acting.arms + above[..., None] * load.weight,
            acting.energy - above[..., 0, :] @ load.weight,
            acting.touch,
        )
    return acting


def _with_contact(
    acting: ExternalForces, plates: Chain, wall: OuterPlate, stiffness: float, forces: Array | None
) -> ExternalForces:
    """Return the forces, including the outer plate's: ``forces``, or by its stiffness."""
    points = plates.tip[..., None, :] + wall.local @ plates.axes[..., -1, :, :].swapaxes(-1, -2)
    deep = ((points - wall.point) * wall.ways).sum(-1)
    lines = np.empty((*points.shape[:-1], 6))
    lines[..., :3] = (points[..., None, :] @ wall.crosses)[..., 0, :]
    lines[..., 3:] = wall.ways
    stiff = np.full(len(wall.local), stiffness)
    stiff[:WALL_POINTS] /= WALL_POINTS
    resists = stiff * np.maximum(deep, wall.least)
    acts = resists if forces is None else forces
    each = acts[..., None] * wall.ways
    return ExternalForces(
        acting.forces - (acts @ wall.ways)[..., None, :],
        acting.arms - (points.swapaxes(-1, -2) @ each)[..., None, :, :],
        acting.energy + (resists * deep).sum(-1) / 2,
        PlateContact(deep, lines, stiff, wall.least, acts),
    )


@lru_cache(maxsize=16)
def plates_beyond(count: int) -> tuple[Array, Array]:
    """Return a mask of plates beyond each level (count, count + 1), and their number."""
    mask = 1.0 - np.tri(count, count + 1)
    return mask, mask.sum(axis=1, keepdims=True)


class LoadedEnergy(NamedTuple):
    """Energy (...) of a stack under a load with its gradient (..., freedoms).

    ``spring_gradient`` (..., levels, 3) and ``blocks`` (..., levels, 3, 3) are first and second
    derivatives of the springs; ``motions`` (..., levels, 3, 6) of the ``plates`` beyond each level
    by its freedoms, ``works`` (..., levels, 3, 6, 4) those with the forces ``acting`` on them.
    """

    value: Array
    gradient: Array
    spring_gradient: Array
    blocks: Array
    motions: Array
    works: Array
    plates: Chain
    acting: ExternalForces

    @property
    def touch(self) -> PlateContact | None:
        """Contact with an outer plate."""
        return self.acting.touch

    @property
    def push(self) -> Array:
        """Force in mN on the outer plate: (...)."""
        return np.zeros(self.value.shape) if self.touch is None else self.touch.push

    @property
    def flat_motions(self) -> Array:
        """The motions by all freedoms: (..., freedoms, 6)."""
        return self.motions.reshape(*self.gradient.shape, 6)

    def turned(self) -> Array:
        """Return the geometric stiffness (..., freedoms, freedoms), by the forces alone.

        A level nearer the base turns all motions beyond it. The mutual effect of the two tilts of
        one level is taken at its mean: enough for a descent.
        """
        moments = self.works[..., :3].reshape(*self.gradient.shape, 3)
        half = self.flat_motions[..., :3] @ moments.swapaxes(-1, -2)
        half *= base_side(half.shape[-1] // 3)
        whole = half + half.swapaxes(-1, -2)
        return np.negative(whole, out=whole)

    def deeper(self, touch: PlateContact) -> Array:
        """Return a contact's depths in mm by a unit of each freedom: (..., points, freedoms)."""
        return np.asarray(touch.lines @ self.flat_motions.swapaxes(-1, -2))

    def rest(self) -> Array:
        """Return the tangent stiffness (..., freedoms, freedoms) without the springs."""
        stiffness = self.turned()
        if self.touch is not None:
            lines = self.deeper(self.touch)
            stiff = (self.touch.stiff * self.touch.touches)[..., None, :]
            stiffness += (lines.swapaxes(-1, -2) * stiff) @ lines
        return stiffness


def with_diagonal_blocks(rest: Array, blocks: Array) -> Array:
    """Return a matrix (..., freedoms, freedoms) with blocks (..., levels, 3, 3) added on its
    diagonal.
    """
    whole = rest.copy()
    count = blocks.shape[-3]
    diagonal = np.einsum("...iaib->...iab", whole.reshape(*rest.shape[:-2], count, 3, count, 3))
    diagonal += blocks
    return whole


def loaded_energy(
    springs: Springs, pitch: float, load: Load, at: Array, forces: Array | None = None
) -> LoadedEnergy:
    """Return the energy of a stack under a load at freedoms (..., levels, 3), with contact
    ``forces`` (..., points) in mN of an outer plate if given: the gradient is then the residual
    against these.
    """
    value, spring_gradient, blocks = springs.energy(at)
    plates = plate_chain(at, pitch)
    acting = external_forces(plates, load, forces)
    motions = level_motions(plates)
    works = motions @ force_motions(acting.arms, acting.forces)
    gradient = spring_gradient - works[..., 3]
    energy = value.sum(-1) + acting.energy
    flat = gradient.reshape(*at.shape[:-2], -1)
    return LoadedEnergy(energy, flat, spring_gradient, blocks, motions, works, plates, acting)


@lru_cache(maxsize=16)
def base_side(count: int) -> Array:
    """Return 1 where the row's level is nearer the base than the column's, 1/2 if equal."""
    level = np.repeat(np.arange(count), 3)
    return np.asarray(np.heaviside(level[None, :] - level[:, None], 0.5))
