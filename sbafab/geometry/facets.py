"""Arcs as chords. On one circle they end at the same angles, whichever contour asks: at whole
multiples of one step, of which a number makes a quarter turn.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

from sbafab.geometry.edges import Arc, Edge, Line, Point
from sbafab.geometry.region import Contour

ROOM = 0.05
"""Share of a chord's angle within which no vertex stands beside the end of a run of chords that
keep to one side of it.
"""


def chord_step(half: float, least: int) -> float:
    """Angle of a chord: no more than twice ``half``, at most a ``least``-th of a whole turn."""
    return math.tau / (4 * math.ceil(max(least, math.ceil(math.pi / half)) / 4))


def ticks(run: Sequence[Edge], step: float, room: float) -> list[float]:
    """Angles, in the run's direction, of the chords' ends on a run of arcs of one circle.

    Nearer than ``room`` steps to the run's ends there is none; a whole circle has all.
    """
    first = run[0]
    assert isinstance(first, Arc)
    sweep = run_sweep(run)
    if run[-1].end == first.start:
        numbers = range(round(math.tau / step))
    else:
        low, high = sorted((first.start_angle / step, (first.start_angle + sweep) / step))
        numbers = range(math.ceil(low + room), math.floor(high - room) + 1)
    return [number * step for number in (numbers if first.ccw else reversed(numbers))]


def run_sweep(run: Sequence[Edge]) -> float:
    """The angle that a run of arcs of one circle turns through, positive counter-clockwise."""
    return sum([edge.sweep for edge in run if isinstance(edge, Arc)])


def facets(contour: Contour, sagitta: float, keeps_area: bool = True) -> list[Point]:
    """Vertices in mm of a polygon that stands in for the contour.

    The height of an arc over its chord is ``sagitta`` mm at most. To keep the area, vertices on a
    circle stand two thirds of the sagitta outside it; corners, where arcs meet other edges, do not.
    """
    points: list[Point] = []
    for run in contour.runs:
        first = run[0]
        if not isinstance(first, Arc):
            points += [edge.start for edge in run]
            continue
        if contour.circle is None:
            points.append(first.start)
        half = math.acos(1 - min(1.0, sagitta / first.radius))
        if keeps_area:
            step = chord_step(half, 12)
            # Half a step from the ends: nearer, a vertex outside the circle would make a dent.
            angles = ticks(run, step, 0.5)
            radius = first.radius * math.sqrt(step / math.sin(step))
            if not angles:
                points.append(first.on_circle(first.start_angle + run_sweep(run) / 2))
        else:
            angles = ticks(run, chord_step(half, 8), 1e-7)
            radius = first.radius
        circle = Arc(first.start, first.end, first.centre, radius, first.ccw)
        points += [circle.on_circle(math.remainder(angle, math.tau)) for angle in angles]
    if len(points) < 3:
        return [edge.at(t) for edge in contour.edges for t in (0.0, 0.5)]
    return points


def run_chords(run: Sequence[Edge], grows: bool, error: float) -> list[Point]:
    """Vertices of chords within ``error`` mm of a run, but for the last, where the next run begins.

    What lies to the left of the run lies left of the chords too if it ``grows``, and there is
    nowhere more of it if not.
    """
    first = run[0]
    if isinstance(first, Line):
        return [first.start]
    step = chord_step(math.acos(first.radius / (first.radius + error)) / (1 + ROOM), 8)
    angles = ticks(run, step, ROOM)
    is_whole = run[-1].end == first.start
    if is_whole:
        angles.append(angles[0] + (math.tau if first.ccw else -math.tau))
    else:
        angles = [first.start_angle, *angles, first.start_angle + run_sweep(run)]
    if first.ccw == grows:
        corners = [_apex(first, a, b) for a, b in pairwise(angles)]
    else:
        corners = [first.on_circle(angle) for angle in angles[not is_whole : -1]]
    return corners if is_whole else [first.start, *corners]


def _apex(arc: Arc, a: float, b: float) -> Point:
    """Where the tangents at two angles meet."""
    middle, radius = (a + b) / 2, arc.radius / math.cos((b - a) / 2)
    return arc.centre[0] + radius * math.cos(middle), arc.centre[1] + radius * math.sin(middle)
