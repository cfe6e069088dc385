"""What is left at every margin as a linear form of all that may be off, in arrays.

Margins between edges of the same two parts feel the same moves: they differ in how wide they are
drawn, in their normal, and in the levers of what turns. Worst case and yield read these forms, of
all interfaces at once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from sbafab.rules.freedoms import Freedom, Freedoms
from sbafab.rules.margins import InterfaceMargins, Owner, Quantity, felt, seated

if TYPE_CHECKING:
    from sbafab.geometry.arrays import Floats, Indices
    from sbafab.rules.narrow_places import Places


class MarginRun(NamedTuple):
    """The margins of one quantity of an interface: the number of its group, and the place of the
    first among all margins of the interface.
    """

    group: int
    quantity: Quantity
    first: int


class Moves(NamedTuple):
    """What one of two owners does and the other not: a column for each two, a line for each move.

    It shifts by up to ``shift`` mm or turns by up to ``turn`` radians, and counts by its ``sign``:
    1 if it acts at the end. ``freedoms`` are the same, by column.
    """

    freedoms: Sequence[Sequence[Freedom]]
    shift: Floats
    turn: Floats
    sign: Floats


class LinearForms(NamedTuple):
    """The margins of all interfaces, run after run, in the order they were found.

    ``begins`` says where each run begins, ``run`` which one a margin is of. ``nominal`` (mm) and
    ``normal`` (2 rows) have a column each; ``between`` is the number of the owners of both edges
    among ``owners`` and ``moves``. ``levers`` has a line for each of these moves: mm per radian of
    what turns, as it counts, else 0. ``loss`` is the most that all of them take from each margin,
    mm; ``pinned_loss`` that of all but what the hand does.
    """

    runs: Sequence[MarginRun]
    begins: Indices
    run: Indices
    nominal: Floats
    normal: Floats
    between: Indices
    owners: Sequence[tuple[Owner, Owner]]
    moves: Moves
    levers: Floats
    loss: Floats
    pinned_loss: Floats

    def by_quantity(self, values: Mapping[Quantity, float]) -> Floats:
        """A value for each margin."""
        import numpy as np

        return np.array([values[run.quantity] for run in self.runs], dtype=float)[self.run]


def linear_forms(groups: Sequence[InterfaceMargins], moves: Freedoms) -> LinearForms:
    """The margins of all interfaces."""
    import numpy as np

    runs: list[MarginRun] = []
    every: list[Places] = []
    owners: list[tuple[Owner, Owner]] = []
    acting: list[Sequence[tuple[Freedom, bool]]] = []
    parts: list[int] = []
    begins = [0]
    between = [np.zeros(0, dtype=np.intp)]
    for number, group in enumerate(groups):
        first, layers = begins[-1], seated(group.first)
        known: dict[tuple[int, ...], int] = {}
        for quantity, places in group.places.items():
            if not len(places.nominal):
                continue
            runs.append(MarginRun(number, quantity, begins[-1] - first))
            begins.append(begins[-1] + len(places.nominal))
            every.append(places)
            between.append(places.between + len(owners))
            owners += places.owners
            for one, other in places.owners:
                both = one.seat, one.piece, other.seat, other.piece
                if both not in known:
                    known[both] = len(acting)
                    acting.append(felt((one, other), layers, moves))
                parts.append(known[both])
    none = np.zeros((2, 0))
    nominal = np.concatenate([none[0], *[places.nominal for places in every]])
    start = np.concatenate([none, *[places.start for places in every]], axis=1)
    end = np.concatenate([none, *[places.end for places in every]], axis=1)
    normal = np.concatenate([none, *[places.normal for places in every]], axis=1)
    own = np.concatenate(between)
    columns = _columns(acting).take(np.array(parts, dtype=np.intp), axis=2)
    shift, turn, sign, pinned, x, y = columns.take(own, axis=2)
    p = np.where(sign > 0, end[:, None], start[:, None])
    levers = np.where(turn > 0, sign, 0.0) * ((p[0] - x) * normal[1] - (p[1] - y) * normal[0])
    return LinearForms(
        runs,
        np.array(begins),
        np.repeat(np.arange(len(runs)), np.diff(begins)),
        nominal,
        normal,
        own,
        owners,
        Moves([[freedom for freedom, _ in acting[part]] for part in parts], *columns[:3]),
        levers,
        (shift + turn * np.abs(levers)).sum(axis=0),
        pinned.sum(axis=0),
    )


def _columns(acting: Sequence[Sequence[tuple[Freedom, bool]]]) -> Floats:
    """How far each line of what acts shifts and turns, its sign, how far it shifts but for the
    hand, and x and y of what it turns about: 0 where it does not, or less acts.
    """
    import numpy as np

    lines = max(map(len, acting), default=0)
    found: list[float] = []
    for own in acting:
        for freedom, is_end in own:
            sign, most = 1.0 if is_end else -1.0, freedom.most
            if freedom.centre is None:
                found += (most, 0.0, sign, 0.0 if freedom.by_hand else most, 0.0, 0.0)
            else:
                found += (0.0, most, sign, 0.0, *freedom.centre)
        found += [0.0] * (6 * (lines - len(own)))
    return np.array(found).reshape(len(acting), lines, 6).transpose(2, 1, 0)
