"""Values of the models at the points of a measured curve, or why there are none."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from sbafab.actuators import build, load_design, records
from sbafab.design.files import toml_tables
from sbafab.design.records import Design, validated
from sbafab.errors import DesignError
from sbafab.laminate.laminate import Laminate
from sbafab.models import elastic, paper
from sbafab.models.balloon import Balloon
from sbafab.models.balloon_map import MOST_STRETCH, stretch
from sbafab.models.balloons import balloons_of
from sbafab.models.figures import Factors, Figure, PredictionRequest
from sbafab.models.film_elements import Array
from sbafab.models.formulas import modulus, second_moments, usual_pressures
from sbafab.models.kinematics import Actuator, actuator
from sbafab.models.pneumatics import AIR, TUBE_DIAMETER, TUBE_LENGTH, Line
from sbafab.models.prediction import plate_of, predict
from sbafab.models.quantity import ANYWHERE, Quantity, chamber_count
from sbafab.models.rippled import free_shapes
from sbafab.models.stack import MOST_PRESSURE, Plate, Pose, Stack, stack
from sbafab.models.unknowns import UNKNOWNS
from sbafab.validation.records import MeasuredActuator, MeasuredCurve

ModelValue = float | None
"""A value of a model; None if the model has no such state."""
SAMPLES = 16
LEAST_FREE_KPA, FIRST_KPA, MOST_FREE_KPA = 0.002, 0.5, 20.0
"""Pressures between which a single balloon is inflated, and the first end of its range."""
NO_TUBE = 1e-3
"""Length in mm of a tube that takes no pressure."""
OPEN_PRESSURES = (10.0, 30.0, 100.0)
"""Pressures in kPa to assume if a source does not state one: from the paper's full actuation
(Sec. 4.5) to the pressure of its forces (Sec. 4.3)."""
LEAST_RATIO = UNKNOWNS[0].least
"""Modulus ratio for which maps are made; maps of stiffer films reach further."""


@dataclass(frozen=True)
class ModelValues:
    """Values of a model at a curve's points, in its unit.

    ``series`` maps each assumption on the set-up, as a phrase, to one value for each point. The
    phrase is "" if nothing is assumed.
    """

    model: str
    series: Mapping[str, tuple[ModelValue, ...]]

    def ranges(self) -> list[tuple[float, float] | None]:
        """Return the least and largest value over the assumptions at each point.

        None for a point at which no assumption has a value.
        """
        ends: list[tuple[float, float] | None] = []
        for values in zip(*self.series.values(), strict=True):
            known = [value for value in values if value is not None]
            ends.append((min(known), max(known)) if known else None)
        return ends


class NoModel(NamedTuple):
    """The reason why no model has values of a curve."""

    reason: str


def model_values(
    curve: MeasuredCurve, factors: Factors | None = None, shares_maps: bool = False
) -> ModelValues | NoModel:
    """Return the values of the models at a curve's points, or why there are none.

    ``factors`` come from a calibration; by default the models use none. For an open set-up, every
    assumption that matters gives one series. ``shares_maps`` is for fits with many factors.
    """
    answer = ANSWERS.get(curve.quantity)
    if answer is None:
        return NoModel(WITHOUT_MODEL[curve.quantity])
    if not curve.actuator.is_described:
        return NoModel("no design describes the actuator")
    try:
        return answer(ModelledActuator(curve.actuator, factors or Factors(), shares_maps), curve)
    except DesignError as error:
        return NoModel(str(error))


WITHOUT_MODEL = {
    "geometric_kpa": "no model: the elastic ones stretch at every pressure",
    "success_share": "no model: leaks and over-melting are not in any of them",
    "build_time_h": "no model: the schedule's minutes are the paper's",
    "cutting_error_mm": "no model: it is an input",
    "pin_error_mm": "no model: it is an input",
    "density_kg_m3": "no model: it is an input",
}
"""Why a quantity has no model."""


def _text(measured: MeasuredActuator) -> str:
    """Return the description of an actuator, as a key of caches."""
    return json.dumps([measured.design, dict(measured.changes), measured.toml], sort_keys=True)


@lru_cache(maxsize=64)
def measured_design(text: str) -> tuple[Design, Laminate]:
    """Return design and laminate of a measured actuator by its text. Raises DesignError."""
    name, changes, toml = json.loads(text)
    if toml:
        tables = toml_tables(toml, "the record's design")
        # The record contains every value of the kit.
        tables.pop("kit", None)
        design = validated(tables, records(), Path())
    else:
        design = load_design(name, [changes])
    return design, build(design)


@lru_cache(maxsize=64)
def _drawn_stack(text: str, loss: float) -> tuple[Stack, Factors]:
    factors = Factors(pocket_loss=loss, modulus_ratio=LEAST_RATIO)
    return stack(*measured_design(text), factors=factors), factors


def drawn_stack(measured: MeasuredActuator, loss: float) -> tuple[Stack, Factors]:
    """Return the stack with a pocket loss in mm at the least modulus ratio, and its factors.

    Its maps also serve all other factors.
    """
    return _drawn_stack(_text(measured), loss)


@dataclass(frozen=True)
class ModelledActuator:
    """The actuator of a curve for the models; parts are built on first use.

    With ``shares_maps``, one map of its balloons serves every modulus and press factor: poses are
    then within 1 % of poses from dedicated maps, and take less than a second.
    """

    measured: MeasuredActuator
    factors: Factors
    shares_maps: bool = False

    @cached_property
    def design(self) -> Design:
        """The design. Raises DesignError."""
        return measured_design(_text(self.measured))[0]

    @cached_property
    def laminate(self) -> Laminate:
        """The laminate. Raises DesignError."""
        return measured_design(_text(self.measured))[1]

    @cached_property
    def actuator(self) -> Actuator:
        """The actuator of the geometric models. Raises DesignError."""
        return actuator(self.design, self.laminate, self.factors)

    @cached_property
    def stack(self) -> Stack:
        """The elastic stack. Raises DesignError for pockets that are not round."""
        if self.shares_maps:
            together, base = drawn_stack(self.measured, self.factors.pocket_loss)
            moved = elastic.moved_stack(together, self.laminate, base, self.factors)
            if moved is not None:
                return moved
        return stack(self.design, self.laminate, factors=self.factors)

    @cached_property
    def name(self) -> str:
        """The name of the elastic stack with its factors."""
        return elastic.calibrated(elastic.FORCE, self.factors).name

    def figure(self, quantity: Quantity) -> Figure:
        """Return the prediction's figure of a quantity. Raises DesignError if it does not exist."""
        pressures = usual_pressures(self.design.form)[-1:]
        request = PredictionRequest(pressures, calibration=self.factors)
        prediction = predict(self.design, request, self.laminate, quick=True)
        for figure in prediction.figures:
            if figure.quantity is quantity:
                return figure
        reasons = (item.reason for item in prediction.left_out if quantity in item.quantities)
        raise DesignError(next(reasons, f"no {quantity.named(ANYWHERE)}"))


def _by_pressure(
    curve: MeasuredCurve, value: Callable[[float], ModelValue]
) -> dict[str, tuple[ModelValue, ...]]:
    """Return a value at each pressure of a curve, by the assumption on the pressure.

    OPEN_PRESSURES are assumed if neither axis nor set-up gives a pressure.
    """

    def reached(pressure: float) -> ModelValue:
        try:
            return value(pressure)
        except DesignError:
            return None

    if curve.x_name == "pressure_kpa":
        return {"": tuple(map(reached, curve.x))}
    count = len(curve.y)
    if curve.setup.pressure_kpa is not None:
        return {"": (reached(curve.setup.pressure_kpa),) * count}
    return {f"{p:g} kPa in the chambers": (reached(p),) * count for p in OPEN_PRESSURES}


def _phrase(*parts: str) -> str:
    return ", ".join(filter(None, parts))


# Forces.


def _forces(of: ModelledActuator, curve: MeasuredCurve) -> ModelValues | NoModel:
    if curve.x_name == "bend_deg" or curve.setup.bend_deg is not None:
        return _bent_forces(of, curve)
    states = _blocked_states(of, curve)
    if isinstance(states, NoModel):
        return states
    series = {}
    for phrase, strokes in states.items():
        series[phrase] = tuple(
            None if stroke is None else _blocked_force(of, curve, pressure, stroke)
            for stroke, pressure in zip(strokes, _pressures(curve), strict=True)
        )
    return ModelValues(of.name, series)


def _blocked_force(
    of: ModelledActuator, curve: MeasuredCurve, pressure: float, stroke: float
) -> float:
    """Return N on a level plate at a stroke in mm."""
    return _pushing(of, curve) * float(elastic.blocked_force(of.stack, pressure, stroke))


def _pushing(of: ModelledActuator, curve: MeasuredCurve) -> int:
    """Return how many chambers push on a level plate."""
    return curve.setup.chambers or of.actuator.form.pushing


def _pressures(curve: MeasuredCurve) -> tuple[float, ...]:
    """Return a pressure in kPa for each value of a force. Raises DesignError."""
    if curve.x_name == "pressure_kpa":
        return curve.x
    if curve.setup.pressure_kpa is None:
        raise DesignError("the set-up names no pressure")
    return (curve.setup.pressure_kpa,) * len(curve.y)


def _blocked_states(
    of: ModelledActuator, curve: MeasuredCurve
) -> dict[str, tuple[ModelValue, ...]] | NoModel:
    """Return the strokes in mm at which a force was measured, by assumption on the full stroke."""
    count = len(curve.y)
    if curve.x_name == "stroke_mm":
        return {"": curve.x}
    if curve.x_name == "height_share":
        return _shares(of, curve.x)
    if curve.setup.stroke_mm is not None:
        return {"": (curve.setup.stroke_mm,) * count}
    if curve.setup.height_share is not None:
        return _shares(of, (curve.setup.height_share,) * count)
    return NoModel("the set-up names no height at which the tip is held")


def _shares(of: ModelledActuator, shares: tuple[float, ...]) -> dict[str, tuple[ModelValue, ...]]:
    """Return the strokes in mm at shares of the full stroke, by the assumption on the full stroke.

    Assumptions are a free stroke at each of OPEN_PRESSURES, or one that the paper gives. Values
    are None if the actuator does not rise freely.
    """
    if not any(shares):
        return {"": shares}
    full: dict[str, ModelValue] = {
        f"full stroke at {pressure:g} kPa": _free_stroke(of.stack, pressure)
        for pressure in OPEN_PRESSURES
    }
    if of.actuator.has_reference:
        full["full height as in Sec. 4.6"] = elastic.stroke_at(of.actuator, 1.0)
        longer = paper.LONGEST_STROKE.value / paper.FULL_HEIGHT.value
        full["full stroke as in Sec. 4.2"] = longer * of.actuator.reference_height
    return {
        phrase: tuple(
            0.0 if share == 0 else None if stroke is None else share * stroke for share in shares
        )
        for phrase, stroke in full.items()
    }


def _free_stroke(whole: Stack, pressure: float) -> ModelValue:
    try:
        return whole.pose((pressure,) * whole.chambers).height - whole.flat_height
    except DesignError:
        return None


def _bent_forces(of: ModelledActuator, curve: MeasuredCurve) -> ModelValues | NoModel:
    counts = _chamber_counts(of, curve)
    if not counts:
        return NoModel("one chamber does not bend")
    given = curve.setup.bend_deg
    angles = curve.x if curve.x_name == "bend_deg" else (given or 0.0,) * len(curve.y)
    pairs = list(zip(angles, _pressures(curve), strict=True))
    return ModelValues(
        of.name,
        {
            _chambers(count, counts): tuple(_bent_force(of.stack, count, *pair) for pair in pairs)
            for count in counts
        },
    )


def _bent_force(whole: Stack, chambers: int, angle: float, pressure: float) -> ModelValue:
    """Return N on a plate square to the tip at an angle; None if it does not bend that far."""
    pose = elastic.pose_bent_by(whole, chambers, angle)
    if pose is None or pose.pressures[0] > pressure:
        return None
    x, y, z = pose.tip.tolist()
    across, aside, along = pose.frames[1][-1][:, 2].tolist()
    plate = Plate((x, y, z), (across, aside, along))
    try:
        return whole.pose(_filled(whole, chambers, pressure), plate=plate, near=pose).force
    except DesignError:
        return None


def _filled(whole: Stack, chambers: int, pressure: float) -> tuple[float, ...]:
    return (pressure,) * chambers + (0.0,) * (whole.chambers - chambers)


def _chamber_counts(of: ModelledActuator, curve: MeasuredCurve) -> list[int]:
    """Return how many chambers may have been pressurised for a bend."""
    given = curve.setup.chambers
    return list(range(1, of.stack.chambers)) if given is None else [given]


def _chambers(count: int, counts: list[int]) -> str:
    """Return the phrase that assumes ``count`` pressurised chambers; "" if the source states it."""
    return chamber_count(count) if len(counts) > 1 else ""


# Strokes, heights and bends.


def _strokes(of: ModelledActuator, curve: MeasuredCurve) -> ModelValues | NoModel:
    is_whole = curve.setup.chambers in (None, of.design.form.stacks)
    if is_whole and curve.x_name != "volume_ul" and not of.shares_maps:
        return _free_strokes(of, curve)
    flat = of.stack.flat_height if curve.quantity == "stroke_mm" else 0.0
    return _risen(of, curve, lambda pose: pose.height - flat)


def _free_strokes(of: ModelledActuator, curve: MeasuredCurve) -> ModelValues:
    """Return strokes or heights with one pressure in all chambers, by the balloons themselves."""
    kinds = Counter(balloons_of(of.design, of.laminate, of.factors))
    flat = 0.0 if curve.quantity == "stroke_mm" else of.actuator.thickness
    model = elastic.calibrated(elastic.ELASTIC, of.factors).name
    series = _by_pressure(curve, lambda p: flat + elastic.free_rise(kinds, p).stroke)
    return ModelValues(model, series)


def _bends(of: ModelledActuator, curve: MeasuredCurve) -> ModelValues | NoModel:
    return _risen(of, curve, lambda pose: pose.bend)


def _risen(
    of: ModelledActuator, curve: MeasuredCurve, value: Callable[[Pose], float]
) -> ModelValues | NoModel:
    """Return values of the free stack's pose at the curve's pressures or volumes."""
    whole = of.stack
    counts = [curve.setup.chambers or whole.chambers]
    if curve.quantity == "bend_deg":
        counts = _chamber_counts(of, curve)
    if not counts:
        return NoModel("one chamber does not bend")
    series = {}
    for count in counts:
        if curve.x_name == "volume_ul":
            poses = (_pose_with(whole, count, volume) for volume in curve.x)
            values = tuple(None if pose is None else value(pose) for pose in poses)
            series[_chambers(count, counts)] = values
            continue
        by_pressure = _by_pressure(curve, _at_pressure(whole, count, value))
        for assumed, values in by_pressure.items():
            series[_phrase(_chambers(count, counts), assumed)] = values
    return ModelValues(of.name, series)


def _at_pressure(
    whole: Stack, chambers: int, value: Callable[[Pose], float]
) -> Callable[[float], ModelValue]:
    return lambda pressure: value(whole.pose(_filled(whole, chambers, pressure)))


def _pose_with(whole: Stack, chambers: int, volume: float) -> Pose | None:
    """Return the free pose with ``volume`` ul added to the pressurised chambers in total.

    None if that takes more than the stack's greatest pressure.
    """
    empty = float(whole.pose((0.0,) * whole.chambers).volumes[:chambers].sum())
    low, high = 0.0, min(whole.most_pressure, MOST_PRESSURE)
    pose = whole.pose(_filled(whole, chambers, high))
    if float(pose.volumes[:chambers].sum()) - empty < volume:
        return None
    for _ in range(40):
        middle = (low + high) / 2
        pose = whole.pose(_filled(whole, chambers, middle))
        is_low = float(pose.volumes[:chambers].sum()) - empty < volume
        low, high = (middle, high) if is_low else (low, middle)
    return pose


def _balloon_strokes(of: ModelledActuator, curve: MeasuredCurve) -> ModelValues | NoModel:
    kinds = set(balloons_of(of.design, of.laminate, of.factors))
    if len(kinds) > 1:
        return NoModel("its balloons are of unlike size")
    (balloon,) = kinds
    model = elastic.calibrated(elastic.ELASTIC, of.factors).name
    if curve.x_name == "volume_ul":
        # A stroke by its volume is the same for every modulus.
        drawn = replace(of.factors, modulus_ratio=1.0)
        balloon = balloons_of(of.design, of.laminate, drawn)[0]
        return ModelValues(model, {"": _strokes_by_volume(balloon, curve.x)})
    series = _by_pressure(curve, lambda p: float(free_shapes(balloon, p).height[0]))
    return ModelValues(model, series)


def _strokes_by_volume(balloon: Balloon, volumes: tuple[float, ...]) -> tuple[ModelValue, ...]:
    """Return the strokes in mm of a free balloon by its volume in ul, to 0.2 %.

    None for a volume that MOST_FREE_KPA does not reach.
    """
    top = FIRST_KPA
    while top < MOST_FREE_KPA and _free_volume(balloon, top) < max(volumes):
        top = min(2 * top, MOST_FREE_KPA)
    held, heights = _filling(balloon, top)
    return tuple(
        None if volume > held[-1] else float(np.interp(volume, held, heights)) for volume in volumes
    )


@lru_cache(maxsize=256)
def _filling(balloon: Balloon, top: float) -> tuple[Array, Array]:
    """Return ul in a free balloon and its height in mm as it fills to a pressure in kPa."""
    shapes = free_shapes(balloon, np.geomspace(LEAST_FREE_KPA, top, SAMPLES))
    return np.append(0.0, shapes.volume), np.append(0.0, shapes.height)


@lru_cache(maxsize=256)
def _free_volume(balloon: Balloon, pressure: float) -> float:
    return float(free_shapes(balloon, pressure).volume[0])


# Work, times, stiffness, sizes.


def _energies(of: ModelledActuator, curve: MeasuredCurve) -> ModelValues | NoModel:
    # Energies are proportional to the modulus at equal pressure over modulus.
    ratio = of.factors.modulus_ratio
    balloons = balloons_of(of.design, of.laminate, replace(of.factors, modulus_ratio=1.0))
    values = []
    for pressure in curve.x:
        stored = sum(_stored(balloon, pressure / ratio) for balloon in balloons)
        values.append(ratio * stored * of.design.form.stacks / 1000)
    return ModelValues(elastic.calibrated(elastic.ELASTIC, of.factors).name, {"": tuple(values)})


@lru_cache(maxsize=1024)
def _stored(balloon: Balloon, pressure: float) -> float:
    """Return the energy in uJ that the films of a free balloon hold. Raises DesignError."""
    shape = free_shapes(balloon, pressure)
    if float(stretch(balloon, shape)[0]) > MOST_STRETCH:
        raise DesignError(f"at {pressure:g} kPa its films would stretch too far")
    return float(shape.energy[0])


def _losses(of: ModelledActuator, curve: MeasuredCurve) -> ModelValues | NoModel:
    """Return work lost, as the calibration's share of the input work."""
    work, share = _energies(of, curve), of.factors.loss_share
    if isinstance(work, NoModel):
        return work
    return ModelValues(
        work.model,
        {"": tuple(None if each is None else share * each for each in work.series[""])},
    )


def _loss_shares(of: ModelledActuator, curve: MeasuredCurve) -> ModelValues:
    """Return the calibration's share of the input work that is lost; 0 without a calibration."""
    model = elastic.calibrated(elastic.ELASTIC, of.factors).name
    return ModelValues(model, {"": (of.factors.loss_share,) * len(curve.y)})


def _times(of: ModelledActuator, curve: MeasuredCurve) -> ModelValues | NoModel:
    flow = curve.setup.flow_ml_min
    if flow is None:
        return NoModel("the set-up names no flow")
    if curve.x_name == "bend_deg":
        counts = _chamber_counts(of, curve)
        if not counts:
            return NoModel("one chamber does not bend")
        return ModelValues(
            f"{of.name}, no tube",
            {
                _chambers(count, counts): tuple(
                    _time_to_bend(of, count, angle, curve) for angle in curve.x
                )
                for count in counts
            },
        )
    given = curve.setup.tube_mm
    tubes = {"no tube": NO_TUBE, f"{TUBE_LENGTH:g} mm of tube": TUBE_LENGTH}
    if given is not None:
        tubes = {"": max(given, NO_TUBE)}
    bore = curve.setup.tube_bore_mm or TUBE_DIAMETER
    is_air = curve.setup.fluid != "water"
    if not is_air and bore != TUBE_DIAMETER:
        return NoModel(f"times of water are of a tube of {TUBE_DIAMETER:g} mm bore")
    delay = of.factors.air_delay if is_air else of.factors.water_delay
    return ModelValues(
        f"{of.name} in time",
        {
            phrase: tuple(
                elastic.air_time(of.stack, flow, until, Line(AIR, length, bore)) + delay
                if is_air
                else elastic.time_to_fill(of.stack, flow, until, length)[0] + delay
                for until in curve.x
            )
            for phrase, length in tubes.items()
        },
    )


def _time_to_bend(
    of: ModelledActuator, chambers: int, angle: float, curve: MeasuredCurve
) -> ModelValue:
    """Return the seconds until the tip is bent, all the flow in some chambers, no tube."""
    whole, flow = of.stack, curve.setup.flow_ml_min
    assert flow is not None
    delay = of.factors.air_delay if curve.setup.fluid == "air" else of.factors.water_delay
    pose = elastic.pose_bent_by(whole, chambers, angle)
    if pose is None:
        return None
    empty = whole.pose((0.0,) * whole.chambers)
    taken_in = float((pose.volumes - empty.volumes)[:chambers].sum())
    return taken_in / (flow * 1000 / 60) + delay


def _moduli(of: ModelledActuator, curve: MeasuredCurve) -> ModelValues | NoModel:
    plate = plate_of(of.laminate)
    if plate is None:
        return NoModel("the topmost film is not the plain outline: it has tabs or ears")
    second, _ = second_moments(plate)

    def at(pressure: float) -> float:
        tip, height = elastic.shut_stiffness(of.stack, pressure)
        return modulus(tip, 1.0, height, second)

    return ModelValues(f"{of.name}, chambers shut", _by_pressure(curve, at))


def _sizes(
    quantity: Quantity,
) -> Callable[[ModelledActuator, MeasuredCurve], ModelValues | NoModel]:
    def answer(of: ModelledActuator, curve: MeasuredCurve) -> ModelValues | NoModel:
        figure = of.figure(quantity)
        return ModelValues(figure.model.name, {"": (figure.value,) * len(curve.y)})

    return answer


ANSWERS: dict[str, Callable[[ModelledActuator, MeasuredCurve], ModelValues | NoModel]] = {
    "force_n": _forces,
    "stroke_mm": _strokes,
    "height_mm": _strokes,
    "balloon_stroke_mm": _balloon_strokes,
    "bend_deg": _bends,
    "flat_height_mm": _sizes(Quantity.FOLDED_HEIGHT),
    "energy_mj": _energies,
    "loss_mj": _losses,
    "loss_share": _loss_shares,
    "time_s": _times,
    "modulus_kpa": _moduli,
    "burst_kpa": _sizes(Quantity.BURST),
    "deflated_diameter_mm": _sizes(Quantity.DEFLATED_DIAMETER),
    "inflated_diameter_mm": _sizes(Quantity.INFLATED_DIAMETER),
    "folded_diameter_mm": _sizes(Quantity.FOLDED_DIAMETER),
    "mass_g": _sizes(Quantity.MASS),
}
"""Functions that answer by quantity; the others are in WITHOUT_MODEL."""
