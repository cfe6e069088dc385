"""Many small symmetric systems at once whose matrices are narrow bands."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from sbafab.models.film_elements import Array


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
