"""Equilibrium of many states of a stack at once: springs, loads, and Newton's steps.

The same energy as in ``stack_loads``, with one column per state: numpy is faster with a longer last
axis. Without a load a state has one row per kind of balloon; under a load it has one row per level,
bottom to top. Lengths mm, pressures kPa, volumes ul, forces mN.
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
from sbafab.models.batch_loads import (
    HeldChain,
    acting,
    chain_of,
    chain_solved,
    contact_of,
    crossed,
    product,
    solved,
    tilt_works,
)
from sbafab.models.least_energy import LARGEST_MOVE
from sbafab.models.stack_loads import RING_POINTS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from sbafab.models.balloon_map import BalloonMap
    from sbafab.models.batch_loads import ContactBatch, Coupling
    from sbafab.models.film_elements import Array
    from sbafab.models.stack_loads import Load
    from sbafab.models.stack_poses import PosedStack

POSE_STEPS = 40
"""Maximum Newton steps for a pose before a state is solved alone."""
RESIDUAL = 1e-7
"""Tolerance of the residual, mN or mN mm."""
POSE_ERROR, LOADED_STEP = 1e-9, 1e-7
"""Error (mm, rad) at which a pose ends; the last step under a load, whose tangent stiffness omits
the same terms as ``LoadedEnergy.turned``, so that the error falls linearly."""
HALVINGS = 12
SPRING_COLUMNS = 2048
"""States times levels whose springs are evaluated together: more would overflow the cache."""
FEW = 6
"""Number of states under a load below which solving each alone is faster."""
BY_PRESSURE = np.zeros((3, DEGREE + 1, DEGREE + 1))
BY_PRESSURE[0], BY_PRESSURE[1, :, :-1], BY_PRESSURE[2, :, :-2] = PIECES, SLOPES, CURVES
"""Splines' weights by pressure: of values, first and second derivatives."""


class TouchingAt(NamedTuple):
    """Levels under a load whose top may touch an outer plate: the ``residual`` (levels, 3, n)
    against given contact ``forces`` (points, n), the rows' own second derivatives ``blocks``
    (levels, 3, 3, n), exact and without what the plate resists; ``motions`` (levels, 3, 6, n) of
    all plates beyond by each freedom, turns then moves, and what couples the levels; the middles of
    the top ``tips`` (3, n) in mm; volumes (chambers, n) and ``filling`` (levels, chambers, 3, n).
    """

    residual: Array
    blocks: Array
    coupling: Coupling
    motions: Array
    contact: ContactBatch
    forces: Array
    tips: Array
    volumes: Array
    filling: Array

    def condensed(self, right: Array) -> Condensed:
        """Return the solutions by right sides (levels, 3, k, n) and by unit forces on the top; the
        first right side becomes the equilibrium with the current contacts.
        """
        k, count = right.shape[2:]
        stiff, gradient = self.contact.held(self.contact.touches, self.forces)
        pulls = np.zeros((6, k + 6, count))
        pulls[:, 0] = gradient
        pulls[np.arange(6), k + np.arange(6)] = 1.0
        whole = np.concatenate([right, np.zeros((*right.shape[:2], 6, count))], axis=2)
        system = HeldChain(self.blocks, self.coupling, self.motions, stiff)
        moves, sums, is_firm = system.solved(pulls, whole)
        return Condensed(moves, sums, stiff, gradient, is_firm)


class Condensed(NamedTuple):
    """Solutions of levels whose top touches an outer plate: ``moves`` (levels, 3, k + 6, n) of
    freedoms and ``sums`` (6, k + 6, n) of the top's turns and moves, by k right sides and then by
    units of pulls on the top; made with its ``stiffness`` (6, 6, n) and ``gradient`` (6, n) by the
    contacts, and True (n) for a positive definite tangent stiffness.
    """

    moves: Array
    sums: Array
    stiffness: Array
    gradient: Array
    is_firm: NDArray[np.bool_]

    def at(self, where: NDArray[np.int_]) -> Condensed:
        """Return some of the states."""
        return Condensed(
            self.moves[..., where],
            self.sums[..., where],
            self.stiffness[..., where],
            self.gradient[:, where],
            self.is_firm[where],
        )

    def with_contacts(self, stiffness: Array, gradient: Array) -> tuple[Array, Array]:
        """Return the turns and moves of the top (6, k, n) with other contacts, and the further
        pulls on it (6, k, n).
        """
        units, begin = self.sums[:, -6:], self.sums[:, :-6].copy()
        stiffer, pulls = stiffness - self.stiffness, np.zeros_like(begin)
        pulls[:, 0] = gradient - self.gradient
        begin[:, 0] += product(units, pulls[:, :1])[:, 0]
        matrix = -product(units, stiffer)
        matrix[np.arange(6), np.arange(6)] += 1.0
        found = np.linalg.solve(matrix.transpose(2, 0, 1), begin.transpose(2, 0, 1))
        sums = np.ascontiguousarray(found.transpose(1, 2, 0))
        return sums, pulls + product(stiffer, sums)


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
        """Replace some of the states by another's."""
        pairs = [*zip(self[:-1], other[:-1], strict=True)]
        if self.coupling is not None and other.coupling is not None:
            pairs += zip(self.coupling, other.coupling, strict=True)
        for mine, its in pairs:
            mine[..., where] = its

    def solved(self, right: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Return the solutions (rows, 3, k, n) of the tangent stiffness by right sides (rows, 3, k,
        n), and a mask (n), True if it is positive definite.
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
        """Return one row per kind of balloon, or one row per level under a load."""
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

    def at(
        self, weights: Array, freedoms: Array, is_exact: NDArray[np.bool_] | None = None
    ) -> LevelsAt:
        """Return the rows at pressures of ``weights`` and freedoms (rows, 3, n); under a load
        second derivatives are exact only where ``is_exact`` (n).
        """
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
        plates = chain_of(freedoms, self.pitch)
        acts = acting(self.load, plates, count)
        blocks = each.matrix
        if is_exact is not None and is_exact.any():
            blocks[:, 1:, 1:] -= is_exact * tilt_works(freedoms, plates, acts, self.pitch)
        return LevelsAt(
            energy + acts.energy,
            each.gradient - acts.works,
            blocks,
            volumes,
            each.filling,
            swelling,
            acts.coupling,
        )

    def touching(
        self, weights: Array, freedoms: Array, stiffness: Array, forces: Array
    ) -> TouchingAt:
        """Return the levels against outer plates of a stiffness (n) in mN/mm, with contact forces
        (points, n) in mN, or by the stiffness where these are NaN.
        """
        assert self.load is not None
        each = self._spring_rows(weights, freedoms)
        plates = chain_of(freedoms, self.pitch)
        contact, points = contact_of(self.load, plates, stiffness)
        pushes = np.where(np.isnan(forces), contact.resists(contact.deep), forces)
        acts = acting(self.load, plates, freedoms.shape[-1], (points, pushes))
        blocks = each.matrix
        blocks[:, 1:, 1:] -= tilt_works(freedoms, plates, acts, self.pitch)
        motions = np.zeros((*acts.works.shape[:2], 6, freedoms.shape[-1]))
        motions[:, 0, 3:] = plates.rises
        motions[:, 1:, :3] = plates.turns
        motions[:, 1:, 3:] = crossed(plates.middles[:, None], plates.turns)
        return TouchingAt(
            each.gradient - acts.works,
            blocks,
            acts.coupling,
            motions,
            contact,
            pushes,
            plates.tip,
            each.volumes.sum(0),
            each.filling,
        )

    def _spring_rows(self, weights: Array, freedoms: Array) -> SpringBatch:
        """Return the springs with a leading axis of rows."""
        rows, _, count = freedoms.shape
        if rows == len(self.springs) == 1 or self.load is None:
            each = [
                self.springs[kind].at(weights[kind], one)
                for kind, one in zip(self.kinds, freedoms, strict=True)
            ]
            return SpringBatch(*(_stacked(list(part)) for part in zip(*each, strict=True)))
        parts: list[Array] = []
        size = max(1, SPRING_COLUMNS // max(count, 1))
        for kind, springs in enumerate(self.springs):
            every = np.flatnonzero(self.kinds == kind)
            for begin in range(0, len(every), size):
                which = every[begin : begin + size]
                columns = np.ascontiguousarray(freedoms[which].transpose(1, 0, 2)).reshape(3, -1)
                found = springs.at(weights[kind], columns)
                if not parts:
                    parts = [np.empty((rows, *part.shape[:-1], count)) for part in found]
                for whole, part in zip(parts, found, strict=True):
                    levels = part.reshape(*part.shape[:-1], len(which), count)
                    whole[which] = np.moveaxis(levels, -2, 0)
        return SpringBatch(*parts)

    def fits(self, centres: Array, freedoms: Array) -> NDArray[np.bool_]:
        """Return True (n) if every balloon, its gap by rise and tilt ``centres`` (3, chambers), is
        within the height of its map.
        """
        most = np.array([self.springs[kind].kind.most_height for kind in self.kinds])
        gaps = np.einsum("ic,rin->rcn", centres, freedoms)
        return np.asarray((gaps <= most[:, None, None]).all((0, 1)))

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
    """Write the freedoms (rows, 3, n) of least energy; return True (n) for the states solved.

    Newton's method with a line search, which finished states leave: the energy of a level alone is
    convex. Under a load a state fails if its tangent stiffness becomes indefinite.
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


# Springs, one column per state.


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
    """Springs of one kind of balloon for many states at once, each with its pressures.

    Like ``stack_loads.Springs`` with one column per state: numpy is faster with a longer last axis.

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
