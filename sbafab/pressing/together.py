"""Several copies of one laminate: how many go into a press cycle, where they lie, how long."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from sbafab.design.records import Design
from sbafab.geometry.edges import Bounds, Point
from sbafab.laminate.assembly import PLATE_MARGIN, assembly
from sbafab.laminate.laminate import Laminate
from sbafab.pressing.schedule import HANDLING_MINUTES, PressSettings, Schedule
from sbafab.pressing.working_days import Entry, by_day, tasks

APART = 5.0
"""mm between two copies in the press, ours: so far do films flow and hands need."""
ROUNDING = 1e-9


@dataclass(frozen=True)
class Runs:
    """How ``copies`` are pressed: side by side at these ``places``, cycle after cycle.

    A place is how far a laminate's frame is moved from that of the first one, which lies at the
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
        """How many copies each cycle presses."""
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
    """As many copies at once as the heated area (mm) takes; ``bounds`` are those of one.

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
    """The press runs of a laminate, on one base plate; registered sheets are one piece to it."""
    if laminate.panel is not None:
        return Runs(1, ((0.0, 0.0),))
    margin = PLATE_MARGIN if laminate.pins else 0.0
    return press_runs(copies, laminate.bounds, platen, margin, most)


def design_runs(design: Design, laminate: Laminate, copies: int | None = None) -> Runs:
    """The press runs of ``copies``, or of all that a design orders; none is longer than a shift."""
    press = design.press
    return runs_of(
        laminate,
        design.order.quantity if copies is None else copies,
        (press.platen_width, press.platen_length),
        _a_shift(design, laminate),
    )


def _a_shift(design: Design, laminate: Laminate) -> int:
    """Number of copies, at least one, that one person makes in a cycle of one working day."""
    press = design.press
    settings = PressSettings(
        flash_bottom=press.flash_bottom_minutes,
        bond_bottom=press.bond_bottom_minutes,
        flash_middle=press.flash_middle_minutes,
        bond_all=press.bond_all_minutes,
    )
    pressing = sum(settings.minutes(part.name) for part in assembly(laminate))
    left = 60 * design.order.shift_hours - pressing
    return max(1, math.floor(left / HANDLING_MINUTES + ROUNDING))


def _grid(room: tuple[float, float], size: tuple[float, float]) -> tuple[int, int]:
    """Columns and rows."""
    columns, rows = (
        max(0, math.floor((most + APART + ROUNDING) / (own + APART)))
        for most, own in zip(room, size, strict=True)
    )
    return columns, rows


def are_apart(places: tuple[Point, ...], bounds: Bounds, room: float) -> bool:
    """Whether copies at these places keep APART, but for ``room`` mm."""
    wide = bounds[2] - bounds[0] + APART - room
    high = bounds[3] - bounds[1] + APART - room
    return all(
        abs(x - u) >= wide or abs(y - v) >= high
        for n, (x, y) in enumerate(places)
        for u, v in places[:n]
    )


@dataclass(frozen=True)
class BatchTimes:
    """Minutes that a batch takes: in the press, by hand, and both after each other."""

    press: float
    hands: float

    @property
    def total(self) -> float:
        return self.press + self.hands


def batch_times(runs: Runs, plan: Schedule) -> BatchTimes:
    """The press closes once a cycle; every copy takes the same hands as one by itself.

    Nothing is taken off for hands that work while the press is closed.
    """
    by_hand = plan.estimated_build_minutes - plan.total_press_minutes
    return BatchTimes(runs.count * plan.total_press_minutes, runs.copies * by_hand)


def working_days(
    design: Design, laminate: Laminate, plan: Schedule, copies: int | None = None
) -> tuple[Entry, ...]:
    """All work on ``copies``, or on all that a design orders, by working day."""
    runs = design_runs(design, laminate, copies)
    by_hand = plan.estimated_build_minutes - plan.total_press_minutes
    work = tasks(laminate, plan, runs.cycles, by_hand)
    return by_day(work, 60 * design.order.shift_hours)


def a_day(plan: Schedule, together: int, minutes: float) -> int:
    """Actuators that one person finishes in a shift with one press, ``together`` at once."""
    by_hand = plan.estimated_build_minutes - plan.total_press_minutes
    made = 0
    while True:
        cycles = math.ceil((made + 1) / together)
        if (made + 1) * by_hand + cycles * plan.total_press_minutes > minutes:
            return made
        made += 1


def most_together(laminate: Laminate, platen: tuple[float, float]) -> int:
    """As many copies as one cycle could press."""
    return runs_of(laminate, 10_000, platen).together


def batch_json(design: Design, laminate: Laminate, plan: Schedule) -> dict[str, Any]:
    """What ``press.json`` says of a batch of several copies."""
    runs, shift = design_runs(design, laminate), 60 * design.order.shift_hours
    times = batch_times(runs, plan)
    most = most_together(laminate, plan.steps[0].platen_mm)
    return {
        "copies": runs.copies,
        "at_once": runs.together,
        "at_once_at_most": most,
        "cycles": list(runs.cycles),
        "places_mm": [list(place) for place in runs.places],
        "press_minutes": times.press,
        "hands_minutes": times.hands,
        "total_minutes": times.total,
        "a_day_one_by_one": a_day(plan, 1, shift),
        "a_day_in_batches": a_day(plan, most, shift),
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
