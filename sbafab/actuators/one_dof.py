"""The 1-DoF actuator: one chamber, its balloons stacked on one axis (paper Sec. 2)."""

from __future__ import annotations

from typing import Literal, Self

from sbafab.actuators import Family
from sbafab.actuators.fitted_size import Fits, fitted
from sbafab.actuators.stacking import (
    Footprint,
    RoundChamber,
    bonded,
    build_footprint,
    free_of_round,
    pocket_shapes,
    round_pockets,
)
from sbafab.design.records import Design, Form, Free, card, degrees_of_freedom
from sbafab.laminate.laminate import Laminate

AXIS = (0.0, 0.0)


class OneDofDesign(Design):
    """A stack of round balloons on one axis."""

    model_config = card(
        "One stack",
        "M12 20a15 15 0 1 0 30 0 15 15 0 1 0-30 0ZM25 20a2 2 0 1 0 4 0 2 2 0 1 0-4 0Z",
    )

    family: Literal["1dof"]
    """Kind of actuator."""
    chamber: RoundChamber = RoundChamber.model_construct()
    fits: Fits = Fits.model_construct()

    @property
    def form(self) -> Form:
        return Form(degrees_of_freedom(1), 1, round_pockets(self, self.chamber))

    @property
    def free(self) -> tuple[Free, ...]:
        return free_of_round(self.chamber, super().free)

    def fitted(self) -> Self:
        return fitted(self, self.fits, build)


def footprint(design: OneDofDesign) -> Footprint:
    """Return pockets on one axis, with ears in the sector left free by the tab."""
    pockets, shape_of = pocket_shapes(design, design.chamber)
    return Footprint(
        pockets=[[pocket] for pocket in pockets],
        shape_of=shape_of,
        axes=(AXIS,),
        directions=[(1.0, 0.0)],
        edge=bonded(pockets[shape_of[0]], design.bond.width).bounds[2],
        ears=[(AXIS, angle) for angle in (90.0, 210.0, 150.0, 270.0)],
    )


def build(design: OneDofDesign) -> Laminate:
    """Return the laminate of a 1-DoF design. Raises DesignError if parts do not fit."""
    return build_footprint(design, footprint(design))


FAMILY = Family(OneDofDesign, build)
