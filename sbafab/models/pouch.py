"""Pouches of inextensible film: a motor that shortens, a hinge that bends, a beam that pressure
stiffens, and a bag of sheets that a vacuum presses together.

A pouch of length L between two seams of width D fills to two arcs of half angle t that keep their
length. The motor is the model of Niiyama et al., Soft Robotics 2 (2015) 59, doi
10.1089/soro.2014.0023: length L sin t / t, volume D L^2 (t - sin t cos t) / 2 t^2, pull p D L cos t
/ t. The hinge is such a pouch across the joint of two stiff plates: one film lies on them, the
other is an arc over both. Its moment is from our statics of that section: film tension p L / 2t at
the plates' ends, minus the pressure on a plate.

The beam is a tube of film, bent as a cantilever: wrinkles start where the pressure's tension along
the tube is used up, at a moment of pi p r^3 / 2, and it collapses at twice that (Comer and Levy,
AIAA Journal 1 (1963) 1652, doi 10.2514/3.1873). A flat tube of width w opens to r = w / pi.

Sheets in a bag (laminar jamming): until they slip, n sheets of thickness h bend as one of n h, n^2
times as stiff as loose ones. They first slip at the largest shear, at the middle: 3 F / 2 b n h =
mu P of a cantilever. Mechanism and measurements: Narang, Vlassak and Howe, Adv. Funct. Mater. 28
(2018) 1707136; the formulas come from beam theory.

Lengths mm, pressures kPa, moduli MPa, forces N, moments N mm.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from sbafab.models.closed_forms import inverse, last_positive, within
from sbafab.models.film_elements import Array

LARGEST_CONTRACTION = 1 - 2 / math.pi
"""Share of the flat length: both arcs are then half circles."""
SLENDER = 5.0
"""Least ratio of length to diameter for a beam; ours."""
SHALLOW = 1e-4
"""Half angle below which series are exact to 1e-9."""


def contraction(angle: ArrayLike) -> Array:
    """Return the contraction of a pouch, as a fraction of its length, at half angles up to pi/2."""
    t = within(angle, math.pi / 2, "half angle", "rad", "pouch motor")
    safe = np.maximum(t, SHALLOW)
    return np.asarray(np.where(t > SHALLOW, 1 - np.sin(safe) / safe, t**2 / 6))


def half_angle(share: ArrayLike) -> Array:
    """Return the half angle at a contraction (a fraction). Raises DesignError out of range."""
    shares = within(share, LARGEST_CONTRACTION, "contraction", "of its length", "pouch motor")
    return inverse(contraction, shares, math.pi / 2)


def section(angle: ArrayLike) -> Array:
    """Return the area between two arcs of this half angle over half the square of their length."""
    t = np.asarray(angle, dtype=float)
    safe = np.maximum(t, SHALLOW)
    return np.where(t > SHALLOW, (safe - np.sin(safe) * np.cos(safe)) / safe**2, 2 * t / 3)


def volume(share: ArrayLike, length: float, width: float) -> Array:
    """Return the volume in ul at a contraction."""
    return np.asarray(width * length**2 / 2 * section(half_angle(share)))


def pull(pressure: float, share: ArrayLike, length: float, width: float) -> Array:
    """Return the pull in N at contractions above 0; it is unbounded for a flat pouch."""
    t = half_angle(share)
    return np.asarray(pressure / 1000 * width * length * np.cos(t) / t)


def tension(pressure: float, angle: ArrayLike, length: float) -> Array:
    """Return the tension in N/mm of an arc of this length and half angle."""
    return np.asarray(pressure / 1000 * length / (2 * np.asarray(angle, dtype=float)))


# The hinge: plates of half the pouch's length on both sides of the joint.


def bent(angle: ArrayLike) -> Array:
    """Return the bend in rad at which the free film's half angle is ``angle``."""
    return np.asarray(2 * np.arccos(1 - contraction(angle)))


def moment(pressure: float, bend: ArrayLike, length: float, width: float) -> Array:
    """Return the moment in N mm that bends the hinge further, at bends up to the free one."""
    b = within(bend, free_bend(), "bend of a hinge", "rad", "pouch hinge")
    t = half_angle(1 - np.cos(b / 2))
    safe = np.maximum(t, SHALLOW)
    lever = np.where(t > SHALLOW, np.sin(safe + b / 2) / safe, 1 + 1 / math.sqrt(3))
    return np.asarray(pressure / 1000 * width * length**2 / 4 * (lever - 0.5))


@cache
def free_bend() -> float:
    """Return the bend in rad at zero moment: the same for any pouch and pressure."""
    pull = last_positive(lambda t: math.sin(t + float(bent(t)) / 2) - t / 2, 1.0, math.pi / 2)
    return float(bent(pull))


# The beam: a tube of film.


def tube_radius(width: float) -> float:
    """Return the radius in mm to which a flat tube of this width opens."""
    return width / math.pi


def wrinkling_moment(pressure: float, width: float) -> float:
    """Return the moment in N mm at which the inner side goes slack."""
    return math.pi * pressure / 1000 * tube_radius(width) ** 3 / 2


def collapse_moment(pressure: float, width: float) -> float:
    """Return the moment in N mm at which the whole circumference is slack."""
    return 2 * wrinkling_moment(pressure, width)


def hoop_tension(pressure: float, width: float) -> float:
    """Return the tension in N/mm around the tube, twice that along it."""
    return pressure / 1000 * tube_radius(width)


# The bag of sheets.


def loose_stiffness(modulus: float, width: float, thickness: float, sheets: int) -> float:
    """Return the bending stiffness in N mm2 of sheets that slide on each other."""
    return sheets * modulus * width * thickness**3 / 12


def jammed_stiffness(modulus: float, width: float, thickness: float, sheets: int) -> float:
    """Return the bending stiffness in N mm2 of sheets that do not slip."""
    return modulus * width * (sheets * thickness) ** 3 / 12


def slip_force(
    vacuum: float, friction: float, width: float, thickness: float, sheets: int
) -> float:
    """Return the tip force in N at which a cantilever's sheets first slip.

    Exact for an even number of sheets, one of whose joints is the middle; ``vacuum`` in kPa below
    the air outside.
    """
    return 2 / 3 * friction * vacuum / 1000 * width * sheets * thickness
