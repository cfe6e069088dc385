"""The base plate and its accessories: holes, pins, build-up, pad and release films."""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

from sbafab.cutting.fixture import plate_corner, whole_plate
from sbafab.laminate.films import FIRST
from sbafab.laminate.laminate import Pin
from sbafab.pressing.build_up import BASE_PLATE, PAD, RELEASE, UNDERLAY, pad_sheets
from sbafab.pressing.dowels import PinHole, pin_holes, push_out
from sbafab.pressing.schedule import (
    Schedule,
    Step,
    joined_words,
)
from sbafab.reports.traveller import units
from sbafab.reports.traveller.job import Work

MOST_LISTED = 9
"""Up to this many places of a plate each is listed."""


class PlateHole(NamedTuple):
    """A row of the hole table, mm: from the plate's front left corner, and from the datum."""

    pin: str
    diameter: float
    x: float
    y: float
    from_datum: tuple[float, float]
    films: float
    depth: str
    push_out: str
    lengths: str


class PlatePlace(NamedTuple):
    """A further place of the plate: the shift of its holes from the first place's, mm."""

    place: int
    x: float
    y: float


def places(work: Work) -> list[PlatePlace]:
    """Return all places of the plate but the first."""
    return [PlatePlace(n, x, y) for n, (x, y) in enumerate(work.runs.places[1:], 2)]


def grid(work: Work) -> str:
    """Return the places of a full plate in one sentence; empty if a short list names them."""
    every = work.runs.places
    if len(every) <= MOST_LISTED:
        return ""
    xs, ys = (sorted({place[axis] for place in every}) for axis in (0, 1))
    right, back = ((steps[1] - steps[0] if len(steps) > 1 else 0.0) for steps in (xs, ys))
    return (
        f"All {len(every)} places have the same holes. They lie in rows of {len(xs)}: from one "
        f"place to the next {right:.3f} mm to the right, from one row to the next {back:.3f} mm to "
        f"the back; the picture of the plate numbers them, and {work.job.fixture} has every hole."
    )


def holes(work: Work) -> list[PlateHole]:
    """Return every hole of the plate's first place; ``films`` are the holes' diameters in films."""
    laminate, press = work.laminate, work.design.press
    platen = press.platen
    corner_x, corner_y = plate_corner(laminate, platen, work.runs.places)
    pins = _pin_holes(work.schedule)
    return [
        PlateHole(
            pin.name,
            pin.diameter,
            pin.centre[0] - corner_x,
            pin.centre[1] - corner_y,
            pin.centre,
            pin.hole,
            *_sizes(pins.get(pin.name)),
        )
        for pin in laminate.pins
    ]


def size(work: Work) -> str:
    """Return the base plate's size as text."""
    press = work.design.press
    low_x, low_y, high_x, high_y = whole_plate(work.laminate, press.platen, work.runs.places).bounds
    return units.size(high_x - low_x, high_y - low_y)


def _sizes(hole: PinHole | None) -> tuple[str, str, str]:
    """Return depth, push-out hole and pins of a hole, as in the table."""
    if hole is None:
        return "not used", "", ""
    lengths = joined_words([f"{length:g}" for length in hole.lengths])
    return f"{hole.depth:g} ± {hole.tolerance:g}", f"{hole.push_out:g}", f"{lengths} mm"


def _pin_holes(plan: Schedule) -> dict[str, PinHole]:
    return pin_holes([step.pin_settings for step in plan.steps])


def has_underlay(step: Step) -> bool:
    return any(item.part == UNDERLAY for item in step.build_up)


def hot_prints(work: Work) -> int:
    """Return the number of underlay prints in the closed press, over all cycles."""
    return work.runs.count * sum(has_underlay(step) for step in work.schedule.steps)


def prints(work: Work) -> int:
    """Return the number of underlay prints needed: one per hot closing, one per tray."""
    return hot_prints(work) + trays(work)


def trays(work: Work) -> int:
    """Return the number of trays for films between steps: one per cycle of several laminates."""
    return work.runs.count if work.runs.together > 1 else 0


def release_films(work: Work) -> int:
    """Return the release films for all cycles: two new ones each time the press closes on a step,
    and one for films that are turned over.
    """
    return 2 * work.runs.count * len(work.schedule.steps) + turns_over(work)


def turns_over(work: Work) -> bool:
    """Return True if films are turned over, so that their pins can be pushed out."""
    return any(step.pin_settings for step in work.schedule.steps)


RELEASE_FILM = "Release film"


def items(work: Work) -> list[tuple[str, str, str, int]]:
    """Return rows of the bill of materials: name, specification, quantity as text and as number."""
    laminate, plan = work.laminate, work.schedule
    if not plan.steps:
        return []
    first = plan.steps[0]
    thick = {item.part: item for item in first.build_up}
    size = units.size(*first.platen_mm)
    plate, pad, release = thick[BASE_PLATE], thick[PAD], thick[RELEASE]
    sheets = pad_sheets(pad.thickness_mm)
    piled = f", a pile of {sheets} sheets" if sheets > 1 else ""
    turned = "; one of them for films that are turned over" if turns_over(work) else ""
    holes = (
        f"; stepped holes from {work.job.fixture} and the table in bench.html"
        if work.job.fixture is not None
        else "; no holes"
    )
    has_no_tpe = all(layer.film.material != FIRST[0] for layer in laminate.layers)
    return [
        *_pin_items(
            laminate.pins * work.runs.together,
            plan,
            work.design.registration.pin_standard,
        ),
        (
            "Base plate",
            f"{plate.material}, {units.millimetres(plate.thickness_mm)}, {size}{holes}",
            "1",
            1,
        ),
        (
            RELEASE_FILM,
            f"{release.material}, {units.millimetres(release.thickness_mm)}, {size}; "
            f"{'films' if has_no_tpe else 'TPE'} must not stick to it at press temperature "
            f"(our advice; the paper names none){turned}",
            str(release_films(work)),
            release_films(work),
        ),
        (
            "Press pad",
            f"{pad.material}, {units.millimetres(pad.thickness_mm)}{piled}, {size}, for "
            f"{first.temperature_c:g} °C in continuous use (our advice; the paper names none)",
            str(sheets),
            sheets,
        ),
    ]


def _pin_items(
    pins: tuple[Pin, ...], plan: Schedule, standard: str
) -> list[tuple[str, str, str, int]]:
    holes = _pin_holes(plan)
    sizes = Counter(
        (pin.diameter, length)
        for pin in pins
        if pin.name in holes
        for length in holes[pin.name].lengths
    )
    return [
        (
            "Dowel pins",
            f"{standard}, ⌀{units.millimetres(diameter)} m6, {units.millimetres(length)} long; "
            "spares to choose from",
            f"{number} + {max(2, number // 2)} spare",
            number + max(2, number // 2),
        )
        for (diameter, length), number in sorted(sizes.items())
    ]


TAPE = "polyimide tape (silicone adhesive, rated 260 °C)"


PUNCH_PLAY = 0.1
"""Difference in mm between the push-out hole and the punch."""


def punch(diameter: float) -> float:
    """Return the diameter of the punch for pins of this diameter, mm."""
    return round(push_out(diameter) - PUNCH_PLAY, 2)
