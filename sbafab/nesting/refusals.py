"""What a nest refuses to do, in sentences that name the field of the design file."""

from __future__ import annotations

from sbafab.errors import DesignError, TooLargeError
from sbafab.laminate.films import FIRST, Material
from sbafab.nesting.records import NestPart, Stock


def field(material: Material) -> str:
    """The section of a design file that describes this material's sheets."""
    name = material.lower()
    return f"sheets.{name}" if material in FIRST else f"films.{name}.sheet"


def no_usable_area(material: Material, stock: Stock) -> DesignError:
    where = field(material)
    return DesignError(
        f"{where}.border of {stock.border:g} mm leaves nothing of a sheet of {stock.width:g} x "
        f"{stock.length:g} mm; it must be below {min(stock.width, stock.length) / 2:g} mm."
    )


def too_large(part: NestPart, stock: Stock) -> TooLargeError:
    where = field(part.material)
    low_x, low_y, high_x, high_y = part.region.bounds
    left, bottom, right, top = stock.usable
    return TooLargeError(
        f"pattern {part.pattern} of {part.design} ({high_x - low_x:.1f} x {high_y - low_y:.1f} mm) "
        f"does not fit the usable {right - left:.1f} x {top - bottom:.1f} mm of {where}; enlarge "
        f"{where}.width or length, or lower its border of {stock.border:g} mm."
    )


def no_place(part: NestPart, stock: Stock) -> DesignError:
    where = field(part.material)
    return DesignError(
        f"pattern {part.pattern} of {part.design} finds no place {stock.spacing:g} mm clear of the "
        f"{len(stock.pins)} {where}.pins; lower {where}.spacing, move the pins, or enlarge the "
        "sheet."
    )


def too_many(material: Material, parts: int, needed: str, stock: Stock) -> DesignError:
    where = field(material)
    return DesignError(
        f"{parts} parts of {material} need {needed} of {stock.width:g} x {stock.length:g} mm, "
        f"{where}.most allows {stock.most}; raise it, order fewer copies, or enlarge the sheets."
    )


def pins_unknown(material: Material, stock: Stock) -> DesignError:
    where = field(material)
    return DesignError(
        f'engine "spyrrow" cannot keep clear of the {len(stock.pins)} {where}.pins; use '
        '"bottom-left", or take the pins out.'
    )


def too_tight(part: NestPart) -> DesignError:
    where = field(part.material)
    return DesignError(
        f"pattern {part.pattern} of {part.design} fits {where} too tightly for engine "
        f'"spyrrow"; use "bottom-left", or lower {where}.border by 0.1 mm.'
    )
