"""Energy minimisation by Newton's method with a line search, for many states at once."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sbafab.models.film_elements import Array

LARGEST_MOVE = np.array([0.4, 0.15, 0.15])
"""Largest rise (mm) and tilts (rad) in one step."""
FINE = 5e-8
"""Error (mm, rad) at which a descent ends; those of all levels add up."""
MOST_STEPS, HALVINGS = 300, 14
RESIDUAL = 1e-7
"""Tolerance of the residual, mN or mN mm."""


def descent(
    energies: Callable[[Any, Array], tuple[Array, ...]],
    start: Array,
    enough: float,
    is_at_plate: bool,
) -> tuple[Array, Array, NDArray[np.bool_], NDArray[np.bool_]]:
    """Return the equilibria downhill of freedoms (n, rows, 3), once their errors are below ``FINE``
    or a step is no larger than ``enough``; the pushes (n) on a plate, and masks of stable states
    and of those found.

    ``energies`` are those of some of the states, with gradients, second derivatives and pushes as
    in ``Energy``.
    """
    count = len(start)
    equilibria, pushes = start.copy(), np.zeros(count)
    is_stable, is_found = np.zeros((2, count), dtype=bool)
    live, at, before = np.arange(count), start, np.full(count, FINE)
    now = energies(live, at)
    for _ in range(MOST_STEPS if count else 0):
        value, gradient, matrix, push = now
        flat = newton_step(gradient, matrix)
        move, slope = flat.reshape(at.shape), (flat * gradient).sum(-1)
        largest = np.abs(flat).max(1)
        is_still = np.abs(gradient).max(1) < RESIDUAL * (1 + 1e-3 * push)
        is_last = largest * largest < FINE * before
        if is_at_plate:
            # Where contacts open and close, steps do not shrink as they do elsewhere.
            is_last[:] = False
            is_still |= slope > -1e-15 * (1 + np.abs(value))
        is_over = is_still | is_last | (largest <= enough)
        if is_over.any():
            is_firm = is_over.copy()
            is_firm[is_over] = is_positive_definite(matrix[is_over]).all(1)
            is_over &= is_still | is_firm
            which, ends = live[is_over], (is_last & is_firm)[is_over]
            equilibria[which] = at[is_over] + np.where(ends[:, None, None], move[is_over], 0.0)
            pushes[which], is_stable[which] = push[is_over], is_firm[is_over]
            is_found[which] = True
            goes = ~is_over
            if not goes.any():
                break
            live, at, move, largest = live[goes], at[goes], move[goes], largest[goes]
            slope, value = slope[goes], value[goes]
        share = step_limit(move)
        now = energies(live, at + share[:, None, None] * move)
        for _ in range(HALVINGS):
            far = np.flatnonzero(~(now[0] <= value + 1e-11 * (1 + np.abs(value))))
            if not far.size:
                break
            # To where the parabola through both energies and the first slope is least.
            over = 2 * (now[0] - value - share * slope)[far]
            share[far] *= np.clip(-(share * slope)[far] / np.maximum(over, 1e-300), 0.1, 0.5)
            tried = energies(live[far], at[far] + share[far, None, None] * move[far])
            for all_, part in zip(now, tried, strict=True):
                all_[far] = part
        before = np.where(share == 1, largest, 0.0)
        at = at + share[:, None, None] * move
    else:
        equilibria[live] = at
    return equilibria, pushes, is_stable, is_found


def newton_step(gradient: Array, matrix: Array) -> Array:
    """Return Newton's steps (n, freedoms) from gradients and second derivatives (n, groups, size,
    size), made positive definite: steps lead downhill, and never toward a saddle.
    """
    slopes = gradient.reshape(matrix.shape[:3])
    step = -np.linalg.solve(definite(matrix), slopes[..., None])[..., 0]
    return np.asarray(step.reshape(gradient.shape))


def definite(matrix: Array) -> Array:
    """Return matrices (..., size, size) with negative eigenvalues made positive."""
    bent = ~is_positive_definite(matrix)
    if not bent.any():
        return matrix
    values, vectors = np.linalg.eigh(matrix[bent])
    least = 1e-6 * np.abs(values).max(-1, keepdims=True) + 1e-9
    values = np.maximum(np.abs(values), least)
    firm = matrix.copy()
    firm[bent] = (vectors * values[:, None]) @ vectors.swapaxes(-1, -2)
    return firm


def step_limit(move: Array) -> Array:
    """Return the fraction of steps (n, rows, 3) that stays within ``LARGEST_MOVE``: (n)."""
    shares = LARGEST_MOVE / np.maximum(np.abs(move), 1e-12)
    return np.asarray(np.minimum(1.0, shares.min((1, 2))))


def is_positive_definite(matrix: Array) -> NDArray[np.bool_]:
    """Return which matrices (..., size, size) are positive definite: (...)."""
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.eigvalsh(matrix)[..., 0] > 0)
    return np.ones(matrix.shape[:-2], dtype=bool)


def bounded_solutions(matrix: Array, right: Array, least: Array, most: Array) -> Array:
    """Return the minima (n, size) of x @ matrix @ x / 2 - right @ x from ``least`` to ``most``.

    Components beyond are clamped until the rest stays within: an active set that only grows, which
    suffices for one of many steps.
    """
    size = matrix.shape[-1]
    tried = np.linalg.solve(matrix, right[..., None])[..., 0]
    x = np.clip(tried, least, most)
    is_free = x == tried
    live = ~is_free.all(1)
    for _ in range(size):
        if not live.any():
            break
        held = np.where(is_free, 0.0, x)
        reduced = np.where(is_free, right - (matrix @ held[..., None])[..., 0], x)
        both = is_free[:, None] & is_free[..., None]
        tried = np.linalg.solve(np.where(both, matrix, np.eye(size)), reduced[..., None])[..., 0]
        within = np.clip(tried, least, most)
        still = is_free & (within == tried)
        x = np.where(live[:, None], within, x)
        live &= (still != is_free).any(1) & still.any(1)
        is_free = still
    return np.asarray(x)
