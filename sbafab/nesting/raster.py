"""Regions as sets of square cells, and where one set of cells would meet another.

Every cell that a region reaches into by more than ``TOUCH`` is set, so parts whose cells are
disjoint are disjoint themselves. Rows count upward (y), columns to the right (x).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sbafab.geometry.edges import Arc, Bounds, Edge, Point
from sbafab.geometry.facets import ticks
from sbafab.geometry.region import Region

Cells = NDArray[np.bool_]
Counts = NDArray[np.intp]
Numbers = NDArray[np.float64]

AT_ONCE = 1_000_000
"""Pairs of runs that are looked at together, which bounds the memory."""
TOUCH = 1e-7
"""mm by which a region may reach into a cell that is not set: regions side by side may touch."""


class Raster(NamedTuple):
    """``cells`` of a region and the box in mm, in the region's frame, that they fill."""

    cells: Cells
    frame: Bounds


def raster(region: Region, cell: float) -> Raster:
    """The cells of a region, which lies in the middle of their box: turns of it agree."""
    low_x, low_y, high_x, high_y = region.bounds
    columns, left = _centred(low_x, high_x, cell)
    rows, bottom = _centred(low_y, high_y, cell)
    cells = reached(region, (left, bottom), (rows, columns), cell)
    return Raster(cells, (left, bottom, left + columns * cell, bottom + rows * cell))


def aligned(region: Region, origin: Point, cell: float) -> tuple[Cells, int, int]:
    """The cells of a region on the grid through ``origin``; row and column of the first."""
    low_x, low_y, high_x, high_y = region.bounds
    first_column, last_column = _span(low_x - origin[0], high_x - origin[0], cell)
    first_row, last_row = _span(low_y - origin[1], high_y - origin[1], cell)
    corner = (origin[0] + first_column * cell, origin[1] + first_row * cell)
    shape = (last_row - first_row + 1, last_column - first_column + 1)
    return reached(region, corner, shape, cell), first_row, first_column


def reached(region: Region, corner: Point, shape: tuple[int, int], cell: float) -> Cells:
    """The cells a region reaches into, of a grid whose lower left is ``corner``."""
    rows, columns = shape
    edge_counts = np.zeros((rows + 1, columns), dtype=np.int32)
    turns = np.zeros((rows + 1, columns), dtype=np.int32)
    for edge in region.edges:
        for piece in _monotone(edge):
            _add_boundary(edge_counts, piece, corner, cell)
            _add_winding(turns, piece, corner, cell)
    return np.asarray(
        (np.cumsum(edge_counts[:-1], axis=0) > 0) | (np.cumsum(turns[:-1], axis=0) > 0)
    )


def meetings(a: Cells, b: Cells) -> Cells:
    """Offsets at which the cells of ``b`` meet those of ``a``.

    Entry (0, 0) is where b's upper right cell lies on a's lower left one; the last, the reverse.
    """
    rows, columns = (m + n - 1 for m, n in zip(a.shape, b.shape, strict=True))
    a_row, a_first, a_end = _runs(a)
    b_row, b_first, b_end = _runs(b)
    width = columns + 1
    counts = np.zeros(rows * width, dtype=np.int64)
    # Where two runs of cells meet: from the offset at which they begin to, to that where they end.
    for some in np.array_split(np.arange(len(a_row)), 1 + len(a_row) * len(b_row) // AT_ONCE):
        line = (a_row[some, None] - b_row + b.shape[0] - 1) * width + b.shape[1]
        counts += np.bincount((line + a_first[some, None] - b_end).ravel(), minlength=counts.size)
        ends = line + a_end[some, None] - b_first - 1
        counts -= np.bincount(ends.ravel(), minlength=counts.size)
    return np.asarray(counts.reshape(rows, width).cumsum(axis=1)[:, :-1] > 0)


def _runs(cells: Cells) -> tuple[Counts, Counts, Counts]:
    """Row, first column and the column past the last of all runs of set cells in a row."""
    steps = np.diff(cells.astype(np.int8), axis=1, prepend=0, append=0)
    row, first = np.nonzero(steps > 0)
    return row, first, np.nonzero(steps < 0)[1]


def quarter_turned(cells: Cells, turns: int) -> Cells:
    """The cells turned counterclockwise; rows count upward, so against numpy's own sense."""
    return np.ascontiguousarray(np.rot90(cells, -turns))


def _centred(low: float, high: float, cell: float) -> tuple[int, float]:
    count = max(1, math.ceil((high - low - 2 * TOUCH) / cell))
    return count, (low + high - count * cell) / 2


def _span(low: float, high: float, cell: float) -> tuple[int, int]:
    """First and last cell that an interval reaches into; first > last where it lies on a limit."""
    return math.floor((low + TOUCH) / cell), math.ceil((high - TOUCH) / cell) - 1


def _monotone(edge: Edge) -> list[Edge]:
    """The edge cut where it turns back in x or in y."""
    if not isinstance(edge, Arc):
        return [edge]
    corners = [edge.start, *map(edge.on_circle, ticks([edge], math.pi / 2, 1e-9)), edge.end]
    return [edge.part(a, b) for a, b in zip(corners, corners[1:], strict=False)]


def _heights(edge: Edge, x: Numbers) -> Numbers:
    """Y of a monotone edge at each x, kept within its ends."""
    (x0, y0), (x1, y1) = edge.start, edge.end
    if isinstance(edge, Arc):
        (cx, cy), middle = edge.centre, edge.at(0.5)
        rise = np.sqrt(np.maximum(0.0, edge.radius**2 - (x - cx) ** 2))
        y = cy + rise if middle[1] > cy else cy - rise
    elif abs(x1 - x0) < TOUCH:
        y = np.full_like(x, y0)
    else:
        y = y0 + (x - x0) * ((y1 - y0) / (x1 - x0))
    return np.clip(y, min(y0, y1), max(y0, y1))


def _add_boundary(counts: NDArray[np.int32], edge: Edge, corner: Point, cell: float) -> None:
    """Adds the edge to every cell it runs through, as steps to be summed along y."""
    (x0, y0), (x1, y1) = edge.start, edge.end
    rows, columns = counts.shape[0] - 1, counts.shape[1]
    left, right = sorted((x0, x1))
    first, last = _span(left - corner[0], right - corner[0], cell)
    first, last = max(0, first), min(columns - 1, last)
    if last < first:
        return
    limits = corner[0] + cell * np.arange(first, last + 2)
    y = _heights(edge, np.clip(limits, left, right))
    low, high = np.minimum(y[:-1], y[1:]), np.maximum(y[:-1], y[1:])
    if right - left < TOUCH:
        low, high = np.minimum(low, min(y0, y1)), np.maximum(high, max(y0, y1))
    bottom = np.floor((low - corner[1] + TOUCH) / cell).astype(np.int64)
    top = np.ceil((high - corner[1] - TOUCH) / cell).astype(np.int64)
    bottom, top = np.clip(bottom, 0, rows), np.clip(top, 0, rows)
    there = np.flatnonzero(top > bottom)
    counts[bottom[there], first + there] += 1
    counts[top[there], first + there] -= 1


def _add_winding(turns: NDArray[np.int32], edge: Edge, corner: Point, cell: float) -> None:
    """Adds, from the edge upward, its turn round the centres of the cells."""
    x0, x1 = edge.start[0], edge.end[0]
    rows, columns = turns.shape[0] - 1, turns.shape[1]
    # Half open, so that a corner on a column's middle counts once.
    first = math.ceil((min(x0, x1) - corner[0]) / cell - 0.5)
    last = math.ceil((max(x0, x1) - corner[0]) / cell - 0.5) - 1
    first, last = max(0, first), min(columns - 1, last)
    if last < first:
        return
    column = np.arange(first, last + 1)
    y = _heights(edge, corner[0] + cell * (column + 0.5))
    row = np.clip(np.ceil((y - corner[1]) / cell - 0.5).astype(np.int64), 0, rows)
    turns[row, column] += 1 if x1 > x0 else -1
