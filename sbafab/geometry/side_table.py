"""The sides of a boundary in arrays: which of them may face each other is asked of all at once."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from sbafab.geometry.boundary_side import BESIDE, BoundarySide
from sbafab.geometry.edge_table import CellOrder, EdgeTable, columns_of, dot, touching_in_parts
from sbafab.geometry.width import ALONGSIDE

if TYPE_CHECKING:
    from sbafab.geometry.arrays import Bools, Floats, Indices

ROOM: Final = 1e-9
"""More than the rounding of what is asked once more of each pair."""


class SideTable:
    """What the search knows of the sides of a boundary, or of several one after the other.

    ``parts`` are the numbers of sides in each boundary; none faces a side of another.
    """

    def __init__(self, sides: Sequence[BoundarySide], parts: Sequence[int] = ()) -> None:
        self.parts = parts or [len(sides)]
        self.edges = [side.edge for side in sides]
        self.table = EdgeTable.of(self.edges, [side.box for side in sides])
        rows = [
            (*side.middle, *side.normal, side.half_turn, side.half, side.lean) for side in sides
        ]
        columns = columns_of(rows, 7)
        self.middle, self.normal = columns[0:2], columns[2:4]
        self.half_turn, self.half, self.lean = columns[4:7]

    def pairs(self, aside: float, within: Floats) -> tuple[Indices, Indices]:
        """Sides and those that their normals may meet no farther off, as ``near`` tells them.

        ``within`` is so many mm for each side.
        """
        asked, a, b = self._near(within)
        far = within.take(a)
        chosen = self._opposed(a, b, aside) & self._may_hold_feet(b, a, far) & (a != b)
        a, b = a[chosen], b[chosen]
        faces = self._may_face(a, b, within.take(a))
        a, b = a[faces], b[faces]
        order = CellOrder(self.table.box, self.parts).sorted(asked, a, b)
        return a.take(order), b.take(order)

    def later(self, aside: float, within: float) -> list[list[int]]:
        """For each side the later ones that it may face square no farther off, and few others."""
        _, a, b = self._near(within)
        a, b = a[a < b], b[a < b]
        opposed = self._opposed(a, b, aside)
        a, b = a[opposed], b[opposed]
        feet = self._may_hold_feet(a, b, within) | self._may_hold_feet(b, a, within)
        found: list[list[int]] = [[] for _ in self.edges]
        for one, other in zip(a[feet].tolist(), b[feet].tolist(), strict=True):
            found[one].append(other)
        return found

    def _near(self, within: float | Floats) -> tuple[Floats, Indices, Indices]:
        """The boxes of sides widened by ``within``, and the sides whose boxes these touch."""
        asked, box = self.table.box.copy(), self.table.box
        asked[:2] -= within
        asked[2:] += within
        return asked, *touching_in_parts(asked, self.parts, box, self.parts)

    def _opposed(self, a: Indices, b: Indices, aside: float) -> Bools:
        """Whether their normals are opposed somewhere, to within ``aside`` radians."""
        room = self.half_turn.take(a) + aside + self.half_turn.take(b)
        facing = dot(self.normal.take(a, axis=1), self.normal.take(b, axis=1))
        opposed = facing < ROOM - np.cos(room)
        found: Bools = opposed | (room > math.pi)
        return found

    def _may_face(self, a: Indices, b: Indices, within: Floats) -> Bools:
        """Whether they may face each other no farther off, as ``width._may_face`` tells of arcs of
        nearly one centre that both have the material inside, or both outside.
        """
        table = self.table
        off = table.centre.take(a, axis=1) - table.centre.take(b, axis=1)
        turn, r, s = table.turn.take(a), table.radius.take(a), table.radius.take(b)
        alike = (np.hypot(off[0], off[1]) < ALONGSIDE) & (turn == table.turn.take(b)) & (turn != 0)
        alike &= np.minimum(r, s) >= 10 * ALONGSIDE
        across = (turn > 0) & (r + s <= within + 2 * ALONGSIDE)
        found: Bools = ~alike | across
        return found

    def _may_hold_feet(self, a: Indices, b: Indices, within: float | Floats) -> Bools:
        """Whether normals of sides ``a`` may meet sides ``b`` no farther off than ``within``."""
        off, normal = (
            self.middle.take(b, axis=1) - self.middle.take(a, axis=1),
            self.normal.take(a, axis=1),
        )
        missed = np.abs(off[0] * normal[1] - off[1] * normal[0])
        half = self.half.take(a) + self.half.take(b)
        may: Bools = missed <= half + within * self.lean.take(a) + BESIDE + ROOM
        return may
