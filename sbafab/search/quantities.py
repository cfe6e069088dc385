"""Quantities of requirements: sizes, mass, yield, stroke, bend, force, stiffness, time, and a
design's keys.

Each is the figure of ``predict``, from the same function: a stroke is its free stroke at a
pressure; bends, forces, stiffness and times come from the elastic stack.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import permutations
from string import ascii_letters
from typing import Any, NamedTuple

from sbafab.design.files import hint, shown
from sbafab.design.records import Design, Form, Slots
from sbafab.design.units import (
    KILOPASCALS,
    MILLILITRES_PER_MINUTE,
    in_first_unit,
    millimetres,
    share_of,
)
from sbafab.errors import DesignError
from sbafab.laminate.burst import NOT_BURST, Burst, burst, is_near_burst, refuse_beyond_burst
from sbafab.laminate.laminate import Laminate, film_mass
from sbafab.models import calibration, elastic
from sbafab.models.actuator import Actuator
from sbafab.models.balloon import Balloon
from sbafab.models.balloons import balloons_of
from sbafab.models.calibration import SHARE
from sbafab.models.figures import NEAR_BURST, Factors, Flag
from sbafab.models.mechanisms import ASKED, mechanism_value
from sbafab.models.paper import FULL_KPA, HEIGHTS, WATER_FLOW, Counterpart, counterpart
from sbafab.models.pneumatics import refuse_pressure, seconds
from sbafab.models.quantity import Conditions, ModelId, Quantity
from sbafab.models.sizes import is_the_papers_3dof, sizes
from sbafab.models.stack import MOST_PRESSURE, Stack, stack
from sbafab.search.vary import key_values


class QuantityName(NamedTuple):
    """A quantity as users write it, with its unit and meaning.

    ``more``: to be maximised; all others are minimised. ``is_drawn``: of the drawing and its
    tolerances; all others are predicted.
    """

    written: str
    unit: str
    meaning: str
    more: bool = False
    is_drawn: bool = False

    @property
    def name(self) -> str:
        """The name without stroke and pressure."""
        return self.written.partition("@")[0]


QUANTITIES = (
    QuantityName("overall_diameter", "mm", "the whole outline, inlet tabs included", is_drawn=True),
    QuantityName("outline_diameter", "mm", "the films without tabs and ears", is_drawn=True),
    QuantityName("deflated_diameter", "mm", "flat, round a tube"),
    QuantityName("inflated_diameter", "mm", "round a tube; safer of two models"),
    QuantityName("reached_diameter", "mm", "the lower one of these two"),
    QuantityName("width", "mm", "of the flat laminate, as length", is_drawn=True),
    QuantityName("length", "mm", "", is_drawn=True),
    QuantityName("height", "mm", "folded: what the press leaves of the films"),
    QuantityName("lumen", "mm", "diameter of the lumen", more=True, is_drawn=True),
    QuantityName("mass", "g", "of the films", is_drawn=True),
    QuantityName("yield", "", "share of builds that hold, 0.95 or 95%", more=True, is_drawn=True),
    QuantityName("stroke@P", "mm", "free stroke at P kPa, elastic balloon", more=True),
    QuantityName("reference_stroke", "mm", "what the paper measured, scaled", more=True),
    QuantityName("bend@P", "deg", "one chamber at P kPa; two: bend@2chambers@P", more=True),
    QuantityName("force@H@P", "N", "blocked at the stroke H mm or %, at P kPa", more=True),
    QuantityName("burst", "kPa", "estimate, film stress in proportion", more=True),
    QuantityName("lateral_stiffness@P", "N/mm", "of the tip, chambers shut at P kPa", more=True),
    QuantityName("time", "s", "to 10 kPa with water at --flow"),
    QuantityName("contraction", "mm", "free, of a drawn pouch motor", more=True),
    QuantityName("pull@P", "N", "of it at P kPa, 10 % shorter", more=True),
    QuantityName("free_bend", "deg", "of drawn hinges, all of a chamber", more=True),
    QuantityName("moment@P", "N mm", "of one, straight, at P kPa", more=True),
    QuantityName("load@P", "N", "that wrinkles a drawn beam at P kPa", more=True),
    QuantityName("slip@P", "N", "that makes jammed sheets slip, P below 0", more=True),
    QuantityName("push@P", "N", "of a drawn pouch on a plate, at most", more=True),
)
"""In the order of the help."""


def quantity_lines() -> str:
    """Return the table as lines for the help of a command."""
    width = max(len(quantity.written) for quantity in QUANTITIES)
    rows = [(row.written, row.unit, row.meaning) for row in QUANTITIES]
    rows.append(("KEY", "", "any key of the design, chamber.diameter"))
    return "\n".join(
        f"{written:{width}}  {unit:4}  {meaning}".rstrip() for written, unit, meaning in rows
    )


USUAL_KPA = 10.0
_CHAMBERS = re.compile(r"\s*([1-9]\d?)\s*chambers?\s*", re.IGNORECASE)
NAMES = {row.name: row for row in QUANTITIES}
AT_PRESSURE = tuple(row.name for row in QUANTITIES if "@" in row.written)
"""Quantities that take a pressure."""
UNITS = {
    "g": {"g": 1.0, "mg": 0.001, "kg": 1000.0},
    "N": {"N": 1.0, "mN": 0.001, "kN": 1000.0},
    "deg": {"deg": 1.0},
    "s": {"s": 1.0, "ms": 0.001},
    "N/mm": {"N/mm": 1.0, "mN/mm": 0.001, "N/m": 0.001},
    "kPa": KILOPASCALS,
    "N mm": {"N mm": 1.0, "Nmm": 1.0, "mNm": 1.0, "Nm": 1000.0},
}
"""Units of masses, forces, angles, times, stiffness and pressures; lengths have the units of design
files."""
ROUND_A_TUBE = ("deflated_diameter", "inflated_diameter", "reached_diameter")
REACHED, WIDEST = "reached_diameter", "inflated_diameter"
"""Inflated diameters around a tube: the lower figure, for a wall that it must reach, and the upper
end, for one that it must not touch."""
HOW = (
    'for example overall_diameter, mass, stroke, "stroke@50kPa", "bend@2chambers@5kPa", '
    '"force@12.5mm@50kPa", "force@50%@50kPa" or chamber.diameter'
)


@dataclass(frozen=True)
class RequestedQuantity:
    """A quantity by name or dotted key; with its pressure in kPa, a force with its stroke in mm or
    as a share of the reference stroke, a bend with the number of its pressurised chambers, a time
    with its flow in ml/min.
    """

    name: str
    unit: str
    kpa: float | None = None
    stroke: float | None = None
    chambers: int = 1
    flow: float | None = None
    share: float | None = None

    @property
    def label(self) -> str:
        at = f"@{self.stroke:g}mm" if self.stroke is not None else ""
        at += f"@{100 * self.share:g}%" if self.share is not None else ""
        at += f"@{self.chambers}chambers" if self.chambers > 1 else ""
        at += f"@{self.kpa:g}kPa" if self.kpa is not None else ""
        return f"{self.name}{at}{f'@{self.flow:g}ml/min' if self.flow is not None else ''}"

    @property
    def key(self) -> str | None:
        """The design key that the quantity stands for, or None."""
        if self.name == "lumen":
            return "lumen.diameter"
        return self.name if "." in self.name else None

    @property
    def is_moved(self) -> bool:
        """True for what inflated chambers do."""
        return self.name in AT_PRESSURE or self.name == "time"

    @property
    def gauge_kpa(self) -> float | None:
        """The gauge pressure in kPa, of a time the one that it ends at; None without one."""
        return FULL_KPA if self.name == "time" else self.kpa


def read_quantity(
    text: str, kpa: float | None = None, flow_ml_min: float = WATER_FLOW
) -> RequestedQuantity:
    """Return the quantity of a text; ``kpa`` is used if it names no pressure, ``flow_ml_min`` if a
    time names no flow. Raises DesignError.
    """
    name, *places = (part.strip() for part in text.split("@"))
    name = name if "." in name else name.replace("-", "_").lower()
    if name in AT_PRESSURE:
        return _with_pressure(name, places, text, kpa)
    if name == "time":
        return RequestedQuantity(name, "s", flow=_flow(places, text, flow_ml_min))
    if places:
        named = f"{', '.join(AT_PRESSURE[:-1])} and {AT_PRESSURE[-1]}"
        raise DesignError(f"{shown(text)}: only {named} take a pressure; {HOW}")
    if name not in NAMES and "." not in name:
        raise DesignError(f"{shown(text)} is not a quantity; {hint(name, [*NAMES, 'any key'])}")
    return RequestedQuantity(name, NAMES[name].unit if name in NAMES else "")


def safer(quantity: RequestedQuantity, at_least: bool) -> RequestedQuantity:
    """The quantity to compare with a limit: of the inflated diameters, the conservative one."""
    if quantity.name not in (REACHED, WIDEST):
        return quantity
    return replace(quantity, name=REACHED if at_least else WIDEST)


def _with_pressure(name: str, places: list[str], text: str, kpa: float | None) -> RequestedQuantity:
    is_vacuum = name == "slip"
    read: dict[str, Any] = {}
    try:
        for place in places:
            field, value = _place(place, name)
            if field == "kpa" and field in read:
                raise DesignError(f"{shown(text)} names two pressures; name one")
            read[field] = value
    except ValueError as error:
        if isinstance(error, DesignError):
            raise
        raise DesignError(f"{shown(text)}: {shown(place)} {error}") from None
    if len({"stroke", "share"} & read.keys()) != (name == "force"):
        raise DesignError(
            f"{shown(text)}: a force needs one stroke, and only a force takes one; {HOW}"
        )
    usual = kpa if kpa is not None and (kpa < 0) == is_vacuum else USUAL_KPA * (1 - 2 * is_vacuum)
    read.setdefault("kpa", usual)
    try:
        refuse_pressure(read["kpa"], is_vacuum)
    except DesignError as error:
        raise DesignError(f"{shown(text)}: {error}") from None
    return RequestedQuantity(name, NAMES[name].unit, **read)


def _place(place: str, name: str) -> tuple[str, float]:
    """Return what a place in a quantity is, a field of ``RequestedQuantity``, and its value.

    Raises ValueError with the end of a sentence.
    """
    count = _CHAMBERS.fullmatch(place)
    if count is not None and name == "bend":
        return "chambers", int(count[1])
    kilopascals = _kilopascals(place)
    if kilopascals is not None:
        return "kpa", kilopascals
    if place.replace(".", "", 1).isdecimal():
        length = f" or {place}mm" if name == "force" else ""
        raise ValueError(f"has no unit; write {place}kPa{length}")
    if place.endswith("%"):
        try:
            return "share", read_share(place)
        except ValueError as error:
            raise ValueError(f"{error}; {HOW}") from None
    try:
        return "stroke", millimetres(place)
    except ValueError:
        raise ValueError(f"is neither a pressure nor a length; {HOW}") from None


def _flow(places: list[str], text: str, flow_ml_min: float) -> float:
    """Return the flow of water of a time in ml/min. Raises DesignError."""
    for place in places:
        read = in_first_unit(place, {"": math.nan, **MILLILITRES_PER_MINUTE})
        if len(places) > 1 or read is None or math.isnan(read):
            raise DesignError(f"{shown(text)}: a time takes one flow, such as time@35ml/min")
        flow_ml_min = read
    seconds(0.0, flow_ml_min)
    return flow_ml_min


def _kilopascals(place: str) -> float | None:
    """The pressure of a text such as 50kPa, its unit in capitals or not; None if it is not one.

    MPa and mPa are not the same: an ambiguous unit is rejected.
    """
    number = place.rstrip(ascii_letters)
    unit = place[len(number) :]
    for each in KILOPASCALS:
        if unit.lower() == each.lower() and (each != "MPa" or unit == each):
            return in_first_unit(number + each, KILOPASCALS)
    return None


def read_limit(quantity: RequestedQuantity, text: str) -> float:
    """Return the limit of a quantity, in its unit. Raises ValueError with the end of a sentence."""
    if quantity.name == "yield":
        return read_share(text)
    units = UNITS.get(quantity.unit)
    if units is not None:
        number = in_first_unit(text, units)
        if number is None:
            raise ValueError(
                f"must be a number, in {quantity.unit} or with one of {', '.join(units)}"
            )
    else:
        try:
            number = millimetres(text)
        except ValueError as error:
            raise ValueError(str(error) if quantity.unit else "must be a number") from None
    if not math.isfinite(number):
        raise ValueError("must be a finite number")
    if quantity.key is None and number < 0:
        raise ValueError("must be at least 0")
    return number


def read_share(text: str) -> float:
    """Return a share from a text such as 0.95 or 95%. Raises ValueError with the end of a
    sentence.
    """
    read = share_of(text)
    if read is None or not 0 <= read <= 1:
        raise ValueError("must be a fraction from 0 to 1, such as 0.95 or 95%")
    return read


def shown_value(quantity: RequestedQuantity, value: float) -> str:
    """A figure with its unit, for display."""
    if quantity.name == "force" and value < 0:
        return "none, it does not rise that far"
    return f"{value:.4g} {quantity.unit}".rstrip()


def shown_interval(interval: tuple[float, float]) -> str:
    """An interval without its unit; of quantities that are at least 0."""
    low, high = (max(end, 0.0) for end in interval)
    return f"{low:.3g} to {high:.3g}"


# Requirements on quantities, and the goal.


CLOSE = 1e-9


@dataclass(frozen=True)
class Requirement:
    """A quantity with its lower or upper limit."""

    quantity: RequestedQuantity
    limit: float
    at_least: bool

    def margin(self, value: float) -> float:
        """Return the margin of a value as a share of the limit; negative if it breaks the limit."""
        more = value - self.limit if self.at_least else self.limit - value
        return more / (abs(self.limit) or 1.0)

    def holds(self, value: float) -> bool:
        return self.margin(value) >= -CLOSE

    @property
    def sense(self) -> str:
        return "at least" if self.at_least else "at most"

    @property
    def bound(self) -> str:
        """For example "at least 3 N"."""
        return f"{self.sense} {self.limit:.10g} {self.quantity.unit}".strip()


@dataclass(frozen=True)
class Goal:
    """The quantity to maximise (``more``) or minimise."""

    quantity: RequestedQuantity
    more: bool

    def cost(self, value: float) -> float:
        return -value if self.more else value

    @property
    def label(self) -> str:
        return f"{'most' if self.more else 'least'} {self.quantity.label}"


def read_all(
    least: Sequence[str], most: Sequence[str], best: str, flow_ml_min: float = WATER_FLOW
) -> tuple[tuple[Requirement, ...], Goal]:
    """The requirements of ``QUANTITY=VALUE`` texts, and the goal. Raises DesignError.

    A quantity without its pressure takes the highest pressure named by any of them, or the largest
    vacuum, a time without a flow takes ``flow_ml_min``.
    """
    pairs = [(text, True) for text in least] + [(text, False) for text in most]
    texts = [*(text.partition("=")[0] for text, _ in pairs), best]
    named = (_kilopascals(place) for text in texts for place in text.split("@")[1:])
    kpa = max((pressure for pressure in named if pressure is not None), key=abs, default=None)
    requirements = tuple(_read(text, at_least, kpa, flow_ml_min) for text, at_least in pairs)
    _refuse_contradictions(requirements, [text for text, _ in pairs])
    quantity = read_quantity(best, kpa, flow_ml_min)
    return requirements, Goal(quantity, quantity.name in NAMES and NAMES[quantity.name].more)


def _read(text: str, at_least: bool, kpa: float | None, flow_ml_min: float) -> Requirement:
    option = "--min" if at_least else "--max"
    name, equals, value = text.partition("=")
    if not equals or not value.strip():
        raise DesignError(
            f"{option} {shown(text)} is not QUANTITY=VALUE; write for example {option} "
            f"{'stroke@50kPa=25' if at_least else 'overall_diameter=20'}"
        )
    quantity = safer(read_quantity(name, kpa, flow_ml_min), at_least)
    try:
        return Requirement(quantity, read_limit(quantity, value), at_least)
    except ValueError as error:
        raise DesignError(f"{option} {shown(text)}: the value {error}") from None


def _refuse_contradictions(requirements: Sequence[Requirement], texts: Sequence[str]) -> None:
    """Raises DesignError if a quantity's lower limit is above its upper limit."""
    pairs = permutations(zip(requirements, texts, strict=True), 2)
    for (least, least_text), (most, most_text) in pairs:
        is_pair = least.at_least and not most.at_least and least.limit > most.limit
        # The inflated diameter that must reach never exceeds the one that must not touch.
        if is_pair and least.quantity == safer(most.quantity, at_least=True):
            raise DesignError(
                f"--min {shown(least_text)} and --max {shown(most_text)} contradict each other; no "
                "design can meet both, so change one"
            )


# The values of a design.


@dataclass(frozen=True)
class Subject:
    """A design with its quantities, each computed once.

    ``given``: factors in place of the calibration's, ``origin``: the subject at the calibration's
    factors, whose stack is reused for others if possible. Its maps reach ``most_kpa``.
    """

    design: Design
    laminate: Laminate
    given: Factors | None = None
    origin: Subject | None = None
    most_kpa: float = MOST_PRESSURE

    def value(self, quantity: RequestedQuantity, good: float | None = None) -> float:
        """Return the value of a quantity in its unit; ``good`` is the share of good builds.

        Raises DesignError if the design has no such quantity, or no model covers it.
        """
        name, form = quantity.name, self.design.form
        if quantity.gauge_kpa is not None:
            refuse_beyond_burst(self.laminate, quantity.gauge_kpa)
        if name in ASKED:
            return mechanism_value(form.mechanism, self.laminate, name, quantity.kpa or USUAL_KPA)
        kpa = quantity.kpa or 0.0
        values: Mapping[str, Callable[[], Any]] = {
            "yield": lambda: good,
            "mass": lambda: film_mass(self.laminate),
            "height": lambda: self._actuator.thickness,
            "reference_stroke": lambda: self._actuator.known_stroke,
            "burst": lambda: self._burst.kpa,
            "time": lambda: self._time(quantity.flow or WATER_FLOW),
            "lumen": lambda: form.lumen,
            "stroke": lambda: self._stroke(kpa),
            "bend": lambda: self._bend(quantity.chambers, kpa),
            "force": lambda: self._force(self._stroke_of(quantity), kpa),
            "lateral_stiffness": lambda: elastic.shut_stiffness(self._stack, kpa)[0],
        }
        others = key_values(self.design) if "." in name else self._sizes
        value = values[name]() if name in values else others.get(name)
        if isinstance(value, int | float):
            return float(value)
        raise DesignError(f"{self.design.name} has no {name} that is a number")

    @cached_property
    def _sizes(self) -> Mapping[str, float]:
        return sizes(self.design, self.laminate, self.factors)

    @property
    def _burst(self) -> Burst:
        estimate = burst(self.laminate)
        if estimate is None:
            raise DesignError(f"the burst pressure of {self.design.name} is not known: {NOT_BURST}")
        return estimate

    def flags(self, quantity: RequestedQuantity) -> tuple[Flag, ...]:
        """Return the limits to trust in the quantity's figure, as in ``predict``."""
        form, kpa = self.design.form, quantity.gauge_kpa
        group, missed = group_of(quantity, form), 0.0
        if quantity.name == "burst":
            missed = calibration.burst_uncertainty(self._burst)[1]
        elif quantity.name == "reference_stroke" and self._actuator.radii:
            sizes = calibration.sizes_of(form, self.laminate)
            missed = sizes.farther(calibration.PAPER_3DOF)
        elif group is not None and self.uncertainty is not None:
            missed = self.uncertainty.farther(group)
        near = kpa is not None and is_near_burst(self.laminate, kpa)
        return (*calibration.flags_at(missed), *((NEAR_BURST,) if near else ()))

    def _time(self, flow_ml_min: float) -> float:
        time, _ = elastic.time_to_fill(self._stack, flow_ml_min, FULL_KPA)
        return time + self.factors.water_delay

    def _stroke_of(self, quantity: RequestedQuantity) -> float:
        """Return the stroke in mm at which a force is blocked; a share is relative to the reference
        stroke, as in ``predict``. Raises DesignError for a share without a reference stroke.
        """
        if not quantity.share:
            return quantity.stroke or 0.0
        reference = self._actuator.known_stroke
        if isinstance(self.design.form.pockets, Slots):
            return quantity.share * reference
        return self._actuator.stroke_at(quantity.share)

    @cached_property
    def factors(self) -> Factors:
        """The factors of the design's calibration, or the given ones."""
        return self.given or calibration.factors_of(self.design)

    @cached_property
    def uncertainty(self) -> calibration.Uncertainty | None:
        """The calibration of the design; None without one."""
        return calibration.uncertainty_of(self.design, laminate=self.laminate)

    @cached_property
    def _others(self) -> dict[Factors, Subject]:
        """The design at other factors."""
        return {self.factors: self}

    def _at(self, factors: Factors) -> Subject:
        subject = Subject(self.design, self.laminate, factors, self, self.most_kpa)
        return self._others.setdefault(factors, subject)

    def interval(
        self, quantity: RequestedQuantity, share: float = SHARE
    ) -> tuple[float, float] | None:
        """Return the interval that holds a measurement of the quantity with a probability of
        ``share``; None without a calibration, and if no calibrated model gives it.

        Raises DesignError if other factors of the calibration lead out of the model's range.
        """
        if quantity.name == "burst":
            return calibration.burst_uncertainty(self._burst, share)[0]
        group = group_of(quantity, self.design.form)
        is_unmolten = quantity.name == "height" and not self._actuator.folded.molten
        if self.uncertainty is None or group is None or is_unmolten:
            return None
        # Below 0 a force is only a distance from one, for the search.
        least = 0.0 if quantity.name == "force" and self.value(quantity) > 0 else -math.inf

        def value_at(factors: Factors) -> float:
            return max(self._at(factors).value(quantity), least)

        delay = "water_delay" if quantity.name == "time" else ""
        return self.uncertainty.interval_of(group, value_at, share, delay)[1]

    @cached_property
    def _actuator(self) -> Actuator:
        return Actuator(self.design, self.laminate, self.factors)

    @cached_property
    def _stack(self) -> Stack:
        moved = None
        if self.origin is not None:
            origin = self.origin
            moved = elastic.moved_stack(origin._stack, origin._actuator, self.factors)
        return moved or stack(self.design, self.laminate, self.most_kpa, self.factors)

    def _stroke(self, kpa: float) -> float:
        if isinstance(self.design.form.pockets, Slots):
            return self._actuator.known_stroke
        kinds = balloons_of(self.design, self.laminate, self.factors)
        return sum(kinds.count(kind) * free_height(kind, kpa) for kind in dict.fromkeys(kinds))

    def _bend(self, chambers: int, kpa: float) -> float:
        if not self.design.form.is_parallel:
            raise DesignError(f"{self.design.name} does not bend; only chambers side by side do")
        empty = self._stack.chambers - chambers
        if empty < 1:
            raise DesignError(
                f"{self.design.name} has {self._stack.chambers} chambers, and a bend is of at most "
                f"{self._stack.chambers - 1} of them, the others empty"
            )
        return self._stack.pose((*(kpa,) * chambers, *(0.0,) * empty)).bend

    def _force(self, stroke: float, kpa: float) -> float:
        form = self.design.form
        if isinstance(form.pockets, Slots):
            first = self._actuator.pockets[0]
            if stroke > first.largest_stroke:
                return first.largest_stroke - stroke
            return form.pushing * kpa * float(first.rate(stroke)) / 1000
        kinds = balloons_of(self.design, self.laminate, self.factors)
        push = float(elastic.blocked_force(self._stack, kpa, stroke))
        if push <= 0:
            maps = self._stack.maps
            free = sum(float(maps[level].free_height(kpa)) for level in self._stack.levels)
            # The shortfall of stroke, as the force for that much of it.
            least = min(kind.pocket for kind in kinds)
            return -kpa / 1000 * math.pi * least**2 * max(stroke / max(free, 1e-6) - 1, 0.0)
        elastic.refuse_stretched(float(elastic.held_stretch(kinds, [kpa], [stroke])[0]))
        return form.pushing * push

    def counterpart(self, quantity: RequestedQuantity) -> Counterpart | None:
        """Return the paper's measured value if the model is off by over a quarter, else None."""
        form, name = self.design.form, quantity.name
        if group_of(quantity, form) is None:
            return None
        at = Conditions(kpa=quantity.gauge_kpa, flow=quantity.flow)
        if name == "height":
            folded = self._actuator.folded
            if folded.molten > 0 and folded.factor != 1:
                return None
        elif name == "bend":
            at = at._replace(chambers=quantity.chambers)
        elif name == "force":
            # The nearest of the three heights at which forces were measured.
            share = self._stroke_of(quantity) / self._actuator.reference_stroke
            at = at._replace(share=min(HEIGHTS, key=lambda height: abs(height - share)))
        (of, model), of_papers = FIGURES[name], is_the_papers_3dof(form, self.laminate)
        return counterpart(form, of, at, model, self.factors.calibration, of_papers)


FIGURES = {
    "height": (Quantity.FOLDED_HEIGHT, ModelId.FILMS),
    "stroke": (Quantity.FREE_STROKE, ModelId.ELASTIC_BALLOON),
    "bend": (Quantity.BEND, ModelId.ELASTIC_STACK),
    "force": (Quantity.BLOCKED_FORCE, ModelId.ELASTIC_STACK),
    "time": (Quantity.WATER_TIME, ModelId.STACK_IN_TIME),
    "lateral_stiffness": (Quantity.SHUT_STIFFNESS, ModelId.STACK_SHUT),
}
"""Figures of ``predict`` and their models, of quantities that the paper measured."""


def group_of(quantity: RequestedQuantity, form: Form) -> str | None:
    """Return the group of a quantity's discrepancy; None if no calibrated model gives it."""
    if quantity.name == "height":
        return calibration.FLAT
    if quantity.name in ASKED or not quantity.is_moved or isinstance(form.pockets, Slots):
        return None
    return calibration.GROUP_BY_UNIT.get(quantity.unit, "motion")


@lru_cache(maxsize=4096)
def free_height(kind: Balloon, kpa: float) -> float:
    """Free height (mm) of a balloon. Raises BeyondError if its film does not stand it."""
    return elastic.free_rise(Counter([kind]), kpa).stroke
