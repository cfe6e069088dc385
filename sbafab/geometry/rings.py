"""Arcs of one centre with material between them: what lies across needs no search."""

from __future__ import annotations

import math

from sbafab.geometry.boundary_side import BoundarySide
from sbafab.geometry.edges import Arc, Edge, Point

WIDE = 1e-5
"""mm: in narrower rings rounding may decide which edges face each other."""


def bound_a_ring(a: Edge, b: Edge) -> bool:
    """Whether two edges are arcs of one centre, the outer one counter-clockwise, with a ring
    between.
    """
    if not (isinstance(a, Arc) and isinstance(b, Arc)) or a.ccw == b.ccw or a.centre != b.centre:
        return False
    return (a.radius - b.radius if a.ccw else b.radius - a.radius) > WIDE


def across_a_ring(a: BoundarySide, b: BoundarySide) -> list[tuple[Point, Point]]:
    """From middle and ends of each of two such arcs to the other one, where it lies across."""
    found: list[tuple[Point, Point]] = []
    for one, other in ((a, b), (b, a)):
        arc = other.edge
        assert isinstance(arc, Arc)
        cx, cy = arc.centre
        r = arc.radius
        mx, my = other.middle[0] - cx, other.middle[1] - cy
        least = r * (math.cos(other.half_turn) - 1e-9)
        for p in (one.middle, one.edge.start, one.edge.end):
            ux, uy = p[0] - cx, p[1] - cy
            distance = math.hypot(ux, uy)
            vx, vy = ux / distance, uy / distance
            if vx * mx + vy * my >= least:
                found.append((p, (cx + r * vx, cy + r * vy)))
    return found
