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
from sbafab.models.film_elements import air
from sbafab.models.rim_ripple import both_bend

if TYPE_CHECKING:
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
    at = [np.stack(single.start(one, load), -1).reshape(len(load.pressure), -1) for one in films]
    both = np.concatenate(at, axis=1)
    both = both @ np.linalg.pinv(basis.T) @ basis.T
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        both = _settled(films, loads, basis, both)
        if films[0].wrinkles:
            zones = [
                single.compressed(one, *part) for one, part in zip(films, _parts(both), strict=True)
            ]
            for _ in range(single.ROUNDS):
                ripples = single.rippling(films, _parts(both))
                loads = tuple(
                    load._replace(cap=single.wrinkling(one, *part, zone), ripple=ripple)
                    for one, part, zone, ripple in zip(
                        films, _parts(both), zones, ripples, strict=True
                    )
                )  # type: ignore[assignment]
                both = _settled(films, loads, basis, both)
    parts = _parts(both)
    energy, volume = (both @ _wringing(films)) ** 2 / 2, np.zeros(len(both))
    for one, own, part in zip(films, loads, parts, strict=True):
        term, _ = single.total(one, own, *part, slopes=False)
        held = air(one.film, one.edge, *part).energy
        energy, volume = energy + term.energy + load.pressure * held, volume + held
    force = np.mean(
        [single.total(o, w, *part)[1] for o, w, part in zip(films, loads, parts, strict=True)], 0
    )
    height = parts[0][1][:, 0] + parts[1][1][:, 0]
    softer = parts[int(films[1].rigid < films[0].rigid)]
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


def _parts(both: Array) -> list[tuple[Array, Array]]:
    """Radii and heights of each film's nodes."""
    return [(half[:, ::2], half[:, 1::2]) for half in np.split(both, 2, axis=1)]


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


def _settled(films: TwoFilms, loads: Loads, basis: Array, both: Array) -> Array:
    """The shapes of least energy: Newton's method, damped where it climbs."""
    both, damping = both.copy(), np.zeros(len(both))
    pressure, diagonal = loads[0].pressure, np.arange(basis.shape[1])
    for _ in range(single.MOST_STEPS):
        energy, gradient, matrix = _total(films, loads, basis, both)
        matrix[:, diagonal, diagonal] += damping[:, None] * np.abs(matrix[:, diagonal, diagonal])
        move = -np.linalg.solve(matrix, gradient[..., None])[..., 0]
        slope = (move * gradient).sum(-1)
        area = math.pi * films[0].pocket ** 2
        still = np.abs(gradient).max(-1) <= single.CLOSE * np.maximum(pressure, single.LEAST) * area
        digits = single.ROUNDING * (np.abs(energy) + pressure * films[0].pocket ** 3)
        still |= (np.abs(slope) <= digits) & (damping == 0.0)
        if still.all():
            return both
        ahead = np.where(still[:, None], 0.0, move) @ basis.T
        share = _downhill(films, loads, both, ahead, energy, slope)
        both += share[:, None] * ahead
        damped = np.where(share > 0, damping / 10, np.clip(10 * damping, 1e-3, 1e9))
        damping = np.where(damped < 1e-6, 0.0, damped)
    raise DesignError(
        f"a balloon of radius {films[0].pocket:g} mm with two unlike films finds no balance; try "
        "another load"
    )


def _total(films: TwoFilms, loads: Loads, basis: Array, both: Array) -> tuple[Array, Array, Array]:
    """Energy with its slopes by the freedoms."""
    size = both.shape[1] // 2
    wrings = _wringing(films)
    wrung, by = both @ wrings, wrings @ basis
    energy, gradient = wrung**2 / 2, wrung[:, None] * by
    matrix = np.tile(np.multiply.outer(by, by), (len(both), 1, 1))
    pairs = zip(films, loads, _parts(both), strict=True)
    for number, (one, load, part) in enumerate(pairs):
        term, _ = single.total(one, load, *part)
        rows = basis[number * size : (number + 1) * size]
        energy = energy + term.energy
        gradient += term.gradient @ rows
        matrix += rows.T @ term.hessian @ rows
    return energy, gradient, matrix


def _downhill(
    films: TwoFilms, loads: Loads, both: Array, ahead: Array, energy: Array, slope: Array
) -> Array:
    """The share of each step that lowers the energy; 0 where none does."""
    change = np.zeros(len(both))
    for (r, z), (dr, dz) in zip(_parts(both), _parts(ahead), strict=True):
        length = np.hypot(np.diff(r), np.diff(z))
        change = np.maximum(change, (np.hypot(np.diff(dr), np.diff(dz)) / length).max(-1))
    share = np.minimum(1.0, single.FARTHEST / np.maximum(change, 1e-300))
    share = np.where(slope <= 0, share, 0.0)
    room = 1e-12 * (np.abs(energy) + loads[0].pressure * films[0].pocket ** 3)
    for _ in range(single.HALVINGS):
        there = both + share[:, None] * ahead
        tried = (there @ _wringing(films)) ** 2 / 2
        for one, load, part in zip(films, loads, _parts(there), strict=True):
            tried = tried + single.total(one, load, *part, slopes=False)[0].energy
        good = tried <= energy + 1e-4 * share * slope + room
        if good.all():
            return share
        share = np.where(good, share, share / 2)
    return np.where(good, share, 0.0)
