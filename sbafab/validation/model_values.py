"""Values of the models at the points of a measured curve, or the reason if there are none."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from pathlib import Path

import numpy as np

from sbafab.actuators import build, load_design, records
from sbafab.design.files import toml_tables
from sbafab.design.records import Design, validated
from sbafab.errors import DesignError
from sbafab.laminate.laminate import Laminate
from sbafab.models import elastic, paper
from sbafab.models.actuator import Actuator
from sbafab.models.balloon_map import MOST_STRETCH, stretch
from sbafab.models.balloons import balloons_of
from sbafab.models.calibration import UNKNOWNS
from sbafab.models.closed_forms import modulus, second_moments
from sbafab.models.column import BatchPoses
from sbafab.models.figures import Factors, Model, PredictionRequest
from sbafab.models.film_elements import Array, Balloon
from sbafab.models.pneumatics import AIR, TUBE_DIAMETER, TUBE_LENGTH, Line, usual_pressures
from sbafab.models.prediction import plate_of, predict
from sbafab.models.quantity import Quantity, chamber_count
from sbafab.models.rim_correction import free_shapes
from sbafab.models.stack import Pose, Stack, stack
from sbafab.validation.evidence import QUANTITIES, MeasuredCurve

ModelValue = float | None
"""A value of a model; None if the model has no such state."""
Series = dict[str, tuple[ModelValue, ...]]
"""Values at a curve's points by the assumption on the set-up, as a phrase; "" if none is made."""
SAMPLES = 60
LEAST_FREE_KPA, MOST_FREE_KPA = 0.002, 20.0
"""Pressures, of films as bought, between which a free stack is filled by volume."""
NO_TUBE = 1e-3
"""Length in mm of a tube that takes no pressure."""
OPEN_PRESSURES = (10.0, 30.0, 100.0)
"""Pressures in kPa to assume if a source does not state one: from the paper's full actuation
(Sec. 4.5) to the pressure of its forces (Sec. 4.3)."""
LEAST_RATIO = UNKNOWNS[0].least
"""Modulus ratio for which maps are made; maps of stiffer films reach further."""


@dataclass(frozen=True)
class ModelValues:
    """Values of a model at a curve's points, in its unit."""

    model: str
    series: Mapping[str, tuple[ModelValue, ...]]

    def ranges(self) -> list[tuple[float, float] | None]:
        """Return the least and largest value over the assumptions at each point.

        None for a point at which no assumption has a value.
        """
        known = [
            [value for value in values if value is not None]
            for values in zip(*self.series.values(), strict=True)
        ]
        return [(min(values), max(values)) if values else None for values in known]


def model_values(
    curve: MeasuredCurve, factors: Factors | None = None, shares_maps: bool = False
) -> ModelValues:
    """Return the values of the models at a curve's points.

    ``factors`` come from a calibration; by default there are none. For an open set-up, every
    relevant assumption gives one series. ``shares_maps`` is for fits with many factors. Raises
    DesignError with the reason if no model has values.
    """
    answer = ANSWERS.get(curve.quantity)
    if answer is None:
        raise DesignError(QUANTITIES[curve.quantity].without_model)
    if not curve.is_described:
        raise DesignError("no design describes the actuator")
    return ModelValues(*answer(ModelledActuator(curve, factors or Factors(), shares_maps)))


@lru_cache(maxsize=64)
def _measured_design(text: str) -> tuple[Design, Laminate]:
    """Return design and laminate of a measured actuator from its text. Raises DesignError."""
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
def _drawn_stack(text: str, loss: float) -> tuple[Stack, Actuator]:
    """Return the stack with a pocket loss in mm at the least modulus ratio, and its actuator.

    Its maps also serve all other factors.
    """
    factors = Factors(pocket_loss=loss, modulus_ratio=LEAST_RATIO)
    drawn = Actuator(*_measured_design(text), factors)
    return stack(drawn.design, drawn.laminate, factors=factors), drawn


@dataclass(frozen=True)
class ModelledActuator:
    """The actuator of a curve for the models; parts are built on first use.

    With ``shares_maps``, one map of its balloons serves every modulus and press factor: poses are
    then within 1 % of poses from dedicated maps, and take less than a second.
    """

    curve: MeasuredCurve
    factors: Factors
    shares_maps: bool = False

    @cached_property
    def _text(self) -> str:
        curve = self.curve
        return json.dumps([curve.design, curve.changes, curve.toml], sort_keys=True)

    @property
    def design(self) -> Design:
        """The design. Raises DesignError."""
        return _measured_design(self._text)[0]

    @property
    def laminate(self) -> Laminate:
        """The laminate. Raises DesignError."""
        return _measured_design(self._text)[1]

    @cached_property
    def actuator(self) -> Actuator:
        """The actuator of the geometric models. Raises DesignError."""
        return Actuator(self.design, self.laminate, self.factors)

    @cached_property
    def stack(self) -> Stack:
        """The elastic stack. Raises DesignError for pockets that are not round."""
        if self.shares_maps:
            together, drawn = _drawn_stack(self._text, self.factors.pocket_loss)
            moved = elastic.moved_stack(together, drawn, self.factors)
            if moved is not None:
                return moved
        return stack(self.design, self.laminate, factors=self.factors)

    def model(self, model: Model = elastic.FORCE) -> str:
        """Return the name of a model with the factors, by default the elastic stack."""
        return elastic.calibrated(model, self.factors).name

    def balloons(self, modulus_ratio: float | None = None) -> list[Balloon]:
        """Return the balloons of one chamber, at their own or another modulus ratio. Raises
        DesignError.
        """
        ratio = self.factors.modulus_ratio if modulus_ratio is None else modulus_ratio
        return balloons_of(self.design, self.laminate, replace(self.factors, modulus_ratio=ratio))

    def free_pose(self, chambers: int, pressure: float) -> Pose:
        """Return the pose with some chambers at a pressure in kPa. Raises DesignError."""
        pressures = elastic.chamber_pressures(self.stack, chambers, pressure)
        return self.stack.pose(pressures, self.tip_load)

    def filling(self, chambers: int) -> BatchPoses:
        """Return the free poses with some chambers at rising pressures, up to the first without
        one.
        """
        most = min(self.stack.most_pressure, MOST_FREE_KPA * self.factors.modulus_ratio)
        rows = np.zeros((SAMPLES, self.stack.chambers))
        rows[1:, :chambers] = np.geomspace(LEAST_FREE_KPA, most, SAMPLES - 1)[:, None]
        poses = self.stack.equilibria(rows, self.stack.acting({"tip_load": self.tip_load}))
        return poses.part(slice(int(np.logical_and.accumulate(poses.is_met).sum())))

    @property
    def tip_load(self) -> tuple[float, float, float]:
        """The force in N on the tip due to its load, for a level base."""
        is_probed = self.curve.setup.tip == "probed"
        return elastic.tip_force(self.factors) if is_probed else (0.0, 0.0, 0.0)

    @property
    def chambers_that_bend(self) -> dict[str, int]:
        """Return the possible numbers of pressurised chambers for a bend, by the phrase that
        assumes it.

        Raises DesignError for one chamber.
        """
        stated = self.curve.setup.chambers
        counts = list(range(1, self.stack.chambers)) if stated is None else [stated]
        if not counts:
            raise DesignError("one chamber does not bend")
        return {chamber_count(count) if len(counts) > 1 else "": count for count in counts}


NamedSeries = tuple[str, Series]
"""The model's name, and its values."""


def _tried(value: Callable[..., float], *at: float) -> ModelValue:
    """Return a value; None if the model has no such state."""
    try:
        return value(*at)
    except DesignError:
        return None


def _by_pressure(curve: MeasuredCurve, value: Callable[[float], float]) -> Series:
    """Return a value at each pressure of a curve, by the assumption about the pressure."""
    reached, pressures = partial(_tried, value), curve.at("pressure_kpa")
    if pressures is not None:
        return {"": tuple(map(reached, pressures))}
    count = len(curve.y)
    return {f"{p:g} kPa in the chambers": (reached(p),) * count for p in OPEN_PRESSURES}


# Forces.


def _forces(of: ModelledActuator) -> NamedSeries:
    curve = of.curve
    angles, pressures = curve.at("bend_deg"), curve.at("pressure_kpa")
    if pressures is None:
        raise DesignError("the set-up states no pressure")
    if angles is not None:
        return of.model(), _bent_forces(of, list(zip(angles, pressures, strict=True)))
    pushing = curve.setup.chambers or of.actuator.form.pushing

    def force(stroke: ModelValue, pressure: float) -> ModelValue:
        if stroke is None:
            return None
        return pushing * float(elastic.blocked_force(of.stack, pressure, stroke))

    return of.model(), {
        phrase: tuple(map(force, strokes, pressures))
        for phrase, strokes in _blocked_states(of).items()
    }


def _blocked_states(of: ModelledActuator) -> Series:
    """Return the strokes in mm at which a force was measured, by the assumption on the full stroke.

    Assumptions are a free stroke at each of OPEN_PRESSURES, or one that the paper gives. Values
    are None if the actuator does not rise freely. Raises DesignError if no stroke is named.
    """
    shares, strokes = of.curve.at("height_share"), of.curve.at("stroke_mm")
    if strokes is not None and of.curve.x_name != "height_share":
        return {"": strokes}
    if shares is None:
        raise DesignError("the set-up does not state the height at which the tip is held")
    if not any(shares):
        return {"": shares}

    def free(pressure: float) -> float:
        return of.free_pose(of.stack.chambers, pressure).height - of.stack.flat_height

    full = {f"full stroke at {p:g} kPa": _tried(free, p) for p in OPEN_PRESSURES}
    if of.actuator.has_reference:
        full["full height as in Sec. 4.6"] = of.actuator.stroke_at(1.0)
        longer = paper.LONGEST_STROKE.value / paper.FULL_HEIGHT.value
        full["full stroke as in Sec. 4.2"] = longer * of.actuator.reference_height
    return {
        phrase: tuple(
            0.0 if share == 0 else None if stroke is None else share * stroke for share in shares
        )
        for phrase, stroke in full.items()
    }


def _bent_forces(of: ModelledActuator, pairs: Sequence[tuple[float, float]]) -> Series:
    """Return forces at pairs of angle and pressure on a plate square to the bent tip, with the
    chambers that bend it, or all of them, pressurised further.
    """
    bending = of.chambers_that_bend
    bends = [(count, angle) for count in bending.values() for angle, _ in pairs]
    poses = dict(zip(bends, elastic.poses_bent_by(of.stack, bends), strict=True))

    def force(bent: int, filled: int, angle: float, pressure: float) -> float:
        pose = poses[bent, angle]
        if pose is None or pose.pressures[0] > pressure:
            raise DesignError("it does not bend that far")
        return elastic.pressed_further(of.stack, filled, pressure, pose).force

    series: Series = {}
    for phrase, count in bending.items():
        further = [(count, phrase)]
        if of.curve.setup.chambers is None:
            further.append((of.stack.chambers, f"{phrase} to bend it and then all"))
        for filled, named in further:
            series[named] = tuple(_tried(force, count, filled, *pair) for pair in pairs)
    return series


# Strokes, heights and bends.


def _strokes(of: ModelledActuator) -> NamedSeries:
    curve = of.curve
    is_stroke = curve.quantity == "stroke_mm"
    is_whole = curve.setup.chambers in (None, of.design.form.stacks)
    is_plain = not of.shares_maps and not any(of.tip_load)
    if is_whole and curve.x_name != "volume_ul" and is_plain:
        # One pressure in all chambers: by the balloons themselves.
        kinds = Counter(of.balloons())
        flat = 0.0 if is_stroke else of.actuator.thickness
        rise = _by_pressure(curve, lambda p: flat + elastic.free_rise(kinds, p).stroke)
        return of.model(elastic.ELASTIC), rise
    flat = of.stack.flat_height if is_stroke else 0.0
    chambers = {"": curve.setup.chambers or of.stack.chambers}
    return _risen(of, chambers, lambda poses: poses.heights - flat)


def _bends(of: ModelledActuator) -> NamedSeries:
    return _risen(of, of.chambers_that_bend, lambda poses: poses.bends)


def _risen(
    of: ModelledActuator, chambers: Mapping[str, int], values: Callable[[BatchPoses], Array]
) -> NamedSeries:
    """Return values of the free stack's poses at the curve's pressures or volumes."""
    series: Series = {}
    for phrase, count in chambers.items():
        if of.curve.x_name == "volume_ul":
            series[phrase] = _by_volume(of, count, of.curve.x, values)
            continue
        by_pressure = _by_pressure(of.curve, lambda p, n=count: _at_pressure(of, n, p, values))  # type: ignore[misc]
        for assumed, risen in by_pressure.items():
            series[", ".join(filter(None, (phrase, assumed)))] = risen
    return of.model(), series


def _at_pressure(
    of: ModelledActuator, chambers: int, pressure: float, values: Callable[[BatchPoses], Array]
) -> float:
    rows = np.array([elastic.chamber_pressures(of.stack, chambers, pressure)])
    load = of.stack.acting({"tip_load": of.tip_load})
    return float(values(of.stack.equilibria(rows, load).met())[0])


def _by_volume(
    of: ModelledActuator,
    chambers: int,
    volumes: Sequence[float],
    values: Callable[[BatchPoses], Array],
) -> tuple[ModelValue, ...]:
    """Return values of the free stack with volumes in ul added to some chambers in total, from
    poses at rising pressures. None for a volume that MOST_FREE_KPA does not reach.
    """
    poses = of.filling(chambers)
    held = poses.volumes[:, :chambers].sum(1)
    at = values(poses)
    added = np.maximum.accumulate(held - held[0])
    reached = np.interp(volumes, added, at, right=np.nan).tolist()
    return tuple(None if math.isnan(value) else value for value in reached)


def _balloon_strokes(of: ModelledActuator) -> NamedSeries:
    balloons = of.balloons()
    if len(set(balloons)) > 1:
        raise DesignError("its balloons differ in size")
    if of.curve.x_name == "volume_ul":
        # Of the whole stack, since what stands on it is carried by every balloon.
        count = len(balloons)
        volumes = [count * volume for volume in of.curve.x]
        strokes = _by_volume(of, of.stack.chambers, volumes, lambda poses: poses.heights)
        flat = of.stack.flat_height
        rises = tuple(None if height is None else (height - flat) / count for height in strokes)
        return of.model(), {"": rises}
    series = _by_pressure(of.curve, lambda p: float(free_shapes(balloons[0], p).height[0]))
    return of.model(elastic.ELASTIC), series


# Work, times, stiffness, sizes.


def _energies(of: ModelledActuator) -> NamedSeries:
    # Energies are proportional to the modulus at equal pressure over modulus.
    ratio, balloons = of.factors.modulus_ratio, of.balloons(modulus_ratio=1.0)
    stored = [sum(_stored(each, p / ratio) for each in balloons) for p in of.curve.x]
    stacks = of.design.form.stacks
    return of.model(elastic.ELASTIC), {"": tuple(ratio * each * stacks / 1000 for each in stored)}


@lru_cache(maxsize=1024)
def _stored(balloon: Balloon, pressure: float) -> float:
    """Return the energy in uJ stored in the films of a free balloon. Raises DesignError."""
    shape = free_shapes(balloon, pressure)
    if float(stretch(balloon, shape)[0]) > MOST_STRETCH:
        raise DesignError(f"at {pressure:g} kPa its films would stretch too far")
    return float(shape.energy[0])


def _losses(of: ModelledActuator) -> NamedSeries:
    """Return the work lost, from the calibration's share of the input work."""
    model, series = _energies(of)
    return model, {"": tuple(of.factors.loss_share * (each or 0.0) for each in series[""])}


def _loss_shares(of: ModelledActuator) -> NamedSeries:
    """Return the calibration's share of the input work that is lost; 0 without a calibration."""
    return of.model(elastic.ELASTIC), {"": (of.factors.loss_share,) * len(of.curve.y)}


def _times(of: ModelledActuator) -> NamedSeries:
    setup, until = of.curve.setup, of.curve.x
    if setup.flow_ml_min is None:
        raise DesignError("the set-up states no flow")
    flow, bore = setup.flow_ml_min, setup.tube_bore_mm or TUBE_DIAMETER
    is_bend = of.curve.x_name == "bend_deg"
    is_water = setup.fluid == "water" or (is_bend and setup.fluid != "air")
    delay = of.factors.water_delay if is_water else of.factors.air_delay
    if is_bend:
        return f"{of.model()}, no tube", {
            phrase: tuple(_time_to_bend(of, count, angle, flow, delay) for angle in until)
            for phrase, count in of.chambers_that_bend.items()
        }
    tubes = {"no tube": NO_TUBE, f"{TUBE_LENGTH:g} mm of tube": TUBE_LENGTH}
    if setup.tube_mm is not None:
        tubes = {"": max(setup.tube_mm, NO_TUBE)}
    if is_water and bore != TUBE_DIAMETER:
        raise DesignError(f"times for water need a tube of {TUBE_DIAMETER:g} mm bore")

    def time(kpa: float, length: float) -> float:
        if is_water:
            return elastic.time_to_fill(of.stack, flow, kpa, length)[0] + delay
        return elastic.air_time(of.stack, flow, kpa, Line(AIR, length, bore)) + delay

    return f"{of.model()} in time", {
        phrase: tuple(time(kpa, length) for kpa in until) for phrase, length in tubes.items()
    }


def _time_to_bend(
    of: ModelledActuator, chambers: int, angle: float, flow: float, delay: float
) -> ModelValue:
    """Return the seconds until the tip is bent, if all the flow fills some chambers, no tube."""
    pose = elastic.pose_bent_by(of.stack, chambers, angle)
    if pose is None:
        return None
    taken_in = float((pose.volumes - of.free_pose(chambers, 0.0).volumes)[:chambers].sum())
    return taken_in / (flow * 1000 / 60) + delay


def _moduli(of: ModelledActuator) -> NamedSeries:
    plate = plate_of(of.laminate)
    if plate is None:
        raise DesignError("the topmost film is not the plain outline: it has tabs or ears")
    second, _ = second_moments(plate)

    def at(pressure: float) -> float:
        tip, height = elastic.shut_stiffness(of.stack, pressure)
        return modulus(tip, 1.0, height, second)

    return f"{of.model()}, chambers shut", _by_pressure(of.curve, at)


def _of_prediction(quantity: Quantity, of: ModelledActuator) -> NamedSeries:
    """Return the prediction's figure of a quantity. Raises DesignError if it does not exist."""
    pressures = usual_pressures(of.design.form)[-1:]
    request = PredictionRequest(pressures, calibration=of.factors)
    figure = predict(of.design, request, of.laminate, quick=True).figure(quantity)
    return figure.model.name, {"": (figure.value,) * len(of.curve.y)}


ANSWERS: dict[str, Callable[[ModelledActuator], NamedSeries]] = {
    "force_n": _forces,
    "stroke_mm": _strokes,
    "height_mm": _strokes,
    "balloon_stroke_mm": _balloon_strokes,
    "bend_deg": _bends,
    "flat_height_mm": partial(_of_prediction, Quantity.FOLDED_HEIGHT),
    "energy_mj": _energies,
    "loss_mj": _losses,
    "loss_share": _loss_shares,
    "time_s": _times,
    "modulus_kpa": _moduli,
    "burst_kpa": partial(_of_prediction, Quantity.BURST),
    "deflated_diameter_mm": partial(_of_prediction, Quantity.DEFLATED_DIAMETER),
    "inflated_diameter_mm": partial(_of_prediction, Quantity.INFLATED_DIAMETER),
    "folded_diameter_mm": partial(_of_prediction, Quantity.FOLDED_DIAMETER),
    "mass_g": partial(_of_prediction, Quantity.MASS),
}
"""Functions that answer by quantity; the others say why they have none."""
