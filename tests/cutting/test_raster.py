"""Cells of regions, judged by shapely and by counting."""

from __future__ import annotations

import numpy as np
import pytest
from shapely.geometry import Polygon, box

from sbafab.cutting.bottom_left import meetings, quarter_turned, raster
from sbafab.geometry.region import Region, disc, polygon, rectangle, stadium

SHAPES = {
    "disc": disc((0.3, -0.2), 2.0),
    "ring": disc((0.0, 0.0), 3.0) - disc((0.1, 0.2), 1.7),
    "triangle": polygon([(0.0, 0.0), (4.1, 0.7), (1.3, 3.9)]),
    "bent": rectangle((0.0, 0.0), (4.0, 1.0)) | stadium((0.5, 2.0), 1.0, 4.0),
}


def shapely_of(region: Region) -> Polygon:
    rings = region.polygons(1e-5)[0]
    return Polygon(rings[0], rings[1:])


@pytest.mark.parametrize("name", SHAPES)
def test_a_cell_is_set_where_shapely_finds_the_region_in_it(name: str) -> None:
    region, cell = SHAPES[name], 0.25
    cells, (low_x, bottom, _, _) = raster(region, cell)
    judge = shapely_of(region)
    for row, column in np.ndindex(cells.shape):
        x, y = low_x + column * cell, bottom + row * cell
        shared = judge.intersection(box(x, y, x + cell, y + cell)).area
        if shared > 1e-4:
            assert cells[row, column], (row, column)
        if judge.distance(box(x, y, x + cell, y + cell)) > 1e-4:
            assert not cells[row, column], (row, column)


def test_turned_cells_are_those_of_the_turned_region() -> None:
    region = SHAPES["triangle"]
    base = raster(region, 0.2).cells
    for turns in range(4):
        expected = raster(region.turned(90.0 * turns), 0.2).cells
        assert np.array_equal(quarter_turned(base, turns), expected)


def test_a_disc_is_the_same_in_every_turn() -> None:
    cells = raster(disc((1.234, -0.77), 3.217), 0.1).cells
    assert all(np.array_equal(quarter_turned(cells, turns), cells) for turns in (1, 2, 3))


def test_meetings_are_what_trying_every_offset_finds() -> None:
    a = raster(SHAPES["bent"], 0.5).cells
    b = raster(SHAPES["triangle"], 0.5).cells
    result = meetings(a, b)
    rows, columns = b.shape
    assert result.shape == (a.shape[0] + rows - 1, a.shape[1] + columns - 1)
    padded = np.pad(a, ((rows - 1, rows - 1), (columns - 1, columns - 1)))
    for row, column in np.ndindex(result.shape):
        expected = bool((padded[row : row + rows, column : column + columns] & b).any())
        assert result[row, column] == expected
