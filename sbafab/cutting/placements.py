"""Records of nesting: parts, film sheets, and the placements in a nest.

Lengths are mm, areas mm2. A sheet's lower left corner is its origin.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

from sbafab.design.films import Sheet
from sbafab.geometry.edges import Bounds, Point, unit
from sbafab.geometry.region import Region
from sbafab.laminate.films import Material
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


def parts_of(
    laminate: Laminate,
    paths: Mapping[str, Region],
    copies: int,
    spares: Callable[[int], int] = lambda needed: 0,
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
        by_form: dict[Region, list[tuple[int, Region]]] = {}
        for number, piece in enumerate(paths[pattern].pieces, start=1):
            low_x, low_y, _, _ = piece.bounds
            by_form.setdefault(piece.moved(-low_x, -low_y), []).append((number, piece))
        for equal in by_form.values():
            (number, piece), count = equal[0], len(equal) * layers_cut
            material = layers[0].film.material
            parts.append(NestPart(laminate.name, pattern, number, material, piece, count))
    return tuple(parts)
