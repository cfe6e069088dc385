"""The bonded rim of a balloon, which buckles out of its plane where its hoop is compressed.

The films, pulled tight, hold the pocket's edge; the rim tilts about it by a cos(n turn), a in rad.
At s from that edge a ripple takes up the hoop strain

    a^2 rho,    rho = (n^2 s^2 / r^2 - s / r) / 4

the first part for the waves' length, the second for the tilt, which draws the hoop inward. It costs

    a^2 K / 2,    K = pi int D ((1/r - n^2 s / r^2)^2 + 2 (1 - nu) n^2 (1/r - s/r^2)^2) r ds
                      + pi R sum sqrt(B T)

the rim's bending and twisting (plate of both films, Kirchhoff), and the films' roots: a long film
of bending stiffness B under the tension T is turned at its end against sqrt(B T). With the rim's
hoop strain e the energy is a^2 K / 2 + int E (e + a^2 rho)^2 / 2, so that the amplitude of least
energy has a closed form, and what is left is quadratic in e. The number of waves is the one of
least energy. Nothing is fitted. Lengths mm, pressures kPa, energies uJ.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.models.film_elements import strain

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from sbafab.models.balloon import Balloon
    from sbafab.models.film_elements import Array, Flat

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


def smooth(balloon: Balloon, count: int) -> Ripple:
    """Rims that do not ripple."""
    elements = np.zeros((count, len(balloon.nodes) - 1 - balloon.edge))
    none = np.full(count, math.inf)
    return Ripple(np.zeros(count), none, elements, elements, np.ones(count))


def rippling(films: Sequence[Balloon], hoop: Array, tensions: Sequence[Array]) -> list[Ripple]:
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


def eased(flat: Flat, edge: int, ripple: Ripple, r: Array) -> Eased:
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
