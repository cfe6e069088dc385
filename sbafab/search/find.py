"""Search for the design that meets all requirements and is best in one quantity.

Rules are checked only for a candidate that would otherwise become the best. The result lists the
binding constraints and can be written as a design file.
"""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import tomli_w
from pydantic import Field

from sbafab.actuators import build
from sbafab.design.files import (
    KIT,
    Change,
    design_path,
    kit_names,
    override,
    read_toml,
    shown,
)
from sbafab.design.kits import kit_path
from sbafab.design.records import Design, Free
from sbafab.documents import Document, PlainNumber, attribute
from sbafab.errors import DesignError, OutputError, SbafabError, Stopped
from sbafab.folders.swap import writing
from sbafab.laminate.laminate import Laminate
from sbafab.markup import table_html
from sbafab.models.balloons import balloons_of, has_balloons
from sbafab.models.calibration import SHARE, uncertainty_of
from sbafab.models.figures import FLAGS, Figure, Flag, FlagList
from sbafab.models.paper import Counterpart, CounterpartEntry
from sbafab.pressing.schedule import refuse_temperature
from sbafab.rules.finding import Place
from sbafab.runtime import Progress, ignore_progress
from sbafab.search.quantities import (
    NAMES,
    Goal,
    RequestedQuantity,
    Requirement,
    refuse_absent,
    shown_value,
)
from sbafab.search.space import (
    FindRequest,
    GridPoint,
    SearchSpace,
    Trial,
    figure_text,
    misses,
    searched,
)
from sbafab.search.sweep_report import LITTLE, front
from sbafab.search.trials import margin_share
from sbafab.search.vary import format_keys, key_values

LEAST_TRIES = 4
MEDIANS = "in parentheses the 90 % interval of what would be measured"


@dataclass(frozen=True, repr=False)
class FoundDesign:
    """Result of a search: the ``best`` design, or the nearest miss if none passes.

    ``front``: Pareto-optimal passing designs, in the goal and every requirement, a selection of
    ``on_front`` designs. ``ends``: keys limited only by their range. ``is_cut_short``: more tries
    might have led to a better one. ``figures`` are those of ``predict`` of the best design, by
    quantity.
    """

    request: FindRequest
    best: Trial
    binds: tuple[Binding, ...]
    ends: tuple[RangeEnd, ...]
    front: tuple[Trial, ...]
    on_front: int
    tries: int
    is_cut_short: bool
    figures: Mapping[str, Figure]

    @property
    def intervals(self) -> dict[str, tuple[float, float]]:
        """The 90 % intervals of measurements of the best design, by quantity in its unit."""
        return {name: f.interval for name, f in self.figures.items() if f.interval}

    @property
    def flags(self) -> dict[str, tuple[Flag, ...]]:
        """The validity limits of figures of the best design, by quantity."""
        return {name: f.flags for name, f in self.figures.items() if f.flags}

    @property
    def measured(self) -> dict[str, Counterpart]:
        """The paper's values beside figures of the best design, by quantity."""
        return {name: f.measured for name, f in self.figures.items() if f.measured}

    @property
    def holds(self) -> bool:
        """True if the best design meets all requirements and passes every rule."""
        return self.best.holds

    def __repr__(self) -> str:
        missed = "" if self.holds else f", nearest miss: {'; '.join(self.missed)}"
        return f"FoundDesign({format_keys(self.best.values)}{missed})"

    def _repr_html_(self) -> str:
        texts = [*(text for text, _ in self.lines), *self.best.broken_rules]
        title = "Best design" if self.holds else "Nearest miss"
        rows = [(text,) for text in texts]
        return table_html(("",), rows, f"{title}: {format_keys(self.best.values)}")

    @property
    def without_room(self) -> list[Spare]:
        """Rules for lengths that pass without margin."""
        laminate = self.best.laminate
        return [
            Spare(rule.rule, rule.measured or 0.0, rule.unit, place_text(laminate, rule.where))
            for rule in (self.best.rules or {}).values()
            if laminate is not None and rule.verdict == "pass" and rule.rule in TIGHT
            if (share := margin_share(rule)) is not None and abs(share) < LITTLE
        ]

    @property
    def missed(self) -> list[str]:
        """Requirements and rules that the best design breaks, one sentence each."""
        return misses(self.request, self.best)

    @property
    def lines(self) -> list[tuple[str, list[str]]]:
        """The required quantities and the goal, each with flags and the paper's measured value."""
        request, best, goal = self.request, self.best, self.request.goal
        texts: dict[str, list[str]] = {}
        for row in request.requirements:
            interval = "" if request.sure is not None else self._interval(row)
            missed = "" if best.meets(row) else ": MISSED"
            value = f"{figure_text(request, best, row)}{interval}; {row.bound}{missed}"
            texts.setdefault(row.quantity.label, []).append(f"{row.quantity.label} {value}")
        label = goal.label if self.holds else goal.quantity.label
        value = shown_value(goal.quantity, best.value(goal)) + self._interval(goal)
        texts.setdefault(goal.quantity.label, []).append(f"{label}: {value}")
        lines = []
        for name, (*others, last) in texts.items():
            notes = [FLAGS[flag] for flag in self.flags.get(name, ())]
            notes += [self.measured[name].sentence] if name in self.measured else []
            lines += [*((text, []) for text in others), (last, notes)]
        return lines

    @property
    def has_medians(self) -> bool:
        """True if some of the lines are medians with their interval."""
        quantities = self.request.quantities
        shown = quantities if self.request.sure is None else quantities[-1:]
        return any(quantity.label in self.intervals for quantity in shown)

    def _interval(self, subject: Requirement | Goal) -> str:
        """Return the 90 % interval of a requirement or the goal; empty without one."""
        interval = self.intervals.get(subject.quantity.label)
        if interval is None or self.best.value(subject) < 0:
            return ""
        low, high = (max(end, 0.0) for end in interval)
        return f" ({low:.3g} to {high:.3g})"


@dataclass(frozen=True)
class Binding:
    """A step of one key that would improve the design, and the constraints it breaks."""

    key: str
    value: Any
    breaks: str


@dataclass(frozen=True)
class Spare:
    """A rule without margin at its worst value, ``measured`` in ``unit``, and its place."""

    rule: str
    measured: float
    unit: str
    place: str


@dataclass(frozen=True)
class RangeEnd:
    """A key at the end of its range that would be better beyond, ``above`` or below: ``low`` to
    ``high`` in steps of ``step``, in mm or balloons, depending on the key.
    """

    key: str
    value: Any
    low: float
    high: float
    step: Annotated[float, Field(exclude=True)]
    above: Annotated[bool, Field(exclude=True)]

    @property
    def wider(self) -> tuple[float, float]:
        """The ends of a range twice as wide, and at least a step wider, in the better direction."""
        span = max(self.high - self.low, self.step)
        if self.above:
            return self.low, self.high + span
        return max(self.low - span, min(self.step, self.low - self.step)), self.high


def find(request: FindRequest, progress: Progress = ignore_progress) -> FoundDesign:
    """Return the best design, or the nearest miss. Raises DesignError for an impossible request."""
    if request.tries < LEAST_TRIES:
        raise DesignError(f"tries = {request.tries} must be at least {LEAST_TRIES}")
    try:
        space = searched(request, free_keys(request), progress)
    except KeyboardInterrupt as stop:
        raise Stopped("the search was stopped, and no file was written", *stop.args) from stop
    point, best = space.best()
    if best.refused:
        # The most common cause, in the words of the nearest candidate that has it.
        refused = sorted(space.trials.values(), key=lambda trial: trial.rank)
        ((cause, count),) = Counter(trial.cause for trial in refused).most_common(1)
        reason = next(trial.refused for trial in refused if trial.cause == cause)
        told = f"{count} of the {len(refused)} tried"
        raise DesignError(f"no design could be made: {reason} ({told})")
    shown_front, count = pareto_front(space, best) if best.holds else ([], 0)
    return FoundDesign(
        request,
        best,
        tuple(bindings(space, point, best)),
        tuple(range_ends(space, point, best)),
        tuple(shown_front),
        count,
        len(space.trials),
        request.tries <= len(space.trials) < space.size,
        dict(_figures(request, best)),
    )


def _figures(request: FindRequest, best: Trial) -> Iterator[tuple[str, Figure]]:
    """Yield the figures of the best design by quantity, with intervals and flags."""
    design = request.design.with_(dict(best.values))
    for quantity in request.quantities:
        if best.laminate is not None and quantity.figure is not None:
            _, figure = request.measured(quantity, design, best.laminate, probability=SHARE)
            if figure is not None:
                yield quantity.label, figure


# The free keys of a request, and what no search could answer.


OF_FILMS = ("films.", "layup.", "press.", KIT)
"""Prefixes of keys that change a design's films or how they are pressed."""
KNOWN_BY_FILM = ("mass", "burst", "reference_stroke")
"""Quantities whose availability depends only on a design's films, and quick to evaluate."""


def free_keys(request: FindRequest) -> tuple[Free, ...]:
    """Return the free keys, restricted by requirements on them.

    Raises DesignError, also if the design lacks a quantity.
    """
    design = request.design
    names = {quantity.name for quantity in request.quantities}
    every = design.free if request.free is None else request.free
    free = [key for key in every if not key.asked or key.asked in names]
    keys = [key.key for key in free]
    for quantity in request.quantities:
        refuse_absent(quantity, design, keys, "--free")
    if request.sure is not None:
        _refuse_unsure(request, request.sure)
    for requirement in request.requirements:
        _refuse_fixed(requirement, design, keys)
    if not free:
        raise DesignError(f"{design.name} has no free key; name one with --free KEY=LOW:HIGH:STEP")
    narrowed = tuple(_within(key, request.requirements) for key in free)
    if not any(key.startswith(OF_FILMS) for key in keys):
        _refuse_films(request)
    return narrowed


def _refuse_films(request: FindRequest) -> None:
    """Raises DesignError if a quantity is unknown for a design's films, or the press cannot bond
    them, at any size: no candidate could be evaluated or made.
    """
    design = request.design
    try:
        laminate = build(design)
    except SbafabError:
        return  # the search may start from impossible sizes
    refuse_temperature(laminate, design.press)
    has_modulus = all(layer.film.elastic for layer in laminate.tpe_layers)
    for quantity in request.quantities:
        try:
            if quantity.name in KNOWN_BY_FILM:
                request.measured(quantity, design, laminate)
            elif quantity.at.share:
                request.measured(RequestedQuantity("reference_stroke"), design, laminate)
            # The flat force has a closed form.
            is_flat = quantity.figure is not None and quantity.figure[1].share == 0
            needs_modulus = quantity.kpa is not None and not is_flat and not has_modulus
            if needs_modulus and has_balloons(design.form):
                balloons_of(design, laminate)
        except DesignError as error:
            raise DesignError(f"{quantity.label}: {error}") from None


def _refuse_unsure(request: FindRequest, sure: float) -> None:
    """Raise DesignError for an invalid probability, and for requirements that cannot have one."""
    if not 0.5 < sure < 1:
        raise DesignError(f"sure = {sure:g} must be above 0.5 and below 1, such as 0.9")
    design = request.design
    if uncertainty_of(design) is None:
        raise DesignError(
            f"sure = {sure:g} needs a calibration, but models.calibration of {design.name} is "
            f'"{design.models.calibration}"; set it, such as to "paper", or omit sure'
        )
    for quantity in (requirement.quantity for requirement in request.requirements):
        is_drawn = quantity.name in NAMES and NAMES[quantity.name].is_drawn
        is_exact = is_drawn or quantity.key is not None or quantity.name == "burst"
        if not is_exact and not quantity.is_calibrated(design.form):
            is_reference = quantity.name == "reference_stroke"
            instead = "ask for stroke@10kPa" if is_reference else "leave sure out"
            raise DesignError(
                f"sure = {sure:g}: no calibrated model predicts {quantity.label} of "
                f"{design.name}, so its probability is unknown; {instead}"
            )


def _refuse_fixed(requirement: Requirement, design: Design, free: Sequence[str]) -> None:
    """Raise DesignError if a requirement on a key contradicts its value and the key is not free."""
    key = requirement.quantity.key
    value = key_values(design).get(key or "")
    if isinstance(value, str):
        raise DesignError(
            f"{key} is a word, {shown(value)}, and cannot have a limit; set it with --set, or let "
            f"the search choose with --free {key}={value},..."
        )
    if key not in free and isinstance(value, int | float) and not requirement.holds(value):
        raise DesignError(
            f"{key} = {value:g}, not {requirement.bound}, and the search does not change it; give "
            f"it a range with --free {key}=LOW:HIGH:STEP"
        )


def _within(free: Free, requirements: Sequence[Requirement]) -> Free:
    """Return the range restricted by requirements on the key. Raises DesignError if it is empty."""
    for requirement in requirements:
        if requirement.quantity.key != free.key:
            continue
        limit, at_least = requirement.limit, requirement.at_least
        if (limit > free.high if at_least else limit < free.low) and not free.widens:
            raise DesignError(
                f"{free.key} must be {requirement.bound}, but its range is {free.low:g} to "
                f"{free.high:g}; change it with --free {free.key}=LOW:HIGH:STEP"
            )
        if at_least:
            low = max(free.low, limit)
            free = replace(free, low=low, high=max(free.high, low))
        else:
            high = min(free.high, limit)
            free = replace(free, low=min(free.low, high), high=high)
    return free


# The diagnosis of a search: binding constraints, tight rules, range ends, the Pareto front.


SHOWN = 8
"""Most designs of the Pareto front that are shown."""
TIGHT = ("bond-width", "mask-overhang", "tube-fit", "film-limits", "press-fit", "pin-fit")
"""Rules with margins that a design change can widen."""


def bindings(space: SearchSpace, point: GridPoint, best: Trial) -> Iterator[Binding]:
    """Yield the binding constraints: those that each improving step breaks.

    For the nearest miss: the steps to designs that cannot be built or evaluated.
    """
    for axis, neighbour, is_inside in space.neighbours(point):
        if not is_inside:
            continue
        trial = space.peek(neighbour)
        if not trial.refused:
            is_nearer = best.holds and trial.cost < best.cost
        elif best.holds:
            # A refused one is judged by the step back.
            back = space.peek(tuple((2 * np.array(point) - neighbour).tolist()))
            is_nearer = not back.refused and back.cost > best.cost
        else:
            is_nearer = True
        broken = misses(space.request, space.with_rules(trial)) if is_nearer else []
        if broken:
            key = space.free[axis].key
            yield Binding(key, trial.values[key], "; ".join(broken))


def range_ends(space: SearchSpace, point: GridPoint, best: Trial) -> Iterator[RangeEnd]:
    """Yield the keys whose range is the only obstacle to a better design, or a nearer miss."""
    for axis, neighbour, is_inside in space.neighbours(point):
        free = space.free[axis]
        if is_inside or free.choices or space.is_excluded(axis, neighbour):
            continue
        if space.with_rules(space.peek(neighbour)).rank < best.rank:
            steps = int(space.lows[axis]), int(space.highs[axis])
            low, high = (round(free.low + step * free.step, 6) for step in steps)
            above = neighbour[axis] > point[axis]
            yield RangeEnd(free.key, space.number(axis, point), low, high, free.step, above)


def pareto_front(space: SearchSpace, best: Trial) -> tuple[list[Trial], int]:
    """Return the Pareto-optimal designs among those tried that pass all rules, and their number.

    The best is first, even if another equals it in the goal; the rest are in the order of the goal.
    If there are many, the ends and some in between are returned.
    """
    goal = space.request.goal.quantity
    sides = [
        requirement
        for requirement in space.request.requirements
        if requirement.quantity.key is None and requirement.quantity != goal
    ]
    passing = [trial for trial in space.trials.values() if trial.holds]
    more = [False, *(requirement.at_least for requirement in sides)]
    while True:
        rows = [[trial.cost, *map(trial.judged, sides)] for trial in passing]
        numbers = {next(n for n, trial in enumerate(passing) if trial is best), *front(rows, more)}
        order = sorted(numbers, key=lambda number: passing[number].rank)
        if len(order) > SHOWN:
            last = len(order) - 1
            order = [order[round(at * last / (SHOWN - 1))] for at in range(SHOWN)]
        for number in order:
            passing[number] = space.with_rules(passing[number])
        if all(passing[number].holds for number in order):
            return [passing[number] for number in order], len(numbers)
        passing = [trial for trial in passing if trial.holds]


RING = 1.0
"""Distance around a bore or the lumen that still belongs to it: a bond and its mask, mm."""


def place_text(laminate: Laminate, where: Place) -> str:
    """Return a place as text, such as "at the lumen"; empty if unknown."""
    if where.x is None or where.y is None:
        return ""
    x, y = where.x, where.y
    if math.hypot(x, y) <= (laminate.lumen or -math.inf) / 2 + RING:
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


# The result for programs.


class TrialEntry(Document):
    """A design that was tried."""

    keys: dict[str, Any] = attribute("values")
    """keys of the design that were found"""
    figures: dict[str, PlainNumber]
    """quantities in mm, deg, N, N/mm, s, g or a share"""


class RequirementEntry(Document):
    """A requirement, with the figures of the best design."""

    quantity: str = attribute("quantity.label")
    unit: str = attribute("quantity.unit")
    sense: Literal["at least", "at most"]
    limit: PlainNumber
    median: PlainNumber
    """best; its force is below 0 if it rises less"""
    bound: PlainNumber | None
    """kept with the probability `sure`, and held against the limit"""
    holds: bool


class FindDocument(Document, schema="sbafab/find@1"):
    """The output of ``find --json``; names that are keys are quantities."""

    holds: bool
    file: str | None
    """the design file; null if none holds"""
    started_from: str
    tries: int
    is_cut_short: bool
    """true if more tries might lead further"""
    sure: PlainNumber | None = attribute("request.sure")
    """probability with which requirements must hold"""
    best: TrialEntry
    intervals: dict[str, tuple[float, float]]
    """90 % intervals of the best, if a calibration says so"""
    flags: dict[str, FlagList]
    """limits to trust in figures of the best"""
    requirements: list[RequirementEntry]
    measured: dict[str, CounterpartEntry]
    missed: list[str]
    binds: list[Binding]
    range_ends: list[RangeEnd] = attribute("ends")
    without_room: list[Spare]
    front: list[TrialEntry]
    on_front: int


def find_document(outcome: FoundDesign, origin: str, target: Path) -> dict[str, Any]:
    """Return the content of ``find --json``; ``bound`` is null without ``sure``."""
    best = outcome.best
    rows = [
        RequirementEntry.read(
            row,
            median=best.value(row),
            bound=best.judged(row) if row.quantity.label in best.intervals else None,
            holds=best.meets(row),
        )
        for row in outcome.request.requirements
    ]
    return FindDocument.of(
        outcome,
        file=str(target) if outcome.holds else None,
        started_from=origin,
        requirements=rows,
        measured=outcome.measured,
    )


# The design file of the result: the starting design's file with the new values.


def refuse_existing(target: Path) -> None:
    """Raise OutputError if the file exists: designs are never overwritten."""
    if target.exists():
        raise OutputError(
            f"{target} exists; choose another folder with -o or file with --to, or remove it first"
        )


def found_toml(
    source: str | Path, assignments: Sequence[str], name: str, outcome: FoundDesign, target: Path
) -> str:
    """Return the text of the design file ``target`` of a result, with its figures as comments."""
    best, design = outcome.best, outcome.request.design
    changes: list[Change] = [*assignments, dict(best.values), {"name": name}]
    data = override(read_toml(design_path(source)), changes)
    data = override(data, [_paths_beside(target, data, design)])
    first = {key: value for key, value in data.items() if not isinstance(value, dict)}
    head = [f"Found by sbafab find, from {Path(source).name}: {format_keys(best.values)}."]
    for text, notes in outcome.lines:
        head += [text, *(f"  ({note})" for note in notes)]
    head += [MEDIANS] if outcome.has_medians else []
    comments = "".join(f"# {line}".rstrip() + "\n" for line in head)
    return f"{comments}\n{tomli_w.dumps(first | data)}"


def _paths_beside(target: Path, data: Mapping[str, Any], design: Design) -> dict[str, str]:
    """Return the paths of a design's drawings, kit and calibration, by key, relative to the folder
    of ``target``, so that all can be moved together.
    """
    files = {**design.drawings}
    if KIT in data and design.kit not in kit_names():
        files[KIT] = kit_path(design.kit, design.folder)
    calibration = design.folder / design.models.calibration
    if "calibration" in data.get("models", {}) and calibration.is_file():
        files["models.calibration"] = calibration
    folder = target.absolute().parent.resolve()
    return {
        key: Path(os.path.relpath(file.parent.resolve() / file.name, folder)).as_posix()
        for key, file in files.items()
    }


def write_found(text: str, target: Path) -> None:
    """Write the result. Raises OutputError if that fails, also if a file appeared meanwhile."""
    with writing(target):
        target.parent.mkdir(parents=True, exist_ok=True)
        with target.open("x", encoding="utf-8", newline="\n") as opened:
            opened.write(text)
