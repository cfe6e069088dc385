"""All that the models say of one design, put together."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from sbafab.actuators import build
from sbafab.design.form import Slots, Wrap
from sbafab.design.records import Design
from sbafab.errors import DesignError
from sbafab.geometry.inconsistent import GeometryError
from sbafab.geometry.region import Region
from sbafab.laminate.extent import film_mass
from sbafab.laminate.laminate import Laminate
from sbafab.models import axial, elastic, lobes, paper, stacked
from sbafab.models.actuator import NOT_MEASURED, Actuator, actuator
from sbafab.models.choice import REACHED, STACK, WIDEST, chosen
from sbafab.models.counterparts import counterpart
from sbafab.models.drawn import (
    bounded,
    flat_forces,
    near_discs,
    relation_by_disc,
    why_no_disc,
)
from sbafab.models.figures import (
    Asked,
    Figure,
    LeftOut,
    Model,
    Prediction,
    Relation,
    Trace,
)
from sbafab.models.inlet import largest_tube
from sbafab.models.sizes import sizes
from sbafab.models.stack import Stack
from sbafab.models.stiffness import second_moments, tip_stiffness

GROUPS = ("size", "inlet", "stroke", "force", "actuation", "bending", "stiffness")
GEOMETRY = Model("plain geometry", "of the cut files", "exact for what is cut")
PAPER_SLOTS = Slots(width=10.0, run=8.5)
"""The paper's SBAs of 11.5 x 20 mm less a bond of 0.75 all round (Sec. 2.1)."""
ROUND_THE_TUBE = {
    "deflated_diameter": Model(
        "tube and films",
        "Sec. 2.1",
        "the paper's 15.33 is this sum; the sheet is taken to lie close to the tube",
    ),
    "reached_diameter": Model(
        REACHED,
        "the largest volume of films that do not stretch",
        "for what it must reach; for the paper's design 27.29, 2.5 % below its about 28",
    ),
    "inflated_diameter": Model(
        WIDEST,
        "Sec. 2.1: 2 w / pi a balloon",
        "upper end, for what it must not touch: a full cylinder, its ends not holding it back; "
        "28.06 for the paper's design, which says about 28",
    ),
}
NOMINAL = Model(
    "sum of the films",
    "Sec. 2",
    "nominal: films flow in the press; the paper's 15 balloons measure 0.95 mm, not 1.865",
)


def predict(
    design: Design,
    asked: Asked | None = None,
    laminate: Laminate | None = None,
    quick: bool = False,
) -> Prediction:
    """Figures and curves of a design of any family; ``quick`` gives no curves and no elastic stack.

    Raises DesignError where the design cannot be built, or for pressures, a flow or volumes that
    are out of range.
    """
    wish = asked or Asked()
    try:
        flat = laminate or build(design)
    except GeometryError as error:
        raise DesignError(f"design {design.name} cannot be resolved: {error}") from None
    discs = near_discs(design)
    if discs is not None and not discs.is_round:
        discs = None
    one = actuator(design, flat, wish.calibration, discs and discs.form(design, discs.equal))
    axial.check_asked(one, wish)
    together = None if quick else stacked.stacked(one, wish)
    found = _found(one, wish, together)
    relations = () if quick else tuple(_relations(one, wish, _stack(together)))
    if discs is not None:
        bounds = [
            actuator(design, flat, wish.calibration, discs.form(design, diameter))
            for diameter in (discs.inner, discs.outer)
        ]
        each = [_found(end, wish, None if quick else stacked.stacked(end, wish)) for end in bounds]
        found = list(bounded(found, each, discs))
        relations = tuple(relation_by_disc(relation, discs) for relation in relations)
    to_come = (STACK,) if quick and one.radii else ()
    figures = chosen((item for item in found if isinstance(item, Figure)), to_come)
    return Prediction(
        wish,
        tuple(
            replace(figure, measured=counterpart(one.form, figure.name, figure.model.name))
            for figure in figures
        ),
        relations,
        tuple(item for item in found if isinstance(item, LeftOut)),
    )


def _stack(together: Stack | LeftOut | None) -> Stack | None:
    return together if isinstance(together, Stack) else None


def _found(one: Actuator, asked: Asked, together: Stack | LeftOut | None) -> list[Figure | LeftOut]:
    """All figures, and what is left out, in the order of their groups."""
    found = list(_all(one, asked))
    if isinstance(together, LeftOut):
        found.append(together)
    elif together is not None:
        found += stacked.figures(one, asked, together)
    return sorted(found, key=_place)


def _all(one: Actuator, asked: Asked) -> Iterator[Figure | LeftOut]:
    mass = _mass(one.laminate)
    grams = None if isinstance(mass, LeftOut) else mass.value
    yield from _sizes(one, asked)
    if one.kinematics and one.form.is_parallel:
        yield lobes.folding(one, asked)
    yield mass
    if isinstance(mass, LeftOut) and one.kinematics:
        yield LeftOut("power density", mass.reason)
    yield from _tubes(one)
    pushed = list(flat_forces(one, asked))
    yield from pushed
    if not one.kinematics:
        force = "force once the plates part" if pushed else "force"
        for what in ("stroke", force, "actuation", "bending", "folded diameter"):
            yield LeftOut(what, why_no_disc(one.design))
        return
    yield from axial.strokes(one, asked)
    yield from elastic.free_strokes(one, asked)
    yield from axial.forces(one, asked)
    yield from axial.power(one, asked, grams)
    if one.form.is_parallel:
        yield from lobes.bending(one)
    yield from _stiffness(one)


def _place(item: Figure | LeftOut) -> int:
    """Where the figures of a group stand; within it the order is as they come."""
    if isinstance(item, LeftOut):
        return len(GROUPS)
    return GROUPS.index(item.group)


def _relations(one: Actuator, asked: Asked, together: Stack | None) -> Iterator[Relation]:
    if not one.kinematics:
        return
    yield axial.stroke_relation(one)
    if asked.pressures_kpa:
        pushed = axial.force_relation(one, asked)
        if together is not None:
            pushed = replace(
                pushed, lines=(*pushed.lines, *stacked.force_traces(one, asked, together))
            )
        yield pushed
    if one.form.is_parallel:
        if one.knows_full:
            yield lobes.bending_relation(one, asked)
        if together is not None:
            yield stacked.bend_relation(asked, together)
        reached = lobes.workspace_relation(one)
        if together is not None:
            more = stacked.workspace_traces(asked, together)
            reached = replace(reached, lines=(*reached.lines, *more))
        if reached.lines:
            yield reached
    if one.form.wrap is not None:
        yield _diameter_relation(one, one.form.wrap)


def _sizes(one: Actuator, asked: Asked) -> Iterator[Figure]:
    """Flat sizes, and round the tube for radial designs."""
    factor = asked.calibration.press_factor
    pressed = NOMINAL.times("press factor", factor)
    for name, value in sizes(one.design, one.laminate).items():
        shown = name.replace("_", " ")
        if name == "thickness":
            yield Figure("size", "deflated height", one.thickness, "mm", pressed)
        elif name in ROUND_THE_TUBE:
            # The laminate is in it twice.
            thinner = 2 * (one.laminate.thickness - one.thickness)
            model = ROUND_THE_TUBE[name].times("press factor", factor)
            yield Figure("size", shown, value - thinner, "mm", model)
        else:
            yield Figure("size", shown, value, "mm", GEOMETRY)


def _mass(laminate: Laminate) -> Figure | LeftOut:
    try:
        grams = film_mass(laminate)
    except DesignError as error:
        return LeftOut("mass", str(error))
    trust = "exact for the films, masks, tabs and ears included; without tubing, glue and fluid"
    return Figure("size", "mass", grams, "g", Model("area x thickness x density", "", trust))


def _tubes(one: Actuator) -> Iterator[Figure]:
    inlet = min(one.laminate.inlets, key=lambda inlet: inlet.width - inlet.tube_diameter)
    model = Model(
        "half the perimeter",
        "a flat strip opened round, its PTFE beside the tube",
        "cut at its narrowest; films do not stretch; glue not counted",
    )
    narrowest = inlet.width - one.design.strip_loss
    most = largest_tube(narrowest, one.design.films.ptfe.thickness)
    yield Figure("inlet", "largest tube that the inlet opens to", most, "mm", model)
    spare = most - inlet.tube_diameter
    name = f"room round the tube of {inlet.tube_diameter:g} mm"
    yield Figure("inlet", name, spare, "mm", model)


def _plate(one: Actuator) -> Region | None:
    """What is cut of the topmost film, if it has neither tabs nor ears."""
    if one.balloons == 1 or one.laminate.registration == "ears":
        return None
    return one.laminate.tpe_layers[-1].profile


def _stiffness(one: Actuator) -> Iterator[Figure | LeftOut]:
    """Bending stiffness of a full actuator by the paper's cantilever formula."""
    name = "lateral tip stiffness, inflated"
    plate = _plate(one)
    if not one.radii:
        yield LeftOut(name, "the paper measured no modulus of oblong balloons")
        return
    if not one.has_the_papers_film:
        yield LeftOut(name, NOT_MEASURED)
        return
    if plate is None:
        yield LeftOut(name, "the topmost film is not the plain outline: it has tabs or ears")
        return
    measured = paper.MODULUS_3DOF if one.form.is_parallel else paper.MODULUS_1DOF
    least, _ = second_moments(plate)
    yield Figure("stiffness", "second moment of area of the plate", least, "mm4", GEOMETRY)
    model = Model(
        "3 E I / l^3",
        f"Sec. 4.4, E = {measured.value:g} kPa as measured there",
        "order of magnitude: E is the paper's of its own actuators, not predicted, and its I is "
        "not given",
    )
    value = tip_stiffness(measured.value, least, one.full_height)
    yield Figure("stiffness", name, value, "N/mm", model)


def _diameter_relation(one: Actuator, wrap: Wrap) -> Relation:
    """Diameter round the tube against the air in a balloon."""
    k = one.kinematics[0]
    stroke = np.linspace(0, k.largest_stroke, axial.SAMPLES)
    around = wrap.tube_diameter + 2 * (one.thickness + stroke)
    lines = [Trace(k.model.name, k.volume(stroke).tolist(), around.tolist(), k.model)]
    label = f"paper: about {paper.RADIAL_FULL.value:g} mm inflated"
    if (one.form.pockets, one.balloons) == (PAPER_SLOTS, 1):
        lines.append(Trace(label, [0.0, k.largest_volume], [paper.RADIAL_FULL.value] * 2))
    return Relation(
        "diameter",
        "Diameter round the tube against volume",
        "volume a balloon, ul",
        "diameter, mm",
        tuple(lines),
    )
