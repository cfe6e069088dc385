"""Shapes of least energy, many at once: Newton's method, damped where it climbs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from sbafab.models.film_elements import Array

FARTHEST = 0.7
"""Share of its length by which an element may change in one step."""
MOST_STEPS = 400
ROUNDING = 1e-13
"""Share of the energy that is lost in its own digits."""
HALVINGS = 12
LAST = 1e-4
"""Share of its length that an element may change by in a step that is not looked at."""


class NoBalance(Exception):  # noqa: N818
    """No end was found."""


class Descent(NamedTuple):
    """Energies (rows,), their slopes by coordinate (coordinates, rows), 0 where none may move, and
    second derivatives as the problem keeps them, rows last.
    """

    energy: Array
    gradient: Array
    matrix: Any


class Potential(Protocol):
    """Energies of a row of shapes.

    ``scale`` (rows,) is an energy of their size, ``close`` (rows,) what slope counts as none.
    """

    scale: Array
    close: Array

    def at(self, x: Array, rows: NDArray[np.int_]) -> Descent:
        """The energies of ``rows`` at coordinates ``x`` (coordinates, rows)."""
        ...

    def ahead(self, state: Descent, damping: Array) -> Array:
        """Where Newton's step leads, (coordinates, rows), with that share of the diagonal more."""
        ...

    def change(self, x: Array, ahead: Array) -> Array:
        """The largest share of its length by which a step changes an element: (rows,)."""
        ...


def settled(problem: Potential, x: Array) -> Array:
    """The coordinates (coordinates, rows) of least energy downhill of these.

    Raises NoBalance where no end is found.
    """
    found, live = x.copy(), np.arange(x.shape[1])
    ahead, share = np.zeros_like(x), np.ones(len(live))
    damping, slope = np.zeros(len(live)), np.zeros(len(live))
    energy = np.full(len(live), np.inf)
    halved = np.zeros(len(live), dtype=int)
    for _ in range(MOST_STEPS):
        scale = problem.scale[live]
        to = x + share * ahead
        state = problem.at(to, live)
        room = 1e-12 * (np.abs(energy) + scale)
        good = (share == 0.0) | (state.energy <= energy + 1e-4 * share * slope + room)
        x, energy = np.where(good, to, x), np.where(good, state.energy, energy)
        lower = np.where(share > 0, damping / 10, np.clip(10 * damping, 1e-3, 1e9))
        damping = np.where(good, np.where(lower < 1e-6, 0.0, lower), damping)
        move = problem.ahead(state, damping)
        falls = (move * state.gradient).sum(0)
        # Where rounding alone decides whether the energy falls, there is nothing left to gain.
        still = np.abs(state.gradient).max(0) <= problem.close[live]
        still |= (np.abs(falls) <= ROUNDING * (np.abs(energy) + scale)) & (damping == 0.0)
        still &= good
        # No element is stretched, turned or shortened by more than its own length: none collapses.
        full = np.minimum(1.0, FARTHEST / np.maximum(problem.change(x, move), 1e-300))
        halved = np.where(good, 0, halved + 1)
        less = np.where(halved < HALVINGS, share / 2, 0.0)
        share = np.where(good, np.where(falls <= 0, full, 0.0), less)
        ahead, slope = np.where(good, move, ahead), np.where(good, falls, slope)
        if still.any():
            # The last step is too short to be judged by the energy, and squares what is amiss.
            last = np.where(problem.change(x, move) < LAST, x + move, x)
            found[:, live[still]] = last[:, still]
            if still.all():
                return found
            left = ~still
            live, x, ahead = live[left], x[:, left], ahead[:, left]
            share, damping, slope = share[left], damping[left], slope[left]
            energy, halved = energy[left], halved[left]
    raise NoBalance


# Many small symmetric systems at once whose matrices are narrow bands.


def solve(band: Array, wanted: Array) -> Array:
    """The ``x`` of A x = ``wanted``: (n, rows), or (n, several, rows) with several wanted of each.

    ``band`` (n, width, rows) holds ``A[i, i + k]`` at ``[i, k]``. By A = L D L^T without a change
    of order, all rows in step; a pivot below 0 is taken for its size, so that of an energy's slopes
    ``x`` leads downhill always.
    """
    size, width, rows = band.shape
    reach = width - 1
    # Room for both halves and beyond the end; A[i, i + k] at [i, reach + k].
    full = np.zeros((size + reach, 2 * reach + 1, rows))
    full[:size, reach:] = band
    several = wanted.reshape(size, -1, rows)
    found = np.zeros((size + reach, *several.shape[1:]))
    found[:size] = several
    step, across, row = full.strides
    # Of each pivot, the square of the rows and columns behind it that it reaches.
    squares = np.lib.stride_tricks.as_strided(
        full[1:, reach:], (size, reach, reach, rows), (step, step - across, across, row)
    )
    lower, pivots = np.empty((size, reach, 1, rows)), np.empty((size, 1, rows))
    product, side = np.empty((reach, reach, rows)), np.empty((reach, *several.shape[1:]))
    for i in range(size):
        right = full[i, reach + 1 :]
        pivot = np.abs(full[i, reach], out=pivots[i, 0])
        share = lower[i]
        np.divide(right, pivot, out=share[:, 0])
        np.multiply(share, right, out=product)
        squares[i] -= product
        np.multiply(share, found[i], out=side)
        found[i + 1 : i + width] -= side
    found[:size] /= pivots
    for i in reversed(range(size)):
        np.multiply(lower[i], found[i + 1 : i + width], out=side)
        found[i] -= side.sum(0)
    return found[:size].reshape(wanted.shape)


def solve_positive(band: Array, wanted: Array) -> Array | None:
    """The ``x`` of A x = ``wanted`` (n, rows) as ``solve`` has it; None unless all A are positive
    definite. Block by block as wide as the band: quicker where that is wide and rows are few.
    """
    size, width, rows = band.shape
    count = -(-size // width)
    # Beyond the end A is 1, so that all blocks are whole.
    whole = np.zeros((rows, count * width, width))
    whole[:, size:, 0] = 1.0
    whole[:, :size] = band.transpose(2, 0, 1)
    whole = whole.reshape(rows, count, width, width)
    number = np.arange(width)
    off = number - number[:, None]
    row = np.broadcast_to(number[:, None], off.shape)
    upper = np.where(off >= 0, whole[:, :, row, off.clip(0)], 0.0)
    own = upper + np.triu(upper, 1).swapaxes(2, 3)
    beside = np.where(off < 0, whole[:, :, row, (off + width).clip(max=width - 1)], 0.0)
    right = np.zeros((rows, count * width, 1))
    right[:, :size, 0] = wanted.T
    right = right.reshape(rows, count, width, 1)
    turned = np.ascontiguousarray(beside.swapaxes(2, 3))
    # Of each block what it hands on, and its own part of the answer.
    both = np.concatenate([beside, right], 3)
    for k in range(count):
        if k:
            lower = turned[:, k - 1] @ both[:, k - 1]
            own[:, k] -= lower[..., :-1]
            both[:, k, :, -1] -= lower[..., -1]
        try:
            np.linalg.cholesky(own[:, k])
        except np.linalg.LinAlgError:
            return None
        both[:, k] = np.linalg.solve(own[:, k], both[:, k])
    found = both[..., -1].copy()
    for k in reversed(range(count - 1)):
        found[:, k] -= (both[:, k, :, :-1] @ found[:, k + 1, :, None])[..., 0]
    return np.asarray(found.reshape(rows, -1)[:, :size].T)


def join(band: Array, from_: int, to: int) -> None:
    """Adds the row and column of one unknown to another's, further on, that it is equal to."""
    size, width = band.shape[:2]
    for i in range(max(0, from_ - width + 1), min(size, from_ + width)):
        value = band[min(i, from_), abs(i - from_)]
        if i == to:
            value = 2 * value
        at = to if i == from_ else i
        band[min(at, to), abs(at - to)] += value


class Packing(NamedTuple):
    """Which entries [i, k] of a band are kept, and where they go in one without the others."""

    row: NDArray[np.int_]
    off: NDArray[np.int_]
    to_row: NDArray[np.int_]
    to_off: NDArray[np.int_]
    size: int


def packing(freedoms: NDArray[np.int_], size: int, width: int) -> Packing:
    """Of a band (size, width) what is left when only ``freedoms`` are unknown."""
    number = np.full(size + width, -1)
    number[freedoms] = np.arange(len(freedoms))
    row, off = (part.ravel() for part in np.meshgrid(freedoms, np.arange(width), indexing="ij"))
    kept = number[row + off] >= 0
    row, off = row[kept], off[kept]
    return Packing(row, off, number[row], number[row + off] - number[row], len(freedoms))


def packed(band: Array, how: Packing) -> Array:
    """The band (freedoms, width, rows) of the unknowns alone, from one (n, width, rows)."""
    found = np.zeros((how.size, *band.shape[1:]))
    found[how.to_row, how.to_off] = band[how.row, how.off]
    return found


def dense(band: Array) -> Array:
    """The whole matrices: (rows, n, n)."""
    size, width, rows = band.shape
    found = np.zeros((rows, size, size))
    for k in range(width):
        i = np.arange(size - k)
        found[:, i, i + k] = found[:, i + k, i] = band[: size - k, k].T
    return found


# Steps of Newton's method towards the least of an energy.


FARTHEST_STEP = np.array([0.4, 0.15, 0.15])
"""The most by which one step moves rise (mm) and tilt (rad)."""
FINE = 1e-6
"""A step (mm, rad) that need not be made."""


def ends(largest: float, before: float, fine: float = FINE) -> bool:
    """Whether a step is the last: what would follow it, if steps go on to shrink as they did since
    the whole step before, is none.
    """
    return largest * largest < fine * before


def towards(gradient: Array, matrix: Array) -> tuple[Array, bool]:
    """Newton's step of each row, kept downhill where the energy curves the wrong way, and whether
    it curves the right way everywhere.
    """
    if not curves_up(matrix):
        values, vectors = np.linalg.eigh(matrix)
        least = 1e-6 * np.abs(values).max(-1, keepdims=True) + 1e-9
        values = np.maximum(np.abs(values), least)
        within = (vectors.transpose(0, 2, 1) @ gradient[..., None])[..., 0]
        return np.asarray(-(vectors @ (within / values)[..., None])[..., 0]), False
    return np.asarray(-np.linalg.solve(matrix, gradient[..., None])[..., 0]), True


def limited(move: Array) -> Array:
    """Share of each row's step that stays within what one step may do."""
    return np.asarray(np.minimum(1.0, (FARTHEST_STEP / np.maximum(np.abs(move), 1e-12)).min(-1)))


def curves_up(matrix: Array) -> bool:
    """Whether the energy rises every way."""
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        return False
    return True
