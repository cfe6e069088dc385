"""Random builds: in which of them every margin of an interface keeps its limit.

What is left at a margin beyond its limit is a row: its room and a sum over the errors drawn. Most
builds are decided without that sum: by the length of all shifts together, which no normal can lose
more than, and by the row that looks most against them. What rests is summed up, row by row, and
what is summed decides: bounds only say where it need not be done.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

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
CHUNK = 8
"""Rows of nearly one normal that are bounded together."""
UNITS = 1000
"""Factors that are equal to so many parts are one: rows that feel all errors alike."""


class CutContour(NamedTuple):
    """A cut contour: by how far its film reaches beyond the nominal edge."""

    layer: int
    contour: int


Error = CutContour | Freedom


class DrawBounds(NamedTuple):
    """Least and largest of the room, the normal's x and y and the levers, in chunks of rows."""

    low: Floats
    high: Floats


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
    def bounds(self) -> DrawBounds:
        import numpy as np

        levers = [levers for _, _, levers in self.moves if levers is not None]
        columns = np.array([self.room, *self.normal, *levers])
        starts = np.arange(0, len(self.room), CHUNK)
        return DrawBounds(
            np.minimum.reduceat(columns, starts, axis=1),
            np.maximum.reduceat(columns, starts, axis=1),
        )


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


class Draws:
    """The errors of a batch of builds, each drawn when it is first asked for."""

    def __init__(self, generator: np.random.Generator, builds: int, cutting: float) -> None:
        self.generator = generator
        self.builds = builds
        self.cutting = cutting
        self.drawn: dict[Error, Floats] = {}

    def of(self, error: Error) -> Floats:
        """X and y of a shift, or the one value of a cutting error or turn, for every build."""
        if error not in self.drawn:
            self.drawn[error] = self._draw(error)
        return self.drawn[error]

    def _draw(self, error: Error) -> Floats:
        import numpy as np

        if isinstance(error, Freedom) and error.centre is None:
            # Uniform over a disc: the radius goes with the root.
            radius = error.most * np.sqrt(self.generator.random(self.builds))
            angle = math.tau * self.generator.random(self.builds)
            return np.vstack([radius * np.cos(angle), radius * np.sin(angle)])
        most = error.most if isinstance(error, Freedom) else self.cutting
        return self.generator.uniform(-most, most, (1, self.builds))


def kept(rows: Iterable[MarginRows], own: Mapping[Error, Error], draws: Draws) -> Bools:
    """In which builds an interface, with its own errors, keeps room at all of the rows."""
    import numpy as np

    good = np.ones(draws.builds, dtype=bool)
    for some in rows:
        drawn = [draws.of(own[error]) for error in some.errors]
        sums = _Sums.of(some, drawn)
        builds = _picked(good & (sums.least() < SURE))
        sums = sums.at(builds)
        facing = sums.left(_looking(some, sums.shift), slice(None)) >= -TOLERANCE
        good[builds[~facing]] = False
        if facing.any():
            builds = builds[facing]
            good[builds[sums.at(facing).short()]] = False
    return good


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

    def least(self, chunk: int | None = None) -> Floats:
        """No row of a chunk leaves less than this, and no row at all where none is named.

        Then all shifts together count by their length: no normal loses more to them.
        """
        import numpy as np

        bounds = self.rows.bounds
        if chunk is None:
            low, high = bounds.low.min(axis=1), bounds.high.max(axis=1)
            left: Floats = low[0] + self.cut - np.hypot(*self.shift)
        else:
            low, high = bounds.low[:, chunk], bounds.high[:, chunk]
            left = low[0] + self.cut
            for column, along in enumerate(self.shift, 1):
                left += np.minimum(low[column] * along, high[column] * along)
        for column, turn in enumerate(self.turns, 3):
            left += np.minimum(low[column] * turn, high[column] * turn)
        return left

    def short(self) -> Bools:
        """In which builds a row comes short; looked for chunk by chunk."""
        import numpy as np

        bad = np.zeros(len(self.cut), dtype=bool)
        for chunk, first in enumerate(range(0, len(self.rows.room), CHUNK)):
            unsure = _picked(self.least(chunk) < SURE)
            if len(unsure):
                own = np.arange(first, min(first + CHUNK, len(self.rows.room)))
                left = self.left(own[:, None], unsure[None, :])
                bad[unsure] |= (left < -TOLERANCE).any(axis=0)
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
