"""A balloon whose two films are unlike: each with its thickness and modulus, bonded at one rim.

Both films of ``models.balloon`` at once. They share the rim, which moves to where both pull alike
and tilts as they wring it: as a ring whose section turns. Units as there.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.errors import DesignError
from sbafab.models import balloon as single
from sbafab.models import banded
from sbafab.models.film_elements import Elements, air
from sbafab.models.least_energy import Descent, NoBalance, settled
from sbafab.models.rim_ripple import both_bend

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from sbafab.models.balloon import Balloon, BalloonLoad, Shapes
    from sbafab.models.film_elements import Array

REACH = 5
"""Coordinates further on that one is joined with."""
TwoFilms = tuple["Balloon", "Balloon"]
Loads = tuple["BalloonLoad", "BalloonLoad"]


def inflate(films: TwoFilms, load: BalloonLoad) -> Shapes:
    """The shapes under a load; ``r`` and ``z`` are those of the film that stretches more easily.

    Raises DesignError where no balance is found.
    """
    loads = (load, load)
    basis = _basis(films[0], is_free=bool(np.isinf(load.half).any()))
    begin = [single.coordinates(*single.start(one, load)) for one in films]
    y = np.asarray(np.linalg.pinv(basis) @ np.concatenate(begin), dtype=float)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        y = _settled(films, loads, basis, y)
        if films[0].wrinkles:
            zones = [
                single.compressed(one, *single.places(part))
                for one, part in zip(films, np.split(basis @ y, 2), strict=True)
            ]
            for _ in range(single.ROUNDS):
                shapes = [single.places(part) for part in np.split(basis @ y, 2)]
                ripples = single.rippling(films, shapes)
                loads = tuple(
                    load._replace(cap=single.wrinkling(one, *shape, zone), ripple=ripple)
                    for one, shape, zone, ripple in zip(films, shapes, zones, ripples, strict=True)
                )  # type: ignore[assignment]
                y = _settled(films, loads, basis, y)
    x = basis @ y
    energy = (_wringing(films) @ x) ** 2 / 2
    volume, force = np.zeros_like(energy), np.zeros_like(energy)
    shapes = []
    for one, own, part in zip(films, loads, np.split(x, 2), strict=True):
        r, z = (np.ascontiguousarray(each) for each in single.places(part))
        found = single.total(one, own, part)
        held = air(one.film, one.edge, Elements.of(r, z)).energy
        energy, volume = energy + found.energy + load.pressure * held, volume + held
        force = force + found.force / 2
        shapes.append((r, z))
    height = shapes[0][1][:, 0] + shapes[1][1][:, 0]
    softer = shapes[int(films[1].rigid < films[0].rigid)]
    return single.Shapes(load.pressure, height, volume, force, energy, *softer)


def _wringing(films: TwoFilms) -> Array:
    """What coordinates make of the square root of twice the energy of wringing the rim.

    A ring of both films bonded turns round its middle line: hoops are bent.
    """
    one = films[0]
    stiff = math.tau * both_bend(films) * math.log((one.pocket + one.ring) / one.pocket)
    found = np.zeros(4 * len(one.nodes))
    found[[2 * len(one.nodes) - 1, 2 * one.edge + 1]] = 1.0, -1.0
    return np.asarray(found * math.sqrt(stiff) / one.ring)


def _basis(one: Balloon, is_free: bool) -> Array:
    """What a unit of each freedom moves: (coordinates of both films, freedoms).

    First come those of each film alone, then those of both: the rim's radii, its tilt, and its
    height. A free balloon's rim stays in its plane: where it is as a whole does not matter.
    """
    count, own = len(one.nodes), _own(one)
    found = np.zeros((4 * count, 2 * len(own) + count - one.edge + 1 + (not is_free)))
    for film, start in ((0, 0), (2 * count, len(own))):
        found[film + own, start + np.arange(len(own))] = 1.0
        found[film + 1 : film + one.level : 2, start + np.searchsorted(own, one.level)] = 1.0
    rim, shared = np.arange(one.edge, count), 2 * len(own)
    for film, side in ((0, 1.0), (2 * count, -1.0)):
        found[film + 2 * rim, shared + np.arange(len(rim))] = 1.0
        found[film + 2 * rim + 1, shared + len(rim)] = side * (one.nodes[rim] - one.pocket)
        found[film + 2 * rim + 1, shared + len(rim) + 1 :] = side
    return found


def _own(one: Balloon) -> NDArray[np.int_]:
    """The coordinates that a film moves alone: those inside the pocket's edge."""
    return one.freedoms[one.freedoms < 2 * one.edge]


def _settled(films: TwoFilms, loads: Loads, basis: Array, y: Array) -> Array:
    """The freedoms (freedoms, rows) of least energy downhill of these."""
    try:
        return settled(_Energies(films, loads, basis), y)
    except (NoBalance, np.linalg.LinAlgError):
        raise DesignError(
            f"a balloon of radius {films[0].pocket:g} mm with two unlike films finds no balance; "
            "try another load"
        ) from None


class _Matrix(NamedTuple):
    """Second derivatives, rows last: those of each film's own freedoms as bands (own, 6, 2 rows),
    the first film's rows before the second's; of its last ones with the shared ones (``REACH``,
    shared, 2 rows), all others are 0; and of the shared ones (rows, shared, shared).
    """

    own: Array
    between: Array
    shared: Array


class _Energies:
    """The energies of both films under their loads, by freedoms, for ``least_energy``."""

    def __init__(self, films: TwoFilms, loads: Loads, basis: Array) -> None:
        self.films, self.loads, self.basis = films, loads, basis
        self.wrings = _wringing(films) @ basis
        self.scale, self.close = single.sizes(films[0], loads[0])
        own = _own(films[0])
        self.packing = banded.packing(own, len(basis) // 2, REACH + 1)
        self.alone = len(own)

    def at(self, x: Array, rows: NDArray[np.int_]) -> Descent:
        first = 2 * self.alone
        by = self.wrings[first:]
        wrung = self.wrings @ x
        energy, slopes = wrung**2 / 2, wrung * self.wrings[:, None]
        shared = np.tile(np.multiply.outer(by, by), (x.shape[1], 1, 1))
        bases, parts = np.split(self.basis, 2), np.split(self.basis @ x, 2)
        own, between = [], []
        for one, load, part, basis in zip(self.films, self.loads, parts, bases, strict=True):
            found = single.total(one, load.rows(rows), part)
            energy = energy + found.energy
            slopes += basis.T @ found.gradient
            single.levelled(one, found)
            own.append(banded.packed(found.matrix, self.packing))
            # The rim, and what is near enough to be joined with it.
            edge = 2 * one.edge
            end, moved = banded.dense(found.matrix[edge - REACH :]), basis[edge:, first:]
            rim = np.arange(REACH, end.shape[1], 2)
            end[:, rim[:, None], rim] += np.moveaxis(found.rim, -1, 0)
            between.append(np.moveaxis(end[:, :REACH, REACH:] @ moved, 0, -1))
            shared += moved.T @ end[:, REACH:, REACH:] @ moved
        matrix = _Matrix(np.concatenate(own, -1), np.concatenate(between, -1), shared)
        return Descent(energy, slopes, matrix)

    def ahead(self, state: Descent, damping: Array) -> Array:
        """By the Schur complement of the shared freedoms."""
        matrix, first = state.matrix, 2 * self.alone
        several, rows = matrix.shared.shape[1], len(damping)
        band, shared = matrix.own.copy(), matrix.shared.copy()
        band[:, 0] += _firmer(band[:, 0], np.tile(damping, 2))
        number = np.arange(several)
        shared[:, number, number] += _firmer(shared[:, number, number].T, damping).T
        wanted = np.zeros((self.alone, several + 1, 2 * rows))
        wanted[-REACH:, :-1] = matrix.between
        wanted[:, -1] = -np.concatenate(np.split(state.gradient[:first], 2), -1)
        alone = banded.solve(band, wanted)
        passed = np.einsum("iar,ibr->rab", matrix.between, alone[-REACH:])
        passed = passed[:rows] + passed[rows:]
        left = -state.gradient[first:].T - passed[..., -1]
        found = np.linalg.solve(shared - passed[..., :-1], left[..., None])[..., 0].T
        own = alone[:, -1] - (alone[:, :-1] * np.tile(found, 2)).sum(1)
        return np.concatenate([own[:, :rows], own[:, rows:], found])

    def change(self, x: Array, ahead: Array) -> Array:
        parts = zip(np.split(self.basis @ x, 2), np.split(self.basis @ ahead, 2), strict=True)
        return np.asarray(np.max([single.change(*part) for part in parts], axis=0))


def _firmer(diagonal: Array, damping: Array) -> Array:
    """What is added to a diagonal (n, rows). Slack films without pressure may be held by nothing:
    rounding's share of the rest is added then.
    """
    size = np.abs(diagonal)
    return np.asarray(damping * size + 1e-15 * size.max(0))
