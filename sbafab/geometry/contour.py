"""Contours: closed chains of lines and arcs, their tidy form, chords in place of arcs, and copies.

A contour has the material on its left: outer contours run counter-clockwise, holes clockwise.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise

from sbafab.geometry.edges import (
    EPSILON,
    SAME,
    Arc,
    Bounds,
    Edge,
    Line,
    Point,
    box_round,
    distance_to,
    left_normal,
    quarter_arcs,
    runs,
    same_support,
    turns_round,
)

Mark = tuple[float, float, float]
Similarity = Callable[[Point], Point]
"""A similarity of the plane, by its effect on points."""


@dataclass(frozen=True)
class Contour:
    """One closed chain of edges; each edge starts where the previous one ends."""

    edges: tuple[Edge, ...]

    @cached_property
    def area(self) -> float:
        """Enclosed area in mm2: positive counter-clockwise, negative for a hole."""
        ox, oy = self.edges[0].start
        twice = bulges = 0.0
        for edge in self.edges:
            x0, y0 = edge.start
            x1, y1 = edge.end
            twice += (x0 - ox) * (y1 - oy) - (x1 - ox) * (y0 - oy)
            bulges += edge.segment_area
        return twice / 2 + bulges

    @cached_property
    def length(self) -> float:
        """Length in mm."""
        return sum([edge.length for edge in self.edges])

    @cached_property
    def boxes(self) -> tuple[Bounds, ...]:
        """The bounds of each edge."""
        return tuple([edge.bounds for edge in self.edges])

    @cached_property
    def bounds(self) -> Bounds:
        """Least x, least y, largest x, largest y, mm."""
        return box_round(self.boxes)

    @cached_property
    def is_hole(self) -> bool:
        """True if the contour runs clockwise."""
        return self.area < 0

    @cached_property
    def start_hash(self) -> int:
        """A hash of the start points of edges: equal for equal edges, and rarely for others."""
        return hash(tuple([edge.start for edge in self.edges]))

    @cached_property
    def circle(self) -> tuple[Point, float] | None:
        """Centre and radius if the contour is one full circle."""
        first = self.edges[0]
        if not isinstance(first, Arc):
            return None
        for edge in self.edges[1:]:
            if not isinstance(edge, Arc) or not same_support(first, edge):
                return None
        return first.centre, first.radius

    @cached_property
    def runs(self) -> tuple[tuple[Edge, ...], ...]:
        """The edges grouped by their common line or circle, from the first corner on."""
        return tuple(runs(self.edges))

    @property
    def vertices(self) -> tuple[Mark, ...]:
        """The x, y and bulge of each vertex, as in a DXF polyline."""
        return tuple((*edge.start, edge.bulge) for edge in self.edges)

    @cached_property
    def marks(self) -> tuple[Mark, ...]:
        """The vertices with their bulges; for a full circle, which may be split anywhere, its
        centre and radius (negative for a hole).
        """
        if self.circle is None:
            return self.vertices
        centre, radius = self.circle
        return ((*centre, -radius if self.is_hole else radius),)

    def coincides(self, contour: Contour) -> bool:
        """Return True if the corners and edge midpoints of both contours agree within SAME."""
        if len(self.marks) != len(contour.marks) or self.is_hole != contour.is_hole:
            return False
        if any(abs(a - b) > SAME for a, b in zip(self.bounds, contour.bounds, strict=True)):
            return False
        if self.circle is not None or contour.circle is not None:
            return (self.circle is None) == (contour.circle is None)
        return any(
            all(_coincide(a, b) for a, b in zip(self.edges, edges, strict=True))
            for first, edge in enumerate(contour.edges)
            if _coincide(self.edges[0], edge)
            for edges in [contour.edges[first:] + contour.edges[:first]]
        )

    def reversed(self) -> Contour:
        """Return the contour in the opposite direction: a hole for an outline."""
        return Contour(tuple([edge.reversed() for edge in reversed(self.edges)]))

    def mapped(self, point: Similarity, scale: float, mirror: bool) -> Contour:
        """Return the contour under a similarity, given as a function of points."""
        # Each edge starts where the one before it ends.
        starts = [point(edge.start) for edge in self.edges]
        ends = [*starts[1:], starts[0]]
        edges = tuple(
            [
                Line(start, end)
                if isinstance(edge, Line)
                else Arc(start, end, point(edge.centre), edge.radius * scale, edge.ccw ^ mirror)
                for edge, start, end in zip(self.edges, starts, ends, strict=True)
            ]
        )
        image = Contour(edges)
        return image.reversed() if mirror else image

    def winding(self, p: Point) -> int:
        """Return the winding number round ``p`` (not on an edge), positive counter-clockwise."""
        px, py = p
        low_x, low_y, high_x, high_y = self.bounds
        if not (low_x <= px <= high_x and low_y <= py <= high_y):
            return 0
        turns = 0
        for edge, box in zip(self.edges, self.boxes, strict=True):
            if box[1] - EPSILON <= py <= box[3] + EPSILON:
                turns += turns_round(edge, p)
        return turns

    def polygon(self, sagitta: float = 0.001) -> list[Point]:
        """Return vertices of a polygon whose chords stay within ``sagitta`` mm of the arcs."""
        return facets(self, sagitta, keeps_area=False)


def _coincide(a: Edge, b: Edge) -> bool:
    return math.dist(a.start, b.start) < SAME and math.dist(a.at(0.5), b.at(0.5)) < SAME


@lru_cache(maxsize=256)
def circle(centre: Point, radius: float) -> Contour:
    """Return a full circle, counter-clockwise, as four quarter arcs.

    All layers that a bore goes through share one contour and the values cached in it.
    """
    x, y = centre
    compass = [(x + radius, y), (x, y + radius), (x - radius, y), (x, y - radius)]
    contour = Contour(
        tuple([Arc(compass[i], compass[(i + 1) % 4], centre, radius, True) for i in range(4)])
    )
    # Known here; no need to derive them from the arcs.
    contour.__dict__.update(
        circle=(centre, radius),
        area=math.pi * radius * radius,
        length=math.tau * radius,
        bounds=(x - radius, y - radius, x + radius, y + radius),
    )
    return contour


# Chords of arcs. On one circle they end at the same angles in every contour: at multiples of a
# step that divides a quarter turn.


CHORD_ROOM = 0.05
"""Share of a chord's angle that stays free of vertices at the ends of a run whose chords keep to
one side of it.
"""


def chord_step(half: float, least: int) -> float:
    """Return the angle of a chord: at most twice ``half``, and at most 1 / ``least`` of a turn."""
    return math.tau / (4 * math.ceil(max(least, math.ceil(math.pi / half)) / 4))


def ticks(run: Sequence[Edge], step: float, room: float) -> list[float]:
    """Return the angles of the chord ends on a run of arcs of one circle, in the run's direction.

    No end lies within ``room`` steps of the run's ends; a whole circle has all of them.
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
    """Return the vertices in mm of a polygon that approximates the contour.

    The height of an arc over its chord is at most ``sagitta`` mm. To preserve the area, vertices on
    a circle lie two thirds of the sagitta outside it; corners, where arcs meet other edges, do not.
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
            # Half a step from the ends: a vertex outside the circle would make a dent any closer.
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
    """Return vertices of chords within ``error`` mm of a run, without the last, where the next run
    starts.

    If it ``grows``, everything left of the run is left of the chords; otherwise the reverse holds.
    """
    first = run[0]
    if isinstance(first, Line):
        return [first.start]
    step = chord_step(math.acos(first.radius / (first.radius + error)) / (1 + CHORD_ROOM), 8)
    angles = ticks(run, step, CHORD_ROOM)
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
    """Return the point where the tangents at two angles meet."""
    middle, radius = (a + b) / 2, arc.radius / math.cos((b - a) / 2)
    return arc.centre[0] + radius * math.cos(middle), arc.centre[1] + radius * math.sin(middle)


# The tidy form, in which booleans return contours: edges on one line or circle joined, no dust.


LEAST_AREA = 1e-7
"""mm2: contours that enclose less are rounding dust, and so are contours with a mean width below
4 EPSILON that are nowhere SLIVER wide.
"""
SLIVER = 50 * EPSILON
"""mm: a tenth of a micrometre."""
QUARTER = math.pi / 2
NANOMETRE = 1e-6
"""mm."""


def tidy(loop: Sequence[Edge]) -> Contour | None:
    """Return a closed chain with collinear or cocircular edges joined and arcs of at most a quarter
    turn.

    None if it encloses only rounding errors.
    """
    contour = Contour(tuple(loop))
    if abs(contour.area) < LEAST_AREA:
        return None
    if abs(contour.area) < 2 * EPSILON * contour.length and not _has_room(contour):
        return None
    if contour.circle is not None:
        whole = circle(*contour.circle)
        return whole if contour.area > 0 else whole.reversed()
    edges = [edge for run in contour.runs for edge in _joined(run)]
    first = _first_edge(edges)
    return Contour((*edges[first:], *edges[:first]))


def _has_room(contour: Contour) -> bool:
    """Return True if a very thin contour is SLIVER wide somewhere beside an edge.

    The mean width of a long sliver would hide such a place.
    """
    into = -SLIVER / 2 if contour.area < 0 else SLIVER / 2
    for edge in contour.edges:
        if edge.length < SLIVER:
            continue
        for share in (0.25, 0.5, 0.75):
            x, y = edge.at(share)
            nx, ny = left_normal(edge, (x, y))
            p = (x + into * nx, y + into * ny)
            if contour.winding(p) and all(
                distance_to(border, p) > 0.99 * SLIVER / 2 for border in contour.edges
            ):
                return True
    return False


def _first_edge(edges: Sequence[Edge]) -> int:
    """Return the number of the edge whose start has the least x, then the least y, to 1 nm."""
    limit = min([edge.start[0] for edge in edges]) + 2 * NANOMETRE
    first, least = 0, (math.inf, math.inf)
    for i, edge in enumerate(edges):
        x, y = edge.start
        # Skip starts too far right to round to the least x.
        if x <= limit and (place := (nanometres(x), nanometres(y))) < least:
            first, least = i, place
    return first


def _joined(run: Sequence[Edge]) -> Sequence[Edge]:
    head, end = run[0], run[-1].end
    if isinstance(head, Line):
        return [Line(head.start, end)]
    if len(run) == 1 and 0 < (head.sweep if head.ccw else -head.sweep) < QUARTER:
        return run
    return quarter_arcs(head.start, end, head.centre, head.radius, run_sweep(run))


def nanometres(value: float) -> int:
    """Return a length in mm, rounded to nanometres.

    Rounded coordinates give nearly equal shapes the same order.
    """
    return math.floor(value * 1e6 + 0.5)


def in_reading_order(contours: Sequence[Contour]) -> tuple[Contour, ...]:
    """Return outer contours, then holes, each from left to right."""
    # Fast path: most regions have one or two.
    return tuple(sorted(contours, key=_reading_order) if len(contours) > 1 else contours)


def _reading_order(contour: Contour) -> tuple[bool, int, int, int]:
    low_x, low_y, high_x, _ = contour.bounds
    return contour.is_hole, nanometres(low_x), nanometres(low_y), nanometres(high_x)
