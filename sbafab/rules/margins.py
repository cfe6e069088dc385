"""Where bond and overhang are narrow, whose edges bound them, and what can move these.

To first order in the small displacements: what is left at a place is its nominal width and the
change along the normal there, which is linear in every cutting error, shift and turn.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise
from typing import TYPE_CHECKING, Final, Literal, NamedTuple

import numpy as np

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
from sbafab.geometry.region import Region
from sbafab.geometry.width import Width
from sbafab.laminate.laminate import Interface, Laminate, Pin
from sbafab.rules.boundary import END_ROOM, STEEP, Facing, Reach
from sbafab.rules.freedoms import Freedom, Freedoms, Part
from sbafab.rules.limits import TOLERANCE, Limits, holds

if TYPE_CHECKING:
    from sbafab.geometry.edge_table import Bools, Floats, Indices

Quantity = Literal["bond", "overhang"]
QUANTITIES: tuple[Quantity, ...] = ("bond", "overhang")

SHARP: Final = 30.0
"""Degrees: a sharper corner is a bond that tapers to nothing. Blunter ones are where a strip leaves
its pocket aslant, between two edges of one void, and no way for a leak."""
ROOM: Final = 1e-6
"""mm: far more than the rounding of what is compared."""


class Owner(NamedTuple):
    """Whose edge it is: the layer's seat in the interface (0 below, 1 above, then the masks), the
    contour and the piece of its profile.
    """

    seat: int
    contour: int
    piece: int

    @property
    def is_film(self) -> bool:
        return self.seat < 2


class Margin(NamedTuple):
    """A place where bond or overhang is narrow: ``start`` and ``end`` on the two edges, whose
    distance apart along ``normal`` is ``nominal``.
    """

    quantity: Quantity
    nominal: float
    start: Point
    end: Point
    normal: Point
    owners: tuple[Owner, Owner]

    @property
    def middle(self) -> Point:
        return (self.start[0] + self.end[0]) / 2, (self.start[1] + self.end[1]) / 2


class Push(NamedTuple):
    """A freedom's greatest effect on a margin, in mm, and whether it acts at its end or start."""

    freedom: Freedom
    cost: float
    at_end: bool


@dataclass(frozen=True)
class InterfaceMargins:
    """Interfaces of equal profiles and equal freedoms, the first of them, and its margins.

    ``places`` are those of bonds, then those of overhangs.
    """

    interfaces: tuple[Interface, ...]
    places: Mapping[Quantity, Places]

    @property
    def first(self) -> Interface:
        return self.interfaces[0]

    def __len__(self) -> int:
        return sum(len(found.nominal) for found in self.places.values())

    def __getitem__(self, number: int) -> Margin:
        for quantity, found in self.places.items():
            if number < len(found.nominal):
                (x, y), (u, v) = found.start[:, number].tolist(), found.end[:, number].tolist()
                nx, ny = found.normal[:, number].tolist()
                nominal = float(found.nominal[number])
                owners = found.owners[found.between[number]]
                return Margin(quantity, nominal, (x, y), (u, v), (nx, ny), owners)
            number -= len(found.nominal)
        raise IndexError(number)


def seated(interface: Interface) -> tuple[int, ...]:
    """Layer indices by seat."""
    return (
        interface.below.index,
        interface.above.index,
        *(mask.index for mask in interface.masks),
    )


def felt(
    owners: tuple[Owner, Owner], layers: Sequence[int], moves: Freedoms
) -> list[tuple[Freedom, bool]]:
    """The freedoms that one of two edges has and the other not, and whether it is the end's.

    ``layers`` are those of the interface, by seat.
    """
    start, end = (moves[Part(layers[o.seat], o.piece)] for o in owners)
    at_start, at_end = set(map(id, start)), set(map(id, end))
    return [
        *[(freedom, False) for freedom in start if id(freedom) not in at_end],
        *[(freedom, True) for freedom in end if id(freedom) not in at_start],
    ]


def pushes(margin: Margin, interface: Interface, moves: Freedoms) -> list[Push]:
    """What can narrow a margin, and by how much."""
    return [
        Push(
            freedom,
            freedom.most
            * abs(freedom.lever(margin.end if at_end else margin.start, margin.normal)),
            at_end,
        )
        for freedom, at_end in felt(margin.owners, seated(interface), moves)
    ]


def felt_alike(
    laminate: Laminate, facing: Iterable[Facing], moves: Freedoms
) -> list[list[Interface]]:
    """Interfaces by equal profiles and equal freedoms.

    Films that face each other past a smaller balloon count as an interface of their own; where no
    mask lies between them, facing-films tells of it.
    """
    groups: dict[object, list[Interface]] = {}
    faced = [pair.gap for pair in facing if pair.bare.is_empty]
    for interface in (*laminate.interfaces, *faced):
        key = interface.pattern, interface.unbonded, _signature(interface, moves)
        groups.setdefault(key, []).append(interface)
    return list(groups.values())


def _signature(interface: Interface, moves: Freedoms) -> tuple[object, ...]:
    """Equal for interfaces whose parts can do the same, whatever the bodies are called."""
    names: dict[int, int] = {}
    return tuple(
        tuple([(names.setdefault(id(freedom), len(names)), freedom.like()) for freedom in own])
        for own in moves.unshared(seated(interface))
    )


class _Loss(NamedTuple):
    """What margins of an interface can lose: no two edges more than ``most``, and ``all`` of what
    moves together, cutting counted.
    """

    most: float
    all: float
    cutting: float

    def slack(self, least: float, drawn: float, limit: float) -> float:
        """How much wider than the ``least`` those are that could become the worst or come short.

        Where the least is short as ``drawn``, those that are not count too.
        """
        if not holds(least, drawn):
            return self.all
        return min(self.all, self.most + max(0.0, limit + self.cutting - least) + ROOM)


def _loss(interface: Interface, limits: Limits, moves: Freedoms) -> _Loss:
    parts = _parts(interface)
    own = moves.unshared(seated(interface))
    reach: list[dict[int, float]] = []
    for region, found in zip(parts, own, strict=True):
        box = region.bounds
        reach.append({id(freedom): freedom.most * _farthest(freedom, box) for freedom in found})
    most = max(
        (
            _cost_without(other, one) + _cost_without(one, other)
            for one, other in combinations(reach, 2)
        ),
        default=0.0,
    )
    loose = {id(freedom): freedom for found in own for freedom in found}.values()
    box = interface.contact.bounds
    cutting = 2 * limits.tolerances.cutting
    together = sum([freedom.most * _farthest(freedom, box) for freedom in loose], 0.0)
    return _Loss(most, cutting + together, cutting)


def _cost_without(shared: Mapping[int, float], costs: Mapping[int, float]) -> float:
    """What all freedoms cost together but those that are shared."""
    return sum([cost for freedom, cost in costs.items() if freedom not in shared], 0.0)


def _parts(interface: Interface) -> list[Region]:
    """The pieces of its layers, by seat."""
    layers = (interface.below, interface.above, *interface.masks)
    return [piece for layer in layers for piece in layer.profile.pieces]


def _farthest(freedom: Freedom, box: Bounds) -> float:
    """The longest lever of a turn in a box; 1 for a shift."""
    if freedom.centre is None:
        return 1.0
    return max(math.dist(freedom.centre, (x, y)) for x in box[::2] for y in box[1::2])


class Felt(NamedTuple):
    """Interfaces that are alike, and what their margins can lose; ``bond`` is the least width."""

    alike: tuple[Interface, ...]
    loss: _Loss
    bond: Width | None

    @staticmethod
    def of(alike: Sequence[Interface], limits: Limits, moves: Freedoms, bond: Width | None) -> Felt:
        return Felt(tuple(alike), _loss(alike[0], limits, moves), bond)

    def slack(self, limits: Limits) -> float:
        """How much wider than its narrowest place a bond is looked at."""
        if self.bond is None:
            return 0.0
        return self.loss.slack(self.bond.value, limits.bond_width, limits.worst_bond_width)


def narrow_places(
    every: Sequence[Felt],
    pins: tuple[Pin, ...],
    limits: Limits,
    reaches: Sequence[Sequence[tuple[Edge, Reach]]],
) -> list[dict[Quantity, Places]]:
    """All margins that could become the least under the tolerances, or come short of a limit.

    ``reaches`` is how far masks reach past film edges, for each of the interfaces that are alike.
    """
    slacks = [felt.slack(limits) for felt in every]
    # Of one bond all interfaces ask for the same places.
    widest: dict[Region, float] = {}
    for felt, slack in zip(every, slacks, strict=True):
        bond = felt.alike[0].bond
        widest[bond] = max(slack, widest.get(bond, 0.0))
    asked: list[tuple[int, Quantity, BondAsked | OverhangAsked]] = []
    flush = limits.mask_overhang
    for number, (felt, slack) in enumerate(zip(every, slacks, strict=True)):
        interface = felt.alike[0]
        if interface.contact.is_empty:
            continue
        profiles = profiles_of(interface)
        if felt.bond is not None:
            bond = interface.bond
            asked.append(
                (number, "bond", BondAsked(bond, felt.bond, slack, widest[bond], profiles))
            )
        free = tuple(
            (edge, reach)
            for edge, reach in reaches[number]
            if holds(reach.value, flush) or not pin_at(edge, pins)
        )
        if free:
            least = min(reach.value for _, reach in free)
            farther = felt.loss.slack(least, flush, limits.worst_mask_overhang)
            overhang = OverhangAsked(interface.mask, free, farther, profiles)
            asked.append((number, "overhang", overhang))
    found: list[dict[Quantity, Places]] = [{} for _ in every]
    told = places_of([one for *_, one in asked])
    for (number, quantity, _), places in zip(asked, told, strict=True):
        found[number][quantity] = places
    return found


def pin_at(edge: Edge, pins: tuple[Pin, ...]) -> Pin | None:
    """The pin that fills a bore with this edge."""
    if not isinstance(edge, Arc) or edge.ccw:
        return None
    for pin in pins:
        if (
            math.dist(edge.centre, pin.centre) <= TOLERANCE
            and abs(edge.radius - pin.hole / 2) <= TOLERANCE
        ):
            return pin
    return None


# The narrow places of an interface in arrays: where they are, how wide, and whose edges they join.
#
# Every place is asked for at once; what bounds them is filed once a profile.


ON_EDGE: Final = 1e-5
"""mm within which a point lies on an edge: booleans keep points to 4 nm, files to 1 nm."""
SQUARE: Final = 0.9
"""Cosine above which an edge counts as square to a direction (within 25 degrees)."""


class Places(NamedTuple):
    """Places from an edge to another, in the order in which they were found.

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


class BondAsked(NamedTuple):
    """Where a bond is at most ``slack`` mm wider than at its narrowest.

    ``widest`` is the most that is asked for of any interface with the same bond; ``profiles`` are
    those of the layers, by seat.
    """

    bond: Region
    least: Width
    slack: float
    widest: float
    profiles: tuple[Region, ...]


class OverhangAsked(NamedTuple):
    """From film edges to the mask's, wherever it is at most ``slack`` farther than the nearest."""

    mask: Region
    free: tuple[tuple[Edge, Reach], ...]
    slack: float
    profiles: tuple[Region, ...]


PlacesAsked = BondAsked | OverhangAsked


def profiles_of(interface: Interface) -> tuple[Region, ...]:
    """Its layers' profiles by seat."""
    return tuple([one.profile for one in (interface.below, interface.above, *interface.masks)])


@cached_batch
def places_of(asked: Sequence[PlacesAsked]) -> Sequence[Places]:
    """The narrow places of each bond and overhang, found together."""
    bonds = [one for one in asked if isinstance(one, BondAsked)]
    overhangs = [one for one in asked if isinstance(one, OverhangAsked)]
    of_bonds = iter(_of_bonds(bonds))
    of_overhangs = iter(_of_overhangs(overhangs))
    segments = [next(of_bonds if isinstance(one, BondAsked) else of_overhangs) for one in asked]
    found = _owned(segments, [one.profiles for one in asked])
    return [
        own if isinstance(one, BondAsked) or not len(own.nominal) else _nearest(own, one.slack)
        for one, own in zip(asked, found, strict=True)
    ]


def _nearest(places: Places, slack: float) -> Places:
    """Those that are at most ``slack`` wider than the narrowest."""
    (kept,) = (places.nominal <= places.nominal.min() + slack).nonzero()
    return places.at(kept)


class _Segments(NamedTuple):
    """Places before it is known whose edges they join.

    ``from_films``: they go from films to masks; else either may lie at both ends.
    """

    nominal: Floats
    start: Floats
    end: Floats
    normal: Floats
    from_films: bool


def _of_bonds(asked: Sequence[BondAsked]) -> list[_Segments]:
    facing = facing_places_of([(one.bond, one.widest, SHARP, one.least) for one in asked])
    found = []
    for one, every in zip(asked, facing, strict=True):
        narrow = every
        if one.slack < one.widest:
            narrow = every.at(every.value <= one.least.value + one.slack)
        off = narrow.end - narrow.start
        length = np.sqrt(dot(off, off))
        normal = off / np.where(length > 0, length, 1.0)
        found.append(_Segments(narrow.value, narrow.start, narrow.end, normal, False))
    return found


def _of_overhangs(asked: Sequence[OverhangAsked]) -> list[_Segments]:
    """Each edge's own reach, then its samples."""
    if not asked:
        return []
    withins = [min(reach.value for _, reach in one.free) + one.slack + ROOM for one in asked]
    nears = [
        [(edge, reach) for edge, reach in one.free if reach.value <= within]
        for one, within in zip(asked, withins, strict=True)
    ]
    near = [one for own in nears for one in own]
    # The ask that each edge is of.
    home = np.arange(len(asked)).repeat([len(own) for own in nears])
    rays = Rays.of([edge for edge, _ in near])
    masks = [_profile(one.mask).table for one in asked]
    home_of_ray = home.take(rays.edge)
    counts = np.bincount(home_of_ray, minlength=len(asked)).tolist()
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
    stops = home.take(edge.take(order)).searchsorted(np.arange(len(asked) + 1)).tolist()
    return [
        _Segments(nominal[a:b], start[:, a:b], ends[:, a:b], normal[:, a:b], True)
        for a, b in pairwise(stops)
    ]


def _owned(segments: Sequence[_Segments], profiles: Sequence[Sequence[Region]]) -> list[Places]:
    """Places once for every two owners of their edges."""
    counts = [len(one.nominal) for one in segments]
    total, home = sum(counts), np.arange(len(counts)).repeat(counts)
    nominal = np.concatenate([one.nominal for one in segments])
    start, end, normal = (
        np.concatenate(column, axis=1)
        for column in zip(*(one[1:4] for one in segments), strict=True)
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
    others = np.bincount(theirs, minlength=total)
    begins = others.cumsum() - others
    own = others.take(ours)
    rows = ours.repeat(own)
    within = np.arange(len(rows)) - (own.cumsum() - own).repeat(own)
    pairs = owner[is_start].repeat(own) * len(owners)
    pairs += owner[~is_start].take(begins.take(rows) + within)
    names = sorted(set(pairs.tolist()))
    between = np.searchsorted(names, pairs)
    named = [(owners[one // len(owners)], owners[one % len(owners)]) for one in names]
    stops = home.take(rows).searchsorted(np.arange(len(counts) + 1)).tolist()
    nominal, normal = nominal.take(rows), normal.take(rows, axis=1)
    start, end = start.take(rows, axis=1), end.take(rows, axis=1)
    found = []
    for a, b in pairwise(stops):
        # Owners are numbered ask by ask.
        low, high = (int(between[a:b].min()), int(between[a:b].max()) + 1) if a < b else (0, 0)
        own = between[a:b] - low
        found.append(
            Places(nominal[a:b], start[:, a:b], end[:, a:b], normal[:, a:b], own, named[low:high])
        )
    return found


class _Block(NamedTuple):
    """So many points, and the edges that may run through them with whose they are."""

    points: int
    edges: Sequence[tuple[int, _Profile]]


def _blocks(segments: Sequence[_Segments], profiles: Sequence[Sequence[Region]]) -> list[_Block]:
    """Starts and ends of each ask: from films to masks, or anywhere."""
    known: dict[int, _Profile] = {}
    found = []
    for one, own in zip(segments, profiles, strict=True):
        seated = [
            (seat, known.get(id(profile)) or known.setdefault(id(profile), _profile(profile)))
            for seat, profile in enumerate(own)
        ]
        count = len(one.nominal)
        if one.from_films:
            found += [_Block(count, seated[:2]), _Block(count, seated[2:])]
        else:
            found.append(_Block(2 * count, seated))
    return found


def _owners(
    p: Floats, normal: Floats, blocks: Sequence[_Block]
) -> tuple[Indices, Indices, list[Owner]]:
    """Whose edges run through each point: of those square to its normal, if any, else all.

    Points in rising order, for each the numbers of its owners, and these.
    """
    owners: list[Owner] = []
    numbers: list[Indices] = []
    for block in blocks:
        for seat, own in block.edges:
            numbers.append(own.contour + len(owners))
            owners += [Owner(seat, number, piece) for number, piece in enumerate(own.pieces)]
    table = EdgeTable.joined([own.table for block in blocks for _, own in block.edges])
    parts = [sum(len(own.contour) for _, own in block.edges) for block in blocks]
    asked = boxes_round(p, p, ON_EDGE)
    counts = [block.points for block in blocks]
    place, number = touching_in_parts(asked, counts, table.box, parts)
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
    order = CellOrder(table.box, parts).sorted(asked, place, number)
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
        start, own = columns_of(points, 2), np.arange(len(edges)).repeat(counts)
        return Rays(start, -EdgeTable.of(edges).at(own).normal(start), own)


def first_met(
    rays: Rays, table: EdgeTable, within: float | Floats, parts: Sequence[tuple[int, int]] = ()
) -> tuple[Indices, Floats, Floats]:
    """The first edge along each ray that meets one: which ray, how far off, and where.

    Edges farther off than ``within`` may be left out. ``parts``: so many rays each meet none but so
    many edges.
    """
    counts, edge_counts = zip(*parts or [(len(rays.edge), len(table.radius))], strict=True)
    boxes = boxes_round(rays.start, rays.start + within * rays.outward, END_ROOM)
    ray, number = touching_in_parts(boxes, counts, table.box, edge_counts)
    start, outward = rays.start.take(ray, axis=1), rays.outward.take(ray, axis=1)
    edges = table.at(number)
    height, there = crossings(start, outward, edges)
    found = []
    for along, is_there in zip(height, there, strict=True):
        q = start + along * outward
        normal = edges.normal(q)
        # What runs along the ray does not end it.
        crosses = np.abs(dot(normal, outward)) >= STEEP
        kept = is_there & (along > -EPSILON) & crosses & _on(edges, q)
        found.append((ray[kept], along[kept], q[:, kept]))
    rows = np.concatenate([one[0] for one in found])
    value = np.concatenate([one[1] for one in found])
    q = np.concatenate([one[2] for one in found], axis=1)
    order = np.lexsort((value, rows))
    sorted_rows = rows.take(order)
    is_first = np.ones(len(rows), dtype=bool)
    is_first[1:] = sorted_rows[1:] != sorted_rows[:-1]
    chosen = order[is_first]
    return rows.take(chosen), np.maximum(value.take(chosen), 0.0), q.take(chosen, axis=1)


def _on(edges: EdgeTable, q: Floats) -> Bools:
    """Whether points of their lines and circles lie between the ends of edges."""
    chord = edges.end - edges.start
    square = dot(chord, chord)
    t = dot(chord, q - edges.start) / np.where(square == 0, 1.0, square)
    on_line = (t >= -1e-12) & (t <= 1 + 1e-12)
    on: Bools = np.where(edges.turn == 0, on_line, edges.faces(q, 1e-9))
    return on


# What is left at every margin as a linear form of all that may be off, in arrays.
#
# Margins between edges of the same two parts feel the same moves: they differ in how wide they are
# drawn, in their normal, and in the levers of what turns. Worst case and yield read these forms, of
# all interfaces at once.


class MarginRun(NamedTuple):
    """The margins of one quantity of an interface: the number of its group, and the place of the
    first among all margins of the interface.
    """

    group: int
    quantity: Quantity
    first: int


class Moves(NamedTuple):
    """What one of two owners does and the other not: a column for each two, a line for each move.

    It shifts by up to ``shift`` mm or turns by up to ``turn`` radians, and counts by its ``sign``:
    1 if it acts at the end. ``freedoms`` are the same, by column.
    """

    freedoms: Sequence[Sequence[Freedom]]
    shift: Floats
    turn: Floats
    sign: Floats


class LinearForms(NamedTuple):
    """The margins of all interfaces, run after run, in the order they were found.

    ``begins`` says where each run begins, ``run`` which one a margin is of. ``nominal`` (mm) and
    ``normal`` (2 rows) have a column each; ``between`` is the number of the owners of both edges
    among ``owners`` and ``moves``. ``levers`` has a line for each of these moves: mm per radian of
    what turns, as it counts, else 0. ``loss`` is the most that all of them take from each margin,
    mm; ``pinned_loss`` that of all but what the hand does.
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

    def by_quantity(self, values: Mapping[Quantity, float]) -> Floats:
        """A value for each margin."""
        import numpy as np

        return np.array([values[run.quantity] for run in self.runs], dtype=float)[self.run]


def linear_forms(groups: Sequence[InterfaceMargins], moves: Freedoms) -> LinearForms:
    """The margins of all interfaces."""
    import numpy as np

    runs: list[MarginRun] = []
    every: list[Places] = []
    owners: list[tuple[Owner, Owner]] = []
    acting: list[Sequence[tuple[Freedom, bool]]] = []
    parts: list[int] = []
    begins = [0]
    between = [np.zeros(0, dtype=np.intp)]
    for number, group in enumerate(groups):
        first, layers = begins[-1], seated(group.first)
        known: dict[tuple[int, ...], int] = {}
        for quantity, places in group.places.items():
            if not len(places.nominal):
                continue
            runs.append(MarginRun(number, quantity, begins[-1] - first))
            begins.append(begins[-1] + len(places.nominal))
            every.append(places)
            between.append(places.between + len(owners))
            owners += places.owners
            for one, other in places.owners:
                both = one.seat, one.piece, other.seat, other.piece
                if both not in known:
                    known[both] = len(acting)
                    acting.append(felt((one, other), layers, moves))
                parts.append(known[both])
    none = np.zeros((2, 0))
    nominal = np.concatenate([none[0], *[places.nominal for places in every]])
    start = np.concatenate([none, *[places.start for places in every]], axis=1)
    end = np.concatenate([none, *[places.end for places in every]], axis=1)
    normal = np.concatenate([none, *[places.normal for places in every]], axis=1)
    own = np.concatenate(between)
    columns = _columns(acting).take(np.array(parts, dtype=np.intp), axis=2)
    shift, turn, sign, pinned, x, y = columns.take(own, axis=2)
    p = np.where(sign > 0, end[:, None], start[:, None])
    levers = np.where(turn > 0, sign, 0.0) * ((p[0] - x) * normal[1] - (p[1] - y) * normal[0])
    return LinearForms(
        runs,
        np.array(begins),
        np.repeat(np.arange(len(runs)), np.diff(begins)),
        nominal,
        normal,
        own,
        owners,
        Moves([[freedom for freedom, _ in acting[part]] for part in parts], *columns[:3]),
        levers,
        (shift + turn * np.abs(levers)).sum(axis=0),
        pinned.sum(axis=0),
    )


def _columns(acting: Sequence[Sequence[tuple[Freedom, bool]]]) -> Floats:
    """How far each line of what acts shifts and turns, its sign, how far it shifts but for the
    hand, and x and y of what it turns about: 0 where it does not, or less acts.
    """
    import numpy as np

    lines = max(map(len, acting), default=0)
    found: list[float] = []
    for own in acting:
        for freedom, is_end in own:
            sign, most = 1.0 if is_end else -1.0, freedom.most
            if freedom.centre is None:
                found += (most, 0.0, sign, 0.0 if freedom.by_hand else most, 0.0, 0.0)
            else:
                found += (0.0, most, sign, 0.0, *freedom.centre)
        found += [0.0] * (6 * (lines - len(own)))
    return np.array(found).reshape(len(acting), lines, 6).transpose(2, 1, 0)
