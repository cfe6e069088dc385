"""Several copies of one laminate: their places in the press, its cycles, and the working days."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from sbafab.design.records import Design
from sbafab.design.sections import named_film
from sbafab.geometry.edges import Bounds, Point
from sbafab.laminate.assembly import PLATE_MARGIN, AssemblyStep, assembly
from sbafab.laminate.laminate import Laminate
from sbafab.pressing.schedule import (
    HANDLING_MINUTES,
    PressSettings,
    Schedule,
    films_without_minutes,
)

APART = 5.0
"""Gap in mm between two copies in the press, ours: films flow, and hands need room."""
ROUNDING = 1e-9


@dataclass(frozen=True)
class Runs:
    """Press cycles of ``copies``, side by side at these ``places``.

    A place is the offset of a laminate's frame from that of the first one, which lies at the
    lower left; rows fill from there. The last cycle may be smaller than the others.
    """

    copies: int
    places: tuple[Point, ...]

    @property
    def together(self) -> int:
        """Copies in a full cycle."""
        return len(self.places)

    @property
    def cycles(self) -> tuple[int, ...]:
        """Copies in each cycle."""
        full, rest = divmod(self.copies, self.together)
        return (self.together,) * full + ((rest,) if rest else ())

    @property
    def count(self) -> int:
        return len(self.cycles)


def press_runs(
    copies: int,
    bounds: Bounds,
    platen: tuple[float, float],
    margin: float = 0.0,
    most: int | None = None,
) -> Runs:
    """Return runs with as many copies at once as the heated area (mm) takes; ``bounds`` are those
    of one.

    ``margin`` mm of base plate lie round all of them; the plate lies on the platen either way.
    Where no cycle may take more than ``most``, cycles are as equal as can be: each place costs
    holes in the plate.
    Copies are equal layer by layer, so every place of the press holds the same films at every
    height: the paper (Sec. 2) splits pressing where stacks of unlike cuts would share the pressure
    unevenly. Unlike designs are therefore never pressed together.
    """
    low_x, low_y, high_x, high_y = bounds
    size = high_x - low_x, high_y - low_y
    room = platen[0] - 2 * margin, platen[1] - 2 * margin
    grids = [_grid(room, size), _grid((room[1], room[0]), size)]
    # What is larger than the heated area breaks the rule press-fit, or is waived: one by one.
    columns, rows = max((*grids, (1, 1)), key=lambda grid: grid[0] * grid[1])
    together = min(copies, columns * rows)
    if most is not None:
        cycles = math.ceil(copies / min(together, most))
        together = math.ceil(copies / cycles)
    # A few copies lie in a block, not in one long row.
    columns = min(columns, max(math.ceil(together / rows), math.ceil(math.sqrt(together))))
    pitch = size[0] + APART, size[1] + APART
    places = [((n % columns) * pitch[0], (n // columns) * pitch[1]) for n in range(together)]
    return Runs(copies, tuple((round(x, 6), round(y, 6)) for x, y in places))


def runs_of(
    laminate: Laminate, copies: int, platen: tuple[float, float], most: int | None = None
) -> Runs:
    """Return a laminate's press runs on one base plate; registered sheets are one piece."""
    if laminate.panel is not None:
        return Runs(1, ((0.0, 0.0),))
    margin = PLATE_MARGIN if laminate.pins else 0.0
    return press_runs(copies, laminate.bounds, platen, margin, most)


def design_runs(design: Design, laminate: Laminate, copies: int | None = None) -> Runs:
    """Return the runs of ``copies``, by default the order; no cycle is longer than a shift."""
    press = design.press
    return runs_of(
        laminate,
        design.order.quantity if copies is None else copies,
        (press.platen_width, press.platen_length),
        _copies_a_shift(design, laminate),
    )


def _copies_a_shift(design: Design, laminate: Laminate) -> int:
    """Return the number of copies that one person makes in a cycle of one working day, at least
    one.

    Minutes that are not stated for the film count as none: the press may then take longer.
    """
    press = design.press
    settings = PressSettings(
        flash_bottom=press.flash_bottom_minutes,
        bond_bottom=press.bond_bottom_minutes,
        flash_middle=press.flash_middle_minutes,
        bond_all=press.bond_all_minutes,
        minutes_for=tuple(map(named_film, press.minutes_for)),
    )
    pressing = 0.0
    if not films_without_minutes(laminate, settings):
        pressing = sum(settings.minutes(part.name) for part in assembly(laminate))
    handling = 60 * design.order.shift_hours - pressing
    return max(1, math.floor(handling / HANDLING_MINUTES + ROUNDING))


def _grid(room: tuple[float, float], size: tuple[float, float]) -> tuple[int, int]:
    """Return columns and rows."""
    columns, rows = (
        max(0, math.floor((most + APART + ROUNDING) / (side + APART)))
        for most, side in zip(room, size, strict=True)
    )
    return columns, rows


def are_apart(places: tuple[Point, ...], bounds: Bounds, room: float) -> bool:
    """Return True if copies at these places keep APART, within a tolerance ``room`` in mm."""
    wide = bounds[2] - bounds[0] + APART - room
    high = bounds[3] - bounds[1] + APART - room
    return all(
        abs(x - u) >= wide or abs(y - v) >= high
        for n, (x, y) in enumerate(places)
        for u, v in places[:n]
    )


@dataclass(frozen=True)
class BatchTimes:
    """Minutes of a batch: in the press (None: not stated), by hand, and both in sequence."""

    press: float | None
    hands: float

    @property
    def total(self) -> float | None:
        return None if self.press is None else self.press + self.hands


def batch_times(runs: Runs, plan: Schedule) -> BatchTimes:
    """Return the times of a batch: the press closes once a cycle; every copy needs the full hand
    work.

    Nothing is taken off for hands that work while the press is closed.
    """
    pressed = plan.total_press_minutes
    return BatchTimes(
        None if pressed is None else runs.count * pressed, runs.copies * plan.hands_minutes
    )


def working_days(
    design: Design, laminate: Laminate, plan: Schedule, copies: int | None = None
) -> tuple[Entry, ...]:
    """Return all work on ``copies``, by default on the order, by working day.

    Empty where the minutes in the press are not stated.
    """
    if plan.total_press_minutes is None:
        return ()
    runs = design_runs(design, laminate, copies)
    work = tasks(laminate, plan, runs.cycles, plan.hands_minutes)
    return by_day(work, 60 * design.order.shift_hours)


def copies_a_day(plan: Schedule, together: int, minutes: float) -> int | None:
    """Return the number of actuators that one person makes in a shift with one press, ``together``
    at once.

    None where the minutes in the press are not stated.
    """
    if plan.total_press_minutes is None:
        return None
    copies = 0
    while True:
        cycles = math.ceil((copies + 1) / together)
        if (copies + 1) * plan.hands_minutes + cycles * plan.total_press_minutes > minutes:
            return copies
        copies += 1


def most_together(laminate: Laminate, platen: tuple[float, float]) -> int:
    """Return the largest number of copies in one cycle."""
    return runs_of(laminate, 10_000, platen).together


def batch_json(design: Design, laminate: Laminate, plan: Schedule) -> dict[str, Any]:
    """Return the entry of ``press.json`` for a batch of several copies."""
    runs, shift = design_runs(design, laminate), 60 * design.order.shift_hours
    times = batch_times(runs, plan)
    most = most_together(laminate, (design.press.platen_width, design.press.platen_length))
    return {
        "copies": runs.copies,
        "at_once": runs.together,
        "at_once_at_most": most,
        "cycles": list(runs.cycles),
        "places_mm": [list(place) for place in runs.places],
        "press_minutes": times.press,
        "hands_minutes": times.hands,
        "total_minutes": times.total,
        "a_day_one_by_one": copies_a_day(plan, 1, shift),
        "a_day_in_batches": copies_a_day(plan, most, shift),
        "shift_minutes": shift,
        "plan": [
            {
                "day": entry.day,
                "start_minutes": entry.start,
                "minutes": entry.minutes,
                "task": entry.task,
                "cycle": entry.cycle or None,
                "step": entry.step or None,
                "copies": list(entry.copies),
            }
            for entry in working_days(design, laminate, plan)
        ],
        "patterns": [
            {
                "pattern": pattern,
                "each": len(layers),
                "cycles": [len(layers) * count for count in runs.cycles],
            }
            for pattern, layers in laminate.patterns.items()
        ],
    }


# A batch spread over working days: its tasks, and the places where the work may pause.
#
# The paper leaves an hour for all hand work on one actuator and does not divide it: the shares
# below are ours. Warming and cooling of the base plate, which is ours too, are not in it.


TaskName = Literal["cut", "press", "finish"]
CUT_SHARE, FINISH_SHARE = 0.25, 0.25
"""Shares of the hour: cutting, wiping and sorting; trimming and fitting the tubes. The rest is for
laying up, shared over the press steps by the number of parts that each lays."""
HOUR_ROUNDING = 1e-6


@dataclass(frozen=True)
class Task:
    """Work on ``copies``, first and last.

    A press step must not be left half done; other tasks may pause after every copy, or sheet.
    ``cycle`` and ``step`` are 0 where a task has none.
    """

    task: TaskName
    copies: tuple[int, int]
    minutes: float
    cycle: int = 0
    step: int = 0

    @property
    def count(self) -> int:
        """Number of copies."""
        return self.copies[1] - self.copies[0] + 1


@dataclass(frozen=True)
class Entry(Task):
    """A task, or a part of one, on its ``day`` (from 1), ``start`` minutes into the shift."""

    day: int = 1
    start: float = 0.0


def tasks(laminate: Laminate, plan: Schedule, cycles: Sequence[int], hands: float) -> list[Task]:
    """Return the work on a batch in its order; ``hands`` minutes are those of one copy.

    All sheets are cut first, for the parts of all cycles lie on them.
    """
    parts = [_parts_laid(laminate, part) for part in assembly(laminate)]
    laying = hands * (1 - CUT_SHARE - FINISH_SHARE)
    work = [Task("cut", (1, sum(cycles)), sum(cycles) * hands * CUT_SHARE)]
    last = 0
    for cycle, size in enumerate(cycles, 1):
        copies = last + 1, last + size
        for step, laid in zip(plan.steps, parts, strict=True):
            minutes = size * laying * laid / sum(parts) + (step.minutes or 0.0)
            work.append(Task("press", copies, minutes, cycle, step.step))
        work.append(Task("finish", copies, size * hands * FINISH_SHARE, cycle))
        last += size
    return work


def _parts_laid(laminate: Laminate, part: AssemblyStep) -> int:
    """Return the number of pieces and bonded stacks that a step lays down."""
    pieces = sum(len(laminate.layer(index).profile.pieces) for index in part.adds)
    return pieces + sum(set(stack).isdisjoint(part.adds) for stack in part.stacks if stack)


def by_day(work: Sequence[Task], shift: float) -> tuple[Entry, ...]:
    """Return the tasks with the day and minute when each begins, in a shift of so many minutes.

    The press steps of a cycle all end on the day on which they begin, where a shift is long enough
    for them; else each step does. One that is longer than a shift begins a day and ends after it.
    """
    return tuple(_entries(work, shift))


def _entries(work: Sequence[Task], shift: float) -> Iterator[Entry]:
    day, start = 1, 0.0
    for task in work:
        if task.task == "press":
            rest = sum(t.minutes for t in work if t.cycle == task.cycle and t.step >= task.step > 0)
            together = rest if rest <= shift and task.step == 1 else task.minutes
            if start and start + together > shift + HOUR_ROUNDING:
                day, start = day + 1, 0.0
            yield _entry(task, task.copies, day, start)
            start += task.minutes
            continue
        first, each = task.copies[0], task.minutes / task.count
        while first <= task.copies[1]:
            remaining = task.copies[1] - first + 1
            count = max(0, min(remaining, math.floor((shift - start + HOUR_ROUNDING) / each)))
            if not count and start:
                day, start = day + 1, 0.0
                continue
            last = first + max(count, 1) - 1
            yield _entry(task, (first, last), day, start)
            start += (last - first + 1) * each
            first = last + 1


def _entry(task: Task, copies: tuple[int, int], day: int, start: float) -> Entry:
    minutes = task.minutes * (copies[1] - copies[0] + 1) / task.count
    return Entry(task.task, copies, round(minutes, 1), task.cycle, task.step, day, round(start, 1))
