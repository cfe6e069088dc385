"""Search strategies: coarse grid, local searches, and Optuna.

A local search takes steps along a key, along two keys against each other, and with one key held
fixed: if a requirement ties keys together, only a step of one key that the others follow makes
progress.
"""

from __future__ import annotations

import itertools
import random
from collections.abc import Sequence
from typing import Any

from sbafab.design.identity import design_sha256
from sbafab.errors import DesignError
from sbafab.search.trial import IMPOSSIBLE, GridPoint, SearchSpace

GRID_SHARE = 0.25
WALK_SHARE = 0.6
"""Shares of all tries: for the coarse grid, and the point where walks from far places must end."""
STARTS = 4
"""Designs of the grid from which to continue."""
FEW = 40
"""Most values of a key that is held fixed in turn: balloons, not diameters."""
FIXED_STEPS = (-1, 1, -2, 2)
"""Steps of the key that is then held fixed."""
SEED = 20_240


def try_every_design(space: SearchSpace) -> None:
    """Evaluate all designs of the space."""
    ranges = zip(space.lows, space.highs, strict=True)
    for point in itertools.product(*(range(low, high + 1) for low, high in ranges)):
        space.trial(point, checks_rules=False)


def explore(space: SearchSpace) -> None:
    """Evaluate a coarse grid, then search locally from its best points that lie far apart.

    While no design passes, it restarts from random points, as long as tries are left.
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
        _descend(space, start)


def refine(space: SearchSpace) -> None:
    """Search locally from the best until no neighbour and no search with a fixed key is better."""
    space.limit = space.tries
    while not space.is_over:
        point = _walk(space, space.best()[0], [1] * len(space.free))
        if not _has_better_walk(space, point):
            return


def _has_better_walk(space: SearchSpace, point: GridPoint) -> bool:
    """Return True if a search with a key fixed a step or two away finds a better candidate."""
    counts = space.counts
    order = sorted(range(len(counts)), key=lambda axis: counts[axis])
    for axis in order:
        if not 1 < counts[axis] <= FEW or len(counts) == 1:
            continue
        for by in FIXED_STEPS:
            start = shifted(
                space, point, [by if number == axis else 0 for number in range(len(counts))]
            )
            if start is None or space.is_over:
                continue
            for share in (32, 128, max(counts)):
                stride = [
                    0 if number == axis else max(1, count // share)
                    for number, count in enumerate(counts)
                ]
                start = _walk(space, start, stride)
            if start in space.trials and space.trial(start).rank < space.trial(point).rank:
                return True
    return False


def _grid(space: SearchSpace) -> None:
    """Evaluate a coarse grid, as fine as its share of the tries allows.

    Keys with words keep their starting value: the walks from the grid change them.
    """
    room = max(8.0, GRID_SHARE * space.tries)
    numbers = sum(not free.choices for free in space.free)
    levels = max(2, int(room ** (1 / max(1, numbers))))
    axes = []
    begin = space.nearest()
    for axis, (low, count) in enumerate(zip(space.lows, space.counts, strict=True)):
        if space.free[axis].choices:
            axes.append([begin[axis]])
            continue
        few = min(levels, count)
        steps = [low + round((count - 1) * number / max(1, few - 1)) for number in range(few)]
        axes.append(list(dict.fromkeys(steps)))
    for point in itertools.product(*axes):
        if space.is_over:
            return
        space.trial(point, checks_rules=False)


def _starts(space: SearchSpace) -> list[GridPoint]:
    """Return the starting point and the best points of the grid that lie far apart."""
    starts = [space.nearest()]
    for point in sorted(space.trials, key=lambda point: space.trials[point].rank):
        is_far = all(
            any(
                abs(a - b) * 3 > count
                for a, b, count in zip(point, start, space.counts, strict=True)
            )
            for start in starts
        )
        if is_far and len(starts) < STARTS:
            starts.append(point)
    return starts


def _descend(space: SearchSpace, start: GridPoint) -> None:
    """Search locally with steps that are halved if none is better."""
    point, share = start, 4
    while share <= 2 * max(space.counts) and not space.is_over:
        point = _walk(space, point, [max(1, count // share) for count in space.counts])
        share *= 2


def _walk(space: SearchSpace, point: GridPoint, stride: Sequence[int]) -> GridPoint:
    """Return the end of improving steps: along one key, or along two against each other.

    Where two requirements meet, only a step of both keys makes progress. A move that improved is
    repeated. A key whose stride is 0 is held fixed.
    """
    moves = neighbours(stride)
    stale = 0
    while stale < len(moves) and not space.is_over:
        neighbour = shifted(space, point, moves[0])
        if neighbour is not None and space.trial(neighbour).rank < space.trial(point).rank:
            point, stale = neighbour, 0
        else:
            stale += 1
            moves = [*moves[1:], moves[0]]
    return point


def neighbours(stride: Sequence[int]) -> list[tuple[int, ...]]:
    """The moves: single keys first, down and up, then pairs of keys against each other."""
    count = len(stride)
    moving = [axis for axis in range(count) if stride[axis]]
    moves = []
    for axis in moving:
        for sign in (-1, 1):
            moves.append(tuple(sign * stride[axis] if at == axis else 0 for at in range(count)))
    for a, b in itertools.combinations(moving, 2):
        for sign in (-1, 1):
            move = [0] * count
            move[a], move[b] = sign * stride[a], -sign * stride[b]
            moves.append(tuple(move))
    return moves


def shifted(space: SearchSpace, point: GridPoint, move: Sequence[int]) -> GridPoint | None:
    """Return the point after a move, kept within the keys' ranges; None if it stays."""
    inside = space.inside([at + by for at, by in zip(point, move, strict=True)])
    return inside if inside != point else None


# Widen ranges of keys whose best value is at an end of the range.


TIMES = 4
"""Most times a range is widened, by its own width each time."""


def widen_ranges(space: SearchSpace) -> None:
    """Search beyond the ends of ranges that may widen, as long as that finds better designs."""
    for _ in range(TIMES):
        point, before = space.best()
        ends = space.lows[:], space.highs[:]
        if not _widen_ends(space, point):
            return
        refine(space)
        if not space.best()[1].rank < before.rank:
            space.lows, space.highs = ends
            return


def _widen_ends(space: SearchSpace, point: GridPoint) -> bool:
    """Widen the ranges at whose end the point lies; return True if any was."""
    has_widened = False
    for axis, free in enumerate(space.free):
        count = space.counts[axis]
        beyond = {-1: point[axis] == space.lows[axis], 1: point[axis] == space.highs[axis]}
        for sign, is_at_end in beyond.items():
            beyond_end = tuple(at + sign * (number == axis) for number, at in enumerate(point))
            value = space.number(axis, beyond_end)
            if (
                not free.widens
                or not is_at_end
                or value <= 0
                or space.is_excluded(axis, beyond_end)
            ):
                continue
            if sign > 0:
                space.highs[axis] += count
            else:
                below = int(round((free.low + space.lows[axis] * free.step) / free.step, 6)) - 1
                space.lows[axis] -= min(count, below)
            has_widened = True
    return has_widened


# Search by Optuna, whose storage resumes it and shares it between machines.


EXTRA = 'Optuna is not installed: pip install "sbafab[optuna]"'


def with_optuna(search: SearchSpace, storage: str | None) -> None:
    """Evaluate designs that Optuna proposes, and keep a share of the tries for the final steps.

    ``storage`` is the URL of the database in which the search resumes. Raises DesignError without
    the extra.
    """
    try:
        import optuna
    except ImportError:
        raise DesignError(EXTRA) from None
    # If a search is stopped, Optuna would report a failed trial with a traceback.
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
        message = " ".join(str(error).split())[:200]
        raise DesignError(
            f"--storage {storage} cannot be used ({message}); write for example "
            "--storage sqlite:///search.db"
        ) from None

    def objective(trial: Any) -> float:
        point = tuple(
            trial.suggest_int(free.key, 0, count - 1)
            for free, count in zip(search.free, search.counts, strict=True)
        )
        candidate = search.trial(point)
        # A miss is worse than every passing design, by the amount of the miss.
        return (
            candidate.cost
            if candidate.holds
            else IMPOSSIBLE * (1 + min(candidate.missed, IMPOSSIBLE))
        )

    # Stored trials come from an earlier run: they are looked up again, not tried again.
    done = study.get_trials(states=[optuna.trial.TrialState.COMPLETE])
    for old in done:
        search.trial(tuple(old.params[free.key] for free in search.free))
    study.optimize(objective, n_trials=max(0, tries - len(done)))


def _name(search: SearchSpace) -> str:
    requirements = [requirement.label for requirement in search.problem.requirements]
    keys = [
        f"{free.key} {', '.join(free.choices)}"
        if free.choices
        else f"{free.key} {free.low:g} to {free.high:g} by {free.step:g}"
        for free in search.free
    ]
    design = search.problem.design
    return "; ".join(
        [
            f"{design.name} {design_sha256(design)[:12]}",
            *requirements,
            search.problem.goal.label,
            *([] if search.problem.sure is None else [f"sure {search.problem.sure:g}"]),
            *keys,
        ]
    )
