"""Index marks: the number of a part's pattern, engraved into the skeleton beside it.

A mark keeps 0.5 mm from every part (half the spacing, if that is less than 1 mm), so that the film
on its two sides adds up to the default spacing of parts. It stands nearer to its part than to any
other, and never in a hole. If the skeleton has no such room, the part gets no mark.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.cutting.lettering import Stroke, strokes, width
from sbafab.cutting.placements import Nest
from sbafab.geometry.edges import Point
from sbafab.geometry.region import Region

if TYPE_CHECKING:
    import shapely

HEIGHT = 1.2
"""mm of the digits."""
FARTHEST = 2.5
"""mm from a part to its mark."""
CLEARANCE = 0.5
"""mm from a mark to every part, at most."""
AROUND = 32
"""Places that are tried on each line round a part."""
GRID = 2
"""Decimals of a mark's place in mm: it hangs on no rounding of a library."""
CHORD = 0.005
"""mm by which the outlines that are searched round may lie inside their arcs."""


class IndexMark(NamedTuple):
    """The number of a pattern, its lower left corner, and its strokes."""

    text: str
    at: Point
    strokes: tuple[Stroke, ...]


def index_marks(nest: Nest, sheet: int) -> tuple[IndexMark, ...]:
    """Return the marks of a sheet's parts, at most one for each."""
    import shapely

    placed, stock = nest.on_sheet(sheet), nest.stock
    if not placed:
        return ()
    outlines = [Region(nest.region(placement).outers).shapely(CHORD) for placement in placed]
    tree = shapely.STRtree(outlines)
    clear, edge = clearance(stock.spacing) + CHORD, stock.border
    inside = shapely.box(edge, edge, stock.width - edge, nest.length(sheet) - edge)
    taken = [shapely.Point(x, y).buffer(d / 2) for x, y, d in stock.pins]
    marks = []
    for number, placement in enumerate(placed):
        pattern = nest.parts[placement.part].pattern
        # The number of a pattern, "5" of "P05".
        text = pattern.lstrip("P").lstrip("0") or pattern
        size = width(text, HEIGHT), HEIGHT
        corners = np.array([*_corners(outlines[number], size, clear)])
        boxes = shapely.box(*corners.T, *(corners + size).T)
        is_free = shapely.contains_properly(inside, boxes)
        is_free[tree.query(boxes, predicate="dwithin", distance=clear)[0]] = False
        away = np.round(shapely.distance(boxes, outlines[number]), GRID)
        near = np.flatnonzero(is_free & (away <= FARTHEST))
        for place in near[np.argsort(away[near], kind="stable")]:
            box = boxes[place]
            around = tree.query(box, predicate="dwithin", distance=away[place] + 0.1)
            if {*around} == {number} and not any(box.dwithin(mark, clear) for mark in taken):
                x, y = map(float, corners[place])
                taken.append(box)
                marks.append(IndexMark(text, (x, y), strokes(text, (x, y), HEIGHT)))
                break
    return tuple(marks)


def clearance(spacing: float) -> float:
    """Return the least distance of a mark from every part, mm."""
    return min(CLEARANCE, spacing / 2)


def _corners(outline: shapely.MultiPolygon, size: Point, clear: float) -> Iterator[Point]:
    """Yield lower left corners of boxes round a part, on lines that keep off it."""
    import shapely

    for off in (size[1] / 2, size[0] / 2, (size[0] ** 2 + size[1] ** 2) ** 0.5 / 2):
        ring = shapely.buffer(outline, clear + off + 0.02)
        exterior = ring.exterior if ring.geom_type == "Polygon" else ring.convex_hull.exterior
        for n in range(AROUND):
            p = exterior.interpolate(n / AROUND, normalized=True)
            yield round(p.x - size[0] / 2, GRID), round(p.y - size[1] / 2, GRID)
