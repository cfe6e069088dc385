"""Edges laid over each other: cut where they meet, and those that coincide made one piece."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import Final, NamedTuple

from sbafab.geometry.edges import (
    BENT,
    EPSILON,
    Arc,
    Bounds,
    Edge,
    Point,
    distance_to,
    from_end_to_end,
)
from sbafab.geometry.intersect import meeting_points
from sbafab.geometry.nearby import close_pairs, widened
from sbafab.geometry.pool import PointPool

_Entry = tuple[float, int, Edge, int]
"""How far the middle of an edge is off its chord, the edge's number, the edge, its turns."""
DIGIT: Final = 16
"""Bits: how often the edges of several owners wind stands in one whole number, a digit an owner."""
ROUNDS: Final = 4
"""Most times that edges are cut over again."""


class Piece(NamedTuple):
    """An edge that meets others at its ends only; the chains wind ``turns`` times more on its left
    than on its right. Those of several owners are told apart by ``by_owner``.
    """

    edge: Edge
    turns: int


class Overlay(NamedTuple):
    """Pieces, and whether some were bent: then they may cross where none was cut."""

    pieces: list[Piece]
    bent: bool


def overlaid(owners: Sequence[Iterable[Edge]], tolerance: float = EPSILON) -> Overlay:
    """The edges of all owners, each place once, cut where they meet.

    What was bent to meet another edge is cut over again, for it may have come to meet a third.
    """
    entries = [(edge, 1 << DIGIT * i) for i, edges in enumerate(owners) for edge in edges]
    return overlay(entries, tolerance)


def overlay(
    entries: Sequence[tuple[Edge, int]],
    tolerance: float = EPSILON,
    chain: Sequence[int] | None = None,
) -> Overlay:
    """The same for edges that each count so many turns.

    ``chain`` numbers the closed chain of each edge where it is known to stay clear of itself; of
    others it is negative.
    """
    bent = True
    for _ in range(ROUNDS):
        split, bent = split_edges([edge for edge, _ in entries], tolerance, chain)
        chain = None
        entries = [
            (part, entry[1]) for parts, entry in zip(split, entries, strict=True) for part in parts
        ]
        if not bent:
            break
    return Overlay(_merged(entries, tolerance), bent)


def by_owner(turns: int, owners: int) -> list[int]:
    """How often the edges of each owner wind, from what the edges of all do."""
    half = 1 << DIGIT - 1
    raised = turns + sum(half << DIGIT * i for i in range(owners))
    return [(raised >> DIGIT * i) % (2 * half) - half for i in range(owners)]


class Split(NamedTuple):
    """The parts of each edge, and whether one was bent to meet another."""

    parts: list[list[Edge]]
    bent: bool


def split_edges(
    edges: Sequence[Edge], tolerance: float = EPSILON, chain: Sequence[int] | None = None
) -> Split:
    """Each edge cut where it meets another; points nearer than 2 ``tolerance`` become one.

    The order of the edges has no part in where they are cut. What meets an arc is looked for along
    its circle, so one that was bent before is taken from end to end.
    """
    whole, edges = edges, [from_end_to_end(edge) for edge in edges]
    cuts: list[list[Point]] = [[] for _ in edges]
    meeting: list[tuple[int, int]] = []
    bounds = [edge.bounds for edge in edges]
    # An arc may leave the box of its ends by as much as these are off its circle.
    near = [widened(box, tolerance + BENT) for box in bounds]
    for i, j in close_pairs(bounds, tolerance):
        if chain is not None and chain[i] == chain[j] >= 0:
            continue
        if _stay_apart(edges[i], edges[j], tolerance) or _only_follows(
            edges[i], edges[j], near[i], near[j], 2 * tolerance
        ):
            continue
        points = meeting_points(edges[i], edges[j], tolerance, (near[i], near[j]))
        if points:
            cuts[i] += points
            cuts[j] += points
            meeting.append((i, j))
    _share(edges, cuts, meeting, bounds, tolerance)
    ends = [p for edge in edges for p in (edge.start, edge.end)]
    pool = PointPool(ends, [p for points in cuts for p in points], 2 * tolerance)
    stops = [_stops(edge, points, pool) for edge, points in zip(edges, cuts, strict=True)]
    return Split(
        [
            [edge]
            if len(own) == 2 and own[0] == edge.start and own[1] == edge.end and own[0] != own[1]
            else [edge.part(a, b) for a, b in pairwise(own) if a != b]
            for edge, own in zip(whole, stops, strict=True)
        ],
        any(
            abs(edge.to_left(p)) > BENT
            for edge, own in zip(edges, stops, strict=True)
            if len(own) > 2 or own[0] != edge.start or own[-1] != edge.end
            for p in own
        ),
    )


def _stay_apart(a: Edge, b: Edge, tolerance: float) -> bool:
    """Whether two arcs lie on circles that come nowhere near each other."""
    if not (isinstance(a, Arc) and isinstance(b, Arc)):
        return False
    gap, r, s = math.dist(a.centre, b.centre), a.radius, b.radius
    # Their ends may be as much as BENT off their circles.
    return max(gap - r - s, abs(r - s) - gap) > tolerance + 2 * BENT


def _only_follows(a: Edge, b: Edge, near_a: Bounds, near_b: Bounds, same: float) -> bool:
    """Whether one edge starts where the other ends, and what else is near both is one with it.

    Then neither is cut by the other.
    """
    if a.end == b.start:
        x, y = a.end
    elif a.start == b.end:
        x, y = a.start
    else:
        return False
    left, low, right, high = near_a
    left_b, low_b, right_b, high_b = near_b
    aside = max(min(right, right_b) - x, x - max(left, left_b))
    above = max(min(high, high_b) - y, y - max(low, low_b))
    return aside * aside + above * above < same * same


def _share(
    edges: Sequence[Edge],
    cuts: Sequence[list[Point]],
    meeting: Sequence[tuple[int, int]],
    bounds: Sequence[Bounds],
    tolerance: float,
) -> None:
    """Cuts edges that run along each other at the same points, those with a third edge too."""
    partners: dict[int, list[int]] = defaultdict(list)
    for i, j in meeting:
        partners[i].append(j)
        partners[j].append(i)
    new = {i: points for i, points in enumerate(cuts) if points}
    while new:
        found: dict[int, list[Point]] = defaultdict(list)
        for i, points in new.items():
            for j in partners[i]:
                low_x, low_y, high_x, high_y = widened(bounds[j], tolerance)
                for p in points:
                    if not (low_x <= p[0] <= high_x and low_y <= p[1] <= high_y):
                        continue
                    if p not in cuts[j] and distance_to(edges[j], p) < tolerance:
                        cuts[j].append(p)
                        found[j].append(p)
        new = found


def _stops(edge: Edge, points: Sequence[Point], pool: PointPool) -> list[Point]:
    """Where the parts of an edge end, from its start to its end."""
    start, end = pool.snapped(edge.start), pool.snapped(edge.end)
    if not points:
        return [start, end]
    inner = dict.fromkeys(map(pool.snapped, points))
    inner.pop(start, None)
    inner.pop(end, None)
    if not inner:
        return [start, end]
    along = {stop: edge.parameter(stop) for stop in inner}
    within = [stop for stop, t in along.items() if 0 < t < 1]
    return [start, *sorted(within, key=along.__getitem__), end]


def _merged(edges: Iterable[tuple[Edge, int]], tolerance: float) -> list[Piece]:
    """Cut edges, those that coincide as one; none where the chains wind alike on both sides."""
    between: dict[tuple[Point, Point], list[tuple[int, Edge, int]]] = defaultdict(list)
    for number, entry in enumerate(edges):
        edge, turns = entry
        a, b = edge.start, edge.end
        between[(a, b) if a < b else (b, a)].append((number, edge, turns))
    pieces: list[Piece] = []
    for ends, own in between.items():
        if len(own) == 1:
            _, edge, turns = own[0]
            pieces.append(Piece(edge, turns))
        else:
            a, b = ends
            entries = [
                (_offset(edge, a, b), number, edge, turns if edge.start == a else -turns)
                for number, edge, turns in own
            ]
            pieces += _united(entries, 4 * tolerance)
    return pieces


def _offset(edge: Edge, a: Point, b: Point) -> float:
    """How far the middle of an edge lies to the left of the chord from ``a`` to ``b``."""
    if not isinstance(edge, Arc):
        return 0.0
    x, y = edge.at(0.5)
    dx, dy = (b[0] - a[0], b[1] - a[1])
    return (dx * (y - a[1]) - dy * (x - a[0])) / math.hypot(dx, dy)


def _united(entries: list[_Entry], same: float) -> Iterator[Piece]:
    """One piece for each group of edges with common ends whose middles are near each other."""
    entries.sort()
    start = 0
    for stop in range(1, len(entries) + 1):
        if stop < len(entries) and entries[stop][0] - entries[stop - 1][0] < same:
            continue
        group, start = entries[start:stop], stop
        turns = sum(turns for *_, turns in group)
        if turns:
            edge = min(group, key=_plainest)[2]
            yield Piece(edge, turns if edge.start < edge.end else -turns)


def _plainest(entry: _Entry) -> tuple[float, Point, int]:
    """Lines first, then arcs by radius: the same choice in any order, and along a whole circle.

    Of edges that are equal but for their direction, the first.
    """
    _, number, edge, _ = entry
    if isinstance(edge, Arc):
        return edge.radius, edge.centre, number
    return 0.0, (0.0, 0.0), number
