"""What several rules ask of one laminate under one set of limits, each worked out once."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, cached_property
from typing import NamedTuple

from sbafab.geometry.cache import cached
from sbafab.geometry.edges import Edge
from sbafab.geometry.region import Region
from sbafab.geometry.width import Width, least_width
from sbafab.laminate.laminate import Interface, Laminate
from sbafab.rules.boundary import Facing, Reach, edges_along, facing_films, outward_reach
from sbafab.rules.freedoms import Freedoms, Laid, freedoms, lay_up
from sbafab.rules.limits import Limits
from sbafab.rules.margins import (
    SHARP,
    Felt,
    InterfaceMargins,
    LinearForms,
    felt_alike,
    linear_forms,
    narrow_places,
)


class Measures:
    """Measured when first asked for; the deck passes one to all rules that share them.

    ``pause`` is called between parts of long work; what it raises ends the work.
    """

    def __init__(
        self, laminate: Laminate, limits: Limits, pause: Callable[[], None] = lambda: None
    ) -> None:
        self.laminate = laminate
        self.limits = limits
        self.pause = pause
        self._bond = cache(_bond)
        self._reaches = cache(_reaches)

    def by_hand(self, limits: Limits) -> Measures:
        """The same laminate laid by a hand no rougher than this one's, as ``limits`` say.

        Places that are narrow with the rougher hand hold all that are so with a steadier one.
        """
        other = Measures(self.laminate, limits, self.pause)
        other.margins, other.laid = self.margins, self.laid
        return other

    @cached_property
    def facing(self) -> tuple[Facing, ...]:
        """The films that face each other past others."""
        return facing_films(self.laminate)

    def bond(self, interface: Interface) -> Width | None:
        """The least width of its bond; None where nothing bonds or no edge faces another."""
        return self._bond(interface.bond)

    def reaches(self, interface: Interface) -> tuple[tuple[Edge, Reach], ...]:
        """Film edges that bound unbonded film, and how far off the mask's edge lies."""
        return self._reaches(interface.unbonded, interface.contact, interface.mask)

    @cached_property
    def moves(self) -> Freedoms:
        """What every piece of every layer can do."""
        return freedoms(self.laminate, self.limits.tolerances, self.laid)

    @cached_property
    def laid(self) -> list[Laid]:
        """Every body in the order in which they are laid."""
        return lay_up(self.laminate)

    @cached_property
    def margins(self) -> list[InterfaceMargins]:
        """The narrow places of every interface."""
        limits = self.limits
        every = [
            Felt.of(alike, limits, self.moves, self.bond(alike[0]))
            for alike in felt_alike(self.laminate, self.facing, self.moves)
        ]
        reaches = [self.reaches(felt.alike[0]) for felt in every]
        found = narrow_places(every, self.laminate.pins, limits, reaches)
        return [
            InterfaceMargins(felt.alike, places) for felt, places in zip(every, found, strict=True)
        ]

    @cached_property
    def forms(self) -> LinearForms:
        """The same as linear forms."""
        return linear_forms(self.margins, self.moves)


def _bond(bond: Region) -> Width | None:
    return None if bond.is_empty else least_width(bond, SHARP)


@cached
def _reaches(unbonded: Region, contact: Region, mask: Region) -> tuple[tuple[Edge, Reach], ...]:
    found = ((edge, outward_reach(edge, mask.index)) for edge in edges_along(unbonded, contact))
    return tuple([(edge, reach) for edge, reach in found if reach is not None])


# Equal interfaces and layers, so that each is measured once however often it repeats.


class Alike(NamedTuple):
    """The first of the interfaces made of equal profiles, and how many they are."""

    interface: Interface
    number: int

    @property
    def others(self) -> str:
        """What a message adds where the finding holds for more than one interface."""
        return f" (and {self.number - 1} like it)" if self.number > 1 else ""


def distinct_interfaces(laminate: Laminate) -> tuple[Alike, ...]:
    """One of every pattern, bottom to top."""
    groups: dict[tuple[str, ...], list[Interface]] = {}
    for interface in laminate.interfaces:
        groups.setdefault(interface.pattern, []).append(interface)
    return tuple(Alike(group[0], len(group)) for group in groups.values())


def interface_name(interface: Interface) -> str:
    """An interface as messages name it, with its layers."""
    kind = f"{interface.kind} interface"
    return f"{kind} {interface.index} (layers {interface.below.index} and {interface.above.index})"
