"""A batch spread over working days: what is done when, and where the work may pause.

The paper leaves an hour for all that hands do to one actuator and does not divide it: the shares
below are ours. Warming and cooling of the base plate, which is ours too, are not in it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

from sbafab.laminate.assembly import AssemblyStep, assembly
from sbafab.laminate.laminate import Laminate
from sbafab.pressing.schedule import Schedule

TaskName = Literal["cut", "press", "finish"]
CUT_SHARE, FINISH_SHARE = 0.25, 0.25
"""Shares of the hour: cutting, wiping and sorting; trimming and fitting the tubes. The rest is for
laying up, shared over the press steps by the number of parts that each lays."""
ROUNDING = 1e-6


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
    """A task, or the part of one, on its ``day`` (from 1), ``start`` minutes after the shift's."""

    day: int = 1
    start: float = 0.0


def tasks(laminate: Laminate, plan: Schedule, cycles: Sequence[int], hands: float) -> list[Task]:
    """Return the work on a batch in its order; ``hands`` minutes are those of one copy.

    All sheets are cut first, for the parts of all cycles lie on them.
    """
    parts = [_parts_laid(laminate, part) for part in assembly(laminate)]
    laying = hands * (1 - CUT_SHARE - FINISH_SHARE)
    found = [Task("cut", (1, sum(cycles)), sum(cycles) * hands * CUT_SHARE)]
    last = 0
    for cycle, size in enumerate(cycles, 1):
        copies = last + 1, last + size
        for step, laid in zip(plan.steps, parts, strict=True):
            minutes = size * laying * laid / sum(parts) + step.minutes
            found.append(Task("press", copies, minutes, cycle, step.step))
        found.append(Task("finish", copies, size * hands * FINISH_SHARE, cycle))
        last += size
    return found


def _parts_laid(laminate: Laminate, part: AssemblyStep) -> int:
    """Number of pieces and bonded stacks that a step lays down."""
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
            if start and start + together > shift + ROUNDING:
                day, start = day + 1, 0.0
            yield _entry(task, task.copies, day, start)
            start += task.minutes
            continue
        first, each = task.copies[0], task.minutes / task.count
        while first <= task.copies[1]:
            left = task.copies[1] - first + 1
            count = max(0, min(left, math.floor((shift - start + ROUNDING) / each)))
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
