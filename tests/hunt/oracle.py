"""What a boolean or an offset must be, from shapely on fine chords and from single points.

Areas are compared with shapely's; what chords and snapping may take off or add is ``error``. Points
beside the edges are asked one by one: a winding number for booleans, a distance for offsets.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from random import Random

import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from sbafab.geometry.boolean import LEAST_AREA, GeometryError, difference, intersection, union
from sbafab.geometry.edges import EPSILON, Edge, Point, left_normal
from sbafab.geometry.offset import grow
from sbafab.geometry.region import Region

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
    solid: BaseGeometry = Polygon()
    for contour in region.contours:
        ring = Polygon(contour.polygon(sagitta))
        solid = shapely.symmetric_difference(solid, shapely.make_valid(ring))
    return solid


def perimeter(*regions: Region) -> float:
    return sum(contour.length for region in regions for contour in region.contours)


def chord_area(region: Region) -> float:
    """Upper bound of the area between the region's arcs and their chords."""
    return SAGITTA * sum(edge.length for edge in region.edges if edge.bulge)


def complaint(what: str, a: Region, b: Region, random: Random) -> str | None:
    """What is wrong with a boolean of two regions, if anything."""
    ours, logic, theirs = OPERATIONS[what]
    try:
        result = ours(a, b)
    except GeometryError as error:
        return f"refused: {error}"
    broken = unsound(result)
    if broken:
        return broken
    for x, y in beside((*a.edges, *b.edges), random):
        if min(a.distance_to_edge((x, y)), b.distance_to_edge((x, y))) < SNAPPED:
            continue
        if result.contains((x, y)) == logic(a.contains((x, y)), b.contains((x, y))):
            continue
        if not left_out(theirs(flat(a, FINE), flat(b, FINE)), result, (x, y)):
            return f"wrong at {x:.7f}, {y:.7f}"
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
    areas = [
        shape.buffer(distance * (1 + part), quad_segs=QUADRANT).area for part in (-1e-3, 0, 1e-3)
    ]
    # Shapely first drops detail of up to a hundredth of the distance.
    corners = 2 * math.pi * reach * reach / QUADRANT**2
    room = (
        chord_area(region)
        + 1e-3 * reach * perimeter(region)
        + SNAPPED * perimeter(region, result)
        + corners * (1 + len(region.edges)) + DUST
    )  # fmt: skip
    if not min(areas) - room <= result.area <= max(areas) + room:
        return f"wrong area {result.area:.9g}, shapely's is {areas[1]:.9g} within {room:.2g}"
    return None
