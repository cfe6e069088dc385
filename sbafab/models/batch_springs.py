"""Springs of one kind of balloon for many states at once, by pressures of their own.

As ``stack_loads.Springs`` with a state a column: numpy is the faster the longer its last axis.
Lengths mm, pressures kPa, volumes ul, energies uJ.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.models.balloon_map import (
    CURVES,
    DEGREE,
    PIECES,
    PIECES_IN_ALL,
    PRESSURE_SPANS,
    SLOPES,
    pieces,
)
from sbafab.models.stack_loads import RING_POINTS

if TYPE_CHECKING:
    from sbafab.models.balloon_map import BalloonMap
    from sbafab.models.film_elements import Array
    from sbafab.models.stack_poses import PosedStack

BY_PRESSURE = np.zeros((3, DEGREE + 1, DEGREE + 1))
BY_PRESSURE[0], BY_PRESSURE[1, :, :-1], BY_PRESSURE[2, :, :-2] = PIECES, SLOPES, CURVES
"""Splines' weights by pressure: of values, first and second derivatives."""
LEAST_PIVOT = 1e-12
"""Pivot, as a share of the largest, below which a matrix counts as indefinite."""


class SpringBatch(NamedTuple):
    """Springs of n states of one kind of balloon: ``energy`` (n), ``gradient`` (3, n) and
    ``matrix`` (3, 3, n) by rise and tilt; ``volumes`` (chambers, n), their rates by rise and tilt,
    ``filling`` (chambers, 3, n), and by pressure, ``swelling`` (chambers, n).
    """

    energy: Array
    gradient: Array
    matrix: Array
    volumes: Array
    filling: Array
    swelling: Array


@dataclass(frozen=True, eq=False)
class BatchSprings:
    """One kind of balloon.

    ``table`` (powers, pieces, coefficients by pressure) are the pieces of its potential, a ring's
    point's share of it; ``meet`` (points, 3), ``squares`` (9, points), ``shut`` (9, points) as of
    ``GapPlaces``, ``tilts`` (chambers x 3, points) sum the ring's gaps by chamber.
    """

    kind: BalloonMap
    table: Array
    meet: Array
    squares: Array
    shut: Array
    tilts: Array

    @classmethod
    def of(cls, stack: PosedStack, number: int) -> BatchSprings:
        """Return the springs of a stack's kind of balloon."""
        kind, places = stack.maps[number], stack.places
        ring = places.ring[number]
        tilts = np.zeros((stack.chambers, 3, len(ring)))
        for chamber in range(stack.chambers):
            part = slice(chamber * RING_POINTS, (chamber + 1) * RING_POINTS)
            tilts[chamber, :, part] = ring[part].T
        return cls(
            kind,
            np.ascontiguousarray(pieces(kind.coefficients).transpose(2, 1, 0) / RING_POINTS),
            np.ascontiguousarray(places.meet[number].T),
            np.ascontiguousarray(places.squares[number].T),
            np.ascontiguousarray(places.shut[number].T),
            tilts.reshape(-1, len(ring)),
        )

    def weights(self, pressures: Array, orders: int) -> Array:
        """Return the splines' weights at pressures (chambers, n) of values and of derivatives by
        pressure: (orders, coefficients, chambers, n).
        """
        x, rate = self.kind.scaled(pressures)
        first = x.astype(np.int_)
        powers = np.empty((DEGREE + 1, x.size))
        powers[0] = 1.0
        powers[1] = (x - first).ravel()
        for k in range(2, DEGREE + 1):
            np.multiply(powers[k - 1], powers[1], out=powers[k])
        each = (BY_PRESSURE[:orders].reshape(-1, DEGREE + 1) @ powers).reshape(orders, -1, x.size)
        if orders > 1:
            rate = rate.ravel()
            if orders > 2:
                p = pressures.ravel()
                each[2] *= rate * rate
                each[2] -= each[1] * (rate * p / (p * p + self.kind.scale_pressure**2))
            each[1] *= rate
        whole = np.zeros((orders, PRESSURE_SPANS + DEGREE, x.size))
        places = first.ravel() * x.size + np.arange(x.size)
        where = places + (np.arange(DEGREE + 1) * x.size)[:, None]
        for one, weights in zip(whole, each, strict=True):
            one.reshape(-1)[where] = weights
        return whole.reshape(orders, -1, *x.shape)

    def at(self, weights: Array, freedoms: Array) -> SpringBatch:
        """Return the springs at pressures of ``weights`` and freedoms (3, n)."""
        orders, _, chambers, count = weights.shape
        points = chambers * RING_POINTS
        gaps = self.meet @ freedoms
        after = gaps[:points] + 1.0
        piece = np.minimum(np.maximum(after, 0.0), PIECES_IN_ALL - 1).astype(np.int_)
        u = after - piece
        low, high = int(piece.min()), int(piece.max()) + 1
        size = chambers * count
        part = self.table[:, low:high].reshape(-1, self.table.shape[2])
        # (orders, powers, pieces x chambers x n)
        rows = (part @ weights.reshape(orders, -1, size)).reshape(orders, DEGREE + 1, -1)
        piece -= low
        piece *= size
        begin = piece.reshape(chambers, RING_POINTS, count)
        begin += np.arange(chambers * count).reshape(chambers, 1, count)
        value, ahead = np.empty((2, orders, points, count))
        for one, table in zip(value, rows, strict=True):
            table[DEGREE].take(piece, out=one, mode="clip")
        first, second = np.zeros((min(orders, 2), points, count)), np.zeros_like(u)
        for k in range(DEGREE - 1, -1, -1):
            if k < DEGREE - 2:
                second *= u
            if k < DEGREE - 1:
                second += first[0]
                first *= u
            first += value[:2]
            for one, table in zip(ahead, rows, strict=True):
                table[k].take(piece, out=one, mode="clip")
            value *= u
            value += ahead
        energy = value[0].sum(0)
        gradient = self.tilts.reshape(chambers, 3, points).sum(0) @ first[0]
        matrix = self.squares @ (2 * second)
        meets = gaps < 0
        if meets.any():
            stiffer = self.shut @ meets
            push = (stiffer.reshape(3, 3, count) * freedoms).sum(1)
            energy += (push * freedoms).sum(0) / 2
            gradient += push
            matrix += stiffer
        sums = [-each.reshape(chambers, RING_POINTS, count).sum(1) for each in value[1:]]
        none = np.zeros((chambers, 0))
        return SpringBatch(
            energy,
            gradient,
            matrix.reshape(3, 3, count),
            sums[0] if orders > 1 else none,
            (self.tilts @ -first[1]).reshape(chambers, 3, count) if orders > 1 else none,
            sums[1] if orders > 2 else none,
        )


def solved(matrices: Array, right: Array) -> tuple[Array, Array]:
    """Return the solutions (size, k, n) of symmetric matrices (size, size, n) by right sides (size,
    k, n), and True (n) where a matrix is positive definite: others have no solution.
    """
    size = len(matrices)
    a, b = matrices.copy(), right.copy()
    least = LEAST_PIVOT * np.abs(np.einsum("iin->in", matrices)).max(0)
    is_firm = np.ones(matrices.shape[2], dtype=bool)
    inverse = []
    for i in range(size):
        fits = a[i, i] > least
        is_firm &= fits
        inverse.append(1 / np.where(fits, a[i, i], 1.0))
        for j in range(i + 1, size):
            share = a[j, i] * inverse[i]
            a[j, i + 1 :] -= share * a[i, i + 1 :]
            b[j] -= share * b[i]
    for i in range(size - 1, -1, -1):
        for j in range(i + 1, size):
            b[i] -= a[i, j] * b[j]
        b[i] *= inverse[i]
    return b, is_firm
