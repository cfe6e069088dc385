"""Loose sheets in a bag, pressed on each other by a vacuum: laminar jamming.

Until they slip, n sheets of thickness h bend as one of n h: n^2 times as stiff as loose ones. They
first slip where shear is largest, at the middle: 3 F / 2 b n h = mu P of a cantilever. Mechanism
and measurements: Narang, Vlassak and Howe, Adv. Funct. Mater. 28 (2018) 1707136; the formulas are
those of beams. Lengths mm, pressures kPa, moduli MPa, forces N.
"""

from __future__ import annotations

MODEL = "laminar jamming"


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
