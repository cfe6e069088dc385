"""What the models need of a design: its stacks of balloons, and how they stand to each other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from sbafab.actuators.lobed import LobedDesign
from sbafab.actuators.one_dof import OneDofDesign
from sbafab.actuators.pockets import diameters
from sbafab.actuators.radial import RadialDesign
from sbafab.design.records import Design
from sbafab.geometry.edges import Point
from sbafab.laminate.laminate import Laminate
from sbafab.models.figures import Calibration
from sbafab.models.kinematics import Kinematics, full_stroke, round_stack, slot_stack

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

NO_OUTLINE = "no model knows the form of a drawn pocket outline; simulate the design instead"


@dataclass(frozen=True)
class Actuator:
    """A design as the models see it.

    ``stacks`` work side by side, each of ``balloons``; ``radii`` (mm, bottom to top) are those of
    round pockets, empty for oblong ones. ``kinematics`` begins with the model that sets the pace;
    it is empty for drawn outlines. ``full_stroke`` mm is what counts as full actuation.
    ``full_height`` mm is its height then; ``thickness`` mm the flat laminate's, the press factor
    included.
    """

    design: Design
    laminate: Laminate
    balloons: int
    stacks: int
    radii: tuple[float, ...]
    kinematics: tuple[Kinematics, ...]
    full_stroke: float
    full_height: float
    thickness: float

    def lengths(self, stroke: NDArray[np.float64]) -> NDArray[np.float64]:
        """How long a chamber is at a stroke: from the flat thickness to the full height."""
        return self.thickness + stroke * (self.full_height - self.thickness) / self.full_stroke

    @property
    def axes(self) -> list[Point]:
        """Where the chambers of a lobed actuator stand."""
        return [chamber.centres[0] for chamber in self.laminate.chambers]

    @property
    def is_tapered(self) -> bool:
        return len(set(self.radii)) > 1

    def is_like_paper(self, family: type[Design], radius: float) -> bool:
        """Whether the paper measured balloons of this kind."""
        return (
            isinstance(self.design, family)
            and set(self.radii) == {radius}
            and self.stacks == (3 if family is LobedDesign else 1)
        )


def actuator(design: Design, laminate: Laminate, calibration: Calibration) -> Actuator:
    """The actuator of a design of any family."""
    balloons = design.stack.balloons
    stacks = 1
    radii: tuple[float, ...] = ()
    kinematics: tuple[Kinematics, ...] = ()
    full = full_height = 0.0
    thickness = laminate.thickness * calibration.press_factor
    if isinstance(design, RadialDesign):
        stacks = design.chamber.count
        if design.chamber.outline is None:
            sides = (design.chamber.width, design.chamber.length)
            width, length = (side - 2 * design.bond.width for side in sorted(sides))
            kinematics = slot_stack(width, length - width, balloons)
            full = kinematics[0].largest_stroke
            full_height = thickness + full
    elif isinstance(design, LobedDesign | OneDofDesign):
        stacks = design.chamber.count if isinstance(design, LobedDesign) else 1
        if design.chamber.outline is None:
            radii = tuple(d / 2 for d in diameters(design, design.chamber))
            kinematics = round_stack(radii)
            # The paper divides its whole height by its balloons (Sec. 4.6: 1.2 mm each).
            full = full_height = full_stroke(radii)
    return Actuator(
        design, laminate, balloons, stacks, radii, kinematics, full, full_height, thickness
    )
