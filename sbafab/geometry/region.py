"""Planar regions bounded by exact lines and arcs.

A contour keeps the material on its left: outer contours run counter-clockwise, holes clockwise.
Contours of one region never cross. Everything here is immutable; operators return new regions.
"""

from __future__ import annotations

import hashlib
import math
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from operator import sub
from typing import TYPE_CHECKING, Final

from sbafab.geometry.cache import Exact, cached_attribute
from sbafab.geometry.edges import (
    EPSILON,
    SAME,
    Arc,
    Bounds,
    Edge,
    Line,
    Point,
    box_round,
    boxes_of,
    distance_to,
    enclosed_area,
    length_of,
    runs,
    same_support,
    times_round,
    turns_round,
    unit,
)
from sbafab.geometry.intersect import meeting_points
from sbafab.geometry.nearby import EdgeIndex, close_pairs

if TYPE_CHECKING:
    import shapely

Mark = tuple[float, float, float]
MANY: Final = 32
"""Edges from which on filing them by place is worth its cost."""


@dataclass(frozen=True)
class Contour:
    """One closed chain of edges; each edge starts where the one before it ends."""

    edges: tuple[Edge, ...]

    @cached_attribute
    def area(self) -> float:
        """Enclosed area in mm2: positive counter-clockwise, negative for a hole."""
        return enclosed_area(self.edges)

    @cached_attribute
    def length(self) -> float:
        return length_of(self.edges)

    @cached_attribute
    def boxes(self) -> tuple[Bounds, ...]:
        """The bounds of each edge."""
        return boxes_of(self.edges)

    @cached_attribute
    def bounds(self) -> Bounds:
        return box_round(self.boxes)

    @cached_attribute
    def is_hole(self) -> bool:
        return self.area < 0

    @cached_attribute
    def start_hash(self) -> int:
        """Equal for equal edges; where edges start tells nearly all other contours apart."""
        return hash(tuple([edge.start for edge in self.edges]))

    @cached_attribute
    def circle(self) -> tuple[Point, float] | None:
        """Centre and radius if the contour is one full circle."""
        first = self.edges[0]
        if not isinstance(first, Arc):
            return None
        for edge in self.edges[1:]:
            if not isinstance(edge, Arc) or not same_support(first, edge):
                return None
        return first.centre, first.radius

    @cached_attribute
    def runs(self) -> tuple[tuple[Edge, ...], ...]:
        """The edges gathered by the line or circle they lie on, from the first corner on."""
        return tuple(runs(self.edges))

    @property
    def vertices(self) -> tuple[tuple[float, float, float], ...]:
        """x, y and bulge of each vertex, as a DXF polyline carries them."""
        return tuple((*edge.start, edge.bulge) for edge in self.edges)

    @cached_attribute
    def marks(self) -> tuple[Mark, ...]:
        """What the contour is known by: its vertices with their bulges, or one circle (which may be
        split anywhere) with its radius, negative round a hole.
        """
        if self.circle is None:
            return self.vertices
        centre, radius = self.circle
        return ((*centre, -radius if self.is_hole else radius),)

    def coincides(self, other: Contour) -> bool:
        """Whether corners and middles of the edges of both lie within SAME of each other."""
        if len(self.marks) != len(other.marks) or self.is_hole != other.is_hole:
            return False
        if any(abs(a - b) > SAME for a, b in zip(self.bounds, other.bounds, strict=True)):
            return False
        if self.circle is not None or other.circle is not None:
            return (self.circle is None) == (other.circle is None)
        return any(
            all(_same(a, b) for a, b in zip(self.edges, after, strict=True))
            for turn, edge in enumerate(other.edges)
            if _same(self.edges[0], edge)
            for after in [other.edges[turn:] + other.edges[:turn]]
        )

    def reversed(self) -> Contour:
        turned = Contour(tuple([edge.reversed() for edge in reversed(self.edges)]))
        known = self.__dict__
        turned.__dict__["circle"] = self.circle
        for name, sign in (("length", 1), ("area", -1)):
            if name in known:
                turned.__dict__[name] = sign * known[name]
        if "bounds" in known:
            turned.__dict__["bounds"] = known["bounds"]
        return turned

    def mapped(self, point: Similarity, scale: float, mirror: bool) -> Contour:
        """The contour under a similarity given by its effect on points."""
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
        known = self.__dict__
        if "length" in known:
            image.__dict__["length"] = scale * known["length"]
        if "area" in known:
            # A mirrored image keeps the material on its left once it is reversed.
            image.__dict__["area"] = scale * scale * known["area"] * (-1 if mirror else 1)
        if self.circle is not None:
            (x, y), radius = point(self.circle[0]), self.circle[1] * scale
            image.__dict__["circle"] = (x, y), radius
            image.__dict__["bounds"] = x - radius, y - radius, x + radius, y + radius
        return image.reversed() if mirror else image

    @cached_attribute
    def _round_once(self) -> tuple[Point, float, int] | None:
        """Centre, radius and direction of a full circle that runs round once."""
        if self.circle is None:
            return None
        centre, radius = self.circle
        if abs(abs(self.area) - math.pi * radius * radius) > SAME * radius:
            return None
        return centre, radius, -1 if self.area < 0 else 1

    def winding(self, p: Point) -> int:
        """How many times the contour runs counter-clockwise round ``p`` (not on an edge)."""
        px, py = p
        low_x, low_y, high_x, high_y = self.bounds
        if not (low_x <= px <= high_x and low_y <= py <= high_y):
            return 0
        if self._round_once is not None:
            (cx, cy), radius, turns = self._round_once
            room = radius - math.hypot(px - cx, py - cy)
            if abs(room) > SAME:
                return turns if room > 0 else 0
        if len(self.edges) < MANY:
            return times_round(self.edges, self.boxes, p)
        low, step, rows = self._rows
        return sum(
            [turns_round(edge, p) for edge in rows[min(len(rows) - 1, int((py - low) / step))]]
        )

    @cached_attribute
    def _rows(self) -> tuple[float, float, list[list[Edge]]]:
        """Edges by level: lowest y, height of a row, and each row's edges."""
        _, low, _, high = self.bounds
        count = len(self.edges) // 4
        step = (high - low) / count
        rows: list[list[Edge]] = [[] for _ in range(count)]
        for edge, (_, bottom, _, top) in zip(self.edges, self.boxes, strict=True):
            # One row more at both ends: a row's own limits are rounded.
            first, last = int((bottom - low) / step) - 1, int((top - low) / step) + 1
            for row in range(max(0, first), min(count - 1, last) + 1):
                rows[row].append(edge)
        return low, step, rows

    def polygon(self, sagitta: float = 0.001) -> list[Point]:
        """Vertices of a polygon whose chords stay within ``sagitta`` of the arcs."""
        from sbafab.geometry.arcs import facets

        return facets(self, sagitta, keeps_area=False)


def _same(a: Edge, b: Edge) -> bool:
    return math.dist(a.start, b.start) < SAME and math.dist(a.at(0.5), b.at(0.5)) < SAME


@dataclass(frozen=True)
class Region(Exact):
    """A planar region, possibly of several pieces, possibly empty."""

    contours: tuple[Contour, ...] = ()

    @cached_attribute
    def area(self) -> float:
        """Area in mm2."""
        return sum(contour.area for contour in self.contours)

    @cached_attribute
    def bounds(self) -> Bounds:
        """Least x, least y, largest x, largest y, mm."""
        return box_round([contour.bounds for contour in self.contours])

    @property
    def is_empty(self) -> bool:
        return not self.contours

    @cached_attribute
    def outers(self) -> tuple[Contour, ...]:
        """The outer contours, counter-clockwise."""
        return tuple(contour for contour in self.contours if not contour.is_hole)

    @cached_attribute
    def holes(self) -> tuple[Contour, ...]:
        """The contours of holes, clockwise."""
        return tuple(contour for contour in self.contours if contour.is_hole)

    @cached_attribute
    def edges(self) -> tuple[Edge, ...]:
        return tuple(edge for contour in self.contours for edge in contour.edges)

    @cached_attribute
    def index(self) -> EdgeIndex:
        """The edges filed by place."""
        return EdgeIndex(self.edges, [box for contour in self.contours for box in contour.boxes])

    @property
    def pieces(self) -> tuple[Region, ...]:
        """The connected pieces, each an outer contour with its holes."""
        # A region that kept itself would be freed late.
        return (self,) if len(self.outers) == 1 else self._several

    @cached_attribute
    def _several(self) -> tuple[Region, ...]:
        held: list[list[Contour]] = [[outer] for outer in self.outers]
        places = [hole.edges[0].at(0.5) for hole in self.holes]
        boxes = [*(outer.bounds for outer in self.outers), *((*p, *p) for p in places)]
        near: list[list[int]] = [[] for _ in places]
        for pair in close_pairs(boxes, 0.0):
            outer, hole = min(pair), max(pair) - len(held)
            if outer < len(held) and hole >= 0:
                near[hole].append(outer)
        for contour, place, numbers in zip(self.holes, places, near, strict=True):
            inside = [
                held[number]
                for number in sorted(numbers)
                if held[number][0].winding(place) != 0 and held[number][0].area > -contour.area
            ]
            min(inside, key=lambda group: group[0].area).append(contour)
        return tuple(Region(tuple(group)) for group in held)

    @cached_attribute
    def key(self) -> str:
        """A name for the shape, from its corners rounded to 1 nm; the same on every machine.

        Equal keys are of equal shapes. Shapes that differ by a hair may round to two keys: ``==``
        tells whether they are one.
        """
        rings = []
        for contour in self.contours:
            # Adding 0.0 makes -0.0 and 0.0 one.
            ring = [tuple(round(value, 6) + 0.0 for value in mark) for mark in contour.marks]
            first = ring.index(min(ring))
            rings.append(ring[first:] + ring[:first])
        return hashlib.sha256(repr(sorted(rings)).encode()).hexdigest()[:16]

    @cached_attribute
    def _hash(self) -> int:
        return hash(tuple(sorted(len(contour.marks) for contour in self.contours)))

    def __hash__(self) -> int:
        return self._hash

    def exact_hash(self) -> int:
        """Return a hash of the contours' exact numbers, in their order."""
        return self._exact_hash

    @cached_attribute
    def _exact_hash(self) -> int:
        return hash(tuple([contour.start_hash for contour in self.contours]))

    def is_exactly(self, other: object) -> bool:
        """Whether the other region has the very same contours, in the same order."""
        return isinstance(other, Region) and (
            self.contours is other.contours
            or [contour.edges for contour in self.contours]
            == [contour.edges for contour in other.contours]
        )

    def __eq__(self, other: object) -> bool:
        """Whether the same corners and arcs lie within SAME of each other, wherever they start."""
        if not isinstance(other, Region) or len(self.contours) != len(other.contours):
            return False
        if self is other:
            return True
        left = list(other.contours)
        for contour in self.contours:
            twin = next((c for c in left if contour.coincides(c)), None)
            if twin is None:
                return False
            left.remove(twin)
        return True

    def contains(self, p: Point) -> bool:
        """Whether ``p``, not on an edge, lies in the region."""
        return sum(contour.winding(p) for contour in self.contours) > 0

    def distance_to_edge(self, p: Point) -> float:
        """Least distance in mm from ``p`` to any edge."""
        if len(self.edges) >= 2 * MANY:
            return self.index.distance(p)
        x, y = p
        least = math.inf
        for contour in self.contours:
            left, low, right, high = contour.bounds
            room = least + EPSILON
            if left - x > room or x - right > room or low - y > room or y - high > room:
                continue
            for edge, (left, low, right, high) in zip(contour.edges, contour.boxes, strict=True):
                room = least + EPSILON
                if left - x > room or x - right > room or low - y > room or y - high > room:
                    continue
                least = min(least, distance_to(edge, p))
        return least

    def __or__(self, other: Region) -> Region:
        from sbafab.geometry.boolean import union

        return union([self, other])

    def __and__(self, other: Region) -> Region:
        from sbafab.geometry.boolean import intersection

        return intersection(self, other)

    def __sub__(self, other: Region) -> Region:
        from sbafab.geometry.boolean import difference

        return difference(self, other)

    def mapped(self, point: Similarity, scale: float, mirror: bool) -> Region:
        """The region under a similarity given by its effect on points."""
        return Region(tuple([one.mapped(point, scale, mirror) for one in self.contours]))

    def moved(self, dx: float, dy: float) -> Region:
        """The region moved by so many mm along x and y."""
        return self.mapped(shift(dx, dy), 1.0, False)

    def turned(self, degrees: float, about: Point = (0.0, 0.0)) -> Region:
        """The region turned counter-clockwise; quarter turns are exact."""
        return self.mapped(turn(unit(degrees), about), 1.0, False)

    def scaled(self, factor: float) -> Region:
        return self.mapped(scale(factor), factor, False)

    def mirrored(self) -> Region:
        """The region flipped over: x becomes -x."""
        return self.mapped(flip, 1.0, True)

    def shapely(self, chord_error: float = 0.001) -> shapely.MultiPolygon:
        """The region for shapely; chords stay within ``chord_error`` mm of the arcs."""
        import shapely

        pieces = self.polygons(chord_error)
        return shapely.MultiPolygon([(outer, holes) for outer, *holes in pieces])

    @property
    def __geo_interface__(self) -> dict[str, object]:
        """A MultiPolygon in the terms of GeoJSON; chords stay within 1 um of the arcs."""
        rings = [[[*ring, ring[0]] for ring in piece] for piece in self.polygons()]
        return {"type": "MultiPolygon", "coordinates": rings}

    def polygons(self, sagitta: float = 0.001) -> list[list[list[Point]]]:
        """Each piece as rings of points, outer first; chords within ``sagitta`` mm of the arcs."""
        return [
            [contour.polygon(sagitta) for contour in (*piece.outers, *piece.holes)]
            for piece in self.pieces
        ]


# Similarities of the plane, by what they do to points.


Similarity = Callable[[Point], Point]


def shift(dx: float, dy: float) -> Similarity:
    return lambda p: (p[0] + dx, p[1] + dy)


def turn(direction: Point, about: Point) -> Similarity:
    """What turns the x axis into a direction."""
    (c, s), (ax, ay) = direction, about
    return lambda p: (
        ax + (p[0] - ax) * c - (p[1] - ay) * s,
        ay + (p[0] - ax) * s + (p[1] - ay) * c,
    )


def scale(factor: float) -> Similarity:
    return lambda p: (p[0] * factor, p[1] * factor)


def flip(p: Point) -> Point:
    """What makes x -x."""
    return -p[0], p[1]


# The centre of area of a region.


def centroid(region: Region) -> Point:
    """Centre of area of a region that is not empty."""
    x, y = region.edges[0].start
    mx = my = 0.0
    for edge in region.edges:
        dx, dy = _moment(edge, (x, y))
        mx, my = mx + dx, my + dy
    return x + mx / region.area, y + my / region.area


def _moment(edge: Edge, origin: Point) -> Point:
    """First moment of the triangle from ``origin`` to the edge's chord, and of what lies between
    chord and arc.
    """
    ox, oy = origin
    (x0, y0), (x1, y1) = edge.start, edge.end
    x0, y0, x1, y1 = x0 - ox, y0 - oy, x1 - ox, y1 - oy
    area = (x0 * y1 - x1 * y0) / 2
    mx, my = area * (x0 + x1) / 3, area * (y0 + y1) / 3
    if not isinstance(edge, Arc):
        return mx, my
    # A circular segment: (2/3) r^3 sin^3(sweep/2) from the circle's centre, along its axis.
    (cx, cy), (px, py) = edge.centre, edge.at(0.5)
    lever = 2 / 3 * edge.radius**2 * math.sin(edge.sweep / 2) ** 3
    segment = edge.segment_area
    return (
        mx + segment * (cx - ox) + lever * (px - cx),
        my + segment * (cy - oy) + lever * (py - cy),
    )


# The primitive profiles: disc, rectangle, stadium, polygon.


@lru_cache(maxsize=256)
def circle(centre: Point, radius: float) -> Contour:
    """A full circle, counter-clockwise, as four quarter arcs.

    The same one for all layers that a bore goes through, with what is known of it.
    """
    x, y = centre
    compass = [(x + radius, y), (x, y + radius), (x - radius, y), (x, y - radius)]
    contour = Contour(
        tuple([Arc(compass[i], compass[(i + 1) % 4], centre, radius, True) for i in range(4)])
    )
    # Known without a look at the arcs.
    contour.__dict__.update(
        circle=(centre, radius),
        area=math.pi * radius * radius,
        length=math.tau * radius,
        bounds=(x - radius, y - radius, x + radius, y + radius),
    )
    return contour


def disc(centre: Point, radius: float) -> Region:
    return Region((circle(centre, radius),))


def polygon(points: Sequence[Point]) -> Region:
    """The region inside straight edges through ``points``, in either order."""
    contour = Contour(
        tuple(Line(points[i], points[(i + 1) % len(points)]) for i in range(len(points)))
    )
    return Region((contour if contour.area > 0 else contour.reversed(),))


def rectangle(low: Point, high: Point) -> Region:
    return polygon([low, (high[0], low[1]), high, (low[0], high[1])])


def strip(start: Point, end: Point, width: float) -> Region:
    """A straight strip of the given width with square ends."""
    length = math.dist(start, end)
    nx = -(end[1] - start[1]) / length * width / 2
    ny = (end[0] - start[0]) / length * width / 2
    return polygon(
        [
            (start[0] + nx, start[1] + ny),
            (start[0] - nx, start[1] - ny),
            (end[0] - nx, end[1] - ny),
            (end[0] + nx, end[1] + ny),
        ]
    )


def stadium(centre: Point, width: float, length: float) -> Region:
    """A slot shape ``width`` across x and ``length`` along y; a disc where they are equal."""
    x, y = centre
    r = width / 2
    half = length / 2 - r
    if half <= 0:
        return disc(centre, r)
    top, bottom = (x, y + half), (x, y - half)
    right_low, right_high = (x + r, bottom[1]), (x + r, top[1])
    left_low, left_high = (x - r, bottom[1]), (x - r, top[1])
    return Region(
        (
            Contour(
                (
                    Line(right_low, right_high),
                    Arc(right_high, (x, top[1] + r), top, r, True),
                    Arc((x, top[1] + r), left_high, top, r, True),
                    Line(left_high, left_low),
                    Arc(left_low, (x, bottom[1] - r), bottom, r, True),
                    Arc((x, bottom[1] - r), right_low, bottom, r, True),
                )
            ),
        )
    )


# Where a straight line runs inside a region.


Interval = tuple[float, float]
NEAR = 1e-3
"""mm: far more than the tolerance within which a line touches an edge."""


def section(region: Region, origin: Point, direction: Point) -> list[Interval]:
    """The stretches of a line inside the region, as distances in mm from ``origin``.

    ``direction`` is a unit vector. The line may touch an edge but must not run along one.
    """
    if region.is_empty:
        return []
    (ox, oy), (ux, uy) = origin, direction
    low_x, low_y, high_x, high_y = region.bounds
    reach = max(math.dist(origin, (x, y)) for x in (low_x, high_x) for y in (low_y, high_y)) + 1.0
    line = Line((ox - reach * ux, oy - reach * uy), (ox + reach * ux, oy + reach * uy))
    stops = sorted(
        (x - ox) * ux + (y - oy) * uy
        for contour in region.contours
        for edge, box in zip(contour.edges, contour.boxes, strict=True)
        if _may_meet(box, origin, direction)
        for x, y in meeting_points(edge, line)
    )
    inside: list[Interval] = []
    for start, end in pairwise(stops):
        middle = (start + end) / 2
        if end - start < 2 * EPSILON:
            continue
        if not region.contains((ox + middle * ux, oy + middle * uy)):
            continue
        if inside and start - inside[-1][1] < 2 * EPSILON:
            inside[-1] = (inside[-1][0], end)
        else:
            inside.append((start, end))
    return inside


def _may_meet(box: Bounds, origin: Point, direction: Point) -> bool:
    """Whether a line comes into a box, or so near that it could touch what is in it."""
    (ox, oy), (ux, uy) = origin, direction
    left, low, right, high = box
    off = ux * ((low + high) / 2 - oy) - uy * ((left + right) / 2 - ox)
    return abs(off) <= (abs(ux) * (high - low) + abs(uy) * (right - left)) / 2 + NEAR


# Contours that are copies of each other: what holds for the shape of one holds for all.


COPIED = 1e-8
"""mm: ten times what the numbers of a file are rounded by; far below what tells edges apart."""


class Copies:
    """Contours, each found to be a copy of an earlier one that lies elsewhere, or the first."""

    def __init__(self) -> None:
        self._known: dict[tuple[int, ...], list[tuple[list[float], Contour]]] = defaultdict(list)
        self._firsts: dict[int, tuple[Contour, Contour]] = {}

    def first(self, contour: Contour) -> Contour:
        """The first contour that this one is a copy of, edge by edge, moved: itself if none is.

        Ends, centres and radii agree within ``COPIED``.
        """
        if id(contour) not in self._firsts:
            self._firsts[id(contour)] = contour, self._found(contour)
        return self._firsts[id(contour)][1]

    def _found(self, contour: Contour) -> Contour:
        ox, oy = contour.edges[0].start
        numbers: list[float] = []
        for edge in contour.edges:
            x, y = edge.start
            numbers += (x - ox, y - oy)
            if isinstance(edge, Arc):
                (x, y), radius = edge.centre, edge.radius
                numbers += (x - ox, y - oy, radius if edge.ccw else -radius)
        left, low, right, high = contour.bounds
        # What copies nearly always agree in tells most others apart.
        sizes = round(100 * (right - left)), round(100 * (high - low))
        filed = self._known[len(contour.edges), len(numbers), *sizes]
        for others, first in filed:
            if max(map(abs, map(sub, numbers, others))) < COPIED:
                return first
        filed.append((numbers, contour))
        return contour

    def lying(self, contour: Contour) -> tuple[int, Point]:
        """A number of the contour's shape, and where it lies: its centre, or where it starts."""
        if contour.circle is not None:
            centre, radius = contour.circle
            return -round(radius / COPIED), centre
        return id(self.first(contour)), contour.edges[0].start


def between(a: Point, b: Point) -> tuple[int, int]:
    """How the second of two points lies to the first, in ``COPIED``."""
    return round((b[0] - a[0]) / COPIED), round((b[1] - a[1]) / COPIED)


# SVG path data of regions: lines as L, arcs as A, nothing flattened.


def path_data(region: Region) -> str:
    """The ``d`` of an SVG path in mm, y up (the caller flips); holes by either fill rule."""
    return " ".join(map(_contour_data, region.contours))


def coord(value: float) -> str:
    """A length to the nanometre without trailing zeros."""
    text = f"{value:.6f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def _contour_data(contour: Contour) -> str:
    commands = [f"M{_point(contour.edges[0].start)}", *map(_command, contour.edges), "Z"]
    return "".join(commands)


def _command(edge: Edge) -> str:
    if not isinstance(edge, Arc):
        return f"L{_point(edge.end)}"
    radius = coord(edge.radius)
    large = int(abs(edge.sweep) > math.pi + 1e-9)
    return f"A{radius} {radius} 0 {large} {int(edge.ccw)} {_point(edge.end)}"


def _point(p: Point) -> str:
    return f"{coord(p[0])} {coord(p[1])}"
