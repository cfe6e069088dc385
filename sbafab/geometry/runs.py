"""Edges of a closed chain gathered by the line or circle that they lie on."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

from sbafab.geometry.edges import EPSILON, Arc, Edge, Line

_Run = tuple[Edge, ...]
DRIFT: Final = 4 * EPSILON
"""mm that edges which follow each other along one line or circle may leave it by, together."""


def runs(edges: _Run) -> Iterator[_Run]:
    """The edges gathered by the line or circle they lie on, from the first corner on."""
    breaks = [i for i in range(len(edges)) if not same_support(edges[i - 1], edges[i])]
    if not breaks:
        yield from _parted(edges)
        return
    for first, last in zip(breaks, [*breaks[1:], breaks[0]], strict=True):
        yield from _parted(edges[first:last] if first < last else edges[first:] + edges[:last])


def same_support(a: Edge, b: Edge) -> bool:
    """Whether two edges lie on one circle, or are lines of one direction, and turn alike."""
    if isinstance(a, Arc) and isinstance(b, Arc):
        return (
            a.ccw == b.ccw
            and abs(a.radius - b.radius) < EPSILON
            and math.dist(a.centre, b.centre) < EPSILON
        )
    if isinstance(a, Line) and isinstance(b, Line):
        ux, uy = a.direction(a.start)
        vx, vy = b.direction(b.start)
        return ux * vx + uy * vy > 0 and abs(ux * vy - uy * vx) * (a.length + b.length) < EPSILON
    return False


def _parted(run: _Run) -> Iterator[_Run]:
    """The run, in parts that each keep to one line or circle.

    Edges may turn by so little from one to the next that each two look straight, and yet round a
    corner together.
    """
    if len(run) < 3:
        yield run
        return
    head, end = run[0], run[-1].end
    if isinstance(head, Arc):
        offs = [_off_circle(edge, head) for edge in run]
        place = next((i for i, off in enumerate(offs) if off > DRIFT), 0)
    else:
        # Of a closed run, what lies farthest from where it starts.
        chord = Line(head.start, end)
        offs = [
            math.dist(edge.start, end) if head.start == end else abs(chord.to_left(edge.start))
            for edge in run
        ]
        farthest = max(range(len(run)), key=offs.__getitem__)
        place = farthest if offs[farthest] > DRIFT else 0
    if not place:
        yield run
        return
    yield from _parted(run[:place])
    yield from _parted(run[place:])


def _off_circle(edge: Edge, head: Arc) -> float:
    """How far an arc's circle is another than the first one's."""
    if not isinstance(edge, Arc):
        return math.inf
    return max(abs(edge.radius - head.radius), math.dist(edge.centre, head.centre))
