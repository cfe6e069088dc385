"""Equilibria as minima of energy, many at once: damped Newton's method with a line search, and its
linear algebra of banded matrices.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from sbafab.models.film_elements import Array

LONGEST_STEP = 0.7
"""Share of its length by which an element may change in one step."""
MOST_STEPS = 400
ROUNDING = 1e-13
"""Share of the energy that is lost to rounding."""
HALVINGS = 12
LAST_STEP = 1e-4
"""Share of its length by which the last step, without line search, may change an element."""
FEW = 8
"""Number of rows up to which solving whole matrices is faster than all bands together."""


class NoEquilibrium(Exception):  # noqa: N818
    """Newton's method did not converge."""


def equilibrium(
    energies: Callable[[Array, NDArray[np.int_]], tuple[Array, Array, Array]],
    change: Callable[[Array, Array], Array],
    x: Array,
    scale: Array,
    close: Array,
) -> Array:
    """Return the coordinates (coordinates, rows) of least energy downhill of these.

    ``energies`` of coordinates and the numbers of their rows are the energies (rows,), their
    gradient (coordinates, rows) and second derivatives as a band (coordinates, width, rows) that
    holds ``A[i, i + k]`` at ``[i, k]``. ``change`` is the largest share of its length by which a
    step from coordinates changes an element: (rows,). ``scale`` (rows,) is the energies' scale,
    ``close`` (rows,) the tolerance of the gradient. Raises NoEquilibrium if Newton's method does
    not converge.
    """
    minimum, live = x.copy(), np.arange(x.shape[1])
    step_taken, share = np.zeros_like(x), np.ones(len(live))
    damping, slope = np.zeros(len(live)), np.zeros(len(live))
    energy = np.full(len(live), np.inf)
    halved = np.zeros(len(live), dtype=int)
    for _ in range(MOST_STEPS):
        to = x + share * step_taken
        value, gradient, band = energies(to, live)
        room = 1e-12 * (np.abs(energy) + scale[live])
        good = (share == 0.0) | (value <= energy + 1e-4 * share * slope + room)
        x, energy = _where(good, to, x), np.where(good, value, energy)
        lower = np.where(share > 0, damping / 10, np.clip(10 * damping, 1e-3, 1e9))
        damping = np.where(good, np.where(lower < 1e-6, 0.0, lower), damping)
        step = _newton_step(gradient, band, damping)
        falls, changed = np.einsum("ij,ij->j", step, gradient), change(x, step)
        # Stop when rounding decides whether the energy falls.
        still = np.abs(gradient).max(0) <= close[live]
        still |= (np.abs(falls) <= ROUNDING * (np.abs(energy) + scale[live])) & (damping == 0.0)
        still &= good
        # No element is stretched, turned or shortened by more than its length: none collapses.
        full = np.minimum(1.0, LONGEST_STEP / np.maximum(changed, 1e-300))
        halved = np.where(good, 0, halved + 1)
        less = np.where(halved < HALVINGS, share / 2, 0.0)
        share = np.where(good, np.where(falls <= 0, full, 0.0), less)
        step_taken, slope = _where(good, step, step_taken), np.where(good, falls, slope)
        if still.any():
            # The last step is too short for the energy to judge it, and squares the error.
            last = np.where(changed < LAST_STEP, step, 0.0)[:, still]
            minimum[:, live[still]] = x[:, still] + last
            if still.all():
                return minimum
            is_open = np.flatnonzero(~still)
            live, x, step_taken = live[is_open], x[:, is_open], step_taken[:, is_open]
            share, damping, slope = share[is_open], damping[is_open], slope[is_open]
            energy, halved = energy[is_open], halved[is_open]
    raise NoEquilibrium


def _where(good: NDArray[np.bool_], new: Array, old: Array) -> Array:
    """Return the columns of ``new`` if good, else of ``old``."""
    return new if good.all() else np.where(good, new, old)


def _newton_step(gradient: Array, band: Array, damping: Array) -> Array:
    """Return Newton's step, with diagonals increased by shares ``damping`` of themselves."""
    size = np.abs(band[:, 0])
    band[:, 0] += damping * size
    # A share of the order of rounding is for slack films, which may be unsupported.
    band[:, 0] += 1e-15 * size.max(0)
    step = solve_whole(band, -gradient) if len(damping) <= FEW else None
    return solve(band, -gradient) if step is None else step


def solve(band: Array, right_side: Array) -> Array:
    """Return the solution of A x = ``right_side``, (n, rows), by bands (n, width, rows) of A.

    By A = L D L^T without pivoting, all rows in step; a negative pivot is replaced by its absolute
    value, so that for the gradient of an energy the solution is always a descent direction.
    """
    size, width, rows = band.shape
    reach = width - 1
    # Room for both halves and beyond the end; A[i, i + k] at [i, reach + k].
    full = np.zeros((size + reach, 2 * reach + 1, rows))
    full[:size, reach:] = band
    solution = np.zeros((size + reach, 1, rows))
    solution[:size, 0] = right_side
    step, across, row = full.strides
    # Of each pivot, the square of the rows and columns behind it that it reaches.
    squares = np.lib.stride_tricks.as_strided(
        full[1:, reach:], (size, reach, reach, rows), (step, step - across, across, row)
    )
    lower, pivots = np.empty((size, reach, 1, rows)), np.empty((size, 1, rows))
    square, side = np.empty((reach, reach, rows)), np.empty((reach, 1, rows))
    for i in range(size):
        right = full[i, reach + 1 :]
        pivot = np.abs(full[i, reach], out=pivots[i, 0])
        share = lower[i]
        np.divide(right, pivot, out=share[:, 0])
        np.multiply(share, right, out=square)
        squares[i] -= square
        np.multiply(share, solution[i], out=side)
        solution[i + 1 : i + width] -= side
    solution[:size] /= pivots
    for i in reversed(range(size)):
        np.multiply(lower[i], solution[i + 1 : i + width], out=side)
        solution[i] -= side.sum(0)
    return np.asarray(solution[:size, 0])


def solve_whole(band: Array, right_side: Array) -> Array | None:
    """Return the solution of A x = ``right_side`` like ``solve``; None unless all A are positive
    definite. Faster for few rows.
    """
    whole = dense(band)
    try:
        np.linalg.cholesky(whole)
        return np.asarray(np.linalg.solve(whole, right_side.T[..., None])[..., 0].T)
    except np.linalg.LinAlgError:
        return None


def dense(band: Array) -> Array:
    """Return the full matrices: (rows, n, n)."""
    size, width, rows = band.shape
    first, off = np.nonzero(np.add.outer(np.arange(size), np.arange(width)) < size)
    whole = np.zeros((rows, size, size))
    whole[:, first, first + off] = whole[:, first + off, first] = band[first, off].T
    return whole


class Packing(NamedTuple):
    """An index map to a band (size, width) of unknowns: the sums from ``starts`` of the ``source``
    entries times their ``weight`` are stored ``into`` its elements.
    """

    source: NDArray[np.int_]
    weight: Array
    starts: NDArray[np.int_]
    into: NDArray[np.int_]
    shape: tuple[int, int]

    def band(self, entries: Array) -> Array:
        """Return the band (size, width, rows) from entries (n, rows)."""
        weighted = entries[self.source]
        weighted *= self.weight[:, None]
        whole = np.zeros((self.shape[0] * self.shape[1], entries.shape[1]))
        whole[self.into] = np.add.reduceat(weighted, self.starts)
        return whole.reshape(*self.shape, -1)


def packing(
    first: Array, second: Array, source: NDArray[np.int_], is_pair: NDArray[np.bool_]
) -> Packing:
    """Return the map of entries to the band of unknowns.

    An entry, a number in ``source``, couples two coordinates, which a unit of each unknown moves by
    ``first`` and ``second`` (entries, unknowns); a pair stands for the second with the first as
    well.
    """
    (a, by_a), (b, by_b) = _moving(first), _moving(second)
    a, b = np.broadcast_arrays(a[:, :, None], b[:, None])
    pair = is_pair[:, None, None]
    weight = by_a[:, :, None] * by_b[:, None] * np.where(pair & (a == b), 2.0, 1.0)
    good = (weight != 0) & (pair | (a <= b))
    off = np.abs(a - b)[good]
    wide = int(off.max()) + 1
    places = np.minimum(a, b)[good] * wide + off
    order = np.argsort(places, kind="stable")
    into, starts = np.unique(places[order], return_index=True)
    sources = source[np.nonzero(good)[0][order]]
    return Packing(sources, weight[good][order], starts, into, (first.shape[1], wide))


def _moving(motion: Array) -> tuple[NDArray[np.int_], Array]:
    """Return the unknowns that move coordinates (n, unknowns), and by how much: (n, most) each."""
    most = int((motion != 0).sum(1).max())
    unknowns = np.argsort(motion == 0, axis=1, kind="stable")[:, :most]
    return unknowns, np.take_along_axis(motion, unknowns, 1)
