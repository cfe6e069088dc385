"""Equilibria as minima of energy, many at once: damped Newton's method with a line search, and its
linear algebra (banded solvers, safeguarded steps).
"""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

if TYPE_CHECKING:
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


class NoEquilibrium(Exception):  # noqa: N818
    """Newton's method did not converge."""


class Descent(NamedTuple):
    """Energies (rows,), their gradient by coordinate (coordinates, rows), 0 for fixed ones, and
    tangent stiffness in the form that the problem uses, rows last.
    """

    energy: Array
    gradient: Array
    matrix: Any


class Potential(Protocol):
    """Energies of a row of shapes.

    ``scale`` (rows,) is their energy scale, ``close`` (rows,) the tolerance of the residual.
    """

    scale: Array
    close: Array

    def at(self, x: Array, rows: NDArray[np.int_]) -> Descent:
        """Return the energies of ``rows`` at coordinates ``x`` (coordinates, rows)."""
        ...

    def newton_step(self, state: Descent, damping: Array) -> Array:
        """Return Newton's step (coordinates, rows), the diagonal increased by ``damping``."""
        ...

    def change(self, x: Array, ahead: Array) -> Array:
        """Return the largest share of its length by which a step changes an element: (rows,)."""
        ...


def equilibrium(problem: Potential, x: Array) -> Array:
    """Return the coordinates (coordinates, rows) of least energy downhill of these.

    Raises NoEquilibrium if Newton's method does not converge.
    """
    minimum, live = x.copy(), np.arange(x.shape[1])
    step_taken, share = np.zeros_like(x), np.ones(len(live))
    damping, slope = np.zeros(len(live)), np.zeros(len(live))
    energy = np.full(len(live), np.inf)
    halved = np.zeros(len(live), dtype=int)
    for _ in range(MOST_STEPS):
        scale = problem.scale[live]
        to = x + share * step_taken
        state = problem.at(to, live)
        room = 1e-12 * (np.abs(energy) + scale)
        good = (share == 0.0) | (state.energy <= energy + 1e-4 * share * slope + room)
        x, energy = _where(good, to, x), np.where(good, state.energy, energy)
        lower = np.where(share > 0, damping / 10, np.clip(10 * damping, 1e-3, 1e9))
        damping = np.where(good, np.where(lower < 1e-6, 0.0, lower), damping)
        step = problem.newton_step(state, damping)
        falls, change = np.einsum("ij,ij->j", step, state.gradient), problem.change(x, step)
        # Stop when rounding decides whether the energy falls.
        still = np.abs(state.gradient).max(0) <= problem.close[live]
        still |= (np.abs(falls) <= ROUNDING * (np.abs(energy) + scale)) & (damping == 0.0)
        still &= good
        # No element is stretched, turned or shortened by more than its length: none collapses.
        full = np.minimum(1.0, LONGEST_STEP / np.maximum(change, 1e-300))
        halved = np.where(good, 0, halved + 1)
        less = np.where(halved < HALVINGS, share / 2, 0.0)
        share = np.where(good, np.where(falls <= 0, full, 0.0), less)
        step_taken, slope = _where(good, step, step_taken), np.where(good, falls, slope)
        if still.any():
            # The last step is too short for the energy to judge it, and squares the error.
            last = np.where(change < LAST_STEP, step, 0.0)[:, still]
            minimum[:, live[still]] = x[:, still] + last
            if still.all():
                return minimum
            is_open = np.flatnonzero(~still)
            live, x, step_taken = live[is_open], x[:, is_open], step_taken[:, is_open]
            share, damping, slope = share[is_open], damping[is_open], slope[is_open]
            energy, halved = energy[is_open], halved[is_open]
    raise NoEquilibrium


def _where(good: NDArray[np.bool_], new: Array, old: Array) -> Array:
    """Return the columns of ``new`` where good, else of ``old``."""
    return new if good.all() else np.where(good, new, old)


# Banded symmetric systems, many small ones at once.


def solve(band: Array, right_side: Array) -> Array:
    """Return the solution of A x = ``right_side``: (n, rows).

    ``band`` (n, width, rows) holds ``A[i, i + k]`` at ``[i, k]``. By A = L D L^T without pivoting,
    all rows in step; a negative pivot is replaced by its absolute value, so that for the gradient
    of an energy the solution is always a descent direction.
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
    """Return the solution of A x = ``right_side`` as ``solve`` does; None unless all A are positive
    definite. Faster for few rows.
    """
    whole = dense(band)
    try:
        np.linalg.cholesky(whole)
        return np.asarray(np.linalg.solve(whole, right_side.T[..., None])[..., 0].T)
    except np.linalg.LinAlgError:
        return None


class Packing(NamedTuple):
    """Index map to a band (size, width) of unknowns: the sums from ``starts`` of the ``source``
    entries times their ``weight`` go ``into`` its elements.
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
        sums = np.add.reduceat(weighted, self.starts)
        whole = np.zeros((self.shape[0] * self.shape[1], entries.shape[1]))
        whole[self.into] = sums
        return whole.reshape(*self.shape, -1)


def packing(
    bases: Array,
    source: NDArray[np.int_],
    part: NDArray[np.int_],
    first: NDArray[np.int_],
    second: NDArray[np.int_],
    is_pair: NDArray[np.bool_],
) -> Packing:
    """Return the map of entries to the band of unknowns, by the motion of each part's coordinates
    by a unit of each unknown, ``bases`` (parts, coordinates, unknowns).

    An entry, a number in ``source``, couples the coordinates ``first`` and ``second`` of a part; a
    pair stands for the second with the first as well.
    """
    most = int((bases != 0).sum(-1).max())
    columns = np.argsort(bases == 0, axis=-1, kind="stable")[..., :most]
    weights = np.take_along_axis(bases, columns, -1)
    entries = []
    for one, other in product(range(most), repeat=2):
        a, b = columns[part, first, one], columns[part, second, other]
        weight = weights[part, first, one] * weights[part, second, other]
        good = (weight != 0) & (is_pair | (a <= b))
        twice = np.where(is_pair & (a == b), 2.0, 1.0)
        each = np.minimum(a, b), np.abs(a - b), source, weight * twice
        entries.append([values[good] for values in each])
    row, off, sources, weight = (np.concatenate(each) for each in zip(*entries, strict=True))
    wide = int(off.max()) + 1
    order = np.argsort(row * wide + off, kind="stable")
    into, starts = np.unique((row * wide + off)[order], return_index=True)
    return Packing(sources[order], weight[order], starts, into, (bases.shape[2], wide))


def dense(band: Array) -> Array:
    """Return the full matrices: (rows, n, n)."""
    size, width, rows = band.shape
    # Room beyond the end, where the band is 0.
    whole = np.zeros((rows, size + width - 1, size + width - 1))
    for half in (whole, whole.swapaxes(1, 2)):
        row, step, across = half.strides
        diagonals = np.lib.stride_tricks.as_strided(
            half, (rows, size, width), (row, step + across, across)
        )
        diagonals[:] = band.transpose(2, 0, 1)
    return whole[:, :size, :size]
