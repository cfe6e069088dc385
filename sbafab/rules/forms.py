"""What is left at every margin as a linear form of all that may be off, in arrays.

Margins between edges of the same two contours feel the same errors: they differ in how wide they
are drawn, in their normal, and in the levers of what turns. Worst case and yield read these forms.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from sbafab.laminate.interfaces import Interface
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
    """Margins with the same two owners of their edges, in the order they were found.

    ``numbers`` are their places among all margins of the interface, ``nominal`` (mm) and ``normal``
    (2 rows) one column each. ``felt`` is what one of the edges does and the other not, whether it
    acts at the end, and the levers (mm per radian) of what turns, None for what shifts.
    """

    quantity: Quantity
    owners: tuple[Owner, Owner]
    numbers: Indices
    nominal: Floats
    normal: Floats
    felt: tuple[tuple[Freedom, bool, Floats | None], ...]

    def loss(self, by_hand: bool = True) -> Floats:
        """The most that all of it takes from each margin, mm; or all but what the hand does."""
        import numpy as np

        total = np.zeros(len(self.nominal))
        for freedom, _, levers in self.felt:
            if by_hand or not freedom.by_hand:
                total += freedom.most if levers is None else freedom.most * np.abs(levers)
        return total


def linear_forms(group: InterfaceMargins, moves: Freedoms) -> tuple[LinearForm, ...]:
    """The margins of an interface by quantity and owners, in the order of their first."""
    found: list[LinearForm] = []
    before = 0
    for quantity, places in group.places.items():
        for owners, numbers in _by_owners(places):
            found.append(_form(quantity, owners, numbers, before, places, group.first, moves))
        before += len(places.nominal)
    return tuple(found)


def _by_owners(places: Places) -> list[tuple[tuple[Owner, Owner], Indices]]:
    """The numbers of places by the owners of their edges, in the order of their first."""
    found = [(own, (places.between == i).nonzero()[0]) for i, own in enumerate(places.owners)]
    return sorted((one for one in found if len(one[1])), key=lambda one: one[1][0])


def _form(
    quantity: Quantity,
    owners: tuple[Owner, Owner],
    own: Indices,
    before: int,
    places: Places,
    interface: Interface,
    moves: Freedoms,
) -> LinearForm:
    normal, start, end = places.normal[:, own], places.start[:, own], places.end[:, own]
    return LinearForm(
        quantity,
        owners,
        own + before,
        places.nominal[own],
        normal,
        tuple(
            (freedom, at_end, _levers(freedom, end if at_end else start, normal))
            for freedom, at_end in felt(owners, interface, moves)
        ),
    )


def _levers(freedom: Freedom, p: Floats, normal: Floats) -> Floats | None:
    """What ``Freedom.lever`` says, for many points and normals."""
    if freedom.centre is None:
        return None
    x, y = freedom.centre
    levers: Floats = (p[0] - x) * normal[1] - (p[1] - y) * normal[0]
    return levers
