"""Random builds: in which of them every margin of an interface keeps its limit.

What is left at a margin beyond its limit is a row: its room and a sum over the errors drawn. Most
builds are decided without that sum: by the cuts alone where the films hardly move, and by the
length of all shifts together, which no normal can lose more than. What rests is summed up, row by
row, and what is summed decides: bounds only say where it need not be done. All interfaces are asked
at once, in arrays.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.rules.draws import DrawnBuilds
from sbafab.rules.likely_builds import ErrorsAsked, likely_builds, picked
from sbafab.rules.limits import TOLERANCE
from sbafab.rules.margin_rows import MarginRows

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Bools = NDArray[np.bool_]
    Floats = NDArray[np.float64]
    Indices = NDArray[np.intp]

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

    ``cuts`` are both cutting errors by their signs; ``moves`` has a row a build, with x and y of
    each shift, or a turn and 0.
    """

    asked: Indices
    kind: Indices
    build: Indices
    cuts: Floats
    moves: Floats

    def at(self, some: Indices) -> _Drawn:
        return _Drawn(
            self.asked[some],
            self.kind[some],
            self.build[some],
            self.cuts[:, some],
            self.moves[some],
        )


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
        self.turned = low[:, kind], high[:, kind]

    def short(self, batch: DrawnBuilds) -> tuple[Indices, Indices]:
        """What was asked for, by number, and the builds in which it comes short."""
        drawn = self._drawn(batch)
        if not len(drawn.asked):
            return drawn.asked, drawn.build
        least = self._least(drawn)
        # What is so near to the limit that it hangs on rounding is summed up in one order.
        near = picked(abs(least + TOLERANCE) < NEAR)
        is_short = least < -TOLERANCE
        is_short[near] = self._is_short(drawn.at(near))
        return drawn.asked[is_short], drawn.build[is_short]

    def _drawn(self, batch: DrawnBuilds) -> _Drawn:
        """What was drawn for those of which no row may be left for sure, sorted by kind."""
        likely = likely_builds(batch, self.errors, self.need)
        some = picked(likely.left < self.need.take(likely.asked))
        asked, builds = likely.asked.take(some), likely.build.take(some)
        left = likely.left.take(some) + self.least.take(asked)
        numbers, table, first = batch.numbers, self.table, self.errors.first
        drawn, count = numbers.ravel(), numbers.shape[1]
        turns = []
        for line, (low, high) in enumerate(zip(*self.turned, strict=True)):
            if table.turn[line].any():
                number = drawn.take(first[2 + line].take(asked) * count + builds)
                turn = 2 * number - 1
                left += np.minimum(low.take(asked) * turn, high.take(asked) * turn)
                turns.append((line, number))
        own = picked(left < SURE)
        asked, builds = asked.take(own), builds.take(own)
        kind, moves = self.kind.take(asked), likely.moves.take(some.take(own), axis=0)
        for line, number in turns:
            most = table.turn[line].take(kind)
            moves[:, 2 * line] += np.where(most > 0, -most + (most + most) * number.take(own), 0.0)
        cutting = self.errors.cutting
        number = drawn.take(first[:2].take(asked, axis=1) * count + builds)
        cuts = self.errors.signs.take(asked, axis=1) * (-cutting + (cutting + cutting) * number)
        return _Drawn(asked, kind, builds, cuts, moves)

    def _least(self, drawn: _Drawn) -> Floats:
        """What is left at the worst row of each, but for rounding."""
        table, least = self.table, np.zeros(len(drawn.kind))
        kinds = range(len(table.begins))
        begins = np.searchsorted(drawn.kind, kinds).tolist()
        for number, (start, stop) in enumerate(pairwise(begins)):
            own = slice(*table.begins[number : number + 2])
            step = max(1, AT_ONCE // (own.stop - own.start))
            for first in range(start, stop, step):
                builds = slice(first, min(stop, first + step))
                left = table.factors[:, own].T @ drawn.moves[builds].T
                left += table.room[own, None]
                least[builds] = left.min(axis=0)
        found: Floats = least + drawn.cuts[0] + drawn.cuts[1]
        return found

    def _is_short(self, drawn: _Drawn) -> Bools:
        """Whether a row comes short when all is summed up in one order, the same everywhere.

        A matrix product would round differently on another machine.
        """
        table, bad = self.table, np.zeros(len(drawn.kind), dtype=bool)
        for number, kind in enumerate(drawn.kind.tolist()):
            own = slice(*table.begins[kind : kind + 2])
            left = table.room[own]
            for cut in drawn.cuts[:, number]:
                left = left + cut
            for factor, moved in zip(table.factors[:, own], drawn.moves[number], strict=True):
                left = left + factor * moved
            bad[number] = bool((left < -TOLERANCE).any())
        return bad
