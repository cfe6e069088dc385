"""Points spread over edges, from which it is looked for what lies across."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from sbafab.geometry.edges import Arc, Edge, Point

STEP: Final = math.radians(15)
"""Widest step of samples along an arc: 7.5 degrees aside a shift counts 0.99 of its length."""


def sampled(edges: Sequence[Edge], room: float = 0.0) -> tuple[list[Point], list[int]]:
    """Samples of all edges, one edge after the other, and how many each has.

    On a line both ends and the middle, on an arc one every 15 degrees at least; those at the ends
    lie ``room`` mm within.
    """
    found: list[Point] = []
    counts: list[int] = []
    for edge in edges:
        count = 2
        if isinstance(edge, Arc):
            count = max(2, math.ceil(abs(edge.sweep) / STEP))
        share = room / edge.length if room > 0 else 0.0
        shares = [min(1 - share, max(share, i / count)) for i in range(count + 1)]
        found += _places_along(edge, shares)
        counts.append(count + 1)
    return found, counts


def _places_along(edge: Edge, shares: list[float]) -> list[Point]:
    """The points at these shares of an edge's length; its very ends at 0 and 1."""
    if not isinstance(edge, Arc):
        return [edge.start if t == 0 else edge.end if t == 1 else edge.at(t) for t in shares]
    first, sweep = edge.start_angle, edge.sweep
    x, y = edge.centre
    r = edge.radius
    angles = [first + t * sweep for t in shares]
    found = [(x + r * math.cos(a), y + r * math.sin(a)) for a in angles]
    if shares[0] == 0:
        found[0] = edge.start
    if shares[-1] == 1:
        found[-1] = edge.end
    return found
