"""The design that meets requirements and is best in one thing, found by trying.

All designs where they are few; else a coarse grid and walks from its best, or Optuna, then steps
from the best that was found. Rules are asked of what would become the best.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import tomli_w

from sbafab.design.files import (
    KIT,
    OUTLINE,
    changed_keys,
    design_path,
    keys_of,
    kit_names,
    override,
    read_toml,
    start_where_the_user_stands,
)
from sbafab.design.records import Design, Free
from sbafab.errors import DesignError, OutputError
from sbafab.laminate.laminate import Laminate
from sbafab.models.paper import Counterpart
from sbafab.process import Progress, unheard
from sbafab.rules.finding import Place
from sbafab.search.page import front
from sbafab.search.quantities import Subject, refuse_unknown_key, shown_value
from sbafab.search.trial import (
    Goal,
    Requirement,
    SearchSpace,
    Steps,
    Trial,
    Wanted,
    broken_rules,
    keys_said,
    misses,
)
from sbafab.search.walks import every_design, explored, neighbours, refined, widened

# What is told of a search's end: what binds, what has nothing to spare, the Pareto front.


SHOWN = 8
"""Designs of the Pareto front that are shown."""
TIGHT = ("bond-width", "mask-overhang", "tube-fit", "film-limits", "press-fit", "pin-fit")
"""Rules whose margins a design can be changed to widen."""
LITTLE = 0.005
"""Share of a limit that is nothing to spare."""


@dataclass(frozen=True)
class Binding:
    """A step of one key that would be better, and what it breaks."""

    key: str
    value: Any
    breaks: str


@dataclass(frozen=True)
class Spare:
    """A rule whose worst value, ``measured`` in ``unit``, has nothing to spare, and where."""

    rule: str
    measured: float
    unit: str
    place: str


@dataclass(frozen=True)
class RangeEnd:
    """A key at the end of its range that would be better beyond: ``low`` to ``high`` in steps of
    ``step``, mm or a number of balloons, as the key is.
    """

    key: str
    value: Any
    low: float
    high: float
    step: float


def without_room(best: Trial) -> list[Spare]:
    """Rules on lengths that hold and have nothing to spare."""
    laminate = best.laminate
    return [
        Spare(one.rule, one.measured or 0.0, one.unit, place_said(laminate, one.where))
        for one in (best.rules or {}).values()
        if laminate is not None
        and one.verdict == "pass"
        and one.rule in TIGHT
        and one.share is not None
        and abs(one.share) < LITTLE
    ]


def bindings(space: SearchSpace, place: Steps, best: Trial) -> list[Binding]:
    """What stops every single step that would come nearer the goal.

    Of the nearest miss: the steps to designs that cannot be made, or that no model knows.
    """
    found = []
    for axis, other in _steps(place):
        if not space.lows[axis] <= other[axis] <= space.highs[axis]:
            continue
        trial = space.looked_at(other)
        if _is_nearer(space, place, other, trial, best):
            broken = misses(space.wanted, space.with_rules(trial))
            if broken:
                key = space.free[axis].key
                found.append(Binding(key, trial.values[key], "; ".join(broken)))
    return found


def _is_nearer(space: SearchSpace, place: Steps, other: Steps, trial: Trial, best: Trial) -> bool:
    """Whether a step would come nearer the goal; where nothing comes of it, by the step back."""
    if not trial.refused:
        return best.holds and trial.cost < best.cost
    if not best.holds:
        return True
    back = space.looked_at(tuple(2 * at - to for at, to in zip(place, other, strict=True)))
    return not back.refused and back.cost > best.cost


def range_ends(space: SearchSpace, place: Steps, best: Trial) -> list[RangeEnd]:
    """The keys whose range alone stops a better design, or a nearer miss."""
    found = []
    for axis, other in _steps(place):
        if space.lows[axis] <= other[axis] <= space.highs[axis] or space.is_asked(axis, other):
            continue
        if space.with_rules(space.looked_at(other)).rank < best.rank:
            one = space.free[axis]
            low, high = (
                round(one.low + step * one.step, 6)
                for step in (space.lows[axis], space.highs[axis])
            )
            found.append(RangeEnd(one.key, space.number(axis, place), low, high, one.step))
    return found


def _steps(place: Steps) -> list[tuple[int, Steps]]:
    """The places a step of one key away, each with the key's number."""
    count = len(place)
    return [
        (
            next(axis for axis, by in enumerate(move) if by),
            tuple(at + by for at, by in zip(place, move, strict=True)),
        )
        for move in neighbours([1] * count)[: 2 * count]
    ]


def pareto_front(space: SearchSpace, best: Trial) -> tuple[list[Trial], int]:
    """Designs that hold, rules included, and that none of those tried betters in everything.

    The best first, also where another one equals it in the goal, then in the order of the goal;
    where they are many the ends and some between. With it how many there are.
    """
    wanted = space.wanted
    sides = [
        one
        for one in wanted.requirements
        if one.quantity.key is None and one.quantity != wanted.goal.quantity
    ]
    left = [trial for trial in space.trials.values() if trial.holds]
    first = left.index(best)
    more = [False, *(one.at_least for one in sides)]
    while True:
        rows = [[trial.cost, *(trial.value(one) for one in sides)] for trial in left]
        numbers = sorted({first, *front(rows, more)}, key=lambda number: left[number].rank)
        chosen = _spread(numbers)
        checked = {number: space.with_rules(left[number]) for number in chosen}
        failed = [number for number, trial in checked.items() if not trial.holds]
        if not failed:
            return [checked[number] for number in chosen], len(numbers)
        first -= sum(number < first for number in failed)
        left = [
            checked.get(number, trial) for number, trial in enumerate(left) if number not in failed
        ]


def _spread(numbers: list[int]) -> list[int]:
    """Some of them, evenly, the first and the last among them."""
    if len(numbers) <= SHOWN:
        return numbers
    return [numbers[round(at * (len(numbers) - 1) / (SHOWN - 1))] for at in range(SHOWN)]


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
        from sbafab.search.walks import with_optuna

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


# Where in an actuator a finding lies, in words.


RING = 1.0
"""mm round a bore or the lumen that still belong to it: a bond and its mask."""


def place_said(laminate: Laminate, where: Place) -> str:
    """For example "at the lumen", "at the inlet tab of chamber2"; empty where nothing is known."""
    if where.x is None or where.y is None:
        return ""
    x, y = where.x, where.y
    if laminate.lumen is not None and math.hypot(x, y) <= laminate.lumen / 2 + RING:
        return "at the lumen"
    for bore in laminate.bores:
        if math.dist((x, y), bore.centre) <= bore.diameter / 2 + RING:
            return f"at the bore of {bore.chamber}"
    for inlet in laminate.inlets:
        mouth, along = inlet.mouth, inlet.direction
        back = (mouth[0] - x) * along[0] + (mouth[1] - y) * along[1]
        aside = abs((mouth[0] - x) * along[1] - (mouth[1] - y) * along[0])
        if -RING <= back <= inlet.length and aside <= inlet.width / 2 + RING:
            return f"at the inlet tab of {inlet.chamber}"
    return "at the rim"


# A found design as a file that generates: the one it started from, with the found keys.


FOUND = "found.toml"
"""The file in a folder that ``-o`` names."""


def found_file(out: Path) -> Path:
    """Return the file that ``-o`` asks for: itself where it ends in .toml, else one in the folder.

    Raises DesignError where no file can come to be: nobody's design is overwritten.
    """
    is_file = out.suffix.lower() == ".toml"
    if is_file and not out.parent.is_dir():
        raise DesignError(f"{out.parent} is no folder; make it first, or name another with -o")
    if not is_file and out.exists() and not out.is_dir():
        raise DesignError(f"{out} is a file; name a folder with -o, or a .toml file with --to")
    target = out if is_file else out / FOUND
    if target.exists():
        raise DesignError(
            f"{target} exists and is not overwritten; name another folder with -o or file with "
            "--to, or remove it first"
        )
    return target


def found_toml(
    source: str | Path, assignments: Sequence[str], name: str, found: FoundDesign
) -> str:
    """The design file of what was found, its figures as comments."""
    path = design_path(source)
    data = override(read_toml(path), [*assignments, dict(found.best.values), {"name": name}])
    start_where_the_user_stands(data, assignments)
    _from_anywhere(data, path.parent, set(changed_keys(assignments)))
    first = {key: value for key, value in data.items() if not isinstance(value, dict)}
    tables = {key: value for key, value in data.items() if isinstance(value, dict)}
    said = [
        f"# {one.quantity.said} = {shown_value(one.quantity, found.best.value(one))} ({one.bound})"
        for one in found.wanted.requirements
    ]
    goal = found.wanted.goal
    value = shown_value(goal.quantity, found.best.value(goal))
    best = f"# {goal.quantity.said} = {value} (the goal)"
    keys = keys_said(found.best.values)
    measured = [f"# {name}: {one.sentence()}" for name, one in found.measured.items()]
    head = [f"# Found by sbafab find, from {Path(source).name}: {keys}.", *said, best, *measured]
    return "\n".join(line.rstrip() for line in head) + "\n\n" + tomli_w.dumps(first | tables)


def _from_anywhere(data: dict[str, Any], folder: Path, given: set[str]) -> None:
    """Paths of the file that it started from, made absolute: the new one may lie elsewhere."""
    chamber: Any = data.get("chamber")
    if OUTLINE not in given and isinstance(chamber, Mapping) and "outline" in chamber:
        chamber = dict(chamber)
        chamber["outline"] = str((folder / str(chamber["outline"])).absolute())
        data["chamber"] = chamber
    if KIT not in given and KIT in data and data[KIT] not in kit_names():
        data[KIT] = str((folder / str(data[KIT])).absolute())


def write_found(text: str, target: Path) -> None:
    """Raises OutputError where it cannot be written, also where a file came to be meanwhile."""
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with target.open("x", encoding="utf-8", newline="\n") as opened:
            opened.write(text)
    except OSError as error:
        raise OutputError(
            f"{target} cannot be written: {error.strerror or error}; name another folder with -o"
        ) from None
