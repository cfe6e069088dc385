"""What all models of one actuator share: its stack, its film, what each chamber is told."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from sbafab.errors import DesignError
from sbafab.laminate.films import density_of
from sbafab.laminate.laminate import Laminate
from sbafab.simulators.coarse.meridian import Start, fullest
from sbafab.simulators.coarse.mesh import SECTORS, CoarseMesh, coarse_mesh
from sbafab.simulators.coarse.rounds import RoundStack, equal_area, round_stack
from sbafab.simulators.simulator import refuse_unknown

PRESSURE = 5.0
"""kPa in each chamber that is told nothing else."""


@dataclass(frozen=True)
class CoarseActuator:
    """A stack of round balloons, the pressure in kPa of every chamber, and how it is meshed.

    A ring has so many ``sectors``; it has the area of its circle if ``is_fair``, else it is
    inscribed in it.
    """

    stack: RoundStack
    pressures: tuple[tuple[str, float], ...]
    sectors: int = SECTORS
    start: Start = fullest
    is_fair: bool = False

    @cached_property
    def mesh(self) -> CoarseMesh:
        """The coarse shell, inflated."""
        return self.mesh_from(self.start)

    def mesh_from(self, start: Start) -> CoarseMesh:
        """The coarse shell, inflated to another start."""
        ringed = equal_area(self.stack, self.sectors) if self.is_fair else self.stack
        return coarse_mesh(ringed, start, self.sectors)

    @property
    def young(self) -> float:
        """Young's modulus of the film in kPa."""
        return 1000 * self.stack.elastic[0]

    @property
    def poisson(self) -> float:
        return self.stack.elastic[1]

    @property
    def membrane(self) -> float:
        """E t of one film in kPa mm = mN/mm."""
        return self.young * self.stack.film.thickness

    def bending(self, films: int) -> float:
        """Bending stiffness of so many films bonded, in mN mm."""
        return self.young * (films * self.stack.film.thickness) ** 3 / (12 * (1 - self.poisson**2))

    @cached_property
    def mass(self) -> float:
        """True mass of the films in kg, tabs left out."""
        return self.mesh.mass(
            self.stack.film.thickness, density_of(self.stack.film, "a simulation")
        )

    @property
    def balloons(self) -> int:
        return len(self.stack.pockets)

    @property
    def size(self) -> float:
        """Mean pocket radius over that of the 5 mm pocket that was measured."""
        return sum(self.stack.pockets) / self.balloons / 2.5

    def volumes(self, given: Mapping[str, float] | None, usual: float) -> dict[str, float]:
        """What every chamber is given, in ul. Raises DesignError for unknown chambers."""
        return checked(self.stack.chambers, given, usual, "volume", "ul")


def actuator(
    laminate: Laminate,
    pressures: Mapping[str, float] | None = None,
    sectors: int = SECTORS,
    start: Start = fullest,
) -> CoarseActuator:
    """An actuator under pressure: 5 kPa a chamber, or what is given by chamber in kPa, 0 elsewhere.

    ``sectors`` nodes make a ring; ``start`` says how far each balloon is inflated. Raises
    DesignError where the laminate has other than round pockets of one film, or a chamber is
    unknown.
    """
    stack = round_stack(laminate)
    told = checked(stack.chambers, pressures, PRESSURE, "pressure", "kPa")
    return CoarseActuator(stack, tuple(told.items()), sectors, start)


def checked(
    chambers: tuple[str, ...],
    given: Mapping[str, float] | None,
    usual: float,
    what: str,
    unit: str,
) -> dict[str, float]:
    """What each chamber is told: the usual, or what is given and 0 for the rest."""
    if given is None:
        return dict.fromkeys(chambers, usual)
    refuse_unknown(chambers, given, what)
    for name, value in given.items():
        if not (math.isfinite(value) and value >= 0):
            raise DesignError(
                f"{what} of {name} = {value:g} {unit} must be 0 or more; vacuum has not been tried"
            )
    return {name: float(given.get(name, 0.0)) for name in chambers}
