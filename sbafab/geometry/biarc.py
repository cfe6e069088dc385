"""Smooth curves fitted by circular arcs: biarcs, two arcs that share a tangent where they join.

A curve is a function of a parameter that gives the point and the derivative there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from sbafab.geometry.edges import EPSILON, Edge, Line, Point, distance_to, edge_from_bulge

Curve = Callable[[float], tuple[Point, Point]]

TOLERANCE = 0.0005
"""Farthest a fitted arc may lie from its curve, in mm."""
SAMPLES = 24
"""Points of a span that are compared with its two arcs."""
STRAIGHT = 1e-6
"""An arc that bulges less than this, in mm, is written as a line."""
LARGEST_TURN = math.radians(80)
"""Farthest the tangent may turn along one arc."""


class FitError(ArithmeticError):
    """A curve that arcs do not follow: it has a cusp or runs wild; the message says where."""


def fit_arcs(
    curve: Curve, first: float, last: float, tolerance: float = TOLERANCE
) -> tuple[Edge, ...]:
    """Arcs and lines within ``tolerance`` mm of the curve between two parameters.

    Neighbours share a tangent; each pair of arcs reaches as far along the curve as the tolerance
    lets it. Raises FitError where the curve has no tangent or turns back on itself.
    """
    edges: list[Edge] = []
    least = (last - first) * 1e-7
    at, step = first, (last - first) / 4
    while at < last:
        reach, fitted = _longest_span(curve, at, last, step, tolerance, least)
        edges += fitted
        at, step = reach, max(reach - at, least)
        if last - at < least:
            break
    return tuple(edge for edge in edges if edge.length > EPSILON)


def _longest_span(
    curve: Curve, at: float, last: float, step: float, tolerance: float, least: float
) -> tuple[float, list[Edge]]:
    """The farthest parameter one biarc from ``at`` reaches, by doubling and then bisection."""
    good, fitted, bad = at, list[Edge](), math.inf
    while good < last and (bad == math.inf or bad - good > 0.01 * step):
        end = min(last, good + 2 * step if good > at else at + step) if bad == math.inf else 0.0
        if bad != math.inf:
            end = (good + bad) / 2
        if end - at < least:
            (x, y), _ = curve(at)
            raise FitError(f"the curve has a cusp near x {x:.4f}, y {y:.4f}")
        edges = _span(curve, at, end, tolerance)
        if edges:
            good, fitted = end, edges
        else:
            bad, step = end, min(step, end - at)
    return good, fitted
