"""Measures shared by several rules, computed once for a laminate and a design."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, cached_property
from typing import NamedTuple

from sbafab.design.records import Design
from sbafab.geometry.cache import cached
from sbafab.geometry.edges import Edge, Point
from sbafab.geometry.region import Region
from sbafab.geometry.width import Width, least_width
from sbafab.laminate.folding import lies_on
from sbafab.laminate.laminate import Interface, Laminate
from sbafab.laminate.lay_up import press_steps
from sbafab.rules.boundary import Facing, Reach, edges_along, facing_films, outward_reach
from sbafab.rules.finding import Place
from sbafab.rules.margins import (
    SHARP,
    Equal,
    Margins,
    Narrow,
    group_interfaces,
    margins_of,
    narrow_places,
)
from sbafab.rules.placement_errors import Freedoms, Laid, freedoms, lay_up
from sbafab.rules.seam_overlaps import SeamEnds, seam_ends
from sbafab.rules.sentences import Clause, say


class Measures:
    """Lazily computed measures; the deck passes one object to all rules.

    ``pause`` is called between parts of long work; an exception in it stops the work.
    """

    def __init__(
        self, laminate: Laminate, design: Design, pause: Callable[[], None] = lambda: None
    ) -> None:
        self.laminate = laminate
        self.design = design
        self.pause = pause
        self._bond = cache(_bond)
        self._reaches = cache(_reaches)

    def by_hand(self, design: Design) -> Measures:
        """Return measures for ``design``, whose hand placement is at least as accurate.

        Places that are narrow with coarser hand placement include every narrow place of a finer
        one.
        """
        steadier = Measures(self.laminate, design, self.pause)
        steadier.equal, steadier.narrow, steadier.laid = self.equal, self.narrow, self.laid
        return steadier

    @cached_property
    def facing(self) -> tuple[Facing, ...]:
        """Pairs of non-adjacent films that face each other and that a press closing would weld."""
        laminate = self.laminate
        pressed = [set(step.layers) for step in press_steps(laminate)]
        return tuple(
            pair
            for pair in facing_films(laminate)
            for below, above in [(pair.gap.below, pair.gap.above)]
            if laminate.presses(below, above)
            and any({below.index, above.index} <= layers for layers in pressed)
        )

    def bond(self, interface: Interface) -> Width | None:
        """Return the least width of an interface's bond; None without a bond or facing edges."""
        return self._bond(interface.whole_bond)

    def reaches(self, interface: Interface) -> tuple[tuple[Edge, Reach], ...]:
        """Return film edges that bound unbonded film, each with its distance to the mask's edge."""
        reaches = self._reaches(interface.masked, interface.contact, interface.mask)
        if not interface.folds:
            return reaches
        return tuple(pair for pair in reaches if not lies_on(pair[0], interface.fold_lines))

    @cached_property
    def moves(self) -> Freedoms:
        """The freedoms of every piece of every layer."""
        return freedoms(self.laminate, self.design, self.laid)

    @cached_property
    def laid(self) -> list[Laid]:
        """Every body, in the order of laying."""
        return lay_up(self.laminate)

    @cached_property
    def equal(self) -> list[Equal]:
        """Interfaces grouped by equal profiles and freedoms."""
        return group_interfaces(self.laminate, self.facing, self.moves)

    @cached_property
    def seam_ends(self) -> list[SeamEnds]:
        """Seam ends in the first interface of each set of equal interfaces."""
        first = [interfaces[0] for interfaces in self.equal]
        return seam_ends(self.laminate, first, self.design.registration.error_of_seam)

    @cached_property
    def narrow(self) -> list[Narrow]:
        """The narrow places of equal interfaces."""
        places = narrow_places(
            self.equal,
            [self.bond(first) for first, *_ in self.equal],
            [self.reaches(first) for first, *_ in self.equal],
            [ends.overlaps for ends in self.seam_ends],
            self.laminate.pins,
            self.design,
            self.moves,
        )
        return list(places)

    @cached_property
    def margins(self) -> list[Margins]:
        """The margins of all interfaces, as linear forms."""
        return list(margins_of(self.narrow, self.moves))


def _bond(bond: Region) -> Width | None:
    return None if bond.is_empty else least_width(bond, SHARP)


@cached
def _reaches(unbonded: Region, contact: Region, mask: Region) -> tuple[tuple[Edge, Reach], ...]:
    reaches = ((edge, outward_reach(edge, mask.index)) for edge in edges_along(unbonded, contact))
    return tuple([(edge, reach) for edge, reach in reaches if reach is not None])


# Equal interfaces, so that each pattern is measured once.


class DistinctInterface(NamedTuple):
    """The first of a set of equal interfaces, and the size of the set."""

    interface: Interface
    number: int

    @property
    def name(self) -> Clause:
        """The interface's name in sentences, with the number of equal interfaces."""
        named = interface_name(self.interface)
        if self.number == 1:
            return named
        return say("words.interface-like", interface=named, like=self.number - 1)


def distinct_interfaces(laminate: Laminate) -> tuple[DistinctInterface, ...]:
    """Return one interface of every pattern, bottom to top."""
    groups: dict[tuple[str, ...], list[Interface]] = {}
    for interface in laminate.interfaces:
        groups.setdefault(interface.pattern, []).append(interface)
    return tuple(DistinctInterface(group[0], len(group)) for group in groups.values())


def interface_name(interface: Interface) -> Clause:
    """Return an interface's name in sentences, with its layers."""
    below, above = interface.below.index, interface.above.index
    kind, index = interface.kind, interface.index
    return say("words.interface", kind=kind, index=index, below=below, above=above)


def place_in(interface: Interface, p: Point | None = None) -> Place:
    """Return a place in an interface, from a point in mm."""
    return Place(interface.index, interface.layer_indices, *(p or (None, None)))
