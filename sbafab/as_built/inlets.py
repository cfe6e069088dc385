"""Inlet tabs, the mouths of their strips and the chambers they feed, found in the profiles."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from sbafab.geometry.edges import Edge, Line, Point
from sbafab.geometry.region import Region
from sbafab.geometry.tidy import tidy
from sbafab.laminate.interfaces import Interface
from sbafab.rules.boundary import edges_along
from sbafab.rules.limits import TOLERANCE

SQUARE = 0.1
"""Cosine up to which a tab's corner counts as square: a turned layer still has its tabs."""
ROUNDED_OFF = 0.9
"""The same where a large fillet takes all of a short tab's sides, and comes aslant to its end."""
STEP = 0.05


class Tab(NamedTuple):
    """A square-ended tab: the middle of its end, unit vector outward, its width, its straight run.

    ``mouth`` holds the ends of the strip in the tab's end, as offsets from the middle; None where
    no strip reaches it.
    """

    end: Point
    direction: Point
    width: float
    run: float
    mouth: tuple[float, float] | None

    def at(self, depth: float, offset: float = 0.0) -> Point:
        (x, y), (dx, dy) = self.end, self.direction
        return x - dx * depth + dy * offset, y - dy * depth - dx * offset

    def depth(self, p: Point) -> float:
        (x, y), (dx, dy) = self.end, self.direction
        return (x - p[0]) * dx + (y - p[1]) * dy

    def offset(self, p: Point) -> float:
        (x, y), (dx, dy) = self.end, self.direction
        return (p[0] - x) * dy - (p[1] - y) * dx

    @property
    def middle(self) -> Point:
        """The middle of the mouth, or of the tab's end."""
        return self.at(0.0, sum(self.mouth) / 2) if self.mouth else self.end


def tabs(interface: Interface, tooling: Sequence[Point]) -> list[Tab]:
    """The inlet tabs of a chamber interface; those with a tooling hole are ears."""
    found = []
    for tab in _square_ends(interface.contact):
        is_ear = any(
            0 <= tab.depth(p) <= tab.run + tab.width and abs(tab.offset(p)) <= tab.width / 2
            for p in tooling
        )
        if not is_ear:
            found.append(tab._replace(mouth=_mouth(tab, interface)))
    if not found:
        # Other convex corners may lie beside any straight edge: only a strip tells a tab there.
        aslant = (
            tab._replace(mouth=_mouth(tab, interface))
            for tab in _square_ends(interface.contact, ROUNDED_OFF)
        )
        found += [tab for tab in aslant if tab.mouth]
    return found


def _square_ends(contact: Region, square: float = SQUARE) -> Iterator[Tab]:
    for outer in contact.outers:
        edges = (tidy(outer.edges) or outer).edges
        for i, edge in enumerate(edges):
            before, after = edges[i - 1], edges[(i + 1) % len(edges)]
            if (
                isinstance(edge, Line)
                and _turns_square(before, edge, square)
                and _turns_square(edge, after, square)
            ):
                ux, uy = edge.direction(edge.start)
                run = min(_straight(before), _straight(after))
                yield Tab(edge.at(0.5), (uy, -ux), edge.length, run, None)


def _straight(side: Edge) -> float:
    """How far a tab's side runs straight: not at all where its fillet reaches the end."""
    return side.length if isinstance(side, Line) else 0.0


def _turns_square(one: Edge, other: Edge, square: float) -> bool:
    """Whether two edges meet in a convex corner, no further off a right angle than ``square``."""
    (ux, uy), (vx, vy) = one.direction(one.end), other.direction(other.start)
    return abs(ux * vx + uy * vy) < square and ux * vy - uy * vx > 0


def _mouth(tab: Tab, interface: Interface) -> tuple[float, float] | None:
    offsets = [
        tab.offset(p)
        for edge in edges_along(interface.unbonded, interface.contact)
        if abs(tab.depth(edge.start)) < TOLERANCE and abs(tab.depth(edge.end)) < TOLERANCE
        for p in (edge.start, edge.end)
        if abs(tab.offset(p)) <= tab.width / 2 + TOLERANCE
    ]
    return (min(offsets), max(offsets)) if offsets else None


def feeding(tabs: Sequence[Tab], place: Point, interface: Interface) -> int:
    """Which tab feeds the channel or pocket at ``place``.

    The nearest of those whose strip opens into the same pocket; else of those whose strip opens
    into none; else of all.
    """
    pockets = interface.unbonded.pieces if not interface.unbonded.is_empty else ()
    holding = [piece for piece in pockets if _holds(piece, place)]
    opens = [
        [piece for piece in pockets if tab.mouth and _holds(piece, _just_inside(tab))]
        for tab in tabs
    ]
    own = [n for n, into in enumerate(opens) if any(piece in holding for piece in into)]
    lost = [n for n, into in enumerate(opens) if not into]
    candidates = own or lost or range(len(tabs))
    return min(candidates, key=lambda n: round(math.dist(tabs[n].middle, place), 6))


def inner_point(tab: Tab, interface: Interface) -> Point:
    """A point of the pocket behind a tab: half way through what lies beyond the tab's run."""
    for region in (interface.unbonded, interface.contact):
        depth = tab.run + STEP
        offset = tab.offset(tab.middle)
        while region.contains(tab.at(depth, offset)):
            depth += STEP
        if depth > tab.run + 10 * STEP:
            return tab.at((tab.run + depth) / 2, offset)
    return tab.at(tab.run + tab.width)


def _just_inside(tab: Tab) -> Point:
    return tab.at(10 * TOLERANCE, tab.offset(tab.middle))


def _holds(piece: Region, p: Point) -> bool:
    return any(outer.winding(p) != 0 for outer in piece.outers)
