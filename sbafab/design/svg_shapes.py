"""Basic shapes of SVG as the paths that they stand for (SVG 2, sections 9 and 10)."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import NamedTuple
from xml.etree import ElementTree

from sbafab.design.svg_lengths import (
    NUMBER,
    WHITE,
    Page,
    SvgLength,
    diagonal,
    length,
    numbers,
    user_units,
)
from sbafab.design.svg_style import local
from sbafab.errors import DesignError

SHAPES = frozenset({"circle", "ellipse", "line", "path", "polygon", "polyline", "rect"})
LENGTHS = {
    "circle": ("cx", "cy", "r"),
    "ellipse": ("cx", "cy", "rx", "ry"),
    "line": ("x1", "y1", "x2", "y2"),
    "rect": ("x", "y", "width", "height", "rx", "ry"),
}
"""The lengths that a shape is drawn with; each is 0 where it is not given."""
ACROSS = frozenset({"cx", "rx", "width", "x", "x1", "x2"})
DOWN = frozenset({"cy", "ry", "height", "y", "y1", "y2"})
SIZES = frozenset({"height", "r", "rx", "ry", "width"})
TAKES = {"M": 2, "L": 2, "H": 1, "V": 1, "C": 6, "S": 4, "Q": 4, "T": 2, "A": 7, "Z": 0}
"""How many numbers a path command takes, over and over."""
UNLIKE = frozenset({"CT", "ST", "QS", "TS"})
"""Smooth curves after curves of the other degree: these begin without a tangent to go on with. The
library would mirror one, which a line of no length between them keeps it from."""
FLAGS = (3, 4)
"""Which of an arc's seven are 0 or 1, and may stand without a space after them."""

_COMMANDS = re.compile(r"([MmLlHhVvCcSsQqTtAaZz])")
_FLAGS_OF_ARC = re.compile(r"[01]")
_NUMBER = re.compile(NUMBER, re.ASCII)
_SPACE = re.compile(r"\s*(?:,\s*)?", re.ASCII)


class Sized(NamedTuple):
    """A shape with its lengths as they are written; None where one is not given, or "auto"."""

    name: str
    lengths: dict[str, SvgLength | None]
    text: str = ""
    """Of a path and of polylines: what they are drawn by."""

    @property
    def is_physical(self) -> bool:
        return any(value is not None and value.is_physical for value in self.lengths.values())


def sized(element: ElementTree.Element) -> Sized:
    """The shape of an element. Raises DesignError where programs would not agree on it."""
    name = local(element)
    found: dict[str, SvgLength | None] = {}
    for key in LENGTHS.get(name, ()):
        text = element.get(key, "").strip(WHITE)
        absent = text == "" or (text == "auto" and key in SIZES)
        found[key] = None if absent else length(text, f"<{name}> with {key}")
    for key, value in found.items():
        if key in SIZES and value is not None and value.number < 0:
            raise DesignError(f"has <{name}> with {key} {value.number:g}, which is negative")
    if name == "ellipse" and (found["rx"] is None) != (found["ry"] is None):
        raise DesignError("has <ellipse> with only one of rx and ry; give both")
    return Sized(name, found, element.get("points" if name.startswith("poly") else "d", ""))


def path_of(shape: Sized, page: Page) -> str:
    """The path data of a shape, in user units; empty where nothing is drawn."""
    whole = {**dict.fromkeys(ACROSS, page.width), **dict.fromkeys(DOWN, page.height)}
    value = {
        key: None
        if one is None
        else user_units(one, whole.get(key, diagonal(page)), f"<{shape.name}> with {key}")
        for key, one in shape.lengths.items()
    }
    if shape.name == "path":
        return " ".join(_commands(shape.text))
    if shape.name in ("polyline", "polygon"):
        return _corners(shape.text, shape.name)
    number = {key: one or 0.0 for key, one in value.items()}
    if shape.name == "line":
        return "M {x1!r} {y1!r} L {x2!r} {y2!r}".format_map(number)
    if shape.name == "rect":
        # A radius that is not given is the other one.
        rx, ry = (value["rx"], value["ry"]) if value["rx"] is not None else (value["ry"],) * 2
        return _rect(number, rx or 0.0, rx or 0.0 if ry is None else ry)
    radii = (number["r"],) * 2 if shape.name == "circle" else (number["rx"], number["ry"])
    return _ellipse(number["cx"], number["cy"], *radii)


def _ellipse(cx: float, cy: float, rx: float, ry: float) -> str:
    if rx == 0 or ry == 0:
        return ""
    stops = ((cx, cy + ry), (cx - rx, cy), (cx, cy - ry), (cx + rx, cy))
    arcs = (f"A {rx!r} {ry!r} 0 0 1 {x!r} {y!r}" for x, y in stops)
    return f"M {cx + rx!r} {cy!r} {' '.join(arcs)} Z"


def _rect(number: dict[str, float], rx: float, ry: float) -> str:
    x, y, width, height = (number[key] for key in ("x", "y", "width", "height"))
    if width == 0 or height == 0:
        return ""
    rx, ry = min(rx, width / 2), min(ry, height / 2)
    right, bottom = x + width, y + height
    if rx == 0 or ry == 0:
        return f"M {x!r} {y!r} H {right!r} V {bottom!r} H {x!r} Z"
    turn = f"A {rx!r} {ry!r} 0 0 1"
    return (
        f"M {x + rx!r} {y!r} H {right - rx!r} {turn} {right!r} {y + ry!r} "
        f"V {bottom - ry!r} {turn} {right - rx!r} {bottom!r} "
        f"H {x + rx!r} {turn} {x!r} {bottom - ry!r} V {y + ry!r} {turn} {x + rx!r} {y!r} Z"
    )


def _corners(text: str, name: str) -> str:
    try:
        found = list(numbers(text))
    except ValueError as error:
        raise DesignError(
            f'has <{name}> with points that stop at "{error}"; draw it again'
        ) from None
    if len(found) % 2:
        raise DesignError(f"has <{name}> with an odd count of numbers in points; draw it again")
    if not found:
        return ""
    pairs = [f"{x} {y}" for x, y in zip(found[::2], found[1::2], strict=True)]
    return f"M {' L '.join(pairs)}{' Z' if name == 'polygon' else ''}"


def _commands(text: str) -> Iterator[str]:
    """Path data with every command and number apart. Raises DesignError where it is damaged."""
    if text.strip(WHITE) in ("", "none"):
        return
    start, *rest = _COMMANDS.split(text)
    letters, bodies = rest[::2], rest[1::2]
    if start.strip(WHITE) or not letters or letters[0] not in "Mm":
        raise DesignError("has <path> with d that does not begin with a move; draw it again")
    for before, letter, body in zip(["", *letters], letters, bodies, strict=False):
        takes = TAKES[letter.upper()]
        found = list(_numbers(body, takes == 7))
        if (takes == 0 and found) or (takes and (not found or len(found) % takes)):
            raise DesignError(
                f'has <path> with d that is damaged at "{letter}{body.strip()[:20]}"; draw it again'
            )
        if before.upper() + letter.upper() in UNLIKE:
            yield from ("l", "0", "0")
        if takes == 7:
            yield from _arcs(letter, found)
        else:
            yield letter
            yield from found


def _arcs(letter: str, found: list[str]) -> Iterator[str]:
    """Arcs one by one; those without a radius are lines."""
    for first in range(0, len(found), 7):
        rx, ry, *rest = found[first : first + 7]
        if float(rx) == 0 or float(ry) == 0:
            yield from ("L" if letter == "A" else "l", *rest[-2:])
        else:
            yield from (letter, rx, ry, *rest)


def _numbers(text: str, arcs: bool) -> Iterator[str]:
    """The numbers after a path command; the flags of arcs need nothing between them."""
    place, count = len(text) - len(text.lstrip(WHITE)), 0
    while place < len(text):
        is_flag = arcs and count % 7 in FLAGS
        match = (_FLAGS_OF_ARC if is_flag else _NUMBER).match(text, place)
        if match is None:
            raise DesignError(
                f'has <path> with d that is damaged at "{text[place : place + 20]}"; draw it again'
            )
        yield match[0] if is_flag else repr(float(match[0]))
        count += 1
        between = _SPACE.match(text, match.end())
        place = between.end() if between else match.end()
