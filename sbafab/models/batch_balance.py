"""Equilibrium of many states of a stack at once: springs, forces on the tip, weight, and Newton's
steps.

The same energy as of ``stack_loads``, with a state a column: numpy is the faster the longer its
last axis. Without a load a state has a row a kind of balloon; under one it has a row a level,
bottom to top, and levels act on each other through the turns of the plates between them alone:
three numbers either way. So its tangent stiffness is eliminated from the top down in blocks of 3 x
3 (a Riccati recursion), at a cost in proportion to the levels. Lengths mm, pressures kPa, volumes
ul, forces mN.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

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
from sbafab.models.stack_loads import RING_POINTS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from sbafab.models.balloon_map import BalloonMap
    from sbafab.models.film_elements import Array
    from sbafab.models.stack_loads import Load
    from sbafab.models.stack_poses import PosedStack

POSE_STEPS = 40
"""Most of Newton's steps of a pose before a state is solved alone."""
RESIDUAL = 1e-7
"""Residual in mN (or mN mm) that counts as none."""
POSE_ERROR, LOADED_STEP = 1e-9, 1e-7
"""Error (mm, rad) at which a pose ends; the last step under a load, whose tangent stiffness leaves
out as much as ``LoadedEnergy.turned`` does, so that the error falls linearly."""
HALVINGS = 12
FEW = 6
"""States under a load that are solved alone sooner than together."""
STRAIGHT = 1e-24
"""Square of a tilt in rad that is taken for 0."""
BY_PRESSURE = np.zeros((3, DEGREE + 1, DEGREE + 1))
BY_PRESSURE[0], BY_PRESSURE[1, :, :-1], BY_PRESSURE[2, :, :-2] = PIECES, SLOPES, CURVES
"""Splines' weights by pressure: of values, first and second derivatives."""
LEAST_PIVOT = 1e-12
"""Pivot, as a share of the largest, below which a matrix counts as indefinite."""


class Coupling(NamedTuple):
    """What couples the levels under a load, by each level's freedoms: the ``turn`` of all plates
    beyond it (levels, 3, 3, n), and the moments by which the forces on these answer to their
    ``motion`` (levels, 3, 3, n).
    """

    turn: Array
    motion: Array


class LevelsAt(NamedTuple):
    """Energy (n), its gradient (rows, 3, n) and the rows' own second derivatives ``blocks`` (rows,
    3, 3, n); volumes (chambers, n), their rates by freedoms, ``filling`` (rows, chambers, 3, n),
    and by pressure, ``swelling`` (chambers, n); and what couples the rows, None without a load.
    """

    energy: Array
    gradient: Array
    blocks: Array
    volumes: Array
    filling: Array
    swelling: Array
    coupling: Coupling | None

    def put(self, where: NDArray[np.int_], other: LevelsAt) -> None:
        """Replace some of the states by those of another."""
        pairs = [*zip(self[:-1], other[:-1], strict=True)]
        if self.coupling is not None and other.coupling is not None:
            pairs += zip(self.coupling, other.coupling, strict=True)
        for mine, its in pairs:
            mine[..., where] = its

    def solved(self, right: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Return the solutions (rows, 3, k, n) of the tangent stiffness by right sides (rows, 3, k,
        n), and True (n) where it is positive definite.
        """
        if self.coupling is not None:
            return chain_solved(self.blocks, self.coupling, right)
        each = [solved(block, one) for block, one in zip(self.blocks, right, strict=True)]
        return _stacked([one for one, _ in each]), np.all([firm for _, firm in each], axis=0)


@dataclass(frozen=True, eq=False)
class Levels:
    """The rows of many states of a stack: ``springs`` of each kind of balloon, the ``kinds`` of the
    rows and how many equal levels each stands for (``counts``); ``pitch`` is the height of a flat
    level in mm, and ``load`` has no outer plate.
    """

    springs: tuple[BatchSprings, ...]
    kinds: NDArray[np.int_]
    counts: NDArray[np.int_]
    pitch: float
    load: Load | None = None

    @classmethod
    def of(cls, stack: PosedStack, load: Load | None) -> Levels:
        """Return a row a kind of balloon, or a row a level under a load."""
        springs = tuple(BatchSprings.of(stack, kind) for kind in range(len(stack.maps)))
        kinds, counts = np.arange(len(springs)), np.bincount(stack.levels, minlength=len(springs))
        if load is not None:
            kinds, counts = stack.levels, np.ones_like(stack.levels)
        return cls(springs, kinds, counts, stack.pitch, load)

    def alone(self, kind: int) -> Levels:
        """Return one level of one kind: without a load, each balances by itself."""
        one = np.array([kind])
        return Levels(self.springs, one, np.ones_like(one), self.pitch)

    def weights(self, pressures: Array, orders: int) -> Array:
        """Return ``BatchSprings.weights`` of each kind: (kinds, ...)."""
        return _stacked([springs.weights(pressures, orders) for springs in self.springs])

    def at(self, weights: Array, freedoms: Array) -> LevelsAt:
        """Return the rows at pressures of ``weights`` and freedoms (rows, 3, n)."""
        count = freedoms.shape[-1]
        each = self._spring_rows(weights, freedoms)
        volumes, swelling = (
            sum(number * one for number, one in zip(self.counts, part, strict=True))
            if len(self.counts) > 1
            else self.counts[0] * part[0]
            for part in (each.volumes, each.swelling)
        )
        energy = each.energy.sum(0)
        if self.load is None:
            return LevelsAt(
                energy, each.gradient, each.matrix, volumes, each.filling, swelling, None
            )
        forces, works, coupling = acting(self.load, chain_of(freedoms, self.pitch), count)
        return LevelsAt(
            energy + forces,
            each.gradient - works,
            each.matrix,
            volumes,
            each.filling,
            swelling,
            coupling,
        )

    def _spring_rows(self, weights: Array, freedoms: Array) -> SpringBatch:
        """Return the springs with an axis of rows before all others."""
        rows, _, count = freedoms.shape
        if rows == len(self.springs) == 1 or self.load is None:
            each = [
                self.springs[kind].at(weights[kind], one)
                for kind, one in zip(self.kinds, freedoms, strict=True)
            ]
            return SpringBatch(*(_stacked(list(part)) for part in zip(*each, strict=True)))
        parts: list[Array] = []
        for kind, springs in enumerate(self.springs):
            which = np.flatnonzero(self.kinds == kind)
            columns = np.ascontiguousarray(freedoms[which].transpose(1, 0, 2)).reshape(3, -1)
            found = springs.at(weights[kind], columns)
            if not parts:
                parts = [np.empty((rows, *part.shape[:-1], count)) for part in found]
            for whole, part in zip(parts, found, strict=True):
                levels = part.reshape(*part.shape[:-1], len(which), count)
                whole[which] = np.moveaxis(levels, -2, 0)
        return SpringBatch(*parts)

    def tips(self, freedoms: Array) -> Array:
        """Return the middles of the top plates in mm of freedoms (levels, 3, n): (n, 3)."""
        return np.asarray(chain_of(freedoms, self.pitch).tip.T)


def _stacked(parts: Sequence[Array]) -> Array:
    return parts[0][None] if len(parts) == 1 else np.stack(parts)


def step_share(moves: Array) -> Array:
    """Return the share (n) of steps (rows, 3, n) that stays within ``LARGEST_MOVE``."""
    limits = LARGEST_MOVE[:, None] / np.maximum(np.abs(moves).max(0), 1e-12)
    return np.asarray(np.minimum(1.0, limits.min(0)))


def descended(levels: Levels, weights: Array, start: Array, end: Array) -> NDArray[np.bool_]:
    """Write the freedoms (rows, 3, n) of least energy; return True (n) where they are found.

    Newton's method with a line search, of which finished states take no further part: the energy
    of a level alone is convex. Under a load a state whose tangent stiffness is indefinite on the
    way is not found.
    """
    count = start.shape[-1]
    is_solved = np.zeros(count, dtype=bool)
    live, at, before = np.arange(count), start.copy(), np.zeros(count)
    end[:] = start
    now = levels.at(weights, at)
    for _ in range(POSE_STEPS):
        moves, is_firm = now.solved(-now.gradient[:, :, None])
        move = moves[:, :, 0]
        largest = np.abs(move).max((0, 1))
        still = np.abs(now.gradient).max((0, 1)) < RESIDUAL
        if levels.load is None:
            still |= is_firm & (largest * largest < POSE_ERROR * before)
        else:
            still = is_firm & (still | (largest < LOADED_STEP))
        if still.any():
            last = at + np.where(is_firm & (largest < 1e-3), move, 0.0)
            end[..., live[still]] = last[..., still]
            is_solved[live[still]] = True
        rest = ~still & is_firm
        if not rest.any() or (levels.load is not None and rest.sum() < FEW):
            break
        live, at, move, largest = live[rest], at[..., rest], move[..., rest], largest[rest]
        value, slope = now.energy[rest], (move * now.gradient[..., rest]).sum((0, 1))
        weights = weights[..., rest]
        full = step_share(move)
        share = full.copy()
        now = levels.at(weights, at + share * move)
        for _ in range(HALVINGS):
            room = 1e-4 * share * slope + 1e-11 * (1 + np.abs(value))
            (far,) = np.nonzero(~(now.energy <= value + room))
            if not far.size:
                break
            share[far] /= 2
            trial = at[..., far] + share[far] * move[..., far]
            now.put(far, levels.at(weights[..., far], trial))
        at = at + share * move
        before = np.where((full == 1.0) & (share == 1.0), largest, 0.0)
    return is_solved


# Plates of many states, and the forces on them.


class ChainBatch(NamedTuple):
    """Plates of n states: ``places`` (levels + 1, 3, n) of their middles in mm, the base first;
    by level the direction of its rise, ``rises`` (levels, 3, n), the middle about which its tilt
    turns all beyond it, ``middles`` (levels, 3, n), and the rotations by a unit of either tilt,
    ``turns`` (levels, 2, 3, n).
    """

    places: Array
    rises: Array
    middles: Array
    turns: Array

    @property
    def tip(self) -> Array:
        """Middle of the top plate in mm: (3, n)."""
        return np.asarray(self.places[-1])


def chain_of(freedoms: Array, pitch: float) -> ChainBatch:
    """Return the plates of freedoms (levels, 3, n), as ``stack_loads.plate_chain`` has them."""
    levels, _, count = freedoms.shape
    half = freedoms[:, 1:] / 2
    x, y = half[:, 0], half[:, 1]
    square = np.maximum(x * x + y * y, STRAIGHT)
    angle = np.sqrt(square)
    sine = np.sin(angle) / angle
    # 1 - cos is lost to rounding where it is small.
    less = 2 * (np.sin(angle / 2) / angle) ** 2
    mean = (1 - sine) / square
    places, rises = np.zeros((levels + 1, 3, count)), np.empty((levels, 3, count))
    turns = np.empty((levels, 2, 3, count))
    # The plate's x, y and z.
    axes = np.zeros((3, 3, count))
    axes[[0, 1, 2], [0, 1, 2]] = 1.0
    for level in range(levels):
        u, v = x[level], y[level]
        middle = _tilted(axes, u, v, sine[level], less[level])
        rises[level] = middle[2]
        across = mean[level] * (u * middle[0] + v * middle[1])
        turns[level, 0] = sine[level] * middle[0] + u * across
        turns[level, 1] = sine[level] * middle[1] + v * across
        axes = _tilted(middle, u, v, sine[level], less[level])
        places[level + 1] = places[level] + middle[2] * (freedoms[level, 0] + pitch)
    return ChainBatch(places, rises, (places[1:] + places[:-1]) / 2, turns)


def _tilted(axes: Array, x: Array, y: Array, sine: Array, less: Array) -> Array:
    """Return axes (3, 3, n) turned by (x, y) about their own x and y (Rodrigues' formula); ``sine``
    is the angle's by the angle, ``less`` 1 - cos by its square.
    """
    first, second, third = axes
    way = less * (x * first + y * second)
    square = x * x + y * y
    cosine = 1 - less * square
    return np.stack(
        [
            cosine * first + x * way - sine * y * third,
            cosine * second + y * way + sine * x * third,
            cosine * third + sine * (y * first - x * second),
        ]
    )


def acting(load: Load, plates: ChainBatch, count: int) -> tuple[Array, Array, Coupling]:
    """Return the energy (n) of a load on the plates, its work by each freedom (levels, 3, n), and
    what couples the levels.
    """
    levels = len(plates.rises)
    tip, middles = plates.tip, plates.middles
    energy = -(load.tip @ tip)
    forces = np.repeat(load.tip[None, :, None], levels, 0)
    # The sum of y f over the points of the plates beyond, y from the level's middle.
    arms = (tip - middles)[:, :, None] * load.tip[None, None, :, None]
    if load.weight is not None:
        beyond = np.cumsum(plates.places[:0:-1], axis=0)[::-1]
        number = np.arange(levels, 0, -1.0)[:, None, None]
        energy = energy - load.weight @ beyond[0]
        forces = forces + number * load.weight[None, :, None]
        arms = arms + (beyond - number * middles)[:, :, None] * load.weight[None, None, :, None]
    trace = arms[:, 0, 0] + arms[:, 1, 1] + arms[:, 2, 2]
    moments = np.stack(
        [
            arms[:, 1, 2] - arms[:, 2, 1],
            arms[:, 2, 0] - arms[:, 0, 2],
            arms[:, 0, 1] - arms[:, 1, 0],
        ],
        axis=1,
    )
    turn = np.zeros((levels, 3, 3, count))
    turn[:, 1:] = plates.turns
    motion = np.empty((levels, 3, 3, count))
    motion[:, 0] = np.cross(plates.rises, forces, axis=1)
    motion[:, 1:] = (plates.turns[:, :, None] * arms[:, None]).sum(3)
    motion[:, 1:] -= plates.turns * trace[:, None, None]
    works = np.empty((levels, 3, count))
    works[:, 0] = (plates.rises * forces).sum(1)
    works[:, 1:] = (plates.turns * moments[:, None]).sum(2)
    return energy, works, Coupling(turn, motion)


def chain_solved(
    blocks: Array, coupling: Coupling, right: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Return the solutions (levels, 3, k, n) under a load by right sides (levels, 3, k, n), and
    True (n) where the tangent stiffness is positive definite.

    Of levels i below j it has the block -turn_i motion_j^T. With r the turn of all below a level,
    and s the moment of all above, s = P r + c: both P and c follow from the top down.
    """
    levels, _, k, count = right.shape
    is_firm = np.ones(count, dtype=bool)
    stiff, free = np.zeros((3, 3, count)), np.zeros((3, k, count))
    answers = np.empty((levels, 3, k + 3, count))
    for level in range(levels - 1, -1, -1):
        turn, motion = coupling.turn[level], coupling.motion[level]
        held = _product(turn, stiff)
        mixed = held / 2 + motion / 2
        across = _product(turn, mixed.transpose(1, 0, 2))
        matrix = blocks[level] - across - across.transpose(1, 0, 2)
        rates = held + motion
        both = np.concatenate([right[level] + _product(turn, free), rates], axis=1)
        answers[level], fits = solved(matrix, both)
        # An indefinite block has no solution, and must not grow from level to level.
        answers[level][..., np.logical_not(fits)] = 0.0
        is_firm &= fits
        more = _product(rates.transpose(1, 0, 2), answers[level])
        free, stiff = free + more[:, :k], stiff + more[:, k:]
    moves = np.empty_like(right)
    turned = np.zeros((3, k, count))
    for level in range(levels):
        moves[level] = answers[level, :, :k] + _product(answers[level, :, k:], turned)
        turned = turned + _product(coupling.turn[level].transpose(1, 0, 2), moves[level])
    return moves, is_firm


def _product(first: Array, second: Array) -> Array:
    """Return the products (i, k, n) of matrices (i, j, n) and (j, k, n)."""
    total = first[:, 0, None] * second[0]
    for j in range(1, len(second)):
        total += first[:, j, None] * second[j]
    return np.asarray(total)


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
        """Return the springs at pressures of ``weights`` and freedoms (3, n), or (3, levels x n)
        level by level, whose results have as many columns.
        """
        orders, _, chambers, states = weights.shape
        points, count = chambers * RING_POINTS, freedoms.shape[1]
        gaps = self.meet @ freedoms
        after = gaps[:points] + 1.0
        piece = np.minimum(np.maximum(after, 0.0), PIECES_IN_ALL - 1).astype(np.int_)
        u = after - piece
        low, high = int(piece.min()), int(piece.max()) + 1
        size = chambers * states
        part = self.table[:, low:high].reshape(-1, self.table.shape[2])
        # (orders, powers, pieces x chambers x n)
        rows = (part @ weights.reshape(orders, -1, size)).reshape(orders, DEGREE + 1, -1)
        piece -= low
        piece *= size
        begin = piece.reshape(chambers, RING_POINTS, -1, states)
        begin += np.arange(size).reshape(chambers, 1, 1, states)
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
        none = np.zeros((chambers, count))
        return SpringBatch(
            energy,
            gradient,
            matrix.reshape(3, 3, count),
            sums[0] if orders > 1 else none,
            (self.tilts @ -first[1]).reshape(chambers, 3, count) if orders > 1 else none[:, None],
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
