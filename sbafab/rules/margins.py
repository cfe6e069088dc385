"""Where bond and overhang are narrow, whose edges bound them, and what can move these.

To first order in the small displacements: what is left at a place is its nominal width and the
change along the normal there, which is linear in every cutting error, shift and turn.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Literal, NamedTuple

from sbafab.geometry.edges import Edge, Point, distance_to, left_normal
from sbafab.geometry.nearby import EdgeIndex, widened
from sbafab.geometry.region import Region
from sbafab.geometry.width import facing_pairs
from sbafab.laminate.interfaces import Interface
from sbafab.laminate.laminate import Laminate, Pin
from sbafab.rules.bond_width import SHARP
from sbafab.rules.boundary import edges_along, outward_reach, outward_samples
from sbafab.rules.facing import Facing
from sbafab.rules.freedoms import Freedom, Freedoms, Part
from sbafab.rules.limits import Limits, holds
from sbafab.rules.mask_overhang import pin_at

Quantity = Literal["bond", "overhang"]
QUANTITIES: tuple[Quantity, ...] = ("bond", "overhang")

ON_EDGE = 1e-5
"""mm within which a point lies on an edge: booleans keep points to 4 nm, files to 1 nm."""
SQUARE = 0.9
"""Cosine above which an edge counts as square to a direction (within 25 degrees)."""


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
    """Interfaces of equal profiles and equal freedoms, the first of them, and its margins."""

    interfaces: tuple[Interface, ...]
    margins: tuple[Margin, ...]

    @property
    def first(self) -> Interface:
        return self.interfaces[0]


def seated(interface: Interface) -> tuple[int, ...]:
    """Layer indices by seat."""
    return (
        interface.below.index,
        interface.above.index,
        *(mask.index for mask in interface.masks),
    )


def felt(
    owners: tuple[Owner, Owner], interface: Interface, moves: Freedoms
) -> list[tuple[Freedom, bool]]:
    """The freedoms that one of two edges has and the other not, and whether it is the end's."""
    layers = seated(interface)
    start, end = (moves[Part(layers[o.seat], o.piece)] for o in owners)
    return [
        *((freedom, False) for freedom in start if freedom not in end),
        *((freedom, True) for freedom in end if freedom not in start),
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
        for freedom, at_end in felt(margin.owners, interface, moves)
    ]


def interface_margins(
    laminate: Laminate, facing: Iterable[Facing], limits: Limits, moves: Freedoms
) -> list[InterfaceMargins]:
    """Every interface's narrow places: all that could become the least under the tolerances.

    Films that face each other past a smaller balloon count as an interface of their own; where no
    mask lies between them, facing-films tells of it.
    """
    groups: dict[object, list[Interface]] = {}
    faced = [pair.gap for pair in facing if pair.bare.is_empty]
    for interface in (*laminate.interfaces, *faced):
        key = interface.pattern, interface.unbonded, _signature(interface, moves)
        groups.setdefault(key, []).append(interface)
    return [
        InterfaceMargins(
            tuple(group),
            _margins(
                group[0],
                laminate.pins,
                limits.mask_overhang,
                _slack(group[0], limits, moves),
            ),
        )
        for group in groups.values()
    ]


def own_freedoms(interface: Interface, moves: Freedoms) -> list[tuple[Freedom, ...]]:
    """What each part of the interface's layers, by seat and piece, can do that not all can."""
    found = []
    for layer in seated(interface):
        piece = 0
        while (part := Part(layer, piece)) in moves:
            found.append(moves[part])
            piece += 1
    shared = set(found[0]).intersection(*found[1:])
    return [tuple(freedom for freedom in own if freedom not in shared) for own in found]


def _signature(interface: Interface, moves: Freedoms) -> tuple[object, ...]:
    """Equal for interfaces whose parts can do the same, whatever the bodies are called."""
    names: dict[Freedom, int] = {}
    return tuple(
        tuple((names.setdefault(freedom, len(names)), freedom.like()) for freedom in own)
        for own in own_freedoms(interface, moves)
    )


def _slack(interface: Interface, limits: Limits, moves: Freedoms) -> float:
    """More than any margin of the interface can lose."""
    low_x, low_y, high_x, high_y = interface.contact.bounds
    corners = [(x, y) for x in (low_x, high_x) for y in (low_y, high_y)]
    loose = dict.fromkeys(f for own in own_freedoms(interface, moves) for f in own)
    return 2 * limits.tolerances.cutting + sum(
        freedom.most
        * (1.0 if freedom.centre is None else max(math.dist(freedom.centre, p) for p in corners))
        for freedom in loose
    )


def _margins(
    interface: Interface, pins: tuple[Pin, ...], flush_below: float, slack: float
) -> tuple[Margin, ...]:
    if interface.contact.is_empty:
        return ()
    owners = _Owners(interface)
    bonds = _bond_margins(interface, slack, owners)
    return (*bonds, *_overhang_margins(interface, pins, flush_below, slack, owners))


def _bond_margins(interface: Interface, slack: float, owners: _Owners) -> Iterator[Margin]:
    for width in facing_pairs(interface.bond, slack, SHARP):
        p, q = width.start, width.end
        normal = _unit(p, q)
        for pair in product(_at(p, normal, owners.every), _at(q, normal, owners.every)):
            yield Margin("bond", width.value, p, q, normal, pair)


def _overhang_margins(
    interface: Interface,
    pins: tuple[Pin, ...],
    flush_below: float,
    slack: float,
    owners: _Owners,
) -> list[Margin]:
    """From film edges to the mask's; not where a pin fills the bore and a flush mask is meant."""
    mask = interface.mask.index
    found: list[Margin] = []
    for edge in edges_along(interface.unbonded, interface.contact):
        least = outward_reach(edge, mask)
        if least is None or (pin_at(edge, pins) and not holds(least.value, flush_below)):
            continue
        p = edge.nearest(least.at)
        nx, ny = left_normal(edge, p)
        places = [(p, (-nx, -ny), least), *outward_samples(edge, mask, least.value + slack)]
        for start, outward, reach in places:
            films = _at(start, outward, owners.films)
            for pair in product(films, _at(reach.at, outward, owners.masks)):
                found.append(Margin("overhang", reach.value, start, reach.at, outward, pair))
    widest = min((margin.nominal for margin in found), default=0.0) + slack
    return [margin for margin in found if margin.nominal <= widest]


class _Owned(NamedTuple):
    edge: Edge
    owner: Owner

    def squareness(self, p: Point, normal: Point) -> float:
        """Cosine between the edge's own normal and the given one."""
        nx, ny = left_normal(self.edge, p)
        return abs(nx * normal[0] + ny * normal[1])


class _Owners:
    """The edges of all layers of an interface, and whose they are."""

    def __init__(self, interface: Interface) -> None:
        layers = (interface.below, interface.above, *interface.masks)
        owned = [
            _Owned(edge, Owner(seat, contour, piece))
            for seat, layer in enumerate(layers)
            for contour, piece, edges in _contours(layer.profile)
            for edge in edges
        ]
        self.films = _Filed([one for one in owned if one.owner.is_film])
        self.masks = _Filed([one for one in owned if not one.owner.is_film])
        self.every = _Filed(owned)


class _Filed:
    """Owned edges, filed by place."""

    def __init__(self, owned: Sequence[_Owned]) -> None:
        self.owned = owned
        self.index = EdgeIndex([one.edge for one in owned])

    def through(self, p: Point) -> list[_Owned]:
        near = (self.owned[number] for number in self.index.numbers(widened((*p, *p), ON_EDGE)))
        return [one for one in near if distance_to(one.edge, p) < ON_EDGE]


def _at(p: Point, normal: Point, edges: _Filed) -> list[Owner]:
    """Whose edges run through ``p``: of those square to ``normal`` if any are, else of all."""
    here = edges.through(p)
    square = [owned for owned in here if owned.squareness(p, normal) > SQUARE]
    return list(dict.fromkeys(owned.owner for owned in square or here))


def _contours(profile: Region) -> Iterator[tuple[int, int, tuple[Edge, ...]]]:
    """Contours of a profile, numbered, with the piece each belongs to."""
    number = 0
    for piece, region in enumerate(profile.pieces):
        for contour in region.contours:
            yield number, piece, contour.edges
            number += 1


def _unit(p: Point, q: Point) -> Point:
    length = math.dist(p, q)
    return ((q[0] - p[0]) / length, (q[1] - p[1]) / length) if length else (0.0, 0.0)
