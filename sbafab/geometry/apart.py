"""Closed chains of edges told apart: which of them meet, and which lie inside which.

Bores, lumens and outlines one inside the other make most of a laminate. Chains that stay clear of
all others are not cut and need no arrangement: how often the others wind round one of their points
says what lies on both sides of them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Final

from sbafab.geometry.edges import Arc, Bounds, Edge, Line, Point, from_end_to_end
from sbafab.geometry.intersect import meeting_points
from sbafab.geometry.kept import kept
from sbafab.geometry.nearby import close_pairs, widened
from sbafab.geometry.region import Contour
from sbafab.geometry.tidy import LEAST_AREA, tidy

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
                first, second = sorted((_first(home, i), _first(home, j)))
                home[second] = first
                continue
            own = boxes[j]
            if box[0] <= own[0] and box[1] <= own[1] and box[2] >= own[2] and box[3] >= own[3]:
                round_it[j][i] = chains[i].turns_round(chains[j])
            else:
                round_it[i][j] = chains[j].turns_round(chains[i])
    members: dict[int, list[int]] = {}
    for i in range(count):
        members.setdefault(_first(home, i), []).append(i)
    groups: list[ChainGroup] = []
    for leader, together in members.items():
        outside = {
            sum(
                chains[i].turns * turns
                for i, turns in round_it[one].items()
                if _first(home, i) != leader
            )
            for one in together
        }
        if len(outside) > 1:
            # One that meets none of them winds round some of a group only.
            return [ChainGroup(list(chains), 0)]
        groups.append(ChainGroup([chains[one] for one in together], outside.pop()))
    return groups


def _first(home: list[int], number: int) -> int:
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
    return kept(contour, "turned_round", _turned)


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
