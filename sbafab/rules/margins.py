"""Margins: the narrow places of bonds and overhangs, the owners of their edges, and their losses.

To first order in the small displacements, the width left at a place is its nominal width and the
change along the normal there, which is linear in every cutting error, shift and turn.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Final, Literal, NamedTuple

from sbafab.design.records import Design
from sbafab.geometry.cache import cached, cached_batch
from sbafab.geometry.edge_table import (
    CellOrder,
    EdgeTable,
    boxes_round,
    columns_of,
    crossings,
    dot,
    touching_in_parts,
)
from sbafab.geometry.edges import EPSILON, Arc, Bounds, Edge, Point, left_normal
from sbafab.geometry.facing_places import facing_places_of, sampled
from sbafab.geometry.on_demand import np
from sbafab.geometry.region import Region
from sbafab.geometry.width import Width
from sbafab.laminate.joints import Seam
from sbafab.laminate.laminate import Interface, Laminate, Pin
from sbafab.rules.boundary import END_ROOM, STEEP, Facing, Reach
from sbafab.rules.freedoms import Freedom, Freedoms, Part, seam_part
from sbafab.rules.limits import TOLERANCE, holds
from sbafab.rules.seam_overlaps import Overlap

if TYPE_CHECKING:
    from sbafab.geometry.edge_table import Bools, Floats, Indices

MarginKind = Literal["bond", "overhang"]
QUANTITIES: tuple[MarginKind, ...] = ("bond", "overhang")

SHARP: Final = 30.0
"""Degrees: a sharper corner is a bond that tapers to nothing. At a blunter one a strip leaves its
pocket at an angle, between two edges of one void, which cannot leak."""
ROOM: Final = 1e-6
"""mm: far more than the rounding of the compared values."""


UNCUT: Final = -1


class Owner(NamedTuple):
    """Owner of an edge: a layer's seat in the interface, contour and piece of its profile.

    Seats are 0 below, 1 above, then the masks, then the seams, with their regions for profiles. The
    contour is UNCUT if a margin does not end at a cut edge: in an overlap of two seams.
    """

    seat: int
    contour: int
    piece: int

    @property
    def is_film(self) -> bool:
        return self.seat < 2

    @property
    def is_cut(self) -> bool:
        return self.contour != UNCUT


class Margin(NamedTuple):
    """A place where bond or overhang is narrow: ``start`` and ``end`` on the two edges, whose
    distance apart along ``normal`` is ``nominal``.
    """

    quantity: MarginKind
    nominal: float
    start: Point
    end: Point
    normal: Point
    owners: tuple[Owner, Owner]

    @property
    def middle(self) -> Point:
        return (self.start[0] + self.end[0]) / 2, (self.start[1] + self.end[1]) / 2

    @property
    def is_overlap(self) -> bool:
        """True if it is the depth by which a seam runs into another one."""
        return not self.owners[0].is_cut


class Push(NamedTuple):
    """A freedom's greatest effect on a margin, in mm."""

    freedom: Freedom
    cost: float


@dataclass(frozen=True)
class InterfaceMargins:
    """Interfaces of equal profiles and equal freedoms, and the margins of the first.

    ``places`` lists the places of bonds, then the places of overhangs.
    """

    interfaces: tuple[Interface, ...]
    places: Mapping[MarginKind, Places]

    @property
    def first(self) -> Interface:
        return self.interfaces[0]

    def __len__(self) -> int:
        return sum(len(places.nominal) for places in self.places.values())

    def __getitem__(self, number: int) -> Margin:
        for quantity, places in self.places.items():
            if number < len(places.nominal):
                (x, y), (u, v) = places.start[:, number].tolist(), places.end[:, number].tolist()
                nx, ny = places.normal[:, number].tolist()
                nominal = float(places.nominal[number])
                owners = places.owners[places.between[number]]
                return Margin(quantity, nominal, (x, y), (u, v), (nx, ny), owners)
            number -= len(places.nominal)
        raise IndexError(number)


def seated(interface: Interface) -> tuple[int, ...]:
    """Return layer indices by seat; seams are numbered as in ``seam_part``."""
    return (
        interface.below.index,
        interface.above.index,
        *(mask.index for mask in interface.masks),
        *(seam_part(seam).layer for seam in bonding_seams(interface)),
    )


def bonding_seams(interface: Interface) -> tuple[Seam, ...]:
    """Return the seams whose edges end a bond; empty if the films are pressed."""
    return () if interface.pressed else interface.seams


def relative_freedoms(
    owners: tuple[Owner, Owner], layers: Sequence[int], moves: Freedoms
) -> list[tuple[Freedom, bool]]:
    """Return the freedoms that only one of two edges has, each with True if it is the end's.

    ``layers`` are the interface's layers, by seat.
    """
    start, end = (moves[Part(layers[o.seat], o.piece)] for o in owners)
    at_start, at_end = set(map(id, start)), set(map(id, end))
    return [
        *[(freedom, False) for freedom in start if id(freedom) not in at_end],
        *[(freedom, True) for freedom in end if id(freedom) not in at_start],
    ]


def pushes(margin: Margin, interface: Interface, moves: Freedoms) -> list[Push]:
    """Return the freedoms that can narrow a margin, with the most that each takes, mm."""
    return [
        Push(
            freedom,
            freedom.most
            * abs(freedom.lever(margin.end if at_end else margin.start, margin.normal)),
        )
        for freedom, at_end in relative_freedoms(margin.owners, seated(interface), moves)
    ]


def group_interfaces(
    laminate: Laminate, facing: Iterable[Facing], moves: Freedoms
) -> list[list[Interface]]:
    """Return interfaces grouped by equal profiles and equal freedoms.

    Films that face each other past a smaller balloon count as a separate interface;
    facing-films reports the pairs without a mask between them.
    """
    groups: dict[object, list[Interface]] = {}
    faced = [pair.gap for pair in facing if pair.bare.is_empty]
    for interface in (*laminate.interfaces, *faced):
        key = interface.pattern, interface.unbonded, _signature(interface, moves)
        groups.setdefault(key, []).append(interface)
    return list(groups.values())


def _signature(interface: Interface, moves: Freedoms) -> tuple[object, ...]:
    """Equal for interfaces whose parts have the same freedoms, whatever the bodies are called."""
    names: dict[int, int] = {}
    return tuple(
        tuple([(names.setdefault(id(freedom), len(names)), freedom.like()) for freedom in ways])
        for ways in moves.unshared(seated(interface))
    )


def _loss(interface: Interface, design: Design, moves: Freedoms) -> float:
    """Return the most that an interface's margins lose when everything moves together, mm.

    A place that is wider than the narrowest by more than this is never the worst.
    """
    ways_of_parts = moves.unshared(seated(interface))
    loose = {id(freedom): freedom for ways in ways_of_parts for freedom in ways}.values()
    box = interface.contact.bounds
    together = sum([freedom.most * _farthest(freedom, box) for freedom in loose], 0.0)
    return 2 * design.registration.cutting_error + together


def _farthest(freedom: Freedom, box: Bounds) -> float:
    """The longest lever of a turn in a box; 1 for a shift."""
    if freedom.centre is None:
        return 1.0
    return max(math.dist(freedom.centre, (x, y)) for x in box[::2] for y in box[1::2])


class InterfaceGroup(NamedTuple):
    """Equal interfaces, the loss that their margins may suffer, and the ``bond``'s least width."""

    interfaces: tuple[Interface, ...]
    loss: float
    bond: Width | None

    @staticmethod
    def of(
        interfaces: Sequence[Interface], design: Design, moves: Freedoms, bond: Width | None
    ) -> InterfaceGroup:
        return InterfaceGroup(tuple(interfaces), _loss(interfaces[0], design, moves), bond)


def narrow_places(
    groups: Sequence[InterfaceGroup],
    pins: tuple[Pin, ...],
    design: Design,
    reaches: Sequence[Sequence[tuple[Edge, Reach]]],
    overlaps: Sequence[Sequence[Overlap]],
) -> list[dict[MarginKind, Places]]:
    """All margins that could become the least under the tolerances, or fall short of a limit.

    ``reaches`` are the masks' reaches past film edges for each group of interfaces, ``overlaps``
    the overlaps of its seams.
    """
    slacks = [group.loss if group.bond is not None else 0.0 for group in groups]
    # Of one bond all interfaces ask for the same places.
    widest: dict[Region, float] = {}
    for group, slack in zip(groups, slacks, strict=True):
        bond = group.interfaces[0].whole_bond
        widest[bond] = max(slack, widest.get(bond, 0.0))
    queries: list[tuple[int, MarginKind, BondQuery | OverhangQuery]] = []
    flush = design.rules.mask_overhang
    for number, (group, slack) in enumerate(zip(groups, slacks, strict=True)):
        interface = group.interfaces[0]
        if interface.contact.is_empty:
            continue
        profiles = profiles_of(interface)
        if group.bond is not None:
            bond = interface.whole_bond
            queries.append(
                (
                    number,
                    "bond",
                    BondQuery(
                        bond, group.bond, slack, widest[bond], profiles, 2 + len(interface.masks)
                    ),
                )
            )
        free = tuple(
            (edge, reach)
            for edge, reach in reaches[number]
            if holds(reach.value, flush) or not pin_at(edge, pins)
        )
        if free:
            films_and_masks = profiles[: 2 + len(interface.masks)]
            overhang = OverhangQuery(interface.mask, free, group.loss, films_and_masks)
            queries.append((number, "overhang", overhang))
    by_group: list[dict[MarginKind, Places]] = [{} for _ in groups]
    results = places_of([query for *_, query in queries])
    for (number, quantity, _), places in zip(queries, results, strict=True):
        by_group[number][quantity] = places
    for number, of_seams in enumerate(overlaps):
        if of_seams:
            places = _of_overlaps(groups[number].interfaces[0], of_seams)
            bonds = by_group[number].pop("bond", None)
            joined: dict[MarginKind, Places] = {"bond": bonds.joined(places) if bonds else places}
            by_group[number] = joined | by_group[number]
    return by_group


def _of_overlaps(interface: Interface, overlaps: Sequence[Overlap]) -> Places:
    """Overlaps of seams as places of bonds: as wide as they are deep, and moved as a whole."""
    first = 2 + len(interface.masks)
    owners = [
        (Owner(first + overlap.seam, UNCUT, 0), Owner(first + overlap.other, UNCUT, 0))
        for overlap in overlaps
    ]
    depth = np.array([overlap.depth for overlap in overlaps])
    way = columns_of([overlap.way for overlap in overlaps], 2)
    middle = columns_of([overlap.at for overlap in overlaps], 2)
    start, end = (middle + side * depth * way for side in (-0.5, 0.5))
    return Places(depth, start, end, way, np.arange(len(owners)), owners)


def pin_at(edge: Edge, pins: tuple[Pin, ...]) -> Pin | None:
    """Return the pin that fills a bore with this edge, or None."""
    if not isinstance(edge, Arc) or edge.ccw:
        return None
    for pin in pins:
        if (
            math.dist(edge.centre, pin.centre) <= TOLERANCE
            and abs(edge.radius - pin.hole / 2) <= TOLERANCE
        ):
            return pin
    return None


# Narrow places of interfaces in arrays: position, width and owners of their edges. All queries are
# answered together; edges are tabulated once a profile.


ON_EDGE: Final = 1e-5
"""mm within which a point lies on an edge: booleans keep points to 4 nm, files to 1 nm."""
SQUARE: Final = 0.9
"""Cosine above which an edge counts as square to a direction (within 25 degrees)."""


class Places(NamedTuple):
    """Places from an edge to another, in the order of detection.

    ``nominal`` mm apart along the unit ``normal``; ``between`` is the number of both edges' owners
    among ``owners``.
    """

    nominal: Floats
    start: Floats
    end: Floats
    normal: Floats
    between: Indices
    owners: Sequence[tuple[Owner, Owner]]

    def at(self, numbers: Indices) -> Places:
        return Places(
            self.nominal.take(numbers),
            self.start.take(numbers, axis=1),
            self.end.take(numbers, axis=1),
            self.normal.take(numbers, axis=1),
            self.between.take(numbers),
            self.owners,
        )

    def joined(self, more: Places) -> Places:
        """These places, then others."""
        return Places(
            np.concatenate([self.nominal, more.nominal]),
            np.concatenate([self.start, more.start], axis=1),
            np.concatenate([self.end, more.end], axis=1),
            np.concatenate([self.normal, more.normal], axis=1),
            np.concatenate([self.between, more.between + len(self.owners)]),
            [*self.owners, *more.owners],
        )


class BondQuery(NamedTuple):
    """Query of a bond's places at most ``slack`` mm wider than its narrowest.

    ``widest`` is the largest slack of any interface with the same bond; ``profiles`` are the
    profiles of ``layers`` films and masks, by seat, and of seams.
    """

    bond: Region
    least: Width
    slack: float
    widest: float
    profiles: tuple[Region, ...]
    layers: int


class OverhangQuery(NamedTuple):
    """Query of overhangs: places at most ``slack`` mm wider than the nearest."""

    mask: Region
    free: tuple[tuple[Edge, Reach], ...]
    slack: float
    profiles: tuple[Region, ...]


PlacesQuery = BondQuery | OverhangQuery


def profiles_of(interface: Interface) -> tuple[Region, ...]:
    """Return an interface's layer profiles by seat, and the regions of its seams."""
    layers = (interface.below, interface.above, *interface.masks)
    return (
        *(layer.profile for layer in layers),
        *(seam.region for seam in bonding_seams(interface)),
    )


@cached_batch
def places_of(queries: Sequence[PlacesQuery]) -> Sequence[Places]:
    """Return the narrow places of each bond and overhang, searched together."""
    bonds = [query for query in queries if isinstance(query, BondQuery)]
    overhangs = [query for query in queries if isinstance(query, OverhangQuery)]
    of_bonds = iter(_of_bonds(bonds))
    of_overhangs = iter(_of_overhangs(overhangs))
    segments = [
        next(of_bonds if isinstance(query, BondQuery) else of_overhangs) for query in queries
    ]
    located = _owned(segments, [query.profiles for query in queries])
    return [
        _without_necks(places, query.layers)
        if isinstance(query, BondQuery)
        else _nearest(places, query.slack)
        if len(places.nominal)
        else places
        for query, places in zip(queries, located, strict=True)
    ]


def _without_necks(places: Places, layers: int) -> Places:
    """Places without those at which two seams cross at both ends, and that either may narrow.

    How far the seams may be moved there is measured by their overlap.
    """
    seams = [tuple(o.seat for o in both if o.seat >= layers) for both in places.owners]
    if not any(len(set(both)) == 2 for both in seams):
        return places
    ends = [(*p, *q) for p, q in zip(places.start.T.tolist(), places.end.T.tolist(), strict=True)]
    rows = [(end, seams[n]) for end, n in zip(ends, places.between.tolist(), strict=True)]
    there = {(end, both) for end, both in rows if len(set(both)) == 2}
    numbers = [n for n, (end, both) in enumerate(rows) if (end, both[::-1]) not in there]
    return places.at(np.array(numbers, dtype=np.intp))


def _nearest(places: Places, slack: float) -> Places:
    """Places that are at most ``slack`` wider than the narrowest."""
    (near,) = (places.nominal <= places.nominal.min() + slack).nonzero()
    return places.at(near)


class _Segments(NamedTuple):
    """Places before the owners of their edges are determined.

    ``from_films``: they go from films to masks; else either may lie at both ends.
    """

    nominal: Floats
    start: Floats
    end: Floats
    normal: Floats
    from_films: bool


def _of_bonds(queries: Sequence[BondQuery]) -> list[_Segments]:
    facing = facing_places_of([(query.bond, query.widest, SHARP, query.least) for query in queries])
    segments = []
    for query, every in zip(queries, facing, strict=True):
        narrow = every
        if query.slack < query.widest:
            narrow = every.at(every.value <= query.least.value + query.slack)
        off = narrow.end - narrow.start
        length = np.sqrt(dot(off, off))
        normal = off / np.where(length > 0, length, 1.0)
        segments.append(_Segments(narrow.value, narrow.start, narrow.end, normal, False))
    return segments


def _of_overhangs(queries: Sequence[OverhangQuery]) -> list[_Segments]:
    """Places of overhangs: each edge's own reach, then its samples."""
    if not queries:
        return []
    withins = [
        min(reach.value for _, reach in query.free) + query.slack + ROOM for query in queries
    ]
    nears = [
        [(edge, reach) for edge, reach in query.free if reach.value <= within]
        for query, within in zip(queries, withins, strict=True)
    ]
    near = [pair for pairs in nears for pair in pairs]
    # The ask that each edge is of.
    home = np.arange(len(queries)).repeat([len(pairs) for pairs in nears])
    rays = Rays.of([edge for edge, _ in near])
    masks = [_profile(query.mask).table for query in queries]
    home_of_ray = home.take(rays.edge)
    counts = np.bincount(home_of_ray, minlength=len(queries)).tolist()
    parts = [(count, len(mask.radius)) for count, mask in zip(counts, masks, strict=True)]
    within = np.array(withins).take(home_of_ray)
    ray, value, end = first_met(rays, EdgeTable.joined(masks), within, parts)
    feet = [edge.nearest(reach.at) for edge, reach in near]
    outward = [left_normal(edge, p) for (edge, _), p in zip(near, feet, strict=True)]
    edge = np.concatenate([np.arange(len(near)), rays.edge.take(ray)])
    order = edge.argsort(kind="stable")
    nominal = np.concatenate([[reach.value for _, reach in near], value])[order]
    start = np.concatenate([columns_of(feet, 2), rays.start.take(ray, axis=1)], axis=1)[:, order]
    ends = np.concatenate([columns_of([reach.at for _, reach in near], 2), end], axis=1)[:, order]
    normal = np.concatenate([-columns_of(outward, 2), rays.outward.take(ray, axis=1)], axis=1)[
        :, order
    ]
    stops = home.take(edge.take(order)).searchsorted(np.arange(len(queries) + 1)).tolist()
    return [
        _Segments(nominal[a:b], start[:, a:b], ends[:, a:b], normal[:, a:b], True)
        for a, b in pairwise(stops)
    ]


def _owned(segments: Sequence[_Segments], profiles: Sequence[Sequence[Region]]) -> list[Places]:
    """Places with the owners of their edges, one for each pair of owners."""
    counts = [len(item.nominal) for item in segments]
    total, home = sum(counts), np.arange(len(counts)).repeat(counts)
    nominal = np.concatenate([item.nominal for item in segments])
    start, end, normal = (
        np.concatenate(column, axis=1)
        for column in zip(*(item[1:4] for item in segments), strict=True)
    )
    # Of each ask its starts, then its ends.
    order = np.concatenate([home, home]).argsort(kind="stable")
    points, square_to = (
        np.concatenate(both, axis=1).take(order, axis=1)
        for both in ((start, end), (normal, normal))
    )
    place, owner, owners = _owners(points, square_to, _blocks(segments, profiles))
    numbered = order.take(place)
    segment, is_start = numbered % total, numbered < total
    ours, theirs = segment[is_start], segment[~is_start]
    end_counts = np.bincount(theirs, minlength=total)
    begins = end_counts.cumsum() - end_counts
    repeats = end_counts.take(ours)
    rows = ours.repeat(repeats)
    within = np.arange(len(rows)) - (repeats.cumsum() - repeats).repeat(repeats)
    pairs = owner[is_start].repeat(repeats) * len(owners)
    pairs += owner[~is_start].take(begins.take(rows) + within)
    names = sorted(set(pairs.tolist()))
    between = np.searchsorted(names, pairs)
    named = [(owners[name // len(owners)], owners[name % len(owners)]) for name in names]
    stops = home.take(rows).searchsorted(np.arange(len(counts) + 1)).tolist()
    nominal, normal = nominal.take(rows), normal.take(rows, axis=1)
    start, end = start.take(rows, axis=1), end.take(rows, axis=1)
    places = []
    for a, b in pairwise(stops):
        # Owners are numbered ask by ask.
        low, high = (int(between[a:b].min()), int(between[a:b].max()) + 1) if a < b else (0, 0)
        local = between[a:b] - low
        places.append(
            Places(nominal[a:b], start[:, a:b], end[:, a:b], normal[:, a:b], local, named[low:high])
        )
    return places


class _Block(NamedTuple):
    """A number of points, and the edges that may run through them with their seats."""

    points: int
    edges: Sequence[tuple[int, _Profile]]


def _blocks(segments: Sequence[_Segments], profiles: Sequence[Sequence[Region]]) -> list[_Block]:
    """Blocks of starts and ends of each query: from films to masks, or anywhere."""
    by_id: dict[int, _Profile] = {}
    blocks = []
    for segment, shapes in zip(segments, profiles, strict=True):
        seated = [
            (seat, by_id.get(id(profile)) or by_id.setdefault(id(profile), _profile(profile)))
            for seat, profile in enumerate(shapes)
        ]
        count = len(segment.nominal)
        if segment.from_films:
            blocks += [_Block(count, seated[:2]), _Block(count, seated[2:])]
        else:
            blocks.append(_Block(2 * count, seated))
    return blocks


def _owners(
    p: Floats, normal: Floats, blocks: Sequence[_Block]
) -> tuple[Indices, Indices, list[Owner]]:
    """Owners of the edges through each point: of those square to its normal, if any, else all.

    Points in rising order, for each the numbers of its owners, and these.
    """
    owners: list[Owner] = []
    numbers: list[Indices] = []
    for block in blocks:
        for seat, shape in block.edges:
            numbers.append(shape.contour + len(owners))
            owners += [Owner(seat, number, piece) for number, piece in enumerate(shape.pieces)]
    table = EdgeTable.joined([shape.table for block in blocks for _, shape in block.edges])
    parts = [sum(len(shape.contour) for _, shape in block.edges) for block in blocks]
    boxes = boxes_round(p, p, ON_EDGE)
    counts = [block.points for block in blocks]
    place, number = touching_in_parts(boxes, counts, table.box, parts)
    edges = table.at(number)
    (here,) = (edges.distance(p.take(place, axis=1)) < ON_EDGE).nonzero()
    place, number = place.take(here), number.take(here)
    edges = edges.at(here)
    aside = dot(edges.normal(p.take(place, axis=1)), normal.take(place, axis=1))
    square = np.abs(aside) > SQUARE
    has_square = np.zeros(p.shape[1], dtype=bool)
    has_square[place[square]] = True
    chosen = square | ~has_square.take(place)
    place, number = place[chosen], number[chosen]
    order = CellOrder(table.box, parts).sorted(boxes, place, number)
    place, owner = place.take(order), np.concatenate(numbers).take(number.take(order))
    # Each owner once a place, where it comes first.
    key = place * len(owners) + owner
    by_key = key.argsort(kind="stable")
    in_order = key.take(by_key)
    is_first = np.ones(len(key), dtype=bool)
    is_first[by_key[1:]] = in_order[1:] != in_order[:-1]
    return place[is_first], owner[is_first], owners


class _Profile(NamedTuple):
    """The edges of a layer, contour by contour, with the contour of each and its piece."""

    table: EdgeTable
    contour: Indices
    pieces: list[int]


@cached
def _profile(profile: Region) -> _Profile:
    numbered = [(n, c) for n, region in enumerate(profile.pieces) for c in region.contours]
    return _Profile(
        EdgeTable.of(
            [edge for _, contour in numbered for edge in contour.edges],
            [box for _, contour in numbered for box in contour.boxes],
        ),
        np.arange(len(numbered)).repeat([len(contour.edges) for _, contour in numbered]),
        [piece for piece, _ in numbered],
    )


class Rays(NamedTuple):
    """Points spread over edges, the outward unit normals there, and the numbers of their edges."""

    start: Floats
    outward: Floats
    edge: Indices

    @staticmethod
    def of(edges: Sequence[Edge]) -> Rays:
        points, counts = sampled(edges, END_ROOM)
        start, numbers = columns_of(points, 2), np.arange(len(edges)).repeat(counts)
        return Rays(start, -EdgeTable.of(edges).at(numbers).normal(start), numbers)


def first_met(
    rays: Rays, table: EdgeTable, within: float | Floats, parts: Sequence[tuple[int, int]]
) -> tuple[Indices, Floats, Floats]:
    """Return the first edge that each ray meets: number of the ray, distance (mm) and point.

    Edges farther off than ``within`` may be left out. ``parts``: numbers of rays and edges of
    blocks; rays of a block meet its edges only.
    """
    counts, edge_counts = zip(*parts, strict=True)
    boxes = boxes_round(rays.start, rays.start + within * rays.outward, END_ROOM)
    ray, number = touching_in_parts(boxes, counts, table.box, edge_counts)
    start, outward = rays.start.take(ray, axis=1), rays.outward.take(ray, axis=1)
    edges = table.at(number)
    height, there = crossings(start, outward, edges)
    hits = []
    for along, is_there in zip(height, there, strict=True):
        q = start + along * outward
        normal = edges.normal(q)
        # What runs along the ray does not end it.
        crosses = np.abs(dot(normal, outward)) >= STEEP
        is_hit = is_there & (along > -EPSILON) & crosses & _on(edges, q)
        hits.append((ray[is_hit], along[is_hit], q[:, is_hit]))
    rows = np.concatenate([hit[0] for hit in hits])
    value = np.concatenate([hit[1] for hit in hits])
    q = np.concatenate([hit[2] for hit in hits], axis=1)
    order = np.lexsort((value, rows))
    sorted_rows = rows.take(order)
    is_first = np.ones(len(rows), dtype=bool)
    is_first[1:] = sorted_rows[1:] != sorted_rows[:-1]
    chosen = order[is_first]
    return rows.take(chosen), np.maximum(value.take(chosen), 0.0), q.take(chosen, axis=1)


def _on(edges: EdgeTable, q: Floats) -> Bools:
    """True for points of their lines and circles that lie between the ends of edges."""
    chord = edges.end - edges.start
    square = dot(chord, chord)
    t = dot(chord, q - edges.start) / np.where(square == 0, 1.0, square)
    on_line = (t >= -1e-12) & (t <= 1 + 1e-12)
    on: Bools = np.where(edges.turn == 0, on_line, edges.faces(q, 1e-9))
    return on


# Linear forms of the width left at every margin.
#
# Margins between edges of the same two parts depend on the same moves: they differ in nominal
# width, normal and levers. Worst case and yield read these forms, of all interfaces at once.


class MarginRun(NamedTuple):
    """The margins of one quantity of an interface: the number of its group, and the place of the
    first among all margins of the interface.
    """

    group: int
    quantity: MarginKind
    first: int


class Moves(NamedTuple):
    """Freedoms that only one of two owners has: a column for each pair, a row for each move.

    A move shifts by up to ``shift`` mm or turns by up to ``turn`` radians, and counts by its
    ``sign``: 1 if it acts at the end. ``freedoms`` holds the same freedoms, by column.
    """

    freedoms: Sequence[Sequence[Freedom]]
    shift: Floats
    turn: Floats
    sign: Floats


class LinearForms(NamedTuple):
    """The margins of all interfaces, run after run, in the order they were found.

    ``begins`` is the first margin of each run, ``run`` the run of each margin. ``nominal`` (mm)
    and ``normal`` (2 rows) have a column for each margin; ``between`` numbers the owners of both
    edges among ``owners`` and ``moves``. ``levers`` has a row for each of these moves: the signed
    mm per radian of a turn, else 0. ``loss`` is the greatest total loss of each margin by all
    moves, mm; ``pinned_loss`` leaves out the moves made by hand. ``cut_edges`` is the number of
    cut edges of each margin: 2, or 0 for an overlap.
    """

    runs: Sequence[MarginRun]
    begins: Indices
    run: Indices
    nominal: Floats
    normal: Floats
    between: Indices
    owners: Sequence[tuple[Owner, Owner]]
    moves: Moves
    levers: Floats
    loss: Floats
    pinned_loss: Floats
    cut_edges: Floats

    def by_quantity(self, values: Mapping[MarginKind, float]) -> Floats:
        """A value for each margin."""
        return np.array([values[run.quantity] for run in self.runs], dtype=float)[self.run]


def linear_forms(groups: Sequence[InterfaceMargins], moves: Freedoms) -> LinearForms:
    """Return the margins of all interfaces as linear forms."""
    runs: list[MarginRun] = []
    every: list[Places] = []
    owners: list[tuple[Owner, Owner]] = []
    acting: list[Sequence[tuple[Freedom, bool]]] = []
    parts: list[int] = []
    begins = [0]
    between = [np.zeros(0, dtype=np.intp)]
    for number, group in enumerate(groups):
        first, layers = begins[-1], seated(group.first)
        acting_by_parts: dict[tuple[int, ...], int] = {}
        for quantity, places in group.places.items():
            if not len(places.nominal):
                continue
            runs.append(MarginRun(number, quantity, begins[-1] - first))
            begins.append(begins[-1] + len(places.nominal))
            every.append(places)
            between.append(places.between + len(owners))
            owners += places.owners
            for owner_a, owner_b in places.owners:
                both = owner_a.seat, owner_a.piece, owner_b.seat, owner_b.piece
                if both not in acting_by_parts:
                    acting_by_parts[both] = len(acting)
                    acting.append(relative_freedoms((owner_a, owner_b), layers, moves))
                parts.append(acting_by_parts[both])
    none = np.zeros((2, 0))
    nominal = np.concatenate([none[0], *[places.nominal for places in every]])
    start = np.concatenate([none, *[places.start for places in every]], axis=1)
    end = np.concatenate([none, *[places.end for places in every]], axis=1)
    normal = np.concatenate([none, *[places.normal for places in every]], axis=1)
    pair = np.concatenate(between)
    columns = _columns(acting).take(np.array(parts, dtype=np.intp), axis=2)
    shift, turn, sign, pinned, x, y = columns.take(pair, axis=2)
    p = np.where(sign > 0, end[:, None], start[:, None])
    levers = np.where(turn > 0, sign, 0.0) * ((p[0] - x) * normal[1] - (p[1] - y) * normal[0])
    return LinearForms(
        runs,
        np.array(begins),
        np.repeat(np.arange(len(runs)), np.diff(begins)),
        nominal,
        normal,
        pair,
        owners,
        Moves([[freedom for freedom, _ in acting[part]] for part in parts], *columns[:3]),
        levers,
        (shift + turn * np.abs(levers)).sum(axis=0),
        pinned.sum(axis=0),
        np.array([owner.is_cut + other.is_cut for owner, other in owners], dtype=float)[pair],
    )


def _columns(acting: Sequence[Sequence[tuple[Freedom, bool]]]) -> Floats:
    """Arrays of shift, turn, sign, shift without the hand, and x and y of the centre of each move.

    0 where it does not apply, or fewer moves act.
    """
    lines = max(map(len, acting), default=0)
    values: list[float] = []
    for ways in acting:
        for freedom, is_end in ways:
            sign, most = 1.0 if is_end else -1.0, freedom.most
            if freedom.centre is None:
                values += (most, 0.0, sign, 0.0 if freedom.by_hand else most, 0.0, 0.0)
            else:
                values += (0.0, most, sign, 0.0, *freedom.centre)
        values += [0.0] * (6 * (lines - len(ways)))
    return np.array(values).reshape(len(acting), lines, 6).transpose(2, 1, 0)
