"""The narrow places of an interface in arrays: where they are, how wide, and whose edges they join.

Every place is asked for at once; what bounds them is filed once a profile.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from sbafab.geometry.edge_table import (
    CellOrder,
    EdgeTable,
    boxes_round,
    columns_of,
    crossings,
    dot,
    touching_in_parts,
)
from sbafab.geometry.edges import EPSILON, Edge, left_normal
from sbafab.geometry.facing_places import facing_places_of
from sbafab.geometry.region import Region
from sbafab.geometry.remembered import remembered, remembered_together
from sbafab.geometry.samples import sampled
from sbafab.geometry.width import Width
from sbafab.laminate.interfaces import Interface
from sbafab.rules.boundary import END_ROOM, STEEP, Reach
from sbafab.rules.margins import ROOM, SHARP, Owner

if TYPE_CHECKING:
    from sbafab.geometry.arrays import Bools, Floats, Indices

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


@remembered_together
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


@remembered
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
