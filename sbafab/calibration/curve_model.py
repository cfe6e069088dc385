"""A measured curve by the elastic models: what they give at its points, for every set-up that its
source leaves open.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.actuators import build, load_design, records
from sbafab.design.files import toml_tables
from sbafab.design.records import validated
from sbafab.errors import DesignError
from sbafab.models import elastic, paper
from sbafab.models.balloon import Balloon
from sbafab.models.balloons import balloons_of
from sbafab.models.elastic import blocked_force, pose_bent_by, stroke_at, time_to_fill
from sbafab.models.figures import Factors
from sbafab.models.formulas import modulus, second_moments
from sbafab.models.kinematics import Actuator, actuator
from sbafab.models.pneumatics import AIR, TUBE_LENGTH, Line
from sbafab.models.prediction import plate_of
from sbafab.models.rippled import free_shapes
from sbafab.models.stack import Plate, Pose, Stack, stack
from sbafab.models.unknowns import UNKNOWNS

if TYPE_CHECKING:
    from sbafab.design.records import Design
    from sbafab.evidence.records import MeasuredCurve
    from sbafab.laminate.laminate import Laminate
    from sbafab.models.film_elements import Array

OPEN_PRESSURES = (10.0, 30.0, 100.0)
"""Pressures in kPa that stand for one that a source does not give: from the paper's full actuation
(Sec. 4.5) to that of its forces (Sec. 4.3)."""
LEAST_RATIO = UNKNOWNS[0].least
"""Modulus ratio for which maps are made; those of stiffer films reach further."""
MOST_KPA = 100.0
NO_TUBE = 1e-3
"""Length in mm of a tube that takes no pressure."""
AIR_STEP = 0.002
LONGEST = 60.0
"""Step and longest time of filling with air, s."""
SHAPE_PRESSURES = np.geomspace(0.003, 60.0, 90)
"""Pressures in kPa at which free balloons are computed, for strokes by volume."""
GROUP_OF = {
    "force_n": "force",
    "stroke_mm": "motion",
    "balloon_stroke_mm": "motion",
    "height_mm": "motion",
    "bend_deg": "motion",
    "flat_height_mm": "flat height",
    "energy_mj": "work",
    "time_s": "time",
    "modulus_kpa": "stiffness",
}
"""Quantities that the models give, and the groups of their discrepancies."""
WITHOUT_STACK = (*("stroke_mm", "balloon_stroke_mm", "height_mm", "flat_height_mm", "energy_mj"),)
"""Those that free balloons give."""


class OpenSetup(NamedTuple):
    """One of the set-ups that a source leaves open: chambers under pressure, kPa, mm of tube."""

    chambers: int
    pressure: float
    tube: float


@dataclass(frozen=True)
class CurveModel:
    """The models of one curve. Raises DesignError where they cannot give it."""

    curve: MeasuredCurve

    @cached_property
    def design(self) -> Design:
        """The design of the actuator that was measured."""
        measured = self.curve.actuator
        if measured.toml:
            tables = toml_tables(measured.toml, self.curve.id)
            return validated(tables, records(), Path())
        return load_design(measured.design, [measured.changes] if measured.changes else [])

    @cached_property
    def laminate(self) -> Laminate:
        """The laminate of the design."""
        return build(self.design)

    @property
    def delay(self) -> str:
        """The field of the delay that is part of the curve's values; empty where none is."""
        if self.curve.quantity != "time_s":
            return ""
        return "air_delay" if self.curve.setup.fluid == "air" else "water_delay"

    @cached_property
    def open_setups(self) -> tuple[OpenSetup, ...]:
        """All set-ups that the source leaves open; one where it tells all that counts."""
        setup, total = self.curve.setup, len(self.laminate.chambers)
        is_bent = "bend_deg" in (self.curve.quantity, self.curve.x_name)
        chambers: tuple[int, ...] = (setup.chambers or total,)
        if is_bent and setup.chambers is None:
            chambers = tuple(range(1, total))
        pressures: tuple[float, ...] = (setup.pressure_kpa or MOST_KPA,)
        if self.curve.x_name != "pressure_kpa" and setup.pressure_kpa is None:
            needs = self.curve.quantity in ("height_mm", "stroke_mm", "bend_deg", "modulus_kpa")
            pressures = OPEN_PRESSURES if needs else pressures
        tubes: tuple[float, ...] = (TUBE_LENGTH if setup.tube_mm is None else setup.tube_mm,)
        if self.delay == "water_delay" and not is_bent and setup.tube_mm is None:
            tubes = (NO_TUBE, TUBE_LENGTH)
        return tuple(OpenSetup(*row) for row in product(chambers, pressures, tubes))

    def values(self, factors: Factors) -> Array:
        """Return the models' values (open set-ups, points) in the unit of the curve, without delay;
        nan where they have none.
        """
        rows = []
        for setup in self.open_setups:
            places = self.curve.x or (0.0,) * len(self.curve.y)
            row = []
            for place in places:
                try:
                    row.append(self._value(factors, setup, place))
                except DesignError:
                    row.append(float("nan"))
            rows.append(row)
        return np.array(rows)

    def check(self) -> None:
        """Raise DesignError, with the reason, where the models give no such curve."""
        if self.curve.quantity not in GROUP_OF:
            raise DesignError(f"no model gives the {self.curve.y_name}")
        if not self.curve.actuator.is_described:
            raise DesignError("no design describes the actuator")
        balloons_of(self.design, self.laminate)
        if self.curve.x_name == "volume_ul" and self.curve.quantity != "balloon_stroke_mm":
            raise DesignError("volumes are compared with the stroke of one balloon only")

    def _value(self, factors: Factors, setup: OpenSetup, place: float) -> float:
        pressure = place if self.curve.x_name == "pressure_kpa" else setup.pressure
        if self.curve.quantity in WITHOUT_STACK:
            return self._of_balloons(factors, pressure, place)
        return self._of_stack(
            self._stack(factors), factors, setup._replace(pressure=pressure), place
        )

    def _of_balloons(self, factors: Factors, pressure: float, place: float) -> float:
        """Return a value that free balloons give."""
        quantity = self.curve.quantity
        thickness = self._actuator(factors).thickness
        if quantity == "flat_height_mm":
            return thickness
        if quantity == "energy_mj":
            return self._energy(factors, pressure)
        if self.curve.x_name == "volume_ul":
            return self._stroke_of_volume(factors, place)
        stroke = self._free_stroke(factors, pressure)
        if quantity == "balloon_stroke_mm":
            return stroke / self.design.stack.balloons
        return stroke + (thickness if quantity == "height_mm" else 0.0)

    def _of_stack(self, whole: Stack, factors: Factors, setup: OpenSetup, place: float) -> float:
        """Return a value that the stack gives."""
        quantity, axis = self.curve.quantity, self.curve.x_name
        if quantity == "modulus_kpa":
            return self._modulus(whole, setup.pressure)
        if quantity == "bend_deg":
            return whole.pose(_pressures(whole, setup.chambers, setup.pressure)).bend
        if quantity == "force_n" and axis == "bend_deg":
            return _bent_force(whole, setup.chambers, place, setup.pressure)
        if quantity == "force_n":
            share = place if axis == "height_share" else 0.0
            stroke = stroke_at(self._actuator(factors), share)
            pushing = min(setup.chambers, self.design.form.pushing)
            return pushing * float(blocked_force(whole, setup.pressure, stroke))
        if axis == "bend_deg":
            return self._time_to_bend(whole, setup.chambers, place)
        return self._time_to_fill(whole, setup)

    def _actuator(self, factors: Factors) -> Actuator:
        return actuator(self.design, self.laminate, factors)

    def _stack(self, factors: Factors) -> Stack:
        loss = factors.pocket_loss
        if loss not in self._stacks:
            base = Factors(pocket_loss=loss, modulus_ratio=LEAST_RATIO)
            self._stacks[loss] = stack(self.design, self.laminate, MOST_KPA, base), base
        together, base = self._stacks[loss]
        moved = elastic.moved_stack(together, base, factors)
        assert moved is not None
        return moved

    @cached_property
    def _stacks(self) -> dict[float, tuple[Stack, Factors]]:
        """Stacks by pocket loss at the least modulus ratio, with their factors."""
        return {}

    def _free_shapes(self, factors: Factors) -> list[tuple[Balloon, Array, Array, Array]]:
        """Return, of each balloon, pressures, heights, volumes at a modulus ratio of 1."""
        drawn = balloons_of(self.design, self.laminate, replace(factors, modulus_ratio=1.0))
        return [(balloon, *_free_curve(balloon)) for balloon in drawn]

    def _stroke_of_volume(self, factors: Factors, volume: float) -> float:
        """Return the mean stroke of a balloon in mm at its volume in ul, for any modulus."""
        curves = self._free_shapes(factors)
        strokes = [np.interp(volume, volumes, heights) for _, _, heights, volumes in curves]
        return float(np.mean(strokes))

    def _free_stroke(self, factors: Factors, pressure: float) -> float:
        """Return the free stroke in mm: pressures scale with the modulus."""
        at = pressure / factors.modulus_ratio
        curves = self._free_shapes(factors)
        return float(sum(np.interp(np.log(at), np.log(p), heights) for _, p, heights, _ in curves))

    def _energy(self, factors: Factors, pressure: float) -> float:
        """Return the work in mJ that films take in up to a pressure."""
        ratio = factors.modulus_ratio
        stored = 0.0
        drawn = balloons_of(self.design, self.laminate, replace(factors, modulus_ratio=1.0))
        for balloon in drawn:
            stored += ratio * _energy_at(balloon, pressure / ratio)
        return stored * self.design.form.stacks / 1000

    def _modulus(self, whole: Stack, pressure: float) -> float:
        """Return the cantilever's modulus in kPa, chambers shut (paper, Sec. 4.4)."""
        tip, height = elastic.shut_stiffness(whole, pressure)
        plate = plate_of(self.laminate)
        if plate is None:
            raise DesignError("the topmost film is not the plain outline: it has tabs or ears")
        return modulus(tip, 1.0, height, second_moments(plate)[0])

    def _time_to_fill(self, whole: Stack, setup: OpenSetup) -> float:
        pressure = setup.pressure
        flow = self.curve.setup.flow_ml_min or paper.WATER_FLOW
        if self.curve.setup.fluid != "air":
            return time_to_fill(whole, flow, pressure, setup.tube)[0]
        moving = whole.motion(line=Line(AIR, setup.tube))
        each, before = flow * 1000 / 60 / whole.chambers, 0.0
        while moving.pressures[0] < pressure:
            before = moving.pressures[0]
            moving.step(AIR_STEP, flows=(each,) * whole.chambers)
            if moving.time > LONGEST:
                raise DesignError(f"it takes longer than {LONGEST:g} s")
        over = (moving.pressures[0] - pressure) / (moving.pressures[0] - before)
        return moving.time - AIR_STEP * over

    def _time_to_bend(self, whole: Stack, chambers: int, angle: float) -> float:
        flow = self.curve.setup.flow_ml_min or paper.WATER_FLOW
        pose = _bent_pose(whole, chambers, angle)
        empty = whole.pose((0.0,) * whole.chambers)
        put_in = float((pose.volumes - empty.volumes)[:chambers].sum())
        return put_in / (flow * 1000 / 60)


@lru_cache(maxsize=256)
def _free_curve(balloon: Balloon) -> tuple[Array, Array, Array]:
    """Return pressures, heights and volumes of a free balloon."""
    shapes = free_shapes(balloon, SHAPE_PRESSURES)
    return SHAPE_PRESSURES, shapes.height, shapes.volume


@lru_cache(maxsize=4096)
def _energy_at(balloon: Balloon, pressure: float) -> float:
    return float(free_shapes(balloon, [pressure]).energy[0])


def _pressures(whole: Stack, chambers: int, pressure: float) -> tuple[float, ...]:
    return (pressure,) * chambers + (0.0,) * (whole.chambers - chambers)


def _bent_pose(whole: Stack, chambers: int, angle: float) -> Pose:
    pose = pose_bent_by(whole, chambers, angle)
    if pose is None:
        raise DesignError(f"it does not bend by {angle:g} degrees")
    return pose


def _bent_force(whole: Stack, chambers: int, angle: float, pressure: float) -> float:
    """Return the force in N on a plate square to a tip that is bent by an angle in degrees."""
    pose = _bent_pose(whole, chambers, angle)
    if pose.pressures[0] > pressure:
        raise DesignError(f"it does not bend by {angle:g} degrees at {pressure:g} kPa")
    point, normal = pose.tip.tolist(), pose.frames[1][-1][:, 2].tolist()
    plate = Plate((point[0], point[1], point[2]), (normal[0], normal[1], normal[2]))
    return whole.pose(_pressures(whole, chambers, pressure), plate=plate, near=pose).force
