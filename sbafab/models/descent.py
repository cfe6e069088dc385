"""Steps of Newton's method towards the least of an energy."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from sbafab.models.film_elements import Array

FARTHEST = np.array([0.4, 0.15, 0.15])
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
    return np.asarray(np.minimum(1.0, (FARTHEST / np.maximum(np.abs(move), 1e-12)).min(-1)))


def curves_up(matrix: Array) -> bool:
    """Whether the energy rises every way."""
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        return False
    return True
