"""Supply of a chamber: fluid, tube, valve and pump, filling times (paper, Sec. 4.5 and 7), and the
range of pressures.

Flow through the tube is laminar (Poiseuille) or, if that gives less flow, turbulent in a smooth
tube (Blasius). A gas is isothermal: squared pressures replace pressures, and its volumes are
measured at atmospheric pressure. Gauge pressures kPa, volumes ul, lengths mm, times s.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sbafab.design.records import Form
from sbafab.errors import DesignError
from sbafab.models.figures import USUAL_PRESSURES

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from sbafab.models.film_elements import Array

TUBE_DIAMETER = 0.635
"""Inner diameter of Braintree RPT040 in mm (paper, Sec. 2)."""
TUBE_LENGTH = 150.0
"""mm; ours, the paper gives none."""


@dataclass(frozen=True)
class Fluid:
    """A fluid at 20 C: ``viscosity`` in kPa s, ``density`` in kg/m3; compressible if ``is_gas``."""

    name: str
    viscosity: float
    density: float
    is_gas: bool


WATER = Fluid("water", 1.002e-6, 998.0, False)
AIR = Fluid("air", 1.82e-8, 1.204, True)
FLUIDS = {"water": WATER, "air": AIR}


@dataclass(frozen=True)
class Line:
    """The supply line of a chamber.

    ``length`` and inner ``diameter`` of its tube are in mm; ``dead_volume`` is in ul between pump
    and tube (syringe, valve, fittings), where a gas is compressed before it flows; ``delay`` is the
    response time of valve or pump in s.
    """

    fluid: Fluid = AIR
    length: float = TUBE_LENGTH
    diameter: float = TUBE_DIAMETER
    dead_volume: float = 0.0
    delay: float = 0.0

    def __post_init__(self) -> None:
        for name, value, least, most in (
            ("length", self.length, 1e-3, 1e6),
            ("diameter", self.diameter, 1e-3, 1e3),
            ("dead_volume", self.dead_volume, 0.0, 1e9),
            ("delay", self.delay, 0.0, 1e6),
        ):
            if not least <= value <= most:
                raise DesignError(f"line {name} = {value:g} must be from {least:g} to {most:g}")

    @property
    def tube_volume(self) -> float:
        """The volume of the tube, ul."""
        return math.pi * self.diameter**2 / 4 * self.length

    @property
    def _conductance(self) -> tuple[float, float]:
        """The laminar flow in ul/s per kPa (Poiseuille), and the turbulent flow at 1 kPa, which
        increases with the pressure to the power of 1 / 1.75 (Blasius): 0.316 Re^-1/4 (length /
        diameter) density speed^2 / 2, in kPa and mm.
        """
        laminar = math.pi * self.diameter**4 / (128 * self.fluid.viscosity * self.length)
        dense = self.fluid.density * 1e-9
        friction = 0.316 * self.length * dense**0.75 * self.fluid.viscosity**0.25
        speed = (2 * self.diameter**1.25 / friction) ** (1 / 1.75)
        return laminar, speed * math.pi * self.diameter**2 / 4

    def flow(self, source: float, chamber: float) -> float:
        """The flow in ul/s (of a gas at atmospheric pressure) from the pump to the chamber."""
        return float(self.flows(np.array(source), np.array(chamber))[0])

    def flows(self, sources: Array, chambers: Array) -> tuple[Array, Array]:
        """``flow`` in ul/s for pressures of any shape, and its derivatives for the chambers'."""
        drops, rates = sources - chambers, np.full(np.shape(chambers), -1.0)
        if self.fluid.is_gas:
            drops = drops * (1 + (sources + chambers) / (2 * ATMOSPHERE_KPA))
            rates = rates - chambers / ATMOSPHERE_KPA
        heads = np.maximum(np.abs(drops), 1e-300)
        slope, least = self._conductance
        # Turbulent flow grows more slowly: laminar flow is the less up to one head.
        is_turbulent = heads > (least / slope) ** (1.75 / 0.75)
        turbulent = least * np.where(is_turbulent, heads, 1.0) ** (1 / 1.75)
        flow = np.where(is_turbulent, np.copysign(turbulent, drops), slope * drops)
        steep = np.where(is_turbulent, turbulent / (1.75 * heads), slope)
        return flow, steep * rates

    def source_pressure(self, flow: float, chamber: float) -> float:
        """Return the pump pressure in kPa that drives a flow (ul/s) into a chamber (kPa)."""
        laminar, turbulent = self._conductance
        drop = max(flow / laminar, float((flow / turbulent) ** 1.75))
        if not self.fluid.is_gas:
            return chamber + drop
        down = chamber + ATMOSPHERE_KPA
        return math.sqrt(down * down + 2 * ATMOSPHERE_KPA * drop) - ATMOSPHERE_KPA

    def content(self, volume: float, pressure: float) -> float:
        """Return the fluid in ul in a volume; for a gas, at atmospheric pressure."""
        return volume * (1 + pressure / ATMOSPHERE_KPA) if self.fluid.is_gas else volume


# Filling time at a steady flow (paper, Sec. 4.5 and 7).


ATMOSPHERE_KPA = 101.325
LEAST_FLOW, MOST_FLOW = 1e-6, 1e6
"""ml/min: from a nanolitre a minute, of the slowest syringe pumps, to 1,000 litres."""


def seconds(
    volume_ul: ArrayLike, flow_ml_min: float, gas_at_kpa: float = 0.0
) -> NDArray[np.float64]:
    """Return the seconds to a volume at a steady flow.

    ``gas_at_kpa`` is the gauge pressure to which a gas is compressed, while its flow is measured at
    atmospheric pressure; omit it for a liquid. Raises DesignError for a flow out of range.
    """
    if not LEAST_FLOW <= flow_ml_min <= MOST_FLOW:
        raise DesignError(
            f"flow = {flow_ml_min:g} ml/min must be from {LEAST_FLOW:g} to {MOST_FLOW:g} ml/min"
        )
    squeezed = 1 + gas_at_kpa / ATMOSPHERE_KPA
    return np.asarray(volume_ul, dtype=float) * squeezed / (flow_ml_min * 1000 / 60)


# Pressures of chambers: gauge pressures in kPa, a vacuum below 0.


MOST_PRESSURE = 1000.0
"""kPa, nearly three times what burst the paper's actuators."""


def usual_pressures(form: Form) -> tuple[float, ...]:
    """Return the pressures in kPa of a design's prediction; negative if it works under vacuum."""
    return tuple(-kpa if form.works_under_vacuum else kpa for kpa in USUAL_PRESSURES)


def refuse_pressure(kpa: ArrayLike, is_vacuum: bool = False, may_be_zero: bool = False) -> None:
    """Raise DesignError for a pressure in kPa that no model accepts: pressures of inflated pockets
    must be positive, of pockets under vacuum negative.
    """
    low, high = (-ATMOSPHERE_KPA, 0.0) if is_vacuum else (0.0, MOST_PRESSURE)
    span = f"at least {low:g} and less than 0" if is_vacuum else f"more than 0, at most {high:g}"
    for each in np.atleast_1d(kpa).tolist():
        if low <= each <= high and (each != 0 or may_be_zero):
            continue
        hint = f"; a vacuum is negative: write {-each:g}" if is_vacuum and each > 0 else ""
        hint = "; it is inflated, and a vacuum does nothing" if not is_vacuum and each < 0 else hint
        raise DesignError(f"pressure = {each:g} kPa is out of range; give {span} kPa gauge{hint}")
