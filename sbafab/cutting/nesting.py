"""Nesting: every part of each material on as few sheets as an engine finds."""

from __future__ import annotations

import hashlib
import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from sbafab.cutting.bottom_left import ROUNDING, bottom_left, takes_lattices
from sbafab.cutting.nest import (
    TURNS,
    Nest,
    NestPart,
    Placement,
    Stock,
    no_usable_area,
    too_large,
    too_many,
)
from sbafab.laminate.films import Material, in_order

NESTED_BY = ("width", "length", "border", "spacing", "pins", "most", "roll", "turns")
"""Fields of a film sheet that affect the places of its parts."""
PLACES = "sheets/nest.json"
"""File of the placements in an output folder, which a later run takes over."""


def nest(
    parts: Sequence[NestPart],
    stocks: Mapping[Material, Stock],
) -> tuple[Nest, ...]:
    """Return one nest for each material that has parts, TPE first.

    Raises DesignError if a part does not fit a sheet or more sheets are needed than allowed.
    """
    nests = []
    for material in materials_of(parts):
        chosen = of_material(parts, material)
        nests.append(_nest(material, chosen, stocks[material]))
    return tuple(nests)


def refuse_unfit(parts: Sequence[NestPart], stocks: Mapping[Material, Stock]) -> None:
    """Raise DesignError if the sheets are too small or too few for any nest, without a search."""
    for material in materials_of(parts):
        _check_fit(material, of_material(parts, material), stocks[material])


def materials_of(parts: Sequence[NestPart]) -> list[Material]:
    """Return the materials that have parts, TPE first."""
    return in_order(part.material for part in parts if part.count > 0)


def of_material(parts: Sequence[NestPart], material: Material) -> tuple[NestPart, ...]:
    return tuple(part for part in parts if part.material == material and part.count > 0)


def _nest(
    material: Material,
    parts: tuple[NestPart, ...],
    stock: Stock,
) -> Nest:
    _check_fit(material, parts, stock)
    placements = bottom_left(parts, stock)
    result = Nest(material, stock, parts, placements)
    if result.sheets > stock.most:
        total = sum(part.count for part in parts)
        raise too_many(material, total, f"{result.sheets} sheets", stock)
    return result


def _check_fit(material: Material, parts: Sequence[NestPart], stock: Stock) -> None:
    min_x, min_y, max_x, max_y = stock.usable
    if max_x - min_x <= 0 or max_y - min_y <= 0:
        raise no_usable_area(material, stock)
    across, along = max_x - min_x + ROUNDING, max_y - min_y + ROUNDING
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
    """Return the number of sheets that the parts' bare areas fill, a lower bound for any nest."""
    min_x, min_y, max_x, max_y = stock.usable
    area = sum(part.count * part.region.area for part in parts)
    return math.ceil(area / ((max_x - min_x) * (max_y - min_y)) - 1e-9)


# Nests saved with the sheets, so that a second export has the same placements.


def as_dict(nests: Sequence[Nest]) -> dict[str, Any]:
    """Return the placements of all nests, for JSON, under a key of all their inputs."""
    return {
        "key": _key((nest.stock, nest.parts, nest.sheets) for nest in nests),
        "nests": {
            nest.material: [[p.part, p.sheet, p.turn, *p.shift] for p in nest.placements]
            for nest in nests
        },
    }


def from_dict(
    data: object, parts: Sequence[NestPart], stocks: Mapping[Material, Stock]
) -> tuple[Nest, ...] | None:
    """Return the saved nests if they were made of these parts and stocks; otherwise None.

    The placements are not checked here, but in ``check_nest``.
    """
    requests = [
        (material, stocks[material], of_material(parts, material))
        for material in materials_of(parts)
    ]
    if not isinstance(data, dict):
        return None
    try:
        nests = tuple(
            Nest(material, stock, chosen, _placements(data["nests"][material], chosen))
            for material, stock, chosen in requests
        )
        return nests if data["key"] == as_dict(nests)["key"] else None
    except (KeyError, TypeError, ValueError, IndexError):
        return None


def _key(nests: Iterable[tuple[Stock, Sequence[NestPart], int]]) -> str:
    """Return a hash of the nesting's inputs and of the methods tried: lattices and arrangements."""
    inputs = [
        (
            "bottom-left, lattices, pairs of lattices, arrangements"
            if takes_lattices(parts, stock, sheets)
            else "bottom-left",
            tuple(getattr(stock, key) for key in NESTED_BY),
            [(p.design, p.pattern, p.piece, p.material, p.region.key, p.count) for p in parts],
        )
        for stock, parts, sheets in nests
    ]
    return hashlib.sha256(repr(inputs).encode()).hexdigest()


def _placements(rows: object, parts: Sequence[NestPart]) -> tuple[Placement, ...]:
    """The placements of saved rows. Raises TypeError or ValueError if they are not of all parts."""
    if not isinstance(rows, list):
        raise TypeError
    placements = []
    for part, sheet, turn, x, y in rows:
        if not (type(part) is type(sheet) is int and sheet >= 0 and math.isfinite(x + y)):
            raise ValueError
        placements.append(Placement(part, sheet, TURNS[TURNS.index(turn)], (float(x), float(y))))
    if Counter(place.part for place in placements) != dict(enumerate(part.count for part in parts)):
        raise ValueError
    return tuple(placements)
