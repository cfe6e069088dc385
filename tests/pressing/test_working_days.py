"""Batches by working day: cycles that a shift holds, and what is done on which day."""

from __future__ import annotations

import math

import pytest

from sbafab.actuators import build, load_design
from sbafab.output.checked import press_settings
from sbafab.pressing.cycles import Entry, Task, batch_times, by_day, design_runs, working_days
from sbafab.pressing.schedule import Schedule, schedule


def planned(template: str, *changes: str) -> tuple[tuple[int, ...], tuple[Entry, ...], Schedule]:
    design = load_design(template, changes)
    laminate = build(design)
    runs = design_runs(design, laminate)
    plan = schedule(laminate, press_settings(design), runs.cycles)
    entries = working_days(design, laminate, plan)
    assert sum(entry.minutes for entry in entries) == pytest.approx(
        batch_times(runs, plan).total, abs=0.05 * len(entries)
    )
    return runs.cycles, entries, plan


@pytest.mark.parametrize(
    ("copies", "hours", "cycles"),
    # 45 min in the press and 60 by hand a copy: (60 h - 45) / 60 copies are a shift, at least one.
    [
        (20, 8, (7, 7, 6)),
        (8, 8, (4, 4)),
        (7, 8, (7,)),
        (3, 3.5, (2, 1)),
        (2, 1, (1, 1)),
        (30, 24, (15, 15)),
    ],
)
def test_a_cycle_is_no_longer_than_a_shift(
    copies: int, hours: float, cycles: tuple[int, ...]
) -> None:
    changes = [f"order.copies={copies}", f"order.shift_hours={hours}"]
    found, _, plan = planned("3dof-15mm", *changes)
    assert found == cycles
    assert plan.total_press_minutes == 45
    assert max(cycles) == 1 or 45 + 60 * max(cycles) <= 60 * hours


@pytest.mark.parametrize("hours", [1, 2.5, 8, 11])
@pytest.mark.parametrize(
    "changes", [("order.good=20",), ("order.copies=20", "registration.method=ears")]
)
def test_no_press_step_is_left_half_done(changes: tuple[str, ...], hours: float) -> None:
    cycles, entries, plan = planned("1dof-5mm", *changes, f"order.shift_hours={hours}")
    pressed = [entry for entry in entries if entry.task == "press"]
    steps = [step.step for step in plan.steps]
    assert [(entry.cycle, entry.step) for entry in pressed] == [
        (cycle, step) for cycle in range(1, len(cycles) + 1) for step in steps
    ]
    # In order, and one after the other.
    for before, after in zip(entries, entries[1:], strict=False):
        assert (after.day, after.start) >= (before.day, before.start + before.minutes - 0.11)
    # All but what is longer than a shift ends within it.
    for entry in entries:
        longer = entry.minutes > 60 * hours
        assert entry.start + entry.minutes <= 60 * hours + 0.1 or (longer and entry.start == 0)
    # A cycle of which all steps fit into one day is pressed on one.
    for cycle in range(1, len(cycles) + 1):
        of_cycle = [entry for entry in pressed if entry.cycle == cycle]
        if sum(entry.minutes for entry in of_cycle) <= 60 * hours - 0.5:
            assert len({entry.day for entry in of_cycle}) == 1


def test_every_copy_is_cut_pressed_in_each_step_and_finished_once() -> None:
    _, entries, plan = planned("3dof-15mm", "order.copies=20", "order.shift_hours=3")
    for task, step in [("cut", 0), ("finish", 0)] + [("press", s.step) for s in plan.steps]:
        spans = [e.copies for e in entries if (e.task, e.step) == (task, step)]
        copies = [copy for first, last in spans for copy in range(first, last + 1)]
        assert copies == list(range(1, 21)), (task, step)


def test_twenty_copies_take_a_day_of_cutting_and_a_day_a_cycle() -> None:
    """20 x 15 min of cutting leave 3 h of 8, in which 45 + 7 x 30 min of pressing do not end."""
    _, entries, _ = planned("3dof-15mm", "order.copies=20")
    assert {e.day: {(f.task, f.cycle) for f in entries if f.day == e.day} for e in entries} == {
        1: {("cut", 0)},
        2: {("press", 1), ("finish", 1)},
        3: {("press", 2), ("finish", 2)},
        4: {("press", 3), ("finish", 3)},
    }


def test_a_step_longer_than_a_shift_begins_a_day() -> None:
    work = [Task("cut", (1, 1), 30), Task("press", (1, 1), 500, 1, 1), Task("finish", (1, 1), 9, 1)]
    entries = by_day(work, 480)
    assert [(e.day, e.start) for e in entries] == [(1, 0), (2, 0), (3, 0)]


def test_what_may_pause_is_split_between_copies() -> None:
    entries = by_day([Task("cut", (1, 10), 100)], 35)
    assert [(e.day, e.copies, e.minutes) for e in entries] == [
        (1, (1, 3), 30),
        (2, (4, 6), 30),
        (3, (7, 9), 30),
        (4, (10, 10), 10),
    ]
    assert math.fsum(e.minutes for e in entries) == 100
    # 10 min a copy: what follows copies 4 to 6 begins after 30.
    work = [Task("cut", (4, 6), 30), Task("finish", (4, 6), 60, 1)]
    assert [(e.day, e.start) for e in by_day(work, 100)] == [(1, 0), (1, 30)]
