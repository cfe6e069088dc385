"""One round balloon as an elastic membrane of revolution: inflated free, or between plates.

Two equal films, bonded round the pocket and, where there are neighbours, at the neck. One film is
computed; the other one mirrors it. A film stretches (plane stress; Saint Venant and Kirchhoff's
law, or Hencky's) and bends. Where its hoop is compressed it wrinkles, and carries what wrinkles of
least energy do:

    N = 2 sqrt(B K)    K = T (pi / L)^2 + E t c^2      (after Cerda and Mahadevan, 2003)

with the bending stiffness B, the tension T along the meridian, the length L of the compressed zone
and the curvature c of the meridian. The rim, two films thick, ripples (``rim_ripple``). Shapes are
those of least energy, found by Newton's method for many pressures and heights at once. Lengths mm,
pressures kPa, volumes ul, forces mN.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.errors import DesignError
from sbafab.laminate.films import PAPER_TPE
from sbafab.models import least_energy
from sbafab.models.film_elements import (
    Elements,
    Flat,
    air,
    bending,
    curvature,
    gradient,
    matrix,
    membrane,
    strain,
)
from sbafab.models.least_energy import Descent, NoBalance, settled

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from sbafab.models.film_elements import Array

FILM_ELEMENTS = 24
RIM_ELEMENTS = 5
NECK_ELEMENTS = 2
CLOSE = 1e-9
"""Force out of balance, as a share of pressure times pocket area, that is none."""
LEAST = 0.01
"""Pressure in kPa that balance is judged by where there is less."""
PLATE = 20_000.0
"""What a plate gives way by: the pressure on the film presses it in by 1 / PLATE mm."""
ROUNDS = 3
"""How often the wrinkles' force is taken from the tension, and the shape from that."""


@dataclass(frozen=True)
class Balloon:
    """A balloon and its film: radii, width of the ring and thickness in mm, modulus in kPa.

    ``neck`` is the radius bonded to the next balloon, ``bore`` that of the hole in it; both 0 for a
    lone balloon. Without ``wrinkles`` films stay as smooth as an axisymmetric mesh keeps them.
    ``inextensible`` is the limit of a film that neither bends nor carries any compression, its rim
    included: the modulus has then to be large. ``order`` is that of the film's law (``Flat``): 2
    for Saint Venant's and Kirchhoff's, which programs for linear films take; 0 for Hencky's.
    """

    pocket: float = 2.5
    ring: float = 0.75
    neck: float = 0.0
    bore: float = 0.0
    thickness: float = 0.038
    modulus: float = 1000 * PAPER_TPE[0]
    poisson: float = PAPER_TPE[1]
    wrinkles: bool = True
    inextensible: bool = False
    order: int = 2
    mate: Balloon | None = None
    """The other film, where it is unlike: of the same sizes, and without a mate."""

    @cached_property
    def nodes(self) -> Array:
        """Radii of the flat film's nodes, closer where it bends sharply: at neck and rim."""
        even = np.linspace(0, 1, FILM_ELEMENTS + 1)
        close = (1 - np.cos(math.pi * even)) / 2 if self.neck else np.sin(math.pi / 2 * even)
        film = self.neck + (self.pocket - self.neck) * (0.6 * close + 0.4 * even)
        held = np.linspace(self.bore, self.neck, NECK_ELEMENTS + 1)[:-1]
        neck = held if self.neck else held[:0]
        rim = self.pocket + self.ring * np.linspace(0, 1, RIM_ELEMENTS + 1)[1:] ** 2
        return np.concatenate([neck, film, rim])

    @property
    def held(self) -> int:
        """Number of the node at the neck's edge; 0, the pole, without a neck."""
        return NECK_ELEMENTS if self.neck else 0

    @property
    def edge(self) -> int:
        """Number of the node at the pocket's edge."""
        return self.held + FILM_ELEMENTS

    @cached_property
    def film(self) -> Flat:
        return Flat(self.nodes, self.thickness, self.modulus, self.poisson, self.order)

    @cached_property
    def widths(self) -> Array:
        """Area in mm2 that belongs to each node."""
        return np.asarray(math.tau * self.nodes * np.gradient(self.nodes))

    @property
    def rigid(self) -> float:
        """Modulus times thickness, N/m: how hard the film resists being stretched."""
        return self.modulus * self.thickness

    @property
    def rigidity(self) -> float:
        """Bending stiffness B of one film in kPa mm3."""
        if self.inextensible:
            return 0.0
        return self.modulus * self.thickness**3 / (12 * (1 - self.poisson**2))

    @cached_property
    def freedoms(self) -> NDArray[np.int_]:
        """Numbers of the coordinates (r, z of each node in turn) that move on their own.

        The neck stays level: its heights follow ``level``. The rim stays in the plane between the
        films, the pole on the axis.
        """
        nodes = range(len(self.nodes))
        found = [2 * node for node in nodes if node or self.bore]
        found += [2 * node + 1 for node in nodes[self.held : self.edge]]
        return np.array(sorted(found))

    @cached_property
    def free(self) -> Array:
        """1 where a coordinate moves on its own, else 0: (coordinates, 1)."""
        found = np.zeros((2 * len(self.nodes), 1))
        found[self.freedoms] = 1.0
        return found

    @cached_property
    def packing(self) -> least_energy.Packing:
        """How a band by coordinates becomes one by freedoms."""
        return least_energy.packing(self.freedoms, 2 * len(self.nodes), 6)

    @property
    def level(self) -> int:
        """Number of the height that the neck's others are equal to."""
        return 2 * self.held + 1

    @cached_property
    def may_wrinkle(self) -> NDArray[np.bool_]:
        """The elements that may: of the films, not of neck and rim."""
        number = np.arange(len(self.nodes) - 1)
        free = (number >= self.held) & (number < self.edge) & self.wrinkles
        return free | ((number >= self.edge) & self.inextensible)


class Shapes(NamedTuple):
    """Balloons in balance, a row each.

    ``pressure`` in kPa; ``height`` that the whole balloon has risen by, its stroke, in mm;
    ``volume`` of its air in ul; ``force`` on the plate at either end in mN; ``energy`` stored in
    its films in uJ; ``r`` and ``z`` of the nodes of one film, above those of a flat one, in mm.
    """

    pressure: Array
    height: Array
    volume: Array
    force: Array
    energy: Array
    r: Array
    z: Array


class BalloonLoad(NamedTuple):
    """Pressure, half the height between the plates, the stress that wrinkles carry, and how the
    rim ripples.
    """

    pressure: Array
    half: Array
    cap: Array
    tied: bool
    ripple: Ripple

    def rows(self, these: NDArray[np.int_]) -> BalloonLoad:
        pressure, half, cap = self.pressure[these], self.half[these], self.cap[these]
        return BalloonLoad(pressure, half, cap, self.tied, self.ripple.rows(these))


def inflate(
    balloon: Balloon, pressure: ArrayLike, height: ArrayLike | None = None, tied: bool = False
) -> Shapes:
    """The shapes at pressures (kPa), free or between plates at heights (mm).

    A free balloon with a bore is pulled on by the air in it, as one in a stack is. With ``tied``
    the plates hold its necks, and pull where they stand higher than it would rise; the force is
    then below 0. Raises DesignError for pressures or heights that are not above 0 (a tied one may
    have no pressure), or where no balance is found.
    """
    p = np.atleast_1d(np.asarray(pressure, dtype=float))
    high = math.inf if height is None else np.asarray(height, dtype=float)
    p, high = np.broadcast_arrays(p, high)
    if not (((p > 0) | (tied & (p == 0))) & np.isfinite(p) & (high > 0)).all():
        raise DesignError("pressure and height of a balloon must be above 0 kPa and 0 mm")
    elements = len(balloon.nodes) - 1
    smooth = np.where(balloon.may_wrinkle & balloon.inextensible, 0.0, math.inf)
    cap = np.broadcast_to(smooth, (len(p), elements))
    load = BalloonLoad(p, high / 2, cap, tied, smooth_rim(balloon, len(p)))
    if balloon.mate is not None:
        return inflate_two_films((replace(balloon, mate=None), balloon.mate), load)
    # Where no balance is found, elements may shrink to nothing on the way; that is said in the end.
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        x = _settled(balloon, load, coordinates(*start(balloon, load)))
        if balloon.wrinkles and not balloon.inextensible:
            zone = compressed(balloon, *places(x))
            for _ in range(ROUNDS):
                (ripple,) = rippling((balloon,), (places(x),))
                load = load._replace(cap=wrinkling(balloon, *places(x), zone), ripple=ripple)
                x = _settled(balloon, load, x)
    r, z = (np.ascontiguousarray(part) for part in places(x))
    found = total(balloon, load, x)
    held = air(balloon.film, balloon.edge, Elements.of(r, z)).energy
    return Shapes(p, 2 * z[:, 0], 2 * held, found.force, 2 * (found.energy + p * held), r, z)


def start(balloon: Balloon, load: BalloonLoad) -> tuple[Array, Array]:
    """Bulged films to begin with, as high as their pressure may lift them."""
    flat, free = balloon.nodes, balloon.pocket - balloon.neck
    rise = 0.3 * free * np.cbrt(load.pressure * balloon.pocket / (balloon.modulus * 0.0025))
    if balloon.rigidity > 0:
        # A thick film rises as a plate that is clamped all round: by less.
        plate = load.pressure * free**4 / ((384 if balloon.neck else 64) * balloon.rigidity)
        rise = np.minimum(rise, plate)
    rise = np.clip(rise, 0.05 * free, 0.8 * free)
    rise = np.maximum(rise, load.half) if load.tied else rise
    shape = np.clip(1 - ((flat - balloon.neck) / free) ** 2, 0.0, 1.0)
    shape[: balloon.held + 1] = 1.0
    return np.tile(flat, (len(rise), 1)), np.minimum(
        rise[:, None] * shape, load.half[:, None] + 1 / PLATE
    )


class Total(NamedTuple):
    """Energy (rows,) of a film and plates less the work of the air, its derivatives by coordinate,
    (coordinates, rows) and as a band (coordinates, 6, rows), without what ripples join: that is by
    the radii of the rim's nodes (nodes, nodes, rows). And the plates' force, (rows,).
    """

    energy: Array
    gradient: Array
    matrix: Array
    rim: Array
    force: Array


def coordinates(r: Array, z: Array) -> Array:
    """Coordinates r, z of each node in turn: (coordinates, rows)."""
    return np.stack([r.T, z.T], 1).reshape(-1, len(r))


def places(x: Array) -> tuple[Array, Array]:
    """The radii and heights of the nodes, a row a film."""
    return x[0::2].T, x[1::2].T


def total(balloon: Balloon, load: BalloonLoad, x: Array) -> Total:
    """The energy at coordinates."""
    film, edge = balloon.film, balloon.edge
    r, z = places(x)
    lie = Elements.of(r, z)
    p = load.pressure
    bent = bending(film, balloon.rigidity, slice(balloon.held, edge), lie)
    stretched, filled = membrane(film, lie, load.cap), air(film, edge, lie)
    eased = eased_by_ripple(film, edge, load.ripple, r)
    slopes, curves = (
        [a + b - p[:, None] * c for a, b, c in zip(*parts, strict=True)]
        for parts in (
            (bent.term.slopes, stretched.slopes, filled.slopes),
            (bent.term.curves, stretched.curves, filled.curves),
        )
    )
    number = np.arange(len(film.nodes))
    stiff = PLATE * p[:, None] * np.where(number < edge, balloon.widths, 0.0)
    over = np.maximum(z - load.half[:, None], 0.0)
    touches = over > 0
    if load.tied:
        holds = number <= balloon.held
        stiff = np.where(holds, PLATE * np.maximum(p, 1.0)[:, None] * balloon.widths, stiff)
        over = np.where(holds, z - load.half[:, None], over)
        touches |= holds
    pressed = stiff * over
    energy = bent.term.energy + stretched.energy + eased.energy
    energy = energy - p * filled.energy + (pressed * over).sum(-1) / 2
    by_place, band = gradient(slopes), matrix(curves, bent.joined)
    by_place[1::2] += pressed.T
    by_place[2 * edge :: 2] += eased.slopes
    band[1::2, 0] += np.where(touches, stiff, 0.0).T
    return Total(energy, by_place, band, eased.curves, pressed.sum(-1))


def levelled(balloon: Balloon, found: Total) -> Total:
    """The same with the heights of the neck taken for one, at ``level``."""
    for height in range(1, balloon.level, 2):
        found.gradient[balloon.level] += found.gradient[height]
        least_energy.join(found.matrix, height, balloon.level)
    return found


class Energies:
    """A balloon's energies under a load, for ``least_energy``."""

    def __init__(self, balloon: Balloon, load: BalloonLoad) -> None:
        self.balloon, self.load = balloon, load
        self.scale, self.close = sizes(balloon, load)

    def at(self, x: Array, rows: NDArray[np.int_]) -> Descent:
        found = levelled(self.balloon, total(self.balloon, self.load.rows(rows), x))
        band = least_energy.packed(found.matrix, self.balloon.packing)
        # The rim's radii are the last freedoms, next to each other.
        ends = len(found.rim)
        for k in range(ends):
            number = np.arange(ends - k)
            band[len(band) - ends + number, k] += found.rim[number, number + k]
        return Descent(found.energy, found.gradient * self.balloon.free, band)

    def ahead(self, state: Descent, damping: Array) -> Array:
        band = state.matrix.copy()
        band[:, 0] += damping * np.abs(band[:, 0])
        freedoms = self.balloon.freedoms
        found = np.zeros_like(state.gradient)
        found[freedoms] = least_energy.solve(band, -state.gradient[freedoms])
        found[1 : self.balloon.level : 2] = found[self.balloon.level]
        return found

    def change(self, x: Array, ahead: Array) -> Array:
        return change(x, ahead)


def sizes(balloon: Balloon, load: BalloonLoad) -> tuple[Array, Array]:
    """An energy of the size of each balloon's, uJ, and the force in mN that counts as none."""
    force = CLOSE * np.maximum(load.pressure, LEAST) * math.pi * balloon.pocket**2
    return load.pressure * balloon.pocket**3, force


def change(x: Array, ahead: Array) -> Array:
    """The largest share of its length by which a step changes an element: (rows,)."""
    length, by = (np.hypot(np.diff(y[0::2], axis=0), np.diff(y[1::2], axis=0)) for y in (x, ahead))
    return np.asarray((by / length).max(0))


def _settled(balloon: Balloon, load: BalloonLoad, x: Array) -> Array:
    """The shapes of least energy downhill of these. Raises DesignError where none is found."""
    try:
        return settled(Energies(balloon, load), x)
    except NoBalance:
        raise DesignError(
            f"a balloon of radius {balloon.pocket:g} mm finds no balance; try another load"
        ) from None


def compressed(balloon: Balloon, r: Array, z: Array) -> Array:
    """Length in mm along the film, neck and rim apart, over which the smooth hoop is compressed."""
    strains = strain(balloon.film, r, z)
    is_film = balloon.may_wrinkle & (not balloon.inextensible)
    pressed = (strains.hoop + balloon.poisson * strains.meridian < 0) & is_film
    shortest = balloon.film.lengths.min()
    return np.asarray(np.maximum((pressed * balloon.film.lengths).sum(-1), shortest))


def wrinkling(balloon: Balloon, r: Array, z: Array, zone: Array) -> Array:
    """The hoop stress in kPa that wrinkles over a zone carry, for each element's tension."""
    film = balloon.film
    tension = balloon.rigid * strain(film, r, z).meridian
    # A wrinkle of a curved film stretches the meridian: many short ones cost least.
    held = np.maximum(tension, 0.0) * (math.pi / zone[:, None]) ** 2
    held = held + balloon.rigid * curvature(film, r, z) ** 2
    force = 2 * np.sqrt(balloon.rigidity * held)
    carried: Array = np.full_like(force, math.inf)
    carried[:, balloon.may_wrinkle] = force[:, balloon.may_wrinkle] / balloon.thickness
    return carried


def rippling(films: Sequence[Balloon], shapes: Sequence[tuple[Array, Array]]) -> list[Ripple]:
    """How the rim ripples at the shapes of its one film, which another mirrors, or of both."""
    strains = [strain(one.film, *shape) for one, shape in zip(films, shapes, strict=True)]
    pulls = [
        one.rigid * found.meridian[:, one.edge - 1]
        for one, found in zip(films, strains, strict=True)
    ]
    return rim_ripples(films, strains[0].hoop[:, films[0].edge :], pulls)


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
# least energy has a closed form, and what is left is quadratic in e. The number of waves is the
# one of least energy. Nothing is fitted. Lengths mm, pressures kPa, energies uJ.


WAVES = np.arange(2, 201)
"""Numbers of waves round the rim that are looked at."""
POINTS = 5
"""Points of Gauss an element."""


class Ripple(NamedTuple):
    """Ripples that one film of each balloon would make, a row a balloon.

    ``waves`` round the rim; ``cost`` is K / 2, infinite where none are made; ``relief`` the rho
    of the rim's elements, ``pull`` each one's volume times modulus times rho, and ``stiff`` the
    integral of E rho^2.
    """

    waves: Array
    cost: Array
    relief: Array
    pull: Array
    stiff: Array

    def rows(self, these: NDArray[np.int_]) -> Ripple:
        return Ripple(*(part[these] for part in self))


def smooth_rim(balloon: Balloon, count: int) -> Ripple:
    """Rims that do not ripple."""
    elements = np.zeros((count, len(balloon.nodes) - 1 - balloon.edge))
    none = np.full(count, math.inf)
    return Ripple(np.zeros(count), none, elements, elements, np.ones(count))


def rim_ripples(films: Sequence[Balloon], hoop: Array, tensions: Sequence[Array]) -> list[Ripple]:
    """The ripples of least energy at the rim's hoop strains (rows, elements), for each film its
    share; ``tensions`` in N/m are those of the films at the pocket's edge, one row each.

    One film stands for two alike.
    """
    pair = films if len(films) == 2 else (films[0], films[0])
    pulls = tensions if len(films) == 2 else (tensions[0], tensions[0])
    roots = sum(
        np.sqrt(one.rigidity * np.maximum(pull, 0.0)) for one, pull in zip(pair, pulls, strict=True)
    )
    rigid = sum(one.rigid for one in pair)
    cost, relief, weight, stiff = _modes(pair)
    cost = cost + math.pi * pair[0].pocket * np.asarray(roots)[:, None] / 2
    pull = rigid * weight * relief
    drive = -(hoop @ pull.T + cost)
    gain = np.where(drive > 0, drive**2 / stiff, 0.0)
    best = gain.argmax(-1)
    row = np.arange(len(hoop))
    found = []
    for one in films:
        share = one.rigid / rigid
        found.append(
            Ripple(
                WAVES[best].astype(float),
                share * cost[row, best],
                relief[best],
                share * pull[best],
                share * stiff[best],
            )
        )
    return found


def _modes(pair: Sequence[Balloon]) -> tuple[Array, Array, Array, Array]:
    """By number of waves: half the cost of bending; rho of each element, and area (elements,); and
    the integral of E rho^2 over both films.
    """
    one = pair[0]
    nodes = one.nodes[one.edge :]
    places, weights = np.polynomial.legendre.leggauss(POINTS)
    length = np.diff(nodes)
    r = nodes[:-1, None] + length[:, None] * (places + 1) / 2
    area = math.tau * r * length[:, None] * weights / 2
    s, n = r - one.pocket, WAVES[:, None, None]
    around = 1 / r - n**2 * s / r**2
    twist = n * (1 / r - s / r**2)
    plate = both_bend(pair) / (1 - one.poisson**2)
    cost = plate / 4 * (area * (around**2 + 2 * (1 - one.poisson) * twist**2)).sum((1, 2))
    rho = (n**2 * s**2 / r**2 - s / r) / 4
    size = area.sum(-1)
    stiff = sum(film.rigid for film in pair) * (area * rho**2).sum((1, 2))
    return cost, (area * rho).sum(-1) / size, size, stiff


def both_bend(pair: Sequence[Balloon]) -> float:
    """Bending stiffness in kPa mm3 of both films bonded, a strip that is free to narrow."""
    (e1, t1), (e2, t2) = ((one.modulus, one.thickness) for one in pair)
    mixed = e1 * e2 * t1 * t2 * (4 * t1**2 + 6 * t1 * t2 + 4 * t2**2)
    return (e1**2 * t1**4 + e2**2 * t2**4 + mixed) / (12 * (e1 * t1 + e2 * t2))


def amplitude(flat: Flat, edge: int, ripple: Ripple, r: Array) -> Array:
    """The squared tilt a^2 of least energy, a row a balloon."""
    return np.asarray(_drive(_hoop(flat, edge, r), ripple) / ripple.stiff)


class Eased(NamedTuple):
    """An energy (rows,) with its derivatives by the radii of the rim's nodes: (nodes, rows) and
    (nodes, nodes, rows).
    """

    energy: Array
    slopes: Array
    curves: Array


def eased_by_ripple(flat: Flat, edge: int, ripple: Ripple, r: Array) -> Eased:
    """What ripples take off the energy of a smooth rim."""
    drive = _drive(_hoop(flat, edge, r), ripple)
    middles = flat.middles[edge:]
    wide = (r[:, edge + 1 :] + r[:, edge:-1]) / (2 * middles)
    # Slopes of the hoop strain by the radius of either node, and what they change by.
    first = wide ** (flat.order - 1) / (2 * middles)
    second = (flat.order - 1) * wide ** (flat.order - 2) / (2 * middles) ** 2
    tilt = drive / ripple.stiff
    pulled = (ripple.pull * first).T
    steep = np.zeros((len(pulled) + 1, len(r)))
    steep[:-1] += pulled
    steep[1:] += pulled
    curves = np.where(drive > 0, -1 / ripple.stiff, 0.0) * steep[:, None] * steep
    bent = (tilt[:, None] * ripple.pull * second).T
    number = np.arange(len(bent))
    for i in (0, 1):
        for j in (0, 1):
            curves[number + i, number + j] += bent
    return Eased(-drive * tilt / 2, tilt * steep, curves)


def _hoop(flat: Flat, edge: int, r: Array) -> Array:
    return strain(flat, r, np.zeros_like(r)).hoop[:, edge:]


def _drive(hoop: Array, ripple: Ripple) -> Array:
    """By how much the hoop's compression outdoes the ripples' cost; 0 where it does not."""
    return np.asarray(np.maximum(-(ripple.cost + (hoop * ripple.pull).sum(-1)), 0.0))


# A balloon whose two films are unlike: each with its thickness and modulus, bonded at one rim.
#
# Both films of ``models.balloon`` at once. They share the rim, which moves to where both pull alike
# and tilts as they wring it: as a ring whose section turns. Units as there.


REACH = 5
"""Coordinates further on that one is joined with."""
TwoFilms = tuple["Balloon", "Balloon"]
Loads = tuple["BalloonLoad", "BalloonLoad"]


def inflate_two_films(films: TwoFilms, load: BalloonLoad) -> Shapes:
    """The shapes under a load; ``r`` and ``z`` are those of the film that stretches more easily.

    Raises DesignError where no balance is found.
    """
    loads = (load, load)
    basis = _basis(films[0], is_free=bool(np.isinf(load.half).any()))
    begin = [coordinates(*start(one, load)) for one in films]
    y = np.asarray(np.linalg.pinv(basis) @ np.concatenate(begin), dtype=float)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        y = _two_films_settled(films, loads, basis, y)
        if films[0].wrinkles:
            zones = [
                compressed(one, *places(part))
                for one, part in zip(films, np.split(basis @ y, 2), strict=True)
            ]
            for _ in range(ROUNDS):
                shapes = [places(part) for part in np.split(basis @ y, 2)]
                ripples = rippling(films, shapes)
                loads = tuple(
                    load._replace(cap=wrinkling(one, *shape, zone), ripple=ripple)
                    for one, shape, zone, ripple in zip(films, shapes, zones, ripples, strict=True)
                )  # type: ignore[assignment]
                y = _two_films_settled(films, loads, basis, y)
    x = basis @ y
    energy = (_wringing(films) @ x) ** 2 / 2
    volume, force = np.zeros_like(energy), np.zeros_like(energy)
    shapes = []
    for one, own, part in zip(films, loads, np.split(x, 2), strict=True):
        r, z = (np.ascontiguousarray(each) for each in places(part))
        found = total(one, own, part)
        held = air(one.film, one.edge, Elements.of(r, z)).energy
        energy, volume = energy + found.energy + load.pressure * held, volume + held
        force = force + found.force / 2
        shapes.append((r, z))
    height = shapes[0][1][:, 0] + shapes[1][1][:, 0]
    softer = shapes[int(films[1].rigid < films[0].rigid)]
    return Shapes(load.pressure, height, volume, force, energy, *softer)


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


def _two_films_settled(films: TwoFilms, loads: Loads, basis: Array, y: Array) -> Array:
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
        self.scale, self.close = sizes(films[0], loads[0])
        own = _own(films[0])
        self.packing = least_energy.packing(own, len(basis) // 2, REACH + 1)
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
            found = total(one, load.rows(rows), part)
            energy = energy + found.energy
            slopes += basis.T @ found.gradient
            levelled(one, found)
            own.append(least_energy.packed(found.matrix, self.packing))
            # The rim, and what is near enough to be joined with it.
            edge = 2 * one.edge
            end, moved = least_energy.dense(found.matrix[edge - REACH :]), basis[edge:, first:]
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
        alone = least_energy.solve(band, wanted)
        passed = np.einsum("iar,ibr->rab", matrix.between, alone[-REACH:])
        passed = passed[:rows] + passed[rows:]
        left = -state.gradient[first:].T - passed[..., -1]
        found = np.linalg.solve(shared - passed[..., :-1], left[..., None])[..., 0].T
        own = alone[:, -1] - (alone[:, :-1] * np.tile(found, 2)).sum(1)
        return np.concatenate([own[:, :rows], own[:, rows:], found])

    def change(self, x: Array, ahead: Array) -> Array:
        parts = zip(np.split(self.basis @ x, 2), np.split(self.basis @ ahead, 2), strict=True)
        return np.asarray(np.max([change(*part) for part in parts], axis=0))


def _firmer(diagonal: Array, damping: Array) -> Array:
    """What is added to a diagonal (n, rows). Slack films without pressure may be held by nothing:
    rounding's share of the rest is added then.
    """
    size = np.abs(diagonal)
    return np.asarray(damping * size + 1e-15 * size.max(0))
