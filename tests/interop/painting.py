"""How much film the red and blue lines of a painted sheet enclose."""

from __future__ import annotations

import math
from typing import NamedTuple

import networkx
import numpy as np
from numpy.typing import NDArray
from PIL import Image

LINE = 0.3
"""Share of a pixel from which a line covers it; thinner lines would let the film run out."""
TINT = 48
"""Steps by which red or blue of a coloured line exceeds its other colours."""

Grid = NDArray[np.bool_]


class Painted(NamedTuple):
    """Lengths in mm, from the picture's lower left corner; areas in mm2."""

    film: float
    pieces: int
    holes: int
    bounds: tuple[float, float, float, float]
    """Of the middles of the red and blue lines: x and y of the lowest, of the highest."""


class _Run(NamedTuple):
    """The blank pixels of one row between two lines; ``left`` is what bounds them there."""

    start: int
    end: int
    left: str


def painted(picture: Image.Image, pixels_per_mm: float) -> Painted:
    """What a picture shows of a sheet: black, red and blue lines on white.

    A line is as wide inside its contour as outside, so half of its pixels are film.
    """
    pixels = np.asarray(picture.convert("RGB"), dtype=np.int16)
    red, green, blue = pixels[..., 0], pixels[..., 1], pixels[..., 2]
    line = green < 255 * (1 - LINE)
    is_red, is_blue = line & (red - blue > TINT), line & (blue - red > TINT)
    runs = _runs(line, is_red, is_blue)
    film, pieces, holes = 0, 0, 0
    for connected in _connected(runs, line.shape[1] + 1):
        # Left of the run that starts it is the line all round an area, not one inside it.
        left = runs[min(connected)].left
        pieces += left == "red"
        holes += left == "blue"
        if left == "red":
            film += sum(runs[index].end - runs[index].start for index in connected)
    coloured = is_red | is_blue
    area = film + np.count_nonzero(coloured) / 2 + _bends(coloured) * (holes - pieces)
    return Painted(area / pixels_per_mm**2, pieces, holes, _bounds(coloured, pixels_per_mm))


def _runs(line: Grid, is_red: Grid, is_blue: Grid) -> list[_Run]:
    """All runs, row by row from the top; places count on from row to row, one column more each."""
    height, width = line.shape
    blank = np.zeros((height, width + 1), dtype=np.int8)
    blank[:, :-1] = ~line
    steps = np.diff(blank.ravel(), prepend=0, append=0)
    starts, ends = np.flatnonzero(steps == 1), np.flatnonzero(steps == -1)
    rows, columns = np.divmod(starts, width + 1)
    before = np.maximum(columns - 1, 0)
    left = np.select([columns == 0, is_red[rows, before], is_blue[rows, before]], [0, 1, 2], 3)
    names = ("edge", "red", "blue", "black")
    return [
        _Run(int(start), int(end), names[colour])
        for start, end, colour in zip(starts, ends, left, strict=True)
    ]


def _connected(runs: list[_Run], row: int) -> list[set[int]]:
    """Runs that touch along a side, as sets of their indices."""
    starts = np.array([run.start for run in runs])
    ends = np.array([run.end for run in runs])
    first = np.searchsorted(ends, starts + row, "right")
    last = np.searchsorted(starts, ends + row, "left")
    graph = networkx.Graph()
    graph.add_nodes_from(range(len(runs)))
    for index, (low, high) in enumerate(zip(first.tolist(), last.tolist(), strict=True)):
        graph.add_edges_from((index, below) for below in range(low, high))
    return list(networkx.connected_components(graph))


def _bends(coloured: Grid) -> float:
    """Pixels that a line has less on the inner side of a closed contour than half of its own.

    A quarter of pi times the sides of pixels along a curve is its length, if it points all ways.
    """
    sides = np.count_nonzero(np.diff(coloured, axis=0)) + np.count_nonzero(
        np.diff(coloured, axis=1)
    )
    length = sides / 2 * math.pi / 4
    half_width = np.count_nonzero(coloured) / (2 * length)
    return math.pi * half_width**2


def _bounds(coloured: Grid, pixels_per_mm: float) -> tuple[float, float, float, float]:
    height = coloured.shape[0]
    columns = _middles(coloured.any(axis=0))
    rows = _middles(coloured.any(axis=1))
    low_x, high_x = columns
    low_y, high_y = height - rows[1], height - rows[0]
    return (
        low_x / pixels_per_mm,
        low_y / pixels_per_mm,
        high_x / pixels_per_mm,
        high_y / pixels_per_mm,
    )


def _middles(hit: NDArray[np.bool_]) -> tuple[float, float]:
    """First and last place that is hit; half a pixel is what a line's middle may be off."""
    places = np.flatnonzero(hit)
    return float(places[0]) + 0.5, float(places[-1]) + 0.5
