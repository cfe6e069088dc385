"""Several copies on one traveller: press cycles, the plate's places, counts and serials."""

from __future__ import annotations

from dataclasses import dataclass

from sbafab.cutting.fixture import whole_plate
from sbafab.geometry.region import coord
from sbafab.pressing.cycles import (
    CYCLE_HOURS,
    Runs,
    batch_times,
    cycle_name,
    most_together,
    serial,
)
from sbafab.reports import drawing as draw
from sbafab.reports.traveller import units
from sbafab.reports.traveller.job import Action, Work
from sbafab.reports.traveller.shapes import Picture, flat, label, pattern_id

WIDEST = 110.0
"""Width of the platen's picture on the page, mm."""


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
    """The serial of a copy, with its cycle and place in the press, from 1."""

    copy: int
    serial: str
    cycle: str
    place: int


@dataclass(frozen=True)
class BatchPage:
    """The section on a batch. Cycles of one size share a column of the counts."""

    summary: str
    why: str
    picture: str
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
    sizes = tuple(dict.fromkeys(runs.cycles))
    return BatchPage(
        _summary(work, runs),
        _cycles_basis(work, runs),
        _picture(work, runs),
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


def _cycles_basis(work: Work, runs: Runs) -> str:
    """Return why this many copies share a cycle, and where the work may pause."""
    sentences = [
        "Copies are alike layer by layer and share the pressure evenly (ours: the paper does not "
        "say how many it pressed at once)."
    ]
    if len(set(runs.cycles)) > 1:
        sentences.append(
            "A smaller last cycle shares the same force: its films get somewhat more pressure."
        )
    room = most_together(work.laminate, _platen(work))
    if runs.count > 1 and runs.together < room:
        most = work.design.order.at_once
        limit = f"one person makes in {CYCLE_HOURS:g} hours" if most is None else "ordered"
        sentences.append(f"The plate has room for {room}; a cycle takes no more than {limit}.")
    sentences.append(
        "Do not pause from the first layer of a step until the press is opened: loose films move."
    )
    return " ".join(sentences)


def _platen(work: Work) -> tuple[float, float]:
    return work.design.press.platen


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
    """Return the names of the cycles of a size as text."""
    numbers = [n for n, copies in enumerate(runs.cycles, 1) if copies == size]
    first, last = cycle_name(numbers[0]), cycle_name(numbers[-1])
    if len(numbers) == 1:
        return f"Cycle {first} ({size})"
    return f"Cycles {first} to {last}, each ({size})"


def _picture(work: Work, runs: Runs) -> str:
    """Return the places on the base plate, numbered in the order of laying."""
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
