"""The energy of a round balloon whose films wave in step with its rim (``waving``).

Films are membranes of Saint Venant and Kirchhoff's law; they bend along the meridian slice by
slice, as in ``film_elements``, and round the hoop wave by wave. One film and its share of the rim
are computed. Lengths mm, pressures kPa, energies uJ, air ul.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.models import banded
from sbafab.models.film_elements import ROOT, Elements, air, gradient, matrix
from sbafab.models.least_energy import Descent
from sbafab.models.waving import (
    EDGE,
    OVERTONES,
    PLACES,
    SLICES,
    UP,
    Parts,
    R,
    Sums,
    Waving,
    Z,
    first_of,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from sbafab.models.film_elements import Array

CLOSE = 1e-6
"""Force out of balance, as a share of pressure times pocket area, that is none."""
MORE = (0.001, 0.01, 0.1, 1.0)
"""Shares of the diagonal that are added in turn where second derivatives are not those of a dip."""


class Slices(NamedTuple):
    """What changes and means of elements are in each slice: along the meridian (rows, elements, 3,
    slices), and round the hoop (.., 4, ..), of which the last is z. And an energy's derivatives by
    them, first and second.
    """

    along: Array
    around: Array
    by_along: Array
    by_around: Array
    alongs: Array
    mixed: Array
    arounds: Array


class WaveTotal(NamedTuple):
    """Energy less the air's work of one film and its share of the rim, (rows,); its derivatives by
    coordinate (coordinates, rows), and second ones as a band of freedoms. What films store, uJ; the
    air on the film's side of the middle plane, ul.
    """

    energy: Array
    gradient: Array
    band: Array
    stored: Array
    volume: Array


class Waves:
    """Energies of waving films, for ``least_energy``: coordinates (nodes x places, rows).

    ``normals`` (rows, elements, 3) are those of the mean meridian in r and z, and its stretch; they
    say which way is out of the film where it bends round the hoop.
    """

    def __init__(self, of: Waving, pressure: Array, normals: Array) -> None:
        self.of, self.pressure, self.normals = of, pressure, normals
        one = of.balloon
        self.scale = pressure * one.pocket**3
        self.close = CLOSE * pressure * math.pi * one.pocket**2

    def at(self, x: Array, rows: NDArray[np.int_]) -> Descent:
        found = self.total(x, rows)
        return Descent(found.energy, found.gradient, found.band)

    def ahead(self, state: Descent, damping: Array) -> Array:
        band = state.matrix.copy()
        band[:, 0] += damping * np.abs(band[:, 0])
        freedoms = self.of.freedoms
        found = np.zeros_like(state.gradient)
        found[freedoms] = _downhill(band, -state.gradient[freedoms])
        return found

    def change(self, x: Array, ahead: Array) -> Array:
        """The largest share of its length by which a step changes an element of the mean meridian:
        (rows,).
        """
        length, by = (
            np.hypot(np.diff(y[R::PLACES], axis=0), np.diff(y[Z::PLACES], axis=0))
            for y in (x, ahead)
        )
        held = self.of.balloon.held
        return np.asarray((by[held:] / length[held:]).max(0))

    def total(self, x: Array, rows: NDArray[np.int_]) -> WaveTotal:
        """The energy at coordinates ``x`` of these rows."""
        of, one = self.of, self.of.balloon
        p, held, edge = self.pressure[rows], one.held, one.edge
        places = x.reshape(len(one.nodes), PLACES, -1).transpose(2, 0, 1).copy()
        places[:, :held, Z] = places[:, held, None, Z]
        ends = of.tail.shape[1]
        rim = (of.tail @ x[of.freedoms[-ends:]]).T.reshape(len(p), -1, PLACES)
        inner = np.concatenate([places[:, :edge], rim[:, 2:-1]], 1)
        outer = np.concatenate([places[:, 1 : edge + 1], rim[:, 3:]], 1)
        change, mean = (outer - inner) / one.film.lengths[:, None], (outer + inner) / 2
        slices = self._slices(change, mean)
        stored = self._stretched(slices)
        kinks, bent = self._bent(slices)
        volume = self._air(slices, p)
        parts = self._parts(slices, change, mean)
        stored = stored + bent + self._waves_bend(parts, rows) + self._plate_bends(parts)
        sums = Sums(of, parts, self._joined(kinks))
        volume = volume + self._inner_face(sums, places, p) + self._lid(sums, places, p)
        # The film's end comes down as the rim tilts, and all of the film with it.
        down = p * math.pi * one.pocket**2 / (2 * one.thickness)
        end = x[PLACES * edge + EDGE]
        sums.by_node[:, edge, EDGE] += 2 * down * end
        sums.own[:, edge, EDGE, EDGE] += 2 * down
        energy = stored - p * volume + down * end**2
        return WaveTotal(energy, *sums.by_freedoms(), stored, volume)

    def _slices(self, change: Array, mean: Array) -> Slices:
        """What each slice feels, with derivatives of nothing."""
        of = self.of
        size = change.shape[:2]
        along = (change @ of.along.reshape(-1, PLACES).T).reshape(*size, 3, SLICES)
        around = (mean @ of.around.reshape(-1, PLACES).T).reshape(*size, 4, SLICES)
        around[:, :, :3] /= of.balloon.film.middles[:, None, None]
        blank = [np.zeros((*size, *many, SLICES)) for many in ((3,), (4,), (3, 3), (3, 4), (4, 4))]
        return Slices(along, around, *blank)

    def _stretched(self, at: Slices) -> Array:
        """Stretching and shearing: (rows,)."""
        one = self.of.balloon
        flat, nu = one.film, one.poisson
        size = (math.tau * flat.middles * flat.lengths * one.thickness / SLICES)[:, None]
        plane = one.modulus / (1 - nu**2) * size
        c12, c33 = plane * nu, one.modulus / (2 * (1 + nu)) * size
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
        """Air in ul between the middle of the film and the middle plane: (rows,)."""
        one = self.of.balloon
        number = np.arange(len(one.film.lengths))
        size = math.tau / SLICES * one.film.middles * one.film.lengths
        part = (size * ((number >= one.held) & (number < one.edge)))[:, None]
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
        """Bending along the meridian, as ``film_elements.bending`` has it, in each slice.

        Gives what joins neighbours, by the changes in r and z along each: (rows, elements - 1, 2,
        2, slices); and the energy, (rows,).
        """
        one = self.of.balloon
        flat, held, edge = one.film, one.held, one.edge
        length = flat.lengths[:, None]
        dr, dz = at.along[:, :, 0] * length, at.along[:, :, 2] * length
        square = dr * dr + dz * dz
        slope = np.arctan2(-dz, dr)
        kink = slope[:, 1 : edge + 1] - slope[:, :edge]
        number = np.arange(len(flat.lengths))
        free = (number >= held) & (number < edge)
        bends = np.where(free, flat.lengths, 2 * ROOT * flat.thickness)
        rigid = math.tau * one.rigidity / SLICES
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
        """What slices say together of changes and means."""
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
        parts = Parts(change, mean, first, second, *blocks)
        # The neck stays level.
        held = of.balloon.held
        parts.by_change[:, :held, Z] = parts.changes[:, :held, Z] = parts.changes[
            :, :held, :, Z
        ] = 0.0
        parts.mixed[:, :held, Z] = 0.0
        return parts

    def _joined(self, kinks: Array) -> Array:
        """What joins changes along neighbours: (rows, elements - 1, places, places)."""
        size = kinks.shape[:2]
        found = (kinks.reshape(*size, -1) @ self.of.products[3]).reshape(*size, PLACES, PLACES)
        found[:, : self.of.balloon.held, Z] = 0.0
        return found

    def _waves_bend(self, parts: Parts, rows: NDArray[np.int_]) -> Array:
        """Films that bend round the hoop, wave by wave: (rows,)."""
        one = self.of.balloon
        length, middle = one.film.lengths, one.film.middles
        normal, stretch = self.normals[rows, :, :2], self.normals[rows, :, 2]
        number = np.arange(len(length))
        film = (number >= one.held) & (number < one.edge)
        area = math.tau * middle * length * one.rigidity / 2 * film
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
        """The rim, as thick as both films: (rows,)."""
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
        """What the film's inner face holds more than its middle, in ul, by the mean meridian."""
        one = self.of.balloon
        lie = Elements.of(places[:, :, R], places[:, :, Z])
        thick, thin = (
            air(one.film._replace(thickness=by), one.edge, lie) for by in (one.thickness, 0.0)
        )
        slopes = [a - b for a, b in zip(thick.slopes, thin.slopes, strict=True)]
        curves = [a - b for a, b in zip(thick.curves, thin.curves, strict=True)]
        none = np.zeros((len(p), one.edge))
        size = (len(p), len(one.nodes), 2)
        sums.by_node[:, :, :2] -= p[:, None, None] * gradient(slopes).T.reshape(size)
        band = -p[:, None, None] * matrix(curves, [none] * 4).transpose(2, 0, 1)
        r, z = band[:, 0::2], band[:, 1::2]
        sums.own[:, :, R, R] += r[:, :, 0]
        sums.own[:, :, Z, Z] += z[:, :, 0]
        sums.own[:, :, R, Z] += r[:, :, 1]
        sums.own[:, :, Z, R] += r[:, :, 1]
        for i, j, by in (
            (R, R, r[:, :, 2]),
            (R, Z, r[:, :, 3]),
            (Z, R, z[:, :, 1]),
            (Z, Z, z[:, :, 2]),
        ):
            sums.next[:, :, i, j] += by[:, :-1]
        return thick.energy - thin.energy

    def _lid(self, sums: Sums, places: Array, p: Array) -> Array:
        """Air in ul under the neck and the bore in it."""
        held = self.of.balloon.held
        r, z = places[:, held, R], places[:, held, Z]
        press = -math.pi * p
        sums.by_node[:, held, R] += 2 * press * r * z
        sums.by_node[:, held, Z] += press * r**2
        sums.own[:, held, R, R] += 2 * press * z
        sums.own[:, held, R, Z] += 2 * press * r
        sums.own[:, held, Z, R] += 2 * press * r
        return np.asarray(math.pi * r**2 * z)


def _downhill(band: Array, wanted: Array) -> Array:
    """Newton's steps; with more on the diagonal where second derivatives are not a dip's."""
    found = banded.solve_positive(band, wanted)
    if found is not None:
        return found
    rows = band.shape[-1]
    if rows > 1:
        # Only those that need more are given more.
        halves = slice(None, rows // 2), slice(rows // 2, None)
        return np.concatenate(
            [_downhill(band[..., half], wanted[..., half]) for half in halves], -1
        )
    diagonal = np.abs(band[:, 0])
    for more in MORE:
        band = band.copy()
        band[:, 0] += more * diagonal
        found = banded.solve_positive(band, wanted)
        if found is not None:
            return found
    return banded.solve(band, wanted)
