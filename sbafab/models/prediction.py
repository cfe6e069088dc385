"""All figures and curves that the models give for a design: sizes, stroke, force, work and time of
chambers in step, bending and workspace of parallel ones, and their order in a prediction.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sbafab.actuators import build
from sbafab.design.records import Design, Slots, Wrap
from sbafab.errors import BeyondError, DesignError, GeometryError
from sbafab.geometry.region import Region
from sbafab.laminate.burst import NOT_BURST, burst
from sbafab.laminate.laminate import Laminate, film_mass
from sbafab.laminate.lay_up import FoldedHeight
from sbafab.models import elastic, mechanisms, paper
from sbafab.models.closed_forms import bend, eqs_1_to_3, paraboloid_radius
from sbafab.models.drawn_pockets import (
    bounded,
    flat_forces,
    near_discs,
    relation_by_disc,
    why_no_disc,
)
from sbafab.models.figures import (
    NEAR_BURST,
    Factors,
    Figure,
    Flag,
    LeftOut,
    Model,
    Points,
    Prediction,
    PredictionRequest,
    Relation,
    Trace,
    chosen,
)
from sbafab.models.formulas import (
    LOBES,
    folded_diameter,
    force,
    is_near_burst,
    is_the_papers_3dof,
    largest_tube,
    refuse_beyond_burst,
    refuse_pressure,
    second_moments,
    sizes,
    tip_stiffness,
)
from sbafab.models.intervals import (
    PAPER_3DOF,
    burst_uncertainty,
    factors_of,
    farther,
    flags_at,
    sizes_of,
    uncertainty_of,
)
from sbafab.models.kinematics import NOT_MEASURED, Actuator, Kinematics
from sbafab.models.kinematics import actuator as actuator_of
from sbafab.models.mechanisms import mechanism_figures
from sbafab.models.paper import BURST as BURST_MEASURED
from sbafab.models.paper import Counterpart, counterpart
from sbafab.models.pneumatics import seconds
from sbafab.models.quantity import (
    OF_STACK,
    OVER_FLOW,
    P_V,
    WORK_ON,
    Conditions,
    ModelId,
    Quantity,
    chamber_count,
)
from sbafab.models.stack import Stack

SAMPLES = 61


def check_request(actuator: Actuator, request: PredictionRequest) -> None:
    """Raise DesignError for pressures, flows or volumes out of every model's range."""
    refuse_pressure(request.pressures_kpa, actuator.form.works_under_vacuum)
    seconds(0.0, request.flow_ml_min)
    if actuator.kinematics:
        widest = max(actuator.kinematics, key=lambda k: k.largest_volume)
        widest.stroke(request.volumes_ul)


def reference_model(actuator: Actuator) -> Model:
    """Return the model of the reference stroke."""
    if actuator.radii:
        return Model(
            ModelId.SCALED_HEIGHT,
            "Sec. 4.6: 17.5 mm for 15 balloons of d = 5, in proportion to d",
            "measured, not predicted: one actuator of d = 5, at a pressure that is not given; as "
            "in the paper, all of the height counts as stroke",
        )
    first = actuator.kinematics[0].model
    return Model(ModelId.LARGEST_VOLUME, first.name, first.trust)


def strokes(actuator: Actuator, request: PredictionRequest) -> Iterator[Figure | LeftOut]:
    """Yield the full state, the largest volumes, and strokes at each volume of the request."""
    if actuator.has_reference:
        model = reference_model(actuator)
        scaled = {
            Quantity.REFERENCE_STROKE: actuator.reference_stroke,
            Quantity.REFERENCE_HEIGHT: actuator.reference_height,
        }
        flags: tuple[Flag, ...] = ()
        if actuator.radii:
            sizes_here = sizes_of(actuator.form, actuator.laminate)
            flags = flags_at(farther(sizes_here, PAPER_3DOF, False))
        for quantity, value in scaled.items():
            yield Figure(quantity, value, model, flags=flags)
        for k in actuator.kinematics:
            at_full = float(k.volume(actuator.reference_stroke))
            yield Figure(Quantity.REFERENCE_VOLUME, at_full, k.model)
    else:
        yield LeftOut("reference stroke and height, and what is predicted at them", NOT_MEASURED)
    for k in actuator.kinematics:
        yield Figure(Quantity.LARGEST_VOLUME, k.largest_volume, k.model)
        yield Figure(Quantity.LARGEST_STROKE, k.largest_stroke, k.model)
    if actuator.radii:
        widest = eqs_1_to_3(max(actuator.radii))
        drawn_in = 2 * paraboloid_radius(widest.largest_volume, widest.largest_stroke)
        by_eqs_1_to_3 = actuator.kinematics[-1].model
        yield Figure(Quantity.BALLOON_DIAMETER, drawn_in, by_eqs_1_to_3)
    for volume in request.volumes_ul:
        for k in actuator.kinematics:
            yield _stroke(k, volume)


def _stroke(k: Kinematics, volume: float) -> Figure | LeftOut:
    quantity, at = Quantity.VOLUME_STROKE, Conditions(volume=volume)
    try:
        return Figure(quantity, float(k.stroke(volume)), k.model, at)
    except DesignError as error:
        return LeftOut(f"{quantity.named(at)}, {k.model.name}", str(error), (quantity,))


def forces(actuator: Actuator, request: PredictionRequest) -> Iterator[Figure]:
    """Yield the blocked force at each pressure, flat and at the paper's shares of the
    reference stroke.
    """
    for pressure in request.pressures_kpa:
        for share in paper.HEIGHTS if actuator.has_reference else paper.HEIGHTS[:1]:
            at = Conditions(kpa=pressure, share=share, each=_each(actuator))
            for k in actuator.kinematics:
                value = _force(actuator, k, pressure, share * actuator.reference_stroke, request)
                model = _force_model(actuator, k, request)
                yield Figure(Quantity.BLOCKED_FORCE, float(value), model, at)


def _force(
    actuator: Actuator,
    k: Kinematics,
    pressure: float,
    stroke: ArrayLike,
    request: PredictionRequest,
) -> NDArray[np.float64]:
    factor = actuator.form.pushing * request.factors.contact_factor
    return factor * force(pressure, k.push(stroke))


def _each(actuator: Actuator) -> str:
    return "" if actuator.form.pushing == actuator.form.stacks else "sba"


def _force_model(actuator: Actuator, k: Kinematics, request: PredictionRequest) -> Model:
    trust = (
        "no film tension, no stretch; for d = 5 at 100 kPa the paper measured 0.76 to 1.24 times "
        "what Eq. 4 says, 0.74 to 1.65 times what Eqs. 1-3 say"
        if actuator.radii
        else "no film tension, no stretch, one balloon stack; not measured"
    )
    model = Model(WORK_ON[k.model.id], "Sec. 4.3, F = p dv/dh", trust)
    return model.times("contact_factor", request.factors.contact_factor)


def power(actuator: Actuator, request: PredictionRequest, mass_g: float | None) -> Iterator[Figure]:
    """Yield time, work, speed and power density, all of it at the volume of the reference stroke:
    where that is not known only times to the volumes of the request, and without a mass no power
    density.
    """
    first = actuator.kinematics[0]
    whole = None
    if actuator.has_reference:
        chamber = actuator.balloons * float(first.volume(actuator.reference_stroke))
        whole = chamber * actuator.form.stacks
        yield Figure(Quantity.TOTAL_VOLUME, whole, first.model)
    flow = Model(
        OVER_FLOW[first.model.id],
        "Sec. 4.5, 7",
        "a liquid at a steady flow into all chambers together, no lag of pump or tube: the paper's "
        "water took 0.92 +- 0.08 s; a gas takes 10 % longer at 10 kPa, and valves much longer",
    )
    if whole is not None:
        time = float(seconds(whole, request.flow_ml_min))
        at = Conditions(flow=request.flow_ml_min)
        yield Figure(Quantity.REFERENCE_TIME, time, flow, at)
    for volume in request.volumes_ul:
        content = volume * actuator.balloons * actuator.form.stacks
        time = float(seconds(content, request.flow_ml_min))
        at = Conditions(volume=volume, flow=request.flow_ml_min)
        plain = Model(ModelId.VOLUME_OVER_FLOW, "Sec. 7", flow.trust)
        yield Figure(Quantity.VOLUME_TIME, time, plain, at)
    if whole is None:
        return
    bound = Model(
        P_V[first.model.id],
        "Sec. 4.1",
        "end pressure times volume: more than the integral of p dV that the paper means, which the "
        "elastic balloon gives",
    )
    for pressure in request.pressures_kpa:
        work = pressure * whole / 1000
        yield Figure(Quantity.WORK_BOUND, work, bound, Conditions(kpa=pressure))
    if request.pressures_kpa and mass_g is not None:
        yield _power_density(actuator, request, whole, mass_g)


def _power_density(
    actuator: Actuator, request: PredictionRequest, whole: float, mass_g: float
) -> Figure:
    """Return the power density with the paper's air: its pump's flow, up to 10 kPa."""
    time = float(seconds(whole, paper.AIR_FLOW, paper.FULL_KPA))
    highest = max(request.pressures_kpa)
    push = float(_force(actuator, actuator.kinematics[0], highest, 0.0, request))
    pushes = actuator.form.stacks / actuator.form.pushing
    model = Model(
        ModelId.POWER,
        "Sec. 7",
        "largest force times mean speed, as in the paper; the two never occur together. No lag of "
        "valve and pump: the paper's 0.067 s of air make it a fifth of this",
    ).times("contact_factor", request.factors.contact_factor)
    watts = pushes * push * actuator.reference_stroke / 1000 / time
    at = Conditions(kpa=highest, flow=paper.AIR_FLOW)
    return Figure(Quantity.POWER_DENSITY, watts / (mass_g / 1000), model, at)


def stroke_relation(actuator: Actuator) -> Relation:
    """Return stroke against volume, by every model of the pockets."""
    lines = []
    for k in actuator.kinematics:
        stroke = np.linspace(0, k.largest_stroke, SAMPLES)
        lines.append(Trace(k.model.name, k.volume(stroke).tolist(), stroke.tolist(), k.model))
    points = []
    if actuator.is_like_paper(1, paper.VALID_RADIUS):
        first = actuator.kinematics[0]
        for fluid, volume, error in paper.VALID:
            label = f"paper: Eq. 4 within {error.value:g} mm a balloon to here ({fluid})"
            at, slack = float(first.stroke(volume)), error.value * actuator.balloons
            points.append(Points(label, [volume], [at], [slack]))
    if actuator.is_like_paper(3, 2.5) and actuator.balloons == paper.BALLOONS:
        ends = [0.0, max(k.largest_volume for k in actuator.kinematics)]
        label = f"paper: {paper.FULL_HEIGHT.value:g} mm high when full"
        lines.append(Trace(label, ends, [paper.FULL_HEIGHT.value] * 2))
    return Relation(
        "stroke",
        "Stroke against volume",
        "volume a balloon, ul" if not actuator.is_tapered else "mean volume a balloon, ul",
        "stroke of the stack, mm",
        tuple(lines),
        tuple(points),
    )


def force_relation(actuator: Actuator, request: PredictionRequest) -> Relation:
    """Return force against stroke, to the reference stroke, at every pressure of the request."""
    most = min(k.largest_stroke for k in actuator.kinematics)
    stroke = np.linspace(0, actuator.reference_stroke if actuator.has_reference else most, SAMPLES)
    lines = []
    for pressure in request.pressures_kpa:
        for k in actuator.kinematics:
            values = _force(actuator, k, pressure, stroke, request)
            model = _force_model(actuator, k, request)
            label = f"{k.model.name}, {pressure:g} kPa"
            lines.append(Trace(label, stroke.tolist(), values.tolist(), model))
    measured = None
    if actuator.is_like_paper(1, 2.5):
        measured = "1-DoF", paper.FORCE_1DOF
    elif actuator.is_like_paper(3, 2.5):
        measured = "3-DoF", paper.FORCE_3DOF
    points = []
    if measured is not None:
        name, values_at = measured
        places = [share * actuator.reference_stroke for share in paper.HEIGHTS]
        label = f"paper: {name}, {paper.FORCE_KPA:g} kPa"
        y, errors = [m.value for m in values_at], [m.error for m in values_at]
        points.append(Points(label, places, y, errors))
    each = " of one SBA" if _each(actuator) else ""
    return Relation(
        "force",
        f"Blocked force{each} against stroke, by virtual work",
        "stroke at which it is blocked, mm",
        f"blocked force{each}, N",
        tuple(lines),
        tuple(points),
    )


# Bending and workspace of parallel chambers, and how they fold.


CURVATURE = Model(
    ModelId.CONSTANT_CURVATURE,
    "from chamber lengths, each at its own stroke",
    "upper bound: chambers are taken to lengthen freely, and films between them do not hold back; "
    "the paper's largest is 81 +- 6 deg",
)


class Path(NamedTuple):
    """Motion of 1, 2 ... neighbouring chambers from flat to the reference stroke: stroke (mm),
    angle (rad), lateral displacement and height of the tip (mm).
    """

    chambers: int
    stroke: NDArray[np.float64]
    angle: NDArray[np.float64]
    aside: NDArray[np.float64]
    height: NDArray[np.float64]


def paths(actuator: Actuator, others_full: bool = False) -> list[Path]:
    """Return one path for 1, 2 ... chambers next to each other; the others flat, or full.

    A path ends where the top has turned by half a turn.
    """
    axes = actuator.axes
    stroke = np.linspace(0, actuator.reference_stroke, SAMPLES)
    rest = actuator.reference_height if others_full else actuator.thickness
    all_paths = []
    for chambers in range(1, len(axes)):
        lengths = np.full((SAMPLES, len(axes)), rest)
        lengths[:, :chambers] = actuator.lengths(stroke)[:, None]
        bent = bend(lengths, axes)
        good = bent.angle <= math.pi
        aside = np.hypot(bent.tip[:, 0], bent.tip[:, 1])
        all_paths.append(
            Path(chambers, stroke[good], bent.angle[good], aside[good], bent.tip[good, 2])
        )
    return all_paths


def bending(actuator: Actuator) -> Iterator[Figure | LeftOut]:
    """Yield the largest bend of each number of chambers, and the lateral tip displacement."""
    if not actuator.has_reference:
        yield LeftOut(
            "bend and tip displacement at the reference stroke, constant curvature",
            NOT_MEASURED,
            (Quantity.REFERENCE_BEND, Quantity.LARGEST_ASIDE),
        )
        return
    all_paths = paths(actuator)
    for path in all_paths:
        quantity, at = Quantity.REFERENCE_BEND, Conditions(chambers=path.chambers)
        if len(path.stroke) < SAMPLES:
            reason = "more than half a turn: the tip would come down through the base"
            yield LeftOut(quantity.named(at), reason, (quantity,))
        else:
            yield Figure(quantity, math.degrees(path.angle[-1]), CURVATURE, at)
    every = [*all_paths, *paths(actuator, others_full=True)]
    reach = max(float(path.aside.max()) for path in every)
    yield Figure(Quantity.LARGEST_ASIDE, reach, CURVATURE)


def folding(actuator: Actuator, request: PredictionRequest) -> Figure | LeftOut:
    """Return the diameter of the channel that three folded lobes pass."""
    if actuator.form.stacks != LOBES:
        reason = f"the model is of {LOBES} lobes folded into a triangle"
        reason = f"{reason}; this design has {actuator.form.stacks}"
        return LeftOut("folded diameter", reason, (Quantity.FOLDED_DIAMETER,))
    model = Model(
        ModelId.FOLDED_LOBES,
        "our geometry; the paper reports 9.25",
        "one figure to compare with: 9.91 at the nominal thickness, 8.61 at the 0.95 mm that the "
        "paper measures, between which its 9.25 lies",
    ).times("press_factor", actuator.folded.factor if actuator.folded.molten else 1.0)
    width = 2 * max(actuator.radii) + 2 * actuator.design.bond.width
    value = folded_diameter(width, actuator.thickness)
    return Figure(Quantity.FOLDED_DIAMETER, value, model)


def bending_relation(actuator: Actuator, request: PredictionRequest) -> Relation:
    """Return bend against time, each chamber fed at the flow of the request."""
    first = actuator.kinematics[0]
    model = Model(
        ModelId.CURVATURE_OVER_FLOW,
        CURVATURE.source,
        f"{CURVATURE.trust}; no lag of pump or tube",
    )
    lines = []
    for path in paths(actuator):
        content = first.volume(path.stroke) * actuator.balloons
        time = seconds(content, request.flow_ml_min)
        label = f"{chamber_count(path.chambers)} inflated, the others flat"
        lines.append(Trace(label, time.tolist(), np.degrees(path.angle).tolist(), model))
    points = []
    if actuator.is_like_paper(3, 2.5) and actuator.balloons == paper.BALLOONS:
        ends = [0.0, max(max(line.x) for line in lines)]
        largest = paper.LARGEST_BEND
        if request.flow_ml_min == paper.WATER_FLOW:
            x = [time for time, _ in paper.BENDING]
            y = [angle.value for _, angle in paper.BENDING]
            label = "paper: time to steady angles"
            points.append(Points(label, x, y, [angle.error for _, angle in paper.BENDING]))
            ends[1] = max(x)
        label = f"paper: largest bend, {largest.value:g} +- {largest.error:g} deg"
        lines.append(Trace(label, ends, [largest.value] * 2))
    return Relation(
        "bending",
        "Bending against time",
        f"time with {request.flow_ml_min:g} ml/min into each inflated chamber, s",
        "bend of the top, deg",
        tuple(lines),
        tuple(points),
    )


def workspace_relation(actuator: Actuator) -> Relation:
    """Return the paths of the tip in the plane in which neighbouring chambers bend; no lines of
    constant curvature where the reference stroke is not known.
    """
    lines = []
    rests = (("flat", False), ("full", True)) if actuator.has_reference else ()
    for rest, others_full in rests:
        for path in paths(actuator, others_full):
            label = f"{chamber_count(path.chambers)}, the others {rest}"
            lines.append(Trace(label, path.aside.tolist(), path.height.tolist(), CURVATURE))
    points = []
    if actuator.is_like_paper(3, 2.5) and actuator.balloons == paper.BALLOONS:
        label = f"paper: all full, {paper.FULL_HEIGHT.value:g} mm"
        points.append(Points(label, [0.0], [paper.FULL_HEIGHT.value], [0.0]))
    return Relation(
        "workspace",
        "Paths of the tip",
        "reach aside, mm",
        "height of the tip, mm",
        tuple(lines),
        tuple(points),
    )


# The whole prediction of one design.


GROUPS = ("size", "inlet", "strength", "stroke", "force", "actuation", "bending", "stiffness")
GEOMETRY = Model(ModelId.GEOMETRY, "of the cut files", "exact for what is cut")
PAPER_SLOTS = Slots(width=10.0, run=8.5)
"""The paper's SBAs of 11.5 x 20 mm less a bond of 0.75 all round (Sec. 2.1)."""
ROUND_THE_TUBE = {
    Quantity.DEFLATED_DIAMETER: Model(
        ModelId.TUBE_AND_FILMS,
        "Sec. 2.1",
        "the paper's 15.33 is the sum of tube and films as bought; the sheet is taken to lie close "
        "to the tube",
    ),
    Quantity.REACHED_DIAMETER: Model(
        ModelId.LENS,
        "the largest volume of films that do not stretch",
        "for what it must reach; for the paper's design 27.29, 2.5 % below its about 28",
    ),
    Quantity.INFLATED_DIAMETER: Model(
        ModelId.CYLINDER,
        "Sec. 2.1: 2 w / pi a balloon",
        "upper end, for what it must not touch: a full cylinder, its ends not holding it back; "
        "28.06 for the paper's design, which says about 28",
    ),
}
AS_BOUGHT = "nominal: films that melt in the press flow, and no press factor is given"
SOLID = "masks and films that do not melt in a press step keep their thickness"


def predict(
    design: Design,
    request: PredictionRequest | None = None,
    laminate: Laminate | None = None,
    quick: bool = False,
) -> Prediction:
    """Return the figures and curves of a design of any family; ``quick`` leaves out curves and the
    elastic stack. If factors are given, intervals are not computed, and figures are not flagged for
    lying outside the checked part of a balloon's map.

    Raises DesignError if the design cannot be built, or for pressures, a flow or volumes that
    are out of range.
    """
    wish = request or PredictionRequest()
    uncertainty, checks_maps = None, wish.calibration is None
    try:
        flat = laminate or build(design)
    except GeometryError as error:
        raise DesignError(f"design {design.name} cannot be resolved: {error}") from None
    discs = near_discs(design)
    if discs is not None and not discs.is_round:
        discs = None
    form = discs and discs.form(design, discs.equal)
    if wish.calibration is None:
        uncertainty = uncertainty_of(design, wish.overrides, flat, form)
        factors = factors_of(design, wish.overrides) if uncertainty is None else uncertainty.factors
        wish = replace(wish, calibration=factors)
    subject = actuator_of(design, flat, wish.factors, form)
    check_request(subject, wish)
    asked, (wish, past) = wish, _within_burst(wish, flat)
    together = None if quick else elastic.elastic_stack(subject, wish)
    items = _figures(subject, wish, together, checks_maps=checks_maps)
    if uncertainty is not None:
        items = uncertainty.bounded(items, partial(_moved_figures, subject, wish, together))
    relations = () if quick else tuple(_relations(subject, wish, _stack(together)))
    if discs is not None:
        each = []
        for diameter in (discs.inner, discs.outer):
            if diameter == discs.equal:
                each.append(items)
                continue
            end = actuator_of(design, flat, wish.factors, discs.form(design, diameter))
            each.append(_figures(end, wish, None if quick else elastic.elastic_stack(end, wish)))
        items = list(bounded(items, each, discs))
        relations = tuple(relation_by_disc(relation, discs) for relation in relations)
    to_come = OF_STACK if quick and subject.radii else ()
    items = [*(_flagged(item, flat) for item in items), *past]
    figures = chosen(
        (item for item in items if isinstance(item, Figure)), to_come, uncertainty is not None
    )
    return Prediction(
        asked,
        tuple(
            replace(figure, measured=_measured(figure, subject, wish.factors.calibration))
            for figure in figures
        ),
        relations,
        tuple(item for item in items if isinstance(item, LeftOut)),
    )


def _measured(figure: Figure, actuator: Actuator, calibration: str) -> Counterpart | None:
    """Return the paper's measurement if the figure is far off; None for a folded height with a
    factor.
    """
    model = figure.model
    if model.id is ModelId.FILMS and model.factors:
        return None
    of_papers = is_the_papers_3dof(actuator.form, actuator.laminate)
    return counterpart(actuator.form, figure.quantity, figure.at, model.id, calibration, of_papers)


def _within_burst(
    request: PredictionRequest, laminate: Laminate
) -> tuple[PredictionRequest, list[LeftOut]]:
    """Return a request without the pressures past the estimated burst pressure, and notes on the
    omitted ones.
    """
    within, past = [], []
    for pressure in request.pressures_kpa:
        try:
            refuse_beyond_burst(laminate, pressure)
            within.append(pressure)
        except BeyondError as error:
            past.append(LeftOut(f"all figures at {pressure:g} kPa", str(error)))
    return replace(request, pressures_kpa=tuple(within)), past


def _flagged(item: Figure | LeftOut, laminate: Laminate) -> Figure | LeftOut:
    """Return a figure, flagged if its pressure is near the estimated burst, or left out if it is
    past that.
    """
    if isinstance(item, LeftOut) or item.pressure_kpa is None:
        return item
    try:
        refuse_beyond_burst(laminate, item.pressure_kpa)
    except BeyondError as error:
        return LeftOut(item.name, str(error), (item.quantity,))
    if is_near_burst(laminate, item.pressure_kpa):
        return replace(item, flags=(*item.flags, NEAR_BURST))
    return item


def _burst(laminate: Laminate) -> Figure | LeftOut:
    """Return the burst pressure with its interval, which is ours."""
    estimate = burst(laminate)
    if estimate is None:
        return LeftOut("burst pressure", NOT_BURST, (Quantity.BURST,))
    interval, missed = burst_uncertainty(estimate)
    pocket = "round pocket" if estimate.is_round else "pocket, taken for a long one,"
    model = Model(
        ModelId.FILM_STRESS,
        f"Sec. 4: {BURST_MEASURED}, pockets of d = 5",
        f"of its widest {pocket} and thinnest film; less where bonds peel or seams give way first. "
        "The interval has the paper's scatter, and what is assumed for other sizes and shapes",
    )
    flags = flags_at(missed)
    return Figure(Quantity.BURST, estimate.kpa, model, interval=interval, flags=flags)


def _moved_figures(
    actuator: Actuator,
    request: PredictionRequest,
    together: Stack | LeftOut | None,
    factors: Factors,
) -> list[Figure | LeftOut]:
    """Return the figures of an actuator at other factors."""
    subject = actuator_of(actuator.design, actuator.laminate, factors, actuator.form)
    moved = replace(request, calibration=factors)
    other: Stack | LeftOut | None = together
    if isinstance(together, Stack):
        other = elastic.moved_stack(together, actuator.laminate, request.factors, factors)
        other = other or elastic.elastic_stack(subject, moved)
    return _figures(subject, moved, other, checks_films=False)


def _stack(together: Stack | LeftOut | None) -> Stack | None:
    return together if isinstance(together, Stack) else None


def _figures(
    actuator: Actuator,
    request: PredictionRequest,
    together: Stack | LeftOut | None,
    checks_films: bool = True,
    checks_maps: bool = False,
) -> list[Figure | LeftOut]:
    """Return all figures, and the ones left out, in the order of their groups."""
    items = list(_geometric_figures(actuator, request))
    if isinstance(together, LeftOut):
        items.append(together)
    elif together is not None:
        items += elastic.stack_figures(actuator, request, together, checks_films, checks_maps)
    return sorted(items, key=_group_order)


def _geometric_figures(
    actuator: Actuator, request: PredictionRequest
) -> Iterator[Figure | LeftOut]:
    mass = _mass(actuator.laminate)
    grams = None if isinstance(mass, LeftOut) else mass.value
    yield from _sizes(actuator, request.factors)
    if actuator.kinematics and actuator.form.is_parallel:
        yield folding(actuator, request)
    yield mass
    if isinstance(mass, LeftOut) and actuator.kinematics:
        yield LeftOut("power density", mass.reason, (Quantity.POWER_DENSITY,))
    yield from _tubes(actuator)
    if not actuator.form.works_under_vacuum:
        yield _burst(actuator.laminate)
    pushed = list(flat_forces(actuator, request))
    yield from pushed
    mechanism = actuator.form.mechanism
    if mechanism is not None:
        yield from mechanism_figures(mechanism, actuator.laminate, request)
        for quantity in mechanisms.LEFT_OUT[mechanism.kind]:
            yield LeftOut(quantity, f"the model of its mechanism, {mechanism.kind}, gives none")
        return
    if not actuator.kinematics:
        force = "force once the plates part" if pushed else "force"
        for quantity in ("stroke", force, "actuation", "bending", "folded diameter"):
            yield LeftOut(quantity, why_no_disc(actuator.design))
        return
    yield from strokes(actuator, request)
    yield from elastic.free_strokes(actuator, request)
    yield from forces(actuator, request)
    yield from power(actuator, request, grams)
    if actuator.form.is_parallel:
        yield from bending(actuator)
    yield from _stiffness(actuator)


def _group_order(item: Figure | LeftOut) -> int:
    """Return the place of a figure's group; within it the order is as they come."""
    if isinstance(item, LeftOut):
        return len(GROUPS)
    return GROUPS.index(item.group)


def _relations(
    actuator: Actuator, request: PredictionRequest, together: Stack | None
) -> Iterator[Relation]:
    if not actuator.kinematics:
        return
    yield stroke_relation(actuator)
    if request.pressures_kpa:
        pushed = force_relation(actuator, request)
        if together is not None:
            pushed = replace(
                pushed, lines=(*pushed.lines, *elastic.force_traces(actuator, request, together))
            )
        yield pushed
    if actuator.form.is_parallel:
        if actuator.has_reference:
            yield bending_relation(actuator, request)
        if together is not None:
            yield elastic.bend_relation(request, together)
        reached = workspace_relation(actuator)
        if together is not None:
            more = elastic.workspace_traces(request, together)
            reached = replace(reached, lines=(*reached.lines, *more))
        if reached.lines:
            yield reached
    if actuator.form.wrap is not None:
        yield _diameter_relation(actuator, actuator.form.wrap)


def _sizes(actuator: Actuator, factors: Factors) -> Iterator[Figure]:
    """Yield flat sizes, and diameters round the tube for radial designs."""
    folded = actuator.folded
    factor = folded.factor if folded.molten else 1.0
    models = {of: model.times("press_factor", factor) for of, model in ROUND_THE_TUBE.items()}
    models[Quantity.FOLDED_HEIGHT] = _folded_model(folded).times("press_factor", factor)
    for name, value in sizes(actuator.design, actuator.laminate, factors).items():
        if name != "thickness":
            quantity = Quantity.of(name)
            yield Figure(quantity, value, models.get(quantity, GEOMETRY))


def _folded_model(folded: FoldedHeight) -> Model:
    """Return the model of a folded height, without its factor."""
    trust = AS_BOUGHT if folded.molten and folded.factor == 1 else SOLID
    trust += ", the others this share of it" if folded.molten and folded.factor != 1 else ""
    trust += f"; {folded.remark}" if folded.remark else ""
    return Model(ModelId.FILMS, "Sec. 2", trust)


def _mass(laminate: Laminate) -> Figure | LeftOut:
    try:
        grams = film_mass(laminate)
    except DesignError as error:
        return LeftOut("mass", str(error), (Quantity.MASS,))
    trust = "exact for the films, masks, tabs and ears included; without tubing, glue and fluid"
    return Figure(Quantity.MASS, grams, Model(ModelId.FILM_MASS, "", trust))


def _tubes(actuator: Actuator) -> Iterator[Figure | LeftOut]:
    if not actuator.laminate.inlets:
        yield LeftOut("tube", "it has no inlet strip: tubes are glued on holes of its films")
        return
    inlet = min(actuator.laminate.inlets, key=lambda inlet: inlet.width - inlet.tube_diameter)
    model = Model(
        ModelId.HALF_PERIMETER,
        "a flat strip opened round, its PTFE beside the tube",
        "cut at its narrowest; films do not stretch; glue not counted",
    )
    narrowest = inlet.width - actuator.design.strip_loss
    most = largest_tube(narrowest, actuator.design.films.ptfe.thickness)
    yield Figure(Quantity.LARGEST_TUBE, most, model)
    tube = inlet.tube_diameter
    yield Figure(Quantity.TUBE_ROOM, most - tube, model, Conditions(tube=tube))


def plate_of(laminate: Laminate) -> Region | None:
    """Return the profile of the topmost film, if it has neither tabs nor ears."""
    if laminate.balloons == 1 or laminate.registration == "ears":
        return None
    return laminate.tpe_layers[-1].profile


def _stiffness(actuator: Actuator) -> Iterator[Figure | LeftOut]:
    """Yield the bending stiffness of a full actuator by the paper's cantilever formula."""
    quantity = Quantity.REFERENCE_STIFFNESS
    name = quantity.named(Conditions())
    plate = plate_of(actuator.laminate)
    if not actuator.radii:
        yield LeftOut(name, "the paper measured no modulus of oblong balloons", (quantity,))
        return
    if not actuator.has_the_papers_film:
        yield LeftOut(name, NOT_MEASURED, (quantity,))
        return
    if plate is None:
        reason = "the topmost film is not the plain outline: it has tabs or ears"
        yield LeftOut(name, reason, (quantity,))
        return
    measured = paper.MODULUS_3DOF if actuator.form.is_parallel else paper.MODULUS_1DOF
    least, _ = second_moments(plate)
    yield Figure(Quantity.SECOND_MOMENT, least, GEOMETRY)
    model = Model(
        ModelId.CANTILEVER,
        f"Sec. 4.4, E = {measured.value:g} kPa as measured there",
        "order of magnitude: E is the paper's of its own actuators, not predicted, and its I is "
        "not given",
    )
    value = tip_stiffness(measured.value, least, actuator.reference_height)
    yield Figure(quantity, value, model)


def _diameter_relation(actuator: Actuator, wrap: Wrap) -> Relation:
    """Return the diameter round the tube against the volume of a balloon."""
    k = actuator.kinematics[0]
    stroke = np.linspace(0, k.largest_stroke, SAMPLES)
    around = wrap.tube_diameter + 2 * (actuator.thickness + stroke)
    lines = [Trace(k.model.name, k.volume(stroke).tolist(), around.tolist(), k.model)]
    label = f"paper: about {paper.RADIAL_FULL.value:g} mm inflated"
    if (actuator.form.pockets, actuator.balloons) == (PAPER_SLOTS, 1):
        lines.append(Trace(label, [0.0, k.largest_volume], [paper.RADIAL_FULL.value] * 2))
    return Relation(
        "diameter",
        "Diameter round the tube against volume",
        "volume a balloon, ul",
        "diameter, mm",
        tuple(lines),
    )
