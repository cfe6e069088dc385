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

from sbafab.rules.draws import DrawnBuilds, Pair
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


class _Bounds(NamedTuple):
    """What moves may take from the rows of each kind, a line for each move, turns first.

    ``place`` is where the errors stand among those of the kind. ``low`` and ``high`` (mm) are what
    a turn to either side takes at most, ``shift`` (mm) is how far shifts go; ``after`` is the most
    that all further lines take. What a kind has not takes nothing.
    """

    place: Indices
    low: Floats
    high: Floats
    shift: Floats
    after: Floats

    @staticmethod
    def of(table: _Table) -> _Bounds:
        low, high = table.turned()
        turns = np.argsort(-np.maximum(-low, high), axis=0, kind="stable")
        turns = turns[: (table.turn > 0).sum(axis=0).max(initial=0)]
        shifts = np.argsort(-table.shift, axis=0, kind="stable")
        shifts = shifts[: (table.shift > 0).sum(axis=0).max(initial=0)]
        low, high = np.take_along_axis(low, turns, 0), np.take_along_axis(high, turns, 0)
        shift = np.take_along_axis(table.shift, shifts, 0)
        takes = np.concatenate([np.maximum(-low, high), shift])
        after = np.cumsum(takes[::-1], axis=0)[::-1] - takes
        # The first two errors are cuts.
        return _Bounds(np.concatenate([turns, shifts]) + 2, low, high, shift, after)

    def of_each(self, kind: Indices, first: Indices) -> _Bounds:
        """The same of what asks, by its kind; with the rows of its numbers for the places."""
        rows = first[self.place[:, kind], np.arange(len(kind))]
        low, high, shift, after = (column[:, kind] for column in self[1:])
        return _Bounds(rows, low, high, shift, after)


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

    def least_uncut(self) -> Floats:
        """By kind: no row leaves less, whatever moves, before what cutting adds or takes."""
        kind = np.repeat(np.arange(len(self.begins) - 1), np.diff(self.begins))
        left = self.room - self.shift.sum(axis=0)[kind]
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

    ``cuts`` are both cutting errors by their signs, ``moves`` x and y of each shift, or a turn
    and 0.
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
            self.moves[:, some],
        )


class RandomBuilds:
    """Tells in which builds the rows of interfaces come short, of all interfaces at once."""

    def __init__(self, asked: Sequence[RowsAsked], cutting: float) -> None:
        kinds = {id(one.rows): one.rows for one in asked}
        numbers = {name: number for number, name in enumerate(kinds)}
        every = list(kinds.values())
        moves = max([len(rows.moves) for rows in every], default=0)
        self.cutting = cutting
        self.kind = np.array([numbers[id(one.rows)] for one in asked], dtype=np.intp)
        first = [(*one.first, *[0] * (2 + moves - len(one.first))) for one in asked]
        self.first = np.array(first, dtype=np.intp).reshape(-1, 2 + moves).T
        signs = [[sign for _, sign in rows.contours] for rows in every]
        self.signs = np.array(signs).reshape(-1, 2).T
        self.table = _Table.of(every, moves)
        self.least = self.table.least
        self.bounds = _Bounds.of(self.table).of_each(self.kind, self.first)
        lines: dict[Pair, int] = {}
        pairs = [
            Pair(a, b, *signs[kind])
            for kind, (a, b, *_) in zip(self.kind.tolist(), first, strict=True)
        ]
        self.line = np.array([lines.setdefault(pair, len(lines)) for pair in pairs], dtype=np.intp)
        """Of what asks, the number of its pair of contours among ``pairs``."""
        self.pairs = tuple(lines)
        least = SURE - self.table.least_uncut() + ROOM
        share = np.where(least > 0, math.inf, -math.inf)
        if cutting > 0:
            share = least / (2 * cutting) + self.signs.sum(axis=0) / 2
        self.share = share[self.kind]
        """Below which sum of the numbers of its pair what asks may come short."""

    def short(self, batch: DrawnBuilds) -> tuple[Indices, Indices]:
        """What was asked for, by number, and the builds in which it comes short."""
        numbers = batch.numbers
        drawn = self._drawn(numbers, *self._roughly(batch, numbers))
        if not len(drawn.asked):
            return drawn.asked, drawn.build
        least = self._least(drawn)
        # What is so near to the limit that it hangs on rounding is summed up in one order.
        near = _picked(abs(least + TOLERANCE) < NEAR)
        is_short = least < -TOLERANCE
        is_short[near] = self._is_short(drawn.at(near))
        return drawn.asked[is_short], drawn.build[is_short]

    def _roughly(self, batch: DrawnBuilds, numbers: Floats) -> tuple[Indices, Indices, Floats]:
        """Where errors may take enough, each by itself; and what cuts and turns leave there.

        One error after the other is taken into account: most builds are decided by the first.
        """
        asked, builds, total = self._cut(batch, numbers)
        signs = self.cutting * self.signs.sum(axis=0)
        held = (self.least - signs)[self.kind][asked] + 2 * self.cutting * total
        drawn, count = numbers.ravel(), numbers.shape[1]
        own, turns = self.bounds, len(self.bounds.low)
        left = held
        for line, (row, after) in enumerate(zip(own.place * count, own.after, strict=True)):
            number = drawn.take(row.take(asked) + builds)
            if line < turns:
                turn = 2 * number - 1
                low, high = own.low[line].take(asked), own.high[line].take(asked)
                left = held = held + np.minimum(low * turn, high * turn)
            else:
                left = left - own.shift[line - turns].take(asked) * np.sqrt(number)
            some = _picked(left - after.take(asked) < SURE)
            asked, builds = asked.take(some), builds.take(some)
            held, left = held.take(some), left.take(some)
        return asked, builds, held

    def _cut(self, batch: DrawnBuilds, numbers: Floats) -> tuple[Indices, Indices, Floats]:
        """Where cutting errors may take enough, and the sums of their numbers, signs kept."""
        line, lowest = self.line, batch.lowest(self.pairs)
        found = [(np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp), np.zeros(0))]
        within = np.zeros(len(line), dtype=bool)
        if lowest is not None:
            within = self.share <= lowest.below[line]
            limit = np.where(within, self.share, -math.inf)
            place = np.flatnonzero(lowest.totals.take(line, axis=0) < limit[:, None])
            asked, place = np.divmod(place, lowest.builds.shape[1])
            found.append(
                (asked, lowest.builds[line[asked], place], lowest.totals[line[asked], place])
            )
        # More may come short than the lowest sums tell of.
        for number in _picked(~within).tolist():
            total = self.pairs[line[number]].total(numbers)
            builds = _picked(total < self.share[number])
            found.append((np.full(len(builds), number), builds, total[builds]))
        return tuple(np.concatenate(one) for one in zip(*found, strict=True))  # type: ignore[return-value]

    def _drawn(self, numbers: Floats, asked: Indices, builds: Indices, held: Floats) -> _Drawn:
        """What was drawn for those of which no row may be left for sure, sorted by kind.

        All shifts together count by their length, as no normal loses more than that of what cuts
        and turns have ``held``.
        """
        order = np.argsort(self.kind[asked], kind="stable")
        asked, builds, held = asked[order], builds[order], held[order]
        kind, table = self.kind[asked], self.table
        drawn, places = numbers.ravel(), self.first * numbers.shape[1]
        moves = np.zeros((2 * len(table.shift), len(asked)))
        together = np.zeros((2, len(asked)))
        for line, most in enumerate(table.shift):
            own = _picked(most[kind] > 0)
            place = places[2 + line][asked[own]] + builds[own]
            radius = most[kind[own]] * np.sqrt(drawn[place])
            angle = math.tau * drawn[place + numbers.shape[1]]
            moves[2 * line, own] = radius * np.cos(angle)
            moves[2 * line + 1, own] = radius * np.sin(angle)
            together += table.sign[line][kind] * moves[2 * line : 2 * line + 2]
        some = _picked(held - np.hypot(*together) < SURE)
        asked, builds, kind, moves = asked[some], builds[some], kind[some], moves[:, some]
        for line, reach in enumerate(table.turn):
            own = _picked(reach[kind] > 0)
            number, most = drawn[places[2 + line][asked[own]] + builds[own]], reach[kind[own]]
            moves[2 * line, own] = -most + (most + most) * number
        cutting = self.cutting
        number = drawn[places[:2, asked] + builds]
        cuts = self.signs[:, kind] * (-cutting + (cutting + cutting) * number)
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
                left = table.factors[:, own].T @ drawn.moves[:, builds]
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
            for factor, moved in zip(table.factors[:, own], drawn.moves[:, number], strict=True):
                left = left + factor * moved
            bad[number] = bool((left < -TOLERANCE).any())
        return bad


def _picked(some: Bools) -> Indices:
    (numbers,) = some.nonzero()
    return numbers
