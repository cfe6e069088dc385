"""Nesting: every part of each material on as few sheets as an engine finds."""

from __future__ import annotations

import hashlib
import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import astuple
from typing import Any

from sbafab.laminate.films import Material, in_order
from sbafab.nesting.records import (
    TURNS,
    EngineName,
    Nest,
    NestPart,
    Placement,
    Stock,
    no_usable_area,
    too_large,
    too_many,
)

ROUNDING = 5e-7


def nest(
    parts: Sequence[NestPart],
    stocks: Mapping[Material, Stock],
    engine: EngineName = "bottom-left",
    seconds: float = 20.0,
) -> tuple[Nest, ...]:
    """One nest for each material that has parts, TPE first.

    ``seconds`` is how long spyrrow looks for each sheet. Raises DesignError where a part does not
    fit a sheet or more sheets are needed than may be used.
    """
    nests = []
    for material in materials_of(parts):
        chosen = of_material(parts, material)
        nests.append(_nest(material, chosen, stocks[material], engine, seconds))
    return tuple(nests)


def refuse_unfit(parts: Sequence[NestPart], stocks: Mapping[Material, Stock]) -> None:
    """Raises DesignError where no search is needed to see that the sheets are too small or few."""
    for material in materials_of(parts):
        _check_fit(material, of_material(parts, material), stocks[material])


def materials_of(parts: Sequence[NestPart]) -> list[Material]:
    """The materials that have parts, TPE first."""
    return in_order(part.material for part in parts if part.count > 0)


def of_material(parts: Sequence[NestPart], material: Material) -> tuple[NestPart, ...]:
    return tuple(part for part in parts if part.material == material and part.count > 0)


def _nest(
    material: Material,
    parts: tuple[NestPart, ...],
    stock: Stock,
    engine: EngineName,
    seconds: float,
) -> Nest:
    _check_fit(material, parts, stock)
    if engine == "spyrrow":
        from sbafab.nesting.strip import strip

        placements = strip(parts, stock, seconds)
    else:
        from sbafab.nesting.bottom_left import bottom_left

        placements = bottom_left(parts, stock)
    found = Nest(engine, material, stock, parts, placements)
    if found.sheets > stock.most:
        total = sum(part.count for part in parts)
        raise too_many(material, total, f"{found.sheets} sheets", stock)
    return found


def _check_fit(material: Material, parts: Sequence[NestPart], stock: Stock) -> None:
    left, bottom, right, top = stock.usable
    if right - left <= 0 or top - bottom <= 0:
        raise no_usable_area(material, stock)
    across, along = right - left + ROUNDING, top - bottom + ROUNDING
    for part in parts:
        low_x, low_y, high_x, high_y = part.region.bounds
        width, height = high_x - low_x, high_y - low_y
        lying = width <= across and height <= along
        standing = 1 in stock.turns and height <= across and width <= along
        if not (lying or standing):
            raise too_large(part, stock)
    least = _least_sheets(parts, stock)
    if least > stock.most:
        total = sum(part.count for part in parts)
        raise too_many(material, total, f"at least {least} sheets", stock)


def _least_sheets(parts: Sequence[NestPart], stock: Stock) -> int:
    """Sheets that the parts' bare areas fill: no nest can do with fewer."""
    left, bottom, right, top = stock.usable
    area = sum(part.count * part.region.area for part in parts)
    return math.ceil(area / ((right - left) * (top - bottom)) - 1e-9)


# Nests as they are saved with the sheets, so that a second export places the parts alike.


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
