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
