"""How a search moves from one design to the next.

A coarse grid, walks from far places, and walks that hold one key still: where a requirement ties
keys together, only a step of one key that the others follow leads on.
"""

from __future__ import annotations

import itertools
import random
from collections.abc import Sequence
from typing import Any

from sbafab.design.files import design_sha256
from sbafab.errors import DesignError
from sbafab.search.trial import IMPOSSIBLE, SearchSpace, Steps

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


# Ranges that a family gives its keys, made wider where the best design stands at their end.


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


# The same search by Optuna, whose storage keeps it, resumes it and shares it between machines.


EXTRA = 'Optuna is not installed: pip install "sbafab[optuna]"'


def with_optuna(search: SearchSpace, storage: str | None) -> None:
    """Tries designs, and leaves a share for the last steps. Raises DesignError without the extra.

    ``storage`` is the URL of the database in which the search goes on.
    """
    try:
        import optuna
    except ImportError:
        raise DesignError(EXTRA) from None
    # Of a search that is stopped it would tell a trial that failed, with a traceback.
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    tries = max(1, round(WALK_SHARE * search.tries))
    try:
        study = optuna.create_study(
            storage=storage,
            study_name=_name(search),
            load_if_exists=True,
            sampler=optuna.samplers.TPESampler(seed=SEED, n_startup_trials=tries // 4),
        )
    except Exception as error:
        said = " ".join(str(error).split())[:200]
        raise DesignError(
            f"--storage {storage} cannot be used ({said}); write for example "
            "--storage sqlite:///search.db"
        ) from None

    def objective(trial: Any) -> float:
        place = tuple(
            trial.suggest_int(free.key, 0, count - 1)
            for free, count in zip(search.free, search.counts, strict=True)
        )
        found = search.trial(place)
        # What misses is worse than all that holds, by how much it misses.
        return found.cost if found.holds else IMPOSSIBLE * (1 + min(found.missed, IMPOSSIBLE))

    # What is stored was tried by an earlier run: here it is looked up again, and tried no more.
    done = study.get_trials(states=[optuna.trial.TrialState.COMPLETE])
    for old in done:
        search.trial(tuple(old.params[free.key] for free in search.free))
    study.optimize(objective, n_trials=max(0, tries - len(done)))


def _name(search: SearchSpace) -> str:
    asked = [one.said for one in search.wanted.requirements]
    keys = [f"{one.key} {one.low:g} to {one.high:g} by {one.step:g}" for one in search.free]
    design = search.wanted.design
    return "; ".join(
        [f"{design.name} {design_sha256(design)[:12]}", *asked, search.wanted.goal.said, *keys]
    )
