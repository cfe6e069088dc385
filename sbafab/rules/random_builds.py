"""Random builds: in which of them every margin of an interface keeps its limit.

What is left at a margin beyond its limit is a row: its room and a sum over the errors drawn. Most
builds are decided without that sum: by the cuts alone where the films hardly move, by the length of
all shifts together, which no normal can lose more than, and by the row that looks most against
them. What rests is summed up, row by row, and what is summed decides: bounds only say where it need
not be done.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

from sbafab.rules.draws import CutContour, Draws, Error
from sbafab.rules.forms import LinearForm
from sbafab.rules.freedoms import Freedom
from sbafab.rules.limits import TOLERANCE
from sbafab.rules.margins import Quantity

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Bools = NDArray[np.bool_]
    Indices = NDArray[np.intp]

SURE = 1e-9 - TOLERANCE
"""mm: what is bounded to be left so far above what holds is so, however the sum is rounded."""
AT_ONCE = 200_000
"""Sums of rows in builds that are worked out at once, which bounds the memory."""
UNITS = 1000
"""Factors that are equal to so many parts are one: rows that feel all errors alike."""


class RowBounds(NamedTuple):
    """Least and largest of room, normal's x and y, and levers, of all rows."""

    low: list[float]
    high: list[float]


@dataclass(frozen=True)
class MarginRows:
    """What is left at margins of one form beyond their limit: ``room`` and a sum of errors.

    Contours count by their sign, shifts by the normal times theirs, turns by the levers times
    theirs. Rows are sorted by the normal's ``angle``.
    """

    quantity: Quantity
    room: Floats
    normal: Floats
    angle: Floats
    contours: tuple[tuple[CutContour, float], ...]
    moves: tuple[tuple[Freedom, float, Floats | None], ...]

    @property
    def errors(self) -> tuple[Error, ...]:
        return *(one for one, _ in self.contours), *(freedom for freedom, _, _ in self.moves)

    @cached_property
    def bounds(self) -> RowBounds:
        levers = [levers for _, _, levers in self.moves if levers is not None]
        columns = [self.room, *self.normal, *levers]
        return RowBounds(
            [float(column.min()) for column in columns], [float(column.max()) for column in columns]
        )

    @cached_property
    def least_uncut(self) -> float:
        """No row leaves less than this, whatever moves, before what cutting adds or takes."""
        low, high = self.bounds
        left, turn = low[0], 3
        for freedom, _, levers in self.moves:
            farthest = 1.0
            if levers is not None:
                farthest = max(-low[turn], high[turn])
                turn += 1
            left -= freedom.most * farthest
        return left


def rows_of(
    form: LinearForm, layers: Sequence[int], limit: float, cutting: float
) -> tuple[int, MarginRows] | None:
    """The margins that can come short at all; of those that feel all errors alike, the least.

    With the number of the first of them; None if there is none.
    """
    import numpy as np

    room = form.nominal - limit
    (short,) = np.nonzero(room - 2 * cutting - form.loss() < -TOLERANCE)
    if not len(short):
        return None
    chosen = short[_least_alike(form, room, short)]
    normal = form.normal[:, chosen]
    angle = np.arctan2(normal[1], normal[0])
    order = np.argsort(angle, kind="stable")
    chosen = chosen[order]
    # More film widens a bond, more mask an overhang.
    signs = (1.0 if one.is_film == (form.quantity == "bond") else -1.0 for one in form.owners)
    contours = (CutContour(layers[one.seat], one.contour) for one in form.owners)
    return int(form.numbers[short[0]]), MarginRows(
        form.quantity,
        room[chosen],
        form.normal[:, chosen],
        angle[order],
        tuple(zip(contours, signs, strict=True)),
        tuple(
            (freedom, 1.0 if at_end else -1.0, None if levers is None else levers[chosen])
            for freedom, at_end, levers in form.felt
        ),
    )


def _least_alike(form: LinearForm, room: Floats, short: Indices) -> list[int]:
    """Which of the short margins have the least room of all with the same factors, rounded."""
    import numpy as np

    columns: list[Floats] = []
    if any(levers is None for _, _, levers in form.felt):
        columns += list(form.normal)
    columns += [levers for _, _, levers in form.felt if levers is not None]
    # Where nothing but cutting is felt there is no column, and all are alike.
    keys = np.array([_parts(column[short]) for column in columns], dtype=np.int64)
    keys = keys.reshape(len(columns), len(short))
    found: dict[bytes, int] = {}
    left = room[short].tolist()
    for place, key in enumerate(np.ascontiguousarray(keys.T)):
        name = key.tobytes()
        known = found.get(name)
        if known is None or left[place] < left[known]:
            found[name] = place
    return list(found.values())


def _parts(factors: Floats) -> Floats:
    """Factors as whole parts, rounded as the decimal number is."""
    import numpy as np

    scaled = factors * UNITS
    parts = np.rint(scaled)
    for doubtful in np.nonzero(np.abs(scaled - np.floor(scaled) - 0.5) < 1e-6)[0]:
        parts[doubtful] = round(round(float(factors[doubtful]), 3) * UNITS)
    return parts


def short(rows: Iterable[MarginRows], draws: Draws) -> list[tuple[Indices, Indices]]:
    """Interfaces and builds of them that come short at a row; one may be named several times."""
    bad: list[tuple[Indices, Indices]] = []
    for some in rows:
        interfaces, builds = draws.cut_below(some.contours, SURE - some.least_uncut)
        roughly = _rough(some, draws, interfaces, builds) < SURE
        interfaces, builds = interfaces[roughly], builds[roughly]
        if not len(builds):
            continue
        sums = _Sums.of(some, [draws.of(error, interfaces, builds) for error in some.errors])
        unsure = _picked(sums.least() < SURE)
        if not len(unsure):
            continue
        interfaces, builds, sums = interfaces[unsure], builds[unsure], sums.at(unsure)
        missed = sums.left(_looking(some, sums.shift), slice(None)) < -TOLERANCE
        unsure = _picked(~missed)
        if len(unsure):
            missed[unsure] = sums.at(unsure).short()
        bad.append((interfaces[missed], builds[missed]))
    return bad


def _rough(rows: MarginRows, draws: Draws, interfaces: Indices, builds: Indices) -> Floats:
    """No row leaves less than this, wherever the shifts go; a turn counts by the farthest lever."""
    import numpy as np

    low, high = rows.bounds
    left = np.full(len(builds), low[0])
    for contour, sign in rows.contours:
        left += sign * draws.value(contour, interfaces, builds)
    column = 3
    for freedom, sign, levers in rows.moves:
        if levers is None:
            left -= draws.reach(freedom, interfaces, builds)
        else:
            turn = sign * draws.value(freedom, interfaces, builds)
            left += np.minimum(low[column] * turn, high[column] * turn)
            column += 1
    return left


class _Sums(NamedTuple):
    """Rows, what was drawn for builds, and that taken together: cuts, shifts and each turn."""

    rows: MarginRows
    drawn: list[Floats]
    cut: Floats
    shift: Floats
    turns: list[Floats]

    @staticmethod
    def of(rows: MarginRows, drawn: list[Floats]) -> _Sums:
        import numpy as np

        cut, shift = np.zeros(drawn[0].shape[1]), np.zeros((2, drawn[0].shape[1]))
        for (_, sign), (one,) in zip(rows.contours, drawn, strict=False):
            cut += sign * one
        moved = drawn[len(rows.contours) :]
        for (_, sign, levers), one in zip(rows.moves, moved, strict=True):
            if levers is None:
                shift += sign * one
        turns = [
            sign * one[0]
            for (_, sign, levers), one in zip(rows.moves, moved, strict=True)
            if levers is not None
        ]
        return _Sums(rows, drawn, cut, shift, turns)

    def at(self, builds: Indices | Bools) -> _Sums:
        """The same for some of the builds."""
        return _Sums(
            self.rows,
            [one[:, builds] for one in self.drawn],
            self.cut[builds],
            self.shift[:, builds],
            [turn[builds] for turn in self.turns],
        )

    def least(self) -> Floats:
        """No row leaves less: all shifts together count by their length, as no normal loses more.

        A turn counts by the farthest lever.
        """
        import numpy as np

        low, high = self.rows.bounds
        left: Floats = low[0] + self.cut - np.hypot(*self.shift)
        for column, turn in enumerate(self.turns, 3):
            left += np.minimum(low[column] * turn, high[column] * turn)
        return left

    def short(self) -> Bools:
        """In which builds a row comes short."""
        import numpy as np

        bad = np.zeros(len(self.cut), dtype=bool)
        every = np.arange(len(self.rows.room))[:, None]
        count = max(1, AT_ONCE // len(every))
        for first in range(0, len(bad), count):
            builds = slice(first, first + count)
            bad[builds] = (self.left(every, builds) < -TOLERANCE).any(axis=0)
        return bad

    def left(self, rows: Indices, builds: Indices | slice) -> Floats:
        """What is left of rows in builds, summed in one order everywhere.

        A matrix product would round differently on another machine.
        """
        left = self.rows.room[rows]
        nx, ny = self.rows.normal[0][rows], self.rows.normal[1][rows]
        cuts = len(self.rows.contours)
        for (_, sign), (cut,) in zip(self.rows.contours, self.drawn, strict=False):
            left = left + sign * cut[builds]
        for (_, sign, levers), drawn in zip(self.rows.moves, self.drawn[cuts:], strict=True):
            if levers is None:
                left = left + (sign * nx) * drawn[0][builds]
                left = left + (sign * ny) * drawn[1][builds]
            else:
                left = left + (sign * levers[rows]) * drawn[0][builds]
        return left


def _picked(some: Bools) -> Indices:
    (numbers,) = some.nonzero()
    return numbers


def _looking(rows: MarginRows, shift: Floats) -> Indices:
    """For each build the row whose normal looks most against all shifts together."""
    import numpy as np

    angle, own = np.arctan2(-shift[1], -shift[0]), rows.angle
    after = np.searchsorted(own, angle) % len(own)
    off = [
        np.abs(np.remainder(own[number] - angle + math.pi, math.tau) - math.pi)
        for number in (after, after - 1)
    ]
    nearest: Indices = np.where(off[0] <= off[1], after, after - 1)
    return nearest
