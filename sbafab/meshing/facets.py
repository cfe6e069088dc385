"""Exact contours as chords that keep the area."""

from __future__ import annotations

import math
from collections.abc import Iterator

from sbafab.geometry.edges import Arc, Edge, Point
from sbafab.geometry.region import Contour, same_support


def facets(contour: Contour, sagitta: float) -> list[Point]:
    """Vertices in mm of a polygon that stands in for the contour.

    The height of an arc over its chord is ``sagitta`` mm at most. Vertices on one circle stand
    at the same angles whichever contour asks, and two thirds of the sagitta outside it, so that
    chords and arcs enclose equal areas; where arcs meet other edges, the corner is a vertex.
    """
    points: list[Point] = []
    runs = list(_runs(contour))
    for run in runs:
        first = run[0]
        if isinstance(first, Arc):
            whole = len(runs) == 1
            if not whole:
                points.append(first.start)
            points.extend(_ticks(first, sum(_sweep(edge) for edge in run), sagitta, whole))
        else:
            points.append(first.start)
    return points


def _runs(contour: Contour) -> Iterator[list[Edge]]:
    """Edges gathered while they follow one circle; the first run starts at a corner."""
    edges = contour.edges
    corner = next((i for i, edge in enumerate(edges) if not _follows(edges[i - 1], edge)), 0)
    run: list[Edge] = []
    for edge in edges[corner:] + edges[:corner]:
        if run and not _follows(run[-1], edge):
            yield run
            run = []
        run.append(edge)
    yield run


def _follows(before: Edge, after: Edge) -> bool:
    return isinstance(after, Arc) and same_support(before, after)


def _sweep(edge: Edge) -> float:
    return edge.sweep if isinstance(edge, Arc) else 0.0


def _ticks(arc: Arc, sweep: float, sagitta: float, whole: bool) -> list[Point]:
    """Vertices on the arc's circle over ``sweep``, the ends of the run left out."""
    ratio = min(1.0, sagitta / arc.radius)
    count = 4 * max(3, math.ceil(math.pi / math.acos(1 - ratio) / 4))
    step = math.tau / count
    radius = arc.radius * math.sqrt(step / math.sin(step))
    if whole:
        ticks = list(range(count))
    else:
        # Half a step from the ends: nearer, a vertex outside the circle would make a dent.
        low, high = sorted((arc.start_angle, arc.start_angle + sweep))
        ticks = list(range(math.ceil(low / step + 0.5), math.floor(high / step - 0.5) + 1))
    if not ticks:
        return [arc.on_circle(arc.start_angle + sweep / 2)]
    circle = Arc(arc.start, arc.end, arc.centre, radius, True)
    points = [circle.on_circle(math.remainder(tick * step, math.tau)) for tick in ticks]
    return points if arc.ccw else points[::-1]
