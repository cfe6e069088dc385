"""The narrow places of an interface in arrays: where they are, how wide, and whose edges they join.

Every place is asked for at once; what bounds them is filed once a profile.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.geometry.edge_table import (
    CellOrder,
    EdgeTable,
    boxes_round,
    crossings,
    dot,
    touching,
)
from sbafab.geometry.edges import EPSILON, Edge, Point, left_normal
from sbafab.geometry.facing_places import facing_places, places_along, spread_along
from sbafab.geometry.region import Region
from sbafab.geometry.remembered import remembered
from sbafab.geometry.width import Width
from sbafab.laminate.interfaces import Interface
from sbafab.rules.boundary import END_ROOM, STEEP, Reach
from sbafab.rules.margins import ROOM, SHARP, Owner

if TYPE_CHECKING:
    from sbafab.geometry.edge_table import Bools, Floats, Indices

ON_EDGE = 1e-5
"""mm within which a point lies on an edge: booleans keep points to 4 nm, files to 1 nm."""
SQUARE = 0.9
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
            self.nominal[numbers],
            self.start[:, numbers],
            self.end[:, numbers],
            self.normal[:, numbers],
            self.between[numbers],
            self.owners,
        )


def bond_places(interface: Interface, least: Width, slack: float, widest: float) -> Places:
    """Where its bond is at most ``slack`` mm wider than at its narrowest.

    ``widest`` is the most that is asked for of any interface with the same bond.
    """
    return _bond_places(interface.bond, least, slack, widest, *_profiles(interface))


@remembered
def _bond_places(
    bond: Region, least: Width, slack: float, widest: float, *profiles: Region
) -> Places:
    p, q, value = facing_places(bond, widest, SHARP, least)
    if slack < widest:
        (kept,) = (value <= least.value + slack).nonzero()
        p, q, value = p[:, kept], q[:, kept], value[kept]
    off = q - p
    length = np.sqrt(dot(off, off))
    normal = off / np.where(length > 0, length, 1.0)
    every = _filed(profiles, films=True, masks=True)
    both = every.at(np.concatenate([p, q], axis=1), np.concatenate([normal, normal], axis=1))
    return _owned(value, p, q, normal, both.parted(len(value)))


def overhang_places(
    interface: Interface, free: Sequence[tuple[Edge, Reach]], slack: float
) -> Places:
    """From film edges to the mask's, wherever it is at most ``slack`` farther than the nearest."""
    return _overhang_places(interface.mask, tuple(free), slack, *_profiles(interface))


@remembered
def _overhang_places(
    mask: Region, free: tuple[tuple[Edge, Reach], ...], slack: float, *profiles: Region
) -> Places:
    within = min(reach.value for _, reach in free) + slack + ROOM
    near = [(edge, reach) for edge, reach in free if reach.value <= within]
    rays = Rays.of([edge for edge, _ in near])
    ray, value, end = first_met(rays, _profile(mask).table, within)
    # Each edge's own reach, then its samples.
    feet = [edge.nearest(reach.at) for edge, reach in near]
    outward = [left_normal(edge, p) for (edge, _), p in zip(near, feet, strict=True)]
    own = np.arange(len(near))
    order = np.argsort(np.concatenate([own, rays.edge[ray]]), kind="stable")
    nominal = np.concatenate([[reach.value for _, reach in near], value])[order]
    start = np.concatenate([np.array(feet).T, rays.start[:, ray]], axis=1)[:, order]
    ends = np.concatenate([np.array([reach.at for _, reach in near]).T, end], axis=1)[:, order]
    normal = np.concatenate([-np.array(outward).T, rays.outward[:, ray]], axis=1)[:, order]
    films, masks = _filed(profiles, films=True), _filed(profiles, masks=True)
    found = _owned(nominal, start, ends, normal, (films.at(start, normal), masks.at(ends, normal)))
    if not len(found.nominal):
        return found
    widest = found.nominal.min() + slack
    (kept,) = np.nonzero(found.nominal <= widest)
    return found.at(kept)


class _Owned(NamedTuple):
    """Whose edges run through places: the place in rising order, and a number of ``owners``."""

    place: Indices
    owner: Indices
    owners: list[Owner]

    def parted(self, place: int) -> tuple[_Owned, _Owned]:
        """Those of the places before this one, and of the others, counted from it on."""
        cut = int(np.searchsorted(self.place, place))
        rest = _Owned(self.place[cut:] - place, self.owner[cut:], self.owners)
        return _Owned(self.place[:cut], self.owner[:cut], self.owners), rest


def _owned(
    nominal: Floats, start: Floats, end: Floats, normal: Floats, both: tuple[_Owned, _Owned]
) -> Places:
    """Places once for every two owners of their edges."""
    ours, theirs = both
    counts = np.bincount(theirs.place, minlength=len(nominal))
    begins = np.cumsum(counts) - counts
    own = counts[ours.place]
    rows = np.repeat(ours.place, own)
    within = np.arange(len(rows)) - np.repeat(np.cumsum(own) - own, own)
    others = len(theirs.owners)
    pairs = np.repeat(ours.owner, own) * others + theirs.owner[begins[rows] + within]
    names = sorted(set(pairs.tolist()))
    owners = [(ours.owners[one // others], theirs.owners[one % others]) for one in names]
    between = np.searchsorted(names, pairs)
    return Places(nominal[rows], start[:, rows], end[:, rows], normal[:, rows], between, owners)


@dataclass(frozen=True)
class _Filed:
    """Edges of several layers, and whose they are: ``owner`` is a number of ``owners``."""

    table: EdgeTable
    owner: Indices
    owners: list[Owner]

    def at(self, p: Floats, normal: Floats) -> _Owned:
        """Whose edges run through each point: of those square to its normal, if any, else all."""
        asked = boxes_round(p, p, ON_EDGE)
        place, number = touching(asked, self.table.box)
        here = self.table.at(number).distance(p[:, place]) < ON_EDGE
        place, number = place[here], number[here]
        aside = dot(self.table.at(number).normal(p[:, place]), normal[:, place])
        square = np.abs(aside) > SQUARE
        has_square = np.zeros(p.shape[1], dtype=bool)
        has_square[place[square]] = True
        chosen = square | ~has_square[place]
        place, number = place[chosen], number[chosen]
        order = CellOrder(self.table.box).sorted(asked, place, number)
        place, owner = place[order], self.owner[number[order]]
        # Each owner once a place, where it comes first.
        key = place * len(self.owners) + owner
        by_key = np.argsort(key, kind="stable")
        is_first = np.ones(len(key), dtype=bool)
        is_first[by_key[1:]] = key[by_key[1:]] != key[by_key[:-1]]
        return _Owned(place[is_first], owner[is_first], self.owners)


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
        np.repeat(np.arange(len(numbered)), [len(contour.edges) for _, contour in numbered]),
        [piece for piece, _ in numbered],
    )


def _profiles(interface: Interface) -> list[Region]:
    """Its layers' profiles by seat."""
    return [one.profile for one in (interface.below, interface.above, *interface.masks)]


def _filed(profiles: Sequence[Region], films: bool = False, masks: bool = False) -> _Filed:
    tables: list[EdgeTable] = []
    numbers: list[Indices] = []
    owners: list[Owner] = []
    for seat, profile in enumerate(profiles):
        if films if seat < 2 else masks:
            own = _profile(profile)
            tables.append(own.table)
            numbers.append(own.contour + len(owners))
            owners += [Owner(seat, number, piece) for number, piece in enumerate(own.pieces)]
    return _Filed(EdgeTable.joined(tables), np.concatenate(numbers), owners)


class Rays(NamedTuple):
    """Points spread over edges, the outward unit normals there, and the numbers of their edges."""

    start: Floats
    outward: Floats
    edge: Indices

    @staticmethod
    def of(edges: Sequence[Edge]) -> Rays:
        starts: list[Point] = []
        numbers: list[int] = []
        for number, edge in enumerate(edges):
            room = END_ROOM / edge.length
            shares = [min(1 - room, max(room, share)) for share in spread_along(edge)]
            starts += places_along(edge, shares)
            numbers += [number] * len(shares)
        start, own = np.array(starts).T, np.array(numbers)
        return Rays(start, -EdgeTable.of(edges).at(own).normal(start), own)


def first_met(rays: Rays, table: EdgeTable, within: float) -> tuple[Indices, Floats, Floats]:
    """The first edge along each ray that meets one: which ray, how far off, and where.

    Edges farther off than ``within`` may be left out.
    """
    boxes = boxes_round(rays.start, rays.start + within * rays.outward, END_ROOM)
    ray, number = touching(boxes, table.box)
    start, outward, edges = rays.start[:, ray], rays.outward[:, ray], table.at(number)
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
    _, first = np.unique(rows[order], return_index=True)
    chosen = order[first]
    return rows[chosen], np.maximum(value[chosen], 0.0), q[:, chosen]


def _on(edges: EdgeTable, q: Floats) -> Bools:
    """Whether points of their lines and circles lie between the ends of edges."""
    chord = edges.end - edges.start
    square = dot(chord, chord)
    t = dot(chord, q - edges.start) / np.where(square == 0, 1.0, square)
    on_line = (t >= -1e-12) & (t <= 1 + 1e-12)
    on: Bools = np.where(edges.turn == 0, on_line, edges.faces(q, 1e-9))
    return on
