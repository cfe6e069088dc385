"""Plates of many states of a stack at once, the forces on them, and the equations by which levels
act on each other.

Like ``stack_loads`` with one column per state: numpy is faster with a longer last axis. Levels act
on each other only through the turns of the plates between them, and through the top if an outer
plate holds it. The tangent stiffness is therefore eliminated from the top down in blocks of 3 x 3
(a Riccati recursion), at a cost proportional to the levels. Lengths mm, forces mN.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sbafab.models.film_elements import Array
from sbafab.models.stack_loads import SMALL, WALL_POINTS, Load, base_side

STRAIGHT = 1e-24
"""Square of a tilt in rad that counts as 0."""
LEAST_PIVOT = 1e-12
"""Pivot, as a share of the largest, below which a matrix counts as indefinite."""


class Coupling(NamedTuple):
    """Coupling of the levels under a load, by each level's freedoms: the ``turn`` of all plates
    beyond it (levels, 3, 3, n), and the moments from the forces on these plates due to their
    ``motion`` (levels, 3, 3, n).
    """

    turn: Array
    motion: Array


class ChainBatch(NamedTuple):
    """Plates of n states: ``places`` (levels + 1, 3, n) of their middles in mm, the base first;
    by level the direction of its rise, ``rises`` (levels, 3, n), the middle about which its tilt
    turns all beyond it, ``middles`` (levels, 3, n), and the rotations by a unit of either tilt,
    ``turns`` (levels, 2, 3, n); the columns of ``axes`` (3, 3, n) are the top's x, y and z.
    """

    places: Array
    rises: Array
    middles: Array
    turns: Array
    axes: Array

    @property
    def tip(self) -> Array:
        """Middle of the top plate in mm: (3, n)."""
        return np.asarray(self.places[-1])


def chain_of(freedoms: Array, pitch: float) -> ChainBatch:
    """Return the plates of freedoms (levels, 3, n), as ``stack_loads.plate_chain`` has them."""
    levels, _, count = freedoms.shape
    x, y = freedoms[:, 1] / 2, freedoms[:, 2] / 2
    xx, xy, yy = x * x, x * y, y * y
    square = np.maximum(xx + yy, STRAIGHT)
    angle = np.sqrt(square)
    sine = np.sin(angle) / angle
    # Small values of 1 - cos are lost to rounding.
    less = 2 * (np.sin(angle / 2) / angle) ** 2
    # The matrix of half a level's tilt (Rodrigues' formula).
    half = np.empty((levels, 3, 3, count))
    half[:, 0, 0], half[:, 1, 1] = 1 - less * yy, 1 - less * xx
    half[:, 0, 1] = half[:, 1, 0] = less * xy
    half[:, 0, 2], half[:, 2, 0] = sine * y, -sine * y
    half[:, 1, 2], half[:, 2, 1] = -sine * x, sine * x
    half[:, 2, 2] = 1 - less * (xx + yy)
    axes = np.zeros((levels + 1, 3, 3, count))
    axes[0, [0, 1, 2], [0, 1, 2]] = 1.0
    axes[1:] = product(half, half)
    reach = 1
    while reach < levels:
        # Each entry is already the product of ``reach`` levels up to its level.
        axes[reach + 1 :] = product(axes[1:-reach], axes[reach + 1 :])
        reach *= 2
    middle = product(axes[:-1], half)
    rises = middle[:, :, 2]
    places = np.zeros((levels + 1, 3, count))
    np.cumsum(rises * (freedoms[:, :1] + pitch), axis=0, out=places[1:])
    mean = (1 - sine) / square
    turns = np.empty((levels, 2, 3, count))
    across = mean[:, None] * (x[:, None] * middle[:, :, 0] + y[:, None] * middle[:, :, 1])
    turns[:, 0] = sine[:, None] * middle[:, :, 0] + x[:, None] * across
    turns[:, 1] = sine[:, None] * middle[:, :, 1] + y[:, None] * across
    return ChainBatch(places, rises, (places[1:] + places[:-1]) / 2, turns, axes[-1])


class ActingBatch(NamedTuple):
    """External forces: their ``energy`` (n) without contact and ``works`` by each freedom (levels,
    3, n); ``forces`` (levels, 3, n) on all beyond each level and their ``moments`` about its
    middle; and what couples the levels.
    """

    energy: Array
    works: Array
    forces: Array
    moments: Array
    coupling: Coupling


def acting(
    load: Load, plates: ChainBatch, count: int, contact: tuple[Array, Array] | None = None
) -> ActingBatch:
    """Return the forces of a load on the plates, with those in mN of an outer plate: ``contact``
    are its points (points, 3, n) in mm and its forces on them (points, n).
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
    if contact is not None and load.wall is not None:
        points, pushes = contact
        each = pushes[:, None] * load.wall.ways[:, :, None]
        whole = each.sum(0)
        forces = forces - whole
        about = (points[:, :, None] * each[:, None]).sum(0)
        arms = arms - about + middles[:, :, None] * whole
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
    motion[:, 0] = crossed(plates.rises, forces)
    motion[:, 1:] = (plates.turns[:, :, None] * arms[:, None]).sum(3)
    motion[:, 1:] -= plates.turns * trace[:, None, None]
    works = np.empty((levels, 3, count))
    works[:, 0] = (plates.rises * forces).sum(1)
    works[:, 1:] = (plates.turns * moments[:, None]).sum(2)
    return ActingBatch(energy, works, forces, moments, Coupling(turn, motion))


def crossed(first: Array, second: Array) -> Array:
    """Return the vector products (..., 3, n) of vectors (..., 3, n)."""
    first, second = np.broadcast_arrays(first, second)
    a, b, c = first[..., 0, :], first[..., 1, :], first[..., 2, :]
    x, y, z = second[..., 0, :], second[..., 1, :], second[..., 2, :]
    return np.stack([b * z - c * y, c * x - a * z, a * y - b * x], axis=-2)


class ContactBatch(NamedTuple):
    """Contact of the top with an outer plate, as ``PlateContact``: ``deep`` (points, n) in mm, by a
    unit of each turn and move of the top ``lines`` (points, 6, n); ``stiff`` (points, n) is its
    stiffness in mN/mm, ``least`` (points, 1) its least depth.
    """

    deep: Array
    lines: Array
    stiff: Array
    least: Array

    @property
    def touches(self) -> NDArray[np.bool_]:
        """True (points, n) in contact."""
        return np.asarray(self.deep > self.least)

    def resists(self, deep: Array) -> Array:
        """Return the forces (points, n) in mN at depths in mm."""
        return np.asarray(self.stiff * np.maximum(deep, self.least))

    def at(self, where: Any) -> ContactBatch:
        """Return some of the states."""
        deep, lines, stiff = (part[..., where] for part in self[:3])
        return ContactBatch(deep, lines, stiff, self.least)

    def held(self, touches: NDArray[np.bool_], forces: Array) -> tuple[Array, Array]:
        """Return the top's stiffness (6, 6, n) by its turns and moves from points in contact
        (points, n), and the gradient (6, n) beyond that from ``forces`` (points, n) in mN.
        """
        stiff = self.stiff * touches
        gradient = np.einsum("pxn,pn->xn", self.lines, stiff * self.deep - forces)
        stiffness = np.einsum("pxn,pyn->xyn", stiff[:, None] * self.lines, self.lines)
        return stiffness, gradient


def contact_of(load: Load, plates: ChainBatch, stiffness: Array) -> tuple[ContactBatch, Array]:
    """Return the contact of the top with the load's outer plate, of a stiffness (n) in mN/mm, and
    its points (points, 3, n) in mm.
    """
    wall = load.wall
    assert wall is not None
    points = plates.tip + np.einsum("pc,xcn->pxn", wall.local, plates.axes)
    ways = wall.ways[:, :, None]
    deep = ((points - wall.point[:, None]) * ways).sum(1)
    lines = np.empty((len(points), 6, points.shape[-1]))
    lines[:, :3], lines[:, 3:] = crossed(points, ways), ways
    stiff = np.tile(stiffness, (len(points), 1))
    stiff[:WALL_POINTS] /= WALL_POINTS
    return ContactBatch(deep, lines, stiff, wall.least[:, None]), points


def tilt_works(freedoms: Array, plates: ChainBatch, acts: ActingBatch, pitch: float) -> Array:
    """Return the work of the forces by the two tilts of one level (levels, 2, 2, n) that the
    coupling omits, as in ``derivatives.hessian``.
    """
    half = freedoms[:, 1:] / 2
    safe = np.maximum((half * half).sum(1), SMALL)
    angle = np.sqrt(safe)
    sine, cosine = np.sin(angle) / angle, np.cos(angle)
    mean = (1 - sine) / safe
    sine_rate = (cosine - sine) / safe
    mean_rate = -(sine_rate + 2 * mean) / safe
    skew = np.stack([-half[:, 1], half[:, 0]], 1) * ((1 - cosine) / safe)[:, None]
    works = acts.works[:, 1:]
    along = (half * works).sum(1)
    axes = (works - (mean * along)[:, None] * half) / sine[:, None]
    turned = crossed(acts.moments, plates.rises)
    across = (turned[:, None] * plates.turns).sum(2)
    mixed = (sine_rate + mean)[:, None] * half
    pairs = mixed[:, :, None] * axes[:, None] - skew[:, :, None] * across[:, None]
    lift = acts.works[:, 0] * (freedoms[:, 0] + pitch)
    second = pairs + pairs.swapaxes(1, 2)
    second += (2 * mean_rate * along)[:, None, None] * (half[:, :, None] * half[:, None])
    second[:, [0, 1], [0, 1]] += (2 * mean * along)[:, None]
    pairs = (plates.turns[:, :, None] * plates.turns[:, None]).sum(3)
    second += lift[:, None, None] * pairs
    return np.asarray(second / 4)


def chain_solved(
    blocks: Array, coupling: Coupling, right: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Return the solutions (levels, 3, k, n) under a load by right sides (levels, 3, k, n), and
    True (n) where the tangent stiffness is positive definite.

    For levels i below j it has the block -turn_i motion_j^T. With r the turn of all below a level,
    and s the moment of all above, s = P r + c: both P and c follow from the top down.
    """
    levels, _, k, count = right.shape
    is_firm = np.ones(count, dtype=bool)
    stiff, free = np.zeros((3, 3, count)), np.zeros((3, k, count))
    answers = np.empty((levels, 3, k + 3, count))
    for level in range(levels - 1, -1, -1):
        turn, motion = coupling.turn[level], coupling.motion[level]
        held = product(turn, stiff)
        mixed = held / 2 + motion / 2
        across = product(turn, mixed.transpose(1, 0, 2))
        matrix = blocks[level] - across - across.transpose(1, 0, 2)
        rates = held + motion
        both = np.concatenate([right[level] + product(turn, free), rates], axis=1)
        answers[level], fits = solved(matrix, both)
        # An indefinite block has no solution; keep it from growing from level to level.
        answers[level][..., np.logical_not(fits)] = 0.0
        is_firm &= fits
        more = product(rates.transpose(1, 0, 2), answers[level])
        free, stiff = free + more[:, :k], stiff + more[:, k:]
    moves = np.empty_like(right)
    turned = np.zeros((3, k, count))
    for level in range(levels):
        moves[level] = answers[level, :, :k] + product(answers[level, :, k:], turned)
        turned = turned + product(coupling.turn[level].transpose(1, 0, 2), moves[level])
    return moves, is_firm


class HeldChain(NamedTuple):
    """Tangent stiffness of levels under a load whose top is held: the rows' own ``blocks`` (levels,
    3, 3, n), what couples them, the ``motions`` (levels, 3, 6, n) of all beyond, and the stiffness
    of the ``top`` (6, 6, n) against its turns and moves.
    """

    blocks: Array
    coupling: Coupling
    motions: Array
    top: Array

    def solved(self, pulls: Array, right: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Return the solutions (levels, 3, k, n) by right sides (levels, 3, k, n) and gradients on
        the top ``pulls`` (6, k, n), the top's turns and moves (6, k, n), and True (n) where the
        matrix is positive definite.

        Like ``chain_solved``: with r the turns and moves of all below a level, the least energy of
        all above is r P r / 2 + c r, and both P and c follow from the top down.
        """
        levels, _, k, count = right.shape
        is_firm = np.ones(count, dtype=bool)
        stiff, free = self.top, pulls
        answers = np.empty((levels, 3, k + 6, count))
        for level in range(levels - 1, -1, -1):
            motion, turn = self.motions[level], self.coupling.turn[level]
            held = product(motion, stiff)
            across = product(turn, self.coupling.motion[level].transpose(1, 0, 2)) / 2
            matrix = self.blocks[level] - across - across.transpose(1, 0, 2)
            matrix += product(held, motion.transpose(1, 0, 2))
            rates = -held
            rates[:, :3] += self.coupling.motion[level]
            both = np.concatenate([right[level] - product(motion, free), rates], axis=1)
            answers[level], fits = solved(matrix, both)
            is_firm &= fits
            less = product(rates.transpose(1, 0, 2), answers[level])
            free, stiff = free - less[:, :k], stiff - less[:, k:]
        moves, sums = np.empty_like(right), np.zeros((6, k, count))
        for level in range(levels):
            moves[level] = answers[level, :, :k] + product(answers[level, :, k:], sums)
            sums = sums + product(self.motions[level].transpose(1, 0, 2), moves[level])
        rest = np.flatnonzero(~is_firm)
        if rest.size:
            moves[..., rest] = self._pivoted(rest, pulls[..., rest], right[..., rest])
            sums[..., rest] = np.einsum("lfxn,lfkn->xkn", self.motions[..., rest], moves[..., rest])
        return moves, sums, is_firm

    def _pivoted(self, which: NDArray[np.int_], pulls: Array, right: Array) -> Array:
        """Return the solutions (levels, 3, k, m) of states whose matrix is indefinite: by pivoting,
        as elimination level by level loses digits.
        """
        levels, _, k, count = right.shape
        turn, motion = (np.moveaxis(part[..., which], -1, 0) for part in self.coupling)
        motions = np.moveaxis(self.motions[..., which], -1, 0).reshape(count, -1, 6)
        top = np.moveaxis(self.top[..., which], -1, 0)
        half = turn.reshape(count, -1, 3) @ motion.reshape(count, -1, 3).transpose(0, 2, 1)
        half *= base_side(levels)
        matrix = motions @ top @ motions.transpose(0, 2, 1) - half - half.transpose(0, 2, 1)
        own = np.einsum("niaib->iabn", matrix.reshape(count, levels, 3, levels, 3))
        own += self.blocks[..., which]
        sides = np.moveaxis(right, -1, 0).reshape(count, -1, k)
        sides = sides - motions @ np.moveaxis(pulls, -1, 0)
        try:
            found = np.linalg.solve(matrix, sides)
        except np.linalg.LinAlgError:
            found = np.full_like(sides, np.nan)
        return np.asarray(found.reshape(count, levels, 3, k).transpose(1, 2, 3, 0))


def product(first: Array, second: Array) -> Array:
    """Return the products (..., i, k, n) of matrices (..., i, j, n) and (..., j, k, n)."""
    return np.asarray(np.einsum("...ijn,...jkn->...ikn", first, second))


def solved(matrices: Array, right: Array) -> tuple[Array, Array]:
    """Return the solutions (size, k, n) of symmetric matrices (size, size, n) by right sides (size,
    k, n), and True (n) if a matrix is positive definite: others have no solution if a pivot is 0.
    """
    size = len(matrices)
    a, b = matrices.copy(), right.copy()
    least = LEAST_PIVOT * np.abs(np.einsum("iin->in", matrices)).max(0)
    is_firm = a[0, 0] > least
    for i in range(size):
        pivot = a[i, i]
        is_firm &= pivot > least
        inverse = 1 / np.where(np.abs(pivot) > least, pivot, 1.0)
        b[i] *= inverse
        a[i, i + 1 :] *= inverse
        if i + 1 < size:
            below = a[i + 1 :, i, None]
            b[i + 1 :] -= below * b[i]
            a[i + 1 :, i + 1 :] -= below * a[i, i + 1 :]
    for i in range(size - 1, 0, -1):
        b[:i] -= a[:i, i, None] * b[i]
    return b, is_firm
