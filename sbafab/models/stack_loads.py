"""Energy of stacks under load, with first and second derivatives: kinematics of the chain of
plates, springs of the levels, and external forces.

A level has three degrees of freedom ("freedoms"): its rise (mm) and the tilt of its upper plate, a
rotation vector in the lower plate's plane (rad). Half of the tilt comes before the rise and half
after, as with constant curvature within a level. The first axis of arrays is that of states, the
next that of levels, or of kinds of balloons if no load makes equal levels differ. Lengths mm,
energies uJ, volumes ul, forces mN.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sbafab.models.balloon_map import BalloonMap, horner
from sbafab.models.film_elements import Array

SMALL = 1e-8
"""Square of the angle below which functions of the angle are replaced by those at this one."""
CROSS = np.zeros((3, 3, 3))
"""The Levi-Civita symbol."""
CROSS[[0, 1, 2], [1, 2, 0], [2, 0, 1]] = 1.0
CROSS[[0, 2, 1], [2, 1, 0], [1, 0, 2]] = -1.0
FLAT_CROSS = CROSS.transpose(1, 2, 0).reshape(3, 9)


class Chain(NamedTuple):
    """Plates of chains, the base first: places (n, levels + 1, 3) in mm and axes (n, levels + 1, 3,
    3), whose columns are the plates' x, y and z; ``rises`` (n, levels, 3) are the levels'
    directions.

    A level's tilt rotates all plates beyond it about its middle: ``middles`` (n, levels, 3) in mm;
    ``turns`` (n, levels, 2, 3) are the rotations per unit of either tilt.
    """

    places: Array
    axes: Array
    rises: Array
    middles: Array
    turns: Array

    @property
    def tip(self) -> Array:
        """The middle of the top plate in mm: (n, 3)."""
        return np.asarray(self.places[..., -1, :])

    def motions(self) -> Array:
        """Return the motion of all plates beyond a level per unit of each of its freedoms: (n,
        levels, 3, 6).

        The first three are rotations, the others translations: a point x of these plates moves by
        turn x x + move.
        """
        motions = np.zeros((*self.rises.shape, 6))
        motions[..., 0, 3:] = self.rises
        motions[..., 1:, :3] = self.turns
        np.matmul(self.turns, crossing(self.middles), out=motions[..., 1:, 3:])
        return motions


def plate_chain(freedoms: Array, pitch: float) -> Chain:
    """The plates of levels with freedoms (..., levels, 3), each ``pitch`` mm high when flat."""
    *lead, count, _ = freedoms.shape
    turned, rates = rotations(freedoms[..., 1:] / 2)
    axes = np.empty((*lead, count + 1, 3, 3))
    axes[..., 0, :, :] = np.eye(3)
    np.matmul(turned, turned, out=axes[..., 1:, :, :])
    reach = 1
    while reach < count:
        # Each is already the product of ``reach`` levels up to its own.
        axes[..., reach + 1 :, :, :] = axes[..., 1:-reach, :, :] @ axes[..., reach + 1 :, :, :]
        reach *= 2
    middle = axes[..., :-1, :, :] @ turned
    rises = middle[..., 2]
    steps = rises * (freedoms[..., :1] + pitch)
    places = np.tri(count + 1, count, -1) @ steps
    # What the first half of a tilt turns by and what the second does differ along the plates
    # between them alone, across which the level rises: together they turn about its middle.
    turns = rates @ middle[..., :2].swapaxes(-1, -2)
    return Chain(places, axes, rises, places[..., 1:, :] - steps / 2, turns)


def rotations(vectors: Array) -> tuple[Array, Array]:
    """Return rotations (..., 3, 3) from vectors (..., 2) in the xy plane, and the rotation per unit
    of each component, half before and half after, in the xy plane between (..., 2, 2): Rodrigues'
    formula, and the mean of the left and right Jacobians.
    """
    x, y = vectors[..., 0], vectors[..., 1]
    xx, xy, yy = x * x, x * y, y * y
    safe = np.maximum(xx + yy, SMALL)
    angle = np.sqrt(safe)
    sine, versine = np.sin(angle) / angle, (1 - np.cos(angle)) / safe
    turned, rates = np.empty((*x.shape, 3, 3)), np.empty((*x.shape, 2, 2))
    turned[..., 0, 0], turned[..., 1, 1] = 1 - versine * yy, 1 - versine * xx
    turned[..., 2, 2] = 1 - versine * (xx + yy)
    turned[..., 0, 1] = turned[..., 1, 0] = versine * xy
    turned[..., 0, 2], turned[..., 1, 2] = sine * y, -sine * x
    turned[..., 2, :2] = -turned[..., :2, 2]
    mean = (1 - sine) / safe
    rates[..., 0, 0], rates[..., 1, 1] = sine + mean * xx, sine + mean * yy
    rates[..., 0, 1] = rates[..., 1, 0] = mean * xy
    return turned, rates


def crossing(vectors: Array) -> Array:
    """Return the matrices (..., 3, 3) of the cross product with vectors (..., 3)."""
    return np.asarray((vectors @ FLAT_CROSS).reshape(*vectors.shape, 3))


def force_motions(arms: Array, forces: Array) -> Array:
    """Return moments and work of forces f at points x under motions as in ``Chain.motions``: (...,
    6, 4).

    They follow from the sum of x f (..., 3, 3) and of f (..., 3) over the points. The first three
    of the last axis are the sum of (motion of x) x f, the fourth is the sum of (motion of x) . f.
    """
    matrix = np.empty((*forces.shape[:-1], 6, 4))
    # (turn x x) x f is x (turn . f) less turn (x . f).
    trace = np.trace(arms, axis1=-2, axis2=-1)[..., None, None]
    matrix[..., :3, :3] = arms.swapaxes(-1, -2) - trace * np.eye(3)
    matrix[..., :3, 3] = arms.reshape(*forces.shape[:-1], 9) @ FLAT_CROSS.T
    matrix[..., 3:, :3] = -crossing(forces)
    matrix[..., 3:, 3] = forces
    return matrix


# Springs of the levels: energy of balloons and of rims that meet.


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

    ``kinds`` (rows, 1) are the rows' kinds of balloon; ``chambers`` (ring points) the chamber of
    each point of the rings. ``meet`` (rows, 3, points) are all gaps that may close, as functions of
    rise and tilt: the rings' gaps, in pieces of the spline, then the rims' in mm. ``ring`` (rows,
    ring points, 3) are the former, ``squares`` (rows, ring points, 9) their products, both as a
    point's fraction of its balloon; ``shut`` (rows, points, 9) are the products of all gaps times
    the contact stiffness.
    """

    kinds: NDArray[np.int_]
    chambers: NDArray[np.int_]
    meet: Array
    ring: Array
    squares: Array
    shut: Array

    @classmethod
    def of(cls, maps: Sequence[BalloonMap], gaps: Array, rims: Array) -> GapPlaces:
        """Return one row per kind of balloon, with gaps at its ring and around its rim, in mm."""
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
            np.ascontiguousarray(meet.transpose(0, 2, 1)),
            ring / RING_POINTS,
            squares[:, :count] / RING_POINTS,
            squares * stiff[..., None],
        )

    def at(self, levels: NDArray[np.int_]) -> GapPlaces:
        """Return one row per level; a single row if all are equal."""
        if len(self.kinds) == 1:
            return self
        kinds, chambers, *parts = self
        return GapPlaces(kinds[levels], chambers, *(part[levels] for part in parts))


class Springs(NamedTuple):
    """Elastic response of rows of levels at given pressures, of n states, evaluated in ``places``.

    ``table`` (powers, rows) are the pieces of the splines of all potentials, of their volumes and,
    if requested, of the volumes' derivatives with respect to pressure; ``begins`` (n, rows, ring
    points) is the row of each point's first piece, ``stride`` leads from a piece to the next and
    ``step`` from a potential to its volume.
    """

    table: Array
    begins: NDArray[np.int_]
    stride: int
    step: int
    places: GapPlaces

    def at(self, where: Any) -> Springs:
        """Return the springs of some of the states."""
        return self._replace(begins=self.begins[where])

    def energy(self, freedoms: Array) -> tuple[Array, Array, Array]:
        """Return energy (n, rows) in uJ, gradient (n, rows, 3), second derivatives (n, rows, 3,
        3).
        """
        count = len(self.places.chambers)
        gaps = by_row(freedoms, self.places.meet)
        value, first, second = horner(self.table, self.begins, gaps[..., :count], self.stride)
        value = value.sum(-1) / RING_POINTS
        gradient = by_row(first, self.places.ring)
        matrix = by_row(second, self.places.squares).reshape(*gradient.shape, 3)
        if gaps.min(initial=0.0) < 0:
            stiffer = by_row((gaps < 0).astype(float), self.places.shut).reshape(matrix.shape)
            push = (stiffer @ freedoms[..., None])[..., 0]
            value += (push * freedoms).sum(-1) / 2
            gradient += push
            matrix += stiffer
        return value, gradient, matrix

    def order(
        self, freedoms: Array, number: ArrayLike, with_rates: bool = True
    ) -> tuple[Array, Array]:
        """Return for each balloon its potential (order 0), its volume in ul (1) or the volume's
        derivative with respect to pressure with all plates held (2), without contacts: (n, rows,
        chambers); and its derivative with respect to its level's freedoms: (n, rows, chambers, 3).
        Several orders come first.
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


class OuterPlate(NamedTuple):
    """An outer plate: the line (``point`` and ``normal``) on which the tip meets it; with
    ``sticks`` friction holds the tip on that line.

    Points fixed to the top may not pass the plate: those around its rim, then, if it sticks, its
    middle in both directions across the line. ``local`` (points, 3) are their positions on the top
    in mm, ``ways`` (points, 3) the constrained directions; ``least`` (points) the least depth in mm
    at which each is in contact.
    """

    point: Array
    normal: Array
    sticks: bool
    local: Array
    ways: Array
    least: Array

    @classmethod
    def of(cls, point: Array, normal: Array, sticks: bool, outline: float) -> OuterPlate:
        """Return the plate for a top with a rim radius ``outline`` in mm."""
        local, ways = outline * WALL_RIM, np.tile(normal, (WALL_POINTS, 1))
        least = np.zeros(WALL_POINTS)
        if sticks:
            aside = np.eye(3)[np.argmin(np.abs(normal))]
            aside = aside - (normal @ aside) * normal
            aside /= np.linalg.norm(aside)
            local = np.concatenate([local, np.zeros((2, 3))])
            ways = np.concatenate([ways, [aside, np.cross(normal, aside)]])
            least = np.concatenate([least, [-np.inf, -np.inf]])
        return cls(point, normal, sticks, local, ways, least)

    def contact(self, plates: Chain, stiffness: float, forces: Array | None) -> PlateContact:
        """Return the contact of the top, with ``forces`` in mN, or by a stiffness in mN/mm."""
        points = plates.tip[..., None, :] + self.local @ plates.axes[..., -1, :, :].swapaxes(-1, -2)
        deep = ((points - self.point) * self.ways).sum(-1)
        lines = np.empty((*points.shape[:-1], 6))
        lines[..., :3] = np.cross(points, self.ways)
        lines[..., 3:] = self.ways
        stiff = np.full(len(self.local), stiffness)
        stiff[:WALL_POINTS] /= WALL_POINTS
        acts = stiff * np.maximum(deep, self.least) if forces is None else forces
        return PlateContact(points, deep, lines, stiff, self.least, acts)


class PlateContact(NamedTuple):
    """Contact of the top with an outer plate at ``points`` (n, points, 3).

    ``deep`` (n, points) is their depth in mm, and ``lines`` (n, points, 6) its increase per unit of
    each rotation and translation of ``Chain.motions``. ``stiff`` and ``least`` (points) are their
    stiffness and least depth; ``forces`` (n, points) in mN.
    """

    points: Array
    deep: Array
    lines: Array
    stiff: Array
    least: Array
    forces: Array

    @property
    def push(self) -> Array:
        """The force in mN on the plate: (n)."""
        return np.asarray(self.forces[..., :WALL_POINTS].sum(-1))

    @property
    def stiff_touches(self) -> Array:
        """The stiffness of the points in contact, 0 for others: (n, points)."""
        return self.stiff * (self.deep > self.least)

    def resists(self, deep: Array) -> Array:
        """Return the forces in mN at depths in mm."""
        return np.asarray(self.stiff * np.maximum(deep, self.least))


class Load(NamedTuple):
    """External loads: tip force and level weight in mN, outer plate, its stiffness in mN/mm."""

    tip: Array
    weight: Array | None
    wall: OuterPlate | None
    stiffness: float = WALL_STIFFNESS


NO_LOAD = Load(np.zeros(3), None, None)


def _external_forces(
    plates: Chain, load: Load, touch: PlateContact | None
) -> tuple[Array, Array, Array]:
    """Return the sum of the external forces f beyond each level (n, levels, 3), the sum of x f over
    their points x (n, levels, 3, 3), and their energy (n); one level represents all if all carry
    the same load.
    """
    tip = plates.tip[..., None, :]
    forces, arms = np.zeros(tip.shape) + load.tip, tip[..., None] * load.tip
    energy = -(tip @ load.tip)[..., 0]
    if touch is not None and load.wall is not None:
        each = touch.forces[..., None] * load.wall.ways
        forces = forces - each.sum(-2, keepdims=True)
        arms = arms - (touch.points.swapaxes(-1, -2) @ each)[..., None, :, :]
        energy = energy + (touch.resists(touch.deep) * touch.deep).sum(-1) / 2
    if load.weight is not None:
        count = plates.rises.shape[-2]
        beyond = 1.0 - np.tri(count, count + 1)
        above = beyond @ plates.places
        forces = forces + beyond.sum(1, keepdims=True) * load.weight
        arms = arms + above[..., None] * load.weight
        energy = energy - above[..., 0, :] @ load.weight
    return forces, arms, energy


class Energy(NamedTuple):
    """Energies (n) in uJ with their gradients (n, freedoms) and second derivatives (n, groups,
    size, size).

    Groups are uncoupled freedoms: one per row without a load, and a single group with one. With a
    load, ``plates`` are positioned by ``motions`` (n, freedoms, 6), and ``touch`` an outer plate.
    """

    value: Array
    gradient: Array
    matrix: Array
    plates: Chain | None = None
    motions: Array | None = None
    touch: PlateContact | None = None

    @property
    def push(self) -> Array:
        """The force in mN on the outer plate: (n)."""
        return np.zeros(self.value.shape) if self.touch is None else self.touch.push

    def deeper(self) -> Array:
        """Return the contact's depths in mm per unit of each freedom: (n, points, freedoms)."""
        assert self.touch is not None
        assert self.motions is not None
        return np.asarray(self.touch.lines @ self.motions.swapaxes(-1, -2))

    def solved(self, right: Array) -> Array:
        """Return the solutions (n, freedoms, k) of the second derivatives for right-hand sides.
        Raises LinAlgError.
        """
        groups = self.matrix.shape[:3]
        moves = np.linalg.solve(self.matrix, right.reshape(*groups, -1))
        return np.asarray(moves.reshape(right.shape))


def energy(
    springs: Springs, pitch: float, load: Load | None, at: Array, forces: Array | None = None
) -> Energy:
    """Return the energy of n stacks at freedoms (n, rows, 3), with contact ``forces`` (n, points)
    in mN of an outer plate if given: the gradient is then the residual against these.
    """
    values, gradient, blocks = springs.energy(at)
    value, flat = values.sum(-1), (len(at), -1)
    if load is None:
        return Energy(value, gradient.reshape(flat), blocks)
    plates = plate_chain(at, pitch)
    touch = None if load.wall is None else load.wall.contact(plates, load.stiffness, forces)
    beyond, arms, outer = _external_forces(plates, load, touch)
    motions = plates.motions()
    works = motions @ force_motions(arms, beyond)
    _add_tilt_works(blocks, works[..., 3], at, pitch)
    motions = motions.reshape(*gradient.reshape(flat).shape, 6)
    # A level nearer the base turns all motions beyond it; of the two tilts of one level this is
    # the mean.
    half = motions[..., :3] @ works[..., :3].reshape(*motions.shape[:2], 3).swapaxes(1, 2)
    half *= -_base_side(at.shape[1])
    matrix = half + half.swapaxes(1, 2)
    if touch is not None:
        lines = touch.lines @ motions.swapaxes(1, 2)
        matrix += (lines.swapaxes(1, 2) * touch.stiff_touches[:, None]) @ lines
    diagonal = matrix.reshape(len(at), at.shape[1], 3, at.shape[1], 3)
    np.einsum("niaib->niab", diagonal)[...] += blocks
    gradient = (gradient - works[..., 3]).reshape(flat)
    return Energy(value + outer, gradient, matrix[:, None], plates, motions, touch)


@lru_cache(maxsize=16)
def _base_side(count: int) -> Array:
    """Return 1 if the row's level is nearer the base than the column's, 1/2 if equal."""
    level = np.repeat(np.arange(count), 3)
    return np.asarray(np.heaviside(level[None, :] - level[:, None], 0.5))


def _add_tilt_works(blocks: Array, works: Array, freedoms: Array, pitch: float) -> None:
    """Subtract from second derivatives (n, levels, 3, 3) of the springs the ``works`` (n, levels,
    3) of the forces by the two tilts of one level, beyond their mean.

    A point y from the level's middle moves by a x y for the rotation a of a tilt. The second tilt,
    with rotation b, changes that to second order by da/db x y + a x (b x y - c x s / 2); the mean
    of a x (b x y) and b x (a x y) is included elsewhere. s goes from plate to plate, c is the
    rotation of the level's first half, so that the middle shifts by c x s / 2.
    """
    (x, y), (tilt_x, tilt_y) = (
        np.moveaxis(freedoms[..., 1:], -1, 0) / 2,
        np.moveaxis(works, -1, 0)[1:],
    )
    safe = np.maximum(x * x + y * y, SMALL)
    angle = np.sqrt(safe)
    # A tilt's turn, in the frame of the level's middle, is (sine I + mean v v) times its rate, and
    # the first half's has the skew part of the Jacobian besides (``rotations``).
    sine, cosine = np.sin(angle) / angle, np.cos(angle)
    mean, skew = (1 - sine) / safe, (1 - cosine) / safe
    sine_rate = (cosine - sine) / safe
    mixed, mean_rate = sine_rate + mean, -(sine_rate + 2 * mean) / safe
    # Moments about the level's middle: along v, along the plane's axes, and across the rise.
    along = x * tilt_x + y * tilt_y
    axis_x, axis_y = (tilt_x - mean * along * x) / sine, (tilt_y - mean * along * y) / sine
    turned = mean * (x * axis_y - y * axis_x)
    across_x, across_y = sine * axis_y + turned * x, turned * y - sine * axis_x
    lift = works[..., 0] * (freedoms[..., 0] + pitch)
    even = mean * along / 2 + lift * sine * sine / 4
    pair = mean_rate * along / 2 + lift * mean * (2 * sine + mean * safe) / 4
    blocks[..., 1, 1] -= even + pair * x * x + (mixed * x * axis_x + skew * y * across_x) / 2
    blocks[..., 2, 2] -= even + pair * y * y + (mixed * y * axis_y - skew * x * across_y) / 2
    both = mixed * (x * axis_y + y * axis_x) + skew * (y * across_y - x * across_x)
    both = pair * x * y + both / 4
    blocks[..., 1, 2] -= both
    blocks[..., 2, 1] -= both
