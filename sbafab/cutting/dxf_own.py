"""Cut files read by the form in which this program writes them, and in no other.

All but numbers, properties and entities has to be the packaged empty document, letter by letter,
and every entity one of the four that are written, with the handle that is its turn. What such a
text holds for ezdxf is therefore known; ``tests/cutting/test_dxf_own.py`` compares the two.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from typing import NamedTuple

from sbafab.cutting.cut_layers import COLOURS, CUT_INNER, CUT_OUTER
from sbafab.cutting.dxf_shapes import DrawnEntity, arc, of_polyline, polyline
from sbafab.cutting.dxf_write import skeleton
from sbafab.errors import OutputError
from sbafab.geometry.edges import Line
from sbafab.geometry.shapes import circle

_NUMBER = r"-?\d{1,7}\.\d{1,9}"
_VALUE = rf"({_NUMBER})\n"
_PROPERTY = re.compile(
    r"  9\n\$CUSTOMPROPERTYTAG\n  1\n([^\n]*)\n  9\n\$CUSTOMPROPERTY\n  1\n([^\n]*)\n"
)
_UNSURE = re.compile(r"\A\s|\s\Z|[\\^%]")
"""In a property: what a reader of DXF may take for a code, or leave out."""
_LOW, _HIGH = (f" 10\n{_NUMBER}\n 20\n{_NUMBER}\n",) * 2
_EXTENTS = re.compile(
    rf"  9\n\$EXTMIN\n{_LOW} 30\n0\.0\n  9\n\$EXTMAX\n{_HIGH} 30\n0\.0\n"
    rf"  9\n\$LIMMIN\n{_LOW}  9\n\$LIMMAX\n{_HIGH}"
)
ROUND = {"CIRCLE": ("x", "y", "radius"), "ARC": ("x", "y", "radius", "from", "to")}
"""What round entities are drawn with."""
_HANDLE = re.compile(r"[0-9A-F]{1,8}")
_ROW = re.compile(rf" 10\n{_VALUE} 20\n{_VALUE}(?: 42\n{_VALUE})?")


class OwnFile(NamedTuple):
    """What a file in this program's form holds."""

    properties: dict[str, str]
    drawn: list[DrawnEntity]


def as_written(text: str) -> OwnFile | None:
    """What a cut file in this program's form holds; None for any other text, and for a polyline
    that cannot be cut.
    """
    form = skeleton()
    if not (text.startswith(form.before_properties) and text.endswith(form.tail)):
        return None
    properties, place = _properties(text, len(form.before_properties))
    if properties is None or not text.startswith(form.before_extents, place):
        return None
    extents = _EXTENTS.match(text, place + len(form.before_extents))
    if extents is None or not text.startswith(form.before_seed, extents.end()):
        return None
    seed = _HANDLE.match(text, extents.end() + len(form.before_seed))
    if seed is None or not text.startswith(form.before_entities, seed.end()):
        return None
    entities = text[seed.end() + len(form.before_entities) : len(text) - len(form.tail)]
    try:
        drawn = _entities(entities, form.first_handle, int(seed[0], 16))
    except OutputError:
        return None
    return OwnFile(properties, drawn) if drawn is not None else None


def _properties(text: str, place: int) -> tuple[dict[str, str] | None, int]:
    """The custom properties from a place on, and where they end; None where they may be others."""
    found: dict[str, str] = {}
    while match := _PROPERTY.match(text, place):
        name, value = match.groups()
        if name in found or any(
            _UNSURE.search(said) or not said.isprintable() for said in (name, value)
        ):
            return None, place
        found[name] = value
        place = match.end()
    return found, place


@cache
def _entity(model_space: str) -> re.Pattern[str]:
    """One entity: kind, handle, layer and what it is drawn with."""
    kinds = (
        rf"AcDbPolyline\n 90\n(\d+)\n 70\n([01])\n((?: 10\n{_NUMBER}\n 20\n{_NUMBER}\n"
        rf"(?: 42\n{_NUMBER}\n)?)+)",
        rf"AcDbCircle\n 10\n{_VALUE} 20\n{_VALUE} 30\n0\.0\n 40\n{_VALUE}"
        rf"(?:100\nAcDbArc\n 50\n{_VALUE} 51\n{_VALUE})?",
        rf"AcDbLine\n 10\n{_VALUE} 20\n{_VALUE} 30\n0\.0\n 11\n{_VALUE} 21\n{_VALUE} 31\n0\.0\n",
    )
    return re.compile(
        rf"  0\n(LWPOLYLINE|CIRCLE|LINE|ARC)\n  5\n([0-9A-F]+)\n330\n{model_space}\n100\n"
        rf"AcDbEntity\n  8\n({'|'.join(COLOURS)})\n100\n(?:{'|'.join(kinds)})"
    )


def _entities(text: str, first_handle: int, seed: int) -> list[DrawnEntity] | None:
    """All entities of a text of nothing else, their handles counted up to the ``seed``."""
    drawn: list[DrawnEntity] = []
    place = 0
    for match in _entity(skeleton().model_space).finditer(text):
        if match.start() != place or match[2] != f"{first_handle + len(drawn):X}":
            return None
        own = _drawn(match)
        if own is None:
            return None
        drawn.append(own)
        place = match.end()
    return drawn if place == len(text) and first_handle + len(drawn) == seed else None


def _drawn(match: re.Match[str]) -> DrawnEntity | None:
    kind, _, layer, count, closed, rows, *numbers = match.groups()
    said = [float(number) for number in numbers if number is not None]
    if kind == "LWPOLYLINE" and rows is not None:
        points = list(_rows(rows))
        if len(points) != int(count):
            return None
        edges = polyline(points, closed == "1", 0.0, layer not in (CUT_INNER, CUT_OUTER))
        return of_polyline(kind, layer, edges, closed == "1")
    is_round = numbers[0] is not None and len(said) == len(ROUND.get(kind, ""))
    if is_round and said[2] > 0:
        x, y, radius, *turn = said
        if kind == "CIRCLE":
            return DrawnEntity(kind, layer, circle((x, y), radius), ())
        return DrawnEntity(kind, layer, None, arc((x, y), radius, *turn))
    if kind == "LINE" and numbers[-1] is not None:
        x, y, u, v = said
        return DrawnEntity(kind, layer, None, [Line((x, y), (u, v))])
    return None


def _rows(text: str) -> Iterator[tuple[float, ...]]:
    """Vertices as an LWPOLYLINE has them: x, y, start and end width, bulge."""
    for x, y, bulge in _ROW.findall(text):
        yield float(x), float(y), 0.0, 0.0, float(bulge or 0.0)
