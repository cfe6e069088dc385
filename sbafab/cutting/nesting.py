"""Nesting: every part of each material on as few sheets as possible."""

from __future__ import annotations

import hashlib
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from sbafab.cutting.bottom_left import ROUNDING, bottom_left, sheet_section, takes_lattices
from sbafab.cutting.placements import TURNS, Nest, NestPart, Placement, Stock
from sbafab.errors import DesignError, TooLargeError
from sbafab.laminate.films import Material, in_order

NESTED_BY = ("width", "length", "border", "spacing", "pins", "most", "roll", "turns")
"""Fields of a film sheet that affect the places of its parts."""
PLACES = "sheets/nest.json"
"""File of the placements in an output folder, which a later run takes over."""


def nest(parts: Sequence[NestPart], stocks: Mapping[Material, Stock]) -> tuple[Nest, ...]:
    """Return one nest for each material that has parts, TPE first.

    Raises DesignError if a part does not fit a sheet or more sheets are needed than allowed.
    """
    refuse_unfit(parts, stocks)
    nests = []
    for material in materials_of(parts):
        chosen, stock = of_material(parts, material), stocks[material]
        result = Nest(material, stock, chosen, bottom_left(chosen, stock))
        if result.sheets > stock.most:
            raise _too_many(material, chosen, f"{result.sheets} sheets", stock)
        nests.append(result)
    return tuple(nests)


def materials_of(parts: Sequence[NestPart]) -> list[Material]:
    """Return the materials that have parts, TPE first."""
    return in_order(part.material for part in parts if part.count > 0)


def of_material(parts: Sequence[NestPart], material: Material) -> tuple[NestPart, ...]:
    return tuple(part for part in parts if part.material == material and part.count > 0)


def refuse_unfit(parts: Sequence[NestPart], stocks: Mapping[Material, Stock]) -> None:
    """Raise DesignError if the sheets are too small or too few for any nest, without a search."""
    for material in materials_of(parts):
        chosen, stock = of_material(parts, material), stocks[material]
        where = sheet_section(material)
        width, length = stock.usable[2] - stock.usable[0], stock.usable[3] - stock.usable[1]
        if min(width, length) <= 0:
            raise DesignError(
                f"{where}.border of {stock.border:g} mm leaves no usable area on a sheet of "
                f"{stock.width:g} x {stock.length:g} mm; it must be below "
                f"{min(stock.width, stock.length) / 2:g} mm."
            )
        for part in chosen:
            low_x, low_y, high_x, high_y = part.region.bounds
            size = high_x - low_x, high_y - low_y
            ways = (size, size[::-1]) if 1 in stock.turns else (size,)
            if not any(x <= width + ROUNDING and y <= length + ROUNDING for x, y in ways):
                raise TooLargeError(
                    f"pattern {part.pattern} of {part.design} ({size[0]:.1f} x {size[1]:.1f} mm) "
                    f"does not fit the usable {width:.1f} x {length:.1f} mm of {where}; enlarge "
                    f"{where}.width or length, or lower its border of {stock.border:g} mm."
                )
        # The sheets that the parts' bare areas fill: a lower bound for any nest.
        area = sum(part.count * part.region.area for part in chosen)
        least = math.ceil(area / (width * length) - 1e-9)
        if least > stock.most:
            raise _too_many(material, chosen, f"at least {least} sheets", stock)


def _too_many(
    material: Material, parts: Sequence[NestPart], needed: str, stock: Stock
) -> DesignError:
    total, where = sum(part.count for part in parts), sheet_section(material)
    return DesignError(
        f"{total} parts of {material} need {needed} of {stock.width:g} x {stock.length:g} mm, "
        f"{where}.most allows {stock.most}; raise it, order fewer copies, or enlarge the sheets."
    )


# Nests saved with the sheets, so that a second export has the same placements.


def as_dict(nests: Sequence[Nest]) -> dict[str, Any]:
    """Return the placements of all nests, for JSON, under a key of all their inputs."""
    return {
        "key": _key(nests),
        "nests": {
            nest.material: [[p.part, p.sheet, p.turn, *p.shift] for p in nest.placements]
            for nest in nests
        },
    }


def from_dict(
    data: Any, parts: Sequence[NestPart], stocks: Mapping[Material, Stock]
) -> tuple[Nest, ...] | None:
    """Return the saved nests if their parts and stocks match; otherwise None.

    ``check_nest`` checks the placements.
    """
    nests = []
    try:
        for material in materials_of(parts):
            chosen = of_material(parts, material)
            placements = tuple(_placement(*row) for row in data["nests"][material])
            counts = Counter(place.part for place in placements)
            if counts != dict(enumerate(part.count for part in chosen)):
                return None
            nests.append(Nest(material, stocks[material], chosen, placements))
        return tuple(nests) if data["key"] == as_dict(nests)["key"] else None
    except (KeyError, TypeError, ValueError, IndexError):
        return None


def _placement(part: Any, sheet: Any, turn: Any, x: Any, y: Any) -> Placement:
    """Return the placement of a saved row. Raises TypeError or ValueError for an invalid row."""
    if not (type(part) is type(sheet) is int and sheet >= 0 and math.isfinite(x + y)):
        raise ValueError
    return Placement(part, sheet, TURNS[TURNS.index(turn)], (float(x), float(y)))


def _key(nests: Sequence[Nest]) -> str:
    """Return a hash of the nesting's inputs and methods: lattices and arrangements."""
    inputs = [
        (
            "bottom-left, lattices, pairs of lattices, arrangements"
            if takes_lattices(nest.parts, nest.stock, nest.sheets)
            else "bottom-left",
            tuple(getattr(nest.stock, key) for key in NESTED_BY),
            [(p.design, p.pattern, p.piece, p.material, p.region.key, p.count) for p in nest.parts],
        )
        for nest in nests
    ]
    return hashlib.sha256(repr(inputs).encode()).hexdigest()
