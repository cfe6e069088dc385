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
    """Rows of an interface, and where the numbers of each of its errors begin, as ``rows.errors``
    names them.
    """

    rows: MarginRows
    first: tuple[int, ...]


class _Table(NamedTuple):
    """All rows of all kinds, one kind after the other: their rooms, and their factors, a line each.

    A move has two lines: the normal's x and y times its sign, or its levers and 0. ``shift`` (mm)
    and ``turn`` (radians) say how far the moves of each kind go, ``sign`` how its shifts count.
    """

    begins: Indices
    room: Floats
    factors: Floats
    shift: Floats
    turn: Floats
    sign: Floats

    @staticmethod
    def of(kinds: Sequence[MarginRows], moves: int) -> _Table:
        begins = np.cumsum([0, *(len(rows.room) for rows in kinds)])
        factors = np.zeros((2 * moves, int(begins[-1])))
        shift, turn, signs = np.zeros((3, moves, len(kinds)))
        for number, rows in enumerate(kinds):
            own = slice(begins[number], begins[number + 1])
            for line, (freedom, sign, levers) in enumerate(rows.moves):
                if levers is None:
                    shift[line, number], signs[line, number] = freedom.most, sign
                    factors[2 * line : 2 * line + 2, own] = sign * rows.normal
                else:
                    turn[line, number] = freedom.most
                    factors[2 * line, own] = sign * levers
        room = np.concatenate([np.zeros(0), *(rows.room for rows in kinds)])
        return _Table(begins, room, factors, shift, turn, signs)

    @property
    def least(self) -> Floats:
        """The least room of each kind."""
        return _of_kinds(np.minimum, self.room, self.begins)

    def least_turned(self) -> Floats:
        """By kind: no row leaves less, however all turns, before what cuts and shifts take."""
        kind = np.repeat(np.arange(len(self.begins) - 1), np.diff(self.begins))
        left = self.room.copy()
        for levers, most in zip(self.factors[::2], self.turn, strict=True):
            left -= most[kind] * np.abs(levers)
        return _of_kinds(np.minimum, left, self.begins)

    def turned(self) -> tuple[Floats, Floats]:
        """What the full turn of each line adds to the rows of each kind, at least and at most."""
        levers = self.factors[::2]
        low, high = (_of_kinds(one, levers, self.begins) for one in (np.minimum, np.maximum))
        return low * self.turn, high * self.turn


def _of_kinds(which: np.ufunc, rows: Floats, begins: Indices) -> Floats:
    """The least, or the largest, of the rows of each kind."""
    if not rows.shape[-1]:
        return rows
    found: Floats = which.reduceat(rows, begins[:-1], axis=-1)
    return found


class _Drawn(NamedTuple):
    """Builds of what is asked: by number of what asks, of its kind and of the build.

    ``cuts`` (mm) is what both cuts leave; ``moves`` are x and y of all shifts together, as they
    count, and a line for each turn (radians).
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

    def __init__(self, asked: Sequence[RowsAsked], cutting: float) -> None:
        kinds = {id(one.rows): one.rows for one in asked}
        numbers = {name: number for number, name in enumerate(kinds)}
        every = list(kinds.values())
        moves = max([len(rows.moves) for rows in every], default=0)
        kind = np.array([numbers[id(one.rows)] for one in asked], dtype=np.intp)
        first = [(*one.first, *[0] * (2 + moves - len(one.first))) for one in asked]
        signs = [[sign for _, sign in rows.contours] for rows in every]
        self.kind = kind
        self.table = table = _Table.of(every, moves)
        self.errors = ErrorsAsked(
            np.array(first, dtype=np.intp).reshape(-1, 2 + moves).T.copy(),
            np.array(signs).reshape(-1, 2).T[:, kind],
            table.shift[:, kind],
            table.sign[:, kind],
            cutting,
        )
        self.need = (SURE - table.least_turned() + ROOM)[kind]
        """What asks may come short where cuts and shifts leave less than this, mm."""
        self.least = table.least[kind]
        low, high = table.turned()
        self.low, self.high = low[:, kind], high[:, kind]
        self.turning = [line for line, most in enumerate(table.turn) if most.any()]
        """The lines of moves that turn a kind; others are turned by nothing there."""
        normal = np.concatenate([np.zeros((2, 0)), *(rows.normal for rows in every)], axis=1)
        self.factors = np.concatenate([normal, table.factors[::2][self.turning]])

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
        some = picked(likely.left < self.need.take(likely.asked))
        asked, builds = likely.asked.take(some), likely.build.take(some)
        left = likely.left.take(some) + self.least.take(asked)
        numbers, first = batch.numbers, self.errors.first
        drawn, count = numbers.ravel(), numbers.shape[1]
        turns = []
        for line in self.turning:
            number = drawn.take(first[2 + line].take(asked) * count + builds)
            turn = 2 * number - 1
            low, high = self.low[line].take(asked), self.high[line].take(asked)
            left += np.minimum(low * turn, high * turn)
            turns.append(turn)
        own = picked(left < SURE)
        asked, builds, some = asked.take(own), builds.take(own), some.take(own)
        kind = self.kind.take(asked)
        moves = np.empty((2 + len(turns), len(own)))
        moves[0], moves[1] = likely.shifts[0].take(some), likely.shifts[1].take(some)
        for row, (line, turn) in enumerate(zip(self.turning, turns, strict=True), 2):
            moves[row] = self.table.turn[line].take(kind) * turn.take(own)
        return _Drawn(asked, kind, builds, likely.cuts.take(some), moves)

    def _least(self, drawn: _Drawn) -> Floats:
        """What is left at the worst row of each, but for rounding."""
        table, least = self.table, np.zeros(len(drawn.kind))
        kinds = range(len(table.begins))
        begins = np.searchsorted(drawn.kind, kinds).tolist()
        rows = table.begins.tolist()
        for number, (start, stop) in enumerate(pairwise(begins)):
            if start == stop:
                continue
            own = slice(rows[number], rows[number + 1])
            step = max(1, AT_ONCE // (own.stop - own.start))
            for first in range(start, stop, step):
                builds = slice(first, min(stop, first + step))
                left = self.factors[:, own].T @ drawn.moves[:, builds]
                left += table.room[own, None]
                least[builds] = left.min(axis=0)
        found: Floats = least + drawn.cuts
        return found

    def _is_short(self, numbers: Floats, asked: int, build: int) -> bool:
        """Whether a row comes short when all is summed up in one order, the same everywhere.

        A matrix product would round differently on another machine.
        """
        table, kind, errors = self.table, int(self.kind[asked]), self.errors
        own = slice(*table.begins[kind : kind + 2])
        left, cutting = table.room[own], errors.cutting
        first = errors.first[:, asked].tolist()
        for row, sign in zip(first, errors.signs[:, asked].tolist(), strict=False):
            left = left + sign * (-cutting + (cutting + cutting) * float(numbers[row, build]))
        for line, row in enumerate(first[2:]):
            x, y = table.factors[2 * line : 2 * line + 2, own]
            number = float(numbers[row, build])
            if table.shift[line, kind] > 0:
                radius = float(table.shift[line, kind]) * math.sqrt(number)
                angle = math.tau * float(numbers[row + 1, build])
                left = left + x * (radius * math.cos(angle))
                left = left + y * (radius * math.sin(angle))
            elif table.turn[line, kind] > 0:
                most = float(table.turn[line, kind])
                left = left + x * (-most + (most + most) * number)
        return bool((left < -TOLERANCE).any())
