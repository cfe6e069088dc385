"""The design that meets requirements and is best in one thing, found by trying.

All designs where they are few; else a coarse grid and walks from its best, or Optuna, then steps
from the best that was found. Rules are asked of what would become the best.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from sbafab.design.form import Free
from sbafab.design.records import Design
from sbafab.design.writing import keys_of
from sbafab.errors import DesignError
from sbafab.models.counterparts import Counterpart
from sbafab.progress import Progress, unheard
from sbafab.search.quantities import Subject, refuse_unknown_key
from sbafab.search.requirements import Goal, Requirement
from sbafab.search.space import SearchSpace
from sbafab.search.told import (
    Binding,
    RangeEnd,
    Spare,
    bindings,
    pareto_front,
    range_ends,
    without_room,
)
from sbafab.search.trial import Trial, Wanted, broken_rules, misses
from sbafab.search.walks import every_design, explored, refined
from sbafab.search.widening import widened

TRIES, LEAST_TRIES = 240, 4


@dataclass(frozen=True)
class FindRequest:
    """What is looked for, from which design; ``free`` keys in place of the family's own, if any.

    ``optuna`` searches with it, ``storage`` is its database, in which a search goes on.
    """

    design: Design
    requirements: tuple[Requirement, ...]
    goal: Goal
    free: tuple[Free, ...] | None = None
    tries: int = TRIES
    optuna: bool = False
    storage: str | None = None


@dataclass(frozen=True)
class FoundDesign:
    """What a search ends with: the ``best`` design, or where it does not hold the nearest miss.

    ``front``: designs that hold and that none of those tried betters in the goal and in every
    requirement; some of all ``on_front`` that there are. ``ends``: keys that only their range
    stops. ``is_cut_short``: more tries might have led to a better one.
    """

    wanted: Wanted
    best: Trial
    binds: tuple[Binding, ...]
    ends: tuple[RangeEnd, ...]
    front: tuple[Trial, ...]
    on_front: int
    tries: int
    is_cut_short: bool
    free: tuple[Free, ...]

    @property
    def holds(self) -> bool:
        """Whether the best design meets all and every rule passes."""
        return self.best.holds

    @property
    def without_room(self) -> list[Spare]:
        """Rules on lengths that hold and have nothing to spare."""
        return without_room(self.best)

    @property
    def missed(self) -> list[str]:
        """What the best design breaks, a sentence each; empty where it holds."""
        return misses(self.wanted, self.best)

    @property
    def measured(self) -> dict[str, Counterpart]:
        """What the paper measured, by quantity, where its model is off by more than a quarter."""
        if self.best.laminate is None:
            return {}
        subject = self._subject
        found = {one.said: subject.counterpart(one) for one in self.wanted.quantities}
        return {name: one for name, one in found.items() if one is not None}

    @property
    def full_stroke(self) -> float | None:
        """The full stroke of the best design in mm, as ``predict`` has it; None for drawn ones."""
        if self.best.laminate is None:
            return None
        try:
            return self._subject.full_stroke
        except DesignError:
            return None

    @property
    def _subject(self) -> Subject:
        assert self.best.laminate is not None
        return Subject(self.wanted.design.with_(dict(self.best.values)), self.best.laminate)

    @property
    def broken_rules(self) -> list[str]:
        """The rules among these."""
        return broken_rules(self.best)


def free_keys(request: FindRequest) -> tuple[Free, ...]:
    """The keys that may change, within what the requirements say of them.

    Raises DesignError, also where a quantity is none of the design.
    """
    for quantity in Wanted(request.design, request.requirements, request.goal).quantities:
        refuse_unknown_key(quantity, request.design)
    keys = {key: value for key, value, _ in keys_of(request.design)}
    asked = {one.quantity.name for one in request.requirements} | {request.goal.quantity.name}
    every = request.design.free if request.free is None else request.free
    own = [one for one in every if not one.asked or one.asked in asked]
    for one in request.requirements:
        _refuse_fixed(one, keys, own)
    found = [_within(one, request.requirements) for one in own]
    if not found:
        raise DesignError(
            f"no key of {request.design.name} is left that a search may change; name one with "
            "--free KEY=LOW:HIGH:STEP"
        )
    return tuple(found)


def _refuse_fixed(
    requirement: Requirement, keys: Mapping[str, object], own: Sequence[Free]
) -> None:
    """Raises DesignError for a key that is asked to be what it is not, and may not change."""
    key = requirement.quantity.key
    value = keys.get(key or "")
    if key in [one.key for one in own] or not isinstance(value, int | float):
        return
    if not requirement.holds(value):
        raise DesignError(
            f"{key} = {value:g}, not {requirement.bound}, and the search does not change it; give "
            f"it a range with --free {key}=LOW:HIGH:STEP"
        )


def _within(free: Free, requirements: Sequence[Requirement]) -> Free:
    """The range within what requirements say of the key itself. Raises DesignError for none."""
    for one in requirements:
        if one.quantity.key != free.key:
            continue
        is_beyond = one.limit > free.high if one.at_least else one.limit < free.low
        if is_beyond and not free.widens:
            raise DesignError(
                f"{free.key} must be {one.bound}, and its range is {free.low:g} to {free.high:g}; "
                f"give it another one with --free {free.key}=LOW:HIGH:STEP"
            )
        if one.at_least:
            low = max(free.low, one.limit)
            free = replace(free, low=low, high=max(free.high, low))
        else:
            high = min(free.high, one.limit)
            free = replace(free, low=min(free.low, high), high=high)
    return free


def find(request: FindRequest, tell: Progress = unheard) -> FoundDesign:
    """The best design, or the nearest miss. Raises DesignError for what cannot be asked."""
    if request.tries < LEAST_TRIES:
        raise DesignError(f"tries = {request.tries} must be at least {LEAST_TRIES}")
    if request.storage is not None and not request.optuna:
        raise DesignError("storage is Optuna's; search with optuna = True, or leave it out")
    wanted = Wanted(request.design, request.requirements, request.goal)
    space = SearchSpace(wanted, free_keys(request), request.tries, tell)
    if request.optuna:
        from sbafab.search.optimiser import with_optuna

        with_optuna(space, request.storage)
    elif space.size <= request.tries:
        every_design(space)
    else:
        explored(space)
    refined(space)
    widened(space)
    place, best = space.best()
    if best.refused:
        raise DesignError(f"no design could be made: {best.refused}")
    shown, count = pareto_front(space, best) if best.holds else ([], 0)
    return FoundDesign(
        wanted,
        best,
        tuple(bindings(space, place, best)),
        tuple(range_ends(space, place, best)),
        tuple(shown),
        count,
        len(space.trials),
        request.tries <= len(space.trials) < space.size,
        space.free,
    )
