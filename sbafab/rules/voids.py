"""Voids of a laminate as a graph of air paths.

Nodes are the connected pieces of unbonded film in each interface, the places in each interface
where one film is missing, the openings of each film, and the outside. Masks seal nothing and are
not part of it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, Literal, NamedTuple

from sbafab.geometry.cache import cached
from sbafab.geometry.edges import Edge, Line, Point, distance_to
from sbafab.geometry.region import Region, rectangle, union
from sbafab.geometry.spatial_index import widened
from sbafab.laminate.folding import lies_on
from sbafab.laminate.joints import Port
from sbafab.laminate.laminate import Inlet, Interface, Laminate, Layer
from sbafab.rules.boundary import beside, edges_along, middle
from sbafab.rules.limits import TOLERANCE
from sbafab.rules.sentences import Clause, say

INSET: Final = 1e-5
"""mm from an edge at which a point surely lies on one side of it."""
PAST_MOUTH: Final = 0.025
"""mm by which an opening may reach past either end of its mouth, and lie off its line; ours."""


VoidKind = Literal["outside", "pocket", "separator", "gap", "opening", "mouth"]


class Void(NamedTuple):
    """A node: ``level`` is an interface's index, or a layer's for an opening.

    The ``level`` of a mouth is its inlet's index in ``laminate.inlets``.
    """

    kind: VoidKind
    level: int = 0
    piece: int = 0


OUTSIDE = Void("outside")


@dataclass
class VoidGraph:
    """Voids, the points at which they connect, and the openings that tubes fill."""

    pieces: dict[Void, Region] = field(default_factory=dict)
    """The unbonded pieces of every interface."""
    gaps: dict[Void, Region] = field(default_factory=dict)
    """Places beside an interface without a film; the outside does not count."""
    openings: dict[Void, Region] = field(default_factory=dict)
    """The holes of films."""
    joins: dict[Void, dict[Void, Point]] = field(default_factory=dict)
    holes: dict[str, Void] = field(default_factory=dict)
    """Openings of the outer films that a port's tube fills, by its name."""

    def join(self, a: Void, b: Void, p: Point) -> None:
        self.joins.setdefault(a, {}).setdefault(b, p)
        self.joins.setdefault(b, {}).setdefault(a, p)

    def reached(
        self, starts: Iterable[Void], walls: Collection[str] = ("outside",)
    ) -> dict[Void, Void | None]:
        """Return every void connected to ``starts`` with its predecessor, nearest first.

        The search enters voids of the ``walls`` kinds but does not pass through them.
        """
        came: dict[Void, Void | None] = dict.fromkeys(starts)
        queue = deque(came)
        while queue:
            here = queue.popleft()
            if here.kind in walls:
                continue
            for there in self.joins.get(here, {}):
                if there not in came:
                    came[there] = here
                    queue.append(there)
        return came


class _Gap(NamedTuple):
    """An interface's contribution, by its shapes: numbered pieces and their connections."""

    unbonded: tuple[Region, ...]
    missing: tuple[Region, ...]
    touching: tuple[tuple[int, int, Edge], ...]


def void_graph(laminate: Laminate) -> VoidGraph:
    """Return the graph of all voids; equal interfaces and films are split into pieces once."""
    graph = VoidGraph()
    left, low, right, high = widened(laminate.bounds, 10)
    frame = rectangle((left, low), (right, high))
    chambers = chambers_by_level(laminate)
    named = {chamber.name for chamber in laminate.chambers}
    for interface in laminate.interfaces:
        gap = _gap(interface.unbonded, interface.contact, frame, interface.fold_lines)
        missing = _voids("gap", interface.index, gap.missing, frame)
        names = chambers.get(interface.index)
        inlets = {
            number: inlet
            for number, inlet in enumerate(laminate.inlets)
            if names is not None and (inlet.chamber in names or inlet.chamber not in named)
        }
        layers = {interface.below.index, interface.above.index}
        folds = [Line(*f.line) for f in laminate.folds if {f.lower, f.upper} == layers]
        _add_gap(graph, interface, gap, missing, inlets, folds)
        graph.gaps |= _known(missing, gap.missing)
        for layer in (interface.below, interface.above):
            pieces = _openings(layer.profile, frame)
            opened = _voids("opening", layer.index, pieces, frame)
            graph.openings |= _known(opened, pieces)
            homes = _homes(layer.profile, interface.contact, frame)
            for opening, (home, p) in zip(opened, homes, strict=True):
                if opening != missing[home]:
                    graph.join(opening, missing[home], p)
    for layer in (laminate.tpe_layers[0], laminate.tpe_layers[-1]):
        pieces = _openings(layer.profile, frame)
        for opening, piece in _known(_voids("opening", layer.index, pieces, frame), pieces).items():
            port = _tube_in(piece, layer, graph, laminate.ports)
            if port is not None:
                graph.holes[port.name] = opening
            else:
                graph.join(opening, OUTSIDE, middle(piece))
    return graph


def _voids(
    kind: VoidKind, level: int, pieces: Sequence[Region], frame: Region | None = None
) -> list[Void]:
    """Return the voids of pieces; the piece that reaches the frame is the outside."""
    return [
        OUTSIDE if frame and piece.bounds[0] == frame.bounds[0] else Void(kind, level, number)
        for number, piece in enumerate(pieces)
    ]


def _known(voids: Sequence[Void], pieces: Sequence[Region]) -> dict[Void, Region]:
    """Return the voids with regions, without the outside."""
    return {v: piece for v, piece in zip(voids, pieces, strict=True) if v != OUTSIDE}


@cached
def _openings(film: Region, frame: Region) -> tuple[Region, ...]:
    """Return the areas of a frame without film."""
    return (frame - film).pieces


@cached
def _homes(film: Region, contact: Region, frame: Region) -> tuple[tuple[int, Point], ...]:
    """Return the piece of a gap above each opening of a film, and a point inside the opening."""
    missing, homes = _openings(contact, frame), []
    for opening in _openings(film, frame):
        edge = max(opening.edges, key=lambda edge: edge.length)
        homes.append((_holding(missing, beside(edge, INSET)), middle(opening)))
    return tuple(homes)


def chambers_by_level(laminate: Laminate) -> dict[int, frozenset[str]]:
    """Return the chambers with a pocket in each chamber interface, by its index."""
    levels = [interface.index for interface in laminate.interfaces if interface.kind == "chamber"]
    return {
        level: frozenset(chamber.name for chamber in laminate.chambers if chamber.is_in(balloon))
        for balloon, level in enumerate(levels, start=1)
    }


def _tube_in(
    opening: Region, layer: Layer, graph: VoidGraph, ports: tuple[Port, ...]
) -> Port | None:
    """Return the port whose tube fills an opening of an outer film; a tube fills one opening."""
    for port in ports:
        is_beside = layer.index in (port.below, port.above) and port.name not in graph.holes
        if port.kind == "hole" and is_beside and opening.contains(port.at):
            return port
    return None


@cached
def _gap(
    unbonded: Region, contact: Region, frame: Region, folds: tuple[tuple[Point, Point], ...]
) -> _Gap:
    pieces, missing = unbonded.pieces, _openings(contact, frame)
    touching: list[tuple[int, int, Edge]] = []
    for edge in edges_along(unbonded, contact):
        if lies_on(edge, folds):
            # Film goes on there: a fold leaks nothing.
            continue
        home = _holding(missing, beside(edge, -INSET))
        touching.append((_bounded(pieces, edge.at(0.5)), home, edge))
    touching.sort(key=lambda entry: entry[0])
    # Inlets open to the outside; of any other two voids it counts that they join, and first where.
    outside = _voids("gap", 0, missing, frame).index(OUTSIDE)
    joins: dict[tuple[int, int, Edge | None], tuple[int, int, Edge]] = {}
    for number, home, edge in touching:
        joins.setdefault((number, home, edge if home == outside else None), (number, home, edge))
    return _Gap(pieces, missing, tuple(joins.values()))


def _bounded(pieces: tuple[Region, ...], p: Point) -> int:
    """Return the number of the piece with an edge through ``p``."""
    # Most lie in the box of that piece alone.
    inside = [
        number
        for number, piece in enumerate(pieces)
        for left, low, right, high in [widened(piece.bounds, TOLERANCE)]
        if left <= p[0] <= right and low <= p[1] <= high
    ]
    if len(inside) == 1:
        return inside[0]
    return min(range(len(pieces)), key=lambda number: pieces[number].distance_to_edge(p))


def _add_gap(
    graph: VoidGraph,
    interface: Interface,
    gap: _Gap,
    missing: list[Void],
    inlets: Mapping[int, Inlet],
    folds: Sequence[Line],
) -> None:
    kind: VoidKind = "pocket" if interface.kind == "chamber" else "separator"
    voids = _voids(kind, interface.index, gap.unbonded)
    graph.pieces |= _known(voids, gap.unbonded)
    for number, home, edge in gap.touching:
        p = edge.at(0.5)
        if missing[home] != OUTSIDE:
            graph.join(voids[number], missing[home], p)
        # Where a film is folded it goes on from one layer to the other.
        elif not any(distance_to(fold, p) <= TOLERANCE for fold in folds):
            for void, there in _outlets(edge, inlets):
                graph.join(voids[number], void, there)


# Mouths: the stretch of the films' outline, square to an inlet's direction, that its tube closes.
# A void that opens along it opens into the inlet; what opens beyond its ends leaks.


def mouth_of(inlet: int) -> Void:
    """Return the mouth of an inlet, by its index in ``laminate.inlets``."""
    return Void("mouth", inlet)


def _outlets(edge: Edge, inlets: Mapping[int, Inlet]) -> Iterator[tuple[Void, Point]]:
    """Yield the mouths on an edge of the outline, and the outside for its remainder.

    Each comes with the midpoint of its stretch.
    """
    covered = []
    for number, inlet in inlets.items():
        span = _share_at(edge, inlet, inlet.width / 2)
        if span is not None and (span[1] - span[0]) * edge.length > TOLERANCE:
            yield mouth_of(number), edge.at(sum(span) / 2)
            covered.append(_share_at(edge, inlet, inlet.width / 2 + PAST_MOUTH) or span)
    done = 0.0
    for low, high in [*sorted(covered), (1.0, 1.0)]:
        if (low - done) * edge.length > TOLERANCE or not covered:
            yield OUTSIDE, edge.at((done + low) / 2)
        done = max(done, high)


def _share_at(edge: Edge, inlet: Inlet, reach: float) -> tuple[float, float] | None:
    """Return the part of an edge on a mouth's line within ``reach`` mm of the mouth's midpoint.

    As fractions of the edge's length; None if there is none.
    """
    start, end = inlet.offset(edge.start), inlet.offset(edge.end)
    if not isinstance(edge, Line) or start == end:
        return None
    low, high = sorted((side - start) / (end - start) for side in (-reach, reach))
    low, high = max(0.0, low), min(1.0, high)
    if low >= high or any(abs(inlet.depth(edge.at(t))) > PAST_MOUTH for t in (low, high)):
        return None
    return low, high


def mouth_openings(inlet: Inlet, interface: Interface) -> list[tuple[float, float]]:
    """Return the openings of an interface's voids at an inlet's mouth, from end to end.

    Offsets are from the mouth's midpoint in mm; an opening may extend past the mouth.
    """
    spans = sorted(
        sorted((inlet.offset(edge.start), inlet.offset(edge.end)))
        for edge in edges_along(interface.unbonded, interface.contact)
        if _share_at(edge, inlet, inlet.width / 2)
    )
    openings: list[tuple[float, float]] = []
    for low, high in spans:
        if openings and low <= openings[-1][1] + TOLERANCE:
            openings[-1] = openings[-1][0], max(high, openings[-1][1])
        else:
            openings.append((low, high))
    return openings


def past_mouth(laminate: Laminate, level: int, p: Point) -> Clause | None:
    """Return the distance that an opening extends past its mouth; None without a mouth."""
    interface = laminate.interfaces[level - 1]
    for inlet in laminate.inlets if interface.kind == "chamber" else ():
        for low, high in mouth_openings(inlet, interface):
            if abs(inlet.depth(p)) <= PAST_MOUTH and low <= inlet.offset(p) <= high:
                return say(
                    "words.past-mouth",
                    opening=high - low,
                    past=max(high, -low) - inlet.width / 2,
                    mouth=inlet.chamber,
                    mouth_width=inlet.width,
                )
    return None


def _holding(pieces: tuple[Region, ...], p: Point) -> int:
    x, y = p
    for number, piece in enumerate(pieces):
        left, low, right, high = piece.bounds
        if left <= x <= right and low <= y <= high and piece.contains(p):
            return number
    return min(range(len(pieces)), key=lambda number: pieces[number].distance_to_edge(p))


# Cavities: what a person sees of the voids in one interface, holes of the films included.


@dataclass(frozen=True)
class Cavity:
    """Unbonded pieces of an interface and the adjacent gaps, which air fills as one.

    ``region`` excludes the holes of films. ``is_open_film``: the cavity is only a film hole,
    without unbonded pieces.
    """

    interface: int
    voids: tuple[Void, ...]
    region: Region
    is_open_film: bool


def cavities(laminate: Laminate, graph: VoidGraph) -> tuple[Cavity, ...]:
    """Return the cavities of all interfaces, bottom to top; equal interfaces share a region."""
    regions: dict[tuple[object, ...], Region] = {}
    patterns = {interface.index: interface.pattern for interface in laminate.interfaces}
    parts = {**graph.pieces, **graph.gaps}
    rows: list[Cavity] = []
    visited: set[Void] = set()
    for void in parts:
        if void in visited:
            continue
        group = _beside(graph, void, parts)
        visited.update(group)
        key = (patterns[void.level], *(part[::2] for part in group))
        if key not in regions:
            regions[key] = union(parts[part] for part in group)
        is_open_film = all(part.kind == "gap" for part in group)
        rows.append(Cavity(void.level, tuple(group), regions[key], is_open_film))
    return tuple(sorted(rows, key=lambda cavity: cavity.interface))


def _beside(graph: VoidGraph, start: Void, parts: dict[Void, Region]) -> list[Void]:
    """Return the voids of an interface that are connected without passing through a film."""
    group, queue = {start}, [start]
    while queue:
        for void in graph.joins.get(queue.pop(), {}):
            if void in parts and void.level == start.level and void not in group:
                group.add(void)
                queue.append(void)
    return sorted(group)
