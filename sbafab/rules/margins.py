"""Where bond and overhang are narrow, whose edges bound them, and what can move these.

To first order in the small displacements: what is left at a place is its nominal width and the
change along the normal there, which is linear in every cutting error, shift and turn.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Final, Literal, NamedTuple

from sbafab.geometry.edges import Arc, Bounds, Edge, Point
from sbafab.geometry.region import Region
from sbafab.geometry.width import Width
from sbafab.laminate.interfaces import Interface
from sbafab.laminate.laminate import Laminate, Pin
from sbafab.rules.boundary import Reach
from sbafab.rules.facing import Facing
from sbafab.rules.freedoms import Freedom, Freedoms, Part
from sbafab.rules.limits import TOLERANCE, Limits, holds

if TYPE_CHECKING:
    from sbafab.rules.narrow_places import Places

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
    from sbafab.rules.narrow_places import BondAsked, OverhangAsked, places_of, profiles_of

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
