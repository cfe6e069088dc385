"""Several copies of one laminate: their places in the press, its cycles, and their serials."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from sbafab.design.records import Design
from sbafab.documents import Document, PlainNumber, attribute
from sbafab.geometry.edges import Bounds, Point
from sbafab.laminate.laminate import Laminate
from sbafab.laminate.lay_up import PLATE_MARGIN, films_without_minutes, press_steps
from sbafab.pressing.schedule import HANDLING_MINUTES, Schedule, minutes_closed

APART = 5.0
"""Gap in mm between two copies in the press, ours: films flow, and hands need room."""
CYCLE_HOURS = 8.0
"""Most hours of pressing and handling in a cycle, if the order does not state the copies per cycle:
ours."""
ROUNDING = 1e-9


@dataclass(frozen=True)
class Runs:
    """Press cycles of ``copies``, side by side at these ``places``.

    A place is the offset of a laminate's frame from the first one's, at the lower left; rows fill
    from there. The last cycle may be smaller than the others.
    """

    copies: int
    places: tuple[Point, ...]

    @property
    def together(self) -> int:
        """The copies in a full cycle."""
        return len(self.places)

    @property
    def cycles(self) -> tuple[int, ...]:
        """The copies in each cycle."""
        full, rest = divmod(self.copies, self.together)
        return (self.together,) * full + ((rest,) if rest else ())

    @property
    def count(self) -> int:
        return len(self.cycles)

    def position(self, copy: int) -> tuple[int, int]:
        """Return the cycle and the place of a copy; all count from 1."""
        cycle, place = divmod(copy - 1, self.together)
        return cycle + 1, place + 1


def serial(runs: Runs, copy: int, batch: str | None = None) -> str:
    """Return the identity of a laminate throughout its manufacture: cycle and place, "A-03".

    The name of the batch, if any, is its prefix: "24-A-03".
    """
    cycle, place = runs.position(copy)
    width = max(2, len(str(runs.together)))
    return f"{f'{batch}-' if batch else ''}{cycle_name(cycle)}-{place:0{width}d}"


def cycle_name(cycle: int) -> str:
    """Return the letters of a cycle, as for a spreadsheet's columns: A, B, ... Z, AA."""
    letters = ""
    while cycle:
        cycle, digit = divmod(cycle - 1, 26)
        letters = chr(ord("A") + digit) + letters
    return letters


def press_runs(
    copies: int,
    bounds: Bounds,
    platen: tuple[float, float],
    margin: float = 0.0,
    most: int | None = None,
) -> Runs:
    """Return runs with as many copies at once as fit the heated area (mm).

    ``bounds`` are those of one copy. ``margin`` mm of base plate surround all copies; the plate may
    lie in either orientation on the platen. If ``most`` limits the copies per cycle, the cycles are
    as equal as possible, since each place costs holes in the plate.

    Copies are equal layer by layer, so every place of the press holds the same films at every
    height: the paper (Sec. 2) splits pressing if stacks of different cuts would share the pressure
    unevenly. Different designs are therefore never pressed together.
    """
    low_x, low_y, high_x, high_y = bounds
    size = high_x - low_x, high_y - low_y
    room = platen[0] - 2 * margin, platen[1] - 2 * margin
    grids = [_grid(room, size), _grid((room[1], room[0]), size)]
    # A copy larger than the heated area fails press-fit, or is waived: press one at a time.
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
    """Return a laminate's press runs on one base plate."""
    margin = PLATE_MARGIN if laminate.pins else 0.0
    return press_runs(copies, laminate.bounds, platen, margin, most)


def design_runs(design: Design, laminate: Laminate) -> Runs:
    """Return the runs of a design's order."""
    order, most = design.order, design.order.at_once
    if most is None:
        # As many as one person makes in a cycle. Minutes that are not stated count as 0.
        timed = not films_without_minutes(laminate, design.press.timed_films)
        parts = press_steps(laminate) if timed else ()
        pressing = sum([minutes_closed(design.press, part.name) or 0.0 for part in parts], 0.0)
        by_hand = (60 * CYCLE_HOURS - pressing) / HANDLING_MINUTES
        most = max(1, math.floor(by_hand + ROUNDING))
    return runs_of(laminate, order.quantity, design.press.platen, most)


def _grid(room: tuple[float, float], size: tuple[float, float]) -> tuple[int, int]:
    """Return columns and rows."""
    columns, rows = (
        max(0, math.floor((most + APART + ROUNDING) / (side + APART)))
        for most, side in zip(room, size, strict=True)
    )
    return columns, rows


class BatchTimes(NamedTuple):
    """The minutes of a batch: in the press, by hand, and both in sequence; None if not stated."""

    press: float | None
    hands: float | None

    @property
    def total(self) -> float | None:
        if self.press is None or self.hands is None:
            return None
        return self.press + self.hands


def batch_times(runs: Runs, plan: Schedule) -> BatchTimes:
    """Return the times of a batch: the press closes once per cycle; every copy needs the full hand
    work.

    Hand work while the press is closed is not subtracted.
    """
    pressed = plan.total_press_minutes
    return BatchTimes(
        None if pressed is None else runs.count * pressed,
        runs.copies * HANDLING_MINUTES if plan.is_timed else None,
    )


def most_together(laminate: Laminate, platen: tuple[float, float]) -> int:
    """Return the largest number of copies in one cycle."""
    return runs_of(laminate, 10_000, platen).together


class PatternEntry(Document):
    """Layers of one shape: their number in each copy, and in each cycle."""

    pattern: str
    each: int
    cycles: list[int]


class BatchEntry(Document):
    """A batch of several copies."""

    copies: int
    at_once: int = attribute("together")
    at_once_at_most: int
    cycles: list[int]
    """copies pressed in each cycle"""
    serials: list[str]
    """cycle and place of each copy"""
    places_mm: list[tuple[PlainNumber, PlainNumber]] = attribute("places")
    press_minutes: PlainNumber | None
    hands_minutes: PlainNumber | None
    total_minutes: PlainNumber | None
    patterns: list[PatternEntry]


def batch_entry(design: Design, laminate: Laminate, schedule: Schedule) -> BatchEntry:
    """Return the entry of ``press.json`` for a batch of several copies."""
    runs = design_runs(design, laminate)
    times = batch_times(runs, schedule)
    patterns = laminate.patterns.items()
    return BatchEntry.read(
        runs,
        at_once_at_most=most_together(laminate, design.press.platen),
        serials=[serial(runs, n + 1, design.order.batch) for n in range(runs.copies)],
        press_minutes=times.press,
        hands_minutes=times.hands,
        total_minutes=times.total,
        patterns=[
            {"pattern": name, "each": len(of), "cycles": [len(of) * n for n in runs.cycles]}
            for name, of in patterns
        ],
    )
