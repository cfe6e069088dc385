"""A round balloon whose films wave in step with its rim: its kinematics, assembly and energy.

With n waves round the rim every node of a film, and of the rim, has a place

    r = r0 + sum r_k cos(k n turn),  z = z0 + sum z_k cos(k n turn),  aside = sum v_k sin(k n turn)

for the first few k. Films are membranes (Saint Venant and Kirchhoff's law) that bend along the
meridian slice by slice, as in ``film_elements``, and round the hoop wave by wave. The rim is
antisymmetric under a half-wave shift: the other film is the mirror image of this one, half a wave
on. So the rim goes up and down as a plate of both films whose section stays straight, its middle in
its plane. A film ends half a thickness off that middle: as the rim tilts, the film's end goes in or
out. One film and its share of the rim are computed. Lengths mm, pressures kPa, energies uJ, air ul.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sbafab.models import least_energy
from sbafab.models.balloon import Balloon, bonded_bending_stiffness
from sbafab.models.film_elements import (
    ROOT_LENGTH,
    Array,
    Elements,
    air_volume,
    assembled_gradient,
    assembled_tangent,
)
from sbafab.models.least_energy import Descent

OVERTONES = 5
"""Harmonics of a film in one ripple of the rim."""
SLICES = 2 * OVERTONES + 2
"""Slices of half a ripple: enough for products of four waves."""
PLACES = 2 + 3 * OVERTONES
"""Coordinates of a node: r0, z0, and r_k, z_k and v_k of each k."""
R, Z, EDGE, UP = 0, 1, 2, 3
"""Numbers of r0, z0, r_1 and z_1. At the pocket's edge r_1 is the film's and z_1 the rim's."""
SMOOTH = 0.25
"""Share of the pocket's radius within which films have no waves."""


def first_of(overtone: int) -> int:
    """Return the number of r_k; z_k and v_k follow."""
    return 3 * overtone - 1


@dataclass(frozen=True, eq=False)
class Waving:
    """Kinematics of a balloon with a number of waves round its rim.

    Coordinates of an element are their change along it, over its length, and the mean of its ends.
    """

    balloon: Balloon
    waves: int

    @cached_property
    def along(self) -> Array:
        """Rates of r, aside and z by the changes, in each slice: (3, slices, places)."""
        rows = np.zeros((3, SLICES, PLACES))
        rows[0, :, R] = rows[2, :, Z] = 1.0
        for k, cos, sin in _overtones():
            at = first_of(k)
            rows[0, :, at], rows[2, :, at + 1], rows[1, :, at + 2] = cos, cos, sin
        return rows

    @cached_property
    def around(self) -> Array:
        """Rates of r, aside and z for a turn of 1 rad, and z, by the means: (4, slices, places)."""
        rows = np.zeros((4, SLICES, PLACES))
        rows[1, :, R] = rows[3, :, Z] = 1.0
        for k, cos, sin in _overtones():
            at, n = first_of(k), k * self.waves
            rows[0, :, at], rows[0, :, at + 2] = -n * sin, -sin
            rows[1, :, at], rows[1, :, at + 2] = cos, n * cos
            rows[2, :, at + 1], rows[3, :, at + 1] = -n * sin, cos
        return rows

    @cached_property
    def products(self) -> tuple[Array, ...]:
        """Products of two of ``along``, one of each, two of ``around``, and two of ``along`` in r
        and z, all of one slice: (two and slices, places x places).
        """
        a, b = self.along, self.around
        kink = a[[0, 2]]
        return tuple(
            np.einsum("ajm,bjn->abjmn", first, second).reshape(-1, PLACES**2)
            for first, second in ((a, a), (a, b), (b, b), (kink, kink))
        )

    @cached_property
    def is_free(self) -> NDArray[np.bool_]:
        """True for the places that are degrees of freedom, (nodes, places)."""
        balloon = self.balloon
        number = np.arange(len(balloon.nodes))
        film = (number >= balloon.neck_edge) & (number < balloon.edge)
        mask = np.zeros((len(number), PLACES), dtype=bool)
        mask[:, R] = (number > 0) | (balloon.bore > 0)
        mask[:, Z] = film
        waves = film & (number > balloon.neck_edge) & (balloon.nodes >= SMOOTH * balloon.pocket)
        mask[:, 2:] = waves[:, None]
        # The rim is antisymmetric under a half-wave shift: only even harmonics lie in its plane.
        for k in range(2, OVERTONES + 1, 2):
            mask[balloon.edge :, first_of(k)] = mask[balloon.edge :, first_of(k) + 2] = True
        mask[balloon.edge, [EDGE, UP]] = True
        return mask

    @cached_property
    def freedoms(self) -> NDArray[np.int_]:
        return np.flatnonzero(self.is_free.ravel())

    @cached_property
    def ends(self) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
        """Numbers of each element's ends in the chain of the film's nodes, then the rim's: at the
        pocket's edge each has one of its own.
        """
        elements = np.arange(len(self.balloon.nodes) - 1)
        first = elements + (elements >= self.balloon.edge)
        return first, first + 1

    @cached_property
    def motion(self) -> Array:
        """Places of the chain's nodes by the freedoms: (nodes x places, freedoms)."""
        balloon, edge = self.balloon, self.balloon.edge
        number = np.where(self.is_free, np.cumsum(self.is_free).reshape(self.is_free.shape) - 1, -1)
        node_of = np.concatenate([np.arange(edge + 1), np.arange(edge, len(balloon.nodes))])
        motion = np.zeros((len(node_of), PLACES, len(self.freedoms)))
        node, place = np.nonzero(self.is_free[node_of])
        motion[node, place, number[node_of[node], place]] = 1.0
        # The neck stays level.
        motion[: balloon.neck_edge, Z, number[balloon.neck_edge, Z]] = 1.0
        # The section tilts: by -2 / thickness for each mm that the film's end goes out.
        tilt = -2 * (balloon.nodes[edge:] - balloon.pocket) / balloon.thickness
        rim = motion[edge + 1 :]
        rim[:, [EDGE, UP]] = 0.0
        rim[:, UP, number[edge, UP]], rim[:, UP, number[edge, EDGE]] = 1.0, tilt
        return motion.reshape(-1, motion.shape[-1])

    @cached_property
    def packing(self) -> least_energy.Packing:
        """Index map to the band of freedoms, from blocks of places: of each node; of each element's
        ends; and of those of each two neighbours up to the rim's first element, first with first,
        first with second, second with first, second with second.
        """
        first, second = self.ends
        nodes, before, behind = np.arange(len(self.motion) // PLACES), first[:-1], first[1:]
        edge = self.balloon.edge
        pairs = [(nodes, nodes), (first, second)]
        pairs += [((before + a)[:edge], (behind + b)[:edge]) for a in (0, 1) for b in (0, 1)]
        rows, columns = (PLACES * np.concatenate(each) for each in zip(*pairs, strict=True))
        place = np.arange(PLACES)
        i = np.broadcast_to(rows[:, None, None] + place[:, None], (len(rows), PLACES, PLACES))
        j = np.broadcast_to(columns[:, None, None] + place, i.shape)
        is_diagonal = (np.arange(len(rows)) < len(nodes))[:, None, None]
        good = np.flatnonzero(~is_diagonal | (i <= j))
        is_pair = ~(is_diagonal & (i == j)).ravel()[good]
        i, j = i.ravel()[good], j.ravel()[good]
        return least_energy.packing(self.motion[None], good, np.zeros_like(i), i, j, is_pair)

    @cached_property
    def plate(self) -> Array:
        """One film's share of the rim's bending and twisting stiffness (Kirchhoff): second
        derivatives by the change and by the mean of z_1 along each element, (elements, 2, 2).
        """
        balloon, n = self.balloon, self.waves
        length, middle = balloon.film.lengths, balloon.film.middles
        rigid = bonded_bending_stiffness((balloon, balloon)) / (1 - balloon.poisson**2) / 4
        area = math.tau * middle * length * (np.arange(len(length)) >= balloon.edge)
        bent = np.stack([1 / middle, -((n / middle) ** 2)], -1)
        wrung = n * np.stack([1 / middle, -1 / middle**2], -1)
        by = _squares(bent) + 2 * (1 - balloon.poisson) * _squares(wrung)
        return np.asarray(rigid * area[:, None, None] * by)


def _squares(rows: Array) -> Array:
    return np.asarray(rows[:, :, None] * rows[:, None])


def _overtones() -> list[tuple[int, Array, Array]]:
    turn = (np.arange(SLICES) + 0.5) * math.pi / SLICES
    return [(k, np.cos(k * turn), np.sin(k * turn)) for k in range(1, OVERTONES + 1)]


class Parts(NamedTuple):
    """Changes and means of each element, (rows, elements, places), and an energy's derivatives by
    them, first and second.
    """

    change: Array
    mean: Array
    by_change: Array
    by_mean: Array
    changes: Array
    mixed: Array
    means: Array


class Sums(NamedTuple):
    """An energy's derivatives by the places of nodes in the chain: ``by_node`` (rows, nodes,
    places), and second ones of each node, ``diagonal``, across each element, and of neighbours by
    their changes, over their lengths (``kinks``).
    """

    by_node: Array
    diagonal: Array
    across: Array
    kinks: Array

    @classmethod
    def of(cls, of: Waving, parts: Parts, kinks: Array) -> Sums:
        """Assemble parts; ``kinks`` (rows, elements - 1, places, places) couple neighbours."""
        (first, second), edge = of.ends, of.balloon.edge
        one_over = 1 / of.balloon.film.lengths[:, None]
        by_change, by_mean = parts.by_change * one_over, parts.by_mean / 2
        changes = parts.changes * (one_over**2)[:, None]
        mixed, quarter = parts.mixed * one_over[:, None] / 2, parts.means / 4
        turned, count = mixed.swapaxes(2, 3), second[-1] + 1
        by_node = np.zeros((len(by_mean), count, PLACES))
        by_node[:, first] += by_mean - by_change
        by_node[:, second] += by_mean + by_change
        diagonal = np.zeros((len(by_mean), count, PLACES, PLACES))
        diagonal[:, first] += changes - mixed - turned + quarter
        diagonal[:, second] += changes + mixed + turned + quarter
        between = kinks[:, :edge] * (one_over[:edge] * one_over[1 : edge + 1])[:, None]
        return cls(by_node, diagonal, quarter - changes - mixed + turned, between)

    def by_freedoms(self, of: Waving) -> tuple[Array, Array]:
        """Return the gradient by coordinate (nodes x places, rows), 0 for fixed ones, and the
        tangent stiffness as a band (freedoms, width, rows).
        """
        count = len(self.by_node)
        slopes = np.zeros((of.is_free.size, count))
        slopes[of.freedoms] = of.motion.T @ self.by_node.reshape(count, -1).T
        blocks = [self.diagonal, self.across, self.kinks, -self.kinks, -self.kinks, self.kinks]
        entries = np.concatenate([part.reshape(count, -1) for part in blocks], axis=1)
        return slopes, of.packing.band(entries.T)


# The energy of one film and its share of the rim.


RESIDUAL = 1e-6
"""Residual force, as a share of pressure times pocket area, that counts as equilibrium."""
DAMPINGS = (0.001, 0.01, 0.1, 1.0)
"""Shares of the diagonal added in turn if the tangent stiffness is indefinite."""


class Slices(NamedTuple):
    """Rates of elements in each slice: along the meridian (rows, elements, 3, slices), and round
    the hoop (.., 4, ..), where the last is z; and an energy's first and second derivatives by
    them.
    """

    along: Array
    around: Array
    by_along: Array
    by_around: Array
    alongs: Array
    mixed: Array
    arounds: Array


class WaveTotal(NamedTuple):
    """Energy less the air's work of one film and its share of the rim, (rows,); its gradient by
    coordinate (coordinates, rows), and the tangent stiffness as a band of freedoms. Energy stored
    in the films, uJ; the air on the film's side of the middle plane, ul.
    """

    energy: Array
    gradient: Array
    band: Array
    stored: Array
    volume: Array


class Waves:
    """Energies of waving films, as a ``least_energy.Potential``: coordinates (nodes x places,
    rows).

    ``normals`` (rows, elements, 3) are the mean meridian's normals in r and z, and its stretch;
    they point out of the film, in the direction in which it bends round the hoop.
    """

    def __init__(self, of: Waving, pressure: Array, normals: Array) -> None:
        self.of, self.pressure, self.normals = of, pressure, normals
        balloon = of.balloon
        self.scale = pressure * balloon.pocket**3
        self.close = RESIDUAL * pressure * math.pi * balloon.pocket**2

    def at(self, x: Array, rows: NDArray[np.int_]) -> Descent:
        state = self.total(x, rows)
        return Descent(state.energy, state.gradient, state.band)

    def newton_step(self, state: Descent, damping: Array) -> Array:
        band = state.matrix.copy()
        band[:, 0] += damping * np.abs(band[:, 0])
        freedoms = self.of.freedoms
        step = np.zeros_like(state.gradient)
        step[freedoms] = _newton_steps(band, -state.gradient[freedoms])
        return step

    def change(self, x: Array, ahead: Array) -> Array:
        """Return the largest relative change of an element of the mean meridian: (rows,)."""
        length, by = (
            np.hypot(np.diff(y[R::PLACES], axis=0), np.diff(y[Z::PLACES], axis=0))
            for y in (x, ahead)
        )
        neck_edge = self.of.balloon.neck_edge
        return np.asarray((by[neck_edge:] / length[neck_edge:]).max(0))

    def total(self, x: Array, rows: NDArray[np.int_]) -> WaveTotal:
        """Return the energy at coordinates ``x`` of these rows."""
        of, balloon = self.of, self.of.balloon
        p, edge = self.pressure[rows], balloon.edge
        places = (of.motion @ x[of.freedoms]).T.reshape(len(p), -1, PLACES)
        inner, outer = (places[:, end] for end in of.ends)
        change, mean = (outer - inner) / balloon.film.lengths[:, None], (outer + inner) / 2
        slices = self._slices(change, mean)
        stored = self._stretched(slices)
        kinks, bent = self._bent(slices)
        volume = self._air(slices, p)
        parts = self._parts(slices, change, mean)
        stored = stored + bent + self._waves_bend(parts, rows) + self._plate_bends(parts)
        sums = Sums.of(of, parts, self._joined(kinks))
        volume = volume + self._inner_face(sums, places, p) + self._lid(sums, places, p)
        # The film's end, and with it the whole film, comes down as the rim tilts.
        down = p * math.pi * balloon.pocket**2 / (2 * balloon.thickness)
        end = x[PLACES * edge + EDGE]
        sums.by_node[:, edge, EDGE] += 2 * down * end
        sums.diagonal[:, edge, EDGE, EDGE] += 2 * down
        energy = stored - p * volume + down * end**2
        return WaveTotal(energy, *sums.by_freedoms(of), stored, volume)

    def _slices(self, change: Array, mean: Array) -> Slices:
        """Return the rates in each slice, with all derivatives 0."""
        of = self.of
        size = change.shape[:2]
        along = (change @ of.along.reshape(-1, PLACES).T).reshape(*size, 3, SLICES)
        around = (mean @ of.around.reshape(-1, PLACES).T).reshape(*size, 4, SLICES)
        around[:, :, :3] /= of.balloon.film.middles[:, None, None]
        blank = [np.zeros((*size, *many, SLICES)) for many in ((3,), (4,), (3, 3), (3, 4), (4, 4))]
        return Slices(along, around, *blank)

    def _stretched(self, at: Slices) -> Array:
        """Add stretching and shearing, and return its energy: (rows,)."""
        balloon = self.of.balloon
        flat, nu = balloon.film, balloon.poisson
        size = (math.tau * flat.middles * flat.lengths * balloon.thickness / SLICES)[:, None]
        plane = balloon.modulus / (1 - nu**2) * size
        c12, c33 = plane * nu, balloon.modulus / (2 * (1 + nu)) * size
        f, g = at.along, at.around[:, :, :3]
        e1, e2, e12 = ((f * f).sum(2) - 1) / 2, ((g * g).sum(2) - 1) / 2, (f * g).sum(2)
        s1, s2, s12 = plane * e1 + c12 * e2, plane * e2 + c12 * e1, c33 * e12
        at.by_along[:] += s1[:, :, None] * f + s12[:, :, None] * g
        at.by_around[:, :, :3] += s2[:, :, None] * g + s12[:, :, None] * f
        for a in range(3):
            plane_f, plane_g = plane * f[:, :, a], plane * g[:, :, a]
            shear_f, shear_g = c33 * f[:, :, a], c33 * g[:, :, a]
            cross_f = c12 * f[:, :, a]
            for b in range(3):
                fb, gb = f[:, :, b], g[:, :, b]
                at.alongs[:, :, a, b] = plane_f * fb + shear_g * gb
                at.arounds[:, :, a, b] = plane_g * gb + shear_f * fb
                at.mixed[:, :, a, b] = cross_f * gb + shear_g * fb
            at.alongs[:, :, a, a] += s1
            at.arounds[:, :, a, a] += s2
            at.mixed[:, :, a, a] += s12
        return np.asarray((s1 * e1 + s2 * e2 + s12 * e12).sum((1, 2)) / 2)

    def _air(self, at: Slices, p: Array) -> Array:
        """Add the air between the film's middle and the middle plane; return its ul: (rows,)."""
        balloon = self.of.balloon
        number = np.arange(len(balloon.film.lengths))
        size = math.tau / SLICES * balloon.film.middles * balloon.film.lengths
        part = (size * ((number >= balloon.neck_edge) & (number < balloon.edge)))[:, None]
        r, aside = at.along[:, :, 0], at.along[:, :, 1]
        turned, out, high = (at.around[:, :, k] for k in (0, 1, 3))
        flat = r * out - aside * turned
        press = -p[:, None, None] * part
        lifted = press * high
        at.by_along[:, :, 0] += lifted * out
        at.by_along[:, :, 1] -= lifted * turned
        at.by_around[:, :, 0] -= lifted * aside
        at.by_around[:, :, 1] += lifted * r
        at.by_around[:, :, 3] += press * flat
        at.mixed[:, :, 0, 1] += lifted
        at.mixed[:, :, 1, 0] -= lifted
        at.mixed[:, :, 0, 3] += press * out
        at.mixed[:, :, 1, 3] -= press * turned
        for k, by in ((0, -press * aside), (1, press * r)):
            at.arounds[:, :, k, 3] += by
            at.arounds[:, :, 3, k] += by
        return np.asarray((part * high * flat).sum((1, 2)))

    def _bent(self, at: Slices) -> tuple[Array, Array]:
        """Add bending along the meridian, as in ``film_elements.bending``, in each slice.

        Returns the coupling of neighbours, by the changes in r and z along each: (rows, elements -
        1, 2, 2, slices); and the energy, (rows,).
        """
        balloon = self.of.balloon
        flat, neck_edge, edge = balloon.film, balloon.neck_edge, balloon.edge
        length = flat.lengths[:, None]
        dr, dz = at.along[:, :, 0] * length, at.along[:, :, 2] * length
        square = dr * dr + dz * dz
        slope = np.arctan2(-dz, dr)
        kink = slope[:, 1 : edge + 1] - slope[:, :edge]
        number = np.arange(len(flat.lengths))
        free = (number >= neck_edge) & (number < edge)
        bends = np.where(free, flat.lengths, 2 * ROOT_LENGTH * flat.thickness)
        rigid = math.tau * balloon.bending_stiffness / SLICES
        stiff = (2 * rigid * flat.nodes[1 : edge + 1] / (bends[:edge] + bends[1 : edge + 1]))[
            :, None
        ]
        ring = (rigid * flat.lengths / flat.middles * (number < edge))[:, None]
        moment = stiff * kink
        # Of the slope: by the changes along the element, over its length.
        a, b = dz / square, -dr / square
        energy = ((moment * kink).sum((1, 2)) + (ring * a * dz).sum((1, 2))) / 2
        turn = ring * b * dz
        turn[:, 1 : edge + 1] += moment
        turn[:, :edge] -= moment
        stiffness = -ring * (a * dz + b * dr)
        stiffness[:, 1 : edge + 1] += stiff
        stiffness[:, :edge] += stiff
        twice, skew = 2 * turn * a * b, turn * (b * b - a * a)
        a, b, twice, skew = a * length, b * length, twice * length**2, skew * length**2
        at.by_along[:, :, 0] += turn * a
        at.by_along[:, :, 2] += turn * b
        at.alongs[:, :, 0, 0] += stiffness * a * a + twice
        at.alongs[:, :, 2, 2] += stiffness * b * b - twice
        both = stiffness * a * b + skew
        at.alongs[:, :, 0, 2] += both
        at.alongs[:, :, 2, 0] += both
        joined = np.zeros((*at.along[:, 1:].shape[:2], 2, 2, SLICES))
        for i, before in enumerate((a, b)):
            for j, behind in enumerate((a, b)):
                joined[:, :edge, i, j] = -stiff * before[:, :edge] * behind[:, 1 : edge + 1]
        return joined, energy

    def _parts(self, at: Slices, change: Array, mean: Array) -> Parts:
        """Return the derivatives by changes and means, summed over the slices."""
        of = self.of
        size = change.shape[:2]
        # Round the hoop, slices were divided by the radius.
        over = np.ones((len(of.balloon.film.middles), 4))
        over[:, :3] /= of.balloon.film.middles[:, None]
        over = over[:, :, None]
        at.by_around[:] *= over
        at.mixed[:] *= over[:, None]
        at.arounds[:] *= over[:, None] * over[:, :, None]
        first = at.by_along.reshape(*size, -1) @ of.along.reshape(-1, PLACES)
        second = at.by_around.reshape(*size, -1) @ of.around.reshape(-1, PLACES)
        blocks = (
            (by.reshape(*size, -1) @ pair).reshape(*size, PLACES, PLACES)
            for by, pair in zip((at.alongs, at.mixed, at.arounds), of.products, strict=False)
        )
        return Parts(change, mean, first, second, *blocks)

    def _joined(self, kinks: Array) -> Array:
        """Return the coupling of neighbours' changes: (rows, elements - 1, places, places)."""
        size = kinks.shape[:2]
        blocks = kinks.reshape(*size, -1) @ self.of.products[3]
        return np.asarray(blocks.reshape(*size, PLACES, PLACES))

    def _waves_bend(self, parts: Parts, rows: NDArray[np.int_]) -> Array:
        """Add the bending of films round the hoop, wave by wave, and return its energy: (rows,)."""
        balloon = self.of.balloon
        length, middle = balloon.film.lengths, balloon.film.middles
        normal, stretch = self.normals[rows, :, :2], self.normals[rows, :, 2]
        number = np.arange(len(length))
        film = (number >= balloon.neck_edge) & (number < balloon.edge)
        area = math.tau * middle * length * balloon.bending_stiffness / 2 * film
        energy = np.zeros(len(rows))
        for k in range(1, OVERTONES + 1):
            pair = slice(first_of(k), first_of(k) + 2)
            turn = (k * self.of.waves / middle) ** 2
            for value, by, curve, weight in (
                (parts.mean, parts.by_mean, parts.means, area * turn**2),
                (parts.change, parts.by_change, parts.changes, 2 * area * turn / stretch**2),
            ):
                off = (normal * value[:, :, pair]).sum(2)
                energy += (weight * off**2).sum(1) / 2
                by[:, :, pair] += (weight * off)[:, :, None] * normal
                each = np.broadcast_to(weight, off.shape)[:, :, None, None]
                curve[:, :, pair, pair] += each * normal[:, :, :, None] * normal[:, :, None]
        return energy

    def _plate_bends(self, parts: Parts) -> Array:
        """Add the bending of the rim, as thick as both films, and return its energy: (rows,)."""
        plate = self.of.plate
        rise, up = parts.change[:, :, UP], parts.mean[:, :, UP]
        by_rise = plate[:, 0, 0] * rise + plate[:, 0, 1] * up
        by_up = plate[:, 1, 0] * rise + plate[:, 1, 1] * up
        parts.by_change[:, :, UP] += by_rise
        parts.by_mean[:, :, UP] += by_up
        parts.changes[:, :, UP, UP] += plate[:, 0, 0]
        parts.mixed[:, :, UP, UP] += plate[:, 0, 1]
        parts.means[:, :, UP, UP] += plate[:, 1, 1]
        return np.asarray((by_rise * rise + by_up * up).sum(1) / 2)

    def _inner_face(self, sums: Sums, places: Array, p: Array) -> Array:
        """Add the volume between the film's middle and its inner face; return it in ul."""
        balloon = self.of.balloon
        film = slice(balloon.edge + 1)
        lie = Elements.of(places[:, film, R].T, places[:, film, Z].T)
        thick, thin = (
            air_volume(replace(balloon.film, thickness=by), balloon.edge, lie)
            for by in (balloon.thickness, 0.0)
        )
        slopes = [a - b for a, b in zip(thick.slopes, thin.slopes, strict=True)]
        curves = [a - b for a, b in zip(thick.curves, thin.curves, strict=True)]
        none = np.zeros((balloon.edge - 1, len(p)))
        size = (len(p), balloon.edge + 1, 2)
        sums.by_node[:, film, :2] -= p[:, None, None] * assembled_gradient(slopes).T.reshape(size)
        band = -p[:, None, None] * assembled_tangent(curves, [none] * 4).transpose(2, 0, 1)
        r, z = band[:, 0::2], band[:, 1::2]
        for i, j, by in ((R, R, r[:, :, 0]), (Z, Z, z[:, :, 0]), (R, Z, r[:, :, 1])):
            sums.diagonal[:, film, i, j] += by
        for i, j, by in (
            (R, R, r[:, :, 2]),
            (R, Z, r[:, :, 3]),
            (Z, R, z[:, :, 1]),
            (Z, Z, z[:, :, 2]),
        ):
            sums.across[:, : balloon.edge, i, j] += by[:, :-1]
        return thick.energy - thin.energy

    def _lid(self, sums: Sums, places: Array, p: Array) -> Array:
        """Add the air under the neck and the bore in it, and return it in ul."""
        neck_edge = self.of.balloon.neck_edge
        r, z = places[:, neck_edge, R], places[:, neck_edge, Z]
        press = -math.pi * p
        sums.by_node[:, neck_edge, R] += 2 * press * r * z
        sums.by_node[:, neck_edge, Z] += press * r**2
        sums.diagonal[:, neck_edge, R, R] += 2 * press * z
        sums.diagonal[:, neck_edge, R, Z] += 2 * press * r
        return np.asarray(math.pi * r**2 * z)


def _newton_steps(band: Array, right_side: Array) -> Array:
    """Return Newton's steps, with a larger diagonal if the tangent stiffness is indefinite."""
    step = least_energy.solve_positive(band, right_side)
    if step is not None:
        return step
    rows = band.shape[-1]
    if rows > 1:
        # Increase the diagonal only where needed.
        halves = slice(None, rows // 2), slice(rows // 2, None)
        return np.concatenate(
            [_newton_steps(band[..., half], right_side[..., half]) for half in halves], -1
        )
    diagonal = np.abs(band[:, 0])
    for more in DAMPINGS:
        band = band.copy()
        band[:, 0] += more * diagonal
        step = least_energy.solve_positive(band, right_side)
        if step is not None:
            return step
    return least_energy.solve(band, right_side)
