"""What all models of one actuator share: its stack, its film, what each chamber is told."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from sbafab.errors import DesignError
from sbafab.laminate.laminate import Laminate
from sbafab.simulators.coarse.mesh import SECTORS, CoarseMesh, coarse_mesh
from sbafab.simulators.coarse.rounds import RoundStack, round_stack
from sbafab.simulators.simulator import refuse_unknown

YOUNG = 10_000.0
"""kPa (paper, Sec. 3.2.1)."""
POISSON = 0.2
"""Likewise."""
PRESSURE = 5.0
"""kPa in each chamber that is told nothing else."""


@dataclass(frozen=True)
class CoarseActuator:
    """A stack of round balloons, and the pressure in kPa of every chamber."""

    stack: RoundStack
    pressures: tuple[tuple[str, float], ...]
    sectors: int = SECTORS

    @cached_property
    def mesh(self) -> CoarseMesh:
        """The coarse shell, inflated."""
        return coarse_mesh(self.stack, sectors=self.sectors)

    @property
    def young(self) -> float:
        """Young's modulus of the film, kPa; the paper's TPE unless the film says its own."""
        elastic = self.stack.film.elastic
        return YOUNG if elastic is None else 1000 * elastic[0]

    @property
    def poisson(self) -> float:
        """Poisson's ratio of the film."""
        elastic = self.stack.film.elastic
        return POISSON if elastic is None else elastic[1]

    @property
    def membrane(self) -> float:
        """E t of one film in kPa mm = mN/mm."""
        return self.young * self.stack.film.thickness

    def bending(self, films: int) -> float:
        """Bending stiffness of so many films bonded, in mN mm."""
        thick = films * self.stack.film.thickness
        return self.young * thick**3 / (12 * (1 - self.poisson**2))

    @cached_property
    def mass(self) -> float:
        """True mass of the films in kg, tabs left out."""
        return self.mesh.mass(self.stack.film.thickness, self.stack.film.density)

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
    laminate: Laminate, pressures: Mapping[str, float] | None = None, sectors: int = SECTORS
) -> CoarseActuator:
    """An actuator under pressure: 5 kPa a chamber, or what is given by chamber in kPa, 0 elsewhere.

    ``sectors`` nodes make a ring. Raises DesignError where the laminate has other than round
    pockets, or a chamber is unknown.
    """
    stack = round_stack(laminate)
    told = checked(stack.chambers, pressures, PRESSURE, "pressure", "kPa")
    return CoarseActuator(stack, tuple(told.items()), sectors)


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
