"""Strands: chains of edges as a drawing holds them, and the loops that their ends make.

All coordinates are mm.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from sbafab.errors import DesignError
from sbafab.geometry.edges import EPSILON, Edge, Line, Point, edge_from_bulge

Strand = tuple[Edge, ...]

JOIN = 0.001
"""Largest gap between joined ends, mm."""
MOST_EDGES = 500
"""Most edges of an outline."""
MOST_OF_ENTITY = 5000
"""Most edges of a whole drawing."""
FARTHEST = 10_000.0
"""No coordinate of a drawing may be larger, in mm."""


class Traced(NamedTuple):
    """Strands of a drawing in mm, and the size of its unit as text."""

    strands: Iterator[Strand]
    scale: str


def place(x: float, y: float) -> Point:
    """A point of a drawing. Raises DesignError unless it is finite and of a sensible size."""
    if not abs(x) <= FARTHEST or not abs(y) <= FARTHEST:
        raise DesignError(
            f"has a coordinate of x {x:g}, y {y:g} mm, where at most {FARTHEST:g} is allowed; "
            "check its units"
        )
    return float(x), float(y)


def nothing_on(layer: str, others: Sequence[str]) -> DesignError:
    """Return the error for an empty layer, with the names of ``others`` that are not."""
    hint = f"paths lie on {', '.join(others)}" if others else "no layer has any"
    return DesignError(f"has no paths on a layer {layer!r}; {hint}")


def counted(strands: Iterable[Strand], most: int = MOST_EDGES) -> Iterator[Strand]:
    """Yield the strands; raises DesignError once they have more than ``most`` edges."""
    total = 0
    for strand in strands:
        total += len(strand)
        refuse_more_than_limit(total, most)
        yield strand


def refuse_more_than_limit(edges: int, most: int = MOST_OF_ENTITY) -> None:
    if edges > most:
        raise DesignError(f"has more than {most} edges; draw the outline with fewer, longer curves")


def polyline(vertices: Sequence[tuple[float, float, float]], closed: bool) -> Strand:
    """Lines and arcs through vertices of x, y and bulge."""
    points = [(x, y) for x, y, _ in vertices]
    ends = [*points[1:], *points[:1]] if closed else points[1:]
    edges: list[Edge] = []
    for start, end, (_, _, bulge) in zip(points, ends, vertices, strict=False):
        if math.dist(start, end) > EPSILON:
            edges += _bulged(start, end, bulge)
    return tuple(edges)


def _bulged(start: Point, end: Point, bulge: float) -> list[Edge]:
    """One edge, or two where the arc turns by more than half a turn."""
    if abs(bulge) <= 1:
        return [edge_from_bulge(start, end, bulge)]
    half = math.tan(math.atan(bulge) / 2)
    # The apex stands off the chord's middle, to the right of an arc that runs counter-clockwise.
    apex = (
        (start[0] + end[0] + bulge * (end[1] - start[1])) / 2,
        (start[1] + end[1] - bulge * (end[0] - start[0])) / 2,
    )
    return [edge_from_bulge(start, apex, half), edge_from_bulge(apex, end, half)]


def reverse(strand: Strand) -> Strand:
    return tuple(edge.reversed() for edge in reversed(strand))


def is_closed(strand: Strand) -> bool:
    return _near(strand[0].start, strand[-1].end)


def joined(strands: Iterable[Strand]) -> tuple[list[Strand], list[Strand]]:
    """Closed loops, and the remaining open strands, after joining ends that meet."""
    whole = [strand for strand in strands if sum(edge.length for edge in strand) > JOIN]
    loops = [strand for strand in whole if is_closed(strand)]
    rest = [strand for strand in whole if not is_closed(strand)]
    opens: list[Strand] = []
    while rest:
        strand = _extended(rest.pop(0), rest)
        if not is_closed(strand):
            strand = _extended(reverse(strand), rest)
        (loops if is_closed(strand) else opens).append(strand)
    return loops, opens


def _extended(strand: Strand, rest: list[Strand]) -> Strand:
    """The strand extended by every continuing strand of ``rest``; these are removed from it."""
    while not is_closed(strand):
        for candidate in rest:
            if _near(strand[-1].end, candidate[0].start):
                follower = candidate
            elif _near(strand[-1].end, candidate[-1].end):
                follower = reverse(candidate)
            else:
                continue
            rest.remove(candidate)
            strand += follower
            break
        else:
            return strand
    return strand


def _near(a: Point, b: Point) -> bool:
    return math.dist(a, b) <= JOIN


def sealed(loop: Strand) -> Strand:
    """The loop with exactly matching ends and no edge shorter than JOIN."""
    edges: list[Edge] = []
    here = loop[-1].end
    for edge in loop:
        if edge.length > 2 * JOIN or not _near(here, edge.end):
            edges.append(_from(here, edge))
            here = edge.end
    if edges:
        edges[0] = _from(here, edges[0])
    return tuple(edges)


def _from(start: Point, edge: Edge) -> Edge:
    if edge.start == start:
        return edge
    if isinstance(edge, Line):
        return Line(start, edge.end)
    return edge_from_bulge(start, edge.end, edge.bulge)


def widest_gap(opens: Sequence[Strand]) -> tuple[float, Point]:
    """The least distance from the first strand's last end to another loose end, and that end."""
    here = opens[0][-1].end
    ends = [opens[0][0].start]
    ends += [end for strand in opens[1:] for end in (strand[0].start, strand[-1].end)]
    return min(math.dist(here, other_end) for other_end in ends), here
