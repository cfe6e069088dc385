"""Overlaps of seams: a seam ends on another or past the edge of a film, and separates two voids.

Each seam is displaced as a whole. Two seams are sure to meet if, in every direction, separation
takes a displacement larger than the sum of both errors. The test takes two seams at a time, so the
number of seams and their order do not matter. A seam that runs past the edge of a film bonds along
that edge, over less length the nearer its end is.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import combinations
from typing import Final, NamedTuple

from sbafab.geometry.edges import Arc, Edge, Point, distance_to
from sbafab.geometry.offset import dragged, grow, shortened, shrink, swept
from sbafab.geometry.region import Region, rectangle, union
from sbafab.geometry.spatial_index import boxes_meet, widened
from sbafab.laminate.folding import lies_on
from sbafab.laminate.joints import Seam, SeamTool
from sbafab.laminate.laminate import Interface, Laminate
from sbafab.rules.boundary import edges_along, middle
from sbafab.rules.voids import OUTSIDE, cavities, void_graph

NEAR: Final = 1e-5
"""mm within which a void touches the corner of an overlap."""
PART: Final = 0.5
"""Radians that a part of an arc turns by at most."""

ToolError = Callable[[SeamTool], float]
"""Farthest that a seam of a tool lies off its path, mm."""


class Overlap(NamedTuple):
    """An overlap of two seams, by their numbers in the interface.

    They separate if ``seam`` moves by ``depth`` mm along the unit vector ``way``; no shorter
    displacement separates them.
    """

    seam: int
    other: int
    depth: float
    way: Point
    at: Point


class EdgeBond(NamedTuple):
    """The bond of a seam that runs past a film's edge: worst-case ``width`` along the edge, mm."""

    interface: Interface
    seam: Seam
    width: float
    at: Point


class SeamEnds(NamedTuple):
    """Ends of an interface's seams, on other seams or on edges, that separate two voids."""

    overlaps: Sequence[Overlap] = ()
    edges: Sequence[EdgeBond] = ()


def seam_ends(
    laminate: Laminate, interfaces: Sequence[Interface], error: ToolError
) -> list[SeamEnds]:
    """Return the seam ends of each interface; none if its films are pressed."""
    if all(gap.pressed or not gap.seams for gap in interfaces):
        return [SeamEnds() for _ in interfaces]
    graph = void_graph(laminate)
    every = cavities(laminate, graph)
    ends = []
    for gap in interfaces:
        named: list[tuple[object, Region]] = []
        for number, cavity in enumerate(every):
            if cavity.interface == gap.index:
                beside = {v for void in cavity.voids for v in graph.joins.get(void, ())}
                is_inlet = any(void.kind == "mouth" for void in beside)
                name = OUTSIDE if OUTSIDE in beside and not is_inlet else number
                named.append((name, cavity.region))
        outer = (edge for contour in gap.contact.outers for edge in contour.edges)
        rim = [edge for edge in outer if not lies_on(edge, gap.fold_lines)]
        seams = _Seams(gap, named, rim, error)
        rows = () if gap.pressed else (list(seams.overlaps()), list(seams.edge_bonds()))
        ends.append(SeamEnds(*rows))
    return ends


class _Seams(NamedTuple):
    """The seams of an interface bonded by seams only, and the voids between them.

    ``cavities`` by name: those open to the outside share one name, unless they are at an inlet;
    ``rim``: the outer edges of the contact, except folds.
    """

    gap: Interface
    cavities: Sequence[tuple[object, Region]]
    rim: Sequence[Edge]
    error: ToolError

    def overlaps(self) -> Iterator[Overlap]:
        bare = self.gap.contact - self.gap.mask
        # A roller's ends are square: of two seams the other is moved along its path.
        numbered = sorted(enumerate(self.gap.seams), key=lambda pair: pair[1].tool == "roller")
        for (a, seam), (b, partner) in combinations(numbered, 2):
            if not boxes_meet(seam.region.bounds, partner.region.bounds):
                continue
            reach = max(
                seam.width + partner.width, self.error(seam.tool) + self.error(partner.tool)
            )
            for piece in (seam.region & partner.region & bare).pieces:
                if self._is_needed(piece, (seam, partner)):
                    near = _edges_near(piece, partner, reach)
                    body = partner.region & union(swept([e], partner.width, True) for e in near)
                    yield Overlap(a, b, *_depth(seam, body, piece, reach), middle(piece))

    def edge_bonds(self) -> Iterator[EdgeBond]:
        inside = Region(self.gap.contact.outers)
        for seam in self.gap.seams:
            error = self.error(seam.tool)
            reach = max(2 * seam.width, error)
            for piece in (seam.region - inside).pieces:
                if not self._is_needed(piece, (seam,)):
                    continue
                left, low, right, high = widened(piece.bounds, 2 * reach)
                beyond = rectangle((left, low), (right, high)) - inside
                depth, (x, y) = _depth(seam, beyond, piece, reach)
                width = 0.0
                if depth > error:
                    moved = seam.region.moved(error * x, error * y) & inside
                    width = sum(
                        edge.length
                        for edge in edges_along(moved, inside)
                        if boxes_meet(edge.bounds, widened(piece.bounds, error + NEAR))
                    )
                yield EdgeBond(self.gap, seam, width, middle(piece))

    def _is_needed(self, overlap: Region, seams: Sequence[Seam]) -> bool:
        """Return True if two voids are joined once these seams no longer meet there.

        They stay separate if other seams, reduced by their position errors and those of ``seams``,
        cover the overlap.
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
        # It touches two voids, and one of them is the outside.
        names: set[object] = set()
        for p in {edge.start for edge in overlap.edges}:
            here = {name for name, void in self.cavities if void.distance_to_edge(p) <= near}
            is_on_rim = not here and any(distance_to(edge, p) <= NEAR for edge in self.rim)
            names |= {OUTSIDE} if is_on_rim else here
        return len(names) > 1


def _depth(seam: Seam, body: Region, piece: Region, reach: float) -> tuple[float, Point]:
    """Return the shortest move (mm, unit vector) of a seam off a body that it meets in a piece.

    Path parts farther than ``reach`` from the piece are ignored: a depth beyond ``reach`` remains
    at least ``reach``.
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
    """Return the parts of a seam's path whose swath lies within ``reach`` of a piece of it.

    The length of a roller's seam counts, except half its width at each end.
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
    """Yield arcs in short parts, since sweeping a region along a long arc is slow."""
    count = math.ceil(abs(edge.sweep) / PART) if isinstance(edge, Arc) else 1
    for k in range(count):
        yield edge.part(edge.at(k / count), edge.at((k + 1) / count))
