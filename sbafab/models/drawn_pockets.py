"""Drawn pockets: discs in place of one that is nearly round, and bounds that hold for any outline.

A pocket contains every disc within it and lies in every disc round it: part of its films is bonded
where the outer disc's are free, and free where the inner disc's are bonded. The figures of both
discs, round the chamber's axis, therefore bound the pocket's, because a wider pocket rises more and
pushes harder.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

from sbafab.design.outline import read_outline
from sbafab.design.records import Design, Discs, Drawn, Form
from sbafab.models.figures import BY_DISC, Figure, LeftOut, Model, PredictionRequest, Relation
from sbafab.models.formulas import force
from sbafab.models.pocket_models import Actuator
from sbafab.models.quantity import Conditions, ModelId, Quantity

ROUNDNESS = 1.2
"""Largest ratio of the farthest to the nearest distance of a nearly round pocket's edge from its
axis: its stroke, in proportion to the diameter, is then known to some 10 % either way.
"""
EXACT_GROUPS = ("size", "inlet")
"""Groups of figures that are computed for the drawn pocket itself."""


class NearDiscs(NamedTuple):
    """Diameters in mm of the disc of ``equal`` area, and of those within and round a pocket, about
    its chamber's axis.
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
    """Return the form as models take it: with discs where drawn pockets are nearly round."""
    discs = near_discs(design) if isinstance(design.form.pockets, Drawn) else None
    return discs.form(design, discs.equal) if discs and discs.is_round else design.form


def why_no_disc(design: Design) -> str:
    """Return the reason why a drawn pocket has no stroke, and the command that computes one."""
    discs = near_discs(design)
    instead = "sbafab simulate --with calculix, or sofa, inflates it"
    if discs is None and design.form.wrap is None:
        return f"no model knows the form of layers drawn one by one; {instead}"
    if discs is None:
        return f"no model knows the form of a drawn pocket outline round a tube; {instead}"
    return (
        "no model knows the form of this drawn pocket outline: a nearly round one is taken for a "
        f"disc, its edge at most {ROUNDNESS:g} times as far from the axis as elsewhere, and this "
        f"one's lies {discs.inner / 2:.3g} to {discs.outer / 2:.3g} mm from it; {instead}"
    )


def bounded(
    figures: Sequence[Figure | LeftOut],
    bounds: Sequence[Sequence[Figure | LeftOut]],
    discs: NearDiscs,
) -> Iterator[Figure | LeftOut]:
    """Yield figures by the disc of equal area, each between those by the discs of ``bounds``.

    A figure that one of the bounds lacks is left out.
    """
    values_of = [
        {figure.key: figure.value for figure in bound if isinstance(figure, Figure)}
        for bound in bounds
    ]
    for figure in figures:
        if (
            isinstance(figure, LeftOut)
            or figure.model is FLAT_PLATES
            or figure.group in EXACT_GROUPS
        ):
            yield figure
            continue
        ends = [values.get(figure.key) for values in values_of]
        values = [figure.value, *(end for end in ends if end is not None)]
        if None in ends:
            reason = "a disc within or round the drawn pocket has none"
            yield LeftOut(figure.name, reason, (figure.quantity,))
            continue
        between = min(values), max(values)
        yield replace(figure, model=by_disc(figure.model, discs), between=between)


def by_disc(model: Model, discs: NearDiscs) -> Model:
    """Return a model as applied to a disc in place of the drawn pocket."""
    return replace(
        model,
        by_disc=True,
        trust=f"{model.trust}; the drawn pocket taken for a disc of d = {discs.equal:.4g} mm, "
        f"bounds by the discs within and round it, {discs.inner:.4g} and {discs.outer:.4g} mm, "
        "where a wider pocket rises more and pushes harder",
    )


def relation_by_disc(relation: Relation, discs: NearDiscs) -> Relation:
    """Return curves with the models of ``by_disc``."""
    return replace(
        relation,
        title=f"{relation.title}, {BY_DISC}",
        lines=tuple(
            replace(line, model=by_disc(line.model, discs)) if line.model else line
            for line in relation.lines
        ),
    )


FLAT_PLATES = Model(
    ModelId.FLAT_PLATES,
    "statics of a stiff plate",
    "an upper bound, for plates that lie flat on the whole pocket: the paper's 3-DoF actuator "
    "reached 0.83 of it at 100 kPa",
)


def flat_forces(actuator: Actuator, request: PredictionRequest) -> Iterator[Figure]:
    """Yield upper bounds of the drawn pockets' blocked force, before plates part."""
    drawing = actuator.design.drawing
    if drawing is None or actuator.form.wrap is not None:
        return
    area = actuator.form.pushing * read_outline(drawing).area
    for pressure in request.pressures_kpa:
        value = float(force(pressure, area))
        yield Figure(Quantity.FORCE_BOUND, value, FLAT_PLATES, Conditions(kpa=pressure))
