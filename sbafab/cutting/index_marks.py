"""Index marks: the number of a part's pattern, engraved into the skeleton beside it.

A mark keeps 0.5 mm from every part (half the spacing, if that is less than 1 mm), so that the film
on its two sides adds up to the default spacing of parts. It stands nearer to its part than to any
other, and never in a hole. If the skeleton has no such room, the part gets no mark.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.cutting.lettering import Stroke, strokes, width
from sbafab.cutting.nest import Nest
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

    placed = nest.on_sheet(sheet)
    if not placed:
        return ()
    outlines = [Region(nest.region(placement).outers).shapely(CHORD) for placement in placed]
    tree = shapely.STRtree(outlines)
    clear = clearance(nest.stock.spacing) + CHORD
    edge, stock = nest.stock.border, nest.stock
    inside = shapely.box(edge, edge, stock.width - edge, nest.length(sheet) - edge)
    pins = [shapely.Point(x, y).buffer(d / 2 + clear) for x, y, d in stock.pins]
    taken: list[shapely.Polygon] = []
    marks = []
    for number, placement in enumerate(placed):
        text = _number(nest.parts[placement.part].pattern)
        size = width(text, HEIGHT), HEIGHT
        corners = np.array([*_corners(outlines[number], size, clear)])
        boxes = shapely.box(*corners.T, *(corners + size).T)
        near = tree.query(boxes, predicate="dwithin", distance=clear)[0]
        is_free = shapely.contains_properly(inside, boxes)
        is_free[near] = False
        for box_number in _by_distance(boxes, is_free, tree, outlines, number):
            box = boxes[box_number]
            if any(box.intersects(pin) for pin in pins):
                continue
            if any(box.dwithin(other, clear) for other in taken):
                continue
            x, y = map(float, corners[box_number])
            taken.append(box)
            marks.append(IndexMark(text, (x, y), strokes(text, (x, y), HEIGHT)))
            break
    return tuple(marks)


def clearance(spacing: float) -> float:
    """Return the least distance of a mark from every part, mm."""
    return min(CLEARANCE, spacing / 2)


def _number(pattern: str) -> str:
    """Return the number of a pattern, "5" of "P05"."""
    return pattern.lstrip("P").lstrip("0") or pattern


def _corners(outline: shapely.MultiPolygon, size: Point, clear: float) -> Iterator[Point]:
    """Yield lower left corners of boxes round a part, on two lines that keep off it."""
    import shapely

    for off in (size[1] / 2, size[0] / 2, (size[0] ** 2 + size[1] ** 2) ** 0.5 / 2):
        ring = shapely.buffer(outline, clear + off + 0.02)
        exterior = ring.exterior if ring.geom_type == "Polygon" else ring.convex_hull.exterior
        for n in range(AROUND):
            p = exterior.interpolate(n / AROUND, normalized=True)
            yield round(p.x - size[0] / 2, GRID), round(p.y - size[1] / 2, GRID)


def _by_distance(
    boxes: np.ndarray,
    is_free: np.ndarray,
    tree: shapely.STRtree,
    outlines: Sequence[shapely.MultiPolygon],
    number: int,
) -> list[int]:
    """Return the free boxes that are nearest to their own part and to no other, nearest first."""
    import shapely

    free = np.flatnonzero(is_free)
    if not len(free):
        return []
    away = shapely.distance(boxes[free], outlines[number])
    order = sorted(zip(np.round(away, GRID), free, strict=True))
    nearest = []
    for distance, box in order:
        if distance > FARTHEST:
            break
        around = tree.query(boxes[box], predicate="dwithin", distance=distance + 0.1)
        if set(map(int, around)) <= {number}:
            nearest.append(int(box))
    return nearest
