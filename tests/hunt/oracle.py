"""What a boolean or an offset must be, from shapely on fine chords and from single points.

Areas are compared with shapely's; what chords and snapping may take off or add is ``error``. Points
beside the edges are asked one by one: a winding number for booleans, a distance for offsets.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from random import Random

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from sbafab.errors import GeometryError
from sbafab.geometry.boolean import arranged, bounding
from sbafab.geometry.contour import LEAST_AREA
from sbafab.geometry.edges import EPSILON, Arc, Edge, Point, left_normal
from sbafab.geometry.offset import grow
from sbafab.geometry.region import Region, difference, intersection, union

Floats = NDArray[np.float64]
Counts = NDArray[np.intp]

SAGITTA = 1e-4
"""mm a chord may leave its arc."""
SNAPPED = 2e-5
"""mm an edge may be moved by snapping; nearer to an edge no point is asked."""
DUST = 1e-6
"""mm2 of contours that may be left out as dust."""
FINE = 1e-7
QUADRANT = 64
OPERATIONS = {
    "or": (lambda a, b: union([a, b]), lambda a, b: a or b, shapely.union),
    "and": (intersection, lambda a, b: a and b, shapely.intersection),
    "minus": (difference, lambda a, b: a and not b, shapely.difference),
    "from": (lambda a, b: difference(b, a), lambda a, b: b and not a,
             lambda a, b: shapely.difference(b, a)),
}  # fmt: skip


def flat(region: Region, sagitta: float = SAGITTA) -> BaseGeometry:
    """The region with chords for arcs: what an odd number of its contours hold."""
    if region.is_empty:
        return Polygon()
    edges = [edge for contour in region.contours for edge in contour.edges]
    points, counts = chords(edges, sagitta)
    owner = np.repeat(np.arange(len(region.contours)), [len(c.edges) for c in region.contours])
    first = np.unique(owner, return_index=True)[1]
    starts = (np.cumsum(counts) - counts)[first]
    closed = np.insert(points, [*starts[1:], len(points)], points[starts], axis=0)
    number = np.repeat(np.arange(len(starts)), np.diff([*starts, len(points)]) + 1)
    rings = shapely.linearrings(closed, indices=number)
    # Where no two rings cross, what lies within the widest and in no other is the same.
    order = np.argsort([-shapely.Polygon(ring).area for ring in rings])
    whole = shapely.Polygon(rings[order[0]], list(rings[order[1:]]))
    if whole.is_valid:
        return whole
    solid: BaseGeometry = Polygon()
    for ring in shapely.polygons(rings):
        solid = shapely.symmetric_difference(solid, shapely.make_valid(ring))
    return solid


def chords(edges: Sequence[Edge], sagitta: float) -> tuple[Floats, Counts]:
    """The points that stand for edges without their ends, and how many each of them has.

    Worked out from the arcs alone, not by the program's own way of making chords.
    """
    radius = np.array([edge.radius if isinstance(edge, Arc) else 1.0 for edge in edges])
    sweep = np.array([edge.sweep if isinstance(edge, Arc) else 0.0 for edge in edges])
    centre = np.array([edge.centre if isinstance(edge, Arc) else (0.0, 0.0) for edge in edges])
    start = np.array([edge.start for edge in edges])
    step = 2 * np.sqrt(2 * np.minimum(1.0, sagitta / radius))
    counts = np.where(sweep == 0, 1, np.maximum(2, np.ceil(np.abs(sweep) / step))).astype(int)
    own = np.repeat(np.arange(len(edges)), counts)
    part = np.arange(len(own)) - np.repeat(np.cumsum(counts) - counts, counts)
    angle = np.arctan2(*(start - centre).T[::-1])[own] + sweep[own] * part / counts[own]
    on_circle = centre[own] + radius[own, None] * np.array([np.cos(angle), np.sin(angle)]).T
    return np.where((part == 0)[:, None], start[own], on_circle), counts


def laid_over(edges: Iterable[Edge], above: int = 0) -> Region:
    """What closed chains wind round more than ``above`` times, every edge cut where it is met."""
    return Region(tuple(arranged([edges], lambda it: bounding(it, lambda turns: turns > above))))


def perimeter(*regions: Region) -> float:
    return sum(contour.length for region in regions for contour in region.contours)


def chord_area(region: Region) -> float:
    """Upper bound of the area between the region's arcs and their chords."""
    return SAGITTA * sum(edge.length for edge in region.edges if edge.bulge)


def complaint(what: str, a: Region, b: Region, random: Random) -> str | None:
    """What is wrong with a boolean of two regions, if anything."""
    try:
        result = OPERATIONS[what][0](a, b)
    except GeometryError as error:
        return f"refused: {error}"
    return fault(what, a, b, result, random)


def fault(what: str, a: Region, b: Region, result: Region, random: Random) -> str | None:
    """What is wrong with the result of a boolean, if anything."""
    _, logic, theirs = OPERATIONS[what]
    broken = unsound(result)
    if broken:
        return broken
    for p in beside((*a.edges, *b.edges), random):
        if result.contains(p) == logic(a.contains(p), b.contains(p)):
            continue
        if min(a.distance_to_edge(p), b.distance_to_edge(p)) < SNAPPED:
            continue
        if not left_out(theirs(flat(a, FINE), flat(b, FINE)), result, p):
            return f"wrong at {p[0]:.7f}, {p[1]:.7f}"
    expected = theirs(flat(a), flat(b)).area
    room = chord_area(a) + chord_area(b) + SNAPPED * perimeter(a, b) + DUST
    if abs(result.area - expected) > room:
        return f"wrong area {result.area:.9g}, shapely's is {expected:.9g} within {room:.2g}"
    return None


def left_out(expected: BaseGeometry, result: Region, p: Point) -> bool:
    """Whether ``p`` lies in what is so small or thin that it may be left out, or filled."""
    apart = shapely.symmetric_difference(expected, flat(result, FINE))
    parts = [part for part in shapely.get_parts(apart) if part.distance(shapely.Point(p)) < FINE]
    return all(part.area < max(LEAST_AREA, 2 * EPSILON * part.length) for part in parts)


def beside(edges: Sequence[Edge], random: Random) -> Iterator[Point]:
    """Points on both sides of some edges, 0.03 um to 0.1 mm off."""
    for edge in random.sample(edges, min(len(edges), 8)):
        x, y = edge.at(random.choice([0.5, random.random()]))
        nx, ny = left_normal(edge, (x, y))
        off = 3e-5 * 3000 ** random.random()
        yield x + off * nx, y + off * ny
        yield x - off * nx, y - off * ny


def unsound(region: Region) -> str | None:
    """A contour that is not closed, or an edge with no length, if there is one."""
    for contour in region.contours:
        for edge, after in zip(contour.edges, (*contour.edges[1:], contour.edges[0]), strict=True):
            if edge.end != after.start:
                return "unsound: a contour is open"
            if edge.start == edge.end or not math.isfinite(edge.length):
                return "unsound: an edge has no length"
    return None


def offset_complaint(region: Region, distance: float, random: Random) -> str | None:
    """What is wrong with a region grown by ``distance`` (shrunk if negative), if anything."""
    try:
        result = grow(region, distance)
    except GeometryError as error:
        return f"refused: {error}"
    return offset_fault(region, distance, result, random)


def offset_fault(region: Region, distance: float, result: Region, random: Random) -> str | None:
    """What is wrong with what a region grown by ``distance`` came out as, if anything."""
    broken = unsound(result)
    if broken:
        return broken
    reach, sign = abs(distance), 1 if distance > 0 else -1
    for edge in result.edges:
        p = edge.at(0.5)
        if abs(region.distance_to_edge(p) - reach) > SNAPPED or region.contains(p) == (sign > 0):
            return f"wrong: an edge at {p[0]:.7f}, {p[1]:.7f} is not {reach:g} off"
    for edge in random.sample(region.edges, min(len(region.edges), 8)):
        q = edge.at(random.choice([0.5, random.random()]))
        nx, ny = left_normal(edge, q)
        for off in (-0.5 * reach, SNAPPED * 2 - reach, -reach - SNAPPED * 2, reach):
            p = (q[0] + sign * off * nx, q[1] + sign * off * ny)
            away = region.distance_to_edge(p)
            if abs(away - reach) < SNAPPED or away < SNAPPED:
                continue
            inside = region.contains(p)
            expected = inside or away < reach if sign > 0 else inside and away > reach
            if result.contains(p) == expected:
                continue
            moved = flat(region, FINE).buffer(distance, quad_segs=QUADRANT)
            if not left_out(moved, result, p):
                return f"wrong at {p[0]:.7f}, {p[1]:.7f}"
    shape = flat(region)
    # Where a gap is just as wide as the distance, a hair more or less decides: both are right.
    reaches = [distance * (1 + part) for part in (-1e-3, 0, 1e-3)]
    areas = [shape.buffer(r, quad_segs=QUADRANT).area for r in reaches]
    # Shapely first drops detail of up to a hundredth of the distance: a little of it is allowed.
    corners = 2 * math.pi * reach * reach / QUADRANT**2
    room = (
        chord_area(region)
        + 1e-3 * reach * perimeter(region)
        + SNAPPED * perimeter(region, result)
        + corners * (1 + len(region.edges)) + DUST
    )  # fmt: skip
    if not min(areas) - room <= result.area <= max(areas) + room:
        areas = [buffered_by_edges(shape, r).area for r in reaches]
    if not min(areas) - room <= result.area <= max(areas) + room:
        return f"wrong area {result.area:.9g}, shapely's is {areas[1]:.9g} within {room:.2g}"
    return None


def buffered_by_edges(shape: BaseGeometry, distance: float) -> BaseGeometry:
    """The shape grown or shrunk by what lies near each of its edges: nothing is dropped first."""
    xy, owner = shapely.get_coordinates(shapely.get_parts(shape.boundary), return_index=True)
    follows = owner[1:] == owner[:-1]
    lines = shapely.linestrings(np.stack([xy[:-1][follows], xy[1:][follows]], axis=1))
    band = shapely.union_all(shapely.buffer(lines, abs(distance), quad_segs=QUADRANT))
    return shape.union(band) if distance > 0 else shape.difference(band)
