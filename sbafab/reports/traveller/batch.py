"""Several copies on one traveller: the press cycles, the plate with its places, a serial each."""

from __future__ import annotations

from dataclasses import dataclass

from sbafab.cutting.fixture import whole_plate
from sbafab.geometry.svg import number, path_data
from sbafab.pressing.together import Runs, batch_times
from sbafab.reports import drawing as draw
from sbafab.reports.traveller import quantities as say
from sbafab.reports.traveller.job import Work
from sbafab.reports.traveller.shapes import Picture, flat, label, pattern_id

WIDEST = 110.0
"""mm of the page that the platen takes."""
PLATE = "#f1f1ef"


@dataclass(frozen=True)
class PatternRow:
    """How many of a pattern one place takes, and each kind of cycle."""

    pattern: str
    material: str
    each: int
    counts: tuple[int, ...]


@dataclass(frozen=True)
class CopyRow:
    """Where a copy is pressed; all numbers count from 1."""

    copy: int
    cycle: int
    place: int


@dataclass(frozen=True)
class BatchPage:
    """What the page says of a batch. Cycles of one size share a column of the counts."""

    at_once: int
    cycles: int
    said: str
    why: str
    picture: str
    cycle_names: tuple[str, ...]
    patterns: tuple[PatternRow, ...]
    copies: tuple[CopyRow, ...]


def batch_page(work: Work) -> BatchPage | None:
    """The batch of a design; None for a single copy."""
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
        _said(work, runs),
        "Copies are alike layer by layer and share the pressure evenly (ours: the paper does not "
        f"say how many it pressed at once).{lesser}",
        _picture(work, runs),
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


def _said(work: Work, runs: Runs) -> str:
    times, one = batch_times(runs, work.schedule), work.schedule.total_press_minutes
    cycles = say.count(runs.count, "press cycle")
    sizes = ", ".join(str(size) for size in dict.fromkeys(runs.cycles))
    return (
        f"{runs.copies} copies in {cycles} of {sizes} at once: {say.plain(times.press)} min in the "
        f"press instead of {say.plain(say.product(runs.copies, one))}."
    )


def _name(runs: Runs, size: int) -> str:
    numbers = [n for n, own in enumerate(runs.cycles, 1) if own == size]
    if len(numbers) == 1:
        return f"Cycle {numbers[0]} ({size})"
    return f"Cycles {numbers[0]} to {numbers[-1]}, each ({size})"


def _picture(work: Work, runs: Runs) -> str:
    """The places on the base plate, numbered as they are laid."""
    laminate = work.laminate
    plate = whole_plate(laminate, work.schedule.steps[0].platen_mm, runs.places)
    low_x, low_y, high_x, high_y = plate.bounds
    wide, high = high_x - low_x, high_y - low_y
    scale = WIDEST / max(wide, high)
    at = 1 - scale * low_x, 1 + scale * high_y
    words = f"{runs.together} places on the base plate, from above"
    picture = Picture("batch-plan", scale * wide + 2, scale * high + 8, words)
    shape = path_data(
        plate.mapped(lambda p: (at[0] + scale * p[0], at[1] - scale * p[1]), scale, mirror=True)
    )
    picture.add(
        f'<path d="{shape}" fill="{PLATE}" fill-rule="evenodd" stroke="{draw.GREY}" '
        'stroke-width="0.25"/>'
    )
    widest = max(laminate.layers, key=lambda layer: layer.profile.area)
    box = laminate.bounds
    for place, (x, y) in enumerate(runs.places, 1):
        moved = at[0] + scale * x, at[1] - scale * y
        picture.part(pattern_id(widest.pattern), widest.film, flat(scale, moved), "clear")
        size = min(3.2, 0.4 * scale * min(box[2] - box[0], box[3] - box[1]))
        middle = (box[0] + box[2]) / 2, (box[1] + box[3]) / 2
        spot = moved[0] + scale * middle[0], moved[1] - scale * middle[1] + size / 3
        picture.add(label(spot, str(place), size))
    size_said = f"{number(round(wide, 6))} x {number(round(high, 6))} mm"
    said = f"base plate and heated area, {size_said}, from above; the cut corner at the back right"
    picture.add(draw.text((1.0, scale * high + 6), said, size=2.2))
    return picture.svg()
