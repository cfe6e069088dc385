"""Quantities as text, in the units of the bench's instruments, and the pages that use them."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sbafab.design.units import KILOPASCALS
from sbafab.laminate.laminate import Inlet
from sbafab.markup import environment
from sbafab.pressing.schedule import HANDLING_MINUTES, joined_words, layers_in_words
from sbafab.reports.drawing import TIMES, layer_numbers
from sbafab.reports.traveller.lay_up import face_down, layer_words
from sbafab.version import GENERATOR

if TYPE_CHECKING:
    from jinja2 import Environment

HERE = Path(__file__).parent
SHORT_HASH = 12
NEWTONS_PER_POUND = 4.4482216152605
BLANK = "________"  # a blank to fill in by hand
ROUND = 10.0  # above this many minutes tenths are dropped
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
    """Minutes to one decimal below ten, else whole: 3 min, 2.4 min, 47 min; blank for None."""
    if value is None:
        return f"{BLANK} min"
    return f"{round(value, 1):g} min" if value < ROUND else f"{value:.0f} min"


def whole_minutes(value: float | None) -> str:
    """Return minutes and hours, "105 min = 1.75 h"; a blank for None."""
    return minutes(None) if value is None else f"{value:.0f} min = {value / 60:.2f} h"


def millimetres(value: float) -> str:
    return f"{round(value, 3) + 0.0:g} mm"


def size(width: float, length: float) -> str:
    return f"{round(width, 2):g} {TIMES} {round(length, 2):g} mm"


def count(number: int, noun: str, plural: str = "") -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {plural or noun + 's'}"


def toward(inlet: Inlet) -> str:
    """Return the bench direction of an inlet tab: x to the right, y to the back."""
    u, v = inlet.direction
    return DIRECTIONS[round(math.atan2(v, u) / (math.pi / 4)) % 8]


FILTERS = {
    "mm": millimetres,
    "celsius": temperature,
    "kpa": pressure,
    "newtons": force,
    "minutes": minutes,
    "whole_minutes": whole_minutes,
    # ``many`` times a number without its unit
    "plain": lambda value, many=1: BLANK if value is None else f"{many * value:g}",
    "g": lambda value: f"{value:g}",
    "fixed": lambda value, digits: f"{value:.{digits}f}",
    "count": count,
    "spaces": lambda words: words.__class__(" ".join(words.split())),
    # after a definite article
    "stacks": lambda number: "stack" if number == 1 else f"{number} stacks",
    "toward": toward,
    "named": layer_words,
    "face_down": face_down,
    # to two digits, whole above 99
    "mg": lambda mass: f"{mass:.2g}" if mass < 99.5 else f"{mass:.0f}",
    "joined": lambda words: joined_words(list(words)),
    "numbers": layer_numbers,
    "indices": lambda layers: [layer.index for layer in layers],
    "numbered": lambda layer: f"{layer.index}: {layer_words(layer)}",
    "layers": layers_in_words,
    "role": lambda layer: layer.role.replace("-", " "),
    "file": lambda path: path.rpartition("/")[2],
}


@cache
def _pages() -> Environment:
    pages = environment(HERE)
    pages.filters.update(FILTERS)
    pages.globals.update(size=size, BLANK=BLANK, HANDLING_MINUTES=HANDLING_MINUTES)
    return pages


def render(template: str, **values: Any) -> str:
    """Return a page, or part of one, from its Jinja template."""
    return _pages().get_template(template).render(values)


def frame(title: str, sha256: str) -> dict[str, Any]:
    """Return the values common to all pages: style, head and foot."""
    short = sha256[:SHORT_HASH]
    return {
        "title": title,
        "sha256": sha256,
        "short_hash": short,
        "generator": GENERATOR,
        "running_head": _css_string(f"{title}  {short}"),
        "style": (HERE / "traveller.css").read_text(encoding="utf-8"),
    }


def _css_string(words: str) -> str:
    """Return a text as a CSS string that cannot end early or close the style element."""
    return '"' + "".join(c if c.isalnum() or c in " .-_" else f"\\{ord(c):x} " for c in words) + '"'
