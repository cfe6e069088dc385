"""What a film of revolution feels, element by element: stretching, wrinkling, bending, air.

A film is a chain of nodes r, z (mm), many films at once: arrays have a row a film. Each function
returns an energy (uJ: kPa mm3) a film with its first and second derivatives. Those of elements
are by their four coordinates r, z, r, z.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

STRETCH = np.array([[1, 0, -1, 0], [0, 1, 0, -1], [-1, 0, 1, 0], [0, -1, 0, 1]], dtype=float)
ROOT = 0.645
"""Thicknesses by which a film bends on past the edge of its bond: end correction of Williams (1989)
for a double cantilever beam, isotropic, nu = 0.2.
"""


class Flat(NamedTuple):
    """The flat film: radii of its nodes and thickness in mm, modulus in kPa, Poisson's ratio.

    ``order`` m says which strain the energy is quadratic in: (stretch^m - 1) / m, of the family of
    Seth (1964) and Hill (1968). 0 is Hencky's logarithmic strain, 2 Green's.
    """

    nodes: Array
    thickness: float
    modulus: float
    poisson: float
    order: int = 2

    @property
    def lengths(self) -> Array:
        return np.diff(self.nodes)

    @property
    def middles(self) -> Array:
        return (self.nodes[1:] + self.nodes[:-1]) / 2


class Term(NamedTuple):
    """An energy with its gradient and its matrix of second derivatives."""

    energy: Array
    gradient: Array
    hessian: Array


NOTHING = np.zeros(0)


class Strain(NamedTuple):
    """Strains of the elements along the meridian and round the hoop."""

    meridian: Array
    hoop: Array


WIDEN = np.array([[1, 0, 1, 0], [0, 0, 0, 0], [1, 0, 1, 0], [0, 0, 0, 0]], dtype=float) / 4


def outer(a: Array, b: Array) -> Array:
    """Products of all entries of two rows."""
    return np.asarray(a[..., :, None] * b[..., None, :])


def strain(flat: Flat, r: Array, z: Array) -> Strain:
    """Strains of each element."""
    along, around = _squares(flat, r, z)
    return Strain(_measure(flat, along), _measure(flat, around))


def curvature(flat: Flat, r: Array, z: Array) -> Array:
    """Curvature of the meridian in 1/mm by element: mean of its two ends."""
    slope = np.arctan2(-np.diff(z), np.diff(r))
    lengths = flat.lengths
    bent = np.diff(slope) / ((lengths[1:] + lengths[:-1]) / 2)
    ends = np.concatenate([bent[:, :1], bent, bent[:, -1:]], axis=1)
    return np.asarray((ends[:, 1:] + ends[:, :-1]) / 2)


def _squares(flat: Flat, r: Array, z: Array) -> tuple[Array, Array]:
    """Squared stretches of each element."""
    length = np.diff(r) ** 2 + np.diff(z) ** 2
    return length / flat.lengths**2, ((r[:, 1:] + r[:, :-1]) / (2 * flat.middles)) ** 2


def _measure(flat: Flat, square: Array) -> Array:
    if flat.order == 0:
        return np.asarray(np.log(square) / 2)
    return np.asarray((square ** (flat.order / 2) - 1) / flat.order)


def membrane(flat: Flat, r: Array, z: Array, cap: Array, slopes: bool = True) -> Term:
    """Stretching, by element; where the hoop stress falls to ``-cap`` (kPa) the film wrinkles.

    Plane stress. With logarithmic strains it is Hencky's (1928) law, good for stretches of 0.7 to
    1.3 (Anand, 1979); with Green's it is Saint Venant's and Kirchhoff's. From there on the hoop
    follows at no more than that stress: the relaxed energy of a tension field (Pipkin, 1986), with
    what the wrinkles themselves carry.
    """
    nu, plane = flat.poisson, flat.modulus / (1 - flat.poisson**2)
    e1, e2 = strain(flat, r, z)
    wrinkled = plane * (e2 + nu * e1) < -cap
    # The hoop strain of the film itself, the wrinkles' waste of length left out.
    held = np.where(wrinkled, cap, 0.0)
    own = np.where(wrinkled, -held / plane - nu * e1, e2)
    s1, s2 = plane * (e1 + nu * own), plane * (own + nu * e1)
    density = (s1 * e1 + s2 * own) / 2 + held * (own - e2)
    volume = math.tau * flat.middles * flat.lengths * flat.thickness
    if not slopes:
        return Term((volume * density).sum(-1), NOTHING, NOTHING)
    c11 = np.where(wrinkled, flat.modulus, plane)
    c12, c22 = np.where(wrinkled, 0.0, plane * nu), np.where(wrinkled, 0.0, plane)
    half = flat.order / 2 - 1
    sq1, sq2 = _squares(flat, r, z)
    f1, f2 = sq1**half / 2, sq2**half / 2
    dr, dz, middle = np.diff(r), np.diff(z), (r[:, 1:] + r[:, :-1]) / 2
    none = np.zeros_like(dr)
    d1 = np.stack([-dr, -dz, dr, dz], -1) * (2 / flat.lengths**2)[:, None]
    d2 = np.stack([middle, none, middle, none], -1) / (flat.middles**2)[:, None]
    gradient = volume[:, None] * ((s1 * f1)[..., None] * d1 + (s2 * f2)[..., None] * d2)
    both = outer(d1, d2)
    hessian = volume[:, None, None] * (
        (2 * s1 * f1 / flat.lengths**2)[..., None, None] * STRETCH
        + (2 * s2 * f2 / flat.middles**2)[..., None, None] * WIDEN
        + (c11 * f1 * f1 + s1 * half * f1 / sq1)[..., None, None] * outer(d1, d1)
        + (c12 * f1 * f2)[..., None, None] * (both + np.swapaxes(both, -1, -2))
        + (c22 * f2 * f2 + s2 * half * f2 / sq2)[..., None, None] * outer(d2, d2)
    )
    return Term((volume * density).sum(-1), gradient, hessian)


def bending(
    flat: Flat, rigidity: float, bent: slice, r: Array, z: Array, slopes: bool = True
) -> Term:
    """Bending along the meridian and round the hoop, by coordinate, between clamped edges.

    What lies outside the nodes ``bent`` is bonded face to face with its mirror. It
    does not bend, but gives way at its root as the arms of a double cantilever beam do. The
    second derivatives leave out those of the slopes themselves: enough to descend by.
    """
    dr, dz = np.diff(r), np.diff(z)
    slope = np.arctan2(-dz, dr)
    held, edge = bent.start, bent.stop
    inner, beyond = slice(0, edge), slice(1, edge + 1)
    kink = slope[:, beyond] - slope[:, inner]
    number = np.arange(len(flat.lengths))
    along = np.where((number >= held) & (number < edge), flat.lengths, 2 * ROOT * flat.thickness)
    between = (along[inner] + along[beyond]) / 2
    stiff = math.tau * rigidity * flat.nodes[beyond] / between
    ring = math.tau * rigidity * flat.lengths / flat.middles
    sine, cosine = np.sin(slope), np.cos(slope)
    energy = ((stiff * kink**2).sum(-1) + (ring * sine**2).sum(-1)) / 2
    if not slopes:
        return Term(energy, NOTHING, NOTHING)
    turn = np.stack([-dz, dr, dz, -dr], -1) / (dr**2 + dz**2)[..., None]
    change = np.zeros((*kink.shape, 6))
    change[..., 2:] += turn[:, beyond]
    change[..., :4] -= turn[:, inner]
    count = r.shape[1]
    total = Term(
        energy,
        np.zeros((len(r), 2 * count)),
        np.zeros((len(r), 2 * count, 2 * count)),
    )
    add(total, (stiff * kink)[..., None] * change, stiff[:, None, None] * outer(change, change))
    by_ring = (ring * cosine**2)[..., None, None] * outer(turn, turn)
    add(total, (ring * sine * cosine)[..., None] * turn, by_ring)
    return total


def add(total: Term, gradient: Array, hessian: Array) -> None:
    """Adds to gradient and hessian of the whole film what its elements, in a row, contribute."""
    width = gradient.shape[-1]
    for number in range(gradient.shape[1]):
        at = slice(2 * number, 2 * number + width)
        total.gradient[:, at] += gradient[:, number]
        total.hessian[:, at, at] += hessian[:, number]


def air(flat: Flat, edge: int, r: Array, z: Array, slopes: bool = True) -> Term:
    """Air (ul) between the inner face of a film and the plane of its edge, by element.

    The film's middle starts half a thickness above that plane, and its inner face is smaller: what
    the volume of a thick film is by Steiner's formula.
    """
    r1, r2, drop = r[:, :-1], r[:, 1:], z[:, :-1] - z[:, 1:]
    dr, mean = r2 - r1, (r1 + r2) / 2
    area = math.pi / 3 * (r1 * r1 + r1 * r2 + r2 * r2)
    half = np.where(np.arange(drop.shape[1]) < edge, math.pi * flat.thickness, 0.0)
    length = np.sqrt(dr**2 + drop**2)
    volume = (area * drop - half * mean * length).sum(-1)
    volume = volume + math.pi / 2 * flat.thickness * r[:, edge] ** 2
    if not slopes:
        return Term(volume, NOTHING, NOTHING)
    a, b = math.pi / 3 * (2 * r1 + r2), math.pi / 3 * (2 * r2 + r1)
    gradient = np.stack([a * drop, area, b * drop, -area], -1)
    hessian = np.zeros((*drop.shape, 4, 4))
    hessian[..., 0, 0] = hessian[..., 2, 2] = math.tau / 3 * drop
    hessian[..., 0, 2] = hessian[..., 2, 0] = math.pi / 3 * drop
    for i, j, value in ((0, 1, a), (0, 3, -a), (2, 1, b), (2, 3, -b)):
        hessian[..., i, j] = hessian[..., j, i] = value
    along = np.stack([-dr, drop, dr, -drop], -1) / length[..., None]
    across = np.stack([-drop, -dr, drop, dr], -1) / length[..., None]
    halves = np.broadcast_to(np.array([0.5, 0.0, 0.5, 0.0]), along.shape)
    both = outer(along, halves)
    gradient -= half[:, None] * (mean[..., None] * along + length[..., None] * halves)
    hessian -= half[:, None, None] * (
        both + np.swapaxes(both, -1, -2) + (mean / length)[..., None, None] * outer(across, across)
    )
    gradient[:, edge - 1, 2] += math.pi * flat.thickness * r[:, edge]
    hessian[:, edge - 1, 2, 2] += math.pi * flat.thickness
    return Term(volume, gradient, hessian)
