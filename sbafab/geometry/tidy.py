"""Contours as booleans hand them out: edges of one support joined, dust left out."""

from __future__ import annotations

import math
from collections.abc import Sequence

from sbafab.geometry.edges import (
    EPSILON,
    Edge,
    Line,
    distance_to,
    left_normal,
    quarter_arcs,
)
from sbafab.geometry.facets import run_sweep
from sbafab.geometry.nanometres import nanometres
from sbafab.geometry.region import Contour
from sbafab.geometry.shapes import circle

LEAST_AREA = 1e-7
"""Contours that enclose less, in mm2, are rounding dust; so are those thinner than 4 EPSILON, as
they are on average where no place in them is ROOM wide.
"""
ROOM = 50 * EPSILON
"""mm: a tenth of a micrometre."""
QUARTER = math.pi / 2
NANOMETRE = 1e-6
"""mm."""


def tidy(loop: Sequence[Edge]) -> Contour | None:
    """One contour with edges of one support joined and arcs of at most a quarter turn."""
    contour = Contour(tuple(loop))
    if abs(contour.area) < LEAST_AREA:
        return None
    if abs(contour.area) < 2 * EPSILON * contour.length and not _has_room(contour):
        return None
    if contour.circle is not None:
        whole = circle(*contour.circle)
        return whole if contour.area > 0 else whole.reversed()
    edges = [edge for run in contour.runs for edge in _joined(run)]
    first = _first(edges)
    return Contour((*edges[first:], *edges[:first]))


def _has_room(contour: Contour) -> bool:
    """Whether there is a place in a contour of hardly any width, beside an edge, that is ROOM wide.

    A long sliver would hide it in its average.
    """
    into = -ROOM / 2 if contour.area < 0 else ROOM / 2
    for edge in contour.edges:
        if edge.length < ROOM:
            continue
        for share in (0.25, 0.5, 0.75):
            x, y = edge.at(share)
            nx, ny = left_normal(edge, (x, y))
            p = (x + into * nx, y + into * ny)
            if contour.winding(p) and all(
                distance_to(other, p) > 0.99 * ROOM / 2 for other in contour.edges
            ):
                return True
    return False


def _first(edges: Sequence[Edge]) -> int:
    """The first edge of those that start at the least x, and of these at the least y, to 1 nm."""
    left = min([edge.start[0] for edge in edges]) + 2 * NANOMETRE
    found, least = 0, (math.inf, math.inf)
    for i, edge in enumerate(edges):
        x, y = edge.start
        # What lies farther to the right is not rounded to the least x.
        if x <= left and (place := (nanometres(x), nanometres(y))) < least:
            found, least = i, place
    return found


def _joined(run: Sequence[Edge]) -> Sequence[Edge]:
    head, end = run[0], run[-1].end
    if isinstance(head, Line):
        return [Line(head.start, end)]
    if len(run) == 1 and 0 < (head.sweep if head.ccw else -head.sweep) < QUARTER:
        return run
    return quarter_arcs(head.start, end, head.centre, head.radius, run_sweep(run))
