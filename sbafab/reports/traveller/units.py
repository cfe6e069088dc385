"""Quantities as text, in the units of the bench's dials and rulers."""

from __future__ import annotations

import math

from sbafab.design.units import KILOPASCALS
from sbafab.laminate.laminate import Inlet
from sbafab.reports.drawing import TIMES

NEWTONS_PER_POUND = 4.4482216152605


BLANK = "________"
"""A blank to fill in by hand."""


ROUND = 10.0
"""Above this many minutes tenths are dropped."""


DIRECTIONS = (
    "to the right",
    "to the back right",
    "to the back",
    "to the back left",
    "to the left",
    "to the front left",
    "to the front",
    "to the front right",
)


def temperature(celsius: float) -> str:
    return f"{celsius:g} °C ({celsius * 9 / 5 + 32:.0f} °F)"


def pressure(kilopascals: float) -> str:
    return f"{kilopascals:g} kPa ({kilopascals / KILOPASCALS['psi']:.1f} psi)"


def force(newtons: float) -> str:
    pounds = newtons / NEWTONS_PER_POUND
    return f"{newtons:.0f} N = {newtons / 1000:.3f} kN = {pounds:.0f} lbf"


def minutes(value: float | None) -> str:
    """Return minutes to the tenth below ten, else whole: 3 min, 2.4 min, 47 min; blank for None."""
    if value is None:
        return f"{BLANK} min"
    return f"{round(value, 1):g} min" if value < ROUND else f"{value:.0f} min"


def plain(value: float | None) -> str:
    """Return a number without its unit, a blank for None."""
    return BLANK if value is None else f"{value:g}"


def hours(value: float | None) -> str:
    """Return minutes as hours, "1.75 h"; a blank for None."""
    return f"{BLANK} h" if value is None else f"{value / 60:.2f} h"


def whole_minutes(value: float | None) -> str:
    """Return minutes and hours, "105 min = 1.75 h"; a blank for None."""
    return minutes(None) if value is None else f"{value:.0f} min = {hours(value)}"


def product(number: int, value: float | None) -> float | None:
    """Return a value times a count; None for None."""
    return None if value is None else number * value


def millimetres(value: float) -> str:
    return f"{round(value, 3) + 0.0:g} mm"


def size(width: float, length: float) -> str:
    return f"{round(width, 2):g} {TIMES} {round(length, 2):g} mm"


def count(number: int, noun: str, plural: str = "") -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {plural or noun + 's'}"


def stacks(number: int) -> str:
    """Return the noun phrase after a definite article: stack, 3 stacks."""
    return "stack" if number == 1 else f"{number} stacks"


def toward(inlet: Inlet) -> str:
    """Return the bench direction in which an inlet tab points: x to the right, y to the back."""
    u, v = inlet.direction
    return DIRECTIONS[round(math.atan2(v, u) / (math.pi / 4)) % 8]
