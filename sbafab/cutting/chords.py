"""Arcs drawn as chords, on the side of them that keeps bonds, overhangs and pins.

What bounds a bond or overhang on one side gives way, and what bounds it on the other side stays
nearer to its arcs than anything measures: films and round holes stay, masks give way.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import pairwise

from sbafab.geometry.boolean import tidy
from sbafab.geometry.edges import EPSILON, Arc, Edge, Line, Point
from sbafab.geometry.region import Contour, Region, same_support
from sbafab.laminate.laminate import Role

FINE = 0.0004
"""mm: chords of films and of round holes stay nearer, so that pins fit as in arcs, and a mask's
edge that gives way has nothing to make up for."""
LEAST = 8
"""Chords that a whole turn has at least."""
ROOM = 0.05
"""Share of a chord's angle within which no vertex stands beside the end of an arc."""


def in_chords(path: Region, role: Role | None, error: float, beam: float = 0.0) -> Region:
    """The path of a layer (None: the pin plate) with chords for arcs, within ``error`` mm of them.

    Outlines of chamber masks shrink, those of separator masks grow, holes open; films grow and
    round holes open by less than FINE. Straight edges stay. Arcs of the radius ``beam``, half the
    kerf in mm, are led round corners of the part, which stay where they are.
    """
    is_film = role is None or not role.endswith("-mask")
    fine = min(error, FINE)
    return Region(
        (
            *(
                _contour(outer, role != "chamber-mask", fine if is_film else error, beam)
                for outer in path.outers
            ),
            *(
                _contour(hole, False, fine if is_film or hole.circle else error, beam)
                for hole in path.holes
            ),
        )
    )


def _contour(contour: Contour, grows: bool, error: float, beam: float) -> Contour:
    """The contour as lines that leave its material no less (``grows``), or no more, anywhere."""
    points = [
        p
        for run in _runs(contour.edges)
        for p in _points(run, grows or _rounds_corner(run[0], beam), error)
    ]
    loop = [Line(p, q) for p, q in zip(points, (*points[1:], points[0]), strict=True) if p != q]
    return tidy(loop) or Contour(tuple(loop))


def _rounds_corner(edge: Edge, beam: float) -> bool:
    return isinstance(edge, Arc) and edge.ccw and beam > 0 and abs(edge.radius - beam) < EPSILON


def _runs(edges: tuple[Edge, ...]) -> Iterable[tuple[Edge, Edge | None]]:
    """First and last edge of every stretch on one line or circle; a whole circle has no last."""
    breaks = [i for i in range(len(edges)) if not same_support(edges[i - 1], edges[i])]
    if not breaks:
        return [(edges[0], None)]
    return [
        (edges[i], edges[after - 1])
        for i, after in zip(breaks, [*breaks[1:], breaks[0]], strict=True)
    ]


def _points(run: tuple[Edge, Edge | None], grows: bool, error: float) -> list[Point]:
    """Vertices of a stretch, but for the last, where the next begins."""
    first, last = run
    if isinstance(first, Line):
        return [first.start]
    angles = _angles(first, last, error)
    on_circle = [first.on_circle(angle) for angle in angles]
    if first.ccw == grows:
        apexes = [_apex(first, a, b) for a, b in pairwise(angles)]
        return apexes if last is None else [first.start, *apexes]
    return on_circle[:-1] if last is None else [first.start, *on_circle[1:-1]]


def _apex(arc: Arc, a: float, b: float) -> Point:
    """Where the tangents at two angles meet."""
    middle, radius = (a + b) / 2, arc.radius / math.cos((b - a) / 2)
    return arc.centre[0] + radius * math.cos(middle), arc.centre[1] + radius * math.sin(middle)


def _angles(first: Arc, last: Edge | None, error: float) -> list[float]:
    """Where chords end or tangents touch: both ends, and whole multiples of one step between.

    Multiples of a step: whichever contours share a circle share its vertices.
    """
    share = first.radius / (first.radius + error)
    count = max(LEAST, math.ceil((1 + ROOM) * math.pi / math.acos(share)))
    step = math.tau / (4 * math.ceil(count / 4))
    sign = 1 if first.ccw else -1
    if last is None:
        return [sign * k * step for k in range(round(math.tau / step) + 1)]
    start = first.start_angle
    turn = _sweep(first, last)
    low, high = sorted((start, start + turn))
    ticks = range(math.ceil(low / step + ROOM), math.floor(high / step - ROOM) + 1)
    inner = [tick * step for tick in ticks]
    return [start, *inner[::sign], start + turn]


def _sweep(first: Arc, last: Edge) -> float:
    """The signed angle from the start of one arc to the end of a later one on its circle."""
    end = math.atan2(last.end[1] - first.centre[1], last.end[0] - first.centre[0])
    turn = (end - first.start_angle) % math.tau
    if not first.ccw:
        turn -= math.tau
    return turn
