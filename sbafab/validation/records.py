"""Records of measurements: a source's curves, with set-up, error and what the source leaves out."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple


class CurveQuantity(NamedTuple):
    """A measured quantity: its unit, its title, and the axes that it is measured against.

    The axis "" means that the quantity is measured without an axis.
    """

    unit: str
    title: str
    axes: tuple[str, ...]


NO_AXIS = ""
AXES = {
    "pressure_kpa": "kPa",
    "volume_ul": "ul",
    "height_share": "",
    "stroke_mm": "mm",
    "bend_deg": "deg",
    NO_AXIS: "",
}
"""Axes and their units. ``height_share`` counts from the flat to the full height, as the source
counts it; ``volume_ul`` is one balloon's for ``balloon_stroke_mm``, else all chambers' in total."""
QUANTITIES = {
    "force_n": CurveQuantity(
        "N", "blocked force", ("height_share", "stroke_mm", "bend_deg", "pressure_kpa", NO_AXIS)
    ),
    "stroke_mm": CurveQuantity("mm", "free stroke", ("pressure_kpa", "volume_ul", NO_AXIS)),
    "balloon_stroke_mm": CurveQuantity(
        "mm", "stroke of one balloon", ("volume_ul", "pressure_kpa", NO_AXIS)
    ),
    "height_mm": CurveQuantity("mm", "height", ("pressure_kpa", "volume_ul", NO_AXIS)),
    "flat_height_mm": CurveQuantity("mm", "deflated height", (NO_AXIS,)),
    "bend_deg": CurveQuantity("deg", "bend", ("pressure_kpa", "volume_ul", NO_AXIS)),
    "energy_mj": CurveQuantity("mJ", "pneumatic input work", ("pressure_kpa",)),
    "loss_mj": CurveQuantity("mJ", "work lost in a cycle", ("pressure_kpa",)),
    "loss_share": CurveQuantity(
        "", "share of the input work lost in a cycle", ("pressure_kpa", NO_AXIS)
    ),
    "time_s": CurveQuantity("s", "time", ("pressure_kpa", "bend_deg")),
    "modulus_kpa": CurveQuantity("kPa", "modulus in bending", ("pressure_kpa", NO_AXIS)),
    "burst_kpa": CurveQuantity("kPa", "burst pressure", (NO_AXIS,)),
    "geometric_kpa": CurveQuantity("kPa", "pressure that ends the geometric regime", (NO_AXIS,)),
    "deflated_diameter_mm": CurveQuantity("mm", "deflated diameter", (NO_AXIS,)),
    "inflated_diameter_mm": CurveQuantity("mm", "inflated diameter", (NO_AXIS,)),
    "folded_diameter_mm": CurveQuantity("mm", "folded diameter", (NO_AXIS,)),
    "mass_g": CurveQuantity("g", "mass", (NO_AXIS,)),
    "success_share": CurveQuantity("", "share of builds that hold", (NO_AXIS,)),
    "build_time_h": CurveQuantity("h", "time to build", (NO_AXIS,)),
    "cutting_error_mm": CurveQuantity("mm", "largest error of the laser's cut", (NO_AXIS,)),
    "pin_error_mm": CurveQuantity("mm", "error of the dowel pins", (NO_AXIS,)),
    "density_kg_m3": CurveQuantity("kg/m3", "density of the film", (NO_AXIS,)),
}
"""Quantities by name."""


KINDS = {
    "standard deviation": 1.0,
    "standard error": 1.0,
    "largest": 1 / math.sqrt(3),
    "rounding": 1 / math.sqrt(3),
}
"""Kinds of a stated error, and the standard error over it: an error that is the largest, or half of
the last digit, is taken as even over its range (JCGM 100:2008, 4.3.7)."""


@dataclass(frozen=True)
class StatedError:
    """The error of a curve's values as its source states it.

    ``absolute``: one per value, in the curve's unit; empty if not stated. ``relative``: of the
    value. ``kind``: of KINDS; ``runs``: how often each value was measured; ``source``: the place
    that states it.
    """

    absolute: tuple[float, ...] = ()
    relative: float = 0.0
    kind: str = "standard deviation"
    runs: int | None = None
    source: str = ""

    @property
    def is_stated(self) -> bool:
        """True if the source states an error."""
        return bool(self.absolute) or self.relative > 0


TIPS = ("free", "held", "bent", "pushed", "")
"""States of the tip: free; held at a height by a plate or sensor; bent and held by a sensor; pushed
to a side; unknown or irrelevant."""


@dataclass(frozen=True)
class Setup:
    """The set-up of a measurement; None and "" mean that the source does not state the value.

    ``supply`` feeds ``fluid`` ("air" or "water") at ``flow_ml_min`` through a tube of ``tube_mm``
    length and ``tube_bore_mm`` bore. ``chambers`` are pressurised, the others empty. ``tip`` is one
    of TIPS; it is held at ``height_share`` or ``stroke_mm``, or bent by ``bend_deg``. The curve's
    axis, which may be ``pressure_kpa``, is empty here.
    """

    supply: str = ""
    fluid: str = ""
    flow_ml_min: float | None = None
    tube_mm: float | None = None
    tube_bore_mm: float | None = None
    pressure_kpa: float | None = None
    height_share: float | None = None
    stroke_mm: float | None = None
    bend_deg: float | None = None
    chambers: int | None = None
    tip: str = ""
    note: str = ""


@dataclass(frozen=True)
class MeasuredActuator:
    """The actuator that was measured, as a design.

    ``design`` is a template's name or a design file, changed by ``changes`` (dotted key to value);
    or ``toml`` is the text of a whole design. All are empty if no design describes it.
    """

    design: str = ""
    changes: Mapping[str, Any] = field(default_factory=dict)
    toml: str = ""

    @property
    def is_described(self) -> bool:
        """True if a design describes the actuator."""
        return bool(self.design or self.toml)


class MeasuredPoint(NamedTuple):
    """A measured value, its place on the axis (None without axis), and its standard error (None
    if the source does not state it).
    """

    x: float | None
    y: float
    error: float | None


@dataclass(frozen=True)
class MeasuredCurve:
    """Values of one quantity by one set-up.

    ``place``: figure and section of the source. ``x`` is empty if ``x_name`` is; else it has one
    number per value. ``comparable`` False: no prediction may be compared with it or fitted to it,
    for ``reason``. Curves of a ``group`` come from one test, so a fit that leaves one out leaves
    all of them out. ``unknown``: sentences on facts that the source does not state.
    """

    id: str
    quantity: str
    place: str
    y: tuple[float, ...]
    x_name: str = NO_AXIS
    x: tuple[float, ...] = ()
    actuator: MeasuredActuator = MeasuredActuator()
    setup: Setup = Setup()
    error: StatedError = StatedError()
    comparable: bool = True
    reason: str = ""
    group: str = ""
    unknown: tuple[str, ...] = ()

    @property
    def y_unit(self) -> str:
        """The unit of the values."""
        return QUANTITIES[self.quantity].unit

    @property
    def y_name(self) -> str:
        """The quantity's title."""
        return QUANTITIES[self.quantity].title

    @property
    def x_unit(self) -> str:
        """The unit of the axis."""
        return AXES[self.x_name]

    @property
    def errors(self) -> tuple[float | None, ...]:
        """Standard errors of the values, in their unit; None if the source does not state them."""
        if not self.error.is_stated:
            return (None,) * len(self.y)
        absolute = self.error.absolute or (0.0,) * len(self.y)
        share = KINDS[self.error.kind]
        return tuple(
            share * math.hypot(size, self.error.relative * value)
            for size, value in zip(absolute, self.y, strict=True)
        )

    def points(self) -> Iterator[MeasuredPoint]:
        """Yield the values with their places and standard errors."""
        places = self.x or (None,) * len(self.y)
        for x, y, error in zip(places, self.y, self.errors, strict=True):
            yield MeasuredPoint(x, y, error)


@dataclass(frozen=True)
class Evidence:
    """The measured curves of one source: a paper, or a lab's file or records.

    ``missing``: sentences on figures of the source that could not be had.
    """

    id: str
    citation: str
    doi: str
    curves: tuple[MeasuredCurve, ...]
    missing: tuple[str, ...] = ()

    def curve(self, name: str) -> MeasuredCurve:
        """Return the curve of an id. Raises KeyError."""
        for curve in self.curves:
            if curve.id == name:
                return curve
        raise KeyError(name)
