"""What the entities of a cut file draw, from their numbers: contours and edges, exact."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from sbafab.errors import OutputError
from sbafab.geometry.edges import Edge, Line, Point, edge_from_bulge, quarter_arcs
from sbafab.geometry.region import Contour

QUARTER = math.tan(math.pi / 8)
"""The bulge of a quarter turn."""


class DrawnEntity(NamedTuple):
    """What one entity draws on a layer: the closed contour, or else the loose edges."""

    kind: str
    layer: str
    contour: Contour | None
    edges: Sequence[Edge]


def of_polyline(kind: str, layer: str, edges: Sequence[Edge], closed: bool) -> DrawnEntity:
    """What a polyline of these edges draws."""
    if closed:
        return DrawnEntity(kind, layer, Contour(tuple(edges)), ())
    return DrawnEntity(kind, layer, None, edges)


def arc(centre: Point, radius: float, first_degrees: float, last_degrees: float) -> list[Edge]:
    """An ARC, counter-clockwise from one angle to the other, in quarters."""
    first = math.radians(first_degrees)
    sweep = math.radians((last_degrees - first_degrees) % 360.0)
    start, end = (
        (centre[0] + radius * math.cos(angle), centre[1] + radius * math.sin(angle))
        for angle in (first, first + sweep)
    )
    return quarter_arcs(start, end, centre, radius, sweep)


def polyline(
    rows: Sequence[tuple[float, ...]], closed: bool, width: float, may_be_open: bool
) -> list[Edge]:
    """The edges of a polyline's rows: x, y, start and end width, bulge."""
    x, y = rows[0][:2] if rows else (0.0, 0.0)
    place = f"polyline at x {x:.3f}, y {y:.3f}"
    if len(rows) < 2 or not (closed or may_be_open):
        raise OutputError(f"{place} is open; close it.")
    if width or any(row[2] or row[3] for row in rows):
        raise OutputError(f"{place} has a width; draw the cut's middle without width.")
    edges: list[Edge] = []
    followers = [*rows[1:], rows[0]] if closed else rows[1:]
    for row, following in zip(rows, followers, strict=False):
        start, end = (row[0], row[1]), (following[0], following[1])
        if start == end:
            raise OutputError(
                f"{place} repeats its vertex x {row[0]:.3f}, y {row[1]:.3f}; remove one."
            )
        edges += _bulge_edges(start, end, row[4])
    return edges


def _bulge_edges(start: Point, end: Point, bulge: float) -> list[Edge]:
    """What a polyline draws from a vertex to the next; arcs may turn more than half round."""
    edge = edge_from_bulge(start, end, bulge)
    if isinstance(edge, Line) or abs(bulge) <= QUARTER:
        return [edge]
    return quarter_arcs(start, end, edge.centre, edge.radius, 4 * math.atan(bulge))
