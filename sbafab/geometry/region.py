"""Planar regions bounded by lines and arcs: booleans, primitive profiles, sections, SVG paths.

Contours of one region never cross. Everything here is immutable; operators return new regions.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

from sbafab.geometry.boolean import combined, more_than
from sbafab.geometry.cache import cached
from sbafab.geometry.contour import (
    Contour,
    Similarity,
    circle,
)
from sbafab.geometry.edges import (
    EPSILON,
    Arc,
    Bounds,
    Edge,
    Line,
    Point,
    box_round,
    meeting_points,
    unit,
)
from sbafab.geometry.spatial_index import EdgeIndex, close_pairs

if TYPE_CHECKING:
    import shapely


@dataclass(frozen=True)
class Region:
    """A planar region, possibly of several pieces, possibly empty."""

    contours: tuple[Contour, ...] = ()

    @cached_property
    def area(self) -> float:
        """Area in mm2."""
        return sum(contour.area for contour in self.contours)

    @cached_property
    def bounds(self) -> Bounds:
        """Least x, least y, largest x, largest y, mm."""
        return box_round([contour.bounds for contour in self.contours])

    @property
    def is_empty(self) -> bool:
        return not self.contours

    @cached_property
    def outers(self) -> tuple[Contour, ...]:
        """The outer contours, counter-clockwise."""
        return tuple(contour for contour in self.contours if not contour.is_hole)

    @cached_property
    def holes(self) -> tuple[Contour, ...]:
        """The contours of holes, clockwise."""
        return tuple(contour for contour in self.contours if contour.is_hole)

    @cached_property
    def edges(self) -> tuple[Edge, ...]:
        return tuple(edge for contour in self.contours for edge in contour.edges)

    @cached_property
    def index(self) -> EdgeIndex:
        """The spatial index of the edges."""
        return EdgeIndex(self.edges, [box for contour in self.contours for box in contour.boxes])

    @property
    def pieces(self) -> tuple[Region, ...]:
        """The connected pieces, each an outer contour with its holes."""
        # A region must not store itself: it would be freed late.
        return (self,) if len(self.outers) == 1 else self._several

    @cached_property
    def _several(self) -> tuple[Region, ...]:
        groups: list[list[Contour]] = [[outer] for outer in self.outers]
        places = [hole.edges[0].at(0.5) for hole in self.holes]
        boxes = [*(outer.bounds for outer in self.outers), *((*p, *p) for p in places)]
        near: list[list[int]] = [[] for _ in places]
        for pair in close_pairs(boxes, 0.0):
            outer, hole = min(pair), max(pair) - len(groups)
            if outer < len(groups) and hole >= 0:
                near[hole].append(outer)
        for contour, place, numbers in zip(self.holes, places, near, strict=True):
            enclosing = [
                groups[number]
                for number in sorted(numbers)
                if groups[number][0].winding(place) != 0 and groups[number][0].area > -contour.area
            ]
            min(enclosing, key=lambda group: group[0].area).append(contour)
        return tuple(Region(tuple(group)) for group in groups)

    @cached_property
    def key(self) -> str:
        """A name for the shape, from its corners rounded to 1 nm; the same on every machine."""
        rings = []
        for contour in self.contours:
            # Adding 0.0 turns -0.0 into 0.0.
            ring = [tuple(round(value, 6) + 0.0 for value in mark) for mark in contour.marks]
            first = ring.index(min(ring))
            rings.append(ring[first:] + ring[:first])
        return hashlib.sha256(repr(sorted(rings)).encode()).hexdigest()[:16]

    @cached_property
    def _hash(self) -> int:
        return hash(tuple(sorted(len(contour.marks) for contour in self.contours)))

    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def exact_hash(self) -> int:
        """A hash of the exact coordinates of the contours, in order."""
        return hash(tuple([contour.start_hash for contour in self.contours]))

    def is_exactly(self, other: object) -> bool:
        """Return True if the other region has exactly the same contours, in the same order."""
        return isinstance(other, Region) and (
            self.contours is other.contours
            or [contour.edges for contour in self.contours]
            == [contour.edges for contour in other.contours]
        )

    def __eq__(self, other: object) -> bool:
        """True if corners and arcs agree within SAME, regardless of where contours start."""
        if not isinstance(other, Region) or len(self.contours) != len(other.contours):
            return False
        if self is other:
            return True
        candidates = list(other.contours)
        for contour in self.contours:
            twin = next((c for c in candidates if contour.coincides(c)), None)
            if twin is None:
                return False
            candidates.remove(twin)
        return True

    def contains(self, p: Point) -> bool:
        """Return True if ``p``, which must not be on an edge, lies in the region."""
        return sum(contour.winding(p) for contour in self.contours) > 0

    def distance_to_edge(self, p: Point) -> float:
        """Return the least distance in mm from ``p`` to any edge."""
        return self.index.distance(p)

    def __or__(self, other: Region) -> Region:
        return union([self, other])

    def __and__(self, other: Region) -> Region:
        return intersection(self, other)

    def __sub__(self, other: Region) -> Region:
        return difference(self, other)

    def mapped(self, point: Similarity, scale: float, mirror: bool) -> Region:
        """Return the region under a similarity, given as a function of points."""
        return Region(tuple([contour.mapped(point, scale, mirror) for contour in self.contours]))

    def moved(self, dx: float, dy: float) -> Region:
        """Return the region moved by ``dx`` and ``dy`` mm."""
        return self.mapped(lambda p: (p[0] + dx, p[1] + dy), 1.0, False)

    def turned(self, degrees: float, about: Point = (0.0, 0.0)) -> Region:
        """Return the region turned counter-clockwise; quarter turns are exact."""
        (c, s), (ax, ay) = unit(degrees), about

        def turned(p: Point) -> Point:
            x, y = p[0] - ax, p[1] - ay
            return ax + x * c - y * s, ay + x * s + y * c

        return self.mapped(turned, 1.0, False)

    def scaled(self, factor: float) -> Region:
        return self.mapped(lambda p: (p[0] * factor, p[1] * factor), factor, False)

    def mirrored(self) -> Region:
        """Return the region mirrored in the y axis."""
        return self.mapped(lambda p: (-p[0], p[1]), 1.0, True)

    def shapely(self, chord_error: float = 0.001) -> shapely.MultiPolygon:
        """The region as a shapely geometry; chords stay within ``chord_error`` mm of the arcs."""
        # Imported here only.
        import shapely

        pieces = self.polygons(chord_error)
        return shapely.MultiPolygon([(outer, holes) for outer, *holes in pieces])

    def widest_place(self) -> Point:
        """Return the centre of a disc within the region that is within 2e-5 mm of the largest."""
        # Imported here only.
        import shapely

        x, y = shapely.maximum_inscribed_circle(self.shapely(1e-5), 1e-5).coords[0]
        return x, y

    @property
    def __geo_interface__(self) -> dict[str, object]:
        """A GeoJSON MultiPolygon; chords stay within 1 um of the arcs."""
        rings = [[[*ring, ring[0]] for ring in piece] for piece in self.polygons()]
        return {"type": "MultiPolygon", "coordinates": rings}

    def polygons(self, sagitta: float = 0.001) -> list[list[list[Point]]]:
        """Each piece as rings of points, outer first; chords within ``sagitta`` mm of the arcs."""
        return [
            [contour.polygon(sagitta) for contour in (*piece.outers, *piece.holes)]
            for piece in self.pieces
        ]


# Boolean operations.


def union(regions: Iterable[Region]) -> Region:
    solid = [region for region in regions if not region.is_empty]
    if len(solid) < 2:
        return solid[0] if solid else Region()
    return _union(*solid)


@cached
def _union(*regions: Region) -> Region:
    return enclosed([contour for region in regions for contour in region.contours])


def intersection(a: Region, b: Region) -> Region:
    if a.is_empty or b.is_empty:
        return Region()
    return _intersection(a, b)


@cached
def _intersection(a: Region, b: Region) -> Region:
    return enclosed([*a.contours, *b.contours], 1)


def difference(a: Region, b: Region) -> Region:
    if a.is_empty or b.is_empty:
        return a
    return _difference(a, b)


@cached
def _difference(a: Region, b: Region) -> Region:
    chains = [*((contour, 1) for contour in a.contours), *((c, -1) for c in b.contours)]
    (contours,) = combined(chains, [more_than(0)])
    return Region(contours)


def enclosed(contours: Iterable[Contour], above: int = 0) -> Region:
    """Return the points around which closed chains wind more than ``above`` times in total."""
    (outlines,) = combined([(contour, 1) for contour in contours], [more_than(above)])
    return Region(outlines)


def centroid(region: Region) -> Point:
    """Return the area centroid of a region that is not empty."""
    x, y = region.edges[0].start
    mx = my = 0.0
    for edge in region.edges:
        dx, dy = _moment(edge, (x, y))
        mx, my = mx + dx, my + dy
    return x + mx / region.area, y + my / region.area


def _moment(edge: Edge, origin: Point) -> Point:
    """Return the first moment about ``origin`` of the edge's triangle and the arc's segment."""
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


def disc(centre: Point, radius: float) -> Region:
    return Region((circle(centre, radius),))


def polygon(points: Sequence[Point]) -> Region:
    """Return the region inside straight edges through ``points``, in either order."""
    contour = Contour(
        tuple(Line(points[i], points[(i + 1) % len(points)]) for i in range(len(points)))
    )
    return Region((contour if contour.area > 0 else contour.reversed(),))


def rectangle(low: Point, high: Point) -> Region:
    return polygon([low, (high[0], low[1]), high, (low[0], high[1])])


def strip(start: Point, end: Point, width: float) -> Region:
    """Return a straight strip of the given width with square ends."""
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
    """Return a slot ``width`` across x and ``length`` along y; a disc if they are equal."""
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


# Sections of regions by straight lines.


Interval = tuple[float, float]
NEAR = 1e-3
"""mm: far more than the tolerance within which a line touches an edge."""


def section(region: Region, origin: Point, direction: Point) -> list[Interval]:
    """Return the stretches of a line inside the region, as distances in mm from ``origin``."""
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
    """Return True if a line enters a box, or comes near enough to touch an edge in it."""
    (ox, oy), (ux, uy) = origin, direction
    low_x, low_y, high_x, high_y = box
    off = ux * ((low_y + high_y) / 2 - oy) - uy * ((low_x + high_x) / 2 - ox)
    return abs(off) <= (abs(ux) * (high_y - low_y) + abs(uy) * (high_x - low_x)) / 2 + NEAR


# SVG path data: lines as L, arcs as A, nothing flattened.


def path_data(region: Region) -> str:
    """Return the ``d`` of an SVG path in mm, y up (the caller flips); holes by either fill rule."""
    return " ".join(map(_contour_data, region.contours))


def coord(value: float) -> str:
    """Return a length to the nanometre without trailing zeros."""
    text = f"{value:.6f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def chain_data(edges: Sequence[Edge]) -> str:
    """Return the ``d`` of an SVG path along a chain of edges, in mm, y up."""
    return "".join([f"M{_point(edges[0].start)}", *map(_command, edges)])


def _contour_data(contour: Contour) -> str:
    return f"{chain_data(contour.edges)}Z"


def _command(edge: Edge) -> str:
    if not isinstance(edge, Arc):
        return f"L{_point(edge.end)}"
    radius = coord(edge.radius)
    large = int(abs(edge.sweep) > math.pi + 1e-9)
    return f"A{radius} {radius} 0 {large} {int(edge.ccw)} {_point(edge.end)}"


def _point(p: Point) -> str:
    return f"{coord(p[0])} {coord(p[1])}"
