"""Overlaps of seams: where one ends on another or past the edge of a film, and parts two voids.

Each seam lies off its path as a whole. Two of them meet in any case if one must be moved farther
than both errors together until it leaves the other, whichever way. That is asked of two at a time,
so that neither the number of seams nor their order matters.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import combinations
from typing import Final, NamedTuple

from sbafab.geometry.edges import Arc, Edge, Point, distance_to
from sbafab.geometry.nearby import boxes_meet, widened
from sbafab.geometry.offset import dragged, grow, shortened, shrink, swept
from sbafab.geometry.region import Region, rectangle, union
from sbafab.laminate.folding import lies_on
from sbafab.laminate.joints import Seam, SeamTool
from sbafab.laminate.laminate import Interface, Laminate
from sbafab.rules.voids import OUTSIDE, Cavity, VoidGraph, cavities, void_graph

NEAR: Final = 1e-5
"""mm within which a void touches the corner of an overlap."""
PART: Final = 0.5
"""Radians that a part of an arc turns by at most."""

Error = Callable[[SeamTool], float]
"""Farthest that a seam of a tool lies off its path, mm."""


class Overlap(NamedTuple):
    """An overlap of a seam with another one, or with what lies past a film's edge.

    They meet no more once the ``seam`` has moved by ``depth``, mm, along the unit vector ``way``,
    and by no less in any direction. ``seam`` and ``other`` are places among the interface's seams;
    in place of the other, ``film`` is 0 for the edge of the film below, 1 for that above.
    """

    seam: int
    other: int | None
    film: int | None
    depth: float
    way: Point
    at: Point


def overlaps_of(
    laminate: Laminate, interfaces: Sequence[Interface], error: Error
) -> list[list[Overlap]]:
    """Return the overlaps of each interface that part two voids; none where films are pressed."""
    if all(gap.pressed or not gap.seams for gap in interfaces):
        return [[] for _ in interfaces]
    graph = void_graph(laminate)
    every = cavities(laminate, graph)
    return [
        [] if gap.pressed else list(_Seams(gap, _Voids.of(gap, graph, every), error).overlaps())
        for gap in interfaces
    ]


class _Voids(NamedTuple):
    """Cavities of an interface by name, those open to the outside under one, and the outer edges
    of its contact, but for folds.
    """

    cavities: Sequence[tuple[object, Region]]
    rim: Sequence[Edge]

    @staticmethod
    def of(gap: Interface, graph: VoidGraph, every: Sequence[Cavity]) -> _Voids:
        named = [
            (OUTSIDE if any(OUTSIDE in graph.joins.get(v, ()) for v in c.voids) else n, c.region)
            for n, c in enumerate(every)
            if c.interface == gap.index
        ]
        outer = [edge for contour in gap.contact.outers for edge in contour.edges]
        return _Voids(named, [edge for edge in outer if not lies_on(edge, gap.fold_lines)])

    def are_parted_by(self, overlap: Region, near: float) -> bool:
        """Return True if an overlap touches two voids, of which the outside is one."""
        names: set[object] = set()
        for p in {edge.start for edge in overlap.edges}:
            here = {name for name, void in self.cavities if void.distance_to_edge(p) <= near}
            names |= here or ({OUTSIDE} if _is_on(p, self.rim) else set())
        return len(names) > 1


class _Seams(NamedTuple):
    """The seams of an interface that is bonded by them alone, and the voids between them."""

    gap: Interface
    voids: _Voids
    error: Error

    def overlaps(self) -> Iterator[Overlap]:
        seams, bare = self.gap.seams, self.gap.contact - self.gap.mask
        inside = Region(self.gap.contact.outers)
        # A roller's ends are square: of two seams the other is moved along its path.
        numbered = sorted(enumerate(seams), key=lambda pair: pair[1].tool == "roller")
        for (a, seam), (b, other) in combinations(numbered, 2):
            if not boxes_meet(seam.region.bounds, other.region.bounds):
                continue
            reach = max(seam.width + other.width, self.error(seam.tool) + self.error(other.tool))
            for piece in (seam.region & other.region & bare).pieces:
                if self._is_needed(piece, (seam, other)):
                    body = other.region & _swath(_edges_near(piece, other, reach), other.width)
                    yield Overlap(a, b, None, *_depth(seam, body, piece, reach), _middle(piece))
        for a, seam in enumerate(seams):
            reach = max(2 * seam.width, self.error(seam.tool))
            for piece in (seam.region - inside).pieces:
                if self._is_needed(piece, (seam,)):
                    left, low, right, high = widened(piece.bounds, 2 * reach)
                    body = rectangle((left, low), (right, high)) - inside
                    depth, way = _depth(seam, body, piece, reach)
                    for film in self._films_at(piece):
                        yield Overlap(a, None, film, depth, way, _middle(piece))

    def _is_needed(self, overlap: Region, seams: Sequence[Seam]) -> bool:
        """Return True if two voids are joined when these seams no longer meet there.

        Where a further seam covers the overlap, but for what it and they may lie off, none are.
        """
        further = [
            seam
            for seam in self.gap.seams
            if seam not in seams and boxes_meet(seam.region.bounds, overlap.bounds)
        ]
        near, off = NEAR, max(self.error(seam.tool) for seam in seams)
        for seam in further:
            if not (seam.region & overlap).is_empty:
                near = max(near, off + self.error(seam.tool))
                overlap -= shrink(seam.region, off + self.error(seam.tool))
        return self.voids.are_parted_by(overlap, near)

    def _films_at(self, piece: Region) -> list[int]:
        """The films whose edge a seam crosses at a piece of it that lies past the contact."""
        corners = [e.start for e in piece.edges if _is_on(e.start, self.gap.contact.edges)]
        films = (self.gap.below.profile, self.gap.above.profile)
        return [n for n, film in enumerate(films) if any(_is_on(p, film.edges) for p in corners)]


def _depth(seam: Seam, body: Region, piece: Region, reach: float) -> tuple[float, Point]:
    """Shortest way, mm and unit vector, by which a seam leaves a body that it meets in a piece.

    What is farther from the piece than ``reach`` is left out: a longer way is at least as long.
    """
    near = _edges_near(piece, seam, reach)
    # All ways that the seam may be moved so that its middle stays within half its width of it.
    meeting = [dragged(grow(body, seam.width / 2).turned(180), edge) for edge in near]
    edges = union(meeting).edges
    if not edges or not union(meeting).contains((0.0, 0.0)):
        return 0.0, (1.0, 0.0)
    x, y = min((edge.nearest((0.0, 0.0)) for edge in edges), key=lambda p: math.hypot(*p))
    depth = math.hypot(x, y)
    return depth, (-x / depth, -y / depth) if depth else (1.0, 0.0)


def _edges_near(piece: Region, seam: Seam, reach: float) -> list[Edge]:
    """The parts of a seam's path whose swath lies within ``reach`` of a piece of it.

    A roller's seam is as wide as its path is long, but for half the width at each end.
    """
    chains = seam.path
    if seam.tool == "roller":
        chains = tuple(shortened(chain, seam.width / 2) for chain in chains)
    wide = seam.width + 2 * reach
    return [
        part
        for chain in chains
        for edge in chain
        for part in _short_parts(edge)
        if boxes_meet(widened(part.bounds, wide / 2), piece.bounds)
        and not (swept([part], wide, True) & piece).is_empty
    ]


def _short_parts(edge: Edge) -> Iterator[Edge]:
    """Yield arcs in parts, as it takes time to drag a region along a long one."""
    count = math.ceil(abs(edge.sweep) / PART) if isinstance(edge, Arc) else 1
    for k in range(count):
        yield edge.part(edge.at(k / count), edge.at((k + 1) / count))


def _swath(edges: Sequence[Edge], width: float) -> Region:
    return union([swept([edge], width, True) for edge in edges])


def _is_on(p: Point, edges: Sequence[Edge]) -> bool:
    return any(distance_to(edge, p) <= NEAR for edge in edges)


def _middle(piece: Region) -> Point:
    left, low, right, high = piece.bounds
    return (left + right) / 2, (low + high) / 2
