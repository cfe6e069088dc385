"""Several copies on one traveller: the press cycles by day, the plate's places, serials."""

from __future__ import annotations

from dataclasses import dataclass

from sbafab.cutting.fixture import whole_plate
from sbafab.geometry.region import coord
from sbafab.pressing.cycles import (
    CUT_SHARE,
    FINISH_SHARE,
    Entry,
    Runs,
    batch_times,
    most_together,
    working_days,
)
from sbafab.reports import drawing as draw
from sbafab.reports.traveller import units
from sbafab.reports.traveller.job import Action, Work
from sbafab.reports.traveller.shapes import Picture, flat, label, pattern_id

WIDEST = 110.0
"""mm of the page that the platen takes."""


PAUSES = (
    "The work may pause between any two rows, within cutting after any sheet, and within the tubes "
    "after any laminate. It may not pause from the first layer of a step to the end of its "
    "pressing: loose films move."
)


@dataclass(frozen=True)
class PatternRow:
    """The count of a pattern at one place, and in each kind of cycle."""

    pattern: str
    material: str
    each: int
    counts: tuple[int, ...]


@dataclass(frozen=True)
class CopyRow:
    """The cycle and the place in which a copy is pressed; all numbers count from 1."""

    copy: int
    cycle: int
    place: int


@dataclass(frozen=True)
class PlanRow:
    """Work that is done in one go; ``day`` and ``span`` stand beside the first row of a day."""

    day: int
    span: int
    start: str
    end: str
    work: str
    copies: str
    minutes: str


@dataclass(frozen=True)
class BatchPage:
    """The section on a batch. Cycles of one size share a column of the counts."""

    at_once: int
    cycles: int
    summary: str
    why: str
    picture: str
    plan: tuple[PlanRow, ...]
    plan_basis: str
    pauses: str
    identity: tuple[Action, ...]
    cycle_names: tuple[str, ...]
    patterns: tuple[PatternRow, ...]
    copies: tuple[CopyRow, ...]


def batch_page(work: Work) -> BatchPage | None:
    """Return the batch of a design; None for a single copy."""
    runs = work.runs
    if runs.copies == 1:
        return None
    lesser = (
        " A smaller last cycle shares the same force: its films get somewhat more pressure."
        if len(set(runs.cycles)) > 1
        else ""
    )
    sizes = tuple(dict.fromkeys(runs.cycles))
    return BatchPage(
        runs.together,
        runs.count,
        _summary(work, runs),
        "Copies are alike layer by layer and share the pressure evenly (ours: the paper does not "
        f"say how many it pressed at once).{lesser}",
        _picture(work, runs),
        _plan(work),
        _plan_basis(work),
        PAUSES,
        _identity(work),
        tuple(_name(runs, size) for size in sizes),
        tuple(
            PatternRow(
                pattern,
                layers[0].film.material,
                len(layers),
                tuple(len(layers) * size for size in sizes),
            )
            for pattern, layers in work.laminate.patterns.items()
        ),
        tuple(
            CopyRow(n + 1, n // runs.together + 1, n % runs.together + 1)
            for n in range(runs.copies)
        ),
    )


def _summary(work: Work, runs: Runs) -> str:
    times, single = batch_times(runs, work.schedule), work.schedule.total_press_minutes
    cycles = units.count(runs.count, "press cycle")
    sizes = ", ".join(str(size) for size in dict.fromkeys(runs.cycles))
    why = f" {work.design.order.why}" if work.design.order.why else ""
    return (
        f"{runs.copies} copies in {cycles} of {sizes} at once: {units.plain(times.press)} min in "
        f"the press instead of {units.plain(units.product(runs.copies, single))}.{why}"
    )


def _plan(work: Work) -> tuple[PlanRow, ...]:
    """Return the work of every day, in its order."""
    entries = working_days(work.design, work.laminate, work.schedule, work.job.copies)
    days = [entry.day for entry in entries]
    return tuple(
        PlanRow(
            entry.day,
            days.count(entry.day) if number == days.index(entry.day) else 0,
            units.clock(entry.start),
            units.clock(entry.start + entry.minutes),
            _task(work, entry),
            _copies(entry),
            f"{entry.minutes:.0f}",
        )
        for number, entry in enumerate(entries)
    )


def _task(work: Work, entry: Entry) -> str:
    if entry.task == "cut":
        return "Cut all sheets, wipe and sort the parts"
    if entry.task == "finish":
        trim = "trim, " if work.laminate.registration == "ears" else ""
        return f"Cycle {entry.cycle}: {trim}fit the tubes"
    return f"Cycle {entry.cycle}: lay up and press step {entry.step}"


def _copies(entry: Entry) -> str:
    first, last = entry.copies
    return str(first) if first == last else f"{first} to {last}"


def _platen(work: Work) -> tuple[float, float]:
    return work.design.press.platen_width, work.design.press.platen_length


def _plan_basis(work: Work) -> str:
    """Return how far the plan can be trusted, or why there is none."""
    if work.schedule.total_press_minutes is None:
        return (
            "No plan: nobody stated the minutes in the press for this film (press.minutes_for). "
            "Generate again once they are known."
        )
    if not work.schedule.steps:
        return "No plan: nothing is pressed, and nobody stated how fast the seams are made."
    by_hand, hours = work.schedule.hands_minutes, work.design.order.shift_hours
    platen = _platen(work)
    holds = most_together(work.laminate, platen)
    entries = working_days(work.design, work.laminate, work.schedule, work.job.copies)
    pressing = {entry.day for entry in entries if entry.task == "press"}
    spare = 60 * hours - max(e.start + e.minutes for e in entries if e.day in pressing)
    return (
        f"One person, one press, shifts of {hours:g} h (order.shift_hours); a cycle takes no more "
        f"copies than such a shift makes (the plate has room for {holds}), and its press steps end "
        "on the day on which they begin, where they fit into one. The minutes are estimates: "
        f"{by_hand:g} of handling for each copy, the paper's total less its time in the press; of "
        f"these {CUT_SHARE:.0%} for cutting, {FINISH_SHARE:.0%} for the tubes and the rest for the "
        "steps, in proportion to the parts that each lays (ours). Not included: warming and "
        "cooling the plate in every press step (blanks in Before the day), for which the fullest "
        f"day with a press step has {units.clock(max(0.0, spare))} left, curing, leak and proof "
        "tests. Write the actual minutes beside each row."
    )


def _identity(work: Work) -> tuple[Action, ...]:
    """Return how each laminate is identified from one step to the next."""
    lining = "a drawing of the places above, with their numbers"
    if work.job.underlay is not None:
        lining = f"one more print of {work.job.underlay}, which has the places' numbers"
    return (
        Action(
            "A laminate is identified by its cycle and its place; the table below gives its copy "
            "number. Nothing that is pressed carries a label: at the press temperature ink and "
            "paper would go into the bond."
        ),
        Action(
            f"Line a flat tray with {lining}. After every step take the laminates off the plate "
            "one at a time, each straight to its number in the tray, the same side up. Stacks of "
            "one number that are not yet bonded lie on each other with paper between."
        ),
        Action(
            "In the next step each goes back to the place of its number. One whose number is lost "
            "may be pressed with the others, as all are equal: write “place lost” in its row."
        ),
        Action(
            "After the last step they stay in the tray until their tubes are fitted. Then put a "
            "flag of tape with the copy number round a tube, and write the serial number in the "
            "table."
        ),
    )


def _name(runs: Runs, size: int) -> str:
    numbers = [n for n, copies in enumerate(runs.cycles, 1) if copies == size]
    if len(numbers) == 1:
        return f"Cycle {numbers[0]} ({size})"
    return f"Cycles {numbers[0]} to {numbers[-1]}, each ({size})"


def _picture(work: Work, runs: Runs) -> str:
    """Return the places on the base plate, numbered as they are laid."""
    laminate = work.laminate
    plate = whole_plate(laminate, _platen(work), runs.places)
    low_x, low_y, high_x, high_y = plate.bounds
    wide, high = high_x - low_x, high_y - low_y
    scale = WIDEST / max(wide, high)
    at = 1 - scale * low_x, 1 + scale * high_y
    words = f"{runs.together} places on the base plate, from above"
    picture = Picture("batch-plan", scale * wide + 2, scale * high + 8, words)
    picture.plate(plate, flat(scale, at))
    widest = max(laminate.layers, key=lambda layer: layer.profile.area)
    box = laminate.bounds
    for place, (x, y) in enumerate(runs.places, 1):
        moved = at[0] + scale * x, at[1] - scale * y
        picture.part(pattern_id(widest.pattern), widest.film, flat(scale, moved), "clear")
        size = min(3.2, 0.4 * scale * min(box[2] - box[0], box[3] - box[1]))
        middle = (box[0] + box[2]) / 2, (box[1] + box[3]) / 2
        spot = moved[0] + scale * middle[0], moved[1] - scale * middle[1] + size / 3
        picture.add(label(spot, str(place), size))
    size_words = f"{coord(round(wide, 6))} x {coord(round(high, 6))} mm"
    caption = (
        f"base plate and heated area, {size_words}, from above; the cut corner at the back right"
    )
    picture.add(draw.text((1.0, scale * high + 6), caption, size=2.2))
    return picture.svg()
