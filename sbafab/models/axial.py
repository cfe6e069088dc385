"""Stroke, force, work and time of an actuator whose chambers all hold the same air."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from sbafab.errors import DesignError
from sbafab.models import paper
from sbafab.models.actuator import NOT_MEASURED, Actuator
from sbafab.models.figures import Asked, Figure, LeftOut, Model, Points, Relation, Trace
from sbafab.models.flow import seconds
from sbafab.models.force import force, work_uj
from sbafab.models.kinematics import Kinematics
from sbafab.models.parabola import fullest

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

SAMPLES = 61
SHARES = (0.0, 0.25, 0.75)


def check_asked(actuator: Actuator, asked: Asked) -> None:
    """Raises DesignError for pressures, flows or volumes out of every model's range."""
    force(asked.pressures_kpa, 0.0)
    seconds(0.0, asked.flow_ml_min)
    if actuator.kinematics:
        widest = max(actuator.kinematics, key=lambda k: k.largest_volume)
        widest.stroke(asked.volumes_ul)


def full_model(actuator: Actuator) -> Model:
    """What "full" means."""
    if actuator.radii:
        return Model(
            "the paper's full height",
            "Sec. 4.6: 17.5 mm for 15 balloons of d = 5, in proportion to d",
            "measured, not predicted: one actuator of d = 5; as in the paper, all of the height "
            "counts as stroke",
        )
    return Model(
        "the largest volume", actuator.kinematics[0].model.name, actuator.kinematics[0].model.trust
    )


def strokes(actuator: Actuator, asked: Asked) -> Iterator[Figure | LeftOut]:
    """Full state, the largest volumes, and strokes at the volumes asked for."""
    if actuator.knows_full:
        full = full_model(actuator)
        yield Figure("stroke", "full stroke", actuator.full_stroke, "mm", full)
        yield Figure("stroke", "full height", actuator.full_height, "mm", full)
        for k in actuator.kinematics:
            at_full = float(k.volume(actuator.full_stroke))
            yield Figure("stroke", "volume a balloon at full stroke", at_full, "ul", k.model)
    else:
        yield LeftOut("full stroke, full height, and what is predicted at them", NOT_MEASURED)
    for k in actuator.kinematics:
        yield Figure("stroke", "largest volume a balloon", k.largest_volume, "ul", k.model)
        yield Figure("stroke", "stroke at the largest volume", k.largest_stroke, "mm", k.model)
    if actuator.radii:
        widest = max(actuator.radii)
        drawn_in = 2 * fullest(widest).radius
        by_eqs_1_to_3 = actuator.kinematics[-1].model
        name = "balloon's diameter at the largest volume"
        yield Figure("stroke", name, drawn_in, "mm", by_eqs_1_to_3)
    for volume in asked.volumes_ul:
        for k in actuator.kinematics:
            yield _stroke(k, volume)


def _stroke(k: Kinematics, volume: float) -> Figure | LeftOut:
    name = f"stroke at {volume:g} ul a balloon"
    try:
        return Figure("stroke", name, float(k.stroke(volume)), "mm", k.model)
    except DesignError as error:
        return LeftOut(f"{name}, {k.model.name}", str(error))


def forces(actuator: Actuator, asked: Asked) -> Iterator[Figure]:
    """Blocked force at the pressures asked for, flat and at the paper's shares of full stroke."""
    for pressure in asked.pressures_kpa:
        for share in SHARES if actuator.knows_full else SHARES[:1]:
            at = "flat" if share == 0 else f"at {100 * share:g} % of full stroke"
            for k in actuator.kinematics:
                value = _force(actuator, k, pressure, share * actuator.full_stroke, asked)
                name = f"blocked force{_each(actuator)} at {pressure:g} kPa, {at}"
                yield Figure("force", name, float(value), "N", _force_model(actuator, k, asked))


def _force(
    actuator: Actuator,
    k: Kinematics,
    pressure: float,
    stroke: ArrayLike,
    asked: Asked,
) -> NDArray[np.float64]:
    factor = actuator.form.pushing * asked.calibration.contact_factor
    return factor * force(pressure, k.push(stroke))


def _each(actuator: Actuator) -> str:
    return "" if actuator.form.pushing == actuator.form.stacks else " of one SBA"


def _force_model(actuator: Actuator, k: Kinematics, asked: Asked) -> Model:
    trust = (
        "no film tension, no stretch; for d = 5 at 100 kPa the paper measured 0.76 to 1.24 times "
        "what Eq. 4 says, 0.74 to 1.65 times what Eqs. 1-3 say"
        if actuator.radii
        else "no film tension, no stretch, one balloon stack; not measured"
    )
    model = Model(f"virtual work on {k.model.name}", "Sec. 4.3, F = p dv/dh", trust)
    return model.times("contact factor", asked.calibration.contact_factor)


def power(actuator: Actuator, asked: Asked, mass_g: float | None) -> Iterator[Figure]:
    """Time, work, speed and power density, all of it at the volume of the full stroke: where that
    is not known only times to the volumes asked for, and without a mass no power density.
    """
    first = actuator.kinematics[0]
    whole = None
    if actuator.knows_full:
        chamber = actuator.balloons * float(first.volume(actuator.full_stroke))
        whole = chamber * actuator.form.stacks
        yield Figure("actuation", "volume of all chambers at full stroke", whole, "ul", first.model)
    flow = Model(
        f"{first.model.name} over flow",
        "Sec. 4.5, 7",
        "a liquid at a steady flow into all chambers together, no lag of pump or tube: the paper's "
        "water took 0.92 +- 0.08 s; a gas takes 10 % longer at 10 kPa, and valves much longer",
    )
    if whole is not None:
        time = float(seconds(whole, asked.flow_ml_min))
        name = f"time to full stroke at {asked.flow_ml_min:g} ml/min"
        yield Figure("actuation", name, time, "s", flow)
    for volume in asked.volumes_ul:
        held = volume * actuator.balloons * actuator.form.stacks
        name = f"time to {volume:g} ul a balloon at {asked.flow_ml_min:g} ml/min"
        plain = Model("volume over flow", "Sec. 7", flow.trust)
        yield Figure("actuation", name, float(seconds(held, asked.flow_ml_min)), "s", plain)
    if whole is None:
        return
    bound = Model(
        f"p v with {first.model.name}",
        "Sec. 4.1",
        "end pressure times volume: more than the integral of p dV that the paper means, which the "
        "elastic balloon gives",
    )
    for pressure in asked.pressures_kpa:
        name = f"pneumatic input work at {pressure:g} kPa"
        yield Figure("actuation", name, work_uj(pressure, whole) / 1000, "mJ", bound)
    if asked.pressures_kpa and mass_g is not None:
        yield _power_density(actuator, asked, whole, mass_g)


def _power_density(actuator: Actuator, asked: Asked, whole: float, mass_g: float) -> Figure:
    """At the speed with air, which the paper takes: its pump's flow, up to 10 kPa."""
    time = float(seconds(whole, paper.AIR_FLOW, paper.FULL_KPA))
    highest = max(asked.pressures_kpa)
    push = float(_force(actuator, actuator.kinematics[0], highest, 0.0, asked))
    pushes = actuator.form.stacks / actuator.form.pushing
    model = Model(
        "F v / m",
        "Sec. 7",
        "largest force times mean speed, as in the paper; the two never occur together. No lag of "
        "valve and pump: the paper's 0.067 s of air make it a fifth of this",
    ).times("contact factor", asked.calibration.contact_factor)
    watts = pushes * push * actuator.full_stroke / 1000 / time
    return Figure(
        "actuation",
        f"power density, blocked force flat at {highest:g} kPa and "
        f"{paper.AIR_FLOW / 1000:g} l/min of air",
        watts / (mass_g / 1000),
        "W/kg",
        model,
    )


def stroke_relation(actuator: Actuator) -> Relation:
    """Stroke against volume, by every model of the pockets."""
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


def force_relation(actuator: Actuator, asked: Asked) -> Relation:
    """Force against stroke, to full stroke, at every pressure asked for."""
    most = min(k.largest_stroke for k in actuator.kinematics)
    stroke = np.linspace(0, actuator.full_stroke if actuator.knows_full else most, SAMPLES)
    lines = []
    for pressure in asked.pressures_kpa:
        for k in actuator.kinematics:
            values = _force(actuator, k, pressure, stroke, asked)
            model = _force_model(actuator, k, asked)
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
        places = [share * actuator.full_stroke for share in paper.HEIGHTS]
        label = f"paper: {name}, {paper.FORCE_KPA:g} kPa"
        y, errors = [m.value for m in values_at], [m.error for m in values_at]
        points.append(Points(label, places, y, errors))
    each = _each(actuator)
    return Relation(
        "force",
        f"Blocked force{each} against stroke, by virtual work",
        "stroke at which it is blocked, mm",
        f"blocked force{each}, N",
        tuple(lines),
        tuple(points),
    )
