"""Several copies on one traveller: the press cycles by day, the plate's places, serials."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from sbafab.cutting.fixture import whole_plate
from sbafab.design.identity import cure_hours
from sbafab.geometry.region import coord
from sbafab.pressing.cycles import Runs, batch_times, cycle_name, most_together, serial
from sbafab.pressing.work_plan import (
    CONNECT_MINUTES,
    CUT_SHARE,
    OPEN_SHARE,
    SORT_SHARE,
    TUBES_SHARE,
    UNPIN_SHARE,
    PlanEntry,
    clock,
    plan_times,
    serials,
    shop_of,
    work_plan,
)
from sbafab.reports import drawing as draw
from sbafab.reports.plan_svg import WIDTH, day_strips, legend
from sbafab.reports.traveller import units
from sbafab.reports.traveller.job import Action, Work
from sbafab.reports.traveller.shapes import Picture, flat, label, pattern_id

WIDEST = 110.0
"""mm of the page that the platen takes."""
MOST_DAYS = 15
"""Days whose charts are drawn on the page; plan.svg has them all."""


PAUSES = (
    "The work may pause between any two rows, and after each laminate of a row of cutting, "
    "sorting, tubes or tests. It may not pause from the first layer of a step until the press is "
    "opened: loose films move. Only cooling and curing go on after the shift."
)


SORTING = (
    "tray.pdf, printed at 100 %, has an outline for every part of each place, in the order of "
    "laying: lay the parts out on it before a cycle, and a wrong or missing one shows. tray.html "
    "has this table with pictures, for a phone beside the tray."
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
    """The serial of a copy, and the cycle and the place in which it is pressed, from 1."""

    copy: int
    serial: str
    cycle: str
    place: int


@dataclass(frozen=True)
class PlanRow:
    """Work that is done in one go; ``day`` and ``span`` stand beside the first row of a day."""

    day: int
    span: int
    start: str
    end: str
    who: str
    work: str
    laminates: str
    minutes: str


@dataclass(frozen=True)
class BatchPage:
    """The section on a batch. Cycles of one size share a column of the counts."""

    at_once: int
    cycles: int
    summary: str
    why: str
    picture: str
    charts: tuple[str, ...]
    plan: tuple[PlanRow, ...]
    plan_basis: str
    pauses: str
    identity: tuple[Action, ...]
    sorting: str
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
    entries = work_plan(work.design, work.laminate, work.schedule, work.job.copies)
    return BatchPage(
        runs.together,
        runs.count,
        _summary(work, runs),
        "Copies are alike layer by layer and share the pressure evenly (ours: the paper does not "
        f"say how many it pressed at once).{lesser}",
        _picture(work, runs),
        tuple(_charts(work, entries)),
        _plan(work, entries),
        _plan_basis(work),
        PAUSES,
        _identity(work),
        SORTING if work.design.order.tray is not False else "",
        tuple(cycles_of(runs, size) for size in sizes),
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
            CopyRow(
                copy,
                serial(runs, copy, work.design.order.batch),
                cycle_name(runs.position(copy)[0]),
                runs.position(copy)[1],
            )
            for copy in range(1, runs.copies + 1)
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


def _charts(work: Work, entries: Sequence[PlanEntry]) -> Iterator[str]:
    """Yield a chart of each day; none for a plan of more days than a reader turns pages for."""
    days = max((entry.day for entry in entries), default=0)
    if not entries or days > MOST_DAYS:
        return
    strips = [*day_strips(entries, shop_of(work.design))]
    for day, height, elements in strips:
        room = 4.0 if day == strips[-1][0] else 0.0
        words = f"day {day}: who and what is busy when"
        picture = Picture(f"plan-day-{day}", WIDTH, height + room, words)
        picture.add(*elements)
        if room:
            picture.add(*legend(entries, (1.0, height + 0.5)))
        yield picture.svg()


def _plan(work: Work, entries: Sequence[PlanEntry]) -> tuple[PlanRow, ...]:
    """Return the work of every day that takes hands, in its order."""
    hands = [entry for entry in entries if entry.technician]
    closings = {(e.cycle, e.step): e for e in entries if e.task == "press"}
    days = [entry.day for entry in hands]
    return tuple(
        PlanRow(
            entry.day,
            days.count(entry.day) if number == days.index(entry.day) else 0,
            clock(entry.start),
            clock(entry.end),
            str(entry.technician),
            _task(work, entry, closings.get((entry.cycle, entry.step))),
            serials(work.runs, entry.copies, work.design.order.batch),
            f"{entry.minutes:.0f}",
        )
        for number, entry in enumerate(hands)
    )


def _task(work: Work, entry: PlanEntry, closing: PlanEntry | None) -> str:
    """Return what a row of the plan is, with press and plate where there are several."""
    shop = shop_of(work.design)
    plate = f" {entry.plate}" if shop.plates > 1 else ""
    press = f" {closing.press}" if closing is not None and shop.presses > 1 else ""
    trim = "trim, " if work.laminate.registration == "ears" else ""
    words = {
        "cut": "Cut: this share of all sheets",
        "sort": "Wipe and sort the parts: this share",
        "lay": f"lay up on plate{plate}, close press{press}",
        "open": f"open press{press}, plate{plate} out to cool",
        "unpin": f"take down from plate{plate}, each to its place in the tray",
        "tubes": f"{trim}fit the tubes",
        "test": "leak and proof tests",
    }[entry.task]
    step = f", step {entry.step}" if entry.step else ""
    return f"{cycle_name(entry.cycle)}{step}: {words}" if entry.cycle else words


def _platen(work: Work) -> tuple[float, float]:
    return work.design.press.platen_width, work.design.press.platen_length


def _plan_basis(work: Work) -> str:
    """Return how far the plan can be trusted, or why there is none."""
    if work.schedule.total_press_minutes is None:
        return (
            "No plan: nobody stated the minutes in the press for this film. Tell the designer once "
            "they are known."
        )
    if not work.schedule.steps:
        return "No plan: nothing is pressed, and nobody stated how fast the seams are made."
    order, shop = work.design.order, shop_of(work.design)
    times = plan_times(work.design, work.laminate, work.schedule)
    holds = most_together(work.laminate, _platen(work))
    at_press = 1 - CUT_SHARE - SORT_SHARE - TUBES_SHARE
    cure = "the kit's" if cure_hours(work.design) else "ours: read its package"
    cure = "as ordered" if order.cure_hours else cure
    cool = "measured" if work.design.press.cool_minutes else "an estimate"
    warm = "measured" if work.schedule.heating.time_constant_minutes else "an estimate"
    resources = (
        units.count(shop.technicians, "technician"),
        units.count(shop.presses, "press", "presses"),
        units.count(shop.plates, "base plate"),
        "one laser",
    )
    return (
        f"{', '.join(resources)}, shifts of {order.shift_hours:g} h; if it is otherwise, tell the "
        "designer. A cycle takes no more copies than one person makes in such a shift (the plate "
        f"has room for {holds}). All sheets are cut and sorted first, as the parts of all cycles "
        "lie on them. The minutes are estimates: {times.hands:g} of handling "
        f"for each copy, the paper's total less its time in the press"
        f"{'' if work.schedule.is_timed else ' (nobody has timed drawn layers)'}; of these "
        f"{CUT_SHARE:.1%} at the laser, {SORT_SHARE:.1%} to wipe and sort, {TUBES_SHARE:.0%} for "
        f"the tubes, {at_press:.0%} at the press ({OPEN_SHARE:.0%} of that to open it, "
        f"{UNPIN_SHARE:.0%} to take down, the rest to lay up, in proportion to the parts of each "
        f"step; all shares ours). Each step warms {times.warm:g} min before its clock ({warm}) and "
        f"cools {times.cool:g} min ({cool}). Adhesive: {times.cure / 60:g} h ({cure}). Tests: "
        f"{times.test:g} min a copy, {CONNECT_MINUTES:g} of them a tube to connect it (ours). "
        "Weekends are not in it. Write the actual minutes beside each row."
    )


def _identity(work: Work) -> tuple[Action, ...]:
    """Return how each laminate is identified from one step to the next."""
    lining = "a drawing of the places above, with their numbers"
    if work.job.underlay is not None:
        lining = f"one more print of {work.job.underlay}, which has the places' numbers"
    first, last = (serial(work.runs, n, work.design.order.batch) for n in (1, work.runs.copies))
    return (
        Action(
            "A laminate has one serial from tray to tube: the letter of its cycle and the number "
            f"of its place, {first} to {last}. Its place is the same on the plate and in the tray; "
            "the test bench and sbafab record take the serial. Nothing that is pressed carries a "
            "label: at the press temperature ink and paper would go into the bond."
        ),
        Action(
            f"Line a flat tray for each cycle with {lining}, and write the cycle's letter on it. "
            "After every step take the laminates off the plate one at a time, each straight to its "
            "number in the tray, the same side up. Stacks of one number that are not yet bonded "
            "lie on each other with paper between."
        ),
        Action(
            "In the next step each goes back to the place of its number. One whose number is lost "
            "may be pressed with the others, as all are equal: write “place lost” in its row."
        ),
        Action(
            "After the last step they stay in the tray until their tubes are fitted. Then put a "
            "flag of tape with the serial round a tube: it stays on at the test bench and after."
        ),
    )


def cycles_of(runs: Runs, size: int) -> str:
    """Return the names of the cycles of a size, in words."""
    numbers = [n for n, copies in enumerate(runs.cycles, 1) if copies == size]
    first, last = cycle_name(numbers[0]), cycle_name(numbers[-1])
    if len(numbers) == 1:
        return f"Cycle {first} ({size})"
    return f"Cycles {first} to {last}, each ({size})"


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
