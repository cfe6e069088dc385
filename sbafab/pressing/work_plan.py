"""The plan of a batch: who does what when, on which press and base plate, until the last test.

A list schedule: of all work whose predecessors are done, what can begin first is begun first, and
the steps of the press come before work that can wait. It is deterministic, and not the shortest:
in the tests it takes up to 1.4 times the lower bound of its resources, as no step can be split.

The paper leaves an hour for all manual work on one actuator and does not divide it; the shares
below are ours. Warming, cooling and curing need no hands.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from heapq import heappop, heappush
from itertools import accumulate
from typing import Any, Literal, NamedTuple

from sbafab.design.identity import cure_hours
from sbafab.design.records import Design
from sbafab.laminate.assembly import AssemblyStep, assembly
from sbafab.laminate.laminate import Laminate
from sbafab.pressing.build_up import BASE_PLATE
from sbafab.pressing.cycles import (
    Runs,
    batch_times,
    copies_a_day,
    cycle_name,
    design_runs,
    most_together,
    serial,
)
from sbafab.pressing.plate_heating import START, cool_minutes, warm_minutes
from sbafab.pressing.schedule import HANDLING_MINUTES, Schedule
from sbafab.spreadsheet import csv_text

TaskName = Literal["cut", "sort", "lay", "press", "open", "cool", "unpin", "tubes", "cure", "test"]
HANDS_OFF: tuple[TaskName, ...] = ("press", "cool", "cure")
"""Tasks that go on by themselves. Cooling and curing may run past the end of a shift; pressing may
not, for somebody opens the press when its clock ends."""
PAUSABLE: tuple[TaskName, ...] = ("cut", "sort", "tubes", "test")
"""Tasks of which the copies are done one after the other; they may pause after each."""
CUT_SHARE, SORT_SHARE, TUBES_SHARE = 0.125, 0.125, 0.25
"""Shares of the hour of one copy: at the laser; wiping and sorting; trimming and fitting the tubes.
The rest is for the press steps."""
OPEN_SHARE, UNPIN_SHARE = 0.05, 0.15
"""Shares of the work at the press, equal in all steps: opening it and taking the plate out; taking
down. The rest is for laying up, by the number of parts that each step lays."""
CONNECT_MINUTES = 2.0
"""Minutes to connect one tube to the test bench and free it again: ours."""
CURE_HOURS = 24.0
"""Hours in which the adhesive of the tubes cures where neither order nor kit says so: ours."""
DAY = 24 * 600
TICKS = 10
"""Of a minute: all times of a plan are tenths of a minute, so that sums are exact."""


@dataclass(frozen=True)
class Shop:
    """What a batch is made with. ``shift`` is the working day in minutes."""

    shift: float
    technicians: int = 1
    presses: int = 1
    plates: int = 1


@dataclass(frozen=True)
class Times:
    """Minutes of a plan's work that hang on neither cycle nor step.

    ``warm`` come before the clock of every step, ``cool`` after it. ``hands`` are those of one
    copy until its tubes are fitted, ``test`` those of one copy at the test bench.
    """

    hands: float
    warm: float
    cool: float
    cure: float
    test: float


@dataclass(frozen=True)
class PlanEntry:
    """A row of the plan: one task on the copies from first to last.

    It begins ``start`` minutes into the shift of ``day`` (from 1). Within a row the copies of what
    may pause ("cut", "sort", "tubes", "test") are done one after the other. ``cycle``, ``step``,
    ``technician``, ``press`` and ``plate`` count from 1 and are 0 where a task has none.
    """

    task: TaskName
    copies: tuple[int, int]
    day: int
    start: float
    minutes: float
    cycle: int = 0
    step: int = 0
    technician: int = 0
    press: int = 0
    plate: int = 0

    @property
    def end(self) -> float:
        """Minutes after the start of the shift in which it began."""
        return round(self.start + self.minutes, 1)


def plan_times(design: Design, laminate: Laminate, schedule: Schedule) -> Times:
    """Return the minutes of a batch's work; warming and cooling are estimates until measured."""
    press, acceptance = design.press, design.acceptance
    plate = next(
        (p.thickness_mm for s in schedule.steps for p in s.build_up if p.part == BASE_PLATE), 0.0
    )
    points = [point for step in schedule.steps[:1] for point in step.time_temperature]
    measured = next((p.after_minutes for p in points if p.point == START), None)
    tubes = laminate.tube_count
    held = (2 * acceptance.leak_seconds + acceptance.proof_seconds) / 60
    return Times(
        hands=HANDLING_MINUTES,
        warm=warm_minutes(plate, press.temperature_c) if measured is None else measured,
        cool=press.cool_minutes or cool_minutes(plate, press.temperature_c),
        cure=60 * (cure_hours(design) or CURE_HOURS) if tubes else 0.0,
        test=max(1, tubes) * (held + CONNECT_MINUTES),
    )


def shop_of(design: Design) -> Shop:
    """Return the people, presses and plates that a design's order states."""
    order = design.order
    return Shop(
        60 * order.shift_hours, order.technicians or 1, order.presses or 1, order.base_plates or 1
    )


def work_plan(
    design: Design, laminate: Laminate, schedule: Schedule, copies: int | None = None
) -> tuple[PlanEntry, ...]:
    """Return all work on ``copies``, by default on the order, in the order in which it begins.

    Empty where nobody stated the minutes: of a step in the press, or of a seam or fold.
    """
    if not schedule.total_press_minutes or schedule.seams or schedule.folds:
        return ()
    runs = design_runs(design, laminate, copies)
    laid = [_parts_laid(laminate, part) for part in assembly(laminate)]
    pressed = [step.minutes or 0.0 for step in schedule.steps]
    return planned(runs, pressed, laid, plan_times(design, laminate, schedule), shop_of(design))


def planned(
    runs: Runs, pressed: Sequence[float], laid: Sequence[int], times: Times, shop: Shop
) -> tuple[PlanEntry, ...]:
    """Return the plan of runs of steps that are ``pressed`` so many minutes each.

    ``laid`` is the number of parts that each step lays.
    """
    return _Planner(runs, pressed, laid, times, shop).entries()


def _parts_laid(laminate: Laminate, part: AssemblyStep) -> int:
    """Return the number of pieces and bonded stacks that a step lays down."""
    pieces = sum(len(laminate.layer(index).profile.pieces) for index in part.adds)
    return pieces + sum(set(stack).isdisjoint(part.adds) for stack in part.stacks if stack)


# Times are tenths of a minute from here on, from the start of the first shift.


@dataclass
class _Bookings:
    """The times at which one person, press, plate or laser is taken, in their order."""

    starts: list[int] = field(default_factory=list)
    ends: list[int] = field(default_factory=list)

    def is_free(self, start: int, end: int) -> bool:
        place = bisect_right(self.starts, start)
        before = place == 0 or self.ends[place - 1] <= start
        return before and (place == len(self.starts) or self.starts[place] >= end)

    def next_start(self, time: int) -> float:
        """Return when it is taken next, from a time at which it is free."""
        place = bisect_left(self.starts, time)
        return self.starts[place] if place < len(self.starts) else math.inf

    def ends_within(self, start: int, end: int) -> Iterator[int]:
        """Yield the ends of bookings in a span."""
        for place in range(bisect_left(self.ends, start), len(self.ends)):
            if self.ends[place] > end:
                return
            yield self.ends[place]

    def book(self, start: int, end: int) -> None:
        place = bisect_right(self.starts, start)
        self.starts.insert(place, start)
        self.ends.insert(place, end)


class _Step(NamedTuple):
    """Durations of one step of one cycle: laying, in the press, opening, cooling, taking down."""

    lay: int
    press: int
    open: int
    cool: int
    unpin: int

    @property
    def attended(self) -> int:
        """Time in which the films must not be left: from the first layer until the press opens."""
        return self.lay + self.press + self.open


@dataclass(frozen=True, order=True)
class _Block:
    """A step of a cycle that may begin at ``ready``."""

    ready: int
    cycle: int
    step: int


@dataclass(frozen=True, order=True)
class _Queue:
    """Copies from first to last that wait for one task of ``each`` ticks, one after the other.

    The first is ready at ``ready``, every further one ``pace`` later.
    """

    ready: int
    rank: int
    task: TaskName
    copies: tuple[int, int]
    each: int
    cycle: int = 0
    pace: int = 0


class _Placed(NamedTuple):
    """A step placed: when each of its tasks begins and ends, and who and what it takes."""

    times: tuple[int, int, int, int, int, int]
    layer: int
    opener: int
    drawer: int
    press: int
    plate: int


class _Planner:
    """A plan that grows by the work that can begin first."""

    def __init__(
        self,
        runs: Runs,
        pressed: Sequence[float],
        laid: Sequence[int],
        times: Times,
        shop: Shop,
    ) -> None:
        self.runs, self.times = runs, times
        self.shift = _ticks(shop.shift)
        self.people = [_Bookings() for _ in range(shop.technicians)]
        self.presses = [_Bookings() for _ in range(shop.presses)]
        self.plates = [_Bookings() for _ in range(shop.plates)]
        self.laser = _Bookings()
        self.steps = {size: _steps_of(size, pressed, laid, times) for size in set(runs.cycles)}
        self.blocks: list[_Block] = []
        self.queues: list[_Queue] = []
        self.unsorted = runs.copies
        self.rows: list[PlanEntry] = []

    def entries(self) -> tuple[PlanEntry, ...]:
        self._wait("cut", (1, self.runs.copies), 0)
        while self.blocks or self.queues:
            block, placed = self._first_block()
            queue, start, person = self._first_queue()
            if queue is None:
                assert block is not None
                self._press(block, placed)
                continue
            # What can wait fills the time until a step begins, and does not hold it up.
            limit = math.inf
            if placed is not None and person == placed.layer:
                limit = placed.times[0]
            if (
                block is not None
                and placed is not None
                and (placed.times[0] <= start or start + queue.each > limit)
            ):
                heappush(self.queues, queue)
                self._press(block, placed)
                continue
            if block is not None:
                heappush(self.blocks, block)
            self._work_off(queue, start, person, limit)
        return tuple(_merged(sorted(self.rows, key=_order)))

    # Which block, and which queue, can begin first. What was ready stays ready, but later.

    def _first_block(self) -> tuple[_Block | None, _Placed | None]:
        while self.blocks:
            block = heappop(self.blocks)
            placed = self._place(block)
            block = replace(block, ready=placed.times[0])
            if not self.blocks or block <= self.blocks[0]:
                return block, placed
            heappush(self.blocks, block)
        return None, None

    def _first_queue(self) -> tuple[_Queue | None, int, int]:
        while self.queues:
            queue = heappop(self.queues)
            start, person = self._slot(queue.ready, queue.each, queue.task)
            later = replace(queue, ready=start)
            if not self.queues or later <= self.queues[0]:
                return queue, start, person
            # The copies behind the first wait as long.
            heappush(self.queues, replace(later, pace=queue.pace))
        return None, 0, 0

    def _slot(self, ready: int, each: int, task: TaskName) -> tuple[int, int]:
        """Return when one of the people is first free for ``each`` ticks, and who that is."""
        day = ready // DAY
        while True:
            low, high = self._window(day, ready)
            moments = {low}
            for person in self.people:
                moments.update(person.ends_within(low, high))
            if task == "cut":
                moments.update(self.laser.ends_within(low, high))
            for start in sorted(moments):
                # What is longer than a shift begins one, and ends after it.
                if start + each > (high if each <= self.shift else day * DAY + each):
                    break
                if task == "cut" and not self.laser.is_free(start, start + each):
                    continue
                for number, person in enumerate(self.people):
                    if person.is_free(start, start + each):
                        return start, number
            day += 1

    def _window(self, day: int, ready: int) -> tuple[int, int]:
        """Return the shift of a day, from ``ready`` on."""
        return max(ready, day * DAY), day * DAY + self.shift

    def _place(self, block: _Block) -> _Placed:
        """Return the first place of a step: people, a press and a plate are free for it."""
        step = self.steps[self.runs.cycles[block.cycle - 1]][block.step - 1]
        day = block.ready // DAY
        while True:
            low, high = self._window(day, block.ready)
            fits = step.attended <= self.shift
            latest = high - step.attended if fits else day * DAY
            for start in self._moments(low, latest, step):
                placed = self._placed(start, step)
                if placed is not None:
                    return placed
            day += 1

    def _moments(self, low: int, latest: int, step: _Step) -> list[int]:
        """Return the times at which something becomes free that a step waits for."""
        opened = step.lay + step.press
        moments = {low}
        for bookings, lead in (
            *((person, 0) for person in self.people),
            *((person, opened) for person in self.people),
            *((press, step.lay) for press in self.presses),
            *((plate, 0) for plate in self.plates),
        ):
            moments.update(end - lead for end in bookings.ends_within(low + lead, latest + lead))
        return sorted(moment for moment in moments if low <= moment <= latest)

    def _placed(self, start: int, step: _Step) -> _Placed | None:
        """Return a step that begins at ``start``; None where something is not free."""
        closed = start + step.lay
        clock_end = closed + step.press
        opened = clock_end + step.open
        layer = _free(self.people, start, closed)
        if layer is None:
            return None
        order = (layer, *(n for n in range(len(self.people)) if n != layer))
        opener = _free(self.people, clock_end, opened, order)
        press = _free(self.presses, closed, opened)
        plate = _free(self.plates, start, opened + step.cool)
        if opener is None or press is None or plate is None:
            return None
        cold = opened + step.cool
        unpin, drawer = self._slot(cold, step.unpin, "unpin")
        plate = _free(self.plates, start, unpin + step.unpin)
        if plate is None:
            return None
        times = (start, closed, clock_end, opened, cold, unpin)
        return _Placed(times, layer, opener, drawer, press, plate)

    # Booking.

    def _press(self, block: _Block, placed: _Placed | None) -> None:
        """Book a step, and let what comes after it wait."""
        assert placed is not None
        copies = self.runs.copies_in(block.cycle)
        step = self.steps[self.runs.cycles[block.cycle - 1]][block.step - 1]
        start, closed, clock_end, opened, cold, unpin = placed.times
        done = unpin + step.unpin
        self.people[placed.layer].book(start, closed)
        self.people[placed.opener].book(clock_end, opened)
        self.people[placed.drawer].book(unpin, done)
        self.presses[placed.press].book(closed, opened)
        self.plates[placed.plate].book(start, done)
        plate, press = placed.plate + 1, placed.press + 1
        spans: tuple[tuple[TaskName, int, int, int, int], ...] = (
            ("lay", start, closed, placed.layer + 1, 0),
            ("press", closed, clock_end, 0, press),
            ("open", clock_end, opened, placed.opener + 1, press),
            ("cool", opened, cold, 0, 0),
            ("unpin", unpin, done, placed.drawer + 1, 0),
        )
        for task, begin, end, person, number in spans:
            row = _entry(task, copies, begin, end - begin)
            self.rows.append(
                replace(
                    row,
                    cycle=block.cycle,
                    step=block.step,
                    technician=person,
                    press=number,
                    plate=plate,
                )
            )
        if block.step < len(self.steps[self.runs.cycles[0]]):
            heappush(self.blocks, _Block(done, block.cycle, block.step + 1))
        else:
            self._wait("tubes", copies, done, block.cycle)
        if block.step == 1 and block.cycle < self.runs.count:
            heappush(self.blocks, _Block(start, block.cycle + 1, 1))

    def _wait(
        self, task: TaskName, copies: tuple[int, int], ready: int, cycle: int = 0, pace: int = 0
    ) -> None:
        minutes = {
            "cut": CUT_SHARE * self.times.hands,
            "sort": SORT_SHARE * self.times.hands,
            "tubes": TUBES_SHARE * self.times.hands,
            "test": self.times.test,
        }[task]
        rank = ("tubes", "test", "sort", "cut").index(task)
        heappush(self.queues, _Queue(ready, rank, task, copies, _ticks(minutes), cycle, pace))

    def _work_off(self, queue: _Queue, start: int, person: int, limit: float) -> None:
        """Book as many copies of a queue as there is time for, one after the other."""
        until = min(
            limit,
            self.people[person].next_start(start),
            start // DAY * DAY + max(self.shift, queue.each),
        )
        first, last = queue.copies
        # Where each copy becomes ready later than the one before takes its work, they are waited
        # for one by one.
        many = last - first + 1 if queue.pace <= queue.each else 1
        count = max(1, min(many, int((until - start) // queue.each)))
        done, end = first + count - 1, start + count * queue.each
        self.people[person].book(start, end)
        if queue.task == "cut":
            self.laser.book(start, end)
        row = _entry(queue.task, (first, done), start, end - start)
        self.rows.append(replace(row, cycle=queue.cycle, technician=person + 1))
        if done < last:
            ready = max(queue.ready + count * queue.pace, start)
            heappush(self.queues, replace(queue, copies=(done + 1, last), ready=ready))
        self._follow(queue, (first, done), start, end)

    def _follow(self, queue: _Queue, copies: tuple[int, int], start: int, end: int) -> None:
        """Let what comes after a task wait."""
        if queue.task == "cut":
            self._wait("sort", copies, start + queue.each, pace=queue.each)
        elif queue.task == "sort":
            # The parts of all cycles lie on all sheets.
            self.unsorted -= copies[1] - copies[0] + 1
            if not self.unsorted:
                ready = max(_at(row) for row in self.rows)
                heappush(self.blocks, _Block(ready, 1, 1))
        elif queue.task == "tubes":
            cure = _ticks(self.times.cure)
            if cure:
                row = _entry("cure", copies, end, cure)
                self.rows.append(replace(row, cycle=queue.cycle))
            self._wait("test", copies, end + cure, queue.cycle)


def _steps_of(
    size: int, pressed: Sequence[float], laid: Sequence[int], times: Times
) -> tuple[_Step, ...]:
    """Return the steps of a cycle of ``size`` copies; their hands sum up exactly."""
    whole = _ticks(size * times.hands * (1 - CUT_SHARE - SORT_SHARE - TUBES_SHARE))
    opening = _shares(round(OPEN_SHARE * whole), [1] * len(laid))
    unpinning = _shares(round(UNPIN_SHARE * whole), [1] * len(laid))
    laying = _shares(whole - sum(opening) - sum(unpinning), laid)
    return tuple(
        _Step(lay, _ticks(times.warm + minutes), opened, _ticks(times.cool), unpin)
        for lay, minutes, opened, unpin in zip(laying, pressed, opening, unpinning, strict=True)
    )


def _shares(whole: int, weights: Sequence[int]) -> list[int]:
    """Return whole ticks in proportion to weights, which sum up to the whole."""
    ends = [round(whole * part / sum(weights)) for part in accumulate(weights)]
    return [end - start for start, end in zip([0, *ends], ends, strict=False)]


def _ticks(minutes: float) -> int:
    return round(minutes * TICKS)


def _free(
    bookings: Sequence[_Bookings], start: int, end: int, order: Iterable[int] | None = None
) -> int | None:
    """Return the first of several that is free in a span; None if none is."""
    numbers = range(len(bookings)) if order is None else order
    return next((n for n in numbers if bookings[n].is_free(start, end)), None)


def _entry(task: TaskName, copies: tuple[int, int], start: int, ticks: int) -> PlanEntry:
    day, within = divmod(start, DAY)
    return PlanEntry(task, copies, day + 1, within / TICKS, ticks / TICKS)


def _merged(rows: Iterable[PlanEntry]) -> Iterator[PlanEntry]:
    """Yield rows in order; one person's same work on the next copies goes on in the same row."""
    merged: list[PlanEntry] = []
    latest: dict[int, int] = {}
    for row in rows:
        before = merged[latest[row.technician]] if row.technician in latest else None
        if before is not None and _goes_on(before, row):
            merged[latest[row.technician]] = replace(
                before,
                copies=(before.copies[0], row.copies[1]),
                minutes=round(before.minutes + row.minutes, 1),
            )
            continue
        if row.technician:
            latest[row.technician] = len(merged)
        merged.append(row)
    yield from merged


def _goes_on(before: PlanEntry, row: PlanEntry) -> bool:
    is_same = (before.task, before.cycle, before.day) == (row.task, row.cycle, row.day)
    is_next = (before.copies[1] + 1, before.end) == (row.copies[0], row.start)
    return is_same and is_next and row.task in PAUSABLE


def _at(row: PlanEntry) -> int:
    """Return the end of a row."""
    return (row.day - 1) * DAY + _ticks(row.end)


def _order(row: PlanEntry) -> tuple[int, float, int, int, int]:
    return row.day, row.start, row.technician or 99, row.cycle, row.step


# What is written of a plan.


COLUMNS = (
    "day",
    "from",
    "to",
    "start_minutes",
    "minutes",
    "technician",
    "task",
    "cycle",
    "step",
    "laminates",
    "first_copy",
    "last_copy",
    "press",
    "base_plate",
    "needs_hands",
)


def plan_csv(design: Design, laminate: Laminate, schedule: Schedule) -> str | None:
    """Return the plan as a table, a row a task; None for one copy, or where it has no plan."""
    entries = work_plan(design, laminate, schedule)
    runs = design_runs(design, laminate)
    if runs.copies == 1 or not entries:
        return None
    rows: list[Sequence[object]] = [COLUMNS]
    rows += [_row(runs, entry, design.order.batch) for entry in entries]
    return csv_text(rows)


def _row(runs: Runs, entry: PlanEntry, batch: str | None) -> Sequence[object]:
    return (
        entry.day,
        clock(entry.start),
        clock(entry.end),
        f"{entry.start:g}",
        f"{entry.minutes:g}",
        entry.technician or None,
        entry.task,
        cycle_name(entry.cycle) or None,
        entry.step or None,
        serials(runs, entry.copies, batch),
        *entry.copies,
        entry.press or None,
        entry.plate or None,
        "no" if entry.task in HANDS_OFF else "yes",
    )


def clock(minutes: float) -> str:
    """Return hours and minutes: 0:05, 7:45."""
    whole = round(round(minutes, 6))
    return f"{whole // 60}:{whole % 60:02d}"


def serials(runs: Runs, copies: tuple[int, int], batch: str | None) -> str:
    """Return the serials of copies from first to last in words."""
    first, last = (serial(runs, copy, batch) for copy in copies)
    return first if first == last else f"{first} to {last}"


def batch_json(design: Design, laminate: Laminate, schedule: Schedule) -> dict[str, Any]:
    """Return the entry of ``press.json`` for a batch of several copies."""
    runs, shift = design_runs(design, laminate), 60 * design.order.shift_hours
    times = batch_times(runs, schedule)
    most = most_together(laminate, (design.press.platen_width, design.press.platen_length))
    return {
        "copies": runs.copies,
        "at_once": runs.together,
        "at_once_at_most": most,
        "cycles": list(runs.cycles),
        "serials": [serial(runs, n + 1, design.order.batch) for n in range(runs.copies)],
        "places_mm": [list(place) for place in runs.places],
        "press_minutes": times.press,
        "hands_minutes": times.hands,
        "total_minutes": times.total,
        "a_day_one_by_one": copies_a_day(schedule, 1, shift),
        "a_day_in_batches": copies_a_day(schedule, most, shift),
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
                "technician": entry.technician or None,
                "press": entry.press or None,
                "base_plate": entry.plate or None,
            }
            for entry in work_plan(design, laminate, schedule)
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
