"""Boolean operations on regions of lines and arcs, exact to EPSILON.

Every edge is split where it meets another; a piece stays if the result lies on one side of it
only; the pieces that stay are chained into contours. Nothing is flattened on the way.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import pairwise

from sbafab.errors import SbafabError
from sbafab.geometry.edges import EPSILON, Arc, Edge, Line, Point
from sbafab.geometry.intersect import meeting_points
from sbafab.geometry.nearby import close_pairs
from sbafab.geometry.region import Contour, Region, same_support
from sbafab.geometry.shapes import circle

Keep = Callable[[Sequence[bool]], bool]
LEAST_AREA = 1e-7
"""Contours that enclose less, in mm2, are rounding dust; so are those thinner than 4 EPSILON."""


class GeometryError(SbafabError, ArithmeticError):
    """An operation on regions came out inconsistent; the message says where."""


def union(regions: Iterable[Region]) -> Region:
    return overlay([region for region in regions if not region.is_empty], any)


def intersection(a: Region, b: Region) -> Region:
    if a.is_empty or b.is_empty:
        return Region()
    return overlay([a, b], all)


def difference(a: Region, b: Region) -> Region:
    if a.is_empty or b.is_empty:
        return a
    return overlay([a, b], lambda inside: inside[0] and not inside[1])


def overlay(regions: Sequence[Region], keep: Keep) -> Region:
    """The points where ``keep`` holds, given for each region whether it covers the point."""
    if len(regions) == 1 and keep([True]):
        return regions[0]
    edges = [edge for region in regions for edge in region.edges]
    owner = [index for index, region in enumerate(regions) for _ in region.edges]
    pool = PointPool()
    covered: dict[int, list[tuple[Edge, dict[int, int]]]] = defaultdict(list)
    for index, pieces in enumerate(split_edges(edges, pool)):
        for piece in pieces:
            _cover(covered, piece, owner[index], pool)
    chosen: list[Edge] = []
    for entries in covered.values():
        for piece, cover in entries:
            middle = piece.at(0.5)
            left, right = [], []
            for index, region in enumerate(regions):
                turns = cover.get(index, 0)
                inside = turns == 0 and index not in cover and region.contains(middle)
                left.append(turns > 0 or inside)
                right.append(turns < 0 or inside)
            stays_left, stays_right = keep(left), keep(right)
            if stays_left and not stays_right:
                chosen.append(piece)
            elif stays_right and not stays_left:
                chosen.append(piece.reversed())
    return chain(chosen)


def _cover(
    covered: dict[int, list[tuple[Edge, dict[int, int]]]], piece: Edge, owner: int, pool: PointPool
) -> None:
    """Files a piece with the pieces it coincides with, noting which way its owner runs."""
    a, b = pool.index(piece.start), pool.index(piece.end)
    entries = covered[(min(a, b) << 32) | max(a, b)]
    middle = piece.at(0.5)
    for other, cover in entries:
        if math.dist(middle, other.at(0.5)) < 4 * EPSILON:
            same_way = pool.index(other.start) == a
            cover[owner] = cover.get(owner, 0) + (1 if same_way else -1)
            return
    entries.append((piece, {owner: 1}))


class PointPool:
    """Gives every point within EPSILON of a known one the known one's coordinates."""

    def __init__(self) -> None:
        self.points: list[Point] = []
        self._seen: dict[Point, int] = {}
        self._cells: dict[tuple[int, int], list[int]] = {}

    def index(self, p: Point) -> int:
        known = self._seen.get(p)
        if known is None:
            known = self._seen[p] = self._search(p)
        return known

    def _search(self, p: Point) -> int:
        x, y = round(p[0] / (4 * EPSILON)), round(p[1] / (4 * EPSILON))
        for i in (x, x - 1, x + 1):
            for j in (y, y - 1, y + 1):
                for known in self._cells.get((i, j), ()):
                    if math.dist(self.points[known], p) < 2 * EPSILON:
                        return known
        self.points.append(p)
        self._cells.setdefault((x, y), []).append(len(self.points) - 1)
        return len(self.points) - 1

    def snapped(self, p: Point) -> Point:
        return self.points[self.index(p)]


def split_edges(edges: Sequence[Edge], pool: PointPool) -> Iterator[list[Edge]]:
    """Each edge cut at every point where it meets another; ends snapped to common points."""
    for edge in edges:
        pool.index(edge.start)
        pool.index(edge.end)
    cuts: list[list[Point]] = [[] for _ in edges]
    for i, j in close_pairs([edge.bounds for edge in edges], EPSILON):
        points = meeting_points(edges[i], edges[j])
        cuts[i] += points
        cuts[j] += points
    for edge, points in zip(edges, cuts, strict=True):
        start, end = pool.snapped(edge.start), pool.snapped(edge.end)
        stops = {pool.index(p) for p in points} - {pool.index(start), pool.index(end)}
        inner = sorted((pool.points[stop] for stop in stops), key=edge.parameter)
        corners = [start, *inner, end]
        yield [edge.part(a, b) for a, b in pairwise(corners) if a is not b]


def chain(pieces: Sequence[Edge]) -> Region:
    """Closed contours from directed pieces that keep the material on their left.

    Contours that touch at a point stay apart. Raises GeometryError where a piece has no successor.
    """
    leaving: dict[Point, list[Edge]] = defaultdict(list)
    for piece in pieces:
        leaving[piece.start].append(piece)
    contours = []
    for piece in pieces:
        if piece not in leaving[piece.start]:
            continue
        leaving[piece.start].remove(piece)
        path, place = [piece], {piece.start: 0}
        while path:
            here = path[-1].end
            back = place.get(here)
            if back is not None:
                contour = tidy(path[back:])
                contours += [contour] if contour is not None else []
                for edge in path[back:]:
                    del place[edge.start]
                del path[back:]
                continue
            options = leaving.get(here)
            if not options:
                raise GeometryError(
                    f"edges that nearly meet at x {here[0]:.6f}, y {here[1]:.6f} cannot be told "
                    "apart; change a size there by 0.001 mm"
                )
            follower = leftmost(path[-1], options)
            options.remove(follower)
            place[here] = len(path)
            path.append(follower)
    return Region(tuple(sorted(contours, key=_reading_order)))


def _reading_order(contour: Contour) -> tuple[bool, float, float, float]:
    low_x, low_y, high_x, _ = contour.bounds
    return contour.is_hole, round(low_x, 6), round(low_y, 6), round(high_x, 6)


def leftmost(before: Edge, options: Sequence[Edge]) -> Edge:
    """The edge that turns most to the left after ``before``; all options start where it ends."""
    if len(options) == 1:
        return options[0]
    # Edges that leave a point in one direction are told apart half way along the shortest: where
    # it ends they may meet again.
    reach = min(math.dist(edge.start, edge.end) for edge in (before, *options)) / 2
    return max(options, key=lambda option: left_turn(before, option, reach))


def left_turn(before: Edge, after: Edge, reach: float = 0.0) -> float:
    """Angle between -pi and pi turned to the left, from edge to edge or from chord to chord.

    The chords run from the common corner to the points at distance ``reach``.
    """
    back = _heading(before.reversed(), reach)
    return math.pi - (back - _heading(after, reach)) % math.tau


def _heading(edge: Edge, reach: float) -> float:
    """Angle from the edge's start to its point at distance ``reach``."""
    ux, uy = edge.direction(edge.start)
    angle = math.atan2(uy, ux)
    if isinstance(edge, Arc):
        bend = math.asin(min(1.0, reach / (2 * edge.radius)))
        angle += bend if edge.ccw else -bend
    return angle


def tidy(loop: Sequence[Edge]) -> Contour | None:
    """One contour with edges of one support joined and arcs of at most a quarter turn."""
    contour = Contour(tuple(loop))
    if abs(contour.area) < max(LEAST_AREA, 2 * EPSILON * contour.length):
        return None
    if contour.circle is not None:
        whole = circle(*contour.circle)
        return whole if contour.area > 0 else whole.reversed()
    breaks = [i for i in range(len(loop)) if not same_support(loop[i - 1], loop[i])]
    runs = [
        list(loop[first:last]) if first < last else [*loop[first:], *loop[:last]]
        for first, last in zip(breaks, [*breaks[1:], breaks[0]], strict=True)
    ]
    edges = [edge for run in runs for edge in _joined(run)]
    first = min(range(len(edges)), key=lambda i: _rounded(edges[i].start))
    return Contour((*edges[first:], *edges[:first]))


def _rounded(p: Point) -> Point:
    return round(p[0], 6), round(p[1], 6)


def _joined(run: Sequence[Edge]) -> list[Edge]:
    head = run[0]
    if isinstance(head, Line):
        return [Line(head.start, run[-1].end)]
    sweep = sum(edge.sweep for edge in run if isinstance(edge, Arc))
    count = max(1, math.ceil(abs(sweep) / (math.pi / 2) - 1e-9))
    if count == 1:
        return [head.part(head.start, run[-1].end)]
    first = head.start_angle
    corners = [
        head.start,
        *(head.on_circle(first + sweep * i / count) for i in range(1, count)),
        run[-1].end,
    ]
    return [head.part(corners[i], corners[i + 1]) for i in range(count)]
