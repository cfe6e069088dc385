"""The path of a beam of some width: regions grown by half of it, contour by contour.

A beam that is as wide along x as along y grows a region by a disc, and arcs stay arcs. One that is
not grows it by an ellipse: straight edges stay straight, and every other piece of the path, known
in closed form, is drawn through its points by arcs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, NamedTuple

from sbafab.geometry.biarc import ellipse, fit_arcs
from sbafab.geometry.boolean import left_turn
from sbafab.geometry.edges import EPSILON, Arc, Edge, Line, Point, distance_to, edge_from_bulge
from sbafab.geometry.nearby import EdgeIndex, widened
from sbafab.geometry.offset import grow
from sbafab.geometry.region import Contour, Region
from sbafab.geometry.width import least_gap

Kerf = float | tuple[float, float]
"""Full width of the cut, mm: the same everywhere, or measured along x and along y."""
Fate = Literal["vanishes", "splits in parts", "runs into another"]

TOLERANCE = 0.0001
"""Farthest an arc of the path may lie from the exact curve, in mm."""
FINE = 0.00005
"""The same for the stretched region, whose path only tells where the pieces of the path end."""
STEP, CORNER_STEP = math.radians(15), math.radians(30)
"""Most that one arc turns along a curve, and round a corner."""
LEAST_ARCS = 3
"""So many arcs follow every curve: four points tell the circle it was, when the kerf is undone."""
SHORT = 1e-3
SMOOTH = 1e-3
"""Radians: a curve that turns more at once crosses itself there, or another."""
SHARP = 15.0
"""Degrees: notches sharper than this are no slots."""


class Lost(NamedTuple):
    """A contour that the path does not follow once, and why."""

    contour: Contour
    fate: Fate


@dataclass(frozen=True)
class BeamPath:
    """The path, and the first contour of the region that has no one path of its own."""

    region: Region
    lost: Lost | None


def widths(kerf: Kerf) -> tuple[float, float]:
    """Full width along x and along y."""
    return kerf if isinstance(kerf, tuple) else (kerf, kerf)


def is_kerf(x: float, y: float) -> bool:
    """Whether a beam may be so wide: up to a millimetre, and nowhere ten times as wide."""
    return min(x, y) >= 0 and max(x, y) <= min(1.0, 10 * min(x, y)) and math.isfinite(x + y)


def beam_path(region: Region, kerf: Kerf) -> BeamPath:
    """The path of the beam's middle that leaves ``region``; both widths 0, or neither.

    Raises GeometryError where the offset cannot be worked out.
    """
    a, b = (width / 2 for width in widths(kerf))
    if a == b:
        path = grow(region, a)
        return BeamPath(path, _lost(region.contours, region.contours, path, a))
    reach = max(a, b)
    sx, sy = reach / a, reach / b
    # Stretched so that the beam is round, in arcs a twentieth of a micrometre off the ellipses.
    rounds = [[_stretched(edge, sx, sy) for edge in c.edges] for c in region.contours]
    wide = Region(tuple(Contour(tuple(e for part in c for e in part)) for c in rounds))
    sources = [
        edge
        for contour, parts in zip(region.contours, rounds, strict=True)
        for edge, part in zip(contour.edges, parts, strict=True)
        for _ in part
    ]
    grown = grow(wide, reach)
    lost = _lost(region.contours, wide.contours, grown, reach)
    near = EdgeIndex(wide.edges)
    contours = []
    for contour in grown.contours:
        tracks = [_track(edge, near, sources, (a, b), reach) for edge in contour.edges]
        contours.append(_drawn(contour.edges, tracks, (sx, sy)))
    return BeamPath(Region(tuple(contours)), lost)


def place_of(region: Region, lost: Lost, kerf: Kerf) -> Point:
    """Where a contour is lost: the slot that closes, or else the contour's middle."""
    if lost.fate != "vanishes":
        slot = least_gap(region, SHARP, max(widths(kerf)))
        if slot is not None:
            return slot.middle
    low_x, low_y, high_x, high_y = lost.contour.bounds
    return (low_x + high_x) / 2, (low_y + high_y) / 2


def rim(a: float, b: float, angle: float) -> Point:
    """The point of a beam's rim (half widths ``a`` and ``b``) with this angle of its normal."""
    x, y = math.cos(angle), math.sin(angle)
    size = math.hypot(a * x, b * y)
    return a * a * x / size, b * b * y / size


class _Track(NamedTuple):
    """What the beam follows: an arc of ``turn`` times ``radius`` (0: a corner), or a straight edge.

    Its points are parameters of the outward normal's angle; of the straight edge's length.
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

    def rate(self, t: float) -> Point:
        step = 1e-6
        (x0, y0), (x1, y1) = self.at(t - step), self.at(t + step)
        return (x1 - x0) / (2 * step), (y1 - y0) / (2 * step)


def _stretched(edge: Edge, sx: float, sy: float) -> tuple[Edge, ...]:
    start, end = ((p[0] * sx, p[1] * sy) for p in (edge.start, edge.end))
    if isinstance(edge, Line):
        return (Line(start, end),)
    (cx, cy), r, first = edge.centre, edge.radius, edge.start_angle
    curve = ellipse((cx * sx, cy * sy), (r * sx, 0.0), (0.0, r * sy))
    low, high = sorted((first, first + edge.sweep))
    fitted = fit_arcs(curve, low, high, FINE)
    if not edge.ccw:
        fitted = tuple(e.reversed() for e in reversed(fitted))
    if not fitted:
        return (Line(start, end),)
    ends = [start, *(e.end for e in fitted[:-1]), end]
    return tuple(e.part(*stops) for e, stops in zip(fitted, pairwise(ends), strict=True))


def _nearest(near: EdgeIndex, p: Point, reach: float) -> int:
    """Which of the edges lies nearest to a point ``reach`` away from them."""
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
        own = [sources for sources in followed if number in sources]
        if not own:
            return Lost(contour, "vanishes")
        if len(own) > 1:
            return Lost(contour, "splits in parts")
        if len(own[0]) > 1:
            return Lost(contour, "runs into another")
    return None


def _track(
    edge: Edge, near: EdgeIndex, sources: Sequence[Edge], beam: tuple[float, float], reach: float
) -> _Track:
    """What a piece of the stretched path follows, in true measure."""
    number = _nearest(near, edge.at(0.5), reach)
    source = sources[number]
    if isinstance(edge, Arc) and edge.ccw and abs(edge.radius - reach) < EPSILON:
        for stretched, true in (
            (near.edges[number].start, source.start),
            (near.edges[number].end, source.end),
        ):
            if math.dist(stretched, edge.centre) < 2 * EPSILON:
                return _Track(beam, true, 0.0, 1)
    if isinstance(source, Line):
        return _Track(beam, source.start, 0.0, 0, source)
    return _Track(beam, source.centre, source.radius, 1 if source.ccw else -1)


def _drawn(edges: Sequence[Edge], tracks: Sequence[_Track], scale: tuple[float, float]) -> Contour:
    """A contour of the path from its stretched image and what each of its edges follows."""
    count = len(edges)
    starts = [
        i
        for i in range(count)
        if tracks[i] != tracks[i - 1] or abs(left_turn(edges[i - 1], edges[i])) > SMOOTH
    ]
    if not starts:
        track = tracks[0]
        start = _parameter(track, edges[0], edges[0].start, scale)
        return Contour(tuple(_arcs(track, start, start + track.turn * math.tau)))
    spans: list[tuple[_Track, float, float]] = []
    for i, after in zip(starts, [*starts[1:], starts[0]], strict=True):
        track, last = tracks[i], edges[after - 1]
        t0 = _parameter(track, edges[i], edges[i].start, scale)
        t1 = _parameter(track, last, last.end, scale)
        spans.append((track, t0, _onward(track, t0, t1)))
    return Contour(tuple(_joined(spans)))


def _parameter(track: _Track, edge: Edge, p: Point, scale: tuple[float, float]) -> float:
    sx, sy = scale
    if track.line is not None:
        (x0, y0), (ux, uy) = track.at(0.0), track.line.direction(track.line.start)
        return (p[0] / sx - x0) * ux + (p[1] / sy - y0) * uy
    ux, uy = edge.direction(p)
    return math.atan2(-ux * sy, uy * sx)


def _onward(track: _Track, t0: float, t1: float) -> float:
    """The later parameter, on from the earlier one the way the track turns."""
    if track.line is not None:
        return t1
    ahead = (t1 - t0) * track.turn % math.tau
    return t0 + track.turn * (0.0 if ahead > math.tau - 1e-6 else ahead)


def _joined(spans: Sequence[tuple[_Track, float, float]]) -> Iterator[Edge]:
    """Edges along the tracks, which end where they cross the next."""
    starts, ends = [t0 for _, t0, _ in spans], [t1 for _, _, t1 in spans]
    corners: list[Point] = []
    for i, (track, _, _) in enumerate(spans):
        before = spans[i - 1][0]
        ends[i - 1], starts[i] = _crossing(before, ends[i - 1], track, starts[i])
        corners.append(track.at(starts[i]))
    for i, (track, _, _) in enumerate(spans):
        start, end = corners[i], corners[(i + 1) % len(corners)]
        edges: list[Edge] = [Line(start, end)]
        if track.line is None:
            edges = _arcs(track, starts[i], ends[i])
        if edges and math.dist(start, end) > EPSILON:
            edges[0] = edges[0].part(start, edges[0].end)
            edges[-1] = edges[-1].part(edges[-1].start, end)
            yield from edges


def _crossing(one: _Track, s: float, other: _Track, t: float) -> tuple[float, float]:
    """The parameters at which two tracks meet, from near ones, by Newton's steps."""
    for _ in range(6):
        (x, y), (u, v) = one.at(s), other.at(t)
        if math.hypot(u - x, v - y) < 1e-10:
            break
        (px, py), (qx, qy) = one.rate(s), other.rate(t)
        det = px * qy - py * qx
        if abs(det) < 1e-3 * math.hypot(px, py) * math.hypot(qx, qy):
            break
        s += ((u - x) * qy - (v - y) * qx) / det
        t += ((u - x) * py - (v - y) * px) / det
    return s, t


def _arcs(track: _Track, t0: float, t1: float) -> list[Edge]:
    """Arcs through points of the track, as many as keep within the tolerance."""
    step, tolerance = (STEP, TOLERANCE) if track.radius else (CORNER_STEP, TOLERANCE / 10)
    count = max(1, math.ceil(abs(t1 - t0) / step - 1e-9))
    if track.radius * abs(t1 - t0) > SHORT:
        count = max(LEAST_ARCS, count)
    return through(track.at, t0, t1, count, tolerance)


def through(
    curve: Callable[[float], Point], t0: float, t1: float, count: int, tolerance: float
) -> list[Edge]:
    """Arcs through ``count`` + 1 points of the curve, or through twice as many, and so on."""
    while True:
        stops = [t0 + (t1 - t0) * k / count for k in range(count + 1)]
        points = [curve(t) for t in stops]
        if math.dist(points[0], points[-1]) < EPSILON:
            points[-1] = points[0]
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
    """The arc from start through a point half way to the end."""
    (ax, ay), (bx, by) = (
        (middle[0] - start[0], middle[1] - start[1]),
        (end[0] - middle[0], end[1] - middle[1]),
    )
    half = math.atan2(ax * by - ay * bx, ax * bx + ay * by)
    if abs(half) * math.dist(start, end) < EPSILON / 10:
        return Line(start, end)
    return edge_from_bulge(start, end, math.tan(half / 2))
