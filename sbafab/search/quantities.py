"""Quantities of requirements: sizes, mass, yield, stroke, bend, force, stiffness, time, and a
design's keys.

Each is a figure of ``predict``, from the same function: a stroke is the free stroke at a pressure;
bends, forces, stiffness and times come from the elastic stack.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import permutations
from string import ascii_letters
from typing import Any, NamedTuple

from sbafab.design.files import hint, key_paths, shown
from sbafab.design.records import Design, Discs, Form, Slots
from sbafab.design.units import (
    KILOPASCALS,
    MILLILITRES_PER_MINUTE,
    in_first_unit,
    millimetres,
    share_of,
)
from sbafab.errors import BeyondError, DesignError
from sbafab.laminate.laminate import Laminate
from sbafab.models.figures import Figure, MeasuredValue
from sbafab.models.paper import FULL_KPA, WATER_FLOW
from sbafab.models.pneumatics import refuse_pressure, seconds
from sbafab.models.prediction import figure
from sbafab.models.quantity import ANYWHERE, Conditions, Quantity
from sbafab.search.vary import key_values


class QuantityName(NamedTuple):
    """A quantity as users write it, with its unit and meaning.

    ``more``: to be maximised; others are minimised. ``is_drawn``: from the drawing and its
    tolerances; others are predicted.
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


CALIBRATED = "calibrated"
FIGURES: dict[str, tuple[Quantity, Conditions, str]] = {
    **{
        of.key: (of, ANYWHERE, "")
        for of in (
            *(Quantity.OVERALL_DIAMETER, Quantity.OUTLINE_DIAMETER, Quantity.WIDTH),
            *(Quantity.DEFLATED_DIAMETER, Quantity.INFLATED_DIAMETER, Quantity.REACHED_DIAMETER),
            *(Quantity.LENGTH, Quantity.MASS, Quantity.REFERENCE_STROKE, Quantity.BURST),
        )
    },
    "height": (Quantity.FOLDED_HEIGHT, ANYWHERE, CALIBRATED),
    "stroke": (Quantity.FREE_STROKE, ANYWHERE, CALIBRATED),
    "bend": (Quantity.BEND, Conditions(chambers=1), CALIBRATED),
    "force": (Quantity.BLOCKED_FORCE, ANYWHERE, CALIBRATED),
    "lateral_stiffness": (Quantity.SHUT_STIFFNESS, ANYWHERE, CALIBRATED),
    "time": (Quantity.WATER_TIME, Conditions(kpa=FULL_KPA), CALIBRATED),
    "contraction": (Quantity.CONTRACTION, ANYWHERE, "pouch-motor"),
    "pull": (Quantity.PULL, Conditions(share=0.1), "pouch-motor"),
    "free_bend": (Quantity.FREE_BEND, ANYWHERE, "hinge"),
    "moment": (Quantity.MOMENT, Conditions(share=0.0), "hinge"),
    "load": (Quantity.WRINKLING_LOAD, ANYWHERE, "beam"),
    "slip": (Quantity.SLIP_LOAD, ANYWHERE, "jamming"),
    "push": (Quantity.FORCE_BOUND, ANYWHERE, "push"),
}
"""Figures of ``predict`` with the conditions that a requirement does not name, and what gives them:
a calibrated model (of oblong pockets of the height alone), or a kind of mechanism.
"""
USUAL_KPA = 10.0
COUNT = "chamber.count"
"""Key of the number of chambers side by side."""
_CHAMBERS = re.compile(r"\s*([1-9]\d?)\s*chambers?\s*", re.IGNORECASE)
NAMES = {row.name: row for row in QUANTITIES}
AT_PRESSURE = tuple(row.name for row in QUANTITIES if "@" in row.written)
"""Quantities that take a pressure."""
TAKES = {"bend": ("kpa", "chambers"), "force": ("kpa", "rise", "share"), "time": ("flow",)}
"""Conditions of quantities that take others than a pressure."""
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
ONE_STROKE = f"a force needs exactly one stroke, and other quantities have none; {HOW}"


@dataclass(frozen=True)
class RequestedQuantity:
    """A quantity by name or dotted key, at the conditions ``at``: the pressure, a force's rise or
    share of the reference stroke, a bend's chambers, a time's flow.
    """

    name: str
    at: Conditions = ANYWHERE

    @property
    def unit(self) -> str:
        return NAMES[self.name].unit if self.name in NAMES else ""

    @property
    def label(self) -> str:
        at = self.at
        places = [
            (at.rise is not None, f"{at.rise or 0:g}mm"),
            (at.share is not None, f"{100 * (at.share or 0):g}%"),
            ((at.chambers or 1) > 1, f"{at.chambers}chambers"),
            (at.kpa is not None, f"{at.kpa or 0:g}kPa"),
            (at.flow is not None, f"{at.flow or 0:g}ml/min"),
        ]
        return "@".join([self.name, *(text for is_given, text in places if is_given)])

    @property
    def key(self) -> str | None:
        """The design key of the quantity, or None."""
        if self.name == "lumen":
            return "lumen.diameter"
        return self.name if "." in self.name else None

    @property
    def figure(self) -> tuple[Quantity, Conditions] | None:
        """The figure of ``predict`` and its conditions; None for the drawing and its keys."""
        if self.name not in FIGURES:
            return None
        of, usual, _ = FIGURES[self.name]
        at = Conditions(**{**usual.as_dict(), **self.at.as_dict()})
        # Flat is no rise, and no share of a reference stroke, which may not be known.
        return of, at._replace(rise=None, share=0.0) if at.rise == 0 else at

    @property
    def kpa(self) -> float | None:
        """The gauge pressure in kPa, for a time the final one; None without one."""
        return self.figure[1].kpa if self.figure else None

    def is_calibrated(self, form: Form) -> bool:
        """Return True if a calibrated model predicts the quantity."""
        is_oblong = isinstance(form.pockets, Slots) and self.name != "height"
        return FIGURES.get(self.name, ("",))[-1] == CALIBRATED and not is_oblong


def read_quantity(
    text: str, kpa: float | None = None, flow_ml_min: float = WATER_FLOW
) -> RequestedQuantity:
    """Return the quantity in a text. ``kpa`` is used if it names no pressure, ``flow_ml_min`` if a
    time names no flow. Raises DesignError.
    """
    name, *places = (part.strip() for part in text.split("@"))
    name = name if "." in name else name.replace("-", "_").lower()
    takes = TAKES.get(name, ("kpa",) if name in AT_PRESSURE else ())
    if places and not takes:
        named = f"{', '.join(AT_PRESSURE[:-1])} and {AT_PRESSURE[-1]}"
        raise DesignError(f"{shown(text)}: only {named} can have a pressure; {HOW}")
    if name not in NAMES and "." not in name:
        raise DesignError(f"{shown(text)} is not a quantity; {hint(name, [*NAMES, 'any key'])}")
    try:
        read = [_condition(place, takes) for place in places]
        return RequestedQuantity(name, _conditions(name, read, takes, kpa, flow_ml_min))
    except ValueError as error:
        raise DesignError(f"{shown(text)}: {error}") from None


def read_measured(text: str) -> MeasuredValue:
    """Return a value measured on an actuator, such as "stroke@10kPa=16.6mm"; with a pressure
    "height" is the full height at it. Raises DesignError.
    """
    name, is_given, value = (part.strip() for part in text.rpartition("="))
    if not is_given:
        raise DesignError(f'{shown(text)} has no value; write it as "stroke@10kPa=16.6mm"')
    of_height, _, place = name.partition("@")
    is_full = of_height.strip() == "height" and bool(place)
    quantity = read_quantity(f"stroke@{place}" if is_full else name)
    if quantity.figure is None:
        raise DesignError(
            f"{shown(text)} is a property of the drawing, which does not narrow a prediction"
        )
    of, at = quantity.figure
    try:
        number = read_limit(quantity, value)
    except ValueError as error:
        raise DesignError(f"{shown(text)}: {shown(value)} {error}") from None
    if number == 0:
        raise DesignError(f"{shown(text)} must be above 0")
    return MeasuredValue(text, Quantity.FREE_HEIGHT if is_full else of, at, number)


def safer(quantity: RequestedQuantity, at_least: bool) -> RequestedQuantity:
    """The quantity to compare with a limit: the conservative one of the inflated diameters."""
    if quantity.name not in (REACHED, WIDEST):
        return quantity
    return RequestedQuantity(REACHED if at_least else WIDEST)


def _conditions(
    name: str,
    named: Sequence[tuple[str, float]],
    takes: Sequence[str],
    kpa: float | None,
    flow_ml_min: float,
) -> Conditions:
    """Return all conditions of a quantity. Raises ValueError with the end of a sentence."""
    read: dict[str, Any] = dict(named)
    if len(read) < len(named):
        raise ValueError("names two pressures, strokes or flows; name one")
    if len({"rise", "share"} & read.keys()) != (name == "force"):
        raise ValueError(ONE_STROKE)
    if "flow" in takes:
        seconds(0.0, read.setdefault("flow", flow_ml_min))
    if "kpa" in takes:
        is_vacuum = name == "slip"
        is_usable = kpa is not None and (kpa < 0) == is_vacuum
        read.setdefault("kpa", kpa if is_usable else USUAL_KPA * (1 - 2 * is_vacuum))
        refuse_pressure(read["kpa"], is_vacuum)
    return Conditions(**read)


def _condition(place: str, takes: Sequence[str]) -> tuple[str, float]:
    """Return the condition that a place in a quantity names, of those that it ``takes``, and its
    value. Raises ValueError with the end of a sentence.
    """
    is_bare = place.replace(".", "", 1).isdecimal()
    count, kilopascals = _CHAMBERS.fullmatch(place), _kilopascals(place)
    if "flow" in takes:
        flow = None if is_bare else in_first_unit(place, MILLILITRES_PER_MINUTE)
        if flow is None:
            raise ValueError("a time has one flow, such as time@35ml/min")
        return "flow", flow
    if count is not None and "chambers" in takes:
        return "chambers", int(count[1])
    if kilopascals is not None:
        return "kpa", kilopascals
    if is_bare:
        length = f" or {place}mm" if "rise" in takes else ""
        raise ValueError(f"{shown(place)} has no unit; write {place}kPa{length}")
    try:
        return ("share", read_share(place)) if place.endswith("%") else ("rise", millimetres(place))
    except ValueError as error:
        reason = error if place.endswith("%") else "is neither a pressure nor a length"
        raise ValueError(f"{shown(place)} {reason}; {HOW}") from None


def _kilopascals(place: str) -> float | None:
    """Return the pressure of a text such as 50kPa, with its unit in either case; None for other
    text.

    MPa and mPa differ: an ambiguous unit is rejected.
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
                f"must be a number in {quantity.unit}, or with a unit: {', '.join(units)}"
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
    """Return a share such as 0.95 or 95%. Raises ValueError with the end of a sentence."""
    read = share_of(text)
    if read is None or not 0 <= read <= 1:
        raise ValueError("must be a fraction from 0 to 1, such as 0.95 or 95%")
    return read


def shown_value(quantity: RequestedQuantity, value: float) -> str:
    """Return a figure with its unit, for display."""
    if quantity.name == "force" and value < 0:
        return "none, it does not rise that far"
    return f"{value:.4g} {quantity.unit}".rstrip()


# Requirements on quantities, and the goal.


CLOSE = 1e-9


@dataclass(frozen=True)
class Requirement:
    """A quantity with its lower or upper limit."""

    quantity: RequestedQuantity
    limit: float
    at_least: bool

    def margin(self, value: float) -> float:
        """The margin of a value as a fraction of the limit; negative if it breaks the limit."""
        more = value - self.limit if self.at_least else self.limit - value
        return more / (abs(self.limit) or 1.0)

    def holds(self, value: float) -> bool:
        return self.margin(value) >= -CLOSE

    @property
    def sense(self) -> str:
        return "at least" if self.at_least else "at most"

    @property
    def bound(self) -> str:
        """The limit as text, such as "at least 3 N"."""
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
    least: Sequence[str], most: Sequence[str], best: str = "mass", flow_ml_min: float = WATER_FLOW
) -> tuple[tuple[Requirement, ...], Goal]:
    """Return the requirements of ``QUANTITY=VALUE`` texts, and the goal. Raises DesignError.

    A quantity without a pressure uses the highest pressure in any of them, or the largest vacuum; a
    time without a flow uses ``flow_ml_min``.
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
    """Raise DesignError if a quantity's lower limit is above its upper limit."""
    pairs = permutations(zip(requirements, texts, strict=True), 2)
    for (least, least_text), (most, most_text) in pairs:
        is_pair = least.at_least and not most.at_least and least.limit > most.limit
        # The inflated diameter that must reach never exceeds the one that must not touch.
        if is_pair and least.quantity == safer(most.quantity, at_least=True):
            raise DesignError(
                f"--min {shown(least_text)} and --max {shown(most_text)} contradict each other; "
                "change one of them"
            )


# The values of a design.


def measured(
    quantity: RequestedQuantity,
    design: Design,
    laminate: Laminate,
    good: float | None = None,
    pressures_kpa: Sequence[float] = (),
    probability: float | None = None,
) -> tuple[float, Figure | None]:
    """Return the value of a quantity of a design in its unit, and its figure of ``predict``, if
    any.

    ``good`` is the share of good builds, the others are as in ``figure``. Raises DesignError if the
    design lacks the quantity, or no model covers it.
    """
    name, form = quantity.name, design.form
    if quantity.figure is None:
        others = {**key_values(design), "yield": good, "lumen": form.lumen}
        value = others.get(name)
        if isinstance(value, int | float):
            return float(value), None
        raise DesignError(f"{design.name} has no {name} as a number")
    of, at = quantity.figure
    kind = FIGURES[name][-1]
    is_of_stack = kind in ("", CALIBRATED)
    if not is_of_stack and (form.mechanism is None or form.mechanism.kind != kind):
        has = f"a mechanism of {form.mechanism.kind}" if form.mechanism else "no mechanism"
        raise DesignError(f"{name} needs a {kind}, but the design has {has}")
    if of is Quantity.BEND:
        refuse_bend(quantity, design)
    if of is Quantity.FREE_STROKE and isinstance(form.pockets, Slots):
        of, at = Quantity.REFERENCE_STROKE, ANYWHERE
    if of is Quantity.BLOCKED_FORCE and isinstance(form.pockets, Slots | Discs):
        largest = figure(design, laminate, Quantity.LARGEST_STROKE).value
        stroke = at.rise or 0.0
        if at.share:
            stroke = at.share * figure(design, laminate, Quantity.REFERENCE_STROKE).value
        is_beyond = isinstance(form.pockets, Slots) and stroke > largest
        item = None if is_beyond else figure(design, laminate, of, at, pressures_kpa, probability)
        if item is None:
            return largest - stroke, None
        if item.value <= 0 and isinstance(form.pockets, Discs):
            # For the search: the shortfall of stroke, as the force for that much of it.
            with suppress(BeyondError):
                rise = figure(design, laminate, Quantity.FREE_STROKE, Conditions(kpa=at.kpa))
                largest = rise.value
            flat = (at.kpa or 0.0) / 1000 * math.pi * (min(form.pockets.diameters) / 2) ** 2
            return -flat * max(stroke / largest - 1, 0.0), None
        return item.value, item
    item = figure(design, laminate, of, at, pressures_kpa, probability)
    return item.value, item


def refuse_absent(
    quantity: RequestedQuantity, design: Design, free: Sequence[str], option: str
) -> None:
    """Raise DesignError for an unknown key, with the likely one, and for a quantity that the
    design's family lacks. Also for a bend for which no chamber would stay empty. The ``free`` keys
    vary by the ``option``.
    """
    name, form = quantity.name, design.form
    if "." in name and name not in key_paths(type(design)):
        design.with_({name: 1})
    if name == "lumen" and form.lumen is None:
        raise DesignError(f"{design.name} has no lumen; only lobed designs do")
    if name in ROUND_A_TUBE and form.wrap is None:
        raise DesignError(f"{design.name} has no {name}; only radial designs do")
    if name == "bend" and COUNT not in free:
        refuse_bend(quantity, design, f"; ask for more with {option} {COUNT}=LOW:HIGH:STEP")


def refuse_bend(quantity: RequestedQuantity, design: Design, more: str = "") -> None:
    """Raise DesignError for a bend for which no chamber would stay empty; ``more`` ends the
    sentence.
    """
    form, chambers = design.form, quantity.at.chambers or 1
    if not form.is_parallel:
        raise DesignError(f"{design.name} does not bend; only parallel chambers do")
    if chambers >= form.stacks:
        raise DesignError(
            f"{quantity.label}: {design.name} has {form.stacks} chambers; a bend needs at most "
            f"{form.stacks - 1} filled and the others empty{more}"
        )
