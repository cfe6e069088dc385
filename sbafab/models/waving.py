"""A round balloon whose films wave in step with its rim: where nodes are, how sums become bands.

With n waves round the rim every node of a film, and of the rim, has a place

    r = r0 + sum r_k cos(k n turn),  z = z0 + sum z_k cos(k n turn),  aside = sum v_k sin(k n turn)

for the first few k. Films are membranes (Saint Venant and Kirchhoff's law) that bend along the
meridian slice by slice, as in ``film_elements``, and round the hoop wave by wave. The other film
does half a wave further on what this one does, upside down; so the rim goes up and down as a plate
of both films whose section stays straight, its middle in its plane. A film ends half a thickness
off that middle: as the rim tilts, the film's end goes in or out. One film and its share of the rim
are computed; their energy is in ``wave_energy``. Lengths mm.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.models.rim_ripple import both_bend

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from sbafab.models.balloon import Balloon
    from sbafab.models.film_elements import Array

OVERTONES = 5
"""Waves of a film in one ripple of the rim, at most."""
SLICES = 2 * OVERTONES + 2
"""Slices of half a ripple: enough for products of four waves."""
PLACES = 2 + 3 * OVERTONES
"""Numbers that say where a node is: r0, z0, and r_k, z_k and v_k of each k."""
R, Z, EDGE, UP = 0, 1, 2, 3
"""Numbers of r0, z0, r_1 and z_1. At the pocket's edge r_1 is the film's and z_1 the rim's."""
SMOOTH = 0.25
"""Share of the pocket's radius within which films do not wave."""


def first_of(overtone: int) -> int:
    """Number of r_k; z_k and v_k follow."""
    return 3 * overtone - 1


class BlockPacking(NamedTuple):
    """Which entries of blocks go where in a band of that size."""

    from_: NDArray[np.int_]
    into: NDArray[np.int_]
    size: tuple[int, int]


@dataclass(frozen=True, eq=False)
class Waving:
    """A balloon whose rim has that many waves, and what follows from both alone.

    Of an element, places are taken as their change along it, over its length, and as the mean of
    its ends.
    """

    balloon: Balloon
    waves: int

    @cached_property
    def along(self) -> Array:
        """What changes say of r, aside and z, slice by slice: (3, slices, places)."""
        found = np.zeros((3, SLICES, PLACES))
        found[0, :, R] = found[2, :, Z] = 1.0
        for k, cos, sin in _overtones():
            at = first_of(k)
            found[0, :, at], found[2, :, at + 1], found[1, :, at + 2] = cos, cos, sin
        return found

    @cached_property
    def around(self) -> Array:
        """What means say of how r, aside and z change for a turn of 1 rad, and of z."""
        found = np.zeros((4, SLICES, PLACES))
        found[1, :, R] = found[3, :, Z] = 1.0
        for k, cos, sin in _overtones():
            at, n = first_of(k), k * self.waves
            found[0, :, at], found[0, :, at + 2] = -n * sin, -sin
            found[1, :, at], found[1, :, at + 2] = cos, n * cos
            found[2, :, at + 1], found[3, :, at + 1] = -n * sin, cos
        return found

    @cached_property
    def products(self) -> tuple[Array, ...]:
        """Two of ``along``, one of each, two of ``around``, and two of ``along`` in r and z, all of
        one slice: (two and slices, places x places).
        """
        a, b = self.along, self.around
        kink = a[[0, 2]]
        return tuple(
            np.einsum("ajm,bjn->abjmn", one, two).reshape(-1, PLACES**2)
            for one, two in ((a, a), (a, b), (b, b), (kink, kink))
        )

    @cached_property
    def kept(self) -> NDArray[np.bool_]:
        """Which places move on their own, (nodes, places)."""
        one = self.balloon
        number = np.arange(len(one.nodes))
        film = (number >= one.held) & (number < one.edge)
        found = np.zeros((len(number), PLACES), dtype=bool)
        found[:, R] = (number > 0) | (one.bore > 0)
        found[:, Z] = film
        waves = film & (number > one.held) & (one.nodes >= SMOOTH * one.pocket)
        found[:, 2:] = waves[:, None]
        # Half a wave further on and upside down the rim is what it is here.
        for k in range(2, OVERTONES + 1, 2):
            found[one.edge :, first_of(k)] = found[one.edge :, first_of(k) + 2] = True
        found[one.edge, [EDGE, UP]] = True
        return found

    @cached_property
    def freedoms(self) -> NDArray[np.int_]:
        return np.flatnonzero(self.kept.ravel())

    @cached_property
    def tail(self) -> Array:
        """What the last freedoms make of the places of the last film element's two nodes, and then
        of the rim's: (nodes x places, freedoms).
        """
        one, edge = self.balloon, self.balloon.edge
        free = self.kept[edge - 1 :]
        number = np.where(free, np.cumsum(free).reshape(free.shape) - 1, -1)
        rim = len(one.nodes) - edge
        found = np.zeros((2 + rim, PLACES, int(free.sum())))
        for node, of in enumerate([0, 1, *range(1, 1 + rim)]):
            places = np.flatnonzero(number[of] >= 0)
            if node >= 2:
                places = places[(places != EDGE) & (places != UP)]
            found[node, places, number[of, places]] = 1.0
        # The section tilts: by -2 / thickness for each mm that the film's end goes out.
        found[2:, UP, number[1, UP]] = 1.0
        found[2:, UP, number[1, EDGE]] = -2 * (one.nodes[edge:] - one.pocket) / one.thickness
        return found.reshape(-1, found.shape[-1])

    @cached_property
    def packing(self) -> BlockPacking:
        """Where entries of blocks go: of each node, with the next, and with the one after that."""
        nodes = len(self.kept)
        number = np.full(self.kept.size, -1)
        number[self.freedoms] = np.arange(len(self.freedoms))
        by_node = number.reshape(nodes, PLACES)
        from_, row, off, begin = [], [], [], 0
        for apart in range(3):
            first = np.repeat(by_node[: nodes - apart, :, None], PLACES, 2)
            second = np.repeat(by_node[apart:, None, :], PLACES, 1)
            good = (first >= 0) & (second >= first)
            from_.append(begin + np.flatnonzero(good))
            row.append(first[good])
            off.append((second - first)[good])
            begin += first.size
        width = max(int(each.max()) for each in off) + 1
        into = np.concatenate(row) * width + np.concatenate(off)
        return BlockPacking(np.concatenate(from_), into, (len(self.freedoms), width))

    @cached_property
    def plate(self) -> Array:
        """One film's share of the rim's bending and twisting (Kirchhoff): second derivatives by the
        change and by the mean of z_1 along each element, (elements, 2, 2).
        """
        one, n = self.balloon, self.waves
        length, middle = one.film.lengths, one.film.middles
        rigid = both_bend((one, one)) / (1 - one.poisson**2) / 4
        area = math.tau * middle * length * (np.arange(len(length)) >= one.edge)
        bent = np.stack([1 / middle, -((n / middle) ** 2)], -1)
        wrung = n * np.stack([1 / middle, -1 / middle**2], -1)
        by = _squares(bent) + 2 * (1 - one.poisson) * _squares(wrung)
        return np.asarray(rigid * area[:, None, None] * by)


def _squares(rows: Array) -> Array:
    return np.asarray(rows[:, :, None] * rows[:, None])


def _overtones() -> list[tuple[int, Array, Array]]:
    turn = (np.arange(SLICES) + 0.5) * math.pi / SLICES
    return [(k, np.cos(k * turn), np.sin(k * turn)) for k in range(1, OVERTONES + 1)]


class Parts(NamedTuple):
    """Of each element the change along it and the mean, (rows, elements, places), and an energy's
    derivatives by them, first and second.
    """

    change: Array
    mean: Array
    by_change: Array
    by_mean: Array
    changes: Array
    mixed: Array
    means: Array


class Sums:
    """An energy's derivatives node by node: ``by_node`` (rows, nodes, places), and second ones of
    each node, ``own``, with the ``next`` one and with the one ``after`` that.
    """

    def __init__(self, of: Waving, parts: Parts, kinks: Array) -> None:
        """``kinks`` (rows, elements - 1, places, places) join changes along neighbours."""
        self.of = of
        nodes, edge = len(of.balloon.nodes), of.balloon.edge
        one_over = 1 / of.balloon.film.lengths[:, None]
        by_change, by_mean = parts.by_change * one_over, parts.by_mean / 2
        changes = parts.changes * (one_over**2)[:, None]
        mixed, quarter = parts.mixed * one_over[:, None] / 2, parts.means / 4
        turned = mixed.swapaxes(2, 3)
        inner, outer = by_mean - by_change, by_mean + by_change
        first, second = changes - mixed - turned + quarter, changes + mixed + turned + quarter
        across = quarter - changes - mixed + turned
        kinks = kinks * (one_over[:-1] * one_over[1:])[:, None]
        count = len(by_mean)
        self.by_node = np.zeros((count, nodes, PLACES))
        self.by_node[:, :edge] += inner[:, :edge]
        self.by_node[:, 1 : edge + 1] += outer[:, :edge]
        self.own = np.zeros((count, nodes, PLACES, PLACES))
        self.own[:, :edge] += first[:, :edge]
        self.own[:, 1 : edge + 1] += second[:, :edge]
        self.next = np.zeros((count, nodes - 1, PLACES, PLACES))
        self.next[:, :edge] += across[:, :edge]
        self.after = np.zeros((count, nodes - 2, PLACES, PLACES))
        inside = kinks[:, : edge - 1]
        self.own[:, 1:edge] -= inside + inside.swapaxes(2, 3)
        self.next[:, 1:edge] += inside
        self.next[:, : edge - 1] += inside
        self.after[:, : edge - 1] -= inside
        self._rim(
            inner[:, edge:],
            outer[:, edge:],
            (first[:, edge:], second[:, edge:]),
            across[:, edge:],
            kinks[:, edge - 1],
        )

    def _rim(
        self, inner: Array, outer: Array, own: tuple[Array, Array], across: Array, kink: Array
    ) -> None:
        """The rim, and the kink between it and the film, by the last freedoms."""
        tail, rim = self.of.tail, inner.shape[1]
        by = np.zeros((len(inner), rim + 3, PLACES))
        by[:, 2:-1] += inner
        by[:, 3:] += outer
        whole = np.zeros((len(inner), rim + 3, PLACES, rim + 3, PLACES))
        for i in range(rim):
            a, b = 2 + i, 3 + i
            whole[:, a, :, a] += own[0][:, i]
            whole[:, b, :, b] += own[1][:, i]
            whole[:, a, :, b] += across[:, i]
            whole[:, b, :, a] += across[:, i].swapaxes(1, 2)
        for a, b, sign in ((0, 2, 1), (0, 3, -1), (1, 2, -1), (1, 3, 1)):
            whole[:, a, :, b] += sign * kink
            whole[:, b, :, a] += sign * kink.swapaxes(1, 2)
        size = len(tail)
        self.by_tail = by.reshape(-1, size) @ tail
        self.tails = tail.T @ whole.reshape(-1, size, size) @ tail

    def by_freedoms(self) -> tuple[Array, Array]:
        """First derivatives by coordinate (nodes x places, rows), 0 where none may move, and second
        ones as a band (freedoms, width, rows).
        """
        of, how = self.of, self.of.packing
        count = len(self.by_node)
        slopes = np.where(of.kept.ravel()[:, None], self.by_node.reshape(count, -1).T, 0.0)
        ends = len(self.by_tail[0])
        slopes[of.freedoms[-ends:]] += self.by_tail.T
        blocks = np.concatenate(
            [part.reshape(count, -1) for part in (self.own, self.next, self.after)], 1
        )
        size, width = how.size
        flat = np.zeros((size * width, count))
        flat[how.into] = blocks[:, how.from_].T
        band = flat.reshape(size, width, count)
        for k in range(min(ends, width)):
            number = np.arange(ends - k)
            band[size - ends + number, k] += self.tails[:, number, number + k].T
        return slopes, band
