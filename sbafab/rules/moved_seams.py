"""Laminates with their seams off their paths by their tools' error, for sealing and nets."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from sbafab.geometry.edges import Arc, Edge, Line, Point, unit
from sbafab.laminate.joints import Seam
from sbafab.laminate.laminate import Laminate
from sbafab.rules.limits import Tolerances

DIRECTIONS = 8
"""In which seams are moved; between two of them a seam is 8 % nearer than the error."""
MOST_SINGLE = 12
"""Seams up to which each is moved against all others; of more, every second one."""
STEADIER = (
    "make seams wider or run them farther past edges and each other, or state a smaller "
    "registration.seam_error that the tool keeps"
)


def straying(laminate: Laminate, tolerances: Tolerances) -> str | None:
    """Return how far seams may lie off their paths, in words; None where the press bonds all."""
    loose = [seam for gap in laminate.interfaces if not gap.pressed for seam in gap.seams]
    if not loose:
        return None
    errors = sorted({tolerances.of_seam(seam.tool) for seam in loose})
    return f"every seam off its path by up to {' or '.join(f'{error:g}' for error in errors)} mm"


def moved_seams(laminate: Laminate, tolerances: Tolerances) -> Iterator[Laminate]:
    """Yield the laminate with its seams off their paths: all one way, and some against the rest."""
    seams = laminate.seams
    most = max((tolerances.of_seam(seam.tool) for seam in seams), default=0.0)
    # A mouth between seams lies where they do.
    inlets = tuple(replace(inlet, width=inlet.width + 2 * most) for inlet in laminate.inlets)
    against = [{n} for n in range(len(seams))]
    if len(seams) > MOST_SINGLE:
        against = [set(range(0, len(seams), 2))]
    for back in ({-1}, *(against if len(seams) > 1 else ())):
        for turn in range(DIRECTIONS):
            x, y = unit(360.0 * turn / DIRECTIONS)
            moved = [
                _moved_seam(seam, (-off * x, -off * y) if n in back else (off * x, off * y))
                for n, seam in enumerate(seams)
                if (off := tolerances.of_seam(seam.tool)) >= 0
            ]
            yield replace(laminate, seams=tuple(moved), inlets=inlets)


def _moved_seam(seam: Seam, by: Point) -> Seam:
    def off(p: Point) -> Point:
        return p[0] + by[0], p[1] + by[1]

    def moved(edge: Edge) -> Edge:
        start, end = off(edge.start), off(edge.end)
        if isinstance(edge, Arc):
            return Arc(start, end, off(edge.centre), edge.radius, edge.ccw)
        return Line(start, end)

    return replace(seam, path=tuple(tuple(map(moved, chain)) for chain in seam.path))
