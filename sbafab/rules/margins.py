"""Margins: narrow places of bonds and overhangs, the owners of their edges, and their losses.

To first order in small displacements, the remaining width is the nominal width plus the change
along the normal, which is linear in every cutting error, shift and rotation.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Final, Literal, NamedTuple

from sbafab.design.records import Design
from sbafab.geometry.cache import cached
from sbafab.geometry.edge_table import (
    EdgeTable,
    boxes_round,
    columns_of,
    crossings,
    dot,
    touching,
)
from sbafab.geometry.edges import EPSILON, Arc, Bounds, Edge, Point, left_normal
from sbafab.geometry.lazy_numpy import np
from sbafab.geometry.overlap_pairs import overlap_pairs, sampled
from sbafab.geometry.region import Region
from sbafab.geometry.width import Width
from sbafab.laminate.joints import Seam
from sbafab.laminate.laminate import Interface, Laminate, Pin
from sbafab.rules.boundary import END_ROOM, STEEP, Facing, Reach
from sbafab.rules.limits import TOLERANCE, holds
from sbafab.rules.placement_errors import Freedom, Freedoms, Part, seam_part, unshared
from sbafab.rules.seam_overlaps import Overlap

if TYPE_CHECKING:
    from sbafab.geometry.edge_table import Bools, Floats, Indices

MarginKind = Literal["bond", "overhang"]

SHARP: Final = 30.0
"""Degrees: a sharper corner is a bond that tapers to nothing. At a blunter one a strip leaves its
pocket at an angle, between two edges of one void, which cannot leak."""
ROOM: Final = 1e-6
"""mm: far more than the rounding of the compared values."""
UNCUT: Final = -1


class Owner(NamedTuple):
    """The owner of an edge: a layer's seat in the interface, and the contour and piece of its
    profile.

    Seats are 0 below, 1 above, then the masks, then the seams, with their regions as profiles. The
    contour is UNCUT if a margin ends at no cut edge: in an overlap of two seams.
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


Owners = tuple[Owner, Owner]


class Places(NamedTuple):
    """Places between an edge of one owner and an edge of another.

    ``numbers`` index the interface's places in the order of detection. ``columns`` has a column for
    each place: distance in mm, x and y of its start and end, and the unit vector from start to end.
    """

    owners: Owners
    numbers: Indices
    columns: Floats

    @property
    def nominal(self) -> Floats:
        nominal: Floats = self.columns[0]
        return nominal

    @property
    def ends(self) -> tuple[Floats, Floats]:
        return self.columns[1:3], self.columns[3:5]

    @property
    def normal(self) -> Floats:
        return self.columns[5:]

    def at(self, chosen: Bools | Indices) -> Places:
        return Places(self.owners, self.numbers[chosen], self.columns[:, chosen])

    def middle(self, column: int) -> Point:
        start, end = self.ends
        x, y = ((start[:, column] + end[:, column]) / 2).tolist()
        return x, y


Equal = tuple[Interface, ...]
"""Interfaces of equal profiles and equal freedoms."""
Narrow = tuple[Equal, MarginKind, Places]
"""Narrow places of the first of equal interfaces."""


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


def pin_at(edge: Edge, pins: tuple[Pin, ...]) -> Pin | None:
    """Return the pin that fills a bore with this edge, or None."""
    if not isinstance(edge, Arc) or edge.ccw:
        return None
    for pin in pins:
        is_on_axis = math.dist(edge.centre, pin.centre) <= TOLERANCE
        if is_on_axis and abs(edge.radius - pin.hole / 2) <= TOLERANCE:
            return pin
    return None


# Groups of equal interfaces, and their narrow places.


def group_interfaces(laminate: Laminate, facing: Iterable[Facing], moves: Freedoms) -> list[Equal]:
    """Return interfaces grouped by equal profiles and equal freedoms.

    Films that face each other beyond a smaller balloon form a separate interface; facing-films
    reports the pairs without a mask between them.
    """
    groups: dict[object, list[Interface]] = {}
    faced = [pair.gap for pair in facing if pair.bare.is_empty]
    for interface in (*laminate.interfaces, *faced):
        # Equal for parts of the same freedoms, whatever the bodies are called.
        names: dict[int, int] = {}
        signature = tuple(
            tuple([(names.setdefault(id(way), len(names)), way.like()) for way in ways])
            for ways in unshared(moves, seated(interface))
        )
        key = interface.pattern, interface.unbonded, signature
        groups.setdefault(key, []).append(interface)
    return [tuple(group) for group in groups.values()]


def most_loss(interface: Interface, design: Design, moves: Freedoms) -> float:
    """Return the largest loss of an interface's margins if every displacement adds up, mm.

    A place that is wider than the narrowest by more than this loss is never the worst.
    """
    loose = {id(way): way for ways in unshared(moves, seated(interface)) for way in ways}.values()
    box = interface.contact.bounds
    together = sum([freedom.most * _farthest(freedom, box) for freedom in loose], 0.0)
    return 2 * design.registration.cutting_error + together


def _farthest(freedom: Freedom, box: Bounds) -> float:
    """Return the longest lever arm of a rotation in a box; 1 for a shift."""
    if freedom.centre is None:
        return 1.0
    return max(math.dist(freedom.centre, (x, y)) for x in box[::2] for y in box[1::2])


@cached
def bond_places(
    bond: Region,
    least: Width,
    slack: float,
    widest: float,
    profiles: tuple[Region, ...],
    layers: int,
) -> list[Places]:
    """Return a bond's places at most ``slack`` mm wider than its narrowest.

    ``widest`` is the largest slack of any interface with the same bond; ``profiles`` holds the
    profiles of films and masks, by seat, and of seams.
    """
    narrow = overlap_pairs(bond, widest, SHARP, least)
    if slack < widest:
        narrow = narrow.at(narrow.value <= least.value + slack)
    off = narrow.end - narrow.start
    length = np.sqrt(dot(off, off))
    normal = off / np.where(length > 0, length, 1.0)
    seats = list(enumerate(profiles))
    columns = np.concatenate([[narrow.value], narrow.start, narrow.end, normal])
    return _without_necks(_owned(columns, seats, seats), layers)


def _without_necks(places: list[Places], layers: int) -> list[Places]:
    """Return places except those where two seams cross at both ends and either may narrow the bond.

    The overlap of the seams limits their displacement there.
    """
    seams = [tuple(o.seat for o in both.owners if o.seat >= layers) for both in places]
    ends = [list(map(tuple, both.columns[1:5].T.tolist())) for both in places]
    there = {
        (end, both)
        for rows, both in zip(ends, seams, strict=True)
        if len(set(both)) == 2
        for end in rows
    }
    if not there:
        return places
    left = [
        of_owners.at(np.array([(end, both[::-1]) not in there for end in rows]))
        for of_owners, rows, both in zip(places, ends, seams, strict=True)
    ]
    return _with_places(left)


def _with_places(places: Iterable[Places]) -> list[Places]:
    return [of_owners for of_owners in places if len(of_owners.numbers)]


@cached
def overhang_places(
    mask: Region, free: tuple[tuple[Edge, Reach], ...], slack: float, profiles: tuple[Region, ...]
) -> list[Places]:
    """Return places from film edges to mask edges, at most ``slack`` mm wider than the nearest.

    Each edge's own distance comes first, then its samples. ``profiles``: of two films and masks.
    """
    within = min(reach.value for _, reach in free) + slack + ROOM
    near = [(edge, reach) for edge, reach in free if reach.value <= within]
    rays = Rays.of([edge for edge, _ in near])
    ray, value, end = first_met(rays, _profile(mask).table, within)
    feet = [edge.nearest(reach.at) for edge, reach in near]
    reached = (
        (reach.value, *p, *reach.at, *(-x for x in left_normal(edge, p)))
        for p, (edge, reach) in zip(feet, near, strict=True)
    )
    rows = value[None], rays.start.take(ray, axis=1), end, rays.outward.take(ray, axis=1)
    columns = np.concatenate([columns_of(reached, 7), np.concatenate(rows)], axis=1)
    order = np.concatenate([np.arange(len(near)), rays.edge.take(ray)]).argsort(kind="stable")
    seats = list(enumerate(profiles))
    places = _owned(columns[:, order], seats[:2], seats[2:])
    nearest = min((float(each.nominal.min()) for each in places), default=math.inf)
    return _with_places(each.at(each.nominal <= nearest + slack) for each in places)


def overlap_places(
    interface: Interface, overlaps: Sequence[Overlap], after: int
) -> Iterator[Places]:
    """Yield overlaps of seams as bond places as wide as the overlap's depth, which move as a whole.

    They are numbered from ``after`` on.
    """
    first = 2 + len(interface.masks)
    for number, overlap in enumerate(overlaps, after):
        owners = Owner(first + overlap.seam, UNCUT, 0), Owner(first + overlap.other, UNCUT, 0)
        (x, y), (u, v), half = overlap.at, overlap.way, overlap.depth / 2
        ends = x - half * u, y - half * v, x + half * u, y + half * v
        column = np.array([overlap.depth, *ends, u, v])
        yield Places(owners, np.array([number]), column[:, None])


def narrow_places(
    groups: Sequence[Equal],
    bonds: Sequence[Width | None],
    reaches: Sequence[Sequence[tuple[Edge, Reach]]],
    overlaps: Sequence[Sequence[Overlap]],
    pins: tuple[Pin, ...],
    design: Design,
    moves: Freedoms,
) -> Iterator[Narrow]:
    """Yield all margins that may become the narrowest or fall short of a limit, for the first of
    each group of interfaces.

    The order is the bond width, the overlaps of seams, then the masks' overhangs past film edges.
    """
    losses = [most_loss(first, design, moves) for first, *_ in groups]
    # Of one bond all interfaces ask for the same places.
    widest: dict[Region, float] = {}
    for (first, *_), loss, bond in zip(groups, losses, bonds, strict=True):
        slack = 0.0 if bond is None else loss
        widest[first.whole_bond] = max(slack, widest.get(first.whole_bond, 0.0))
    rows = zip(groups, losses, bonds, reaches, overlaps, strict=True)
    for group, loss, bond, reached, overlapping in rows:
        first, whole, of_bond = group[0], group[0].whole_bond, list[Places]()
        films = tuple(layer.profile for layer in (first.below, first.above, *first.masks))
        if bond is not None and not first.contact.is_empty:
            profiles = (*films, *(seam.region for seam in bonding_seams(first)))
            of_bond += bond_places(whole, bond, loss, widest[whole], profiles, len(films))
        last = max((int(places.numbers[-1]) for places in of_bond), default=-1)
        of_bond += overlap_places(first, overlapping, last + 1)
        yield from ((group, "bond", places) for places in of_bond)
        free = tuple(
            (edge, reach)
            for edge, reach in reached
            if holds(reach.value, design.rules.mask_overhang) or not pin_at(edge, pins)
        )
        if free and not first.contact.is_empty:
            for places in overhang_places(first.mask, free, loss, films):
                yield group, "overhang", places


# Owners of the edges at both ends of places.


ON_EDGE: Final = 1e-5
"""mm within which a point lies on an edge: booleans keep points to 4 nm, files to 1 nm."""
SQUARE: Final = 0.9
"""Cosine above which an edge counts as square to a direction (within 25 degrees)."""

Seats = Sequence[tuple[int, Region]]
"""Profiles with their seats."""


def _owned(columns: Floats, at_start: Seats, at_end: Seats) -> list[Places]:
    """Return places grouped by pairs of edge owners."""
    start, end, normal = columns[1:3], columns[3:5], columns[5:]
    ours, first, firsts = _owners(start, normal, at_start)
    theirs, last, lasts = _owners(end, normal, at_end)
    counts = np.bincount(theirs, minlength=columns.shape[1])
    begins = counts.cumsum() - counts
    repeats = counts.take(ours)
    rows = ours.repeat(repeats)
    within = np.arange(len(rows)) - (repeats.cumsum() - repeats).repeat(repeats)
    pairs = first.repeat(repeats) * len(lasts) + last.take(begins.take(rows) + within)
    # Numbered in this order, before they are parted by owners.
    return [
        Places((firsts[name // len(lasts)], lasts[name % len(lasts)]), own, columns[:, rows[own]])
        for name in sorted(set(pairs.tolist()))
        for own in [np.flatnonzero(pairs == name)]
    ]


def _owners(p: Floats, normal: Floats, seats: Seats) -> tuple[Indices, Indices, list[Owner]]:
    """Return the owners of the edges through each point: those square to its normal, else all.

    Returns points in rising order, the numbers of each point's owners, and the owners.
    """
    shapes = [(seat, _profile(profile)) for seat, profile in seats]
    owners = [Owner(seat, n, piece) for seat, s in shapes for n, piece in enumerate(s.pieces)]
    offsets = np.cumsum([0, *(len(shape.pieces) for _, shape in shapes)]).tolist()
    numbered = [s.contour + first for (_, s), first in zip(shapes, offsets, strict=False)]
    table = EdgeTable.joined([shape.table for _, shape in shapes])
    boxes = boxes_round(p, p, ON_EDGE)
    place, number = touching(boxes, table.box)
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
    owner = np.concatenate(numbered).take(number)
    # Each owner once a place, where it comes first.
    _, firsts = np.unique(place * len(owners) + owner, return_index=True)
    firsts.sort()
    return place[firsts], owner[firsts], owners


class _Profile(NamedTuple):
    """The edges of a layer, contour by contour, with the contour and piece of each."""

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
    """Points along edges, their outward unit normals, and the numbers of their edges."""

    start: Floats
    outward: Floats
    edge: Indices

    @staticmethod
    def of(edges: Sequence[Edge]) -> Rays:
        points, counts = sampled(edges, END_ROOM)
        start, numbers = columns_of(points, 2), np.arange(len(edges)).repeat(counts)
        return Rays(start, -EdgeTable.of(edges).at(numbers).normal(start), numbers)


def first_met(rays: Rays, table: EdgeTable, within: float) -> tuple[Indices, Floats, Floats]:
    """Return the first edge that each ray meets: number of the ray, distance (mm) and point.

    Edges beyond ``within`` may be omitted.
    """
    boxes = boxes_round(rays.start, rays.start + within * rays.outward, END_ROOM)
    ray, number = touching(boxes, table.box)
    start, outward = rays.start.take(ray, axis=1), rays.outward.take(ray, axis=1)
    edges = table.at(number)
    hits = []
    for along, is_there in zip(*crossings(start, outward, edges), strict=True):
        q = start + along * outward
        # What runs along the ray does not end it.
        crosses = np.abs(dot(edges.normal(q), outward)) >= STEEP
        is_hit = is_there & (along > -EPSILON) & crosses & _on(edges, q)
        hits.append((ray[is_hit], along[is_hit], q[:, is_hit]))
    rows, value, q = (np.concatenate(column, axis=-1) for column in zip(*hits, strict=True))
    order = np.lexsort((value, rows))
    _, firsts = np.unique(rows.take(order), return_index=True)
    chosen = order[firsts]
    return rows.take(chosen), np.maximum(value.take(chosen), 0.0), q.take(chosen, axis=1)


def _on(edges: EdgeTable, q: Floats) -> Bools:
    """Return True for points between the ends of edges, given points on their lines and circles."""
    chord = edges.end - edges.start
    square = dot(chord, chord)
    t = dot(chord, q - edges.start) / np.where(square == 0, 1.0, square)
    on_line = (t >= -1e-12) & (t <= 1 + 1e-12)
    on: Bools = np.where(edges.turn == 0, on_line, edges.faces(q, 1e-9))
    return on


# Linear forms of the width left at margins.
#
# Margins between edges of the same two parts depend on the same moves: they differ in nominal
# width, normal and levers.


class Margins(NamedTuple):
    """The margins of equal interfaces between edges of the same two owners.

    ``moves`` are the freedoms that only one of the two parts has, with a sign: 1 if it moves the
    end. ``levers`` has a row for each move and a column for each place: the signed mm per radian of
    a rotation, 0 for a shift.
    """

    interfaces: Equal
    quantity: MarginKind
    places: Places
    moves: Sequence[tuple[Freedom, float]]
    levers: Floats

    @property
    def cut_edges(self) -> int:
        """The number of cut edges of each margin: 2, or 0 for an overlap of seams."""
        return sum(owner.is_cut for owner in self.places.owners)

    @property
    def costs(self) -> Floats:
        """Return the largest loss of each margin due to each move, mm: one row per move."""
        rows = [
            np.full(len(lever), way.most) if way.centre is None else way.most * np.abs(lever)
            for (way, _), lever in zip(self.moves, self.levers, strict=True)
        ]
        return np.array(rows).reshape(self.levers.shape)

    @property
    def pinned_loss(self) -> float:
        """Return the loss due to all moves other than hand placement, mm."""
        return sum([freedom.most for freedom, _ in self.moves if not freedom.by_hand], 0.0)


def margins_of(narrow: Iterable[Narrow], moves: Freedoms) -> Iterator[Margins]:
    """Yield the margins at narrow places."""
    for interfaces, quantity, places in narrow:
        acting = list(relative_freedoms(places.owners, seated(interfaces[0]), moves))
        levers = np.zeros((len(acting), len(places.numbers)))
        for row, (freedom, sign) in enumerate(acting):
            if freedom.centre is not None:
                (x, y), p = freedom.centre, places.ends[sign > 0]
                levers[row] = sign * ((p[0] - x) * places.normal[1] - (p[1] - y) * places.normal[0])
        yield Margins(interfaces, quantity, places, acting, levers)


def relative_freedoms(
    owners: Owners, layers: Sequence[int], moves: Freedoms
) -> Iterator[tuple[Freedom, float]]:
    """Yield the freedoms of only one of two edges, with 1 for the end's and -1 for the start's.

    ``layers`` are the interface's layers, by seat.
    """
    start, end = (moves[Part(layers[owner.seat], owner.piece)] for owner in owners)
    for ways, theirs, sign in ((start, end, -1.0), (end, start, 1.0)):
        shared = set(map(id, theirs))
        yield from ((freedom, sign) for freedom in ways if id(freedom) not in shared)
