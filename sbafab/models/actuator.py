"""The actuator of a design as input of the models, and the discs that approximate drawn pockets.

A drawn pocket contains every inscribed disc and lies in every circumscribed disc: part of its films
is bonded where the outer disc's are free, and free where the inner disc's are bonded. The figures
of both discs, about the chamber's axis, therefore bound the pocket's, because a wider pocket rises
more and pushes harder.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

from sbafab.design.outline import read_outline
from sbafab.design.records import Design, Discs, Drawn, Form, Slots
from sbafab.geometry.edges import Point
from sbafab.laminate.films import PAPER_PRODUCT, PAPER_THICKNESS, PAPER_TPE, film_name
from sbafab.laminate.laminate import Laminate
from sbafab.laminate.lay_up import FoldedHeight
from sbafab.models.closed_forms import ClosedForm, eq_4, eqs_1_to_3, lens, scaled_stroke
from sbafab.models.figures import Factors
from sbafab.models.film_elements import Array

NOT_MEASURED = (
    f"the paper measured it with its own film, {film_name(PAPER_PRODUCT, PAPER_THICKNESS)} of "
    f"{PAPER_TPE[0]:g} MPa, and no model predicts it for another: take the free stroke at a "
    "pressure, or simulate the design"
)
ROUNDNESS = 1.2
"""Largest ratio of the farthest to the nearest distance of a nearly round pocket's edge from its
axis: its stroke, in proportion to the diameter, is then known to some 10 % either way.
"""


@dataclass(frozen=True)
class Actuator:
    """A design with its laminate and calibration factors; ``drawn_as`` replaces its form."""

    design: Design
    laminate: Laminate
    factors: Factors
    drawn_as: Form | None = None

    @property
    def form(self) -> Form:
        """The form used by the models."""
        return self.drawn_as or self.design.form

    @property
    def balloons(self) -> int:
        """The balloons in each of the stacks, which act in parallel."""
        return self.design.stack.balloons

    @cached_property
    def radii(self) -> tuple[float, ...]:
        """Radii of round pockets in mm, bottom to top; empty for others."""
        pockets = self.form.pockets
        return tuple(d / 2 for d in pockets.diameters) if isinstance(pockets, Discs) else ()

    @cached_property
    def pockets(self) -> tuple[ClosedForm, ...]:
        """The pockets of one stack by each closed form, the preferred one first; empty for drawn
        outlines.
        """
        if isinstance(self.form.pockets, Slots):
            return (lens(self.form.pockets.width, self.form.pockets.run, self.balloons),)
        return (eq_4(*self.radii), eqs_1_to_3(*self.radii)) if self.radii else ()

    @cached_property
    def folded(self) -> FoldedHeight:
        """The height of the flat laminate after the press."""
        return self.factors.folded(self.laminate)

    @property
    def thickness(self) -> float:
        """The folded height in mm."""
        return self.folded.height

    @property
    def reference_stroke(self) -> float:
        """The stroke in mm that is the reference for shares: the paper's measurement, scaled, or
        for oblong pockets that of their largest volume.
        """
        return scaled_stroke(self.radii) if self.radii else self.pockets[0].largest_stroke

    @property
    def reference_height(self) -> float:
        """The height in mm at the reference stroke, per balloon; the paper divides its whole height
        by its balloons (Sec. 4.6: 1.2 mm each).
        """
        return self.reference_stroke + (0.0 if self.radii else self.thickness)

    def lengths(self, stroke: Array) -> Array:
        """Return a chamber's length at a stroke, from flat to the reference height."""
        rise = self.reference_height - self.thickness
        return self.thickness + stroke * rise / self.reference_stroke

    def stroke_at(self, share: float) -> float:
        """Return the stroke in mm at a fraction of the way from flat to the reference height."""
        return max(share * (self.reference_height - self.thickness), 0.0)

    @property
    def axes(self) -> list[Point]:
        """The centres of the chambers of a lobed actuator."""
        return [chamber.centres[0] for chamber in self.laminate.chambers]

    @property
    def has_the_papers_film(self) -> bool:
        """True if the films are the paper's, so that its measurements apply."""
        return all(layer.film.is_the_papers for layer in self.laminate.tpe_layers)

    @property
    def has_reference(self) -> bool:
        """True if the reference stroke is known: measured for round pockets, with one film."""
        return not self.radii or self.has_the_papers_film

    def is_like_paper(self, stacks: int, radius: float) -> bool:
        """Return True if the paper measured this number of stacks of such balloons on common
        plates: one in its 1-DoF actuators, three in its 3-DoF actuator.
        """
        return (
            self.has_the_papers_film
            and self.form.wrap is None
            and self.form.stacks == stacks
            and set(self.radii) == {radius}
        )


class NearDiscs(NamedTuple):
    """Diameters in mm of the disc of ``equal`` area, and of the inscribed and circumscribed discs
    of a pocket, about its chamber's axis.
    """

    equal: float
    inner: float
    outer: float

    @property
    def is_round(self) -> bool:
        return self.outer <= ROUNDNESS * self.inner

    def form(self, design: Design, diameter: float) -> Form:
        """Return the form of a design whose pockets are discs of this diameter."""
        return replace(design.form, pockets=Discs((diameter,) * design.stack.balloons))


def near_discs(design: Design) -> NearDiscs | None:
    """Return the discs of a drawn pocket between flat plates; None for a design without one."""
    drawing = design.drawing
    if drawing is None or design.form.wrap is not None:
        return None
    pocket, axis = read_outline(drawing), (0.0, 0.0)
    outer = max(edge.farthest_from(axis) for edge in pocket.edges)
    inner = pocket.distance_to_edge(axis)
    equal = math.sqrt(pocket.area / math.pi)
    # To the nanometre, as points are told apart: a drawn circle's discs are one.
    return NearDiscs(*(round(2 * radius, 6) for radius in (equal, inner, outer)))


def model_form(design: Design) -> Form:
    """Return the form used by the models, with discs in place of nearly round drawn pockets."""
    discs = near_discs(design) if isinstance(design.form.pockets, Drawn) else None
    return discs.form(design, discs.equal) if discs and discs.is_round else design.form


def why_no_disc(design: Design) -> str:
    """Return the reason why a drawn pocket has no stroke, and the command that computes one."""
    discs = near_discs(design)
    why = "no model knows the form of "
    if discs is not None:
        why += (
            "this drawn pocket outline: a nearly round one is taken for a disc, its edge at most "
            f"{ROUNDNESS:g} times as far from the axis as elsewhere, and this one's lies "
            f"{discs.inner / 2:.3g} to {discs.outer / 2:.3g} mm from it"
        )
    elif design.form.wrap is None:
        why += "layers drawn one by one"
    else:
        why += "a drawn pocket outline round a tube"
    return f"{why}; sbafab simulate --with calculix, or sofa, inflates it"
