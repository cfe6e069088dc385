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
from sbafab.models.balloon import Balloon, bonded_bending_stiffness, relative_change
from sbafab.models.film_elements import ROOT_LENGTH, Array, Elements, air_volume
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
RESIDUAL = 1e-6
"""Residual force, as a share of pressure times pocket area, that counts as equilibrium."""
DAMPINGS = (0.001, 0.01, 0.1, 1.0)
"""Shares of the diagonal added in turn if the tangent stiffness is indefinite."""
SIDEWAYS = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
"""The area of two rates f and g, seen from above: f @ SIDEWAYS @ g."""


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
    def rates(self) -> tuple[Array, Array]:
        """Rates in each slice: of r, aside and z by an element's changes, (3, slices, places); and
        by its means, of these for a turn of 1 rad, and z: (4, slices, places).
        """
        along, around = np.zeros((3, SLICES, PLACES)), np.zeros((4, SLICES, PLACES))
        along[0, :, R] = along[2, :, Z] = around[1, :, R] = around[3, :, Z] = 1.0
        turn = (np.arange(SLICES) + 0.5) * math.pi / SLICES
        for k in range(1, OVERTONES + 1):
            at, n, cos, sin = first_of(k), k * self.waves, np.cos(k * turn), np.sin(k * turn)
            along[0, :, at], along[1, :, at + 2], along[2, :, at + 1] = cos, sin, cos
            around[0, :, at], around[0, :, at + 2] = -n * sin, -sin
            around[1, :, at], around[1, :, at + 2] = cos, n * cos
            around[2, :, at + 1], around[3, :, at + 1] = -n * sin, cos
        return along, around

    @cached_property
    def products(self) -> tuple[Array, Array, Array, Array]:
        """Products of two rates of one slice: along twice, one of each, around twice, and along in
        r and z twice: (two rates and slices, places x places).
        """
        a, b = self.rates
        aa, ab, bb, kinks = (
            np.einsum("ajm,bjn->abjmn", first, second).reshape(-1, PLACES**2)
            for first, second in ((a, a), (a, b), (b, b), (a[[0, 2]], a[[0, 2]]))
        )
        return aa, ab, bb, kinks

    @cached_property
    def is_film(self) -> NDArray[np.bool_]:
        """True for the elements that bound air: (elements, 1)."""
        number = np.arange(len(self.balloon.nodes) - 1)[:, None]
        return (number >= self.balloon.neck_edge) & (number < self.balloon.edge)

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
    def first(self) -> NDArray[np.int_]:
        """Number of each element's first end in the chain of the film's nodes, then the rim's: at
        the pocket's edge each has one of its own. The second end is the next one.
        """
        elements = np.arange(len(self.balloon.nodes) - 1)
        return elements + (elements >= self.balloon.edge)

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
        first, edge = self.first, self.balloon.edge
        nodes, before, behind = np.arange(first[-1] + 2), first[:edge], first[1 : edge + 1]
        pairs = [(nodes, nodes), (first, first + 1)]
        pairs += [(before + a, behind + b) for a in (0, 1) for b in (0, 1)]
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
        by = [row[:, :, None] * row[:, None] for row in (bent, wrung)]
        return np.asarray(rigid * area[:, None, None] * (by[0] + 2 * (1 - balloon.poisson) * by[1]))


class Slices(NamedTuple):
    """Rates of elements in each slice, ``f`` along the meridian, (rows, elements, 3, slices), and
    ``g`` round the hoop, (.., 4, ..); and an energy's first and second derivatives by them.
    """

    f: Array
    g: Array
    by_f: Array
    by_g: Array
    ff: Array
    fg: Array
    gg: Array


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


class Waves:
    """Energies of waving films, as a ``least_energy.Potential``: coordinates (nodes x places,
    rows). Round the hoop films bend in the direction that is normal to the mean meridian at
    ``start``.
    """

    def __init__(self, of: Waving, pressure: Array, start: Array) -> None:
        self.of, self.pressure = of, pressure
        balloon = of.balloon
        self.scale = pressure * balloon.pocket**3
        self.close = RESIDUAL * pressure * math.pi * balloon.pocket**2
        r, z = start[R::PLACES].T, start[Z::PLACES].T.copy()
        z[:, : balloon.neck_edge] = z[:, balloon.neck_edge, None]
        dr, dz = np.diff(r), np.diff(z)
        length = np.hypot(dr, dz)
        self.normal = np.stack([-dz / length, dr / length], -1)
        self.stretch = length / balloon.film.lengths

    def at(self, x: Array, rows: NDArray[np.int_]) -> Descent:
        return self.total(x, rows)[0]

    def newton_step(self, state: Descent, damping: Array) -> Array:
        band = state.matrix.copy()
        band[:, 0] += damping * np.abs(band[:, 0])
        freedoms = self.of.freedoms
        step = np.zeros_like(state.gradient)
        step[freedoms] = _newton_steps(band, -state.gradient[freedoms])
        return step

    def change(self, x: Array, ahead: Array) -> Array:
        """Return the largest relative change of an element of the mean meridian: (rows,)."""
        first, rows = self.of.balloon.neck_edge, x.shape[1]
        mean = (y.reshape(-1, PLACES, rows)[first:, :2].reshape(-1, rows) for y in (x, ahead))
        return relative_change(*mean)

    def total(self, x: Array, rows: NDArray[np.int_]) -> tuple[Descent, Array, Array]:
        """Return the energies of these rows at coordinates ``x``, those of one film and its share
        of the rim, less the air's work; the energy stored in the films, uJ; and the air on the
        film's side of the middle plane, ul.
        """
        of, balloon = self.of, self.of.balloon
        p, edge, neck_edge = self.pressure[rows], balloon.edge, balloon.neck_edge
        places = (of.motion @ x[of.freedoms]).T.reshape(len(p), -1, PLACES)
        inner, outer = places[:, of.first], places[:, of.first + 1]
        change, mean = (outer - inner) / balloon.film.lengths[:, None], (outer + inner) / 2
        slices = self._slices(change, mean)
        stored = self._stretched(slices)
        joined, bent = self._bent(slices)
        volume = self._air(slices, p)
        parts = self._parts(slices, change, mean)
        stored = stored + bent + self._waves_bend(parts, rows) + self._plate_bends(parts)
        volume = volume + self._inner_face(parts, places, p)
        by_node, diagonal, across = self._by_nodes(parts)
        # The air under the neck and the bore in it.
        r, z, press = places[:, neck_edge, R], places[:, neck_edge, Z], -math.pi * p
        by_node[:, neck_edge, R] += 2 * press * r * z
        by_node[:, neck_edge, Z] += press * r**2
        diagonal[:, neck_edge, R, R] += 2 * press * z
        diagonal[:, neck_edge, R, Z] += 2 * press * r
        volume = volume + math.pi * r**2 * z
        # The film's end, and with it the whole film, comes down as the rim tilts.
        down, end = -press * balloon.pocket**2 / (2 * balloon.thickness), places[:, edge, EDGE]
        by_node[:, edge, EDGE] += 2 * down * end
        diagonal[:, edge, EDGE, EDGE] += 2 * down
        slopes = np.zeros((of.is_free.size, len(p)))
        slopes[of.freedoms] = of.motion.T @ by_node.reshape(len(p), -1).T
        blocks = [diagonal, across, joined, -joined, -joined, joined]
        entries = np.concatenate([part.reshape(len(p), -1) for part in blocks], axis=1)
        energy = stored - p * volume + down * end**2
        return Descent(energy, slopes, of.packing.band(entries.T)), stored, volume

    def _slices(self, change: Array, mean: Array) -> Slices:
        """Return the rates in each slice, with all derivatives 0."""
        size = change.shape[:2]
        f, g = (
            (part @ rates.reshape(-1, PLACES).T).reshape(*size, -1, SLICES)
            for part, rates in zip((change, mean), self.of.rates, strict=True)
        )
        g[:, :, :3] /= self.of.balloon.film.middles[:, None, None]
        blank = [np.zeros((*size, *many, SLICES)) for many in ((3,), (4,), (3, 3), (3, 4), (4, 4))]
        return Slices(f, g, *blank)

    def _stretched(self, at: Slices) -> Array:
        """Add stretching and shearing, and return its energy: (rows,)."""
        balloon = self.of.balloon
        flat, nu = balloon.film, balloon.poisson
        size = (math.tau * flat.middles * flat.lengths * balloon.thickness / SLICES)[:, None]
        plane = balloon.modulus / (1 - nu**2) * size
        c12, c33 = plane * nu, balloon.modulus / (2 * (1 + nu)) * size
        f, g, whole = at.f, at.g[:, :, :3], np.eye(3)[:, :, None]
        e1, e2, e12 = ((f * f).sum(2) - 1) / 2, ((g * g).sum(2) - 1) / 2, (f * g).sum(2)
        s1, s2, s12 = plane * e1 + c12 * e2, plane * e2 + c12 * e1, c33 * e12
        at.by_f[:] += s1[:, :, None] * f + s12[:, :, None] * g
        at.by_g[:, :, :3] += s2[:, :, None] * g + s12[:, :, None] * f
        ff, gg, fg = _pairs(f, f), _pairs(g, g), _pairs(f, g)
        wide, cross, shear = (each[:, None, None] for each in (plane, c12, c33))
        at.ff[:] += wide * ff + shear * gg + s1[:, :, None, None] * whole
        at.gg[:, :, :3, :3] += wide * gg + shear * ff + s2[:, :, None, None] * whole
        turned = fg.swapaxes(2, 3)
        at.fg[:, :, :, :3] += cross * fg + shear * turned + s12[:, :, None, None] * whole
        return np.asarray((s1 * e1 + s2 * e2 + s12 * e12).sum((1, 2)) / 2)

    def _air(self, at: Slices, p: Array) -> Array:
        """Add the air between the film's middle and the middle plane; return its ul: (rows,)."""
        flat, high = self.of.balloon.film, at.g[:, :, 3]
        part = (math.tau / SLICES * flat.middles * flat.lengths)[:, None] * self.of.is_film
        # Seen from above, an element's area by its rates along and round.
        by_f, by_g = SIDEWAYS @ at.g[:, :, :3], SIDEWAYS.T @ at.f
        area = (at.f * by_f).sum(2)
        press = (-p[:, None, None] * part)[:, :, None]
        lifted = press * high[:, :, None]
        at.by_f[:] += lifted * by_f
        at.by_g[:, :, :3] += lifted * by_g
        at.by_g[:, :, 3] += press[:, :, 0] * area
        at.fg[:, :, :, :3] += SIDEWAYS[:, :, None] * lifted[:, :, None]
        at.fg[:, :, :, 3] += press * by_f
        at.gg[:, :, :3, 3] += press * by_g
        at.gg[:, :, 3, :3] += press * by_g
        return np.asarray((part * high * area).sum((1, 2)))

    def _bent(self, at: Slices) -> tuple[Array, Array]:
        """Add bending along the meridian, as in ``film_elements.bending``, in each slice.

        Returns the coupling of neighbours up to the rim's first element by the changes along each,
        over their lengths: (rows, elements, places, places); and the energy, (rows,).
        """
        of, balloon = self.of, self.of.balloon
        flat, edge = balloon.film, balloon.edge
        length = flat.lengths[:, None]
        dr, dz = at.f[:, :, 0] * length, at.f[:, :, 2] * length
        square = dr * dr + dz * dz
        slope = np.arctan2(-dz, dr)
        kink = slope[:, 1 : edge + 1] - slope[:, :edge]
        bends = np.where(of.is_film, length, 2 * ROOT_LENGTH * flat.thickness)
        rigid = math.tau * balloon.bending_stiffness / SLICES
        between = bends[:edge] + bends[1 : edge + 1]
        stiff = 2 * rigid * flat.nodes[1 : edge + 1, None] / between
        ring = rigid * length / flat.middles[:, None]
        ring[edge:] = 0.0
        moment = stiff * kink
        # Of the slope: by the changes along the element.
        a, b = dz / square, -dr / square
        energy = ((moment * kink).sum((1, 2)) + (ring * a * dz).sum((1, 2))) / 2
        turn = ring * b * dz
        turn[:, 1 : edge + 1] += moment
        turn[:, :edge] -= moment
        stiffness = -ring * (a * dz + b * dr)
        stiffness[:, 1 : edge + 1] += stiff
        stiffness[:, :edge] += stiff
        twice, skew = 2 * a * b, b * b - a * a
        curl = np.stack([twice, skew, skew, -twice], 2).reshape(*a.shape[:2], 2, 2, SLICES)
        rates = np.stack([a, b], 2)
        at.by_f[:, :, ::2] += (turn * length)[:, :, None] * rates
        curves = stiffness[:, :, None, None] * _pairs(rates, rates) + turn[:, :, None, None] * curl
        at.ff[:, :, ::2, ::2] += (length**2)[:, None, None] * curves
        both = -stiff[:, None, None] * _pairs(rates[:, :edge], rates[:, 1 : edge + 1])
        joined = both.reshape(len(both), edge, -1) @ of.products[3]
        return joined.reshape(len(both), edge, PLACES, PLACES), energy

    def _parts(self, at: Slices, change: Array, mean: Array) -> Parts:
        """Return the derivatives by changes and means, summed over the slices."""
        of, size = self.of, change.shape[:2]
        # Round the hoop, rates were divided by the radius.
        over = np.ones((len(of.balloon.film.middles), 4, 1))
        over[:, :3] /= of.balloon.film.middles[:, None, None]
        at.by_g[:] *= over
        at.fg[:] *= over[:, None]
        at.gg[:] *= over[:, None] * over[:, :, None]
        firsts = (
            by.reshape(*size, -1) @ rates.reshape(-1, PLACES)
            for by, rates in zip((at.by_f, at.by_g), of.rates, strict=True)
        )
        blocks = (
            (by.reshape(*size, -1) @ pair).reshape(*size, PLACES, PLACES)
            for by, pair in zip((at.ff, at.fg, at.gg), of.products, strict=False)
        )
        return Parts(change, mean, *firsts, *blocks)

    def _waves_bend(self, parts: Parts, rows: NDArray[np.int_]) -> Array:
        """Add the bending of films round the hoop, wave by wave, and return its energy: (rows,)."""
        balloon, waves = self.of.balloon, range(1, OVERTONES + 1)
        length, middle = balloon.film.lengths[:, None], balloon.film.middles[:, None]
        area = math.tau * middle * length * balloon.bending_stiffness / 2 * self.of.is_film
        turn = (np.array(waves) * self.of.waves / middle) ** 2
        normal = self.normal[rows][:, :, None]
        both = normal[..., :, None] * normal[..., None, :]
        # The places r_k and z_k of each wave.
        at = np.array([(first_of(k), first_of(k) + 1) for k in waves])
        energy = np.zeros(len(rows))
        for value, by, curve, weight in (
            (parts.mean, parts.by_mean, parts.means, area * turn**2),
            (
                parts.change,
                parts.by_change,
                parts.changes,
                2 * area * turn / self.stretch[rows][:, :, None] ** 2,
            ),
        ):
            off = (normal * value[:, :, at]).sum(-1)
            energy += (weight * off**2).sum((1, 2)) / 2
            by[:, :, at] += (weight * off)[..., None] * normal
            curve[:, :, at[:, :, None], at[:, None]] += weight[..., None, None] * both
        return energy

    def _plate_bends(self, parts: Parts) -> Array:
        """Add the bending of the rim, as thick as both films, and return its energy: (rows,)."""
        plate = self.of.plate
        both = np.stack([parts.change[:, :, UP], parts.mean[:, :, UP]], -1)
        by = (plate @ both[..., None])[..., 0]
        parts.by_change[:, :, UP] += by[..., 0]
        parts.by_mean[:, :, UP] += by[..., 1]
        for block, i, j in ((parts.changes, 0, 0), (parts.mixed, 0, 1), (parts.means, 1, 1)):
            block[:, :, UP, UP] += plate[:, i, j]
        return np.asarray((by * both).sum((1, 2)) / 2)

    def _inner_face(self, parts: Parts, places: Array, p: Array) -> Array:
        """Add the volume between the film's middle and its inner face; return it in ul."""
        balloon, film = self.of.balloon, slice(self.of.balloon.edge)
        nodes = places[:, : balloon.edge + 1]
        lie = Elements.of(nodes[:, :, R].T, nodes[:, :, Z].T)
        thick, thin = (
            air_volume(replace(balloon.film, thickness=by), balloon.edge, lie)
            for by in (balloon.thickness, 0.0)
        )
        by_dr, by_dz, by_middle = (
            -p[:, None] * (a - b).T for a, b in zip(thick.slopes, thin.slopes, strict=True)
        )
        rr, rz, zz, rm, zm, mm = (
            -p[:, None] * (a - b).T for a, b in zip(thick.curves, thin.curves, strict=True)
        )
        length = balloon.film.lengths[film]
        parts.by_change[:, film, R] += by_dr * length
        parts.by_change[:, film, Z] += by_dz * length
        parts.by_mean[:, film, R] += by_middle
        for i, j, by in ((R, R, rr), (R, Z, rz), (Z, R, rz), (Z, Z, zz)):
            parts.changes[:, film, i, j] += by * length**2
        parts.mixed[:, film, R, R] += rm * length
        parts.mixed[:, film, Z, R] += zm * length
        parts.means[:, film, R, R] += mm
        return thick.energy - thin.energy

    def _by_nodes(self, parts: Parts) -> tuple[Array, Array, Array]:
        """Return the derivatives by the places of nodes in the chain, (rows, nodes, places), second
        ones of each node, and across each element.
        """
        first = self.of.first
        one_over = 1 / self.of.balloon.film.lengths[:, None]
        by_change, by_mean = parts.by_change * one_over, parts.by_mean / 2
        changes = parts.changes * (one_over**2)[:, None]
        mixed, quarter = parts.mixed * one_over[:, None] / 2, parts.means / 4
        turned, count = mixed.swapaxes(2, 3), first[-1] + 2
        by_node = np.zeros((len(by_mean), count, PLACES))
        by_node[:, first] += by_mean - by_change
        by_node[:, first + 1] += by_mean + by_change
        diagonal = np.zeros((len(by_mean), count, PLACES, PLACES))
        diagonal[:, first] += changes - mixed - turned + quarter
        diagonal[:, first + 1] += changes + mixed + turned + quarter
        return by_node, diagonal, quarter - changes - mixed + turned


def _pairs(a: Array, b: Array) -> Array:
    """Return the products of all rates (.., n, slices) and (.., m, slices): (.., n, m, slices)."""
    return a[..., :, None, :] * b[..., None, :, :]


def _newton_steps(band: Array, right_side: Array) -> Array:
    """Return Newton's steps, with a larger diagonal where the tangent stiffness is indefinite."""
    together = least_energy.solve_blocks(band, right_side)
    if together is not None:
        return together
    steps = []
    for one, side in zip(np.moveaxis(band, -1, 0)[..., None], right_side.T[..., None], strict=True):
        stiffer, diagonal = one.copy(), np.abs(one[:, 0])
        for more in (0.0, *DAMPINGS):
            stiffer[:, 0] += more * diagonal
            step = least_energy.solve_blocks(stiffer, side)
            if step is not None:
                break
        steps.append(least_energy.solve(stiffer, side) if step is None else step)
    return np.concatenate(steps, 1)
