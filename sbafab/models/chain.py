"""A chain of plates: where tilting and rising levels put each plate, and how it moves with them.

A level has three freedoms: its rise (mm) and the tilt of its upper plate, a rotation vector in the
lower plate's plane (rad). Half of the tilt comes before the rise and half after: what constant
curvature within a level does. Arrays have a row a level.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from sbafab.models.film_elements import Array

SMALL = 1e-8
NEXT, AFTER = np.array([1, 2, 0]), np.array([2, 0, 1])


class Chain(NamedTuple):
    """Plates of a chain, the base first: places (n + 1, 3) in mm and axes (n + 1, 3, 3), whose
    columns are the plates' x, y and z; ``rises`` (n, 3) are the levels' directions.

    ``turns`` (n, 2, 3, 2) are what a unit of tilt turns plates by, before and after the rise.
    """

    places: Array
    axes: Array
    rises: Array
    turns: Array


def chain(freedoms: Array, pitch: float) -> Chain:
    """The plates of levels with freedoms (n, 3), each ``pitch`` mm high when flat."""
    count = len(freedoms)
    half = freedoms[:, 1:] / 2
    turned, rates = _rotations(half)
    lengths = (freedoms[:, 0] + pitch).tolist()
    both = turned @ turned
    axes = np.empty((count + 1, 3, 3))
    axes[0] = np.eye(3)
    for i in range(count):
        np.matmul(axes[i], both[i], out=axes[i + 1])
    middle = axes[:-1] @ turned
    rises = middle[:, :, 2]
    places = np.zeros((count + 1, 3))
    np.cumsum(rises * np.asarray(lengths)[:, None], axis=0, out=places[1:])
    turns = np.empty((count, 2, 3, 2))
    turns[:, 0] = axes[:-1] @ rates / 2
    turns[:, 1] = middle @ rates / 2
    return Chain(places, axes, rises, turns)


def _rotations(vectors: Array) -> tuple[Array, Array]:
    """Rotations (n, 3, 3) by vectors (n, 2) in the xy plane, and the turn by a unit change of each
    (n, 3, 2): Rodrigues' formula and the left Jacobian.
    """
    x, y = vectors[:, 0], vectors[:, 1]
    angle = np.sqrt(x * x + y * y)
    safe = np.maximum(angle, SMALL)
    sine = np.where(angle > SMALL, np.sin(safe) / safe, 1.0)
    versine = np.where(angle > SMALL, (1 - np.cos(safe)) / safe**2, 0.5)
    rest = np.where(angle > 1e-4, (1 - sine) / safe**2, 1 / 6)
    found = np.empty((len(x), 3, 3))
    found[:, 0, 0] = 1 - versine * y * y
    found[:, 1, 1] = 1 - versine * x * x
    found[:, 2, 2] = 1 - versine * angle**2
    found[:, 0, 1] = found[:, 1, 0] = versine * x * y
    found[:, 0, 2], found[:, 2, 0] = sine * y, -sine * y
    found[:, 1, 2], found[:, 2, 1] = -sine * x, sine * x
    rates = np.empty((len(x), 3, 2))
    rates[:, 0, 0] = 1 - rest * y * y
    rates[:, 1, 1] = 1 - rest * x * x
    rates[:, 0, 1] = rates[:, 1, 0] = rest * x * y
    rates[:, 2, 0], rates[:, 2, 1] = -versine * y, versine * x
    return found, rates


def _cross(a: Array, b: Array) -> Array:
    """Vector products; numpy's own takes ten times as long for short rows."""
    found = a[..., NEXT] * b[..., AFTER]
    found -= a[..., AFTER] * b[..., NEXT]
    return np.asarray(found)


def moves(at: Chain, points: Array, plates: NDArray[np.int_]) -> Array:
    """How points (k, 3) on plates (k) move with the freedoms: (k, 3, 3 n)."""
    count = len(at.rises)
    found = np.empty((len(points), 3, count, 3))
    found[..., 0] = at.rises.T
    for which, start in ((0, at.places[:-1]), (1, at.places[1:])):
        arms = points[:, None] - start
        by_turn = _cross(at.turns[None, :, which].transpose(0, 1, 3, 2), arms[:, :, None])
        part = by_turn.transpose(0, 3, 1, 2)
        if which == 0:
            found[..., 1:] = part
        else:
            found[..., 1:] += part
    if (plates < count).any():
        found *= (np.arange(count) < plates[:, None])[:, None, :, None]
    return found.reshape(len(points), 3, -1)


def stiffening(at: Chain, moved: Array, forces: Array) -> Array:
    """Second derivatives of the work of forces (k, 3) by the freedoms: what comes of their arms.

    A joint nearer the base turns all movements beyond it. Of those within a joint its own tilts
    are taken at their mean: enough to descend by.
    """
    count = len(at.rises)
    whole = at.turns.sum(1)
    # sum over points of force . (turn_i x move_j) = turn_i . sum (move_j x force)
    torque = _cross(moved.transpose(0, 2, 1), forces[:, None, :]).sum(0)
    found = np.zeros((count, 3, 3 * count))
    found[:, 1:] = np.einsum("idt,jd->itj", whole, torque)
    matrix = found.reshape(3 * count, 3 * count)
    level = np.repeat(np.arange(count), 3)
    upper = np.where(level[:, None] < level[None, :], matrix, 0.0)
    own = np.where(level[:, None] == level[None, :], matrix, 0.0)
    return np.asarray(upper + upper.T + (own + own.T) / 2)
