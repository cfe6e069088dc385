"""The nearest point to another that keeps linear limits: a convex quadratic program."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from sbafab.models.film_elements import Array

STEPS = 80
CLOSE, SMALL = 1e-5, 1e-8
"""Out of balance that is none; limits missed, and slack times its multiplier, that are none."""
SHORT = 0.99
"""Share of the way to the next limit that a step may go."""


def nearest(point: Array, rows: Array, least: Array) -> Array | None:
    """Return the x nearest to ``point`` (n,) with ``rows @ x >= least``; None where none is found.

    Rows (m, n) are unit vectors. Mehrotra's predictor and corrector (Nocedal and Wright, Numerical
    Optimization, Sec. 16.6).
    """
    x = point.copy()
    room = rows @ x - least
    begin = max(1e-2 * float(np.abs(room).max(initial=0.0)), 1e-4)
    slack, push = np.maximum(room, begin), np.full(len(rows), begin)
    for _ in range(STEPS):
        off = x - point - push @ rows
        gap = rows @ x - slack - least
        mean = float(slack @ push) / len(rows)
        if np.abs(off).max() < CLOSE and max(np.abs(gap).max(), mean) < SMALL:
            return x
        weighted = rows * np.sqrt(push / slack)[:, None]
        # A matrix times its own transpose: BLAS does half of the work.
        inverse = np.linalg.inv(np.eye(len(x)) + weighted.T @ weighted)

        def step(wanted: Array) -> tuple[Array, Array, Array]:
            ahead = inverse @ (((-wanted - push * gap) / slack) @ rows - off)  # noqa: B023
            slacker = rows @ ahead + gap  # noqa: B023
            return ahead, slacker, (-wanted - push * slacker) / slack  # noqa: B023

        _, slacker, harder = step(slack * push)
        to = _share(slack, slacker), _share(push, harder)
        left = (slack + to[0] * slacker) @ (push + to[1] * harder) / len(rows)
        aim = (left / mean) ** 3 * mean
        ahead, slacker, harder = step(slack * push + slacker * harder - aim)
        share = min(1.0, SHORT * min(_share(slack, slacker), _share(push, harder)))
        x, slack, push = x + share * ahead, slack + share * slacker, push + share * harder
    return None


def _share(values: Array, by: Array) -> float:
    """Share of a step after which the first of the values is 0; inf where none ever is."""
    falls = by < 0
    return float((values[falls] / -by[falls]).min(initial=np.inf))
