"""A chain of plates: where tilting and rising levels put each plate, and how it moves with them.

A level has three freedoms: its rise (mm) and the tilt of its upper plate, a rotation vector in the
lower plate's plane (rad). Half of the tilt comes before the rise and half after: what constant
curvature within a level does. Arrays have a row a level.
"""

from __future__ import annotations

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
    """Matrix (13, 15) behind ``_rotations``: of 1, x, y, twice xx, xy, yx, yy, then x, y."""
    found = np.zeros((13, 15))
    turn, rate = found[:, :9].reshape(13, 3, 3), found[:, 9:].reshape(13, 2, 3)
    turn[0] = BASE
    # The vector (x, y, 0) as a cross product, then that twice.
    turn[1:3] = SIGNS[:, :2].transpose(1, 0, 2)
    turn[3:7] = (turn[1:3, None] @ turn[None, 1:3]).reshape(4, 3, 3)
    rate[0] = BASE[:2] / 2
    rate[7:11] = turn[3:7, :2] / 2
    rate[7:11, :, 2] = 0.0
    rate[11:] = -turn[1:3, :2] / 2
    return found


TURNED = _turned()


class Chain(NamedTuple):
    """Plates of a chain, the base first: places (n + 1, 3) in mm and axes (n + 1, 3, 3), whose
    columns are the plates' x, y and z; ``rises`` (n, 3) are the levels' directions.

    ``turns`` (n, 2, 2, 3) are what a unit of each tilt turns plates by, before and after the rise.
    """

    places: Array
    axes: Array
    rises: Array
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
    places = np.zeros((count + 1, 3))
    np.cumsum(rises * (freedoms[:, :1] + pitch), axis=0, out=places[1:])
    turns = np.empty((count, 2, 2, 3))
    np.matmul(rates, axes[:-1].transpose(0, 2, 1), out=turns[:, 0])
    np.matmul(rates, middle.transpose(0, 2, 1), out=turns[:, 1])
    return Chain(places, axes, rises, turns)


def _rotations(vectors: Array) -> tuple[Array, Array]:
    """Rotations (n, 3, 3) by vectors (n, 2) in the xy plane, and half the turn by a unit change of
    each (n, 2, 3): Rodrigues' formula and the left Jacobian.
    """
    count = len(vectors)
    pairs = (vectors[:, :, None] * vectors[:, None]).reshape(count, 4)
    square = pairs[:, :1] + pairs[:, 3:]
    safe = np.maximum(square, SMALL)
    angle = np.sqrt(safe)
    sine = np.sin(angle) / angle
    versine = (1 - np.cos(angle)) / safe
    parts = np.empty((count, 13))
    parts[:, :1] = 1.0
    np.multiply(sine, vectors, out=parts[:, 1:3])
    np.multiply(versine, pairs, out=parts[:, 3:7])
    np.multiply((1 - sine) / safe, pairs, out=parts[:, 7:11])
    np.multiply(versine, vectors, out=parts[:, 11:])
    found = parts @ TURNED
    return found[:, :9].reshape(count, 3, 3), found[:, 9:].reshape(count, 2, 3)


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
    before, after = at.turns[:, 0], at.turns[:, 1]
    found[:, 1:, :3] = before + after
    arms = crossing(at.places)
    found[:, 1:, 3:] = before @ arms[:-1] + after @ arms[1:]
    return found
