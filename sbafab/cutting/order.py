"""The order in which the contours of a region are cut."""

from __future__ import annotations

import math
from collections.abc import Iterable

from sbafab.geometry.edges import Point
from sbafab.geometry.region import Contour, Region

ORIGIN: Point = (0.0, 0.0)


def cutting_order(region: Region) -> tuple[Contour, ...]:
    """Holes first, then outlines, each time on to the nearest start, from the origin."""
    holes = _nearest_first(region.holes, ORIGIN)
    here = holes[-1].edges[0].start if holes else ORIGIN
    return (*holes, *_nearest_first(region.outers, here))


def _nearest_first(contours: Iterable[Contour], here: Point) -> list[Contour]:
    """A contour ends where it starts, so the head travels from start to start."""
    rest = list(contours)
    path: list[Contour] = []
    while rest:
        # Rounding lets equal ways stay equal on every machine; the first of them wins.
        ways = [round(math.dist(here, contour.edges[0].start), 6) for contour in rest]
        path.append(rest.pop(ways.index(min(ways))))
        here = path[-1].edges[0].start
    return path
