"""The base plate and what goes with it: its holes, its pins, the pad and the release films."""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

from sbafab.cutting.fixture import plate_corner
from sbafab.laminate.laminate import Pin
from sbafab.pressing.build_up import BASE_PLATE, LAMINATE, PAD, RELEASE, pieces
from sbafab.pressing.schedule import Schedule
from sbafab.reports.traveller import quantities as say
from sbafab.reports.traveller.job import Work

MOST_LISTED = 9
"""Places of a plate up to which each is listed."""


class PlateHole(NamedTuple):
    """A row of the hole table, mm: from the plate's front left corner, and from the datum."""

    pin: str
    diameter: float
    x: float
    y: float
    from_datum: tuple[float, float]
    films: float
    length: str


class PlatePlace(NamedTuple):
    """Where a further place has its holes, mm from those of the first."""

    place: int
    x: float
    y: float


def places(work: Work) -> list[PlatePlace]:
    """All places of the plate but the first."""
    return [PlatePlace(n, x, y) for n, (x, y) in enumerate(work.runs.places[1:], 2)]


def grid(work: Work) -> str:
    """The places of a full plate in one sentence, where a list of them is too long to use."""
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
    """Every hole of the plate's first place; films have the diameter ``films`` there."""
    laminate, press = work.laminate, work.design.press
    platen = press.platen_width, press.platen_length
    corner_x, corner_y = plate_corner(laminate, platen, work.runs.places)
    lengths = _lengths(work.schedule)
    return [
        PlateHole(
            pin.name,
            pin.diameter,
            pin.centre[0] - corner_x,
            pin.centre[1] - corner_y,
            pin.centre,
            pin.hole,
            say.millimetres(lengths[pin.name]) if pin.name in lengths else "not used",
        )
        for pin in laminate.pins
    ]


def _lengths(plan: Schedule) -> dict[str, float]:
    return {pin.pin: pin.length_mm for step in plan.steps for pin in step.pin_settings}


def build_up_notes(work: Work) -> tuple[str, ...]:
    """The one build-up of all steps, and what its force means."""
    step = work.schedule.steps[-1]
    thick = {item.part: item for item in step.build_up}
    newtons, kilopascals = f"{step.force_n:.0f} N", f"{step.pressure_kpa:g} kPa"
    size = say.size(*step.platen_mm)
    plate, pad, release = thick[BASE_PLATE], thick[PAD], thick[RELEASE]
    together = work.runs.together
    alone = together * work.laminate.layers[-1].profile.area
    what = "laminate" if together == 1 else f"{together} laminates"
    return (
        "Every step has the same build-up, from the lower platen up: base plate "
        f"({plate.material}, {say.millimetres(plate.thickness_mm)}, {size}, as large as the "
        f"platen), release film ({release.material}), {LAMINATE}, release film, press pad "
        f"({pad.material}, {say.millimetres(pad.thickness_mm)}, as large as the platen), upper "
        "platen. Nothing rigid lies on the films: no second plate.",
        f"{newtons} is {kilopascals} on the whole platen of {size}; the paper gives no force. The "
        f"pad brings it to the films; without it {newtons} on the {what} alone ({alone:.0f} mm²) "
        f"would be {step.force_n / alone:.1f} MPa. What the paper laid between platen and films is "
        "not known. The pressures at each step are estimates that no press has confirmed: check "
        "them once, cold, with pressure-indicating film.",
        "The pad has no holes: pins press their chamfers into it. It keeps heat back: films are "
        "heated from below, through the base plate. Lay up on the plate while it is cold, out of "
        "the press; it warms with the films on it, and each step counts from when it is hot.",
    )


def build_up_again(work: Work) -> tuple[str, ...]:
    """The same where another design's page has said it: only what is this design's own."""
    thick = {item.part: item for item in work.schedule.steps[-1].build_up}
    plate, pad = thick[BASE_PLATE], thick[PAD]
    return (
        "Build-up, force and heating are those of the first Press section, with a press pad of "
        f"{say.millimetres(pad.thickness_mm)} ({pad.material}) and a base plate of "
        f"{say.millimetres(plate.thickness_mm)}; what reaches the films stands at each step.",
    )


def items(work: Work) -> list[tuple[str, str, str]]:
    """Rows of the bill of materials: what, which, how many."""
    laminate, plan = work.laminate, work.schedule
    first = plan.steps[0]
    thick = {item.part: item for item in first.build_up}
    size = say.size(*first.platen_mm)
    plate, pad, release = thick[BASE_PLATE], thick[PAD], thick[RELEASE]
    sheets = pieces(pad.thickness_mm)
    piled = f", a pile of {sheets} sheets" if sheets > 1 else ""
    holes = (
        f"; holes from {work.job.fixture} and the hole table, reamed H7"
        if work.job.fixture is not None
        else "; no holes"
    )
    return [
        *_pin_items(
            laminate.pins * work.runs.together, plan, work.design.registration.pin_standard
        ),
        (
            "Base plate",
            f"{plate.material}, {say.millimetres(plate.thickness_mm)}, {size}{holes}",
            "1",
        ),
        (
            "Release film",
            f"{release.material}, {say.millimetres(release.thickness_mm)}, {size}; TPE must not "
            "stick to it at press temperature (our advice; the paper names none)",
            f"{2 * len(plan.steps)}",
        ),
        (
            "Press pad",
            f"{pad.material}, {say.millimetres(pad.thickness_mm)}{piled}, {size}, for "
            f"{first.temperature_c:g} °C in lasting use (our advice; the paper names none)",
            str(sheets),
        ),
    ]


def _pin_items(pins: tuple[Pin, ...], plan: Schedule, standard: str) -> list[tuple[str, str, str]]:
    lengths = _lengths(plan)
    sizes = Counter((pin.diameter, lengths[pin.name]) for pin in pins if pin.name in lengths)
    return [
        (
            "Dowel pins",
            f"{standard}, ⌀{say.millimetres(diameter)} m6, {say.millimetres(length)} long",
            str(number),
        )
        for (diameter, length), number in sorted(sizes.items())
    ]
