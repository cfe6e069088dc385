"""Builds in which something may come short, by what hangs on no size: cuts and shifts.

The same errors are drawn for every laminate with the same layers and contours, and so are the
builds that they bring near a limit: what was found for one laminate is kept, with some room, for
the next.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.rules.draws import DrawnBuilds

if TYPE_CHECKING:
    from sbafab.geometry.arrays import Bools, Floats, Indices

SLACK = 0.01
"""mm: how much more than it asks for is kept from the second laminate on, for those after it."""
MOST_KEPT = 40_000
"""Builds of all that ask which are kept, a few MB; where there are more, none are."""


class ErrorsAsked(NamedTuple):
    """The errors of what asks, a column each.

    ``first`` are the numbers of their first rows: two cuts, then moves. ``signs`` is how the cuts
    count, ``shift`` (mm) how far each move shifts, 0 where it turns, and ``sign`` how it counts.
    ``turning`` are the lines of moves that turn anything.
    """

    first: Indices
    signs: Floats
    shift: Floats
    sign: Floats
    turning: Indices
    cutting: float

    @property
    def name(self) -> bytes:
        """Equal for equal errors."""
        return b"".join([np.float64(self.cutting).tobytes(), *(one.tobytes() for one in self[:5])])


class LikelyBuilds(NamedTuple):
    """Builds by the number of what asks, in rising order.

    ``cuts`` (mm) is what both cuts leave, ``moves`` are x and y of all shifts together, as they
    count, and how far each line turns that turns anything, -1 to 1 of its most. ``left`` is what
    the cuts leave less the length of the shifts, which no normal loses more than. What asks has no
    other builds below its ``level``.
    """

    asked: Indices
    build: Indices
    cuts: Floats
    moves: Floats
    left: Floats
    level: Floats

    def covers(self, need: Floats) -> bool:
        """Whether no build below these is missing."""
        return bool((need <= self.level).all())


class _Kept:
    """What was found last, if anything."""

    found: LikelyBuilds | None = None


@lru_cache(maxsize=4)
def _kept(batch: DrawnBuilds, name: bytes) -> _Kept:
    del batch, name
    return _Kept()


def likely_builds(batch: DrawnBuilds, errors: ErrorsAsked, need: Floats) -> LikelyBuilds:
    """All builds in which cuts and shifts leave less than what asks needs, and perhaps others."""
    kept = _kept(batch, errors.name)
    known = kept.found
    if known is not None and known.covers(need):
        return known
    if known is not None:
        wide = _found(batch, errors, np.maximum(need + SLACK, known.level))
        if len(wide.asked) <= MOST_KEPT:
            kept.found = wide
            return wide
    found = _found(batch, errors, need)
    kept.found = found if len(found.asked) <= MOST_KEPT else None
    return found


def _found(batch: DrawnBuilds, errors: ErrorsAsked, level: Floats) -> LikelyBuilds:
    """The builds below a level: one error after the other is counted, as most decide soon."""
    numbers = batch.numbers
    drawn, count = numbers.ravel(), numbers.shape[1]
    shift = errors.shift
    asked, builds, held = _cut(numbers, errors, level + shift.sum(axis=0))
    order = np.argsort(-shift, axis=0, kind="stable")[: (shift > 0).sum(axis=0).max(initial=0)]
    reach = np.take_along_axis(shift, order, 0)
    places = np.take_along_axis(errors.first[2:], order, 0) * count
    after = np.cumsum(reach[::-1], axis=0)[::-1] - reach
    left = held
    for place, own, rest in zip(places, reach, after, strict=True):
        number = drawn.take(place.take(asked) + builds)
        left = left - own.take(asked) * np.sqrt(number)
        some = picked(left < (level + rest).take(asked))
        asked, builds = asked.take(some), builds.take(some)
        held, left = held.take(some), left.take(some)
    shifts = np.zeros((2, len(asked)))
    for line, most in enumerate(shift):
        own = picked(most.take(asked) > 0)
        some = asked.take(own)
        place = errors.first[2 + line].take(some) * count + builds[own]
        reached = (errors.sign[line] * most).take(some) * np.sqrt(drawn.take(place))
        angle = math.tau * drawn.take(place + count)
        shifts[0, own] += reached * np.cos(angle)
        shifts[1, own] += reached * np.sin(angle)
    left = held - np.hypot(*shifts)
    some = picked(left < level.take(asked))
    asked, builds = asked.take(some), builds.take(some)
    moves = np.empty((2 + len(errors.turning), len(some)))
    moves[:2] = shifts[:, some]
    for row, line in enumerate(errors.turning.tolist(), 2):
        moves[row] = 2 * drawn.take(errors.first[2 + line].take(asked) * count + builds) - 1
    return LikelyBuilds(asked, builds, held.take(some), moves, left.take(some), level)


def _cut(numbers: Floats, errors: ErrorsAsked, level: Floats) -> tuple[Indices, Indices, Floats]:
    """Builds in which cutting errors together come below a level, and how far they come, mm."""
    cutting, (one_sign, other_sign) = errors.cutting, errors.signs
    share = np.where(level > 0, math.inf, -math.inf)
    if cutting > 0:
        share = level / (2 * cutting) + (one_sign + other_sign) / 2
    least = np.minimum(one_sign, 0) + np.minimum(other_sign, 0)
    counts: list[int] = []
    found: list[Indices] = [np.zeros(0, dtype=np.intp)]
    totals = [np.zeros(0)]
    asking = picked(share > least)
    for number in asking.tolist():
        one, other = numbers[errors.first[0, number]], numbers[errors.first[1, number]]
        total = one_sign[number] * one + other_sign[number] * other
        builds = picked(total < share[number])
        counts.append(len(builds))
        found.append(builds)
        totals.append(total.take(builds))
    asked = np.repeat(asking, counts)
    signs = (one_sign + other_sign).take(asked)
    return asked, np.concatenate(found), cutting * (2 * np.concatenate(totals) - signs)


def picked(some: Bools) -> Indices:
    """The numbers of those that are true."""
    (numbers,) = some.nonzero()
    return numbers
