"""Joints of a laminate other than pressed bonds: seams of a moving tool, folds, and nets of ports.

Lengths are mm, in the frame of the finished laminate. Layers are named by their index, counted from
1 at the bottom.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Literal

from sbafab.geometry.edges import Edge, Point
from sbafab.geometry.offset import swept
from sbafab.geometry.region import Region, union
from sbafab.laminate.films import BondProcess

SeamTool = Literal["laser", "hot-tip", "ultrasonic", "roller"]
"""A moving tool that bonds two films along a path."""
SeamKind = Literal["lap", "fin"]
"""A lap seam bonds films that lie flat on each other; a fin seam bonds edges that stand out."""
PRESS: BondProcess = "press"


@dataclass(frozen=True)
class FaceBond:
    """Two face materials that bond to each other, in either order, and the process.

    ``temperature_c`` is the bonding temperature in C, None if not stated; ``after`` names a bond
    that must be made first.
    """

    name: str
    faces: tuple[str, str]
    by: BondProcess
    temperature_c: float | None = None
    after: str | None = None

    def joins(self, a: str, b: str) -> bool:
        """Return True if these are its two faces."""
        return {a, b} == set(self.faces)


PortKind = Literal["place", "hole"]


@dataclass(frozen=True)
class Seam:
    """A bond made by a tool along a path, between the structural layers ``below`` and ``above``.

    ``path`` holds chains of edges, each open or closed; the bond extends by half of ``width`` to
    each side. ``order`` counts the seams in order of making, from 1.
    """

    name: str
    below: int
    above: int
    path: tuple[tuple[Edge, ...], ...]
    width: float
    tool: SeamTool
    kind: SeamKind = "lap"
    order: int = 1

    @property
    def length(self) -> float:
        """Length of the path, mm."""
        return sum(edge.length for chain in self.path for edge in chain)

    @cached_property
    def region(self) -> Region:
        """Region covered by the tool: half of the width on both sides of the path."""
        is_round = self.tool != "roller"
        return union([swept(chain, self.width, is_round) for chain in self.path])


@dataclass(frozen=True)
class Fold:
    """A film folded along a straight line: layers ``lower`` and ``upper`` are halves of one part.

    ``line`` holds two points of the fold. The film is continuous from one half to the other there,
    so a fold does not leak. The part is cut flat: the upper half mirrored about the line.
    """

    lower: int
    upper: int
    line: tuple[Point, Point]


@dataclass(frozen=True)
class Port:
    """A named place at ``at`` in the gap between the structural layers ``below`` and ``above``.

    Nets are declared between ports: the mouth of an inlet, a pocket, the end of a channel. A "hole"
    is an opening of the top or bottom film beside that gap; a tube with an outer diameter of
    ``tube_diameter`` mm (None if unknown) is glued to the film around it.
    """

    name: str
    below: int
    above: int
    at: Point
    kind: PortKind = "place"
    tube_diameter: float | None = None


@dataclass(frozen=True)
class Net:
    """Ports that voids should connect with each other, and with no other port or the outside."""

    name: str
    ports: tuple[str, ...]


# Gaps that hold chambers, and the balloons that films belong to, by roles from the bottom up.


def chamber_gaps(
    roles: Sequence[str], seams: Collection[tuple[int, int]]
) -> dict[tuple[int, int], bool]:
    """Return the gaps between structural layers, by their layers' indices: True for a chamber.

    A chamber mask makes a chamber, and so do seams without a mask, unless one of the layers is a
    sheet, or the lower is a cap or the upper a base: these end balloons. ``seams`` are pairs of
    layers.
    """
    films = [index for index, role in enumerate(roles, 1) if not role.endswith("-mask")]
    gaps = {}
    for below, above in pairwise(films):
        masks = roles[below : above - 1]
        ends = {"sheet", "cap"} & {roles[below - 1]} or {"sheet", "base"} & {roles[above - 1]}
        gaps[below, above] = "chamber-mask" in masks or (
            not masks and (below, above) in seams and not ends
        )
    return gaps


def balloon_numbers(roles: Sequence[str], gaps: Mapping[tuple[int, int], bool]) -> list[int | None]:
    """Return the balloon of every layer, counted from 1 at the bottom, by its ``chamber_gaps``.

    A film belongs to the chamber above it, else to the one below. A sheet and its mask belong to
    none.
    """
    numbers: list[int | None] = [None] * len(roles)
    count = 0
    for (below, above), is_chamber in gaps.items():
        count += is_chamber
        is_beside = not is_chamber and "sheet" in (roles[below - 1], roles[above - 1])
        for index in range(below, above):
            is_none = roles[index - 1] == "sheet" or (is_beside and index > below)
            numbers[index - 1] = None if is_none else max(1, count)
    if roles and roles[-1] != "sheet":
        numbers[-1] = max(1, count)
    return numbers
