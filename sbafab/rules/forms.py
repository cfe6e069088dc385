"""What is left at every margin as a linear form of all that may be off, in arrays.

Margins between edges of the same two parts feel the same moves: they differ in how wide they are
drawn, in their normal, and in the levers of what turns. Worst case and yield read these forms.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from sbafab.geometry.once import once
from sbafab.rules.freedoms import Freedom, Freedoms
from sbafab.rules.margins import InterfaceMargins, Owner, Quantity, felt

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from sbafab.rules.narrow_places import Places

    Floats = NDArray[np.float64]
    Indices = NDArray[np.intp]


@dataclass(frozen=True)
class LinearForm:
    """Margins between edges of the same two parts, in the order they were found.

    ``numbers`` are their places among all margins of the interface, ``nominal`` (mm) and ``normal``
    (2 rows) one column each; ``between`` is the number of the owners of both edges among
    ``owners``. ``felt`` is what one of the parts does and the other not, whether it acts at the
    end, and the levers (mm per radian) of what turns, None for what shifts.
    """

    quantity: Quantity
    owners: Sequence[tuple[Owner, Owner]]
    between: Indices
    numbers: Indices
    nominal: Floats
    normal: Floats
    felt: tuple[tuple[Freedom, bool, Floats | None], ...]

    def loss(self, by_hand: bool = True) -> Floats:
        """The most that all of it takes from each margin, mm; or all but what the hand does."""
        return self._loss if by_hand else self._lost(False)

    @once
    def _loss(self) -> Floats:
        return self._lost(True)

    def _lost(self, by_hand: bool) -> Floats:
        import numpy as np

        total = np.zeros(len(self.nominal))
        for freedom, _, levers in self.felt:
            if by_hand or not freedom.by_hand:
                total += freedom.most if levers is None else freedom.most * np.abs(levers)
        return total


def linear_forms(group: InterfaceMargins, moves: Freedoms) -> tuple[LinearForm, ...]:
    """The margins of an interface by quantity and parts."""
    found: list[LinearForm] = []
    before = 0
    for quantity, places in group.places.items():
        for first, own in _by_parts(places):
            start, end = places.start[:, own], places.end[:, own]
            normal = places.normal[:, own]
            form = LinearForm(
                quantity,
                places.owners,
                places.between[own],
                own + before,
                places.nominal[own],
                normal,
                tuple(
                    (freedom, at_end, _levers(freedom, end if at_end else start, normal))
                    for freedom, at_end in felt(first, group.first, moves)
                ),
            )
            found.append(form)
        before += len(places.nominal)
    return tuple(found)


def _by_parts(places: Places) -> Iterator[tuple[tuple[Owner, Owner], Indices]]:
    """The numbers of places between the same two parts, with the first of their owners."""
    import numpy as np

    parts: dict[object, list[int]] = {}
    for number, (one, other) in enumerate(places.owners):
        key = one.seat, one.piece, other.seat, other.piece
        parts.setdefault(key, []).append(number)
    home = np.empty(len(places.owners), dtype=np.intp)
    for part, numbers in enumerate(parts.values()):
        home[numbers] = part
    of_place = home[places.between]
    for part, numbers in enumerate(parts.values()):
        (own,) = (of_place == part).nonzero()
        if len(own):
            yield places.owners[numbers[0]], own


def _levers(freedom: Freedom, p: Floats, normal: Floats) -> Floats | None:
    """What ``Freedom.lever`` says, for many points and normals."""
    if freedom.centre is None:
        return None
    x, y = freedom.centre
    levers: Floats = (p[0] - x) * normal[1] - (p[1] - y) * normal[0]
    return levers
