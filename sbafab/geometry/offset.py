"""Offsets of regions that keep arcs as arcs: growing and shrinking, and the path of a beam."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, NamedTuple

from sbafab.errors import GeometryError
from sbafab.geometry.arcs import biarc, ellipse
from sbafab.geometry.boolean import FAR, alone, meets_itself
from sbafab.geometry.cache import cached
from sbafab.geometry.contour import Contour, circle
from sbafab.geometry.edges import (
    EPSILON,
    Arc,
    Edge,
    Line,
    Point,
    distance_to,
    edge_from_bulge,
    left_turn,
    meeting_points,
)
from sbafab.geometry.region import Region, enclosed, union
from sbafab.geometry.spatial_index import EdgeIndex, close_pairs, widened

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
    """A closed chain that winds round the contour's inside and the bands beside its edges."""
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
    """Yield the edges with ends merged that differ by a rounding."""
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
    """True if the bands of two lines both hold the triangle of a corner and the ends beside it."""
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
    """The arcs round a convex corner; empty if the path is smooth or turns the other way.

    At the tip of a cusp, rounding decides whether the path turns left or right, so it always gets
    its arcs there: round the end of a notch they lie in the material and drop out.
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


# Tracks of a beam's middle in closed form, their crossings, and arcs along them.


TOLERANCE = 0.0001
"""Farthest an arc of the path may lie from the exact curve, in mm."""
STEP, CORNER_STEP = math.radians(15), math.radians(30)
"""Maximum turn of one arc along a curve, and round a corner."""
LEAST_ARCS = 3
"""Minimum arcs per curve: four points identify its circle when the kerf is undone."""
SHORT = 1e-3
SHARES = tuple(0.75**k for k in range(16, 0, -1))
"""Shares of two tracks at which the search for a crossing starts."""


def rim(a: float, b: float, angle: float) -> Point:
    """The point of a beam's rim (half widths ``a`` and ``b``) with this angle of its normal."""
    x, y = math.cos(angle), math.sin(angle)
    size = math.hypot(a * x, b * y)
    return a * a * x / size, b * b * y / size


class Track(NamedTuple):
    """The source of a stretch of path: a line, or an arc ``turn`` x ``radius`` long (0: a corner).

    The parameter is the angle of the outward normal; along a line, the length.
    """

    beam: tuple[float, float]
    centre: Point
    radius: float
    turn: int
    line: Line | None = None

    def at(self, t: float) -> Point:
        if self.line is not None:
            ux, uy = self.line.direction(self.line.start)
            (x, y), (ex, ey) = self.line.start, rim(*self.beam, math.atan2(-ux, uy))
            return x + ex + t * ux, y + ey + t * uy
        (cx, cy), (ex, ey) = self.centre, rim(*self.beam, t)
        r = self.turn * self.radius
        return cx + r * math.cos(t) + ex, cy + r * math.sin(t) + ey

    def bend(self, t: float) -> float:
        """Radius of curvature of source and rim, positive to the left of the normal's turn."""
        a, b = self.beam
        rim_bend = (a * b) ** 2 / math.hypot(a * math.cos(t), b * math.sin(t)) ** 3
        return self.turn * self.radius + rim_bend

    def rate(self, t: float) -> Point:
        if self.line is not None:
            return self.line.direction(self.line.start)
        bend = self.bend(t)
        return -bend * math.sin(t), bend * math.cos(t)

    def runs_on(self, t: float) -> bool:
        """True if the beam moves forward; in a hollow narrower than its rim it moves back."""
        return self.turn >= 0 or self.bend(t) < 0


def crossing(
    arriving: tuple[Track, float, float], leaving: tuple[Track, float, float]
) -> tuple[float, float]:
    """Return the parameters at which a track that ends meets one that starts.

    The search starts there, or farther away if the beam moves back there.
    """
    (before, far, end), (after, start, on) = arriving, leaving
    if before.runs_on(end) and after.runs_on(start):
        if math.dist(before.at(end), after.at(start)) < 2 * EPSILON:
            return end, start
        return _met(before, end, after, start) or (end, start)
    back, ahead = far - end, on - start
    for share in SHARES:
        reach = share * max(abs(back), abs(ahead))
        met = _met(
            before,
            end + math.copysign(min(reach, abs(back)), back),
            after,
            start + math.copysign(min(reach, abs(ahead)), ahead),
        )
        if met and (met[0] - end) * back >= 0 and (met[1] - start) * ahead >= 0:
            return met
    return end, start


def _met(before: Track, s: float, after: Track, t: float) -> tuple[float, float] | None:
    """The parameters at which two forward tracks cross, by Newton's method from near ones."""
    first = s, t
    for _ in range(8):
        (x, y), (u, v) = before.at(s), after.at(t)
        if max(abs(s - first[0]), abs(t - first[1])) > 0.5:
            return None
        if math.hypot(u - x, v - y) < 1e-10:
            return (s, t) if before.runs_on(s) and after.runs_on(t) else None
        (px, py), (qx, qy) = before.rate(s), after.rate(t)
        det = px * qy - py * qx
        if abs(det) < 1e-3 * math.hypot(px, py) * math.hypot(qx, qy):
            return None
        s += ((u - x) * qy - (v - y) * qx) / det
        t += ((u - x) * py - (v - y) * px) / det
    return None


def arcs_along(track: Track, t0: float, t1: float) -> list[Edge]:
    """Return enough arcs through points of the track to stay within the tolerance."""
    step, tolerance = (STEP, TOLERANCE) if track.radius else (CORNER_STEP, TOLERANCE / 10)
    count = max(1, math.ceil(abs(t1 - t0) / step - 1e-9))
    if track.radius * abs(t1 - t0) > SHORT:
        count = max(LEAST_ARCS, count)
    return through(track.at, t0, t1, count, tolerance)


def through(
    curve: Callable[[float], Point], t0: float, t1: float, count: int, tolerance: float
) -> list[Edge]:
    """Arcs through ``count`` + 1 points of the curve, doubled until they fit."""
    while True:
        stops = [t0 + (t1 - t0) * k / count for k in range(count + 1)]
        points = [curve(t) for t in stops]
        if math.dist(points[0], points[-1]) < EPSILON:
            points[-1] = points[0]
            if count == 1:
                return []
        edges = [
            _through(p, curve((s + t) / 2), q)
            for (s, t), (p, q) in zip(pairwise(stops), pairwise(points), strict=True)
        ]
        off = max(
            distance_to(edge, curve(s + (t - s) * share))
            for edge, (s, t) in zip(edges, pairwise(stops), strict=True)
            for share in (0.2, 0.8)
        )
        if off <= tolerance or count > 1000:
            return [edge for edge in edges if math.dist(edge.start, edge.end) > EPSILON]
        count *= 2


def _through(start: Point, middle: Point, end: Point) -> Edge:
    """Return the arc from start to end through a point half way."""
    (ax, ay), (bx, by) = (
        (middle[0] - start[0], middle[1] - start[1]),
        (end[0] - middle[0], end[1] - middle[1]),
    )
    half = math.atan2(ax * by - ay * bx, ax * bx + ay * by)
    if abs(half) * math.dist(start, end) < EPSILON / 10:
        return Line(start, end)
    return edge_from_bulge(start, end, math.tan(half / 2))


# The path of a beam of some width: regions grown by half of it, contour by contour.
#
# A beam of equal width along x and y grows a region by a disc, and arcs stay arcs. An unequal beam
# grows it by an ellipse: straight edges stay straight, and arcs are fitted through points of every
# other piece of the path, which has a closed form.


Kerf = float | tuple[float, float]
"""Full width of the cut, mm: the same everywhere, or measured along x and along y."""
Fate = Literal["vanishes", "splits in parts", "runs into another"]

FINE = 0.00005
"""Farthest a stretched arc may lie off, mm; its error shifts the ends of the path's pieces."""
SHORTEST = 4 * EPSILON
"""An arc shorter than this is stretched as a line."""
STRETCHED_STEP, MOST_PIECES = math.radians(30), 1000
"""Maximum turn of two arcs along a stretched curve, and more pieces than any curve needs."""
SMOOTH = 1e-3
"""Radians: a curve with a sharper kink crosses itself or another one there."""
PROJECTIONS, BEND = 3, 0.01
"""Iterations to a track's nearest point; radius in mm at which distance along it counts equally.
"""


class Lost(NamedTuple):
    """A contour that the path does not follow exactly once, and the reason."""

    contour: Contour
    fate: Fate


@dataclass(frozen=True)
class BeamPath:
    """The path, and the first contour of the region without a single path."""

    region: Region
    lost: Lost | None


def widths(kerf: Kerf) -> tuple[float, float]:
    """Full width along x and along y."""
    return kerf if isinstance(kerf, tuple) else (kerf, kerf)


def beam_path(region: Region, kerf: Kerf) -> BeamPath:
    """The path of the beam's centre that leaves ``region``; both widths are 0, or neither is.

    Raises GeometryError if the offset cannot be computed.
    """
    a, b = (width / 2 for width in widths(kerf))
    if a == b:
        path = grow(region, a)
        return BeamPath(path, _lost(region.contours, region.contours, path, a))
    reach = max(a, b)
    sx, sy = reach / a, reach / b
    # Stretch until the beam is round; the arcs stay within 0.05 um of the ellipses.
    rounds = [[_stretched(edge, sx, sy) for edge in c.edges] for c in region.contours]
    wide = Region(tuple(Contour(tuple(e for part in c for e in part)) for c in rounds))
    grown = grow(wide, reach)
    lost = _lost(region.contours, wide.contours, grown, reach)
    sources = _Sources(
        EdgeIndex(wide.edges),
        [
            _Source(edge, part is parts[0], part is parts[-1])
            for contour, pieces in zip(region.contours, rounds, strict=True)
            for edge, parts in zip(contour.edges, pieces, strict=True)
            for part in parts
        ],
        (a, b),
        reach,
    )
    contours = []
    for contour in grown.contours:
        tracks = [_track(edge, sources) for edge in contour.edges]
        contours.append(_untangled(_drawn(contour.edges, tracks, (sx, sy))))
    return BeamPath(Region(tuple(contours)), lost)


class _Source(NamedTuple):
    """The true edge of a piece of the stretched region, and whether the piece starts or ends it."""

    edge: Edge
    is_first: bool
    is_last: bool


class _Sources(NamedTuple):
    """A spatial index of the stretched region's edges, and the source of each."""

    near: EdgeIndex
    of: Sequence[_Source]
    beam: tuple[float, float]
    reach: float


def _stretched(edge: Edge, sx: float, sy: float) -> list[Edge]:
    """Return edges within FINE of the stretched edge, without kinks, which would count as corners.

    The ends match the edge's exactly; an edge too short to turn becomes a line.
    """
    start, end = ((p[0] * sx, p[1] * sy) for p in (edge.start, edge.end))
    if isinstance(edge, Line) or math.dist(start, end) < SHORTEST:
        return [Line(start, end)]
    (cx, cy), r, first, sweep = edge.centre, edge.radius, edge.start_angle, edge.sweep
    curve = ellipse((cx * sx, cy * sy), (r * sx, 0.0), (0.0, r * sy))
    count = math.ceil(abs(sweep) / STRETCHED_STEP)
    while count < MOST_PIECES:
        angles = [first + sweep * k / count for k in range(count + 1)]
        points = [start, *(curve(t)[0] for t in angles[1:-1]), end]
        ways = [_unit(curve(t)[1], sweep) for t in angles]
        pieces = [
            biarc(p, u, q, v, 0.0)
            for (p, q), (u, v) in zip(pairwise(points), pairwise(ways), strict=True)
        ]
        # A biarc deviates most from its curve at one sixth and five sixths of its length.
        if all(
            pair and distance_to(pair[half], curve(s + (t - s) * share)[0]) < FINE
            for pair, (s, t) in zip(pieces, pairwise(angles), strict=True)
            for half, share in ((0, 1 / 6), (1, 5 / 6))
        ):
            return [piece for pair in pieces for piece in pair]
        count *= 2
    x, y = edge.start
    raise GeometryError(f"the arc at x {x:.6f}, y {y:.6f} cannot be stretched to the kerf")


def _unit(way: Point, sign: float) -> Point:
    size = math.copysign(math.hypot(*way), sign)
    return way[0] / size, way[1] / size


def _nearest(near: EdgeIndex, p: Point, reach: float) -> int:
    """Return the number of the edge nearest to a point ``reach`` away from them."""
    numbers = list(near.numbers(widened((*p, *p), 1.01 * reach))) or range(len(near.edges))
    return min(numbers, key=lambda n: (round(distance_to(near.edges[n], p), 9), n))


def _lost(
    originals: Sequence[Contour], stretched: Sequence[Contour], grown: Region, reach: float
) -> Lost | None:
    near = EdgeIndex([edge for contour in stretched for edge in contour.edges])
    owners = [n for n, contour in enumerate(stretched) for _ in contour.edges]
    followed = [
        {owners[_nearest(near, edge.at(0.5), reach)] for edge in contour.edges}
        for contour in grown.contours
    ]
    for number, contour in enumerate(originals):
        paths = [sources for sources in followed if number in sources]
        if not paths:
            return Lost(contour, "vanishes")
        if len(paths) > 1:
            return Lost(contour, "splits in parts")
        if len(paths[0]) > 1:
            return Lost(contour, "runs into another")
    return None


def _track(edge: Edge, sources: _Sources) -> Track:
    """Return the track of a piece of the stretched path, in unstretched lengths."""
    near, reach = sources.near, sources.reach
    if isinstance(edge, Arc) and edge.ccw and abs(edge.radius - reach) < EPSILON:
        for number in near.numbers(widened((*edge.centre, *edge.centre), 2 * EPSILON)):
            piece, (source, is_first, is_last) = near.edges[number], sources.of[number]
            if is_first and math.dist(piece.start, edge.centre) < 2 * EPSILON:
                return Track(sources.beam, source.start, 0.0, 1)
            if is_last and math.dist(piece.end, edge.centre) < 2 * EPSILON:
                return Track(sources.beam, source.end, 0.0, 1)
    source = sources.of[_nearest(near, edge.at(0.5), reach)].edge
    if isinstance(source, Line):
        return Track(sources.beam, source.start, 0.0, 0, source)
    return Track(sources.beam, source.centre, source.radius, 1 if source.ccw else -1)


def _drawn(edges: Sequence[Edge], tracks: Sequence[Track], scale: tuple[float, float]) -> Contour:
    """Return a contour of the path from its stretched image and the tracks of its edges."""
    count = len(edges)
    starts = [
        i
        for i in range(count)
        if tracks[i] != tracks[i - 1] or abs(left_turn(edges[i - 1], edges[i])) > SMOOTH
    ]
    if not starts:
        track = tracks[0]
        start = _parameter(track, edges[0], edges[0].start, scale)
        return Contour(tuple(arcs_along(track, start, start + track.turn * math.tau)))
    spans: list[tuple[Track, float, float]] = []
    for i, after in zip(starts, [*starts[1:], starts[0] + count], strict=True):
        stretch = [edges[k % count] for k in range(i, max(after, i + 1))]
        t0 = _parameter(tracks[i], stretch[0], stretch[0].start, scale)
        stops = _cut_where_wide(tracks[i], t0, _last(tracks[i], t0, stretch, scale))
        # If the beam moves back along the whole piece, its neighbours cross each other.
        spans += [
            (tracks[i], s, t)
            for s, t in pairwise(stops)
            if any(tracks[i].runs_on(s + share * (t - s)) for share in (0.0, 0.5, 1.0))
        ]
    return Contour(tuple(_joined(spans)))


def _untangled(contour: Contour) -> Contour:
    """The contour without loops below a micrometre, made by tracks with an extra crossing."""
    edges, count = contour.edges, len(contour.edges)
    if not any(
        (i - j) % count not in (1, count - 1) and meeting_points(edges[i], edges[j])
        for i, j in close_pairs(contour.boxes, EPSILON)
    ):
        return contour
    whole = enclosed([contour.reversed() if contour.is_hole else contour]).contours
    # A larger loop is not rounding: keep it, so that reading the file back reports it.
    if len(whole) != 1 or abs(whole[0].area - abs(contour.area)) > EPSILON * contour.length:
        return contour
    return whole[0].reversed() if contour.is_hole else whole[0]


def _cut_where_wide(track: Track, t0: float, t1: float) -> list[float]:
    """Both ends, and the points between at which the beam's flat side moves back over itself."""
    flat = 0.0 if track.beam[1] > track.beam[0] else math.pi / 2
    low, high = sorted((t0, t1))
    sides = [
        flat + math.pi * k
        for k in range(math.ceil((low - flat) / math.pi), math.floor((high - flat) / math.pi) + 1)
    ]
    back = [t for t in sides if low < t < high and not track.runs_on(t)]
    return [t0, *sorted(back, reverse=t1 < t0), t1]


def _parameter(track: Track, edge: Edge, p: Point, scale: tuple[float, float]) -> float:
    sx, sy = scale
    if track.line is not None:
        (x0, y0), (ux, uy) = track.at(0.0), track.line.direction(track.line.start)
        return (p[0] / sx - x0) * ux + (p[1] / sy - y0) * uy
    ux, uy = edge.direction(p)
    t = math.atan2(-ux * sy, uy * sx)
    for _ in range(PROJECTIONS):
        # The length gives the parameter, more exactly than the position if the track bends little.
        (x, y), (rx, ry) = track.at(t), track.rate(t)
        t += ((p[0] / sx - x) * rx + (p[1] / sy - y) * ry) / (rx * rx + ry * ry + BEND**2)
    return t


def _last(track: Track, t0: float, edges: Sequence[Edge], scale: tuple[float, float]) -> float:
    """The parameter at the end of a track's edges, counted from ``t0`` as the track turns."""
    t1 = _parameter(track, edges[-1], edges[-1].end, scale)
    if track.line is not None:
        return t1
    # No edge turns by more than half a turn, so their sum counts the normal's full turns.
    turn = sum(
        math.remainder(
            _parameter(track, e, e.end, scale) - _parameter(track, e, e.start, scale), math.tau
        )
        for e in edges
    )
    t1 += math.tau * round((t0 + turn - t1) / math.tau)
    return t1 if (t1 - t0) * track.turn > 0 else t0


def _joined(spans: Sequence[tuple[Track, float, float]]) -> Iterator[Edge]:
    """Yield edges along the tracks; each ends where it crosses the next."""
    starts, ends = [t0 for _, t0, _ in spans], [t1 for _, _, t1 in spans]
    for i, span in enumerate(spans):
        ends[i - 1], starts[i] = crossing(spans[i - 1], span)
    visible = [
        i
        for i, (track, _, _) in enumerate(spans)
        if math.dist(track.at(starts[i]), track.at(ends[i])) > EPSILON
    ]
    for i, following in zip(visible, [*visible[1:], *visible[:1]], strict=True):
        track = spans[i][0]
        start, end = track.at(starts[i]), spans[following][0].at(starts[following])
        miss = math.dist(end, track.at(ends[i]))
        if miss > TOLERANCE:
            raise GeometryError(
                f"the edges that meet at x {end[0]:.6f}, y {end[1]:.6f} miss each other by "
                f"{miss:.6f} mm once the kerf is added; change a size there by 0.001 mm"
            )
        edges: list[Edge] = [Line(start, end)]
        if track.line is None:
            edges = arcs_along(track, starts[i], ends[i])
        if edges:
            edges[0] = edges[0].part(start, edges[0].end)
            edges[-1] = edges[-1].part(edges[-1].start, end)
            yield from edges


# Strips: the area swept by a tool of some width along a path, or by a region along an edge.


SHORT_TURN = 1.5
"""Radians, under a quarter turn: between points of two arcs the angle differs by less than pi."""


def swept(path: Sequence[Edge], width: float, has_round_ends: bool) -> Region:
    """Return the area swept by a tool of ``width`` mm along a chain of edges, with exact arcs.

    The chain may be closed, and may cross, touch or retrace itself. An open one has round or
    square ends; the tool turns on the spot at corners, so they are round on the outside.
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
    """The edge, with an arc split into parts of less than a quarter turn."""
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
    """Yield outlines of the area swept by an edge along a line, split where both are parallel."""
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
    """The sums along the edges of a cell of angles: arcs of either arc, or of both at the fold."""
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
    """Return a chain of edges shortened by ``length`` mm at each end; a closed one is unchanged."""
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
    right, left = edge.offset(half), edge.offset(-half)
    if right is not None and left is not None:
        sides: list[Edge] = [right, Line(right.end, left.end), left.reversed()]
        return Region((Contour((*sides, Line(left.start, right.start))),))
    # The inner side of an arc of a small radius shrinks to its centre.
    outer = right if right is not None else left
    assert isinstance(edge, Arc)
    assert outer is not None
    loop = Contour((outer, Line(outer.end, edge.centre), Line(edge.centre, outer.start)))
    return Region((loop if loop.area > 0 else loop.reversed(),))
