"""The usable area as a grid: shapes as cells, and which places of one shape would meet another.

Shapes are grown by half the spacing, so cells that are disjoint keep it. A place is the row and
column of the lower left cell of a form.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from sbafab.geometry.edges import Bounds, Point
from sbafab.geometry.offset import grow
from sbafab.geometry.region import Region
from sbafab.geometry.shapes import disc
from sbafab.nesting.raster import Cells, aligned, meetings, quarter_turned, raster
from sbafab.nesting.records import TURNS, Stock, Turn

CELL = 0.1
"""mm; the finest grid. It is coarser where the maps would outgrow ``MEMORY`` bytes."""
MEMORY = 120e6
ROUNDING = 5e-7
"""mm by which a part may lie past the border: less than what is checked."""


@dataclass(frozen=True)
class TurnedShape:
    """A shape in one of its turns.

    ``cells`` fill ``frame``, ``bounds`` are those of the shape itself; both mm, in the shape's
    own frame turned. ``number`` counts the forms of all shapes.
    """

    number: int
    shape: int
    turn: Turn
    cells: Cells = field(repr=False)
    frame: Bounds
    bounds: Bounds


@dataclass(frozen=True)
class Grid:
    """The forms of all shapes on the grid of one usable ``area``."""

    area: Bounds
    margin: float
    cell: float
    forms: tuple[TurnedShape, ...]
    _form_of: dict[tuple[int, Turn], TurnedShape] = field(repr=False)
    _clear: dict[tuple[int, int], Cells] = field(default_factory=dict, repr=False)

    @property
    def origin(self) -> Point:
        """The grid's corner; what is grown by the margin may reach past the border by it."""
        return self.area[0] - self.margin, self.area[1] - self.margin

    def clear(self, a: TurnedShape, b: TurnedShape) -> Cells:
        """Offsets of ``b`` from ``a`` that keep them apart, from one less than b's size below 0."""
        key = (a.number, b.number)
        if key not in self._clear:
            self._clear[key] = self._found(a, b)
        return self._clear[key]

    def _found(self, a: TurnedShape, b: TurnedShape) -> Cells:
        opposite = self._clear.get((b.number, a.number))
        if opposite is not None:
            return np.ascontiguousarray(opposite[::-1, ::-1])
        if a.turn == 0:
            # The other way round, turned until a lies as it is drawn.
            turned = self._form_of[a.shape, TURNS[-b.turn % len(TURNS)]]
            twin = self._clear.get((self._form_of[b.shape, 0].number, turned.number))
            if twin is not None:
                return np.ascontiguousarray(quarter_turned(twin, b.turn)[::-1, ::-1])
            return ~meetings(a.cells, b.cells)
        # What both are turned by turns the offsets with them.
        back = self._form_of[b.shape, TURNS[(b.turn - a.turn) % len(TURNS)]]
        return quarter_turned(self.clear(self._form_of[a.shape, 0], back), a.turn)

    def shift(self, form: TurnedShape, row: int, column: int) -> Point:
        """What moves the turned shape to a place, in mm."""
        x, y = self.origin
        return x + column * self.cell - form.frame[0], y + row * self.cell - form.frame[1]

    def places(self, form: TurnedShape, stock: Stock) -> Cells:
        """Where the form lies inside the border and clear of the pins."""
        x, y = self.shift(form, 0, 0)
        rows = self._count(self.area[3] - form.bounds[3] - y)
        columns = self._count(self.area[2] - form.bounds[2] - x)
        free = np.ones((rows, columns), dtype=np.bool_)
        for pin_x, pin_y, diameter in stock.pins:
            pin = disc((pin_x, pin_y), diameter / 2 + self.margin)
            cells, row, column = aligned(pin, self.origin, self.cell)
            strike(free, ~meetings(cells, form.cells), form, (row, column))
        return free

    def _count(self, room: float) -> int:
        return max(0, math.floor((room + ROUNDING) / self.cell) + 1)


def strike(free: Cells, clear: Cells, form: TurnedShape, place: tuple[int, int]) -> None:
    """Takes from a form's free places those that are not ``clear`` of what lies at ``place``."""
    row, column = (at - size + 1 for at, size in zip(place, form.cells.shape, strict=True))
    rows = slice(max(0, row), max(0, row + clear.shape[0]))
    columns = slice(max(0, column), max(0, column + clear.shape[1]))
    window = free[rows, columns]
    top, left = rows.start - row, columns.start - column
    window &= clear[top : top + window.shape[0], left : left + window.shape[1]]


def grid_of(shapes: Sequence[Region], area: Bounds, spacing: float, turns: Sequence[Turn]) -> Grid:
    """The grid for shapes, turned by ``turns``, that are to lie ``spacing`` apart in ``area``."""
    margin = spacing / 2
    cell = _cell_size(shapes, area, spacing, len(turns))
    grown = [grow(shape, margin) for shape in shapes]
    forms: list[TurnedShape] = []
    form_of: dict[tuple[int, Turn], TurnedShape] = {}
    for number, shape in enumerate(shapes):
        cells, frame = raster(grown[number], cell)
        seen: dict[tuple[tuple[int, ...], bytes], TurnedShape] = {}
        for turn in turns:
            turned = quarter_turned(cells, turn)
            mark = (turned.shape, turned.tobytes())
            # Only turns that differ on the grid.
            if mark not in seen:
                boxes = _turned(frame, turn), _turned(shape.bounds, turn)
                seen[mark] = TurnedShape(len(forms), number, turn, turned, *boxes)
                forms.append(seen[mark])
            form_of[number, turn] = seen[mark]
    return Grid(area, margin, cell, tuple(forms), form_of)


def _turned(box: Bounds, turn: Turn) -> Bounds:
    for _ in range(turn):
        low_x, low_y, high_x, high_y = box
        box = (-high_y, low_x, -low_y, high_x)
    return box


def _cell_size(shapes: Sequence[Region], area: Bounds, spacing: float, turns: int) -> float:
    """The cell at which the maps of free places and of meetings stay within ``MEMORY``."""
    sizes = [
        (high_x - low_x + spacing, high_y - low_y + spacing)
        for low_x, low_y, high_x, high_y in (shape.bounds for shape in shapes)
    ]
    maps = 2 * turns * len(shapes) * (area[2] - area[0]) * (area[3] - area[1])
    pairs = sum((max(a) + max(b)) ** 2 for a in sizes for b in sizes) * turns**2
    return CELL * max(1.0, math.sqrt((maps + pairs) / CELL**2 / MEMORY))
