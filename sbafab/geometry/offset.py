"""Offsets of regions that preserve arcs: growing and shrinking, and the path of a beam."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Iterator, Sequence
from itertools import accumulate, pairwise
from typing import Literal, NamedTuple

from sbafab.errors import GeometryError
from sbafab.geometry.arcs import Curve, biarc, edge_through
from sbafab.geometry.boolean import FAR, alone, meets_itself
from sbafab.geometry.cache import cached
from sbafab.geometry.contour import Contour, circle
from sbafab.geometry.edges import (
    EPSILON,
    SAME,
    Arc,
    Edge,
    Line,
    Point,
    distance_to,
    left_turn,
)
from sbafab.geometry.region import Region, enclosed, union
from sbafab.geometry.spatial_index import EdgeIndex, widened

CUSP = 3.0
"""Radians: a path that turns by more is treated as turning back on itself."""


def grow(region: Region, distance: float) -> Region:
    """All points within ``distance`` of the region (round at its corners); shrinks if negative."""
    if distance < 0:
        return shrink(region, -distance)
    if distance < EPSILON or region.is_empty:
        return region
    return _grown(region, distance)


@cached
def _grown(region: Region, distance: float) -> Region:
    chains = [_chain(contour, distance) for contour in region.contours]
    return enclosed([chain for chain in chains if chain.edges])


def shrink(region: Region, distance: float) -> Region:
    """Return the points at least ``distance`` inside the region."""
    if distance < 0:
        return grow(region, -distance)
    if distance < EPSILON or region.is_empty:
        return region
    return _shrunk(region, distance)


@cached
def _shrunk(region: Region, distance: float) -> Region:
    # The outside grows: its winding number is 0 or more, and -1 in the remaining material.
    outside = [contour.reversed() for contour in region.contours]
    chains = [_chain(contour, distance) for contour in outside]
    return enclosed([chain.reversed() for chain in chains if chain.edges])


def fillet(region: Region, radius: float) -> Region:
    """Return the region with concave corners rounded to ``radius`` and narrower gaps filled."""
    return shrink(grow(region, radius), radius)


def _chain(contour: Contour, distance: float) -> Contour:
    """A closed chain that winds around the contour's inside and the bands beside its edges."""
    if contour.circle is not None and alone(contour):
        centre, radius = contour.circle
        radius += -distance if contour.is_hole else distance
        if radius > FAR:
            return circle(centre, radius).reversed() if contour.is_hole else circle(centre, radius)
    moved = list(_moved(contour, distance))
    chain = Contour(tuple(_joined_up(moved)))
    corners = {edge.start for edge in contour.edges}
    # A path through a corner meets itself there.
    return meets_itself(chain) if any(edge.end in corners for edge in moved) else chain


def _joined_up(edges: Sequence[Edge]) -> Iterator[Edge]:
    """Yield the edges with ends merged if they differ only by rounding."""
    starts = [edge.start for edge in edges]
    for i, start in enumerate(starts):
        end = edges[i - 1].end
        if end < start and math.dist(end, start) < EPSILON:
            starts[i] = end
    for edge, start, following in zip(edges, starts, (*starts[1:], *starts[:1]), strict=True):
        end = following if math.dist(edge.end, following) < EPSILON else edge.end
        yield edge if start == edge.start and end == edge.end else edge.part(start, end)


def _moved(contour: Contour, distance: float) -> Iterator[Edge]:
    """Yield the edges of the chain described in ``_chain``.

    The band of an edge reaches ``distance`` to its right. Bands that overlap at a corner are
    traversed one by one through the corner, or straight on if both cover the difference.
    """
    edges = contour.edges
    moved = [edge.offset(distance) for edge in edges]
    for i, edge in enumerate(edges):
        before, after = moved[i - 1], moved[i]
        start = before.end if before is not None else _centre(edges[i - 1])
        end = after.start if after is not None else _centre(edge)
        corner = edge.start
        arcs = list(_corner_arcs(edges[i - 1], edge, distance))
        way: list[Edge] = list(arcs)
        if arcs:
            stops = [start, arcs[0].start], [arcs[-1].end, end]
            way = [*_lines(stops[0]), *arcs, *_lines(stops[1])]
        elif math.dist(start, end) >= EPSILON:
            way = _lines(
                [start, end] if _both_cover(edges[i - 1], edge, distance) else [start, corner, end]
            )
        yield from way
        if after is not None:
            yield after


def _both_cover(before: Edge, after: Edge, distance: float) -> bool:
    """True if the bands of two lines both hold the triangle of a corner and the adjacent ends."""
    if not (isinstance(before, Line) and isinstance(after, Line)):
        return False
    turn = left_turn(before, after)
    return turn > -1 and min(before.length, after.length) > -distance * math.sin(turn)


def _centre(edge: Edge) -> Point:
    assert isinstance(edge, Arc)
    return edge.centre


def _lines(stops: Sequence[Point]) -> list[Edge]:
    return [Line(a, b) for a, b in pairwise(stops) if math.dist(a, b) > EPSILON]


def _corner_arcs(before: Edge, after: Edge, distance: float) -> Iterator[Arc]:
    """Return the arcs around a convex corner; empty if the path is smooth or turns the other way.

    At the tip of a cusp, rounding decides whether the path turns left or right, so it always gets
    arcs there: at the end of a notch they lie in the material and are discarded.
    """
    turn = left_turn(before, after)
    if -CUSP < turn < EPSILON / distance:
        return
    x, y = after.start
    ux, uy = before.direction(after.start)
    heading, sweep = math.atan2(-ux, uy), turn % math.tau
    count = 2 if sweep > CUSP else 1
    vx, vy = after.direction(after.start)
    between = [heading + sweep * k / count for k in range(1, count)]
    stops = [(uy, -ux), *((math.cos(t), math.sin(t)) for t in between), (vy, -vx)]
    points = [(x + nx * distance, y + ny * distance) for nx, ny in stops]
    for start, end in pairwise(points):
        yield Arc(start, end, (x, y), distance, True)


# The path of a beam of some width: a region grown by half of it.
#
# A beam of equal width along x and y grows a region by a disc, and arcs stay arcs. For an unequal
# one the plane is stretched until the beam is round: straight edges stay straight, and arcs become
# pieces of ellipses, which arcs follow.


Kerf = float | tuple[float, float]
"""Full width of the cut, mm: the same everywhere, or measured along x and along y."""
Fate = Literal["vanishes", "splits in parts", "runs into another"]

FINE, ALONG = 1e-6, 2e-6
"""Farthest an arc may lie off a stretched edge, and off the stretched path, mm."""
SMOOTH, SIMILAR = 1e-6, 2.0
"""Radians a smooth run may turn from arc to arc, and the most that their radii differ by."""
STEP, LEAST_SHARE = math.radians(30), 1e-5
"""Most that a piece turns, and a smaller share of a run than any piece has."""


class Lost(NamedTuple):
    """A contour that the path does not follow exactly once, and the reason."""

    contour: Contour
    fate: Fate


def widths(kerf: Kerf) -> tuple[float, float]:
    """The full width along x and along y."""
    return kerf if isinstance(kerf, tuple) else (kerf, kerf)


def beam_path(region: Region, kerf: Kerf) -> tuple[Region, Lost | None]:
    """Return the path of the beam's centre around ``region``, and the first contour without a
    single path.

    Both widths are 0, or neither is. Raises GeometryError if the offset cannot be computed.
    """
    a, b = (width / 2 for width in widths(kerf))
    reach = max(a, b)
    alone = [[[edge] for edge in contour.edges] for contour in region.contours]
    wide = region if a == b else _stretched(alone, reach / a, reach / b, _smooth)
    path = grown = grow(wide, reach)
    if a != b:
        runs = [_smooth_runs(contour.edges) for contour in grown.contours]
        path = _stretched(runs, a / reach, b / reach, _through)
    return path, _lost(region.contours, wide.contours, grown, reach)


SmoothRun = Sequence[Edge]
"""A line, or arcs that go on from each other smoothly."""
ArcFit = Callable[[Curve, float, float], list[Edge]]
"""Edges along a curve between two parameters; none if they would stray from it."""


def _stretched(
    contours: Sequence[Sequence[SmoothRun]], sx: float, sy: float, fit: ArcFit
) -> Region:
    """Return a region stretched along x and y, with edges fitted to the images of arcs.

    Raises GeometryError for arcs that cannot be fitted.
    """
    images = []
    for runs in contours:
        edges: list[Edge] = []
        x, y = runs[0][0].start
        here = x * sx, y * sy
        for piece in (piece for run in runs for piece in _pieces(run, sx, sy, fit)):
            edges.append(piece.part(here, piece.end))
            here = piece.end
        images.append(Contour(tuple(edges)))
    return Region(tuple(images))


def _pieces(run: SmoothRun, sx: float, sy: float, fit: ArcFit) -> list[Edge]:
    start, end = ((p[0] * sx, p[1] * sy) for p in (run[0].start, run[-1].end))
    arcs = [edge for edge in run if isinstance(edge, Arc)]
    if not arcs or (len(arcs) == 1 and math.dist(start, end) < 2 * SAME):
        return [Line(start, end)]
    image, turn = _image(arcs, sx, sy), sum(abs(arc.sweep) for arc in arcs)

    def follow(here: float, there: float) -> list[Edge]:
        edges = fit(image, here, there)
        if edges:
            return edges
        if there - here < LEAST_SHARE:
            raise GeometryError(
                f"the arc at x {start[0]:.6f}, y {start[1]:.6f} cannot be stretched to the kerf"
            )
        middle = (here + there) / 2
        return [*follow(here, middle), *follow(middle, there)]

    count = max(1, math.ceil(turn / STEP - 1e-9))
    *inner, last = (edge for k in range(count) for edge in follow(k / count, (k + 1) / count))
    return [*inner, last.part(last.start, end)]


def _image(arcs: Sequence[Arc], sx: float, sy: float) -> Curve:
    """The stretched arcs as one curve, with the fraction of their sweep as parameter."""
    turned = list(accumulate(abs(arc.sweep) for arc in arcs))

    def image(share: float) -> tuple[Point, Point]:
        turn = share * turned[-1]
        number = min(bisect_left(turned, turn), len(arcs) - 1)
        arc = arcs[number]
        sign = 1.0 if arc.ccw else -1.0
        angle = arc.start_angle + arc.sweep - sign * (turned[number] - turn)
        (x, y), r, c, s = arc.centre, arc.radius, math.cos(angle), math.sin(angle)
        return (sx * (x + r * c), sy * (y + r * s)), (-sign * sx * r * s, sign * sy * r * c)

    return image


def _smooth(image: Curve, start: float, end: float) -> list[Edge]:
    (p, u), (q, v) = image(start), image(end)
    # A kink would count as a corner. A biarc strays most a sixth from either end.
    pair = biarc(p, _unit(u), q, _unit(v), 0.0)
    places = [image(start + share * (end - start))[0] for share in (1 / 6, 5 / 6)]
    return pair if max(map(distance_to, pair, places), default=FINE) < FINE else []


def _through(image: Curve, start: float, end: float) -> list[Edge]:
    p, a, middle, b, q = (
        image(start + share * (end - start))[0] for share in (0.0, 0.2, 0.5, 0.8, 1.0)
    )
    edge = edge_through(p, middle, q)
    return [edge] if max(distance_to(edge, a), distance_to(edge, b)) < ALONG else []


def _unit(way: Point) -> Point:
    size = math.hypot(*way)
    return way[0] / size, way[1] / size


def _smooth_runs(edges: Sequence[Edge]) -> list[list[Edge]]:
    """Lines, and runs of arcs that join without a corner and with little change of curvature."""
    count = len(edges)
    starts = [i for i in range(count) if not _goes_on(edges[i - 1], edges[i])] or [0]
    stops = [*starts[1:], starts[0] + count]
    return [[edges[k % count] for k in range(i, j)] for i, j in zip(starts, stops, strict=True)]


def _goes_on(before: Edge, after: Edge) -> bool:
    return (
        isinstance(before, Arc)
        and isinstance(after, Arc)
        and before.ccw == after.ccw
        and abs(left_turn(before, after)) < SMOOTH
        and 1 / SIMILAR < before.radius / after.radius < SIMILAR
    )


def _lost(
    originals: Sequence[Contour], stretched: Sequence[Contour], grown: Region, reach: float
) -> Lost | None:
    near = EdgeIndex([edge for contour in stretched for edge in contour.edges])
    owners = [n for n, contour in enumerate(stretched) for _ in contour.edges]

    def nearest(p: Point) -> int:
        """Return the contour with the edge nearest to a point ``reach`` away from it."""
        numbers = list(near.numbers(widened((*p, *p), 1.01 * reach))) or range(len(owners))
        return owners[min(numbers, key=lambda n: (round(distance_to(near.edges[n], p), 9), n))]

    followed = [{nearest(edge.at(0.5)) for edge in contour.edges} for contour in grown.contours]
    for number, contour in enumerate(originals):
        paths = [sources for sources in followed if number in sources]
        if not paths:
            return Lost(contour, "vanishes")
        if len(paths) > 1:
            return Lost(contour, "splits in parts")
        if len(paths[0]) > 1:
            return Lost(contour, "runs into another")
    return None


# Strips: the area swept by a tool of some width along a path, or by a region along an edge.


SHORT_TURN = 1.5
"""Radians, under a quarter turn: between points of two arcs the angle differs by less than pi."""


def swept(path: Sequence[Edge], width: float, has_round_ends: bool) -> Region:
    """Return the area swept by a tool of ``width`` mm along a chain of edges, with exact arcs.

    The chain may be closed, and may cross, touch or retrace itself. An open chain has round or
    square ends; the tool rotates in place at corners, so they are round on the outside.
    """
    half = width / 2
    is_closed = math.dist(path[0].start, path[-1].end) < EPSILON
    joints = [edge.start for edge in path[1:]]
    if is_closed or has_round_ends:
        joints += [path[0].start, path[-1].end]
    discs = [Region((circle(p, half),)) for p in dict.fromkeys(joints)]
    return union([*(_band(edge, half) for edge in path), *discs])


def dragged(region: Region, way: Edge) -> Region:
    """Return the Minkowski sum of a region and an edge: the area swept along the edge.

    It is the exact union of the region at both ends and the areas swept by its edges.
    """
    bands = [
        band
        for part in _short(way)
        for edge in region.edges
        for piece in _short(edge)
        for band in _sums(piece, part)
    ]
    return union([region.moved(*way.start), region.moved(*way.end), *bands])


def _short(edge: Edge) -> list[Edge]:
    """Return the edge, with arcs split into parts of less than a quarter turn."""
    count = math.ceil(abs(edge.sweep) / SHORT_TURN) if isinstance(edge, Arc) else 1
    return [edge.part(edge.at(k / count), edge.at((k + 1) / count)) for k in range(count)]


def _sums(a: Edge, b: Edge) -> Iterator[Region]:
    """Yield the Minkowski sum of two short edges."""
    if isinstance(a, Arc) and isinstance(b, Arc):
        loops = _sums_of_arcs(a, b)
    else:
        loops = _slid(a, b) if isinstance(b, Line) else _slid(b, a)
    for loop in loops:
        contour = Contour(tuple(loop))
        if contour.edges and abs(contour.area) > EPSILON**2:
            yield Region((contour if contour.area > 0 else contour.reversed(),))


def _slid(edge: Edge, way: Edge) -> Iterator[Sequence[Edge]]:
    """Outlines of the area swept by an edge along a line, split where the two are parallel."""
    shares = [0.0, 1.0]
    if isinstance(edge, Arc):
        (u, v), (x, y), r = way.direction(way.start), edge.centre, edge.radius
        turns = map(edge.parameter, [(x - v * r, y + u * r), (x + v * r, y - u * r)])
        shares += [t for t in turns if 0 < t < 1]
    for t0, t1 in pairwise(sorted(shares)):
        part = edge.part(edge.at(t0), edge.at(t1))
        near, far = shifted(part, way.start), shifted(part, way.end)
        yield near, Line(near.end, far.end), far.reversed(), Line(far.start, near.start)


def shifted(edge: Edge, by: Point) -> Edge:
    """Return an edge moved by a vector, mm."""
    start, end = ((p[0] + by[0], p[1] + by[1]) for p in (edge.start, edge.end))
    if isinstance(edge, Line):
        return Line(start, end)
    x, y = edge.centre
    return Arc(start, end, (x + by[0], y + by[1]), edge.radius, edge.ccw)


def _sums_of_arcs(a: Arc, b: Arc) -> Iterator[Sequence[Edge]]:
    """Yield outlines of the Minkowski sum of two arcs.

    The angles of the two points span a rectangle. The map to their sum folds where the arcs are
    parallel, that is, where the angles differ by a multiple of pi; each side of it is one-to-one.
    """
    first, low = a.start_angle, b.start_angle
    last, high = first + a.sweep, low + b.sweep
    cell = [(first, low), (last, low), (last, high), (first, high)]
    differ = [s - t for s, t in cell]
    fold = math.pi * math.ceil(min(differ) / math.pi)
    if not min(differ) < fold < max(differ):
        yield _outline(cell, a, b)
        return
    for side in (1, -1):
        half: list[Point] = []
        for (s, t), (s1, t1) in pairwise([*cell, cell[0]]):
            off, off1 = side * (s - t - fold), side * (s1 - t1 - fold)
            if off >= 0:
                half.append((s, t))
            if off * off1 < 0:
                # One of the two angles is constant along a side of the rectangle.
                half.append((s, s - fold) if s == s1 else (t + fold, t))
        yield _outline(half, a, b)


def _outline(cell: Sequence[Point], a: Arc, b: Arc) -> list[Edge]:
    """Sums along the edges of a cell of angles: arcs of either arc, or of both at the fold."""
    centre = a.centre[0] + b.centre[0], a.centre[1] + b.centre[1]

    def on(middle: Point, radius: float, angle: float) -> Point:
        return middle[0] + radius * math.cos(angle), middle[1] + radius * math.sin(angle)

    points = [on(on(centre, a.radius, s), b.radius, t) for s, t in cell]
    edges: list[Edge] = []
    for n, ((s, t), (s1, t1)) in enumerate(pairwise([*cell, cell[0]])):
        start, end = points[n], points[(n + 1) % len(points)]
        middle, radius = centre, a.radius + b.radius * math.cos(s - t)
        if s == s1:
            middle, radius = on(centre, a.radius, s), b.radius
        elif t == t1:
            middle, radius = on(centre, b.radius, t), a.radius
        if math.dist(start, end) > EPSILON:
            edges.append(Arc(start, end, middle, abs(radius), (s1, t1) > (s, t)))
    return edges


def shortened(path: Sequence[Edge], length: float) -> tuple[Edge, ...]:
    """Return a chain shortened by ``length`` mm at each end; a closed chain is unchanged."""
    if math.dist(path[0].start, path[-1].end) < EPSILON:
        return tuple(path)
    edges = list(path)
    for _ in range(2):
        rest = length
        while edges and edges[0].length <= rest:
            rest -= edges.pop(0).length
        if edges:
            edges[0] = edges[0].part(edges[0].at(rest / edges[0].length), edges[0].end)
        edges = [edge.reversed() for edge in reversed(edges)]
    return tuple(edges)


def _band(edge: Edge, half: float) -> Region:
    """Return the points within ``half`` mm of an edge along its normals."""
    outer_side, inner = edge.offset(half), edge.offset(-half)
    if outer_side is not None and inner is not None:
        sides: list[Edge] = [outer_side, Line(outer_side.end, inner.end), inner.reversed()]
        return Region((Contour((*sides, Line(inner.start, outer_side.start))),))
    # The inner side of an arc of a small radius shrinks to its centre.
    outer = outer_side if outer_side is not None else inner
    assert isinstance(edge, Arc)
    assert outer is not None
    loop = Contour((outer, Line(outer.end, edge.centre), Line(edge.centre, outer.start)))
    return Region((loop if loop.area > 0 else loop.reversed(),))
