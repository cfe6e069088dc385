"""Equal interfaces and layers, so that each is measured once however often it repeats."""

from __future__ import annotations

from typing import NamedTuple

from sbafab.laminate.interfaces import Interface
from sbafab.laminate.laminate import Laminate


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
