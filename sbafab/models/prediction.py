"""All figures and curves that the models predict for a design: sizes, stroke, force, work and time
of chambers in step, bending and workspace of parallel ones, and their order in a prediction.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from sbafab.actuators import build
from sbafab.design.outline import read_outline
from sbafab.design.records import Design, Slots
from sbafab.errors import BeyondError, DesignError, GeometryError
from sbafab.geometry.region import Region
from sbafab.laminate.burst import NOT_BURST, burst, is_near_burst, refuse_beyond_burst
from sbafab.laminate.films import PAPER_PRODUCT
from sbafab.laminate.laminate import Laminate, film_mass
from sbafab.models import elastic, paper
from sbafab.models.actuator import NOT_MEASURED, Actuator, NearDiscs, near_discs, why_no_disc
from sbafab.models.calibration import (
    PAPER_3DOF,
    SHARE,
    Reading,
    Uncertainty,
    bonding_products,
    burst_uncertainty,
    factors_of,
    flags_at,
    sizes_of,
    uncertainty_of,
)
from sbafab.models.closed_forms import (
    LOBES,
    ClosedForm,
    bend,
    eqs_1_to_3,
    folded_diameter,
    largest_tube,
    paraboloid_radius,
    second_moments,
    tip_stiffness,
)
from sbafab.models.figures import (
    BY_DISC,
    MODELS,
    NEAR_BURST,
    Factors,
    Figure,
    FigureItem,
    Flag,
    LeftOut,
    Model,
    Prediction,
    PredictionRequest,
    Relation,
    Trace,
    chosen,
)
from sbafab.models.film_elements import Array
from sbafab.models.mechanisms import LEFT_OUT, mechanism_figures
from sbafab.models.paper import Measured, counterpart
from sbafab.models.pneumatics import refuse_pressure, seconds
from sbafab.models.quantity import (
    ANYWHERE,
    OF_STACK,
    OVER_FLOW,
    P_V,
    WORK_ON,
    Conditions,
    ModelId,
    Quantity,
    chamber_count,
)
from sbafab.models.sizes import is_the_papers_3dof, sizes
from sbafab.models.stack import Stack

SAMPLES = 61
LEAST_READING_ERROR = 0.01
"""Relative standard error of a value that was measured on an actuator, which is assumed."""
BY_STACK = (
    *(Quantity.BLOCKED_FORCE, Quantity.BENT_FORCE, *elastic.BENDS),
    *(Quantity.WATER_TIME, Quantity.WATER_HEIGHT),
    *(Quantity.HELD_STIFFNESS, Quantity.SHUT_STIFFNESS),
)
"""Quantities for which balloons' maps are computed."""
GEOMETRY, CURVATURE = MODELS["geometry"], MODELS["constant-curvature"]
FLAT_PLATES = MODELS["flat-plates"]
SIZES = {
    Quantity.DEFLATED_DIAMETER: MODELS["tube-and-films"],
    Quantity.REACHED_DIAMETER: MODELS["lens"],
    Quantity.INFLATED_DIAMETER: MODELS["cylinder"],
}
"""Models of sizes that the press changes."""
PAPER_SLOTS = Slots(width=10.0, run=8.5)
"""The paper's SBAs of 11.5 x 20 mm less a bond of 0.75 all round (Sec. 2.1)."""
AT_REFERENCE = (
    *(Quantity.REFERENCE_STROKE, Quantity.REFERENCE_HEIGHT, Quantity.REFERENCE_VOLUME),
    *(Quantity.TOTAL_VOLUME, Quantity.REFERENCE_TIME, Quantity.WORK_BOUND, Quantity.POWER_DENSITY),
)
"""Quantities that are known with the reference stroke alone."""
GROUPS = ("size", "inlet", "strength", "stroke", "force", "actuation", "bending", "stiffness")
EXACT_GROUPS = ("size", "inlet")
"""Groups of figures that are computed for a drawn pocket itself."""


def predict(
    design: Design,
    request: PredictionRequest | None = None,
    laminate: Laminate | None = None,
    quick: bool = False,
) -> Prediction:
    """Return the figures of a design of any family, and its curves when these are asked for;
    ``quick`` leaves out curves and the elastic stack. If factors are given, intervals are not
    computed, and figures are not flagged for lying outside the checked part of a balloon's map.

    Raises DesignError if the design cannot be built, or for pressures, a flow or volumes that
    are out of range.
    """
    asked_request = request or PredictionRequest()
    uncertainty = None
    checks_maps = asked_request.calibration is None and asked_request.wanted is None
    try:
        flat = laminate or build(design)
    except GeometryError as error:
        raise DesignError(f"design {design.name} cannot be resolved: {error}") from None
    discs = near_discs(design) if asked_request.wanted is None else None
    discs = discs if discs and discs.is_round else None
    form = discs and discs.form(design, discs.equal)
    before: tuple[Figure, ...] = ()
    if asked_request.calibration is None:
        uncertainty = uncertainty_of(design, flat, form, asked_request.tip_load)
        if asked_request.measured:
            before = predict(design, replace(asked_request, measured=()), flat, quick).figures
            uncertainty = _built(
                uncertainty, Actuator(design, flat, Factors(), form), asked_request
            )
        plain = Factors(tip_load=asked_request.tip_load)
        factors = uncertainty.factors if uncertainty else plain
        asked_request = replace(asked_request, calibration=factors)
    subject = Actuator(design, flat, asked_request.factors, form)
    _check_request(subject, asked_request)
    burst_at = {kpa: _past_burst(flat, kpa) for kpa in asked_request.pressures_kpa}
    past = [LeftOut.of(f"all figures at {kpa:g} kPa", why) for kpa, why in burst_at.items() if why]
    below = tuple(kpa for kpa, why in burst_at.items() if not why)
    request = replace(asked_request, pressures_kpa=below)
    moved = uncertainty.moved if uncertainty else ()
    (state, *others), guides = _states(subject, moved, request, quick), elastic.Guides()
    items = _figures(state, request, guides, checks_maps=checks_maps)
    if uncertainty is not None:
        moved_items = (_figures(each, request, guides, checks_films=False) for each in others)
        items = uncertainty.bounded(items, moved_items, request.probability)
    if discs is not None:
        ends = []
        for diameter in (discs.inner, discs.outer):
            end = replace(subject, drawn_as=discs.form(design, diameter))
            is_same = diameter == discs.equal
            [there] = [state] if is_same else _states(end, (), request, quick)
            ends.append(items if is_same else _figures(there, request, guides))
        items = list(_by_discs(items, ends, discs))
    items = [*(_flagged(item, flat) for item in items), *past]
    figures = chosen(
        (item for item in items if isinstance(item, Figure)),
        OF_STACK if quick and subject.radii else (),
        uncertainty is not None,
    )
    return Prediction(
        asked_request,
        tuple(replace(figure, measured=_measured(figure, subject)) for figure in figures),
        tuple(item for item in items if isinstance(item, LeftOut)),
        before,
        tuple if quick else partial(_relations, state, request, discs),
    )


def _built(
    uncertainty: Uncertainty | None, actuator: Actuator, request: PredictionRequest
) -> Uncertainty:
    """Return the uncertainty of an actuator given the values measured on it.

    Raises DesignError for one that no calibrated model predicts, or that contradicts the
    prediction.
    """
    if uncertainty is None:
        raise DesignError(
            "measured values narrow the prediction of a calibration, but models.calibration = "
            '"none"; give a calibration or omit the measured values'
        )
    readings = []
    for text, quantity, at, value in request.measured:
        kpa = () if at.kpa is None else (at.kpa,)
        asked = replace(request, pressures_kpa=kpa, calibration=uncertainty.factors)
        asked = replace(asked, measured=(), wanted=(quantity, at))
        subject = replace(actuator, factors=uncertainty.factors)
        states = _states(subject, uncertainty.moved, asked, quantity not in BY_STACK)
        guides = elastic.Guides()
        figures = [
            _figure_of(_figures(state, asked, guides, checks_films=False), quantity, at, text)
            for state in states
        ]
        readings.append(Reading(text, value, LEAST_READING_ERROR, figures))
    return uncertainty.built(readings)


def figure(
    design: Design,
    laminate: Laminate,
    quantity: Quantity,
    at: Conditions = ANYWHERE,
    pressures_kpa: Sequence[float] = (),
    probability: float | None = None,
) -> Figure:
    """Return the figure of ``predict`` for one quantity at its conditions: by the calibrated model
    if there are several, and the smallest of several chambers.

    Balloons' maps extend to ``pressures_kpa``. With a ``probability`` it has its interval, flags
    and measured counterpart. Raises DesignError if no model predicts it.
    """
    if at.share and quantity is Quantity.BLOCKED_FORCE:
        figure(design, laminate, Quantity.REFERENCE_STROKE)  # what the share is of
    for kpa in (at.kpa,) if at.kpa is not None else ():
        refuse_beyond_burst(laminate, kpa)
    request = PredictionRequest(
        tuple(dict.fromkeys((*pressures_kpa, *((at.kpa,) if at.kpa is not None else ())))),
        at.flow or PredictionRequest.flow_ml_min,
        calibration=None if probability else factors_of(design),
        wanted=(quantity, at),
        probability=probability or SHARE,
    )
    prediction = predict(design, request, laminate, quick=quantity not in BY_STACK)
    return _figure_of((*prediction.figures, *prediction.left_out), quantity, at, design.name)


def _figure_of(
    items: Iterable[FigureItem], quantity: Quantity, at: Conditions, name: str
) -> Figure:
    """Return the figure of a quantity at its conditions among items.

    Raises DesignError with the reason for its omission, or with the ``name`` of the request.
    """
    figures, left_out = [], []
    for item in items:
        if isinstance(item, LeftOut):
            left_out.append(item)
        elif item.is_of(quantity, at):
            figures.append(item)
    calibrated = [item for item in figures if item.model.id in paper.CALIBRATED_MODELS]
    if figures:
        main = [item for item in figures if not item.other]
        return min(calibrated or main or figures, key=lambda item: item.value)
    for item in sorted(left_out, key=lambda item: quantity not in item.quantities):
        if not item.quantities or quantity in item.quantities:
            raise item.error or DesignError(f"{item.name}: {item.reason}")
    raise DesignError(f"no model gives the {quantity.named(at)} of {name}")


def _check_request(actuator: Actuator, request: PredictionRequest) -> None:
    """Raise DesignError for pressures, flows or volumes out of every model's range."""
    refuse_pressure(request.pressures_kpa, actuator.form.works_under_vacuum)
    seconds(0.0, request.flow_ml_min)
    if actuator.pockets:
        max(actuator.pockets, key=lambda each: each.largest_volume).stroke(request.volumes_ul)


def _measured(figure: Figure, actuator: Actuator) -> paper.Counterpart | None:
    """Return the paper's measurement if the figure is far off; None for a folded height with a
    press factor.
    """
    model, form = figure.model, actuator.form
    if model.id is ModelId.FILMS and model.press_factor != 1:
        return None
    is_papers, calibration = (
        is_the_papers_3dof(form, actuator.laminate),
        actuator.factors.calibration,
    )
    at = figure.at
    if figure.quantity is Quantity.BLOCKED_FORCE and actuator.pockets:
        # The nearest of the three heights at which forces were measured.
        share = at.share if at.rise is None else at.rise / actuator.reference_stroke
        at = at._replace(share=min(paper.HEIGHTS, key=lambda height: abs(height - (share or 0.0))))
    return counterpart(form, figure.quantity, at, model.id, calibration, is_papers)


def _past_burst(laminate: Laminate, kpa: float) -> BeyondError | None:
    """Return why there are no figures above the estimated burst pressure; None below it."""
    try:
        refuse_beyond_burst(laminate, kpa)
    except BeyondError as error:
        return error
    return None


def _flagged(item: FigureItem, laminate: Laminate) -> FigureItem:
    """Return a figure, flagged if its pressure is near the estimated burst, omitted if above it."""
    if isinstance(item, LeftOut) or item.at.kpa is None:
        return item
    past = _past_burst(laminate, item.at.kpa)
    if past:
        return LeftOut.of(item.name, past, item.quantity)
    is_near = is_near_burst(laminate, item.at.kpa)
    return replace(item, flags=(*item.flags, NEAR_BURST)) if is_near else item


def _states(
    subject: Actuator, moved: Sequence[Factors], request: PredictionRequest, quick: bool
) -> list[elastic.Inflated]:
    """Return an actuator inflated, also at ``moved`` factors; ``quick`` without stacks."""
    actuators = [subject, *(replace(subject, factors=factors) for factors in moved)]
    stacks = [None if quick else elastic.elastic_stack(subject, request)]
    first = stacks[0]
    for each in actuators[1:]:
        moved_one = isinstance(first, Stack) and elastic.moved_stack(first, subject, each.factors)
        has_new = isinstance(first, Stack) and not moved_one
        stacks.append(elastic.elastic_stack(each, request) if has_new else moved_one or first)
    return elastic.inflated(actuators, stacks, request)


def _figures(
    state: elastic.Inflated,
    request: PredictionRequest,
    guides: elastic.Guides,
    checks_films: bool = True,
    checks_maps: bool = False,
) -> list[FigureItem]:
    """Return all figures, including omitted ones, in the order of their groups."""
    items = list(_geometric_figures(state, request))
    if isinstance(state.stack, LeftOut):
        items.append(state.stack)
    elif state.stack is not None:
        items += elastic.stack_figures(state, request, guides, checks_films, checks_maps)
    return sorted(items, key=lambda item: GROUPS.index(item.group) if item.group else len(GROUPS))


def _geometric_figures(state: elastic.Inflated, request: PredictionRequest) -> Iterator[FigureItem]:
    """Yield the figures of the wanted groups that need no stack."""
    actuator, mass = state.actuator, _mass(state.actuator.laminate)
    form, laminate = actuator.form, actuator.laminate
    parts: list[tuple[str, Iterable[FigureItem]]] = [
        ("size", _sizes(actuator)),
        ("size", _folding(actuator) if actuator.pockets and form.is_parallel else ()),
        ("size", _weights(actuator, mass)),
        ("inlet", _tubes(actuator)),
        ("strength", () if form.works_under_vacuum else _burst(laminate, request.probability)),
        ("force", _flat_forces(actuator, request)),
    ]
    if actuator.pockets and form.mechanism is None:
        parts += [
            ("stroke", _strokes(actuator, request)),
            ("", elastic.free_strokes(state)),
            ("force", _forces(actuator, request)),
            ("actuation", _power(actuator, request, mass)),
            ("bending", _bending(actuator) if form.is_parallel else ()),
            ("stiffness", _stiffness(actuator)),
        ]
    else:
        parts.append(("", _without_pockets(actuator, request)))
    for group, items in parts:
        if not group or request.wants(group):
            yield from items


def _without_pockets(actuator: Actuator, request: PredictionRequest) -> Iterator[FigureItem]:
    """Yield the figures of a mechanism, or the reason why a drawn pocket has none."""
    mechanism = actuator.form.mechanism
    if mechanism is not None:
        yield from mechanism_figures(mechanism, actuator.laminate, request.pressures_kpa)
        for name in LEFT_OUT[mechanism.kind]:
            yield LeftOut(name, f"the model of its mechanism, {mechanism.kind}, gives none")
        return
    of_force = "force once the plates part" if any(_flat_forces(actuator, request)) else "force"
    for name in ("stroke", of_force, "actuation", "bending", "folded diameter"):
        yield LeftOut(name, why_no_disc(actuator.design))


# Drawn pockets: figures between those of two discs, and a bound that holds for any outline.


def _by_discs(
    items: list[FigureItem], bounds: Sequence[list[FigureItem]], discs: NearDiscs
) -> Iterator[FigureItem]:
    """Yield figures for the disc of equal area, each between those for the discs of ``bounds``.

    A figure that one of the bounds lacks is omitted.
    """
    values_of = [
        {figure.key: figure.value for figure in bound if isinstance(figure, Figure)}
        for bound in bounds
    ]
    for item in items:
        if isinstance(item, LeftOut) or item.model is FLAT_PLATES or item.group in EXACT_GROUPS:
            yield item
            continue
        values = [item.value, *(of[item.key] for of in values_of if item.key in of)]
        if len(values) <= len(bounds):
            reason = "a disc within or round the drawn pocket has none"
            yield LeftOut(item.name, reason, (item.quantity,))
        else:
            between = min(values), max(values)
            yield replace(item, model=_by_disc(item.model, discs), between=between)


def _by_disc(model: Model, discs: NearDiscs) -> Model:
    """Return a model applied to a disc in place of the drawn pocket."""
    return replace(
        model,
        by_disc=True,
        trust=f"{model.trust}; the drawn pocket taken for a disc of d = {discs.equal:.4g} mm, "
        f"bounds by the discs within and round it, {discs.inner:.4g} and {discs.outer:.4g} mm, "
        "where a wider pocket rises more and pushes harder",
    )


def _flat_forces(actuator: Actuator, request: PredictionRequest) -> Iterator[Figure]:
    """Yield upper bounds of the blocked force of drawn pockets, before the plates separate."""
    drawing = actuator.design.drawing
    if drawing is None or actuator.form.wrap is not None:
        return
    area = actuator.form.pushing * read_outline(drawing).area
    for kpa in request.pressures_kpa:
        yield Figure(Quantity.FORCE_BOUND, kpa * area / 1000, FLAT_PLATES, Conditions(kpa=kpa))


# Sizes, mass, inlet and burst.


def _sizes(actuator: Actuator) -> Iterator[Figure]:
    """Yield flat sizes, and diameters around the tube for radial designs."""
    folded = actuator.folded
    factor = folded.factor if folded.molten else 1.0
    trust = "masks and films that do not melt in a press step keep their thickness"
    if folded.molten and factor == 1:
        trust = "nominal: films that melt in the press flow, and no press factor is given"
    elif folded.molten:
        trust += ", the others this share of it"
    trust += f"; {folded.remark}" if folded.remark else ""
    models = SIZES | {Quantity.FOLDED_HEIGHT: Model(ModelId.FILMS, "Sec. 2", trust)}
    for name, value in sizes(actuator.design, actuator.laminate, actuator.factors).items():
        if name != "thickness":
            quantity = Quantity.of(name)
            model = models.get(quantity)
            model = replace(model, press_factor=factor) if model else GEOMETRY
            yield Figure(quantity, value, model)


def _folding(actuator: Actuator) -> Iterator[FigureItem]:
    """Yield the diameter of a channel that three folded lobes pass."""
    quantity, stacks = Quantity.FOLDED_DIAMETER, actuator.form.stacks
    if stacks != LOBES:
        reason = f"the model is of {LOBES} lobes folded into a triangle; this design has {stacks}"
        yield LeftOut("folded diameter", reason, (quantity,))
        return
    factor = actuator.folded.factor if actuator.folded.molten else 1.0
    width = 2 * max(actuator.radii) + 2 * actuator.design.bond.width
    value = folded_diameter(width, actuator.thickness)
    yield Figure(quantity, value, replace(MODELS["folded-lobes"], press_factor=factor))


def _mass(laminate: Laminate) -> FigureItem:
    try:
        return Figure(Quantity.MASS, film_mass(laminate), MODELS["film-mass"])
    except DesignError as error:
        return LeftOut.of("mass", error, Quantity.MASS)


def _weights(actuator: Actuator, mass: FigureItem) -> Iterator[FigureItem]:
    yield mass
    if isinstance(mass, LeftOut) and actuator.pockets:
        yield LeftOut("power density", mass.reason, (Quantity.POWER_DENSITY,))


def _tubes(actuator: Actuator) -> Iterator[FigureItem]:
    if not actuator.laminate.inlets:
        yield LeftOut("tube", "it has no inlet strip: tubes are glued on holes of its films")
        return
    inlet = min(actuator.laminate.inlets, key=lambda inlet: inlet.width - inlet.tube_diameter)
    narrowest, tube = inlet.width - actuator.design.strip_loss, inlet.tube_diameter
    most = largest_tube(narrowest, actuator.design.films.ptfe.thickness)
    model = MODELS["half-perimeter"]
    yield Figure(Quantity.LARGEST_TUBE, most, model)
    yield Figure(Quantity.TUBE_ROOM, most - tube, model, Conditions(tube=tube))


def _burst(laminate: Laminate, probability: float) -> Iterator[FigureItem]:
    """Yield the burst pressure with our own interval."""
    estimate = burst(laminate)
    if estimate is None:
        yield LeftOut("burst pressure", NOT_BURST, (Quantity.BURST,))
        return
    interval, missed = burst_uncertainty(estimate, probability)
    pocket = "round pocket" if estimate.is_round else "pocket, taken for a long one,"
    model = MODELS["film-stress"].filled(burst=paper.BURST, pocket=pocket)
    flags = flags_at(missed)
    yield Figure(Quantity.BURST, estimate.kpa, model, interval=interval, flags=flags)


# Strokes, forces, work and time of chambers in step.


def _strokes(actuator: Actuator, request: PredictionRequest) -> Iterator[FigureItem]:
    """Yield the full state, the largest volumes, and strokes at each volume of the request."""
    stroke = actuator.reference_stroke
    if actuator.has_reference:
        first = actuator.pockets[0].model
        model, flags = Model(ModelId.LARGEST_VOLUME, first.name, first.trust), tuple[Flag, ...]()
        if actuator.radii:
            at = sizes_of(actuator.form, actuator.laminate)
            model, flags = MODELS["scaled-height"], flags_at(at.farther(PAPER_3DOF))
        yield Figure(Quantity.REFERENCE_STROKE, stroke, model, flags=flags)
        yield Figure(Quantity.REFERENCE_HEIGHT, actuator.reference_height, model, flags=flags)
        for each in actuator.pockets:
            yield Figure(Quantity.REFERENCE_VOLUME, float(each.volume(stroke)), each.model)
    else:
        name = "reference stroke and height, and what is predicted at them"
        error = DesignError(f"reference stroke: {NOT_MEASURED}")
        yield LeftOut(name, NOT_MEASURED, AT_REFERENCE, error)
    for each in actuator.pockets:
        yield Figure(Quantity.LARGEST_VOLUME, each.largest_volume, each.model)
        yield Figure(Quantity.LARGEST_STROKE, each.largest_stroke, each.model)
    if actuator.radii:
        widest = eqs_1_to_3(max(actuator.radii))
        drawn_in = 2 * paraboloid_radius(widest.largest_volume, widest.largest_stroke)
        yield Figure(Quantity.BALLOON_DIAMETER, drawn_in, actuator.pockets[-1].model)
    quantity = Quantity.VOLUME_STROKE
    for volume in request.volumes_ul:
        for each in actuator.pockets:
            at_volume = Conditions(volume=volume)
            try:
                yield Figure(quantity, float(each.stroke(volume)), each.model, at_volume)
            except DesignError as error:
                name = f"{quantity.named(at_volume)}, {each.model.name}"
                yield LeftOut(name, str(error), (quantity,))


def _pushes(
    actuator: Actuator, request: PredictionRequest
) -> Iterator[tuple[Model, Callable[[float, ArrayLike], Array]]]:
    """Yield the blocked force in N at a pressure in kPa and strokes in mm, by every model: virtual
    work, F dh = p dv.
    """
    trust = (
        "no film tension, no stretch; for d = 5 at 100 kPa the paper measured 0.76 to 1.24 times "
        "what Eq. 4 says, 0.74 to 1.65 times what Eqs. 1-3 say"
        if actuator.radii
        else "no film tension, no stretch, one balloon stack; not measured"
    )
    for each in actuator.pockets:
        model = Model(WORK_ON[each.model.id], "Sec. 4.3, F = p dv/dh", trust)

        def push(pressure: float, stroke: ArrayLike, each: ClosedForm = each) -> Array:
            return np.asarray(actuator.form.pushing * pressure * each.push(stroke) / 1000)

        yield model, push


def _each(actuator: Actuator) -> str:
    return "" if actuator.form.pushing == actuator.form.stacks else "sba"


def _forces(actuator: Actuator, request: PredictionRequest) -> Iterator[Figure]:
    """Yield the blocked force at each pressure, flat and at the paper's shares of the reference
    stroke.
    """
    shares = paper.HEIGHTS if actuator.has_reference else paper.HEIGHTS[:1]
    products = set(bonding_products(actuator.laminate))
    sizes_here = sizes_of(actuator.form, actuator.laminate)
    farther = sizes_here.farther(PAPER_3DOF, products != {PAPER_PRODUCT})
    flags = flags_at(farther) if actuator.radii else ()
    every = product(request.pressures_kpa, shares)
    usual = (Conditions(kpa=kpa, share=share) for kpa, share in every)
    for at in request.places(usual, Quantity.BLOCKED_FORCE):
        if at.rise is not None and actuator.radii:
            continue  # it may lie beyond the closed forms' largest stroke
        stroke = (at.share or 0.0) * actuator.reference_stroke if at.rise is None else at.rise
        for model, push in _pushes(actuator, request):
            value = float(push(at.kpa or 0.0, stroke))
            at_each = at._replace(each=_each(actuator))
            yield Figure(Quantity.BLOCKED_FORCE, value, model, at_each, flags=flags)


def _power(actuator: Actuator, request: PredictionRequest, mass: FigureItem) -> Iterator[Figure]:
    """Yield time, work, speed and power density, all at the volume of the reference stroke.

    Where that is unknown there are only times to the volumes of the request, and without a mass no
    power density.
    """
    first, form, flow = actuator.pockets[0], actuator.form, request.flow_ml_min
    stroke, whole = actuator.reference_stroke, 0.0
    plain = MODELS["volume-over-flow"]
    if actuator.has_reference:
        whole = actuator.balloons * float(first.volume(stroke)) * form.stacks
        yield Figure(Quantity.TOTAL_VOLUME, whole, first.model)
        time = float(seconds(whole, flow))
        over_flow = replace(plain, id=OVER_FLOW[first.model.id], source="Sec. 4.5, 7")
        yield Figure(Quantity.REFERENCE_TIME, time, over_flow, Conditions(flow=flow))
    for volume in request.volumes_ul:
        time = float(seconds(volume * actuator.balloons * form.stacks, flow))
        yield Figure(Quantity.VOLUME_TIME, time, plain, Conditions(volume=volume, flow=flow))
    if not actuator.has_reference:
        return
    bound = replace(MODELS["p-v-eq-4"], id=P_V[first.model.id])
    for pressure in request.pressures_kpa:
        # 1 kPa x 1 ul = 1 uJ.
        work = pressure * whole / 1000
        yield Figure(Quantity.WORK_BOUND, work, bound, Conditions(kpa=pressure))
    if request.pressures_kpa and isinstance(mass, Figure):
        # With the paper's air: its pump's flow, up to 10 kPa.
        time = float(seconds(whole, paper.AIR_FLOW, paper.FULL_KPA))
        highest = max(request.pressures_kpa)
        _, push = next(_pushes(actuator, request))
        watts = form.stacks / form.pushing * float(push(highest, 0.0)) * stroke / 1000 / time
        at = Conditions(kpa=highest, flow=paper.AIR_FLOW)
        yield Figure(Quantity.POWER_DENSITY, watts / (mass.value / 1000), MODELS["power"], at)


# Bending and stiffness of parallel chambers.


class TipPath(NamedTuple):
    """Motion of 1, 2 ... neighbouring chambers from flat to the reference stroke: stroke (mm),
    angle (rad), lateral displacement and height of the tip (mm).
    """

    chambers: int
    stroke: Array
    angle: Array
    aside: Array
    height: Array


def _paths(actuator: Actuator, others_full: bool = False) -> list[TipPath]:
    """Return one path for each number of adjacent chambers; the others flat, or full.

    A path ends when the top has rotated by half a turn.
    """
    axes, stroke = actuator.axes, np.linspace(0, actuator.reference_stroke, SAMPLES)
    rest = actuator.reference_height if others_full else actuator.thickness
    paths = []
    for chambers in range(1, len(axes)):
        lengths = np.full((SAMPLES, len(axes)), rest)
        lengths[:, :chambers] = actuator.lengths(stroke)[:, None]
        bent = bend(lengths, axes)
        aside = np.hypot(bent.tip[:, 0], bent.tip[:, 1])
        columns = stroke, bent.angle, aside, bent.tip[:, 2]
        paths.append(TipPath(chambers, *(column[bent.angle <= math.pi] for column in columns)))
    return paths


def _bending(actuator: Actuator) -> Iterator[FigureItem]:
    """Yield the largest bend of each number of chambers, and the lateral tip displacement."""
    quantity, largest = Quantity.REFERENCE_BEND, Quantity.LARGEST_ASIDE
    if not actuator.has_reference:
        name = "bend and tip displacement at the reference stroke, constant curvature"
        yield LeftOut(name, NOT_MEASURED, (quantity, largest))
        return
    paths = _paths(actuator)
    for path in paths:
        at = Conditions(chambers=path.chambers)
        if len(path.stroke) < SAMPLES:
            reason = "more than half a turn: the tip would come down through the base"
            yield LeftOut(quantity.named(at), reason, (quantity,))
        else:
            yield Figure(quantity, math.degrees(path.angle[-1]), CURVATURE, at)
    reach = max(float(path.aside.max()) for path in (*paths, *_paths(actuator, others_full=True)))
    yield Figure(largest, reach, CURVATURE)


def plate_of(laminate: Laminate) -> Region | None:
    """Return the profile of the topmost film if it has neither tabs nor ears."""
    if laminate.balloons == 1 or laminate.registration == "ears":
        return None
    return laminate.tpe_layers[-1].profile


def _stiffness(actuator: Actuator) -> Iterator[FigureItem]:
    """Yield the bending stiffness of a full actuator by the paper's cantilever formula."""
    quantity, plate = Quantity.REFERENCE_STIFFNESS, plate_of(actuator.laminate)
    reason = ""
    if not actuator.radii:
        reason = "the paper measured no modulus of oblong balloons"
    elif not actuator.has_the_papers_film:
        reason = NOT_MEASURED
    elif plate is None:
        reason = "the topmost film is not the plain outline: it has tabs or ears"
    if reason or plate is None:
        yield LeftOut(quantity.named(Conditions()), reason, (quantity,))
        return
    measured = paper.MODULUS_3DOF if actuator.form.is_parallel else paper.MODULUS_1DOF
    least, _ = second_moments(plate)
    yield Figure(Quantity.SECOND_MOMENT, least, GEOMETRY)
    model = MODELS["cantilever"].filled(modulus=measured.value)
    value = tip_stiffness(measured.value, least, actuator.reference_height)
    yield Figure(quantity, value, model)


# Curves.


def _relations(
    state: elastic.Inflated, request: PredictionRequest, discs: NearDiscs | None
) -> Iterator[Relation]:
    """Yield the curves, of a drawn pocket those by the disc of equal area."""
    for each in _curves(state, request):
        if discs is None:
            yield each
            continue
        lines = [
            replace(line, model=line.model and _by_disc(line.model, discs)) for line in each.lines
        ]
        yield replace(each, title=f"{each.title}, {BY_DISC}", lines=lines)


def _curves(state: elastic.Inflated, request: PredictionRequest) -> Iterator[Relation]:
    actuator, factors = state.actuator, state.actuator.factors
    together = state.stack if isinstance(state.stack, Stack) else None
    if not actuator.pockets:
        return
    yield _stroke_relation(actuator)
    if request.pressures_kpa:
        traces = elastic.force_traces(actuator, request, together) if together else ()
        yield _force_relation(actuator, request, traces)
    if actuator.form.is_parallel:
        if actuator.has_reference:
            yield _bending_relation(actuator, request)
        traces = ()
        if together is not None:
            yield elastic.bend_relation(factors, together)
            traces = elastic.workspace_traces(factors, together)
        reached = workspace_relation(actuator, traces)
        if reached.lines:
            yield reached
    if actuator.form.wrap is not None:
        yield _diameter_relation(actuator, actuator.form.wrap.outer_diameter)


def _trace(label: str, x: ArrayLike, y: ArrayLike, model: Model | None = None) -> Trace:
    return Trace(label, np.asarray(x).tolist(), np.asarray(y).tolist(), model)


def _level(label: str, most: float, measured: Measured) -> Trace:
    """Return the line of a value measured by the paper."""
    return Trace(label, [0.0, most], [measured.value] * 2)


def _points(label: str, x: Sequence[float], measured: Sequence[Measured]) -> Trace:
    values, errors = [each.value for each in measured], [each.error for each in measured]
    return Trace(label, x, values, error=errors)


def _is_full_3dof(actuator: Actuator) -> bool:
    """Return True for the stacks whose height and bends the paper measured."""
    return actuator.is_like_paper(3, 2.5) and actuator.balloons == paper.BALLOONS


def _stroke_relation(actuator: Actuator) -> Relation:
    """Return stroke against volume, by every model of the pockets."""
    lines, points = [], []
    for k in actuator.pockets:
        stroke = np.linspace(0, k.largest_stroke, SAMPLES)
        lines.append(_trace(k.model.name, k.volume(stroke), stroke, k.model))
    if actuator.is_like_paper(1, paper.VALID_RADIUS):
        for fluid, volume, error in paper.VALID:
            label = f"paper: Eq. 4 within {error.value:g} mm a balloon to here ({fluid})"
            stroke_there = float(actuator.pockets[0].stroke(volume))
            slack = error.value * actuator.balloons
            points.append(Trace(label, [volume], [stroke_there], error=[slack]))
    if _is_full_3dof(actuator):
        most, high = max(k.largest_volume for k in actuator.pockets), paper.FULL_HEIGHT
        lines.append(_level(f"paper: {high.value:g} mm high when full", most, high))
    mean = "mean volume" if len(set(actuator.radii)) > 1 else "volume"
    axes = f"{mean} a balloon, ul", "stroke of the stack, mm"
    return Relation("stroke", "Stroke against volume", *axes, lines, points)


def _force_relation(
    actuator: Actuator, request: PredictionRequest, traces: Sequence[Trace]
) -> Relation:
    """Return force against stroke, to the reference stroke, at every pressure of the request."""
    most = min(k.largest_stroke for k in actuator.pockets)
    stroke = np.linspace(0, actuator.reference_stroke if actuator.has_reference else most, SAMPLES)
    lines = [
        _trace(f"{k.model.name}, {pressure:g} kPa", stroke, push(pressure, stroke), model)
        for pressure in request.pressures_kpa
        for k, (model, push) in zip(actuator.pockets, _pushes(actuator, request), strict=True)
    ]
    places = [share * actuator.reference_stroke for share in paper.HEIGHTS]
    points = [
        _points(f"paper: {stacks}-DoF, {paper.FORCE_KPA:g} kPa", places, measured)
        for stacks, measured in ((1, paper.FORCE_1DOF), (3, paper.FORCE_3DOF))
        if actuator.is_like_paper(stacks, 2.5)
    ]
    each = " of one SBA" if _each(actuator) else ""
    title = f"Blocked force{each} against stroke, by virtual work"
    axes = "stroke at which it is blocked, mm", f"blocked force{each}, N"
    return Relation("force", title, *axes, [*lines, *traces], points)


def _bending_relation(actuator: Actuator, request: PredictionRequest) -> Relation:
    """Return bend against time, each chamber fed at the flow of the request."""
    trust, flow = f"{CURVATURE.trust}; no lag of pump or tube", request.flow_ml_min
    model = Model(ModelId.CURVATURE_OVER_FLOW, CURVATURE.source, trust)
    lines, points = [], []
    for path in _paths(actuator):
        content = actuator.pockets[0].volume(path.stroke) * actuator.balloons
        label = f"{chamber_count(path.chambers)} inflated, the others flat"
        lines.append(_trace(label, seconds(content, flow), np.degrees(path.angle), model))
    if _is_full_3dof(actuator):
        most, largest = max(max(line.x) for line in lines), paper.LARGEST_BEND
        if flow == paper.WATER_FLOW:
            times = [time for time, _ in paper.BENDING]
            angles = [angle for _, angle in paper.BENDING]
            points.append(_points("paper: time to steady angles", times, angles))
            most = max(times)
        label = f"paper: largest bend, {largest.value:g} +- {largest.error:g} deg"
        lines.append(_level(label, most, largest))
    axes = f"time with {flow:g} ml/min into each inflated chamber, s", "bend of the top, deg"
    return Relation("bending", "Bending against time", *axes, lines, points)


def workspace_relation(actuator: Actuator, traces: Sequence[Trace] = ()) -> Relation:
    """Return the tip paths in the plane in which adjacent chambers bend; without constant-curvature
    curves if the reference stroke is unknown.
    """
    rests = (("flat", False), ("full", True)) if actuator.has_reference else ()
    lines = []
    for rest, others_full in rests:
        for path in _paths(actuator, others_full):
            label = f"{chamber_count(path.chambers)}, the others {rest}"
            lines.append(_trace(label, path.aside, path.height, CURVATURE))
    points = []
    if _is_full_3dof(actuator):
        high = paper.FULL_HEIGHT.value
        points.append(Trace(f"paper: all full, {high:g} mm", [0.0], [high], error=[0.0]))
    axes = "reach aside, mm", "height of the tip, mm"
    return Relation("workspace", "Paths of the tip", *axes, [*lines, *traces], points)


def _diameter_relation(actuator: Actuator, tube: float) -> Relation:
    """Return the diameter around the tube against the volume of a balloon."""
    k, full = actuator.pockets[0], paper.RADIAL_FULL
    stroke = np.linspace(0, k.largest_stroke, SAMPLES)
    around = tube + 2 * (actuator.thickness + stroke)
    lines = [_trace(k.model.name, k.volume(stroke), around, k.model)]
    if (actuator.form.pockets, actuator.balloons) == (PAPER_SLOTS, 1):
        label = f"paper: about {full.value:g} mm inflated"
        lines.append(_level(label, k.largest_volume, full))
    axes = "volume a balloon, ul", "diameter, mm"
    return Relation("diameter", "Diameter round the tube against volume", *axes, lines)
