"""A round balloon as an elastic membrane of revolution: inflated free, or between plates.

Two films, bonded round the pocket and, between neighbours, at the neck. If the films are equal, one
is computed and the other mirrors it; different films are computed together. A film stretches (plane
stress; Saint Venant and Kirchhoff's law) and bends. It wrinkles under hoop
compression, and the wrinkles of least energy carry

    N = 2 sqrt(B K)    K = T (pi / L)^2 + E t c^2      (after Cerda and Mahadevan, 2003)

with the bending stiffness B, the tension T along the meridian, the length L of the compressed zone
and the curvature c of the meridian. The rim, two films thick, ripples. Shapes minimise the energy,
by Newton's method for many pressures and heights at once. Lengths mm, pressures kPa, volumes ul,
forces mN.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sbafab.errors import DesignError
from sbafab.models.film_elements import (
    Array,
    Balloon,
    Elements,
    air_volume,
    assembled_gradient,
    assembled_tangent,
    bending,
    curvature,
    membrane,
    strain,
    strain_measure,
)
from sbafab.models.least_energy import NoEquilibrium, Packing, equilibrium, packing
from sbafab.runtime import one_blas_thread

RESIDUAL = 1e-9
"""Residual force, as a share of pressure times pocket area, that counts as equilibrium."""
LEAST_PRESSURE = 0.01
"""Least pressure in kPa for the tolerance of the residual."""
PLATE_STIFFNESS = 20_000.0
"""Penalty of a plate: the pressure on the film presses it in by 1 / PLATE_STIFFNESS mm."""
BAND = 6
"""Coordinates that a film couples, from each one on."""
WRINKLE_ROUNDS = 3
"""Iterations between the shape and the wrinkles' stress, which depends on the tension."""


class Shapes(NamedTuple):
    """Balloons in equilibrium, one row each.

    ``pressure`` in kPa; ``height``, the rise (stroke) of the whole balloon, in mm; ``volume`` of
    its air in ul; ``force`` on the plate at either end in mN; ``energy`` stored in its films in uJ;
    ``r`` and ``z`` of the nodes of one film, relative to a flat one, in mm.
    """

    pressure: Array
    height: Array
    volume: Array
    force: Array
    energy: Array
    r: Array
    z: Array

    def rows(self, these: slice) -> Shapes:
        return Shapes(*(part[these] for part in self))


class BalloonLoad(NamedTuple):
    """Pressure and half the height between the plates, both (rows,); ``cap``, the hoop stress
    carried by wrinkles (elements, rows); whether plates hold the necks (``tied``); the rim's
    ripple.
    """

    pressure: Array
    half: Array
    cap: Array
    tied: bool
    ripple: Ripple

    def rows(self, these: NDArray[np.int_]) -> BalloonLoad:
        if len(these) == len(self.pressure):
            return self
        pressure, half, cap = self.pressure[these], self.half[these], self.cap[:, these]
        return BalloonLoad(pressure, half, cap, self.tied, self.ripple.rows(these))


@one_blas_thread
def inflate(
    balloon: Balloon, pressure: ArrayLike, height: ArrayLike | None = None, tied: bool = False
) -> Shapes:
    """Return the equilibrium shapes at pressures (kPa), free or between plates at heights (mm); for
    two films ``r`` and ``z`` are those of the more compliant one.

    The air in the bore of a free balloon pulls on it, as in a stack. With ``tied`` the plates hold
    its necks, and pull if they are farther apart than its free height; the force is then negative.
    Raises DesignError for pressures or heights that are not above 0 (a tied balloon may have no
    pressure), or if Newton's method finds no equilibrium.
    """
    p = np.atleast_1d(np.asarray(pressure, dtype=float))
    high = math.inf if height is None else np.asarray(height, dtype=float)
    p, high = np.broadcast_arrays(p, high)
    if not (((p > 0) | (tied & (p == 0))) & np.isfinite(p) & (high > 0)).all():
        raise DesignError("pressure and height of a balloon must be above 0 kPa and 0 mm")
    smooth = np.where(balloon.may_wrinkle & balloon.inextensible, 0.0, math.inf)
    cap = np.broadcast_to(smooth[:, None], (len(smooth), len(p)))
    none = np.zeros((len(balloon.nodes) - 1 - balloon.edge, len(p)))
    ripple = Ripple(p * 0.0, p + math.inf, none, np.ones(len(p)))
    load = BalloonLoad(p, high / 2, cap, tied, ripple)
    mate = balloon.mate
    films = (balloon,) if mate is None else (replace(balloon, mate=None), mate)
    motion = _motion(films, is_free=bool(np.isinf(high).any()))
    loads = [load] * len(films)
    y = motion.inverse @ np.concatenate([initial_shape(film, load) for film in films])
    # Elements may collapse before equilibrium; that raises an error in the end.
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        y = _balanced(films, loads, motion, y)
        if balloon.wrinkles and not balloon.inextensible:
            zones = [compressed_length(*each) for each in zip(films, motion.shapes(y), strict=True)]
            for _ in range(WRINKLE_ROUNDS):
                shapes = motion.shapes(y)
                ripples = ripples_at(films, shapes)
                loads = [
                    load._replace(cap=wrinkle_stress(film, x, zone), ripple=ripple)
                    for film, x, zone, ripple in zip(films, shapes, zones, ripples, strict=True)
                ]
                y = _balanced(films, loads, motion, y)
    return _shapes(films, loads, motion, y)


def _shapes(films: FilmPair, loads: Sequence[BalloonLoad], motion: FilmMotion, y: Array) -> Shapes:
    """Return the shapes at freedoms (freedoms, rows); one film represents two."""
    shapes, both = motion.shapes(y), 2 / len(films)
    height = volume = force = np.zeros(y.shape[1])
    energy = motion.twist @ y**2 / 2
    for film, load, x in zip(films, loads, shapes, strict=True):
        state = total_energy(film, load, x)
        half = air_volume(film, Elements.of(x)).energy
        energy = energy + both * (state.energy + load.pressure * half)
        height, volume = height + both * x[1], volume + both * half
        force = force + both / 2 * state.force
    softer = int(films[-1].membrane_stiffness < films[0].membrane_stiffness)
    r, z = (np.ascontiguousarray(shapes[softer][place::2].T) for place in (0, 1))
    return Shapes(loads[0].pressure, height, volume, force, energy, r, z)


def initial_shape(balloon: Balloon, load: BalloonLoad) -> Array:
    """Return the initial coordinates of films: bulged, as high as their pressure could lift them,
    or cones if plates pull them higher: (coordinates, rows).
    """
    flat, free = balloon.nodes, balloon.pocket - balloon.neck
    rise = 0.3 * free * np.cbrt(load.pressure * balloon.pocket / (balloon.modulus * 0.0025))
    if balloon.bending_stiffness > 0:
        # A thick film rises less, like a plate clamped all round.
        plate = (
            load.pressure * free**4 / ((384 if balloon.neck else 64) * balloon.bending_stiffness)
        )
        rise = np.minimum(rise, plate)
    rise = np.clip(rise, 0.05 * free, 0.8 * free)
    out = np.clip((flat - balloon.neck) / free, 0.0, 1.0)[:, None]
    pulled = load.tied & (load.half > rise)
    # A film without a neck would begin with a kink at the axis.
    is_cone = pulled & (balloon.neck > 0)
    z = np.where(pulled, load.half, rise) * np.where(is_cone, 1 - out, 1 - out**2)
    z = np.minimum(z, load.half + 1 / PLATE_STIFFNESS)
    return coordinates(np.tile(flat, (len(rise), 1)), z.T)


class TotalEnergy(NamedTuple):
    """Potential energy (rows,) of a film, its air and the plates, with its derivatives.

    ``gradient`` by coordinate (coordinates, rows), the residual; ``matrix``, the tangent stiffness
    as a band (coordinates, 6, rows), without the ripples' coupling: this is ``rim``, by the radii
    of the rim's nodes (nodes, nodes, rows). ``force`` is the plates' force, (rows,).
    """

    energy: Array
    gradient: Array
    matrix: Array
    rim: Array
    force: Array


def coordinates(r: Array, z: Array) -> Array:
    """Return the coordinates r, z of each node in turn, (coordinates, rows), from radii and heights
    (rows, nodes).
    """
    return np.stack([r.T, z.T], 1).reshape(-1, len(r))


def total_energy(balloon: Balloon, load: BalloonLoad, x: Array) -> TotalEnergy:
    """Return the potential energy at coordinates, with residual and tangent stiffness."""
    p, elements = load.pressure, Elements.of(x)
    bend, joined = bending(balloon, elements)
    stretch, content = membrane(balloon, elements, load.cap), air_volume(balloon, elements)
    eased, relief, rim = ripple_energy(balloon, load.ripple, x[0::2])
    slopes, curves = (
        [a - p * b for a, b in zip(*both, strict=True)]
        for both in ((stretch.slopes, content.slopes), (stretch.curves, content.curves))
    )
    for total, parts in ((slopes, bend.slopes), (curves, bend.curves)):
        for number, part in enumerate(parts):
            total[number] += part
    over = x[1::2] - load.half
    touches = over > 0
    stiff = PLATE_STIFFNESS * p * balloon.node_areas
    if load.tied:
        held = slice(balloon.neck_edge + 1)
        touches[held] = True
        stiff[held] = PLATE_STIFFNESS * np.maximum(p, 1.0) * balloon.node_areas[held]
    over, stiff = np.where(touches, over, 0.0), np.where(touches, stiff, 0.0)
    pressed = stiff * over
    energy = bend.energy + stretch.energy + eased
    energy = energy - p * content.energy + (pressed * over).sum(0) / 2
    by_place, band = assembled_gradient(slopes), assembled_tangent(curves, joined)
    by_place[1::2] += pressed
    by_place[2 * balloon.edge :: 2] += relief
    band[1::2, 0] += stiff
    return TotalEnergy(energy, by_place, band, rim, pressed.sum(0))


FilmPair = tuple["Balloon", ...]
"""One film, mirrored by an equal one, or two films bonded at one rim."""


class FilmMotion(NamedTuple):
    """Motion of films per unit of each degree of freedom.

    ``bases`` (films, coordinates, freedoms) has the pseudoinverse ``inverse``; with the index map
    from their tangent stiffness to its band, and ``twist``, the stiffness of each freedom due to
    the rim's twist.

    Heights of the neck are one freedom, so that it stays level. Two films share the rim, which
    moves until their tensions balance and tilts as they twist it, like a ring whose section
    rotates.
    """

    bases: Array
    inverse: Array
    packing: Packing
    twist: Array

    def shapes(self, y: Array) -> list[Array]:
        """Return the coordinates of each film at freedoms (freedoms, rows)."""
        return [basis @ y for basis in self.bases]


@lru_cache(maxsize=64)
def _motion(films: FilmPair, is_free: bool) -> FilmMotion:
    """Return the motion of films by their own freedoms, coordinate by coordinate, then the rim's:
    its radii and, for two films, its tilt and height.

    A free balloon's rim stays in its plane: its overall height is fixed.
    """
    balloon, several = films[0], len(films)
    nodes = np.arange(balloon.edge)
    rim = np.arange(balloon.edge, len(balloon.nodes))
    level = 2 * balloon.neck_edge + 1
    radii = 2 * nodes[(nodes > 0) | (balloon.bore > 0)]
    inner = np.sort(np.concatenate([radii, 2 * nodes[balloon.neck_edge :] + 1]))
    shared = several * len(inner)
    count = shared + len(rim) + (several - 1) * (2 - is_free)
    bases = np.zeros((several, 2 * len(balloon.nodes), count))
    for number, basis in enumerate(bases):
        own, side = several * np.arange(len(inner)) + number, 1.0 - 2 * number
        basis[inner, own] = 1.0
        basis[1:level:2, own[np.searchsorted(inner, level)]] = 1.0
        basis[2 * rim, shared + np.arange(len(rim))] = 1.0
        if several > 1:
            basis[2 * rim + 1, shared + len(rim)] = side * (balloon.nodes[rim] - balloon.pocket)
            basis[2 * rim + 1, shared + len(rim) + 1 :] = side
    # A ring of both films bonded turns round its middle line: hoops are bent.
    twist = np.zeros(count)
    if several > 1:
        widening = math.log((balloon.pocket + balloon.ring) / balloon.pocket)
        twist[shared + len(rim)] = math.tau * bonded_bending_stiffness(films) * widening
    inverse = np.asarray(np.linalg.pinv(bases.reshape(-1, count)), dtype=float)
    # Entries of each film: those of its band, and of the rim's radii, which ripples couple.
    first, off = np.divmod(np.arange(bases.shape[1] * BAND), BAND)
    second = np.concatenate([first + off, np.tile(2 * rim, len(rim))])
    first = np.concatenate([first, np.repeat(2 * rim, len(rim))])
    good = np.flatnonzero((second < bases.shape[1]) & (first <= second))
    source = (good + len(first) * np.arange(several)[:, None]).ravel()
    moved, others = (bases[:, each[good]].reshape(-1, count) for each in (first, second))
    is_pair = np.tile(first[good] != second[good], several)
    return FilmMotion(bases, inverse, packing(moved, others, source, is_pair), twist)


def _balanced(films: FilmPair, loads: Sequence[BalloonLoad], motion: FilmMotion, y: Array) -> Array:
    """Return the freedoms (freedoms, rows) of least energy downhill. Raises DesignError."""
    twist, bases, pocket = motion.twist[:, None], motion.bases, films[0].pocket

    def energies(y: Array, rows: NDArray[np.int_]) -> tuple[Array, Array, Array]:
        energy, slopes, entries = (twist * y**2 / 2).sum(0), twist * y, []
        for film, load, basis in zip(films, loads, bases, strict=True):
            state = total_energy(film, load.rows(rows), basis @ y)
            energy, slopes = energy + state.energy, slopes + basis.T @ state.gradient
            entries += [part.reshape(-1, y.shape[1]) for part in (state.matrix, state.rim)]
        band = motion.packing.band(np.concatenate(entries))
        band[:, 0] += twist
        return energy, slopes, band

    def change(y: Array, ahead: Array) -> Array:
        return np.asarray(np.max([relative_change(b @ y, b @ ahead) for b in bases], axis=0))

    pressure = loads[0].pressure
    close = RESIDUAL * np.maximum(pressure, LEAST_PRESSURE) * math.pi * pocket**2
    try:
        return equilibrium(energies, change, y, pressure * pocket**3, close)
    except (NoEquilibrium, np.linalg.LinAlgError):
        raise DesignError(
            f"no equilibrium found for a balloon of radius {pocket:g} mm; try another load"
        ) from None


def relative_change(x: Array, ahead: Array) -> Array:
    """Return the largest relative change of length of an element in a step: (rows,)."""
    length, by = (np.hypot(y[2::2] - y[:-2:2], y[3::2] - y[1:-2:2]) for y in (x, ahead))
    return np.asarray((by / length).max(0))


def compressed_length(balloon: Balloon, x: Array) -> Array:
    """The length in mm of the film over which a smooth film is compressed in the hoop direction."""
    meridian, hoop = strain(balloon, Elements.of(x))
    is_compressed, lengths = hoop + balloon.poisson * meridian < 0, balloon.lengths
    return np.asarray(np.maximum((lengths * balloon.may_wrinkle) @ is_compressed, lengths.min()))


def wrinkle_stress(balloon: Balloon, x: Array, zone: Array) -> Array:
    """The hoop stress in kPa carried by wrinkles over a zone, from each element's tension."""
    at = Elements.of(x)
    tension = balloon.membrane_stiffness * strain(balloon, at)[0]
    # A wrinkle in a curved film stretches the meridian: a large number of short ones costs least.
    support = np.maximum(tension, 0.0) * (math.pi / zone) ** 2
    support = support + balloon.membrane_stiffness * curvature(balloon, at) ** 2
    force = 2 * np.sqrt(balloon.bending_stiffness * support)
    return np.where(balloon.may_wrinkle[:, None], force / balloon.thickness, math.inf)


def ripples_at(films: Sequence[Balloon], shapes: Sequence[Array]) -> list[Ripple]:
    """Return the rim's ripples at coordinates of one film (mirrored by the other), or of both."""
    strains = [strain(film, Elements.of(x)) for film, x in zip(films, shapes, strict=True)]
    edge = films[0].edge
    pulls = [
        film.membrane_stiffness * meridian[edge - 1]
        for film, (meridian, _) in zip(films, strains, strict=True)
    ]
    return rim_ripples(films, strains[0][1][edge:], pulls)


# The bonded rim of a balloon, which buckles out of its plane where its hoop is compressed.
#
# The films, pulled tight, hold the pocket's edge; the rim tilts about it by a cos(n turn), a in
# rad. At s from that edge a ripple takes up the hoop strain
#
#     a^2 rho,    rho = (n^2 s^2 / r^2 - s / r) / 4
#
# the first part for the waves' length, the second for the tilt, which draws the hoop inward. It
# costs
#
#     a^2 K / 2,    K = pi int D ((1/r - n^2 s / r^2)^2 + 2 (1 - nu) n^2 (1/r - s/r^2)^2) r ds
#                       + pi R sum sqrt(B T)
#
# the rim's bending and twisting (plate of both films, Kirchhoff), and the films' roots: a long
# film of bending stiffness B under the tension T is turned at its end against sqrt(B T). With the
# rim's hoop strain e the energy is a^2 K / 2 + int E (e + a^2 rho)^2 / 2, so that the amplitude of
# least energy has a closed form, and the rest is quadratic in e. The number of waves is the
# one of least energy. Nothing is fitted. Lengths mm, pressures kPa, energies uJ.


WAVE_NUMBERS = np.arange(2, 201)
"""Numbers of waves round the rim that are compared."""
GAUSS_POINTS = 5
"""Points an element at which a rim's integrals are taken."""


class Ripple(NamedTuple):
    """A ripple of one film's rim, rows last.

    ``waves`` around the rim; ``cost`` is K / 2, infinite for a smooth rim; ``pull`` is each
    element's volume times modulus times rho, and ``stiff`` the integral of E rho^2.
    """

    waves: Array
    cost: Array
    pull: Array
    stiff: Array

    def rows(self, these: NDArray[np.int_]) -> Ripple:
        return Ripple(*(part[..., these] for part in self))


def rim_ripples(films: Sequence[Balloon], hoop: Array, tensions: Sequence[Array]) -> list[Ripple]:
    """Return the ripples of least energy at the rim's hoop strains (elements, rows), one part per
    film.

    ``tensions`` in N/m are the films' tensions at the pocket's edge, one row per film. One film
    represents two equal ones.
    """
    pair = films[0], films[-1]
    roots = sum(
        np.sqrt(film.bending_stiffness * np.maximum(pull, 0.0))
        for film, pull in zip(pair, (tensions[0], tensions[-1]), strict=True)
    )
    rigid = sum(film.membrane_stiffness for film in pair)
    cost, relief, stiff = _rim_modes(pair)
    cost = cost[:, None] + math.pi * pair[0].pocket * np.asarray(roots) / 2
    pull = rigid * relief
    drive = -(pull @ hoop + cost)
    best = np.where(drive > 0, drive**2 / stiff[:, None], 0.0).argmax(0)
    ripples = []
    for film in films:
        share = film.membrane_stiffness / rigid
        found = cost[best, np.arange(len(best))], pull[best].T, stiff[best]
        ripples.append(Ripple(WAVE_NUMBERS[best] * 1.0, *(share * part for part in found)))
    return ripples


@lru_cache(maxsize=64)
def _rim_modes(pair: tuple[Balloon, Balloon]) -> tuple[Array, Array, Array]:
    """Return, by number of waves: half the bending cost; each element's area times its mean rho;
    and the integral of E rho^2 over both films.
    """
    balloon = pair[0]
    nodes = balloon.nodes[balloon.edge :]
    length = np.diff(nodes)[:, None]
    places, weights = np.polynomial.legendre.leggauss(GAUSS_POINTS)
    r = nodes[:-1, None] + length * (places + 1) / 2
    area = math.tau * r * length * weights / 2
    s, n = r - balloon.pocket, WAVE_NUMBERS[:, None, None]
    around = 1 / r - n**2 * s / r**2
    twist = n * (1 / r - s / r**2)
    plate = bonded_bending_stiffness(pair) / (1 - balloon.poisson**2)
    cost = plate / 4 * (area * (around**2 + 2 * (1 - balloon.poisson) * twist**2)).sum((1, 2))
    rho = (n**2 * s**2 / r**2 - s / r) / 4
    stiff = sum(film.membrane_stiffness for film in pair) * (area * rho**2).sum((1, 2))
    return cost, (area * rho).sum(-1), stiff


def bonded_bending_stiffness(pair: Sequence[Balloon]) -> float:
    """Return the bending stiffness in kPa mm3 of both bonded films, as a strip free to narrow."""
    (e1, t1), (e2, t2) = ((film.modulus, film.thickness) for film in pair)
    mixed = e1 * e2 * t1 * t2 * (4 * t1**2 + 6 * t1 * t2 + 4 * t2**2)
    return (e1**2 * t1**4 + e2**2 * t2**4 + mixed) / (12 * (e1 * t1 + e2 * t2))


def ripple_energy(balloon: Balloon, ripple: Ripple, r: Array) -> tuple[Array, Array, Array]:
    """Return the energy (rows,) of a rippled rim at the radii of a film's nodes (nodes, rows), less
    that of a smooth one: at most 0; and its derivatives by the rim's radii, (nodes, rows) and
    (nodes, nodes, rows).
    """
    rim, middles = r[balloon.edge :], balloon.middles[balloon.edge :, None]
    wide = (rim[1:] + rim[:-1]) / (2 * middles)
    drive = ripple.cost + (strain_measure(balloon, wide * wide) * ripple.pull).sum(0)
    drive = np.maximum(-drive, 0.0)
    # Squared, that of least energy.
    tilt = drive / ripple.stiff
    # By the radius of either node of an element.
    pulled = ripple.pull * wide ** (balloon.order - 1) / (2 * middles)
    steep = np.zeros_like(rim)
    steep[:-1] += pulled
    steep[1:] += pulled
    curves = np.where(drive > 0, -1 / ripple.stiff, 0.0) * steep[:, None] * steep
    bent = tilt * ripple.pull * (balloon.order - 1) * wide ** (balloon.order - 2)
    bent /= (2 * middles) ** 2
    number = np.arange(len(bent))
    for i, j in ((0, 0), (0, 1), (1, 0), (1, 1)):
        curves[number + i, number + j] += bent
    return -drive * tilt / 2, tilt * steep, curves
