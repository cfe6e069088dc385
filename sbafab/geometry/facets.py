"""Arcs as chords. On one circle they end at the same angles, whichever contour asks: at whole
multiples of one step, of which a number makes a quarter turn.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from sbafab.geometry.edges import Arc, Edge, Point
from sbafab.geometry.region import Contour


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
    return sum(edge.sweep for edge in run if isinstance(edge, Arc))


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
        circle = first._replace(radius=radius)
        points += [circle.on_circle(math.remainder(angle, math.tau)) for angle in angles]
    if len(points) < 3:
        return [edge.at(t) for edge in contour.edges for t in (0.0, 0.5)]
    return points
