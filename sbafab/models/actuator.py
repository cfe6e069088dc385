"""What the models need of a design: its stacks of balloons, and how they stand to each other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from sbafab.design.form import Discs, Form, Slots
from sbafab.design.records import Design
from sbafab.geometry.edges import Point
from sbafab.laminate.films import PAPER_PRODUCT, PAPER_THICKNESS, PAPER_TPE, film_name
from sbafab.laminate.laminate import Laminate
from sbafab.models.figures import Factors
from sbafab.models.kinematics import Kinematics, full_stroke, round_stack, slot_stack

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

NOT_MEASURED = (
    f"the paper measured it with its own film, {film_name(PAPER_PRODUCT, PAPER_THICKNESS)} of "
    f"{PAPER_TPE[0]:g} MPa, and no model predicts it for another: take the free stroke at a "
    "pressure, or simulate the design"
)
NO_OUTLINE = "no model knows the form of a drawn pocket outline; simulate the design instead"
"""Of a search, which compares designs by figures without bounds."""


@dataclass(frozen=True)
class Actuator:
    """A design as the models see it.

    Stacks work side by side, each of ``balloons``; ``radii`` (mm, bottom to top) are those of
    round pockets, empty for oblong ones. ``kinematics`` begins with the model that sets the pace;
    it is empty for drawn outlines. ``full_stroke`` mm is what counts as full actuation.
    ``full_height`` mm is its height then; ``thickness`` mm the flat laminate's, the press factor
    included.
    """

    design: Design
    form: Form
    laminate: Laminate
    balloons: int
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

    @property
    def has_the_papers_film(self) -> bool:
        """Whether what the paper measured of its film's actuators holds for this one's."""
        return all(layer.film.is_the_papers for layer in self.laminate.tpe_layers)

    @property
    def knows_full(self) -> bool:
        """Whether full stroke and full height are known: of round pockets they were measured."""
        return not self.radii or self.has_the_papers_film

    def is_like_paper(self, stacks: int, radius: float) -> bool:
        """Whether the paper measured so many stacks of such balloons on common plates: its 1-DoF
        actuators have one, its 3-DoF actuator three.
        """
        return (
            self.has_the_papers_film
            and self.form.wrap is None
            and self.form.stacks == stacks
            and set(self.radii) == {radius}
        )


def actuator(
    design: Design, laminate: Laminate, calibration: Factors, form: Form | None = None
) -> Actuator:
    """The actuator of a design of any family; ``form`` in place of its own, where one is given."""
    balloons, form = design.stack.balloons, form or design.form
    radii: tuple[float, ...] = ()
    kinematics: tuple[Kinematics, ...] = ()
    full = full_height = 0.0
    thickness = laminate.thickness * calibration.press_factor
    if isinstance(form.pockets, Slots):
        kinematics = slot_stack(form.pockets.width, form.pockets.run, balloons)
        full = kinematics[0].largest_stroke
        full_height = thickness + full
    elif isinstance(form.pockets, Discs):
        radii = tuple(d / 2 for d in form.pockets.diameters)
        kinematics = round_stack(radii)
        # The paper divides its whole height by its balloons (Sec. 4.6: 1.2 mm each).
        full = full_height = full_stroke(radii)
    return Actuator(
        design, form, laminate, balloons, radii, kinematics, full, full_height, thickness
    )
