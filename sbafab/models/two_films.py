"""A balloon whose two films are unlike: each with its thickness and modulus, bonded at one rim.

Both films of ``models.balloon`` at once. They share the rim, which moves to where both pull alike
and tilts as they wring it: as a ring whose section turns. Units as there.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from sbafab.errors import DesignError
from sbafab.models import balloon as single
from sbafab.models.film_elements import Elements, air
from sbafab.models.least_energy import Descent, NoBalance, settled
from sbafab.models.rim_ripple import both_bend

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from sbafab.models.balloon import Balloon, BalloonLoad, Shapes
    from sbafab.models.film_elements import Array

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

    A free balloon's rim stays in its plane: where it is as a whole does not matter.
    """
    count, columns = len(one.nodes), []

    def column(*moved: tuple[int, float]) -> None:
        found = np.zeros(4 * count)
        for coordinate, by in moved:
            found[coordinate] = by
        columns.append(found)

    for film in (0, 2 * count):
        for node in range(0 if one.bore else 1, one.edge):
            column((film + 2 * node, 1.0))
        column(*((film + 2 * node + 1, 1.0) for node in range(one.held + 1)))
        for node in range(one.held + 1, one.edge):
            column((film + 2 * node + 1, 1.0))
    for node in range(one.edge, count):
        column((2 * node, 1.0), (2 * (count + node), 1.0))
    away = [(node, float(one.nodes[node]) - one.pocket) for node in range(one.edge + 1, count)]
    column(
        *((2 * node + 1, by) for node, by in away),
        *((2 * (count + node) + 1, -by) for node, by in away),
    )
    if not is_free:
        rim = range(one.edge, count)
        column(
            *((2 * node + 1, 1.0) for node in rim),
            *((2 * (count + node) + 1, -1.0) for node in rim),
        )
    return np.stack(columns, -1)


def _settled(films: TwoFilms, loads: Loads, basis: Array, y: Array) -> Array:
    """The freedoms (freedoms, rows) of least energy downhill of these."""
    try:
        return settled(_Energies(films, loads, basis), y)
    except NoBalance:
        raise DesignError(
            f"a balloon of radius {films[0].pocket:g} mm with two unlike films finds no balance; "
            "try another load"
        ) from None


class _Energies:
    """The energies of both films under their loads, by freedoms, for ``least_energy``."""

    def __init__(self, films: TwoFilms, loads: Loads, basis: Array) -> None:
        self.films, self.loads, self.basis = films, loads, basis
        self.wrings = _wringing(films) @ basis
        self.scale, self.close = single.sizes(films[0], loads[0])

    def at(self, x: Array, rows: NDArray[np.int_]) -> Descent:
        wrung = self.wrings @ x
        energy, slopes = wrung**2 / 2, wrung * self.wrings[:, None]
        matrix = np.tile(np.multiply.outer(self.wrings, self.wrings), (x.shape[1], 1, 1))
        bases, parts = np.split(self.basis, 2), np.split(self.basis @ x, 2)
        for one, load, part, basis in zip(self.films, self.loads, parts, bases, strict=True):
            found = single.total(one, load.rows(rows), part)
            energy = energy + found.energy
            slopes += basis.T @ found.gradient
            whole = single.second_slopes(one, found)
            matrix += basis.T @ whole @ basis
        return Descent(energy, slopes, matrix)

    def ahead(self, state: Descent, damping: Array) -> Array:
        matrix, diagonal = state.matrix.copy(), np.arange(len(self.wrings))
        own = np.abs(matrix[:, diagonal, diagonal])
        # Slack films without pressure may be held by nothing; rounding's share of the rest is.
        matrix[:, diagonal, diagonal] += damping[:, None] * own + 1e-15 * own.max(-1)[:, None]
        return np.asarray(-np.linalg.solve(matrix, state.gradient.T[..., None])[..., 0].T)

    def change(self, x: Array, ahead: Array) -> Array:
        parts = zip(np.split(self.basis @ x, 2), np.split(self.basis @ ahead, 2), strict=True)
        return np.asarray(np.max([single.change(*part) for part in parts], axis=0))
