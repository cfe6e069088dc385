"""Boolean operations on contours of lines and arcs, exact except that points within SAME merge.

Contours that meet are overlaid; a piece is kept if the result lies on only one side of it, and
these pieces are chained into contours. Isolated contours are kept or dropped whole. Arcs are never
flattened.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from operator import lt
from typing import NamedTuple, TypeVar

from sbafab.errors import GeometryError, InconsistentError
from sbafab.geometry.arrangement import Arrangement, overlaid, overlay
from sbafab.geometry.cache import stored
from sbafab.geometry.contour import LEAST_AREA, Contour, in_reading_order, tidy
from sbafab.geometry.edges import (
    EPSILON,
    Arc,
    Bounds,
    Edge,
    Line,
    Point,
    from_end_to_end,
    meeting_points,
)
from sbafab.geometry.spatial_index import close_pairs, widened

Result = TypeVar("Result")
Membership = Callable[[int], bool]
"""True if a place belongs to a region, from the winding number of the chains there."""
CountedContour = tuple[Contour, int]
"""A contour, and how many times it counts."""

TOLERANCES = (1, 4, 16, 64)
"""Cutting tolerances as multiples of EPSILON, tried in turn; the last one merges points within
a quarter of a micrometre.
"""


def more_than(turns: int) -> Membership:
    """Return the membership of points with a winding number above ``turns``."""
    return partial(lt, turns)


def combined(
    contours: Iterable[CountedContour], memberships: Sequence[Membership]
) -> list[tuple[Contour, ...]]:
    """Return the contours of a region for each membership, in reading order.

    Raises GeometryError if no tolerance gives a consistent result.
    """
    results: list[list[Contour]] = [[] for _ in memberships]
    for group in grouped(chains_of(contours)):
        if group.is_alone:
            parts = [_whole(group.chains[0], group.outside, is_in) for is_in in memberships]
        else:
            parts = _in_some_way(partial(_cut, group, memberships))
        for result, part in zip(results, parts, strict=True):
            result.extend(part)
    return [in_reading_order(result) for result in results]


def _whole(chain: ClosedChain, outside: int, is_in: Membership) -> list[Contour]:
    """An isolated chain with the material on its left; empty if it bounds no material."""
    contour = chain.contour
    inside = outside + (-chain.turns if contour.is_hole else chain.turns)
    if is_in(inside) == is_in(outside):
        return []
    return [contour if is_in(outside) == contour.is_hole else turned_round(contour)]


def _cut(
    group: ChainGroup, memberships: Sequence[Membership], tolerance: float
) -> list[list[Contour]]:
    """Return the contours of each region for chains that meet."""
    arrangement = Arrangement(overlay(group.edges, tolerance, group.clear))
    return [bounding(arrangement, is_in, group.outside) for is_in in memberships]


def bounding(arrangement: Arrangement, is_in: Membership, outside: int = 0) -> list[Contour]:
    """Return contours around the faces of a membership; ``outside`` is added to winding numbers."""
    turns = {turns for turns in set(arrangement.left) if is_in(turns + outside)}
    loops = map(tidy, arrangement.loops(arrangement.edging(turns)))
    return [settled(contour) for contour in loops if contour is not None]


def arranged(owners: Sequence[Iterable[Edge]], read: Callable[[Arrangement], Result]) -> Result:
    """Return ``read`` for the overlaid closed chains of edges of all owners.

    Raises GeometryError if no tolerance gives a consistent result.
    """
    return _in_some_way(lambda tolerance: read(Arrangement(overlaid(owners, tolerance))))


def _in_some_way(read: Callable[[float], Result]) -> Result:
    """Return ``read`` at the finest cutting tolerance that gives a consistent result."""
    place: Point | None = None
    for coarser in TOLERANCES:
        try:
            return read(coarser * EPSILON)
        except InconsistentError as fault:
            place = place or fault.args[0]
    x, y = place or (0.0, 0.0)
    raise GeometryError(
        f"edges that nearly meet at x {x:.6f}, y {y:.6f} cannot be distinguished; change a "
        "dimension there by 0.001 mm"
    )


# Groups of closed chains that meet, and their nesting.
#
# Most of a laminate consists of nested bores, lumens and outlines. Chains that stay clear of all
# others are not cut and need no arrangement: the winding number of the others round one of their
# points gives the numbers on both sides.


FAR = 1e-3
"""mm: chains at least this far apart are not cut, at any tolerance."""


class ClosedChain:
    """A closed chain, and the total count of it and its duplicates.

    ``outline`` is the first of them; ``contour`` is its tidy form if it is ``alone``, that is, does
    not meet itself.
    """

    __slots__ = ("alone", "circle", "contour", "outline", "start", "turns")

    def __init__(self, contour: Contour, turns: int) -> None:
        whole = alone(contour)
        self.alone = whole is not None
        self.outline = contour
        self.contour = whole or contour
        self.circle = whole.circle if whole is not None else None
        self.turns = turns
        self.start: Point = self.contour.edges[0].start

    def turns_round(self, chain: ClosedChain) -> int:
        """Return the contour's winding number around another chain that does not meet it."""
        if self.circle is None:
            return self.contour.winding(chain.start)
        (centre, radius) = self.circle
        if math.dist(centre, chain.start) > radius:
            return 0
        return -1 if self.contour.is_hole else 1


def chains_of(contours: Iterable[CountedContour]) -> list[ClosedChain]:
    """Return chains in order of first appearance, with coincident chains merged.

    Chains that cancel out are omitted.
    """
    chains: list[ClosedChain] = []
    circles: dict[tuple[Point, float], ClosedChain] = {}
    by_edge: dict[Edge, list[ClosedChain]] = {}
    for contour, turns in contours:
        chain = ClosedChain(contour, turns)
        if chain.circle is not None:
            twin = circles.setdefault(chain.circle, chain)
            if twin is not chain:
                same_way = twin.contour.is_hole == chain.contour.is_hole
                twin.turns += turns if same_way else -turns
                continue
        elif chain.alone:
            edges = chain.contour.edges
            candidates = by_edge.setdefault(edges[0], [])
            equal = next((first for first in candidates if first.contour.edges == edges), None)
            if equal is not None:
                equal.turns += turns
                continue
            candidates.append(chain)
        chains.append(chain)
    return [chain for chain in chains if chain.turns]


class ChainGroup(NamedTuple):
    """Chains that meet, or one isolated chain.

    The chains of all other groups wind around it ``outside`` times.
    """

    chains: list[ClosedChain]
    outside: int

    @property
    def is_alone(self) -> bool:
        """True if it is one isolated chain."""
        return len(self.chains) == 1 and self.chains[0].alone

    @property
    def edges(self) -> list[tuple[Edge, int]]:
        """The edges of all its chains, with their counts."""
        return [(edge, chain.turns) for chain in self.chains for edge in chain.outline.edges]

    @property
    def clear(self) -> list[int]:
        """The chain number of each edge; -1 if the chain may meet itself."""
        numbers = [number if chain.alone else -1 for number, chain in enumerate(self.chains)]
        return [n for n, c in zip(numbers, self.chains, strict=True) for _ in c.outline.edges]


def grouped(chains: Sequence[ClosedChain]) -> list[ChainGroup]:
    """Return the chains in groups that do not meet each other."""
    count = len(chains)
    home = list(range(count))
    windings: list[dict[int, int]] = [{} for _ in range(count)]
    """For each chain, the winding numbers of others round it."""
    boxes = [chain.contour.bounds for chain in chains]
    for j in range(count):
        low_x, low_y, high_x, high_y = widened(boxes[j], FAR)
        for i in range(j):
            a, b = boxes[i], boxes[j]
            if a[0] > high_x or a[2] < low_x or a[1] > high_y or a[3] < low_y:
                continue
            if _meet(chains[i], chains[j]):
                first, second = sorted((_home(home, i), _home(home, j)))
                home[second] = first
            elif a[0] <= b[0] and a[1] <= b[1] and a[2] >= b[2] and a[3] >= b[3]:
                windings[j][i] = chains[i].turns_round(chains[j])
            else:
                windings[i][j] = chains[j].turns_round(chains[i])
    members: dict[int, list[int]] = {}
    for i in range(count):
        members.setdefault(_home(home, i), []).append(i)
    groups: list[ChainGroup] = []
    for leader, numbers in members.items():
        outside = {
            sum(
                chains[i].turns * turns
                for i, turns in windings[number].items()
                if _home(home, i) != leader
            )
            for number in numbers
        }
        if len(outside) > 1:
            # A chain that meets none of them may wind round only part of a group.
            return [ChainGroup(list(chains), 0)]
        groups.append(ChainGroup([chains[number] for number in numbers], outside.pop()))
    return groups


def _home(home: list[int], number: int) -> int:
    while home[number] != number:
        number = home[number]
    return number


def _meet(a: ClosedChain, b: ClosedChain) -> bool:
    """Return True if two chains may come within FAR of each other."""
    if a.circle is not None and b.circle is not None:
        (p, r), (q, s) = a.circle, b.circle
        gap = math.dist(p, q)
        return not max(gap - r - s, abs(r - s) - gap) > FAR
    edges, boxes = b.contour.edges, b.contour.boxes
    low_x, low_y, high_x, high_y = widened(b.contour.bounds, FAR)
    for edge, box in zip(a.contour.edges, a.contour.boxes, strict=True):
        if box[0] > high_x or box[2] < low_x or box[1] > high_y or box[3] < low_y:
            continue
        if not _clear_of_all(edge, box, edges, boxes):
            return True
    return False


def _clear_of_all(
    edge: Edge, box: Bounds, obstacles: tuple[Edge, ...], boxes: tuple[Bounds, ...]
) -> bool:
    """Return True if an edge is certain to stay farther than FAR from all obstacles."""
    low_x, low_y, high_x, high_y = widened(box, FAR)
    for obstacle, b in zip(obstacles, boxes, strict=True):
        meets = b[0] <= high_x and b[2] >= low_x and b[1] <= high_y and b[3] >= low_y
        if meets and not _clear(edge, obstacle):
            return False
    return True


def _clear(a: Edge, b: Edge) -> bool:
    """Return True if two edges are certain to stay farther than FAR from each other."""
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
    """Return True if a line stays clear of an arc's whole circle, outside or inside."""
    if abs(line.to_left(arc.centre)) > arc.radius + FAR:
        return True
    return line.farthest_from(arc.centre) < arc.radius - FAR


def alone(contour: Contour) -> Contour | None:
    """Return the tidy form of a contour that does not meet itself; None if it may."""
    values = contour.__dict__
    if "alone" not in values:
        form = tidy(contour.edges) if _keeps_clear(contour) else None
        # Do not store a contour within itself: it would never be freed.
        values["alone"] = form is not None and (form.edges == contour.edges or form)
        if form is not None:
            form.__dict__["alone"] = True
    whole: Contour | bool = values["alone"]
    if isinstance(whole, bool):
        return contour if whole else None
    return whole


def settled(contour: Contour) -> Contour:
    """Mark a contour as free of self-intersections, since its edges were cut at intersections."""
    contour.__dict__["alone"] = True
    return contour


def meets_itself(contour: Contour) -> Contour:
    """Mark a contour that comes near itself, so that ``alone`` skips the test."""
    contour.__dict__["alone"] = False
    return contour


def turned_round(contour: Contour) -> Contour:
    """Return the reversed tidy form of a contour that is ``alone``."""
    return stored(contour, "turned_round", _turned)


def _turned(contour: Contour) -> Contour:
    turned = contour.reversed()
    whole = turned if contour.circle is not None else tidy(turned.edges)
    assert whole is not None
    return settled(whole)


def _keeps_clear(contour: Contour) -> bool:
    """Return True if only consecutive edges come within FAR of each other."""
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
