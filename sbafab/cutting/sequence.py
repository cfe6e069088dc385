"""The cutting order of contours: inner before outer, short travel, spread heat; and its time."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise

from sbafab.design.sections import Laser
from sbafab.geometry.contour import Contour
from sbafab.geometry.edges import Bounds, Point
from sbafab.geometry.lazy_numpy import np
from sbafab.geometry.region import Region

ORIGIN: Point = (0.0, 0.0)
SWEEPS = 6
"""Number of passes over a path to undo crossings."""
LOOKED_AHEAD = 40
"""Contours along the path that one end of a crossing may lie from the other."""
SHORTER = 1e-6
"""mm by which a path has to become shorter to be turned round."""


def cutting_sequence(region: Region, heat_distance: float = 0.0) -> tuple[Contour, ...]:
    """Return holes first, then outlines, each followed by the nearest start, from the origin.

    Contours closer than ``heat_distance`` mm are not cut consecutively while others remain to be
    cut in between.
    """
    holes = _short(region.holes, ORIGIN)
    here = _start(holes[-1]) if holes else ORIGIN
    outers = _short(region.outers, here)
    return (*_spread(holes, heat_distance), *_spread(outers, heat_distance))


def travel(contours: Iterable[Contour]) -> float:
    """The travel of the head in mm from the origin to each contour, which ends where it starts."""
    stops = [ORIGIN, *map(_start, contours)]
    return sum(math.dist(a, b) for a, b in pairwise(stops))


def cutting_minutes(cuts: int, cut_length: float, moved: float, laser: Laser) -> float:
    """Return the minutes for cuts and travel (mm).

    Engraving and the travel to a roll's parting cut are excluded.
    """
    seconds = (
        cut_length / laser.cut_speed + moved / laser.travel_speed + cuts * laser.pierce_seconds
    )
    return seconds / 60


def _start(contour: Contour) -> Point:
    return contour.edges[0].start


def _short(contours: Iterable[Contour], here: Point) -> list[Contour]:
    """Return a short path through all contours: nearest neighbours, then without crossings."""
    rest = list(contours)
    starts = np.array([_start(contour) for contour in rest], dtype=float).reshape(-1, 2)
    path: list[Contour] = []
    place = np.array(here, dtype=float)
    while len(path) < len(rest):
        # Rounding lets equal ways stay equal on every machine; the first of them wins.
        number = int(np.round(np.hypot(*(starts - place).T), 6).argmin())
        path.append(rest[number])
        place = starts[number].copy()
        starts[number] = math.inf
    for _ in range(SWEEPS):
        if not _undo_crossings(path, here):
            break
    return path


def _undo_crossings(path: list[Contour], here: Point) -> bool:
    """Reverse stretches of the path wherever that shortens it (2-opt)."""
    shorter = False
    stops = [here, *map(_start, path)]
    count = len(path)
    steps = [math.dist(a, b) for a, b in pairwise(stops)] + [0.0]
    for i in range(count - 1):
        for j in range(i + 1, min(count, i + LOOKED_AHEAD)):
            # Behind the last stop there is nothing to go on to.
            before = steps[i] + steps[j + 1]
            after = math.dist(stops[i], stops[j + 1])
            if after < before - SHORTER and j + 1 < count:
                after += math.dist(stops[i + 1], stops[j + 2])
            if after < before - SHORTER:
                path[i : j + 1] = path[i : j + 1][::-1]
                stops[i + 1 : j + 2] = stops[i + 1 : j + 2][::-1]
                steps[i + 1 : j + 1] = steps[i + 1 : j + 1][::-1]
                steps[i] = math.dist(stops[i], stops[i + 1])
                if j + 1 < count:
                    steps[j + 1] = math.dist(stops[j + 1], stops[j + 2])
                shorter = True
    return shorter


def _spread(path: Sequence[Contour], heat_distance: float) -> list[Contour]:
    """Return the path in which each next contour is, if possible, not close to the last."""
    rest = list(path)
    spread: list[Contour] = []
    while rest:
        far = (
            number
            for number, contour in enumerate(rest)
            if not spread or _apart(spread[-1].bounds, contour.bounds) >= heat_distance
        )
        spread.append(rest.pop(next(far, 0)))
    return spread


def _apart(a: Bounds, b: Bounds) -> float:
    """Return the gap between two bounding boxes in mm."""
    across = max(a[0] - b[2], b[0] - a[2], 0.0)
    along = max(a[1] - b[3], b[1] - a[3], 0.0)
    return math.hypot(across, along)
