"""What is left at every margin as a linear form of all that may be off, in arrays.

Margins between edges of the same two parts feel the same moves: they differ in how wide they are
drawn, in their normal, and in the levers of what turns. Worst case and yield read these forms.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from sbafab.rules.freedoms import Freedom, Freedoms
from sbafab.rules.margins import InterfaceMargins, Owner, Quantity, felt

if TYPE_CHECKING:
    from sbafab.geometry.arrays import Floats, Indices
    from sbafab.rules.narrow_places import Places


@dataclass(frozen=True)
class LinearForms:
    """The margins of one quantity of an interface, in the order they were found.

    ``first`` is the place of the first among all margins of the interface. ``nominal`` (mm) and
    ``normal`` (2 rows) have a column each; ``between`` is the number of the owners of both edges
    among ``owners``, ``parts`` that of their two parts among ``felt``: what one of these does and
    the other not, and whether it acts at the end. ``levers`` has a line for each of these: mm per
    radian of what turns, 1 of what shifts, 0 where less is felt. ``loss`` is the most that all of
    it takes from each margin, mm; ``pinned_loss`` that of all but what the hand does.
    """

    quantity: Quantity
    first: int
    owners: Sequence[tuple[Owner, Owner]]
    between: Indices
    nominal: Floats
    normal: Floats
    parts: Indices
    felt: Sequence[Sequence[tuple[Freedom, bool]]]
    levers: Floats
    loss: Floats
    pinned_loss: Floats


def linear_forms(group: InterfaceMargins, moves: Freedoms) -> tuple[LinearForms, ...]:
    """The margins of an interface by quantity."""
    found: list[LinearForms] = []
    first = 0
    for quantity, places in group.places.items():
        if len(places.nominal):
            found.append(_forms(quantity, first, places, group, moves))
        first += len(places.nominal)
    return tuple(found)


def _forms(
    quantity: Quantity, first: int, places: Places, group: InterfaceMargins, moves: Freedoms
) -> LinearForms:
    import numpy as np

    numbers: dict[object, int] = {}
    some: list[tuple[Owner, Owner]] = []
    home = []
    for both in places.owners:
        one, other = both
        number = numbers.setdefault((one.seat, one.piece, other.seat, other.piece), len(numbers))
        if number == len(some):
            some.append(both)
        home.append(number)
    acting = [felt(owners, group.first, moves) for owners in some]
    parts = np.array(home)[places.between]
    count = max(map(len, acting), default=0)
    x, y = np.zeros((2, count, len(acting)))
    at_end = np.zeros((count, len(acting)), dtype=bool)
    # How its lever counts, and what is added to it.
    turns, shifts = np.zeros((2, count, len(acting)))
    for part, own in enumerate(acting):
        for line, (freedom, is_end) in enumerate(own):
            at_end[line, part] = is_end
            if freedom.centre is None:
                shifts[line, part] = 1.0
            else:
                turns[line, part] = 1.0
                x[line, part], y[line, part] = freedom.centre
    p = np.where(at_end[:, parts], places.end[:, None], places.start[:, None])
    nx, ny = places.normal
    levers = (p[0] - x[:, parts]) * ny - (p[1] - y[:, parts]) * nx
    levers = turns[:, parts] * levers + shifts[:, parts]
    return LinearForms(
        quantity,
        first,
        places.owners,
        places.between,
        places.nominal,
        places.normal,
        parts,
        acting,
        levers,
        _lost(parts, acting, levers, True),
        _lost(parts, acting, levers, False),
    )


def _lost(
    parts: Indices, acting: Sequence[Sequence[tuple[Freedom, bool]]], levers: Floats, by_hand: bool
) -> Floats:
    """The most that all moves take from each margin, mm; without the hand's if not ``by_hand``."""
    import numpy as np

    most = np.zeros((len(acting), len(levers)))
    for own, reach in zip(acting, most, strict=True):
        reach[: len(own)] = [
            freedom.most if by_hand or not freedom.by_hand else 0.0 for freedom, _ in own
        ]
    lost: Floats = (most[parts].T * np.abs(levers)).sum(axis=0)
    return lost
