"""Boolean operations on regions of lines and arcs, exact but for points that are made one (SAME).

Contours that meet are laid over each other; a piece stays if what is asked for lies on one side of
it only; the pieces that stay are chained into contours. Those that meet no other stay or fall whole
(``apart.py``). Nothing is flattened on the way.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache, partial
from operator import lt
from typing import Final, TypeVar

from sbafab.errors import GeometryError, InconsistentError
from sbafab.geometry.arcs import run_sweep
from sbafab.geometry.arrangement import DIGIT, Arrangement, by_owner, overlaid, overlay
from sbafab.geometry.cache import MOST, cached, stored
from sbafab.geometry.edges import (
    EPSILON,
    Arc,
    Bounds,
    Edge,
    Line,
    Point,
    distance_to,
    from_end_to_end,
    left_normal,
    quarter_arcs,
)
from sbafab.geometry.intersect import meeting_points
from sbafab.geometry.nearby import close_pairs, widened
from sbafab.geometry.region import Contour, Region, circle

Found = TypeVar("Found")
WantedTurns = Callable[[int], bool]
"""Whether a place belongs to a region, from how often chains wind round it."""

WAYS = (1, 4, 16, 64)
"""With how many EPSILON edges are cut where they meet, tried in turn; by the last, points within a
quarter of a micrometre are one.
"""


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
    own, other = ((contour, 1) for contour in a.contours), ((c, -1) for c in b.contours)
    (found,) = _enclosed([*own, *other], [_more_than(0)])
    return found


def divided(region: Region, by: Region) -> tuple[Region, Region]:
    """What of a region lies outside another, and what inside: ``region - by`` and ``region & by``.

    Both come of one arrangement.
    """
    if region.is_empty or by.is_empty:
        return region, Region()
    return _divided(region, by)


@cached
def _divided(region: Region, by: Region) -> tuple[Region, Region]:
    own, other = ((c, 1) for c in region.contours), ((c, 1 << DIGIT) for c in by.contours)
    outside, inside = _enclosed([*own, *other], [_is_outside, _is_inside])
    return outside, inside


@lru_cache(maxsize=MOST)
def _is_outside(turns: int) -> bool:
    """Whether the first of two regions is there alone."""
    own, other = by_owner(turns, 2)
    return own > 0 >= other


@lru_cache(maxsize=MOST)
def _is_inside(turns: int) -> bool:
    """Whether both of two regions are there."""
    own, other = by_owner(turns, 2)
    return own > 0 and other > 0


def _more_than(turns: int) -> WantedTurns:
    """Wanted is what chains wind round more often than so."""
    return partial(lt, turns)


def wound(edges: Sequence[Edge], above: int) -> Region:
    """The points that closed chains of edges wind round more than ``above`` times.

    Raises GeometryError where no way to cut the edges where they meet gives one answer.
    """
    return arranged([edges], partial(_wound, above))


def _wound(above: int, found: Arrangement) -> Region:
    return _region(_loops(found, _more_than(above)))


def enclosed(contours: Iterable[Contour], above: int = 0) -> Region:
    """The same for contours, each a closed chain by itself."""
    (found,) = _enclosed([(contour, 1) for contour in contours], [_more_than(above)])
    return found


def _enclosed(chains: Iterable[Wound], wanted: Sequence[WantedTurns]) -> list[Region]:
    """The regions of the places that are wanted, from how often chains wind round them."""
    found: list[list[Contour]] = [[] for _ in wanted]
    for group in grouped(chains_of(chains)):
        if group.is_alone:
            own = [_whole(group.chains[0], group.outside, is_in) for is_in in wanted]
        else:
            own = _cut(group, wanted)
        for contours, more in zip(found, own, strict=True):
            contours.extend(more)
    return [Region(in_reading_order(contours)) for contours in found]


def _whole(chain: ClosedChain, outside: int, wanted: WantedTurns) -> list[Contour]:
    """A chain that nothing meets, with the material on its left; nothing if it bounds none."""
    contour = chain.contour
    inside = outside + (-chain.turns if contour.is_hole else chain.turns)
    if wanted(inside) == wanted(outside):
        return []
    return [contour if wanted(outside) == contour.is_hole else turned_round(contour)]


def _cut(group: ChainGroup, wanted: Sequence[WantedTurns]) -> list[list[Contour]]:
    """The contours of each region, where chains meet each other."""
    return _in_some_way(partial(_cut_with, group, wanted))


def _cut_with(
    group: ChainGroup, wanted: Sequence[WantedTurns], tolerance: float
) -> list[list[Contour]]:
    found = Arrangement(overlay(group.edges, tolerance, group.clear))
    return [_contours(_loops(found, is_in, group.outside)) for is_in in wanted]


def _loops(found: Arrangement, wanted: WantedTurns, outside: int = 0) -> Iterable[Sequence[Edge]]:
    """Loops round what is wanted, where other chains wind so often round all of it."""
    return found.loops(
        found.edging({turns for turns in set(found.left) if wanted(turns + outside)})
    )


def _contours(loops: Iterable[Sequence[Edge]]) -> list[Contour]:
    return [settled(contour) for contour in map(tidy, loops) if contour is not None]


def _region(loops: Iterable[Sequence[Edge]]) -> Region:
    """The region inside closed chains that meet nowhere."""
    return Region(in_reading_order(_contours(loops)))


def arranged(owners: Sequence[Iterable[Edge]], read: Callable[[Arrangement], Found]) -> Found:
    """What is read from the closed chains of edges of all owners, laid over each other.

    Raises GeometryError where no way to cut the edges where they meet gives one answer.
    """
    return _in_some_way(partial(_arranged_with, owners, read))


def _arranged_with(
    owners: Sequence[Iterable[Edge]], read: Callable[[Arrangement], Found], tolerance: float
) -> Found:
    return read(Arrangement(overlaid(owners, tolerance)))


def _in_some_way(read: Callable[[float], Found]) -> Found:
    """What is read where edges are cut with a tolerance, the finest that gives one answer."""
    place: Point | None = None
    for coarser in WAYS:
        try:
            return read(coarser * EPSILON)
        except InconsistentError as fault:
            place = place or fault.args[0]
    x, y = place or (0.0, 0.0)
    raise GeometryError(
        f"edges that nearly meet at x {x:.6f}, y {y:.6f} cannot be told apart; change a size "
        "there by 0.001 mm"
    )


# Closed chains of edges told apart: which of them meet, and which lie inside which.
#
# Bores, lumens and outlines one inside the other make most of a laminate. Chains that stay clear
# of all others are not cut and need no arrangement: how often the others wind round one of their
# points says what lies on both sides of them.


FAR: Final = 1e-3
"""mm: chains that stay so far from each other are not cut, however coarsely points are made one."""

Wound = tuple[Contour, int]
"""A closed chain of edges, and how often it counts."""


class ClosedChain:
    """A closed chain, and how often it and its twins count together.

    ``drawn`` is the first of them; ``contour`` is what a boolean leaves of it where nothing meets
    it, if it is ``alone``: where it stays clear of itself.
    """

    __slots__ = ("alone", "circle", "contour", "drawn", "start", "turns")

    def __init__(self, contour: Contour, turns: int) -> None:
        whole = alone(contour)
        self.alone = whole is not None
        self.drawn = contour
        self.contour = whole or contour
        self.circle = whole.circle if whole is not None else None
        self.turns = turns
        self.start: Point = self.contour.edges[0].start

    def turns_round(self, other: ClosedChain) -> int:
        """How often its contour winds round another chain that it stays clear of."""
        if self.circle is None:
            return self.contour.winding(other.start)
        (centre, radius) = self.circle
        if math.dist(centre, other.start) > radius:
            return 0
        return -1 if self.contour.is_hole else 1


def chains_of(wound: Iterable[Wound]) -> list[ClosedChain]:
    """Chains in the order of their first, those that run along the same edges as one.

    What cancels out is left out.
    """
    found: list[ClosedChain] = []
    circles: dict[tuple[Point, float], ClosedChain] = {}
    others: dict[Edge, list[ClosedChain]] = {}
    for contour, turns in wound:
        chain = ClosedChain(contour, turns)
        if chain.circle is not None:
            twin = circles.setdefault(chain.circle, chain)
            if twin is not chain:
                alike = twin.contour.is_hole == chain.contour.is_hole
                twin.turns += turns if alike else -turns
                continue
        elif chain.alone:
            edges = chain.contour.edges
            filed = others.setdefault(edges[0], [])
            known = next((one for one in filed if one.contour.edges == edges), None)
            if known is not None:
                known.turns += turns
                continue
            filed.append(chain)
        found.append(chain)
    return [chain for chain in found if chain.turns]


class ChainGroup:
    """Chains that meet, or one that stays clear of all others.

    The chains of all other groups wind round it ``outside`` times.
    """

    __slots__ = ("chains", "outside")

    def __init__(self, chains: list[ClosedChain], outside: int) -> None:
        self.chains = chains
        self.outside = outside

    @property
    def is_alone(self) -> bool:
        """Whether it is one chain that meets nothing."""
        return len(self.chains) == 1 and self.chains[0].alone

    @property
    def edges(self) -> list[tuple[Edge, int]]:
        """The edges of all its chains, and how often each counts."""
        return [(edge, chain.turns) for chain in self.chains for edge in chain.drawn.edges]

    @property
    def clear(self) -> list[int]:
        """For each edge a number of its chain; -1 where that may meet itself."""
        return [
            number if chain.alone else -1
            for number, chain in enumerate(self.chains)
            for _ in chain.drawn.edges
        ]


def grouped(chains: Sequence[ClosedChain]) -> list[ChainGroup]:
    """Chains by groups that stay clear of each other."""
    count = len(chains)
    home = list(range(count))
    round_it: list[dict[int, int]] = [{} for _ in range(count)]
    boxes = [chain.contour.bounds for chain in chains]
    for j in range(count):
        left, low, right, high = widened(boxes[j], FAR)
        for i in range(j):
            box = boxes[i]
            if box[0] > right or box[2] < left or box[1] > high or box[3] < low:
                continue
            if _meet(chains[i], chains[j]):
                first, second = sorted((_home(home, i), _home(home, j)))
                home[second] = first
                continue
            own = boxes[j]
            if box[0] <= own[0] and box[1] <= own[1] and box[2] >= own[2] and box[3] >= own[3]:
                round_it[j][i] = chains[i].turns_round(chains[j])
            else:
                round_it[i][j] = chains[j].turns_round(chains[i])
    members: dict[int, list[int]] = {}
    for i in range(count):
        members.setdefault(_home(home, i), []).append(i)
    groups: list[ChainGroup] = []
    for leader, together in members.items():
        outside = {
            sum(
                chains[i].turns * turns
                for i, turns in round_it[one].items()
                if _home(home, i) != leader
            )
            for one in together
        }
        if len(outside) > 1:
            # One that meets none of them winds round some of a group only.
            return [ChainGroup(list(chains), 0)]
        groups.append(ChainGroup([chains[one] for one in together], outside.pop()))
    return groups


def _home(home: list[int], number: int) -> int:
    while home[number] != number:
        number = home[number]
    return number


def _meet(a: ClosedChain, b: ClosedChain) -> bool:
    """Whether two chains may come within FAR of each other."""
    if a.circle is not None and b.circle is not None:
        one, r = a.circle
        other, s = b.circle
        gap = math.dist(one, other)
        return not max(gap - r - s, abs(r - s) - gap) > FAR
    edges, boxes = b.contour.edges, b.contour.boxes
    low_x, low_y, high_x, high_y = widened(b.contour.bounds, FAR)
    for edge, own in zip(a.contour.edges, a.contour.boxes, strict=True):
        if own[0] > high_x or own[2] < low_x or own[1] > high_y or own[3] < low_y:
            continue
        if not _clear_of_all(edge, own, edges, boxes):
            return True
    return False


def _clear_of_all(
    edge: Edge, box: Bounds, others: tuple[Edge, ...], boxes: tuple[Bounds, ...]
) -> bool:
    """Whether an edge surely stays farther than FAR from all others."""
    left, low, right, high = widened(box, FAR)
    for other, own in zip(others, boxes, strict=True):
        meets = own[0] <= right and own[2] >= left and own[1] <= high and own[3] >= low
        if meets and not _clear(edge, other):
            return False
    return True


def _clear(a: Edge, b: Edge) -> bool:
    """Whether two edges surely stay farther than FAR from each other."""
    if isinstance(a, Arc):
        if isinstance(b, Arc):
            gap = math.dist(a.centre, b.centre)
            r, s = a.radius, b.radius
            if max(gap - r - s, abs(r - s) - gap) > FAR:
                return True
        elif _clear_of_circle(b, a):
            return True
    elif isinstance(b, Arc) and _clear_of_circle(a, b):
        return True
    return not meeting_points(a, b, FAR)


def _clear_of_circle(line: Line, arc: Arc) -> bool:
    """Whether a line keeps clear of an arc's whole circle, outside or inside."""
    if abs(line.to_left(arc.centre)) > arc.radius + FAR:
        return True
    return line.farthest_from(arc.centre) < arc.radius - FAR


def alone(contour: Contour) -> Contour | None:
    """What a boolean leaves of a contour that no other meets; None where it may meet itself."""
    known = contour.__dict__
    if "alone" not in known:
        found = tidy(contour.edges) if _keeps_clear(contour) else None
        # No contour is kept within itself, or it would outlive its last use.
        known["alone"] = found is not None and (found.edges == contour.edges or found)
        if found is not None:
            found.__dict__["alone"] = True
    whole: Contour | bool = known["alone"]
    if isinstance(whole, bool):
        return contour if whole else None
    return whole


def settled(contour: Contour) -> Contour:
    """A contour that has been cut where it meets others or itself, and needs not be once more."""
    contour.__dict__["alone"] = True
    return contour


def meets_itself(contour: Contour) -> Contour:
    """A contour that is known to come near itself, so that nobody looks."""
    contour.__dict__["alone"] = False
    return contour


def turned_round(contour: Contour) -> Contour:
    """What a boolean leaves of a contour that is alone where the material is on its other side."""
    return stored(contour, "turned_round", _turned)


def _turned(contour: Contour) -> Contour:
    turned = contour.reversed()
    whole = turned if contour.circle is not None else tidy(turned.edges)
    assert whole is not None
    return settled(whole)


def _keeps_clear(contour: Contour) -> bool:
    """Whether no edges of a contour come within FAR of each other but where one follows another."""
    edges, count = contour.edges, len(contour.edges)
    least = max(LEAST_AREA, FAR * contour.length)
    if abs(contour.area) < least or any(from_end_to_end(edge) is not edge for edge in edges):
        return False
    if contour.circle is not None:
        _, radius = contour.circle
        whole = abs(abs(contour.area) - math.pi * radius * radius) < FAR * radius
        same = {(e.centre, e.radius) for e in edges if isinstance(e, Arc)}
        return whole and len(same) == 1 and radius > FAR
    for i, j in close_pairs(contour.boxes, FAR):
        a, b = (edges[i], edges[j]) if i < j else (edges[j], edges[i])
        apart = abs(i - j)
        if 1 < apart < count - 1:
            if not _clear(a, b):
                return False
            continue
        shared = {a.start, a.end} & {b.start, b.end}
        if min(math.dist(a.start, a.end), math.dist(b.start, b.end)) < 4 * FAR:
            return False
        if not set(meeting_points(a, b)) <= shared:
            return False
    return True


# Contours as booleans hand them out: edges of one support joined, dust left out.


LEAST_AREA = 1e-7
"""Contours that enclose less, in mm2, are rounding dust; so are those thinner than 4 EPSILON, as
they are on average where no place in them is ROOM wide.
"""
ROOM = 50 * EPSILON
"""mm: a tenth of a micrometre."""
QUARTER = math.pi / 2
NANOMETRE = 1e-6
"""mm."""


def tidy(loop: Sequence[Edge]) -> Contour | None:
    """One contour with edges of one support joined and arcs of at most a quarter turn."""
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
    """Whether there is a place in a contour of hardly any width, beside an edge, that is ROOM wide.

    A long sliver would hide it in its average.
    """
    into = -ROOM / 2 if contour.area < 0 else ROOM / 2
    for edge in contour.edges:
        if edge.length < ROOM:
            continue
        for share in (0.25, 0.5, 0.75):
            x, y = edge.at(share)
            nx, ny = left_normal(edge, (x, y))
            p = (x + into * nx, y + into * ny)
            if contour.winding(p) and all(
                distance_to(other, p) > 0.99 * ROOM / 2 for other in contour.edges
            ):
                return True
    return False


def _first_edge(edges: Sequence[Edge]) -> int:
    """The first edge of those that start at the least x, and of these at the least y, to 1 nm."""
    left = min([edge.start[0] for edge in edges]) + 2 * NANOMETRE
    found, least = 0, (math.inf, math.inf)
    for i, edge in enumerate(edges):
        x, y = edge.start
        # What lies farther to the right is not rounded to the least x.
        if x <= left and (place := (nanometres(x), nanometres(y))) < least:
            found, least = i, place
    return found


def _joined(run: Sequence[Edge]) -> Sequence[Edge]:
    head, end = run[0], run[-1].end
    if isinstance(head, Line):
        return [Line(head.start, end)]
    if len(run) == 1 and 0 < (head.sweep if head.ccw else -head.sweep) < QUARTER:
        return run
    return quarter_arcs(head.start, end, head.centre, head.radius, run_sweep(run))


# Coordinates in whole nanometres: shapes that differ by a hair come in one order.


def nanometres(value: float) -> int:
    """The whole nanometres nearest to so many mm."""
    return math.floor(value * 1e6 + 0.5)


def in_reading_order(contours: Sequence[Contour]) -> tuple[Contour, ...]:
    """Outer contours, then holes, each from left to right."""
    # Most regions have one or two.
    return tuple(sorted(contours, key=_reading_order) if len(contours) > 1 else contours)


def _reading_order(contour: Contour) -> tuple[bool, int, int, int]:
    low_x, low_y, high_x, _ = contour.bounds
    return contour.is_hole, nanometres(low_x), nanometres(low_y), nanometres(high_x)
