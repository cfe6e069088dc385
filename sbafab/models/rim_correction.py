"""Balloons with wide pockets, corrected for films that wave in step with their rim.

``balloon`` lets the rim hinge about the pocket's edge and averages the films' wrinkles. If a pocket
is wide compared with its ring, CalculiX shows film waves in step with the rim's, and an edge that
moves with them: the balloon rises higher. The correction is fitted to 192 free balloons with
resolved waves (docs/prediction.md): pockets of 4 to 17 ring widths in radius, films of 0.027 to
0.27. Lengths mm, pressures kPa, volumes ul, energies uJ.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from sbafab.models.balloon import Shapes, inflate
from sbafab.models.film_elements import Array, Balloon

WIDE = 3.8
"""Pocket radius in ring widths above which films wave with the rim."""
LEAST_STRAIN = 1e-5
"""Film strain, p R / (E t), below which there are no waves."""
LEAST_GRIP = 0.15
"""Least radius of the disc, as a share of the pocket's, by which a balloon would be pulled."""
POWER = 4
"""Power of the height with which waves ease a balloon: free volumes are then those resolved."""


def is_corrected(balloon: Balloon) -> bool:
    """Return True for a wide pocket with equal films of the default law."""
    usual = balloon.wrinkles and not balloon.inextensible and balloon.order == 2
    return usual and balloon.mate is None and balloon.pocket > WIDE * balloon.ring


def waves_of(balloon: Balloon, pressure: Array) -> tuple[Array, Array, Array]:
    """Return what waves do to ``is_corrected`` balloons at pressures (n,) in kPa, above 0: the
    share by which free ones rise higher than those of ``inflate``, and the power of the pressure
    with which it grows; and the force in mN that would pull those of ``inflate`` as high.
    """
    strain = pressure * balloon.pocket / balloon.membrane_stiffness
    rings, thick = balloon.pocket / balloon.ring, balloon.thickness / balloon.ring / 0.05
    late, early = (strain / 0.034) ** 1.75, (0.33 * thick**3 / rings**2 / strain) ** 3
    rise = 0.062 * (rings - WIDE) ** 0.25 / (1 + late) / (1 + early)
    # The pull is within 10 % of that of balloons between plates.
    hard = 0.25 + 2 * max(balloon.neck / balloon.pocket, LEAST_GRIP)
    pull = hard * math.pi * balloon.pocket**2 * pressure * rise
    return rise, 3 * early / (1 + early) - 1.75 * late / (1 + late), pull


def free_shapes(balloon: Balloon, pressure: ArrayLike) -> Shapes:
    """Return free balloons at pressures (kPa)."""
    shapes = inflate(balloon, pressure)
    if not is_corrected(balloon):
        return shapes
    rise, power, pull = waves_of(balloon, shapes.pressure)
    height = shapes.height * (1 + rise)
    # As of ``compressed_shapes`` there; the first third is what the balloon holds as it is pulled.
    work = pull * height * (1 / 3 + power / POWER)
    return shapes._replace(
        height=height,
        volume=shapes.volume + work / shapes.pressure,
        energy=shapes.energy + work - pull * height / POWER,
    )


def compressed_shapes(
    balloon: Balloon, pressure: ArrayLike, height: ArrayLike, tied: bool = False
) -> Shapes:
    """Return balloons between plates at heights (mm), like ``inflate``, with the effect of waves.

    Their energy is lower by

    g = P h^n / (n H^(n - 1))

    and by its tangent above H, where P is the pull that holds a balloon of ``inflate`` at the free
    height H of one with waves. So forces are 0 at H, and equal those without waves for a balloon
    pressed flat. Volumes follow from the powers of the pressure in P, near 1, and in H, near 1/3.
    """
    shapes = inflate(balloon, pressure, height, tied)
    if not is_corrected(balloon):
        return shapes
    p, h = np.broadcast_arrays(shapes.pressure, np.asarray(height, dtype=float))
    p = np.maximum(p, LEAST_STRAIN * balloon.membrane_stiffness / balloon.pocket)
    unique, back = np.unique(p, return_inverse=True)
    rise, power, pull = waves_of(balloon, p)
    top = inflate(balloon, unique).height[back] * (1 + rise)
    low = np.minimum(h / top, 1.0)
    eased = pull * top * (low**POWER / POWER + h / top - low)
    falls = pull * top * (1 / 3 + power * rise / (1 + rise)) * (1 - 1 / POWER) * low**POWER
    more = ((1 + power) * eased - falls) / p
    force = shapes.force + pull * low ** (POWER - 1)
    energy = shapes.energy + shapes.pressure * more - eased
    return shapes._replace(force=force, volume=shapes.volume + more, energy=energy)
