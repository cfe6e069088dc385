"""Energy of an axisymmetric film by element: membrane stretch, wrinkling, bending, and its air.

A film is a chain of nodes r, z (mm). Many films are computed at once: arrays have a column for
each. Functions return an energy (uJ: kPa mm3) for each film with its first and second derivatives
with respect to the coordinates of an element: the differences of its two nodes in r and z, and
their mean radius. Kinks couple neighbours. ``assembled_gradient`` and ``assembled_tangent`` convert
these into derivatives with respect to the coordinates of nodes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sbafab.laminate.films import PAPER_TPE

Array = NDArray[np.float64]
FILM_ELEMENTS = 24
RIM_ELEMENTS = 5
NECK_ELEMENTS = 2
ROOT_LENGTH = 0.645
"""Thicknesses by which a film bends on past the edge of its bond: end correction of Williams (1989)
for a double cantilever beam, isotropic, nu = 0.2.
"""


@dataclass(frozen=True)
class Balloon:
    """A balloon and its film: radii, width of the ring and thickness in mm, modulus in kPa.

    ``neck`` is the radius bonded to the next balloon, ``bore`` the radius of its hole; both are 0
    for a lone balloon. Without ``wrinkles`` films stay as smooth as in an axisymmetric mesh.
    ``inextensible`` is the limit of a film, rim included, that neither bends nor carries
    compression: the modulus must then be large. ``order`` m selects the strain in which the energy
    is quadratic, (stretch^m - 1) / m: 2 is Saint Venant's and Kirchhoff's law, as in programs for
    linear films; films of higher orders stiffen.
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
    """The second film if the two differ: of the same sizes, and without a mate itself."""

    def stiffened(self, ratio: float) -> Balloon:
        """Return the balloon with the modulus of its films multiplied by ``ratio``."""
        mate = None if self.mate is None else self.mate.stiffened(ratio)
        return replace(self, modulus=ratio * self.modulus, mate=mate)

    @cached_property
    def nodes(self) -> Array:
        """The radii of the flat film's nodes, mm, closer at neck and rim, where it bends."""
        even = np.linspace(0, 1, FILM_ELEMENTS + 1)
        close = (1 - np.cos(math.pi * even)) / 2 if self.neck else np.sin(math.pi / 2 * even)
        film = self.neck + (self.pocket - self.neck) * (0.6 * close + 0.4 * even)
        neck_nodes = np.linspace(self.bore, self.neck, NECK_ELEMENTS + 1)[:-1]
        neck = neck_nodes if self.neck else neck_nodes[:0]
        rim = self.pocket + self.ring * np.linspace(0, 1, RIM_ELEMENTS + 1)[1:] ** 2
        return np.concatenate([neck, film, rim])

    @property
    def neck_edge(self) -> int:
        """The number of the node at the neck's edge; 0, the pole, without a neck."""
        return NECK_ELEMENTS if self.neck else 0

    @property
    def edge(self) -> int:
        """The number of the node at the pocket's edge."""
        return self.neck_edge + FILM_ELEMENTS

    @cached_property
    def lengths(self) -> Array:
        return np.diff(self.nodes)

    @cached_property
    def middles(self) -> Array:
        return np.asarray((self.nodes[1:] + self.nodes[:-1]) / 2)

    @cached_property
    def squares(self) -> tuple[Array, Array, Array]:
        """Squares of the flat elements' lengths and middle radii, mm2, and their volumes in mm3:
        (elements, 1) each.
        """
        volumes = math.tau * self.middles * self.lengths * self.thickness
        return self.lengths[:, None] ** 2, self.middles[:, None] ** 2, volumes[:, None]

    @cached_property
    def node_areas(self) -> Array:
        """The area in mm2 of each node, 0 outside the pocket: (nodes, 1)."""
        areas = math.tau * self.nodes * np.gradient(self.nodes)
        return np.asarray(np.where(np.arange(len(areas)) < self.edge, areas, 0.0)[:, None])

    @property
    def membrane_stiffness(self) -> float:
        """Modulus times thickness, N/m."""
        return self.modulus * self.thickness

    @property
    def bending_stiffness(self) -> float:
        """The bending stiffness B of one film in kPa mm3."""
        if self.inextensible:
            return 0.0
        return self.modulus * self.thickness**3 / (12 * (1 - self.poisson**2))

    @cached_property
    def is_free(self) -> NDArray[np.bool_]:
        """True for the elements between neck and rim."""
        number = np.arange(len(self.nodes) - 1)
        return (number >= self.neck_edge) & (number < self.edge)

    @cached_property
    def may_wrinkle(self) -> NDArray[np.bool_]:
        """True for elements that may wrinkle: in the film, outside neck and rim."""
        beyond = np.arange(len(self.nodes) - 1) >= self.edge
        return (self.is_free & self.wrinkles) | (beyond & self.inextensible)


class Elements(NamedTuple):
    """Deformed elements, (elements, films): from node to node in r and z, middle radius, mm; and
    the square of their length.
    """

    dr: Array
    dz: Array
    middle: Array
    square: Array

    @classmethod
    def of(cls, x: Array) -> Elements:
        """Return the elements between nodes at r and z in turn, (coordinates, films)."""
        r, z = x[0::2], x[1::2]
        dr, dz = r[1:] - r[:-1], z[1:] - z[:-1]
        return cls(dr, dz, (r[1:] + r[:-1]) / 2, dr * dr + dz * dz)


class EnergyTerm(NamedTuple):
    """An energy, (films,), with its derivatives with respect to dr, dz and the middle radius, each
    (elements, films), and second ones: dr dr, dr dz, dz dz, and, if it depends on the radius, dr
    middle, dz middle, middle middle.
    """

    energy: Array
    slopes: list[Array]
    curves: list[Array]


def strain(flat: Balloon, at: Elements) -> tuple[Array, Array]:
    """Return the meridional and the hoop strain of each element."""
    along, around = _squared_stretches(flat, at)
    return strain_measure(flat, along), strain_measure(flat, around)


def _squared_stretches(flat: Balloon, at: Elements) -> tuple[Array, Array]:
    length2, middle2, _ = flat.squares
    return at.square / length2, at.middle * at.middle / middle2


def strain_measure(flat: Balloon, square: Array) -> Array:
    """Return the strain of squared stretches, of the family of Seth (1964) and Hill (1968)."""
    power = square if flat.order == 2 else square ** (flat.order / 2)
    return np.asarray((power - 1) / flat.order)


def curvature(flat: Balloon, at: Elements) -> Array:
    """Return the curvature of the meridian in 1/mm by element: the mean of its two ends."""
    bent = np.diff(np.arctan2(-at.dz, at.dr), axis=0)
    bent /= ((flat.lengths[1:] + flat.lengths[:-1]) / 2)[:, None]
    ends = np.concatenate([bent[:1], bent, bent[-1:]])
    return np.asarray((ends[1:] + ends[:-1]) / 2)


def membrane(flat: Balloon, at: Elements, cap: Array) -> EnergyTerm:
    """Return the membrane energy; where the hoop stress falls to ``-cap`` (kPa) the film wrinkles.

    Plane stress. In a wrinkled element the hoop stress stays at ``-cap``: the relaxed energy of a
    tension field (Pipkin, 1986), with what the wrinkles themselves carry.
    """
    nu, plane = flat.poisson, flat.modulus / (1 - flat.poisson**2)
    sq1, sq2 = _squared_stretches(flat, at)
    e1, e2 = strain_measure(flat, sq1), strain_measure(flat, sq2)
    lateral = nu * e1
    wrinkled = plane * (e2 + lateral) < -cap
    # The hoop strain of the film itself, the wrinkles' waste of length left out.
    support = np.where(wrinkled, cap, 0.0)
    film_hoop = np.where(wrinkled, support / -plane - lateral, e2)
    s1, s2 = plane * (e1 + nu * film_hoop), plane * (film_hoop + lateral)
    length2, middle2, volume = flat.squares
    density = (s1 * e1 + s2 * film_hoop) / 2 + support * (film_hoop - e2)
    c22 = np.where(wrinkled, 0.0, plane)
    # Strains by the squares of stretches, and those by dr, dz and the middle radius.
    by1, by2 = volume / length2, volume / middle2
    g1, g2 = by1 * s1, by2 * s2
    k1, k2 = by1 / length2 * np.where(wrinkled, flat.modulus, plane), by2 / middle2 * c22
    k12 = nu * by1 / middle2 * c22
    if flat.order != 2:
        half = flat.order / 2 - 1
        f1, f2 = sq1**half, sq2**half
        k1 = k1 * f1 * f1 + 2 * half * g1 * f1 / (length2 * sq1)
        k2 = k2 * f2 * f2 + 2 * half * g2 * f2 / (middle2 * sq2)
        g1, g2, k12 = g1 * f1, g2 * f2, k12 * f1 * f2
    dr, dz, middle = at.dr, at.dz, at.middle
    k1_dr, k12_middle = k1 * dr, k12 * middle
    return EnergyTerm(
        (volume * density).sum(0),
        [g1 * dr, g1 * dz, g2 * middle],
        [
            g1 + k1_dr * dr,
            k1_dr * dz,
            g1 + k1 * dz * dz,
            k12_middle * dr,
            k12_middle * dz,
            g2 + k2 * middle * middle,
        ],
    )


def bending(flat: Balloon, at: Elements) -> tuple[EnergyTerm, list[Array]]:
    """Return the bending energy along the meridian and round the hoop between clamped edges; and
    the second derivatives that couple the elements before and after a kink, by dr dr, dr dz, dz dr
    and dz dz of the two, each (kinks, films).

    The elements of neck and rim are bonded face to face with their mirror image: they do not bend,
    but give way at their root as the arms of a double cantilever beam do.
    """
    slope, rigidity, edge = np.arctan2(-at.dz, at.dr), flat.bending_stiffness, flat.edge
    kink = slope[1 : edge + 1] - slope[:edge]
    along = np.where(flat.is_free, flat.lengths, 2 * ROOT_LENGTH * flat.thickness)
    between = (along[:edge] + along[1 : edge + 1]) / 2
    stiff = (math.tau * rigidity * flat.nodes[1 : edge + 1] / between)[:, None]
    ring = (math.tau * rigidity * flat.lengths / flat.middles)[:, None]
    moment = stiff * kink
    # Of the slope: by dr and by dz; and the squares of its sine and cosine.
    a, b = at.dz / at.square, -at.dr / at.square
    sine2, cosine2 = a * at.dz, -b * at.dr
    energy = ((moment * kink).sum(0) + (ring * sine2).sum(0)) / 2
    # The energy by the slope of each element, first and second.
    turn = ring * b * at.dz
    turn[1 : edge + 1] += moment
    turn[:edge] -= moment
    stiffness = ring * (cosine2 - sine2)
    stiffness[1 : edge + 1] += stiff
    stiffness[:edge] += stiff
    stiff_a, stiff_b = stiffness * a, stiffness * b
    twice = 2 * turn * a * b
    curves = [stiff_a * a + twice, stiff_a * b + turn * (b * b - a * a), stiff_b * b - twice]
    before = -stiff * a[:edge], -stiff * b[:edge]
    after = a[1 : edge + 1], b[1 : edge + 1]
    joined = [x * y for x in before for y in after]
    return EnergyTerm(energy, [turn * a, turn * b], curves), joined


def air_volume(flat: Balloon, at: Elements) -> EnergyTerm:
    """Return the air (ul) between the inner face of a film and the plane of its edge.

    The film's mid-surface starts half a thickness above that plane, and its inner face is smaller,
    by Steiner's formula for the volume of a thick film.
    """
    dr, dz, middle = at.dr, at.dz, at.middle
    half = np.where(np.arange(len(dr)) < flat.edge, math.pi * flat.thickness, 0.0)[:, None]
    length = np.sqrt(at.square)
    area = math.pi * middle * middle + math.pi / 12 * dr * dr
    mean = half * middle
    volume = -(area * dz + mean * length).sum(0)
    along_r, along_z = dr / length, dz / length
    pi_dz, twice = math.pi * dz, math.tau * middle
    bend = mean / length
    bend_z = bend * along_z
    by_dr = pi_dz * dr / -6 - mean * along_r
    by_dz = -area - mean * along_z
    by_middle = -twice * dz - half * length
    curves = [
        pi_dz / -6 - bend_z * along_z,
        bend_z * along_r - math.pi / 6 * dr,
        -bend * along_r * along_r,
        -half * along_r,
        -twice - half * along_z,
        -2 * pi_dz,
    ]
    # The disc at the edge, half a thickness high; its radius is middle + dr / 2 of the last one.
    last, disc = flat.edge - 1, math.pi * flat.thickness
    rim = middle[last] + dr[last] / 2
    by_dr[last] += disc / 2 * rim
    by_middle[last] += disc * rim
    for curve, share in ((0, 0.25), (3, 0.5), (5, 1.0)):
        curves[curve][last] += disc * share
    return EnergyTerm(volume + disc / 2 * rim**2, [by_dr, by_dz, by_middle], curves)


def assembled_gradient(slopes: list[Array]) -> Array:
    """The derivatives for the coordinates r, z of each node in turn: (coordinates, films)."""
    by_dr, by_dz, by_middle = slopes
    count, films = by_dr.shape
    by_node = np.zeros((2 * count + 2, films))
    half = by_middle / 2
    by_node[0:-2:2] = half - by_dr
    by_node[2::2] += half + by_dr
    by_node[1:-2:2] = -by_dz
    by_node[3::2] += by_dz
    return by_node


def assembled_tangent(curves: list[Array], joined: list[Array]) -> Array:
    """Return the second derivatives with respect to coordinates, as a band: (coordinates, 6,
    films), in which ``[i, k]`` is the derivative with respect to coordinates i and i + k.
    """
    rr, rz, zz, rm, zm, mm = curves
    count, films = rr.shape
    band = np.zeros((2 * count + 2, 6, films))
    r, z = band[0::2], band[1::2]
    quarter, half = mm / 4, zm / 2
    diagonal = rr + quarter
    r[:-1, 0] = diagonal - rm
    r[1:, 0] += diagonal + rm
    r[:-1, 1] = rz - half
    r[1:, 1] += rz + half
    z[:-1, 0] = zz
    z[1:, 0] += zz
    r[:-1, 2], r[:-1, 3] = quarter - rr, half - rz
    z[:-1, 1], z[:-1, 2] = -rz - half, -zz
    # A kink couples three nodes: the ones before and after it, and its node with each of them.
    c_rr, c_rz, c_zr, c_zz = joined
    before, centre = slice(0, len(c_rr)), slice(1, len(c_rr) + 1)
    for node in (before, centre):
        r[node, 2] += c_rr
        r[node, 3] += c_rz
        z[node, 1] += c_zr
        z[node, 2] += c_zz
    r[before, 4], r[before, 5], z[before, 3], z[before, 4] = -c_rr, -c_rz, -c_zr, -c_zz
    r[centre, 0] -= 2 * c_rr
    r[centre, 1] -= c_rz + c_zr
    z[centre, 0] -= 2 * c_zz
    return band
