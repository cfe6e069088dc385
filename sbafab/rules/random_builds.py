"""Random builds: in which of them every margin of an interface keeps its limit.

What is left at a margin beyond its limit is a row: its room and a sum over the errors drawn. Most
builds are decided without that sum: by the cuts alone where the films hardly move, and by the
length of all shifts together, which no normal can lose more than. What rests is summed up, row by
row, and what is summed decides: bounds only say where it need not be done. All interfaces are asked
at once, in arrays.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.rules.draws import DrawnBuilds
from sbafab.rules.likely_builds import ErrorsAsked, likely_builds, picked
from sbafab.rules.limits import TOLERANCE
from sbafab.rules.margin_rows import MarginRows

if TYPE_CHECKING:
    from sbafab.geometry.arrays import Floats, Indices

SURE = 1e-9 - TOLERANCE
"""mm: what is bounded to be left so far above what holds is so, however the sum is rounded."""
ROOM = 1e-12
"""mm: far more than the rounding of a sum of two errors."""
NEAR = 1e-9
"""mm: more than the rounding of a sum of all errors."""
AT_ONCE = 200_000
"""Sums of rows in builds that are worked out at once, which bounds the memory."""


class RowsAsked(NamedTuple):
    """Rows of an interface: the number of their kind, and where the numbers of each of its errors
    begin, as ``RowKind.errors`` names them. They are asked for kind by kind.
    """

    kind: int
    first: Sequence[int]


class _Drawn(NamedTuple):
    """Builds of what is asked: by number of what asks, of its kind and of the build.

    ``cuts`` (mm) is what both cuts leave; ``moves`` are x and y of all shifts together, as they
    count, a line for each turn (radians), and 1 for the room.
    """

    asked: Indices
    kind: Indices
    build: Indices
    cuts: Floats
    moves: Floats


class RandomBuilds:
    """Tells in which builds the rows of interfaces come short, of all interfaces at once.

    Rows that are asked for of several interfaces stand beside each other.
    """

    def __init__(self, rows: MarginRows, asked: Sequence[RowsAsked], cutting: float) -> None:
        self.rows = rows
        begins, lines = rows.begins[:-1], len(rows.turn)
        least = np.minimum.reduceat(rows.room, begins)
        turn = rows.turn.repeat(np.diff(rows.begins), axis=1)
        # However all turns, no row leaves less, before what cuts and shifts take.
        turned = rows.room - (turn * np.abs(rows.levers)).sum(axis=0)
        need = SURE - np.minimum.reduceat(turned, begins) + ROOM
        turning = picked(rows.turn.max(axis=1, initial=0.0) > 0)
        levers, self.turn = rows.levers[turning], rows.turn[turning]
        low = np.minimum.reduceat(levers, begins, axis=1) * self.turn
        high = np.maximum.reduceat(levers, begins, axis=1) * self.turn
        self.kind = kind = np.array([one.kind for one in asked], dtype=np.intp)
        first = [(*one.first, *[0] * (2 + lines - len(one.first))) for one in asked]
        signs = np.array([own.signs for own in rows.kinds]).reshape(-1, 2)
        self.errors = ErrorsAsked(
            np.array(first, dtype=np.intp).reshape(-1, 2 + lines).T.copy(),
            signs.T[:, kind],
            rows.shift[:, kind],
            rows.sign[:, kind],
            turning,
            cutting,
        )
        self.need = need[kind]
        """What asks may come short where cuts and shifts leave less than this, mm."""
        self.least = least[kind]
        self.low, self.high = low[:, kind], high[:, kind]
        """What the full turn of each line adds to the rows of what asks, at least and at most."""
        self.factors = np.vstack([rows.normal, levers, rows.room]).T.copy()
        """Of each row, a column for each line of ``_Drawn.moves``."""

    def short(self, batch: DrawnBuilds) -> tuple[Indices, Indices]:
        """What was asked for, by number, and the builds in which it comes short."""
        drawn = self._drawn(batch)
        if not len(drawn.asked):
            return drawn.asked, drawn.build
        least = self._least(drawn)
        # What is so near to the limit that it hangs on rounding is summed up in one order.
        is_short = least < -TOLERANCE
        for near in picked(abs(least + TOLERANCE) < NEAR).tolist():
            place = int(drawn.asked[near]), int(drawn.build[near])
            is_short[near] = self._is_short(batch.numbers, *place)
        return drawn.asked[is_short], drawn.build[is_short]

    def _drawn(self, batch: DrawnBuilds) -> _Drawn:
        """What was drawn for those of which no row may be left for sure, sorted by kind."""
        likely = likely_builds(batch, self.errors, self.need)
        asked, turns = likely.asked, likely.moves[2:]
        low, high = self.low.take(asked, axis=1), self.high.take(asked, axis=1)
        left = likely.left + self.least.take(asked)
        left += np.minimum(low * turns, high * turns).sum(axis=0)
        own = picked((likely.left < self.need.take(asked)) & (left < SURE))
        asked = asked.take(own)
        kind = self.kind.take(asked)
        moves = np.vstack([likely.moves.take(own, axis=1), np.ones(len(own))])
        moves[2:-1] *= self.turn.take(kind, axis=1)
        return _Drawn(asked, kind, likely.build.take(own), likely.cuts.take(own), moves)

    def _least(self, drawn: _Drawn) -> Floats:
        """What is left at the worst row of each, but for rounding."""
        least = np.zeros(len(drawn.kind))
        kinds = range(len(self.rows.begins))
        begins = np.searchsorted(drawn.kind, kinds).tolist()
        rows = self.rows.begins.tolist()
        for number, (start, stop) in enumerate(pairwise(begins)):
            if start == stop:
                continue
            own = slice(rows[number], rows[number + 1])
            step = max(1, AT_ONCE // (own.stop - own.start))
            for first in range(start, stop, step):
                builds = slice(first, min(stop, first + step))
                left = self.factors[own] @ drawn.moves[:, builds]
                np.minimum.reduce(left, axis=0, out=least[builds])
        found: Floats = least + drawn.cuts
        return found

    def _is_short(self, numbers: Floats, asked: int, build: int) -> bool:
        """Whether a row comes short when all is summed up in one order, the same everywhere.

        A matrix product would round differently on another machine.
        """
        rows, kind, errors = self.rows, int(self.kind[asked]), self.errors
        own = slice(*rows.begins[kind : kind + 2])
        left, cutting = rows.room[own], errors.cutting
        first = errors.first[:, asked].tolist()
        for row, sign in zip(first, errors.signs[:, asked].tolist(), strict=False):
            left = left + sign * (-cutting + (cutting + cutting) * float(numbers[row, build]))
        for line, row in enumerate(first[2:]):
            shift, turn, sign = (
                float(one[line, kind]) for one in (rows.shift, rows.turn, rows.sign)
            )
            number = float(numbers[row, build])
            if shift > 0:
                radius = shift * math.sqrt(number)
                angle = math.tau * float(numbers[row + 1, build])
                x, y = sign * rows.normal[:, own]
                left = left + x * (radius * math.cos(angle))
                left = left + y * (radius * math.sin(angle))
            elif turn > 0:
                left = left + rows.levers[line, own] * (-turn + (turn + turn) * number)
        return bool((left < -TOLERANCE).any())
