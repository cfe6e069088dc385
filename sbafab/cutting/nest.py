"""Records of nesting: parts, film sheets, the placements in a nest, and its errors.

Lengths are mm, areas mm2. A sheet's lower left corner is its origin.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

from sbafab.design.films import Sheet
from sbafab.errors import DesignError, TooLargeError
from sbafab.geometry.edges import Bounds, Point, unit
from sbafab.geometry.region import Region
from sbafab.laminate.films import FIRST, Material
from sbafab.laminate.laminate import Laminate

Turn = Literal[0, 1, 2, 3]
"""Quarter turns, counterclockwise. Never mirrored: a film's faces differ by their cut."""
TURNS: tuple[Turn, ...] = (0, 1, 2, 3)


@dataclass(frozen=True)
class NestPart:
    """One piece that is to be cut ``count`` times.

    ``region`` is the path of the beam, kerf compensated, in the frame of its layer; ``design`` and
    ``pattern`` name its source, ``piece`` its number (from 1) if the pattern has several pieces.
    """

    design: str
    pattern: str
    piece: int
    material: Material
    region: Region
    count: int

    @property
    def name(self) -> str:
        return f"{self.pattern}.{self.piece}"


class Stock(Sheet):
    """Film to cut from, and the ``turns`` that parts may take on it: a path that is compensated for
    different kerfs along x and along y keeps its axes.
    """

    turns: tuple[Turn, ...] = TURNS

    @property
    def usable(self) -> Bounds:
        """The sheet without its border: least x, least y, largest x, largest y."""
        return self.border, self.border, self.width - self.border, self.length - self.border


@dataclass(frozen=True)
class Placement:
    """A part on a sheet: its region turned by ``turn`` about the origin, then moved by ``shift``.

    ``part`` is an index into the parts that were nested; sheets count from 0.
    """

    part: int
    sheet: int
    turn: Turn
    shift: Point


@dataclass(frozen=True)
class Nest:
    """The places of all parts of one material; ``placements`` have no order."""

    material: Material
    stock: Stock
    parts: tuple[NestPart, ...]
    placements: tuple[Placement, ...]

    @property
    def sheets(self) -> int:
        return 1 + max((placement.sheet for placement in self.placements), default=-1)

    def on_sheet(self, sheet: int) -> Sequence[Placement]:
        return [placement for placement in self.placements if placement.sheet == sheet]

    def length(self, sheet: int) -> float:
        """Return the sheet's length: a roll is cut off one border past the last part."""
        if not self.stock.roll:
            return self.stock.length
        tops = (self.region(placement).bounds[3] for placement in self.on_sheet(sheet))
        return max(tops) + self.stock.border

    def region(self, placement: Placement) -> Region:
        """Return the part's path at its place."""
        return self._regions[placement]

    @cached_property
    def _regions(self) -> dict[Placement, Region]:
        return {
            placement: placed(self.parts[placement.part].region, placement.turn, placement.shift)
            for placement in self.placements
        }


def placed(region: Region, turn: Turn, shift: Point) -> Region:
    """Return a region turned by exact quarter turns about the origin and then moved."""
    (c, s), (dx, dy) = unit(90.0 * turn), shift
    for contour in region.contours:
        # Computed here once instead of for every place.
        _ = contour.area, contour.length
    return region.mapped(lambda p: (p[0] * c - p[1] * s + dx, p[0] * s + p[1] * c + dy), 1.0, False)


# The parts to cut for a laminate.


def no_spares(needed: int) -> int:
    """Return zero spares, whatever number is needed."""
    return 0


def parts_of(
    laminate: Laminate,
    paths: Mapping[str, Region],
    copies: int,
    spares: Callable[[int], int] = no_spares,
) -> tuple[NestPart, ...]:
    """Return every piece of every pattern, by pattern in stacking order.

    ``paths`` holds each pattern's path of the beam, kerf compensated; ``spares`` returns
    the number of a pattern's spare pieces beyond the ``copies``. Pieces of one pattern that differ
    only in their place are one part, named after the first of them.
    """
    parts: list[NestPart] = []
    for pattern, layers in laminate.patterns.items():
        if laminate.cut_with(layers[0]) != layers[0].index:
            continue
        needed = len(layers) * copies
        layers_cut = needed + spares(needed)
        by_form: dict[Region, list[int]] = {}
        pieces = paths[pattern].pieces
        for number, piece in enumerate(pieces):
            low_x, low_y, _, _ = piece.bounds
            by_form.setdefault(piece.moved(-low_x, -low_y), []).append(number)
        for numbers in by_form.values():
            parts.append(
                NestPart(
                    design=laminate.name,
                    pattern=pattern,
                    piece=numbers[0] + 1,
                    material=layers[0].film.material,
                    region=pieces[numbers[0]],
                    count=len(numbers) * layers_cut,
                )
            )
    return tuple(parts)


# Errors that name the field of the design file.


def field(material: Material) -> str:
    """Return the section of a design file that describes this material's sheets."""
    name = material.lower()
    return f"sheets.{name}" if material in FIRST else f"films.{name}.sheet"


def no_usable_area(material: Material, stock: Stock) -> DesignError:
    where = field(material)
    return DesignError(
        f"{where}.border of {stock.border:g} mm leaves no usable area on a sheet of "
        f"{stock.width:g} x {stock.length:g} mm; it must be below "
        f"{min(stock.width, stock.length) / 2:g} mm."
    )


def too_large(part: NestPart, stock: Stock) -> TooLargeError:
    where = field(part.material)
    low_x, low_y, high_x, high_y = part.region.bounds
    min_x, min_y, max_x, max_y = stock.usable
    return TooLargeError(
        f"pattern {part.pattern} of {part.design} ({high_x - low_x:.1f} x {high_y - low_y:.1f} mm) "
        f"does not fit the usable {max_x - min_x:.1f} x {max_y - min_y:.1f} mm of {where}; enlarge "
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
