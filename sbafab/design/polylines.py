"""Polylines: the chains of lines and arcs that a drawing holds.

All coordinates are mm.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise

from sbafab.errors import DesignError
from sbafab.geometry.edges import EPSILON, Edge, Point, edge_from_bulge

Polyline = tuple[Edge, ...]

JOIN = 0.001
"""Largest gap between joined ends, mm."""
MOST_BYTES = 2_000_000
MOST_EDGES = 5000
"""Most edges of a whole drawing, or of one of its entities."""
FARTHEST = 10_000.0
"""No coordinate of a drawing may be larger, in mm."""


def place(x: float, y: float) -> Point:
    """Return a point of a drawing. Raises DesignError unless it is finite and within limits."""
    if not abs(x) <= FARTHEST or not abs(y) <= FARTHEST:
        raise DesignError(
            f"has a coordinate of x {x:g}, y {y:g} mm; the limit is {FARTHEST:g} mm; check its "
            "units"
        )
    # Adding 0 makes -0 a plain 0.
    return float(x) + 0.0, float(y) + 0.0


def nothing_on(layer: str, others: Iterable[str]) -> DesignError:
    """Return the error for an empty layer, with the names of ``others`` that have content."""
    names = ", ".join(sorted({*others}))
    hint = f"paths lie on {names}" if names else "no layer has any"
    return DesignError(f"has no paths on a layer {layer!r}; {hint}")


def counted(polylines: Iterable[Polyline], most: int) -> Iterator[Polyline]:
    """Yield the polylines; raises DesignError once they have more than ``most`` edges."""
    total = 0
    for chain in polylines:
        total += len(chain)
        refuse_more_than_limit(total, most)
        yield chain


def refuse_more_than_limit(edges: int, most: int = MOST_EDGES) -> None:
    if edges > most:
        raise DesignError(f"has more than {most} edges; draw the outline with fewer, longer curves")


def polyline(vertices: Sequence[tuple[float, float, float]], closed: bool) -> Polyline:
    """Return lines and arcs through vertices of x, y and bulge."""
    points = [(x, y) for x, y, _ in vertices]
    ends = [*points[1:], *points[:1]] if closed else points[1:]
    edges: list[Edge] = []
    for start, end, (_, _, bulge) in zip(points, ends, vertices, strict=False):
        if math.dist(start, end) <= EPSILON:
            continue
        stops, part = [start, end], bulge
        if abs(bulge) > 1:
            # More than half a turn, so two arcs: the apex stands off the chord's middle, to the
            # right of an arc that runs counter-clockwise.
            (x, y), (u, v) = start, end
            stops[1:1] = [((x + u + bulge * (v - y)) / 2, (y + v - bulge * (u - x)) / 2)]
            part = math.tan(math.atan(bulge) / 2)
        edges += [edge_from_bulge(a, b, part) for a, b in pairwise(stops)]
    return tuple(edges)


def is_closed(chain: Polyline) -> bool:
    return math.dist(chain[0].start, chain[-1].end) <= JOIN
