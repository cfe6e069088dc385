"""Ranges that a family gives its keys, made wider where the best design stands at their end."""

from __future__ import annotations

from sbafab.search.space import SearchSpace
from sbafab.search.trial import Steps
from sbafab.search.walks import refined

TIMES = 4
"""How often a range is made wider, by its own width each time."""


def widened(space: SearchSpace) -> None:
    """Walks on beyond the ends of ranges that may widen, as long as that leads to better ones."""
    for _ in range(TIMES):
        place, before = space.best()
        ends = space.lows[:], space.highs[:]
        if not _moved_ends(space, place):
            return
        refined(space)
        if not space.best()[1].rank < before.rank:
            space.lows, space.highs = ends
            return


def _moved_ends(space: SearchSpace, place: Steps) -> bool:
    """Makes ranges wider whose end the place stands at; whether there was any."""
    found = False
    for axis, free in enumerate(space.free):
        count = space.counts[axis]
        beyond = {-1: place[axis] == space.lows[axis], 1: place[axis] == space.highs[axis]}
        for sign, is_at_end in beyond.items():
            other = tuple(at + sign * (own == axis) for own, at in enumerate(place))
            value = space.number(axis, other)
            if not free.widens or not is_at_end or value <= 0 or space.is_asked(axis, other):
                continue
            if sign > 0:
                space.highs[axis] += count
            else:
                below = int(round((free.low + space.lows[axis] * free.step) / free.step, 6)) - 1
                space.lows[axis] -= min(count, below)
            found = True
    return found
