"""What a CalculiX run is asked to do, and the film it does it with.

Units are mm, N, MPa, t and s; pressures are given in kPa.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from sbafab.errors import DesignError
from sbafab.laminate.films import PAPER_TPE, Film, density_of
from sbafab.laminate.laminate import Laminate
from sbafab.simulators.simulator import Wish, chamber_pressures

Procedure = Literal["dynamic", "static"]

PAPER_PRESSURE = 6.0
"""kPa up to which the paper's model of one balloon is inflated (Fig. 7c)."""


class Elastic(NamedTuple):
    """A film: Young's modulus in MPa, Poisson's ratio, density in t/mm3."""

    modulus: float
    poisson: float
    density: float


TPE = Elastic(*PAPER_TPE, 1.122e-9)
"""As in the paper's model. The density is the film's own where there is a laminate."""


@dataclass(frozen=True)
class DeckSettings:
    """Load and procedure.

    ``pressures`` in kPa by chamber, reached after ``ramp`` seconds and written out ``outputs``
    times on the way. They rise with the square of time, because a flat film gives way at once and
    then ever less. Films start ``imperfection`` mm off flat, or wrinkles would be a bifurcation
    that no Newton iteration gets past; "static" leaves out the inertia that carries a film from
    one pattern of wrinkles to the next, and mostly stops there. ``film`` is TPE, ``others`` are
    further films by material.
    """

    pressures: Mapping[str, float]
    procedure: Procedure = "dynamic"
    ramp: float = 1.0
    outputs: int = 24
    imperfection: float = 0.010
    film: Elastic = TPE
    others: Mapping[str, Elastic] = field(default_factory=dict)

    def times(self) -> list[float]:
        """When results are written, in s, and the start."""
        return [self.ramp * n / self.outputs for n in range(self.outputs + 1)]

    def share(self, time: float) -> float:
        """The part of the pressures that is on at a time; straight between outputs."""
        at = min(max(time / self.ramp, 0.0), 1.0) * self.outputs
        n = min(int(at), self.outputs - 1)
        return (n**2 + (at - n) * (2 * n + 1)) / self.outputs**2

    @property
    def largest(self) -> float:
        """The highest of the pressures in kPa."""
        return max(self.pressures.values())


def deck_settings(
    laminate: Laminate, wish: Wish | None = None, procedure: Procedure = "dynamic"
) -> DeckSettings:
    """Settings for a laminate; pressures as in ``chamber_pressures``, by default the paper's."""
    names = [chamber.name for chamber in laminate.chambers]
    pressures = chamber_pressures(names, wish or Wish(), PAPER_PRESSURE)
    films = {layer.film.material: _elastic(layer.film) for layer in laminate.tpe_layers}
    film = films.pop("TPE", TPE)
    return DeckSettings(pressures, procedure, film=film, others=films)


def _elastic(film: Film) -> Elastic:
    """What a film is like. Raises DesignError where its modulus is not known."""
    if film.elastic is None:
        raise DesignError(
            f"CalculiX needs Young's modulus of {film.material}; add "
            f"films.{film.material.lower()}.modulus, in MPa, and poisson, its ratio"
        )
    return Elastic(*film.elastic, 1e-12 * density_of(film, "CalculiX"))
