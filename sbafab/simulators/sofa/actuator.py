"""What all scenes of one actuator share: its stack, its film, what each chamber is told."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from sbafab.errors import DesignError
from sbafab.laminate.laminate import Laminate
from sbafab.simulators.sofa.coarse import CoarseMesh, coarse_mesh
from sbafab.simulators.sofa.rounds import RoundStack, round_stack

YOUNG = 10_000.0
"""kPa (paper, Sec. 3.2.1)."""
POISSON = 0.2
"""Likewise."""
NODAL_STIFFNESS = 6.56 / 2304 / 0.02**2
"""mN/mm: nodal mass / dt^2 at which the coarse shell was seen to keep still (7.12)."""
PRESSURE = 5.0
"""kPa in each chamber that is told nothing else."""


@dataclass(frozen=True)
class Actuator:
    """A stack of round balloons, and the pressure in kPa of every chamber."""

    stack: RoundStack
    pressures: tuple[tuple[str, float], ...]

    @cached_property
    def mesh(self) -> CoarseMesh:
        """The coarse shell, inflated."""
        return coarse_mesh(self.stack)

    @property
    def membrane(self) -> float:
        """E t of one film in kPa mm = mN/mm."""
        return YOUNG * self.stack.film.thickness

    def bending(self, films: int) -> float:
        """Bending stiffness of so many films bonded, in mN mm."""
        return YOUNG * (films * self.stack.film.thickness) ** 3 / (12 * (1 - POISSON**2))

    @cached_property
    def mass(self) -> float:
        """True mass of the films in kg, tabs left out."""
        return self.mesh.mass(self.stack.film.thickness, self.stack.film.density)

    def scaled_mass(self, dt: float) -> float:
        """Mass in kg that keeps the shell still at a time step in s: artificial."""
        return NODAL_STIFFNESS * len(self.mesh.rest) * dt**2

    @property
    def balloons(self) -> int:
        return len(self.stack.pockets)

    @property
    def size(self) -> float:
        """Mean pocket radius over that of the 5 mm pocket that was measured."""
        return sum(self.stack.pockets) / self.balloons / 2.5

    def told(self, given: Mapping[str, float] | None, default: float) -> dict[str, float]:
        """A value for every chamber. Raises DesignError for chambers that are not there."""
        return checked(self.stack.chambers, given, default)


def actuator(laminate: Laminate, pressures: Mapping[str, float] | None = None) -> Actuator:
    """An actuator under pressure: 5 kPa a chamber, or what is given by chamber in kPa, 0 elsewhere.

    Raises DesignError where the laminate has other than round pockets, or a chamber is unknown.
    """
    stack = round_stack(laminate)
    told = checked(stack.chambers, pressures, PRESSURE)
    return Actuator(stack, tuple(told.items()))


def checked(
    chambers: tuple[str, ...], given: Mapping[str, float] | None, default: float
) -> dict[str, float]:
    """What each chamber is told: the default, or what is given and 0 for the rest."""
    if given is None:
        return dict.fromkeys(chambers, default)
    for name, value in given.items():
        if name not in chambers:
            raise DesignError(
                f"pressure names chamber {name}, which is not there; "
                f"the chambers are {', '.join(chambers)}"
            )
        if not (math.isfinite(value) and value >= 0):
            raise DesignError(
                f"pressure of {name} = {value:g} kPa must be 0 or more; "
                "the scenes have not been tried with vacuum"
            )
    return {name: float(given.get(name, 0.0)) for name in chambers}
