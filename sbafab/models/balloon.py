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
from sbafab.models import banded, rim_ripple
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
    from sbafab.models.rim_ripple import Ripple

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
    def packing(self) -> banded.Packing:
        """How a band by coordinates becomes one by freedoms."""
        return banded.packing(self.freedoms, 2 * len(self.nodes), 6)

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
    load = BalloonLoad(p, high / 2, cap, tied, rim_ripple.smooth(balloon, len(p)))
    if balloon.mate is not None:
        from sbafab.models import two_films

        return two_films.inflate((replace(balloon, mate=None), balloon.mate), load)
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
    eased = rim_ripple.eased(film, edge, load.ripple, r)
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
        banded.join(found.matrix, height, balloon.level)
    return found


class Energies:
    """A balloon's energies under a load, for ``least_energy``."""

    def __init__(self, balloon: Balloon, load: BalloonLoad) -> None:
        self.balloon, self.load = balloon, load
        self.scale, self.close = sizes(balloon, load)

    def at(self, x: Array, rows: NDArray[np.int_]) -> Descent:
        found = levelled(self.balloon, total(self.balloon, self.load.rows(rows), x))
        band = banded.packed(found.matrix, self.balloon.packing)
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
        found[freedoms] = banded.solve(band, -state.gradient[freedoms])
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
    return rim_ripple.rippling(films, strains[0].hoop[:, films[0].edge :], pulls)
