"""What the press's gauge and a pressure-indicating film must resolve."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from sbafab.pressing.words import listed
from sbafab.reports.traveller import quantities as say
from sbafab.reports.traveller.job import Work


class FilmClass(NamedTuple):
    """A class of pressure-indicating film: its name, its product, and its range in kPa."""

    name: str
    product: str
    low: float
    high: float


FILM_CLASSES = (
    FilmClass("extreme low pressure", "4LW", 50, 200),
    FilmClass("ultra super low pressure", "LLLW", 200, 600),
    FilmClass("super low pressure", "LLW", 500, 2500),
)
"""Two-sheet films of Fujifilm Prescale, by the ranges that its maker lists as far as we know: the
list was not opened, so the page has them compared with the box."""
COLD = "once, cold, to find the pressure; compare its range with the box"
WANTED = 0.05
"""Share to which a gauge should set the pressure: ours."""


def pressure_range(works: Sequence[Work]) -> tuple[float, float]:
    """Return the least and the largest pressure in kPa that any place of the films gets."""
    steps = [step for work in works for step in work.schedule.steps]
    low = min(min(step.film_kpa, step.bond_kpa, step.plate_kpa) for step in steps)
    return low, max(max(step.edge_kpa, step.film_kpa) for step in steps)


def film_classes(low: float, high: float) -> list[FilmClass]:
    """Return the fewest classes that cover a range in kPa, as far as classes do."""
    return [one for one in FILM_CLASSES if one.low < high and one.high > low]


def film_words(works: Sequence[Work]) -> str:
    """Return which pressure-indicating film covers what the films get."""
    low, high = pressure_range(works)
    found = film_classes(low, high)
    names = listed(
        [f"{one.name} ({one.product}, {one.low:g} to {one.high:g} kPa)" for one in found]
    )
    return (
        f"pressure-indicating film for {low:.0f} to {high:.0f} kPa: Fujifilm Prescale, {names}"
        if found
        else f"pressure-indicating film for {low:.0f} to {high:.0f} kPa"
    )


def notes(work: Work) -> tuple[str, ...]:
    """Return what a reading of the press's gauge is worth on the platen."""
    step = work.schedule.steps[0]
    pound = step.pressure_kpa / step.force_n * say.NEWTONS_PER_POUND
    finest = 2 * WANTED * step.pressure_kpa / pound
    return (
        f"The gauge: {say.force(step.force_n)} is the reading, 1 lbf of it {pound:.2g} kPa. Read "
        f"to half a division, a gauge sets {step.pressure_kpa:g} kPa to {WANTED:.0%} if it has a "
        f"division every {finest:.0f} lbf ({finest * say.NEWTONS_PER_POUND:.0f} N) or finer; what "
        "the gauge of the paper's press (Carver 5420) has, we do not know. A coarser one: set the "
        "force by a load cell between the platens, cold, and mark the gauge.",
    )
