"""Nests as they are saved with the sheets, so that a second export places the parts alike."""

from __future__ import annotations

import hashlib
import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import astuple
from typing import Any

from sbafab.laminate.films import Material
from sbafab.nesting.nest import materials_of, of_material
from sbafab.nesting.records import TURNS, EngineName, Nest, NestPart, Placement, Stock


def as_dict(nests: Sequence[Nest]) -> dict[str, Any]:
    """The placements of all nests, for JSON, under a key of all that decided them."""
    return {
        "key": _key((nest.engine, nest.stock, nest.parts) for nest in nests),
        "nests": {
            nest.material: [[p.part, p.sheet, p.turn, *p.shift] for p in nest.placements]
            for nest in nests
        },
    }


def from_dict(
    data: object, parts: Sequence[NestPart], stocks: Mapping[Material, Stock], engine: EngineName
) -> tuple[Nest, ...] | None:
    """The saved nests if they were made of these parts, stocks and engine; otherwise None.

    Whether the parts lie as they must is left to ``check_nest``.
    """
    wanted = [
        (material, stocks[material], of_material(parts, material))
        for material in materials_of(parts)
    ]
    key = _key((engine, stock, chosen) for _, stock, chosen in wanted)
    if not isinstance(data, dict) or data.get("key") != key:
        return None
    try:
        return tuple(
            Nest(engine, material, stock, chosen, _placements(data["nests"][material], chosen))
            for material, stock, chosen in wanted
        )
    except (KeyError, TypeError, ValueError):
        return None


def _key(nests: Iterable[tuple[EngineName, Stock, Sequence[NestPart]]]) -> str:
    told = [
        (
            engine,
            astuple(stock),
            [(p.design, p.pattern, p.piece, p.material, p.region.key, p.count) for p in parts],
        )
        for engine, stock, parts in nests
    ]
    return hashlib.sha256(repr(told).encode()).hexdigest()


def _placements(rows: object, parts: Sequence[NestPart]) -> tuple[Placement, ...]:
    """Raises TypeError or ValueError for rows that are no placements of all the parts."""
    if not isinstance(rows, list):
        raise TypeError
    found = []
    for part, sheet, turn, x, y in rows:
        if not (type(part) is type(sheet) is int and sheet >= 0 and math.isfinite(x + y)):
            raise ValueError
        found.append(Placement(part, sheet, TURNS[TURNS.index(turn)], (float(x), float(y))))
    if Counter(place.part for place in found) != dict(enumerate(part.count for part in parts)):
        raise ValueError
    return tuple(found)
