"""bench.html: work and measurements done once per bench; and practice common to all pages.

All of it is ours; the paper gives none.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from sbafab.design.identity import adhesive_for
from sbafab.design.sections import HoldDown
from sbafab.laminate.assembly import films_without_minutes
from sbafab.laminate.base_plate import (
    HOLE_PROCESSES,
    HoleProcess,
    for_a_cnc_mill,
    most_play,
    pin_error,
)
from sbafab.laminate.films import PAPER_PRODUCT, PAPER_THICKNESS, Film
from sbafab.pressing.plate_heating import END, MELTING, PATIENCE, START, Heating, HeatPoint
from sbafab.pressing.schedule import Step, joined_words
from sbafab.reports.html_templates import environment
from sbafab.reports.traveller import base_plate, units
from sbafab.reports.traveller.base_plate import punch
from sbafab.reports.traveller.bill import kerf_states
from sbafab.reports.traveller.job import HERE, Action, Work, frame
from sbafab.rules.pin_fit import NAME as PIN_FIT
from sbafab.rules.pin_fit import most_on_a_pin

WIPE = (
    "Wipe bench and film with isopropanol and a lint-free cloth, let them dry. Gloves on; hold "
    "film by its border: grease and dust keep films from bonding."
)
AIR = (
    "Air assist off, or as low as the machine's owner allows; exhaust drawn off below the bed "
    "where the machine has it, and the lid opened slowly: a draught takes parts of a few "
    "milligrams with it."
)
HOLDING: Mapping[HoldDown, str] = {
    "border": (
        "lay it flat on smooth card, without stretching it, and hold it down all along its border "
        "with tape or magnets. Parts stay where they were cut, on the card."
    ),
    "carrier": (
        "stick it without bubbles on a carrier sheet of low tack, of paper or polyester and never "
        "of vinyl (PVC gives off hydrogen chloride). Cut through the film and not through the "
        "carrier (try power and speed on a corner). Parts stay on the carrier until they are laid: "
        "bend it away from the part, and wipe the face that was stuck on."
    ),
    "vacuum": (
        "lay it on the vacuum bed over a porous sheet, such as filter paper, as large as the film. "
        "The vacuum stays on until the last part is picked up."
    ),
}
"""Ways to hold a film under the beam, by ``laser.hold_tpe`` and ``laser.hold_ptfe``."""
SILICONE = " PTFE hardly sticks to acrylic or rubber adhesives: the carrier's must be silicone."


def before_cutting(works: Sequence[Work]) -> list[Action]:
    """Return the actions before cutting: films lie clean and flat under the beam, held in place.

    None of it was tried, and the actions say so.
    """
    return [Action(WIPE), *(_holding(works, film) for film in _films(works)), Action(AIR)]


def _films(works: Sequence[Work]) -> list[Film]:
    return list(dict.fromkeys(layer.film for work in works for layer in work.laminate.layers))


def hold_down(work: Work, film: Film) -> HoldDown:
    """Return how a film is held under the beam: masks like PTFE, others like TPE."""
    laser = work.design.laser
    return laser.hold_ptfe if film.is_mask else laser.hold_tpe


def _holding(works: Sequence[Work], film: Film) -> Action:
    """Return how a film is held on sheets whose parts all come free."""
    count, lightest = 0, math.inf
    for work in works:
        for layers in work.laminate.patterns.values():
            # Halves of a folded film are one part.
            cut = [layer for layer in layers if work.laminate.cut_with(layer) == layer.index]
            if cut and cut[0].film == film:
                is_folded = bool(work.laminate.folds)
                shape = work.laminate.as_cut(cut[0]) if is_folded else cut[0].profile
                pieces = shape.pieces
                needed = len(cut) * work.copies
                count += len(pieces) * (needed + work.design.order.spare_parts(needed))
                lightest = min(lightest, *(piece.area for piece in pieces))
    weight = ""
    if film.density is not None:
        milligrams = lightest * film.thickness * film.density / 1000
        shown = f"{milligrams:.2g}" if milligrams < 99.5 else f"{milligrams:.0f}"
        weight = f", the lightest of {shown} mg"
    thin = units.millimetres(film.thickness)
    how = HOLDING[hold_down(works[0], film)]
    sticks = ""
    if film.material == "PTFE" and hold_down(works[0], film) == "carrier":
        sticks = SILICONE
    up = ""
    if film.faces is not None and film.faces[0] != film.faces[1]:
        up = f" Its {film.faces[0]} face is up, its {film.faces[1]} face down: mark the upper one."
    return Action(
        f"{film.written}, {thin} thick: {how}{sticks}{up} No tab holds a part: {count} come free"
        f"{weight}. (Our proposal, not tried.)"
    )


def after_cutting(works: Sequence[Work]) -> list[Action]:
    """Return the actions for taking parts off the sheet, clean and without losing any."""
    actions = [
        Action(
            "Wipe the soot off both faces of every part with isopropanol, let it dry: soot in a "
            "bond leaks."
        )
    ]
    actions += _threading(works)
    loose, spare = (sum(counts) for counts in zip(*map(_loose, works), strict=True))
    if loose:
        spares = f" and {spare} spare" if spare else ""
        actions.append(
            Action(
                f"{units.count(loose, 'loose mask piece')}{spares}: pick them up with antistatic "
                "tweezers on an earthed mat, keep them in a dish with a lid. PTFE charges itself "
                "and flies."
            )
        )
    return actions


def _threading(works: Sequence[Work]) -> list[Action]:
    """Return the trial on the pins required by rule pin-fit, for the design that stretches most."""
    tight = [
        (finding.measured, finding.limit or 0.0, work)
        for work in works
        for finding in work.job.findings
        if finding.rule == PIN_FIT and finding.measured
    ]
    if not tight:
        return []
    stretch, allowed, work = max(tight, key=lambda stretched: stretched[0])
    error = units.millimetres(work.design.registration.cutting_error)
    return [
        Action(
            "Try one part of every pattern on its pins before you lay up. With edges off by "
            f"{error}, the worst case, a film must stretch by {stretch:.0%} over its pin "
            f"({allowed:.0%} is allowed; nobody has tried it), and up to "
            f"{units.count(most_on_a_pin(work.laminate), 'film')} go on one pin. If one tears or "
            "wrinkles, stop: the designer takes a thinner pin or a wider bore."
        )
    ]


def _loose(work: Work) -> tuple[int, int]:
    """Return the numbers of needed and spare pieces of masks with several pieces."""
    loose = spare = 0
    for layers in work.laminate.patterns.values():
        pieces = len(layers[0].profile.pieces)
        if layers[0].is_mask and pieces > 1:
            needed = len(layers) * work.copies
            loose += pieces * needed
            spare += pieces * work.design.order.spare_parts(needed)
    return loose, spare


# Warming of the plate: the time-temperature line and its blanks.


MOST_RAISED = 5.0
"""Excess in C that the platens may have over the schedule's temperature: ours."""


class HeatBlank(NamedTuple):
    """A point of a step's time-temperature line as text, with a blank for the time read; ``id``
    identifies that blank.
    """

    point: str
    words: str
    id: str


def heat_blanks(step: Step, heating: Heating) -> list[HeatBlank]:
    """Return the time-temperature line of a step, from the melting point to the end of its
    clock.
    """
    return [
        HeatBlank(point.point, _heat_words(point, step, heating), f"heat-{step.step}-{number}")
        for number, point in enumerate(step.time_temperature, 1)
    ]


def _heat_words(point: HeatPoint, step: Step, heating: Heating) -> str:
    """Return the point as a short text: three of them fit on one line of the page."""
    if point.point == END:
        return f"end ({units.minutes(step.minutes)} later)"
    name = "melting" if point.point == MELTING else point.point
    minutes = point.after_minutes
    after = _constants(point, heating) if minutes is None else units.minutes(minutes)
    return f"{point.edge_c:g} °C ({name}, {after})"


def _constants(point: HeatPoint, heating: Heating) -> str:
    """Return the time constants to a point of known temperature, as text."""
    assert point.edge_c is not None
    return f"{heating.constants_to(point.edge_c):.2f} τ"


# Pressure-indicating film.


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
"""Two-sheet films of Fujifilm Prescale, by the ranges in its maker's list as far as we know: the
list was not opened, so the page asks to compare them with the box."""
COLD = "checks the pressure once, cold; compare this range with its box"


def pressure_range(works: Sequence[Work]) -> tuple[float, float]:
    """Return the least and the largest pressure in kPa anywhere on the films."""
    steps = [step for work in works for step in work.schedule.steps]
    low = min(min(step.film_kpa, step.bond_kpa, step.plate_kpa) for step in steps)
    return low, max(max(step.edge_kpa, step.film_kpa) for step in steps)


def film_classes(low: float, high: float) -> list[FilmClass]:
    """Return the fewest classes that cover a range in kPa, as far as possible."""
    return [film for film in FILM_CLASSES if film.low < high and film.high > low]


def film_words(works: Sequence[Work]) -> str:
    """Return the pressure-indicating films that cover the pressures on the films."""
    low, high = pressure_range(works)
    classes = film_classes(low, high)
    names = joined_words(
        [f"{film.name} ({film.product}, {film.low:g} to {film.high:g} kPa)" for film in classes]
    )
    return (
        f"pressure-indicating film for {low:.0f} to {high:.0f} kPa: Fujifilm Prescale, {names}"
        if classes
        else f"pressure-indicating film for {low:.0f} to {high:.0f} kPa"
    )


# The page.


TEMPLATE = "bench.html.j2"
NAME = "bench.html"
WANTED = 0.05
"""Accuracy of setting the pressure on a gauge, as a share: ours."""


class BasePlatePage(NamedTuple):
    """The base plate of a design: its file, the accuracy of its holes, and their table.

    ``counted`` is the error in mm that the rules count for it, ``coarse`` for a CNC mill's plate;
    ``command`` adapts the design to the latter, empty if its plate needs no better machine.
    """

    name: str
    file: str
    size: str
    several: bool
    making: HoleProcess
    play: float
    counted: float
    coarse: float
    command: str
    holes: list[base_plate.PlateHole]
    places: list[base_plate.PlatePlace]
    grid: str


class Pressed(NamedTuple):
    """A design's press steps, and the force on its laminate alone."""

    name: str
    steps: tuple[Step, ...]
    alone: str


def bench_html(
    title: str,
    sha256: str,
    generator: str,
    works: Sequence[Work],
    further_tools: Sequence[Tool] = (),
) -> str:
    """Return the page of work done once per bench, for all designs of a folder."""
    films = dict.fromkeys(layer.film for work in works for layer in work.laminate.layers)
    materials = list(dict.fromkeys(film.material for film in films))
    nominal = [name for name, _, measured in kerf_states(works[0].job, materials) if not measured]
    hands = [w.design.registration for w in works if w.laminate.registration == "channel-pin"]
    pressed = [work for work in works if work.schedule.steps]
    page = frame(title, sha256, generator)
    values = {
        "nominal": joined_words(nominal),
        "warned": joined_words([film.material for film in films if film.warning]),
        "plates": [_plate(work) for work in works if work.job.fixture is not None],
        "cnc": HOLE_PROCESSES["cnc-mill"],
        "unknown_kerf": works[0].design.laser.unknown_kerf,
        "loupe": min((hand.hand_placement for hand in hands), default=None),
        "prints": any(work.job.underlay is not None for work in works),
        "tools": [*tools(works), *further_tools],
        "program": works[0].design.sheets.program,
        "designs": [_pressed(work) for work in works],
        **_trials(works),
        "first": None,
    }
    if pressed:
        values |= _heat_and_force(pressed)
    return environment(HERE).get_template(TEMPLATE).render(**page, **values, shapes="")


def _trials(works: Sequence[Work]) -> dict[str, str]:
    """Return the names of films whose bond and adhesive need a trial: all that bond, except the
    paper's.
    """
    papers = [(PAPER_PRODUCT, PAPER_THICKNESS)]
    bonded = [film for work in works for film in films_without_minutes(work.laminate, papers)]
    films = [film for work in works for film in work.laminate.glued_films]
    glued = [film.product for film in films if film.product != PAPER_PRODUCT]
    return {
        "bonded": joined_words(list(dict.fromkeys(film.said for film in bonded))),
        "glued": joined_words(list(dict.fromkeys(glued))),
        "adhesive": adhesive_for(works[0].design, works[0].laminate.glued_films) or units.BLANK,
    }


def _plate(work: Work) -> BasePlatePage:
    design, laminate = work.design, work.laminate
    machine, pin = design.registration.plate_made_by, design.thickest_pin
    several = len(laminate.pins) > 1
    finer = several and design.registration.pin_error is None and machine == "jig-borer"
    assert work.job.fixture is not None
    return BasePlatePage(
        design.name,
        work.job.fixture,
        base_plate.size(work),
        several,
        HOLE_PROCESSES[machine],
        most_play(pin, machine),
        design.pin_error if several else design.lone_pin_error,
        pin_error(pin, "cnc-mill"),
        for_a_cnc_mill("design.toml") if finer else "",
        base_plate.holes(work),
        base_plate.places(work),
        base_plate.grid(work),
    )


def _pressed(work: Work) -> Pressed:
    together = work.runs.together
    area = together * work.laminate.layers[-1].profile.area
    what = work.laminate.name if together == 1 else f"{together} of {work.laminate.name}"
    force = work.design.press.pressure_kpa * work.design.press.platen_width
    newtons = force * work.design.press.platen_length / 1000
    alone = f"{newtons / area:.1f} MPa on the {area:.0f} mm² of {what}"
    return Pressed(work.design.name, work.schedule.steps, alone)


def _heat_and_force(works: Sequence[Work]) -> dict[str, Any]:
    """Return the page's values on time, temperature and force."""
    first, heating = works[0].schedule.steps[0], works[0].schedule.heating
    points = {point.point: point for point in first.time_temperature}
    start, melting = points[START], points.get(MELTING)
    pound = first.pressure_kpa / first.force_n * units.NEWTONS_PER_POUND
    return {
        "first": first,
        "heating": heating,
        "hot": units.temperature(heating.platen_c),
        "ready": units.temperature(heating.clock_c),
        "reach": heating.platen_c - (heating.platen_c - heating.start_c) * math.exp(-1),
        "patience": PATIENCE,
        "most_raised": MOST_RAISED,
        "closings": sum(work.runs.count * len(work.schedule.steps) for work in works),
        "pressures": pressure_range(works),
        "indicating": film_words(works),
        "pound_kpa": pound,
        "division_lbf": 2 * WANTED * first.pressure_kpa / pound,
        "start": _after(start, heating),
        "melting": "" if melting is None else _after(melting, heating),
        "molten": (start.after_constants or 0) - ((melting or start).after_constants or 0),
    }


def _after(point: HeatPoint, heating: Heating) -> str:
    return f"{_constants(point, heating)} = {units.minutes(point.after_minutes)}"


# Tools.


LOUPE = "10x with a scale of 0.1 mm"
"""Readings are to half a division; by eye, one minute of arc is 0.09 mm at 300 mm."""


class Tool(NamedTuple):
    """A row of the list of tools."""

    name: str
    use: str


HOLDERS: Mapping[HoldDown, Tool] = {
    "border": Tool("Smooth card; tape or magnets", "hold thin film flat under the beam"),
    "carrier": Tool(
        "Carrier sheet of low tack, silicone adhesive",
        "holds masks and their parts under the beam: one as large as each sheet",
    ),
    "vacuum": Tool("Vacuum bed, porous sheet", "holds film and parts under the beam"),
}


def tools(works: Sequence[Work]) -> list[Tool]:
    """Return the tools, without consumables."""
    laminates = [work.laminate for work in works]
    rows = [
        Tool("Laser or drag knife", "cuts the film sheets; exhaust on"),
        Tool("Lint-free cloths, isopropanol, clean gloves", "clean films and parts before bonding"),
    ]
    masks = [layer for laminate in laminates for layer in laminate.layers if layer.is_mask]
    holds = {hold_down(work, layer.film) for work in works for layer in work.laminate.layers}
    rows += [tool for hold, tool in HOLDERS.items() if hold in holds]
    if any(len(layer.profile.pieces) > 1 for layer in masks):
        rows.append(Tool("Antistatic tweezers, earthed mat, dish with a lid", "loose mask pieces"))
    sizes = sorted({pin.diameter for laminate in laminates for pin in laminate.pins})
    if sizes:
        diameters = joined_words([f"⌀{units.millimetres(size)}" for size in sizes])
        thin = joined_words([f"⌀{units.millimetres(punch(size))}" for size in sizes])
        is_underlaid = any(
            step.pin_settings and base_plate.has_underlay(step)
            for work in works
            for step in work.schedule.steps
        )
        pricked = "release film and underlay" if is_underlaid else "the release film"
        rows += [
            Tool(
                f"Drills, flat cutters, reamers H7 {diameters}",
                "base plate, if you make it yourself",
            ),
            Tool("Depth gauge, small hammer", "seat the pins on their shoulders, check heights"),
            Tool(f"Pin punches {thin}, or shanks of drills", "push the pins out, from below"),
            Tool("Flat tweezers, pliers", "hold the films down and draw the pins"),
            Tool("Needle", f"pricks {pricked} over the pins"),
        ]
    if any(work.job.underlay is not None for work in works):
        rows.append(
            Tool("Knife, steel rule, 100 mm at least", "measure the underlay's bars, cut it out")
        )
    hands = [w.design.registration for w in works if w.laminate.registration == "channel-pin"]
    if hands:
        finest = units.millimetres(min(hand.hand_placement for hand in hands))
        rows.append(
            Tool(
                f"Measuring loupe, {LOUPE}; bright light",
                f"lay by eye to {finest} and measure the result (sbafab record --offset); the "
                "unaided eye resolves about 0.1 mm",
            )
        )
    seams = [seam for work in works for seam in work.schedule.seams]
    for tool in dict.fromkeys(seam.tool for seam in seams):
        widths = sorted({seam.width_mm for seam in seams if seam.tool == tool})
        wide = joined_words([units.millimetres(width) for width in widths])
        rows.append(Tool(f"{tool.capitalize()}, {wide} wide", "seams, along the paths of layers/"))
        if tool == "hot-tip":
            rows.append(Tool("Heat-proof mat; release film of PTFE", "under and over a seam"))
    if works[0].schedule.steps:
        rows += _press_tools(works)
    if any(laminate.tube_count for laminate in laminates):
        ears = "ears, " if any(laminate.registration == "ears" for laminate in laminates) else ""
        has_tabs = any(laminate.inlets for laminate in laminates)
        uses = "strips and tubes; mark tabs" if has_tabs else "tubes; mark holes"
        rows += [
            Tool("Fine scissors, razor blade, pen", f"cut {ears}{uses}"),
            Tool(
                "Regulator or syringe with a gauge, water or soapy water, eye protection",
                "leak and proof test",
            ),
            Tool(works[0].design.acceptance.fitting, "joins each tube to the supply"),
        ]
    return rows


def _press_tools(works: Sequence[Work]) -> list[Tool]:
    first = works[0].schedule.steps[0]
    width, length = first.platen_mm
    return [
        Tool(
            f"Heat press, {units.size(width, length)}",
            f"both platens to {units.temperature(first.temperature_c)}, "
            f"{units.force(first.force_n)}",
        ),
        Tool("Thermocouple with a reader, clock", "on the plate's edge: starts each step's clock"),
        Tool(f"{film_words(works)[:1].upper()}{film_words(works)[1:]}", COLD),
        Tool("Heat-proof gloves", "take the plate out, as hot as the platens"),
    ]
