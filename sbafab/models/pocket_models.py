"""Stroke and volume of a stack of balloons by each geometric model of its pockets, and the actuator
that the models take.

Balloons of unlike size (a tapered stack) are taken at equal height over radius, so that one
formula holds for all: strokes add up with l, volumes with l^3. Volumes are the mean of a chamber's
balloons. Blocked at a height they all carry one force, and are then at unlike heights over radius.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sbafab.design.records import Design, Discs, Form, Slots
from sbafab.errors import DesignError
from sbafab.geometry.edges import Point
from sbafab.laminate.films import PAPER_PRODUCT, PAPER_THICKNESS, PAPER_TPE, film_name
from sbafab.laminate.laminate import Laminate
from sbafab.laminate.lay_up import FoldedHeight
from sbafab.models.closed_forms import PocketModel, eq_4, eqs_1_to_3, lens, within
from sbafab.models.figures import Factors, Model
from sbafab.models.paper import FULL_SHARE, VALID, VALID_RADIUS
from sbafab.models.quantity import ModelId

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Law = Callable[[NDArray[np.float64]], NDArray[np.float64]]

SAMPLES = 401


@dataclass(frozen=True)
class Kinematics:
    """One stack by one model: limits, and ``_stroke``, ``_volume`` and ``_rate`` within them.

    ``_push`` is given for balloons of unlike size.
    """

    model: Model
    largest_volume: float
    largest_stroke: float
    _stroke: Law
    _volume: Law
    _rate: Law
    _push: Law | None = None

    def stroke(self, volume: ArrayLike) -> NDArray[np.float64]:
        """Return the stroke of the stack in mm at ul a balloon. Raises DesignError out of range."""
        volumes = within(volume, self.largest_volume, "volume", "ul a balloon", self.model.name)
        return self._stroke(volumes)

    def volume(self, stroke: ArrayLike) -> NDArray[np.float64]:
        """Return ul a balloon at a stroke of the stack. Raises DesignError out of range."""
        return self._volume(self._within(stroke))

    def rate(self, stroke: ArrayLike) -> NDArray[np.float64]:
        """Return dv/dh of the stack in mm2: the chamber's whole volume by the stack's stroke."""
        return self._rate(self._within(stroke))

    def push(self, stroke: ArrayLike) -> NDArray[np.float64]:
        """Return force over pressure in mm2 of the stack blocked at a stroke, the same for every
        balloon in it.

        For a tapered stack at most the value of its weakest balloon when flat; additional force
        from solid films of shut balloons is not counted.
        """
        return (self._push or self._rate)(self._within(stroke))

    def _within(self, stroke: ArrayLike) -> NDArray[np.float64]:
        return within(stroke, self.largest_stroke, "stroke of the stack", "mm", self.model.name)


def round_stack(radii: Sequence[float]) -> tuple[Kinematics, Kinematics]:
    """Return Eq. 4 and Eqs. 1 to 3 for balloons with these pocket radii (mm)."""
    first, third = sum(radii), sum(radius**3 for radius in radii)
    scale = third / len(radii)

    def scaled(model: Model, pocket: PocketModel) -> Kinematics:
        return Kinematics(
            model,
            pocket.largest_volume * scale,
            pocket.largest_stroke * first,
            lambda v: pocket.stroke(v / scale) * first,
            lambda h: pocket.volume(h / first) * scale,
            lambda h: pocket.rate(h / first) * third / first,
            _in_series(radii, pocket) if len(set(radii)) > 1 else None,
        )

    by_eq_4 = Model(ModelId.EQ_4, "Sec. 3.1, h the stroke of one balloon", _eq_4_trust(max(radii)))
    by_eqs_1_to_3 = Model(
        ModelId.EQS_1_TO_3,
        "Sec. 3.1, solved for two halves",
        "geometric regime only: films that do not stretch, wrinkle or have a neck ring; "
        "3/4 of Eq. 4's volume and force at small strokes",
    )
    return scaled(by_eq_4, eq_4(1.0)), scaled(by_eqs_1_to_3, eqs_1_to_3(1.0))


def _in_series(radii: Sequence[float], pocket: PocketModel) -> Law:
    """Return force over pressure by stroke of unlike balloons that carry the same force; ``pocket``
    is of radius 1.
    """
    share = np.linspace(0.0, pocket.largest_stroke, SAMPLES)
    # A formula may rise again past the full state; a balloon does not.
    falling = np.minimum.accumulate(pocket.rate(share))
    force = np.linspace(0.0, min(radii) ** 2 * falling[0], SAMPLES)
    stroke = sum(r * np.interp(force / r**2, falling[::-1], share[::-1]) for r in radii)
    by_stroke = np.asarray(stroke)[::-1]
    return lambda h: np.asarray(np.interp(h, by_stroke, force[::-1]))


def slot_stack(width: float, run: float, balloons: int) -> tuple[Kinematics]:
    """Return the lens of two arcs for oblong pockets of a width and straight run (mm)."""
    pocket = lens(width, run)
    model = Model(
        ModelId.LENS_STROKE,
        "films of constant length, ends as spherical caps",
        "geometric regime only; the paper measured no oblong balloon but the inflated diameter",
    )
    return (
        Kinematics(
            model,
            pocket.largest_volume,
            pocket.largest_stroke * balloons,
            lambda v: pocket.stroke(v) * balloons,
            lambda h: pocket.volume(h / balloons),
            lambda h: pocket.rate(h / balloons),
        ),
    )


def scaled_stroke(radii: Sequence[float]) -> float:
    """Return the paper's stroke in mm in proportion to radii: 17.5 for 15 of 2.5 (Sec. 4.6)."""
    return FULL_SHARE * sum(radii)


def _eq_4_trust(radius: float) -> str:
    scale = (radius / VALID_RADIUS) ** 3
    limits = [
        f"within {error.value * radius / VALID_RADIUS:.2g} mm a balloon to "
        f"{volume * scale:.3g} ul in {fluid}"
        for fluid, volume, error in VALID
    ]
    origin = "" if radius == VALID_RADIUS else f", scaled from d = {2 * VALID_RADIUS:g}"
    if radius == 2.5:
        origin += "; the regime ends near 0.95 kPa"
    return f"geometric regime only: {', '.join(limits)} (measured{origin})"


# The actuator of a design, as input of the models.


NOT_MEASURED = (
    f"the paper measured it with its own film, {film_name(PAPER_PRODUCT, PAPER_THICKNESS)} of "
    f"{PAPER_TPE[0]:g} MPa, and no model predicts it for another: take the free stroke at a "
    "pressure, or simulate the design"
)
NO_OUTLINE = "no model knows the form of a drawn pocket outline; simulate the design instead"
"""Message of a search, which compares designs by figures without bounds."""


@dataclass(frozen=True)
class Actuator:
    """A design as input of the models.

    Stacks work side by side, each of ``balloons``; ``radii`` (mm, bottom to top) are the radii of
    round pockets, empty for oblong ones. ``kinematics`` begins with the preferred model; it is
    empty for drawn outlines. Shares of a stroke refer to ``reference_stroke`` mm, and
    ``reference_height`` mm is the height there: the paper's measurement, scaled, or for oblong
    pockets the state of largest volume; ``folded`` is the height of the flat laminate after the
    press.
    """

    design: Design
    form: Form
    laminate: Laminate
    balloons: int
    radii: tuple[float, ...]
    kinematics: tuple[Kinematics, ...]
    reference_stroke: float
    reference_height: float
    folded: FoldedHeight

    @property
    def thickness(self) -> float:
        """The folded height in mm."""
        return self.folded.height

    def lengths(self, stroke: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a chamber's length at a stroke, from flat to the reference height."""
        rise = self.reference_height - self.thickness
        return self.thickness + stroke * rise / self.reference_stroke

    @property
    def axes(self) -> list[Point]:
        """Centres of the chambers of a lobed actuator."""
        return [chamber.centres[0] for chamber in self.laminate.chambers]

    @property
    def is_tapered(self) -> bool:
        return len(set(self.radii)) > 1

    @property
    def has_the_papers_film(self) -> bool:
        """True if the films are the paper's, so that its measurements apply."""
        return _has_the_papers_film(self.laminate)

    @property
    def has_reference(self) -> bool:
        """True if the reference stroke is known: measured for round pockets, with one film."""
        return not self.radii or self.has_the_papers_film

    @property
    def known_stroke(self) -> float:
        """The reference stroke in mm. Raises DesignError if it is not known."""
        if not self.kinematics:
            raise DesignError(NO_OUTLINE)
        if not self.has_reference:
            raise DesignError(f"reference stroke: {NOT_MEASURED}")
        return self.reference_stroke

    def is_like_paper(self, stacks: int, radius: float) -> bool:
        """Return True if the paper measured this number of stacks of such balloons on common
        plates: its 1-DoF actuators have one, its 3-DoF actuator three.
        """
        return (
            self.has_the_papers_film
            and self.form.wrap is None
            and self.form.stacks == stacks
            and set(self.radii) == {radius}
        )


def _has_the_papers_film(laminate: Laminate) -> bool:
    return all(layer.film.is_the_papers for layer in laminate.tpe_layers)


def actuator(
    design: Design, laminate: Laminate, calibration: Factors, form: Form | None = None
) -> Actuator:
    """Return the actuator of a design of any family; ``form`` replaces its own."""
    balloons, form = design.stack.balloons, form or design.form
    radii: tuple[float, ...] = ()
    kinematics: tuple[Kinematics, ...] = ()
    stroke = height = 0.0
    folded = calibration.folded(laminate)
    if isinstance(form.pockets, Slots):
        kinematics = slot_stack(form.pockets.width, form.pockets.run, balloons)
        stroke = kinematics[0].largest_stroke
        height = folded.height + stroke
    elif isinstance(form.pockets, Discs):
        radii = tuple(d / 2 for d in form.pockets.diameters)
        kinematics = round_stack(radii)
        # The paper divides its whole height by its balloons (Sec. 4.6: 1.2 mm each).
        stroke = height = scaled_stroke(radii)
    return Actuator(
        design,
        form,
        laminate,
        balloons,
        radii,
        kinematics,
        stroke,
        height,
        folded,
    )
