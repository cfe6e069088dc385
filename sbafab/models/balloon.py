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
from sbafab.models import rim_ripple
from sbafab.models.film_elements import Flat, Term, add, air, bending, curvature, membrane, strain

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from sbafab.models.film_elements import Array
    from sbafab.models.rim_ripple import Ripple

FILM_ELEMENTS = 24
RIM_ELEMENTS = 5
NECK_ELEMENTS = 2
FARTHEST = 0.7
"""Share of its length by which an element may change in one step."""
MOST_STEPS = 400
ROUNDING = 1e-13
"""Share of the energy that is lost in its own digits."""
HALVINGS = 12
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
        return BalloonLoad(
            self.pressure[these],
            self.half[these],
            self.cap[these],
            self.tied,
            self.ripple.rows(these),
        )


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
        r, z = _settled(balloon, load, *start(balloon, load))
        if balloon.wrinkles and not balloon.inextensible:
            zone = compressed(balloon, r, z)
            for _ in range(ROUNDS):
                (ripple,) = rippling((balloon,), ((r, z),))
                load = load._replace(cap=wrinkling(balloon, r, z, zone), ripple=ripple)
                r, z = _settled(balloon, load, r, z)
    term, force = total(balloon, load, r, z)
    held = air(balloon.film, balloon.edge, r, z).energy
    return Shapes(p, 2 * z[:, 0], 2 * held, force, 2 * (term.energy + p * held), r, z)


def start(balloon: Balloon, load: BalloonLoad) -> tuple[Array, Array]:
    """Bulged films to begin with, as high as their pressure may lift them."""
    flat, free = balloon.nodes, balloon.pocket - balloon.neck
    rise = 0.3 * free * np.cbrt(load.pressure * balloon.pocket / (balloon.modulus * 0.0025))
    rise = np.clip(rise, 0.05 * free, 0.8 * free)
    rise = load.half if load.tied else np.minimum(rise, load.half)
    shape = np.clip(1 - ((flat - balloon.neck) / free) ** 2, 0.0, 1.0)
    shape[: balloon.held + 1] = 1.0
    return np.tile(flat, (len(rise), 1)), rise[:, None] * shape


def total(
    balloon: Balloon, load: BalloonLoad, r: Array, z: Array, slopes: bool = True
) -> tuple[Term, Array]:
    """Energy of films and plates less the work of the air, by coordinate, and the plates' force."""
    film, edge = balloon.film, balloon.edge
    bent = slice(balloon.held, edge)
    total = bending(film, balloon.rigidity, bent, r, z, slopes)
    stretched = membrane(film, r, z, load.cap, slopes)
    eased = rim_ripple.eased(film, edge, load.ripple, r, slopes)
    filled = air(film, edge, r, z, slopes)
    p = load.pressure
    number = np.arange(len(film.nodes))
    stiff = PLATE * p[:, None] * np.where(number < edge, balloon.widths, 0.0)
    over = np.maximum(z - load.half[:, None], 0.0)
    touching = over > 0
    if load.tied:
        holds = number <= balloon.held
        stiff = np.where(holds, PLATE * np.maximum(p, 1.0)[:, None] * balloon.widths, stiff)
        over = np.where(holds, z - load.half[:, None], over)
        touching |= holds
    pressed = stiff * over
    energy = total.energy + stretched.energy + eased.energy - p * filled.energy
    energy = energy + (pressed * over).sum(-1) / 2
    if not slopes:
        return total._replace(energy=energy), pressed.sum(-1)
    add(
        total,
        stretched.gradient - p[:, None, None] * filled.gradient,
        stretched.hessian - p[:, None, None, None] * filled.hessian,
    )
    total.gradient[:] += eased.gradient
    total.hessian[:] += eased.hessian
    heights = np.arange(1, 2 * len(film.nodes), 2)
    total.gradient[:, heights] += pressed
    total.hessian[:, heights, heights] += np.where(touching, stiff, 0.0)
    return total._replace(energy=energy), pressed.sum(-1)


def _settled(balloon: Balloon, load: BalloonLoad, r: Array, z: Array) -> tuple[Array, Array]:
    """The shapes of least energy downhill of these: Newton's method, damped where it climbs.

    Raises DesignError where it does not end.
    """
    freedoms = balloon.freedoms
    r, z, damping = r.copy(), z.copy(), np.zeros(len(r))
    live = np.arange(len(r))
    own = np.ix_(freedoms, freedoms)
    diagonal = np.arange(len(freedoms))
    for _ in range(MOST_STEPS):
        part, at = load.rows(live), (r[live], z[live])
        term, _ = total(balloon, part, *at)
        for height in range(1, balloon.level, 2):
            term.gradient[:, balloon.level] += term.gradient[:, height]
            term.hessian[:, balloon.level] += term.hessian[:, height]
        for height in range(1, balloon.level, 2):
            term.hessian[:, :, balloon.level] += term.hessian[:, :, height]
        gradient = term.gradient[:, freedoms]
        stiffness = term.hessian[:, own[0], own[1]]
        stiffness[:, diagonal, diagonal] += damping[live, None] * np.abs(
            stiffness[:, diagonal, diagonal]
        )
        move = -np.linalg.solve(stiffness, gradient[..., None])[..., 0]
        slope = (move * gradient).sum(-1)
        small = CLOSE * np.maximum(part.pressure, LEAST) * math.pi * balloon.pocket**2
        still = np.abs(gradient).max(-1) <= small
        # Where rounding alone decides whether the energy falls, there is nothing left to gain.
        digits = ROUNDING * (np.abs(term.energy) + part.pressure * balloon.pocket**3)
        still |= (np.abs(slope) <= digits) & (damping[live] == 0.0)
        if still.all():
            return r, z
        ahead = np.zeros_like(term.gradient)
        ahead[:, freedoms] = np.where(still[:, None], 0.0, move)
        ahead[:, 1 : balloon.level : 2] = ahead[:, balloon.level, None]
        share = _downhill(balloon, part, at, ahead, term.energy, slope)
        r[live] += share[:, None] * ahead[:, ::2]
        z[live] += share[:, None] * ahead[:, 1::2]
        damped = np.where(share > 0, damping[live] / 10, np.clip(10 * damping[live], 1e-3, 1e9))
        damping[live] = np.where(damped < 1e-6, 0.0, damped)
        live = live[~still]
    raise DesignError(
        f"a balloon of radius {balloon.pocket:g} mm finds no balance; try another load"
    )


def _downhill(
    balloon: Balloon,
    load: BalloonLoad,
    at: tuple[Array, Array],
    ahead: Array,
    energy: Array,
    slope: Array,
) -> Array:
    """The share of each step that lowers the energy; 0 where none does or it leads uphill."""
    # No element is stretched, turned or shortened by more than its own length: none collapses.
    length = np.hypot(np.diff(at[0]), np.diff(at[1]))
    change = np.hypot(np.diff(ahead[:, ::2]), np.diff(ahead[:, 1::2]))
    share = np.minimum(1.0, FARTHEST / np.maximum((change / length).max(-1), 1e-300))
    share = np.where(slope <= 0, share, 0.0)
    room = 1e-12 * (np.abs(energy) + load.pressure * balloon.pocket**3)
    for _ in range(HALVINGS):
        step = share[:, None] * ahead
        to = at[0] + step[:, ::2], at[1] + step[:, 1::2]
        tried = total(balloon, load, *to, slopes=False)[0].energy
        good = tried <= energy + 1e-4 * share * slope + room
        if good.all():
            return share
        share = np.where(good, share, share / 2)
    return np.where(good, share, 0.0)


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
