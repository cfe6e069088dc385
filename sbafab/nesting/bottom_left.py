"""The default engine: each part goes to the lowest free place of a fine grid, in fixed orders.

Several ways to fill the sheets are tried and the best kept; nothing is drawn at random. Holes of
parts are free for smaller parts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sbafab.geometry.edges import Point
from sbafab.geometry.region import Region
from sbafab.nesting.grid import ROUNDING, Grid, TurnedShape, grid_of, strike
from sbafab.nesting.raster import Cells
from sbafab.nesting.records import NestPart, Placement, Stock, placed
from sbafab.nesting.refusals import no_place

MANY = 600
"""Parts from which on only the first few ways to fill a sheet are tried."""


def bottom_left(parts: Sequence[NestPart], stock: Stock) -> tuple[Placement, ...]:
    """Places for every part; each must fit the usable area.

    Raises DesignError where the pins leave no place for one.
    """
    shapes, shape_of = _shapes(parts)
    left, bottom, right, top = stock.usable
    window = min(top - bottom, _length_needed(parts, stock))
    while True:
        grid = grid_of(shapes, (left, bottom, right, bottom + window), stock.spacing, stock.turns)
        filler = _Filler(tuple(parts), tuple(shape_of), stock, grid)
        best = min((filler.filled(way) for way in _ways(parts)), key=_score)
        if window >= top - bottom or (best.stuck is None and best.sheets == 1):
            break
        window = min(top - bottom, 2 * window)
    if best.stuck is not None:
        raise no_place(parts[best.stuck], stock)
    return best.placements


@dataclass(frozen=True)
class _Way:
    """How to fill: the order of the parts, and the share of a part's height that counts as low."""

    order: tuple[int, ...]
    share: float


@dataclass(frozen=True)
class _Filled:
    """``reach`` is the last sheet's highest y; ``stuck`` the part that found no place at all."""

    placements: tuple[Placement, ...]
    sheets: int
    reach: float
    stuck: int | None = None


def _score(filled: _Filled) -> tuple[bool, int, float]:
    """Fewest sheets, then least of the last one's length; of equal ones the first stays."""
    return filled.stuck is not None, filled.sheets, round(filled.reach, 3)


def _size(part: NestPart) -> tuple[float, float]:
    low_x, low_y, high_x, high_y = part.region.bounds
    return high_x - low_x, high_y - low_y


def _ways(parts: Sequence[NestPart]) -> list[_Way]:
    """Large parts first, and the same by longest side: small ones find room between them."""
    orders = []
    for measure in (math.prod, max):
        sizes = [-round(measure(_size(part)), 6) for part in parts]
        orders.append(tuple(sorted(range(len(parts)), key=sizes.__getitem__)))
    ways = [_Way(order, share) for order in dict.fromkeys(orders) for share in (0.5, 0.0, 1.0)]
    return ways if sum(part.count for part in parts) < MANY else ways[:2]


def _length_needed(parts: Sequence[NestPart], stock: Stock) -> float:
    """A length that most likely holds all parts, to keep the maps of long rolls small."""
    area, longest = 0.0, 0.0
    for part in parts:
        width, height = (size + stock.spacing for size in _size(part))
        area += part.count * width * height
        longest = max(longest, width, height)
    left, _, right, _ = stock.usable
    pins = sum((diameter + 2 * stock.spacing) ** 2 for _, _, diameter in stock.pins)
    return 1.3 * (area + pins) / (right - left) + 2 * longest


def _shapes(parts: Sequence[NestPart]) -> tuple[list[Region], list[int]]:
    """The different outlines, and each part's.

    Holes count as full: they are cut before all outlines, and what lay in one would drop out.
    """
    known: dict[Region, int] = {}
    shape_of = []
    for part in parts:
        shape_of.append(known.setdefault(Region(part.region.outers), len(known)))
    return list(known), shape_of


class _Filler:
    """Fills sheets of one grid, in one way or another."""

    def __init__(
        self, parts: tuple[NestPart, ...], shape_of: tuple[int, ...], stock: Stock, grid: Grid
    ) -> None:
        self.parts, self.shape_of, self.stock, self.grid = parts, shape_of, stock, grid
        self.empty = [grid.places(form, stock) for form in grid.forms]
        self.forms = [[form for form in grid.forms if form.shape == shape] for shape in shape_of]

    def filled(self, way: _Way) -> _Filled:
        """Sheet after sheet: what of the remaining parts finds a place, in the way's order."""
        left = [part.count for part in self.parts]
        done: list[Placement] = []
        sheet = 0
        while any(left):
            on_sheet = self._sheet(sheet, left, way) or self._alone(sheet, left, way.order)
            if not on_sheet:
                stuck = next(part for part in way.order if left[part])
                return _Filled((), sheet, math.inf, stuck)
            for placement in on_sheet:
                left[placement.part] -= 1
            done += on_sheet
            sheet += 1
        return _Filled(tuple(done), sheet, self._reach(on_sheet))

    def _sheet(self, sheet: int, left: Sequence[int], way: _Way) -> list[Placement]:
        free = _Free(self.grid, [np.copy(places) for places in self.empty], way.share)
        found: list[Placement] = []
        for step, part in enumerate(way.order):
            for number in range(left[part]):
                spot = free.lowest(self.forms[part])
                if spot is None:
                    break
                form, row, column = spot
                shift = self.grid.shift(form, row, column)
                found.append(Placement(part, sheet, form.turn, shift))
                rest = way.order[step + (number + 1 == left[part]) :]
                open_shapes = {self.shape_of[other] for other in rest if left[other]}
                free.occupy(form, (row, column), open_shapes)
        return found

    def _alone(self, sheet: int, left: Sequence[int], order: Sequence[int]) -> list[Placement]:
        """The next part in the corner of an empty sheet: the grid is too coarse for a tight fit."""
        if self.stock.pins:
            return []
        part = next(part for part in order if left[part])
        low_x, low_y, high_x, high_y = self.stock.usable
        for turn in self.stock.turns:
            bounds = placed(self.parts[part].region, turn, (0.0, 0.0)).bounds
            shift: Point = (low_x - bounds[0], low_y - bounds[1])
            if max(bounds[2] + shift[0] - high_x, bounds[3] + shift[1] - high_y) <= ROUNDING:
                return [Placement(part, sheet, turn, shift)]
        return []

    def _reach(self, placements: Sequence[Placement]) -> float:
        tops = {
            (part, form.turn): form.bounds[3]
            for part, forms in enumerate(self.forms)
            for form in forms
        }
        return max(
            tops.get((placement.part, placement.turn), math.inf) + placement.shift[1]
            for placement in placements
        )


class _Free:
    """The places of every form that are free on one sheet, and where to look for the lowest."""

    def __init__(self, grid: Grid, maps: list[Cells], share: float) -> None:
        self.grid, self.maps, self.share = grid, maps, share
        self.searched = [0] * len(maps)

    def lowest(self, forms: Sequence[TurnedShape]) -> tuple[TurnedShape, int, int] | None:
        """The form that lies lowest, by the share of its height that counts; row and column."""
        spots = []
        for form in forms:
            place = self._first(form.number)
            if place is not None:
                low = place[0] + self.share * form.cells.shape[0]
                spots.append((low, place[1], form.number, place[0]))
        if not spots:
            return None
        _, column, number, row = min(spots)
        return self.grid.forms[number], row, column

    def _first(self, number: int) -> tuple[int, int] | None:
        """Row and column of the lowest free place, the leftmost of its row."""
        places = self.maps[number].reshape(-1)
        # Places are only ever taken, so what was searched once need not be again.
        start = self.searched[number]
        if start < places.size:
            start += int(np.argmax(places[start:]))
            self.searched[number] = start if places[start] else places.size
        if self.searched[number] == places.size:
            return None
        columns: int = self.maps[number].shape[1]
        return divmod(start, columns)

    def occupy(self, form: TurnedShape, place: tuple[int, int], shapes: set[int]) -> None:
        """Takes what a form at ``place`` makes impossible from the maps of these shapes."""
        for other in self.grid.forms:
            if other.shape in shapes and self.searched[other.number] < self.maps[other.number].size:
                strike(self.maps[other.number], self.grid.clear(form, other), other, place)
