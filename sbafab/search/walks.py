"""How a search moves from one design to the next.

A coarse grid, walks from far places, and walks that hold one key still: where a requirement ties
keys together, only a step of one key that the others follow leads on.
"""

from __future__ import annotations

import itertools
import random
from collections.abc import Sequence

from sbafab.search.space import SearchSpace
from sbafab.search.trial import Steps

GRID_SHARE = 0.25
WALK_SHARE = 0.6
"""Of all tries: for the coarse grid, and until the walks from far places have to end."""
STARTS = 4
"""Designs of the grid from which to go on."""
FEW = 40
"""Values of a key that is held still in turn: balloons, not diameters."""
HELD = (-1, 1, -2, 2)
"""Steps of the key that is then held still."""
SEED = 20_240


def every_design(space: SearchSpace) -> None:
    """Tries all that there are."""
    ranges = zip(space.lows, space.highs, strict=True)
    for place in itertools.product(*(range(low, high + 1) for low, high in ranges)):
        space.trial(place, asks=False)


def explored(space: SearchSpace) -> None:
    """Tries a coarse grid, then walks from the best places that lie far apart.

    While nothing holds it starts anew from random places, as long as there are tries.
    """
    space.limit = round(WALK_SHARE * space.tries)
    _grid(space)
    dice = random.Random(SEED)
    starts = _starts(space)
    while not space.is_over:
        if starts:
            start = starts.pop(0)
        elif space.best()[1].holds:
            break
        else:
            ranges = zip(space.lows, space.highs, strict=True)
            start = tuple(dice.randint(low, high) for low, high in ranges)
        _descended(space, start)


def refined(space: SearchSpace) -> None:
    """Walks on from the best: no neighbour, and no walk beside it with one key held, is better."""
    space.limit = space.tries
    while not space.is_over:
        place = _walked(space, space.best()[0], [1] * len(space.free))
        if not _is_bettered(space, place):
            return


def _is_bettered(space: SearchSpace, place: Steps) -> bool:
    """Whether a walk that holds a key a step or two away finds something better."""
    counts = space.counts
    order = sorted(range(len(counts)), key=lambda axis: counts[axis])
    for axis in order:
        if not 1 < counts[axis] <= FEW or len(counts) == 1:
            continue
        for by in HELD:
            start = moved(space, place, [by if own == axis else 0 for own in range(len(counts))])
            if start is None or space.is_over:
                continue
            for share in (32, 128, max(counts)):
                stride = [
                    0 if own == axis else max(1, count // share) for own, count in enumerate(counts)
                ]
                start = _walked(space, start, stride)
            if start in space.trials and space.trial(start).rank < space.trial(place).rank:
                return True
    return False


def _grid(space: SearchSpace) -> None:
    """A coarse grid, as fine as its share of the tries allows."""
    room = max(8.0, GRID_SHARE * space.tries)
    levels = max(2, int(room ** (1 / len(space.free))))
    axes = []
    for low, count in zip(space.lows, space.counts, strict=True):
        few = min(levels, count)
        steps = [low + round((count - 1) * number / max(1, few - 1)) for number in range(few)]
        axes.append(list(dict.fromkeys(steps)))
    for place in itertools.product(*axes):
        if space.is_over:
            return
        space.trial(place, asks=False)


def _starts(space: SearchSpace) -> list[Steps]:
    """Where the design itself stands, and the best of the grid that are far from each other."""
    found = [space.nearest()]
    for place in sorted(space.trials, key=lambda place: space.trials[place].rank):
        is_far = all(
            any(
                abs(a - b) * 3 > count for a, b, count in zip(place, one, space.counts, strict=True)
            )
            for one in found
        )
        if is_far and len(found) < STARTS:
            found.append(place)
    return found


def _descended(space: SearchSpace, start: Steps) -> None:
    """Walks with steps that are halved where none is better."""
    place, share = start, 4
    while share <= 2 * max(space.counts) and not space.is_over:
        place = _walked(space, place, [max(1, count // share) for count in space.counts])
        share *= 2


def _walked(space: SearchSpace, place: Steps, stride: Sequence[int]) -> Steps:
    """Where steps lead while they are better: along a key, or along two against each other.

    Where two requirements meet, only a step of both keys leads on. What is better once is tried
    again. A key whose stride is 0 is held still.
    """
    moves = neighbours(stride)
    stale = 0
    while stale < len(moves) and not space.is_over:
        other = moved(space, place, moves[0])
        if other is not None and space.trial(other).rank < space.trial(place).rank:
            place, stale = other, 0
        else:
            stale += 1
            moves = [*moves[1:], moves[0]]
    return place


def neighbours(stride: Sequence[int]) -> list[tuple[int, ...]]:
    """The moves: single keys first, down and up, then pairs of keys against each other."""
    count = len(stride)
    own = [axis for axis in range(count) if stride[axis]]
    moves = []
    for axis in own:
        for sign in (-1, 1):
            moves.append(tuple(sign * stride[axis] if at == axis else 0 for at in range(count)))
    for a, b in itertools.combinations(own, 2):
        for sign in (-1, 1):
            move = [0] * count
            move[a], move[b] = sign * stride[a], -sign * stride[b]
            moves.append(tuple(move))
    return moves


def moved(space: SearchSpace, place: Steps, move: Sequence[int]) -> Steps | None:
    """The place of a step, kept within the keys' ranges; None where that leads nowhere."""
    inside = space.inside([at + by for at, by in zip(place, move, strict=True)])
    return inside if inside != place else None
