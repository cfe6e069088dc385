"""Strokes, volumes and stored energy at a pressure, by the elastic balloon, free to rise."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from sbafab.design.outline import read_outline
from sbafab.design.records import Design, Discs, Drawn, Form
from sbafab.errors import DesignError
from sbafab.models.balloon import Balloon, Shapes
from sbafab.models.balloon_map import MOST_STRETCH, stretch
from sbafab.models.balloons import balloons_of
from sbafab.models.figures import Asked, Factors, Figure, LeftOut, Model, Relation
from sbafab.models.formulas import force
from sbafab.models.kinematics import Actuator
from sbafab.models.rippled import risen

Inflated = Mapping[Balloon, Shapes]
ELASTIC = Model(
    "elastic balloon",
    "membrane of revolution, the film's modulus",
    "one balloon to 10 kPa: within 1.2 % of an axisymmetric mesh; of a solid one that ripples, "
    "d = 5 to 15 within 3 %, d = 20 within 5 %, but d = 10 is 6 to 19 % low where a lone one's rim "
    "rolls to one side; all balloons of a stack are taken for inner ones, inlets left out",
)


def calibrated(model: Model, factors: Factors) -> Model:
    """The same model with the factors it took, named unless they are the defaults."""
    said = []
    if factors.press_factor != 1:
        said.append(f"press factor {factors.press_factor:g}")
    if factors.pocket_loss:
        said.append(f"pocket loss {factors.pocket_loss:g} mm")
    if factors.modulus_mpa is not None:
        said.append(f"E = {factors.modulus_mpa:g} MPa")
    return replace(model, name=f"{model.name}, {', '.join(said)}") if said else model


def free_strokes(one: Actuator, asked: Asked) -> Iterator[Figure | LeftOut]:
    """What a stack of round pockets rises by, holds and stores at the pressures asked for."""
    if not one.radii:
        return
    try:
        kinds = Counter(balloons_of(one.design, one.laminate, asked.calibration, one.form))
    except DesignError as error:
        yield LeftOut("free stroke, elastic balloon", str(error))
        return
    model = calibrated(ELASTIC, asked.calibration)
    together = _inflated(kinds, asked.pressures_kpa)
    for row, pressure in enumerate(asked.pressures_kpa):
        at = f"at {pressure:g} kPa"
        try:
            stroke, volume, stored = _risen(kinds, pressure, together[row] if together else None)
        except DesignError as error:
            yield LeftOut(f"free stroke {at}, elastic balloon", str(error))
            continue
        yield Figure("stroke", f"free stroke {at}", stroke, "mm", model)
        yield Figure("stroke", f"free height {at}", one.thickness + stroke, "mm", model)
        yield Figure("stroke", f"volume a balloon {at}", volume / one.balloons, "ul", model)
        work = stored * one.form.stacks / 1000
        yield Figure("actuation", f"pneumatic input work {at}, free", work, "mJ", model)


def _inflated(kinds: Iterable[Balloon], pressures: Sequence[float]) -> list[Inflated] | None:
    """The balloons at each pressure, all in one go; None where one finds no balance."""
    try:
        found = {kind: risen(kind, pressures) for kind in kinds}
    except DesignError:
        return None
    return [
        {kind: Shapes(*(values[row : row + 1] for values in found[kind])) for kind in found}
        for row in range(len(pressures))
    ]


def _risen(
    kinds: Counter[Balloon], pressure: float, known: Inflated | None
) -> tuple[float, float, float]:
    """Stroke in mm, air in ul and energy in uJ (to 3 % the integral of p dV) of one stack."""
    stroke = volume = stored = 0.0
    for kind, count in kinds.items():
        shape = known[kind] if known else risen(kind, pressure)
        longer = float(stretch(kind, shape)[0])
        if longer > MOST_STRETCH:
            raise DesignError(
                f"the film would be {100 * longer:.0f} % longer, and one modulus is unlikely to "
                f"hold beyond {100 * MOST_STRETCH:g} %; ask for less pressure"
            )
        stroke += count * float(shape.height[0])
        volume += count * float(shape.volume[0])
        stored += count * float(shape.energy[0])
    return stroke, volume, stored


# Drawn pockets: what holds of any outline, and discs in place of one that is nearly round.
#
# A pocket holds every disc within it and lies in every disc round it: its films are bonded where
# the outer disc's are free, and free where the inner disc's are bonded. So the figures of both
# discs, round the chamber's axis, bound its own, where a wider pocket rises more and pushes
# harder.


ROUND = 1.2
"""How many times as far from its axis as elsewhere the edge of a nearly round pocket lies at most:
its stroke, in proportion to the diameter, is then known to some 10 % either way.
"""
EXACT = ("size", "inlet")
"""Groups of figures that are those of the drawn pocket itself."""
BY_DISC = "disc of equal area"


class NearDiscs(NamedTuple):
    """Diameters in mm of the disc of ``equal`` area, and of those within and round a pocket, about
    its chamber's axis.
    """

    equal: float
    inner: float
    outer: float

    @property
    def is_round(self) -> bool:
        return self.outer <= ROUND * self.inner

    def form(self, design: Design, diameter: float) -> Form:
        """The form of a design whose pockets are discs of this diameter."""
        return replace(design.form, pockets=Discs((diameter,) * design.stack.balloons))


def near_discs(design: Design) -> NearDiscs | None:
    """Return the discs of a drawn pocket between flat plates; None for a design without one."""
    drawing = design.drawing
    if drawing is None or design.form.wrap is not None:
        return None
    pocket, axis = read_outline(drawing), (0.0, 0.0)
    outer = max(edge.farthest_from(axis) for edge in pocket.edges)
    inner = pocket.distance_to_edge(axis)
    return NearDiscs(2 * math.sqrt(pocket.area / math.pi), 2 * inner, 2 * outer)


def model_form(design: Design) -> Form:
    """Return the form as models take it: with discs where drawn pockets are nearly round."""
    discs = near_discs(design) if isinstance(design.form.pockets, Drawn) else None
    return discs.form(design, discs.equal) if discs and discs.is_round else design.form


def why_no_disc(design: Design) -> str:
    """Return why a drawn pocket has no stroke, and what has one."""
    discs = near_discs(design)
    instead = "sbafab simulate --with calculix, or sofa, inflates it"
    if discs is None:
        return f"no model knows the form of a drawn pocket outline round a tube; {instead}"
    return (
        "no model knows the form of this drawn pocket outline: a nearly round one is taken for a "
        f"disc, its edge at most {ROUND:g} times as far from the axis as elsewhere, and this one's "
        f"lies {discs.inner / 2:.3g} to {discs.outer / 2:.3g} mm from it; {instead}"
    )


def bounded(
    found: Sequence[Figure | LeftOut],
    bounds: Sequence[Sequence[Figure | LeftOut]],
    discs: NearDiscs,
) -> Iterator[Figure | LeftOut]:
    """Figures by the disc of equal area, each between those by the discs of ``bounds``.

    One that a bound has not is left out.
    """
    known = [
        {(one.name, one.model.name): one.value for one in figures if isinstance(one, Figure)}
        for figures in bounds
    ]
    for one in found:
        if isinstance(one, LeftOut) or one.model is FLAT or one.group in EXACT:
            yield one
            continue
        ends = [values.get((one.name, one.model.name)) for values in known]
        values = [one.value, *(end for end in ends if end is not None)]
        if None in ends:
            yield LeftOut(one.name, "a disc within or round the drawn pocket has none")
            continue
        between = min(values), max(values)
        yield replace(one, model=by_disc(one.model, discs), between=between)


def by_disc(model: Model, discs: NearDiscs) -> Model:
    """The same model of a disc in place of the drawn pocket."""
    return replace(
        model,
        name=f"{model.name}, {BY_DISC}",
        trust=f"{model.trust}; the drawn pocket taken for a disc of d = {discs.equal:.4g} mm, "
        f"bounds by the discs within and round it, {discs.inner:.4g} and {discs.outer:.4g} mm, "
        "where a wider pocket rises more and pushes harder",
    )


def relation_by_disc(relation: Relation, discs: NearDiscs) -> Relation:
    """The same curves, their models named likewise."""
    return replace(
        relation,
        title=f"{relation.title}, {BY_DISC}",
        lines=tuple(
            replace(line, model=by_disc(line.model, discs)) if line.model else line
            for line in relation.lines
        ),
    )


FLAT = Model(
    "pressure x pocket area",
    "statics of a stiff plate",
    "an upper bound, for plates that lie flat on the whole pocket: the paper's 3-DoF actuator "
    "reached 0.83 of it at 100 kPa",
)


def flat_forces(actuator: Actuator, asked: Asked) -> Iterator[Figure]:
    """The most that drawn pockets push with at the pressures asked for, before plates part."""
    drawing = actuator.design.drawing
    if drawing is None or actuator.form.wrap is not None:
        return
    area = actuator.form.pushing * read_outline(drawing).area
    for pressure in asked.pressures_kpa:
        name = f"blocked force at {pressure:g} kPa, flat, at most"
        yield Figure("force", name, float(force(pressure, area)), "N", FLAT)
