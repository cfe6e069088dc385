"""A chain of plates: where tilting and rising levels put each plate, and how it moves with them.

A level has three freedoms: its rise (mm) and the tilt of its upper plate, a rotation vector in the
lower plate's plane (rad). Half of the tilt comes before the rise and half after: what constant
curvature within a level does. Arrays have a row a level.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from sbafab.models.film_elements import Array

SMALL = 1e-8
"""Square of the angle below which its functions are those at this one."""
BASE = np.eye(3)
SIGNS = np.zeros((3, 3, 3))
"""The Levi-Civita symbol."""
SIGNS[[0, 1, 2], [1, 2, 0], [2, 0, 1]] = 1.0
SIGNS[[0, 2, 1], [2, 1, 0], [1, 0, 2]] = -1.0
CROSS = SIGNS.transpose(1, 2, 0).reshape(3, 9)


def _felt() -> Array:
    """Matrix (12, 24) behind ``felt``."""
    found = np.zeros((12, 6, 4))
    arms, forces = found[:9].reshape(3, 3, 6, 4), found[9:]
    one = np.eye(3)
    # (turn x x) x f is x (turn . f) less turn (x . f).
    arms[:, :, :3, :3] = np.einsum("kc,lr->klrc", one, one) - np.einsum("kl,rc->klrc", one, one)
    arms[:, :, :3, 3] = SIGNS.transpose(1, 2, 0)
    forces[:, 3:, :3] = -SIGNS.transpose(1, 2, 0)
    forces[:, 3:, 3] = one
    return found.reshape(12, 24)


FELT = _felt()


def _turned() -> Array:
    """Matrix (12, 13) behind ``_rotations``: of 1, x, y, xx, xy, yx, yy, 1, then xx, xy, yx, yy."""
    found = np.zeros((12, 13))
    turn, rate = found[:, :9].reshape(12, 3, 3), found[:, 9:].reshape(12, 2, 2)
    turn[0] = BASE
    # The vector (x, y, 0) as a cross product, then that twice.
    turn[1:3] = SIGNS[:, :2].transpose(1, 0, 2)
    turn[3:7] = (turn[1:3, None] @ turn[None, 1:3]).reshape(4, 3, 3)
    rate[7] = BASE[:2, :2]
    rate[8:] = np.eye(4).reshape(4, 2, 2)
    return found


TURNED = _turned()


class Chain(NamedTuple):
    """Plates of a chain, the base first: places (n + 1, 3) in mm and axes (n + 1, 3, 3), whose
    columns are the plates' x, y and z; ``rises`` (n, 3) are the levels' directions.

    A level's tilt turns all beyond it about its middle: ``middles`` (n, 3) in mm; ``turns``
    (n, 2, 3) is what a unit of either turns it by.
    """

    places: Array
    axes: Array
    rises: Array
    middles: Array
    turns: Array


def chain(freedoms: Array, pitch: float) -> Chain:
    """The plates of levels with freedoms (n, 3), each ``pitch`` mm high when flat."""
    count = len(freedoms)
    turned, rates = _rotations(freedoms[:, 1:] / 2)
    axes = np.empty((count + 1, 3, 3))
    axes[0] = BASE
    np.matmul(turned, turned, out=axes[1:])
    reach = 1
    while reach < count:
        # Each is already the product of ``reach`` levels up to its own.
        axes[reach + 1 :] = axes[1:-reach] @ axes[reach + 1 :]
        reach *= 2
    middle = axes[:-1] @ turned
    rises = middle[:, :, 2]
    steps = rises * (freedoms[:, :1] + pitch)
    places = _sums(count) @ steps
    # What the first half of a tilt turns by and what the second does differ along the plates
    # between them alone, across which the level rises: together they turn about its middle.
    turns = rates @ middle[:, :, :2].transpose(0, 2, 1)
    return Chain(places, axes, rises, places[1:] - steps / 2, turns)


@lru_cache(maxsize=16)
def _sums(count: int) -> Array:
    """Matrix (count + 1, count) that adds up the rows before each place."""
    return np.tri(count + 1, count, -1)


def _rotations(vectors: Array) -> tuple[Array, Array]:
    """Rotations (n, 3, 3) by vectors (n, 2) in the xy plane, and what a unit of each component,
    half before and half after, turns by in the xy plane between (n, 2, 2): Rodrigues' formula, and
    the mean of the left and the right Jacobian.
    """
    count = len(vectors)
    # A column a level: numpy is the faster the longer its last axis.
    each = vectors.T
    pairs = (each[:, None] * each).reshape(4, count)
    safe = np.maximum(pairs[0] + pairs[3], SMALL)
    angle = np.sqrt(safe)
    sine = np.sin(angle) / angle
    parts = np.empty((12, count))
    parts[0] = 1.0
    np.multiply(sine, each, out=parts[1:3])
    np.multiply((1 - np.cos(angle)) / safe, pairs, out=parts[3:7])
    parts[7] = sine
    np.multiply((1 - sine) / safe, pairs, out=parts[8:])
    found = parts.T @ TURNED
    return found[:, :9].reshape(count, 3, 3), found[:, 9:].reshape(count, 2, 2)


def crossing(vectors: Array) -> Array:
    """Matrices (..., 3, 3) that make of a row its vector product, the vectors (..., 3) first."""
    return np.asarray((vectors @ CROSS).reshape(*vectors.shape, 3))


def felt(arms: Array, forces: Array) -> Array:
    """What movements as of ``twists`` do with forces f at points x: (n, 6, 4).

    Of the sum of x f (n, 3, 3) and of f (n, 3) over the points. The first three of the last axis
    are the sum of (movement of x) x f, the fourth is that of (movement of x) . f.
    """
    both = np.concatenate([arms.reshape(-1, 9), forces], axis=1)
    return np.asarray((both @ FELT).reshape(-1, 6, 4))


def twists(at: Chain) -> Array:
    """What a unit of each freedom does to all plates beyond its level: (n, 3, 6).

    The first three turn, the others move: a point x of these plates moves by turn x x + move.
    """
    found = np.zeros((len(at.rises), 3, 6))
    found[:, 0, 3:] = at.rises
    found[:, 1:, :3] = at.turns
    np.matmul(at.turns, crossing(at.middles), out=found[:, 1:, 3:])
    return found
