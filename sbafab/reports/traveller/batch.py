"""Several copies: places on the plate, counts for each press cycle, serials, and tray.html."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sbafab.cutting.fixture import whole_plate
from sbafab.geometry.region import coord
from sbafab.pressing.cycles import CYCLE_HOURS, Runs, cycle_name, most_together, serial
from sbafab.reports import drawing as draw
from sbafab.reports.traveller.formatting import SHORT_HASH, render
from sbafab.reports.traveller.materials import Cut, cut_list
from sbafab.reports.traveller.pictures import (
    Picture,
    definitions,
    flat,
    pattern_id,
    pattern_regions,
)
from sbafab.reports.traveller.work import Work

WIDEST = 110.0
"""Width of the platen's picture on the page, mm."""
MOST_CYCLES = 6
"""Up to this many cycles each has a box on tray.html; otherwise cycles of one size share one."""


def batch_page(work: Work) -> dict[str, Any] | None:
    """Return the batch of a design; None for a single copy. Cycles of one size share a column.

    ``copies`` have number, serial, cycle and place in the press, from 1.
    """
    runs, batch = work.cycles, work.design.order.batch
    if runs.copies == 1:
        return None
    sizes = list(dict.fromkeys(runs.cycles))
    return {
        "sizes": sizes,
        "room": most_together(work.laminate, work.design.press.platen),
        "cycle_hours": CYCLE_HOURS,
        "picture": _picture(work, runs),
        "cycle_names": [cycles_of(runs, size) for size in sizes],
        "patterns": work.laminate.patterns,
        "copies": [
            (copy, serial(runs, copy, batch), cycle_name(cycle), place)
            for copy in range(1, runs.copies + 1)
            for cycle, place in [runs.position(copy)]
        ],
    }


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
    plate = whole_plate(laminate, work.design.press.platen, runs.places)
    low_x, low_y, high_x, high_y = plate.bounds
    wide, high = high_x - low_x, high_y - low_y
    scale = WIDEST / max(wide, high)
    at = 1 - scale * low_x, 1 + scale * high_y
    words = f"{runs.together} places on the base plate, from above"
    picture = Picture("batch-plan", scale * wide + 2, scale * high + 8, words)
    picture.plate(plate, flat(scale, at))
    widest = max(laminate.layers, key=lambda layer: layer.profile.area)
    box = laminate.bounds
    size = min(3.2, 0.4 * scale * min(box[2] - box[0], box[3] - box[1]))
    middle = (box[0] + box[2]) / 2, (box[1] + box[3]) / 2
    for place, (x, y) in enumerate(runs.places, 1):
        moved = at[0] + scale * x, at[1] - scale * y
        picture.part(pattern_id(widest.pattern), widest.film, flat(scale, moved), "clear")
        spot = moved[0] + scale * middle[0], moved[1] - scale * middle[1] + size / 3
        picture.label(spot, str(place), size)
    plate_size = f"{coord(round(wide, 6))} x {coord(round(high, 6))} mm"
    caption = (
        f"base plate and heated area, {plate_size}, from above; the cut corner at the back right"
    )
    picture.add(draw.text((1.0, scale * high + 6), caption, size=2.2))
    return picture.svg()


def tray_html(work: Work) -> str:
    """Return tray.html: the patterns with their counts, for a phone beside the tray."""
    laminate, runs = work.laminate, work.cycles
    cycles = [(f"Cycle {cycle_name(n)}", size) for n, size in enumerate(runs.cycles, 1)]
    if len(cycles) > MOST_CYCLES:
        cycles = [(cycles_of(runs, size), size) for size in dict.fromkeys(runs.cycles)]
    cards: Sequence[tuple[Cut, int]] = [
        (cut, len(laminate.patterns[cut.pattern])) for cut in cut_list(work)
    ]
    return render(
        "tray.html.j2",
        name=laminate.name,
        short_hash=work.sha256[:SHORT_HASH],
        shapes=definitions(pattern_regions(laminate)),
        runs=runs,
        cycles=cycles,
        cards=cards,
    )
