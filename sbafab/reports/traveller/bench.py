"""Practice at the bench: cutting and laying films, heating the plate, pressure, preparation, tools.

All of it is ours; the paper gives none.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from sbafab.design.sections import HoldDown
from sbafab.laminate.assembly import AssemblyStep, distinct_layers
from sbafab.laminate.films import Film
from sbafab.laminate.laminate import Laminate
from sbafab.pressing.plate_heating import END, MELTING, PATIENCE, START, Heating, HeatPoint
from sbafab.pressing.schedule import Step, joined_words
from sbafab.reports.traveller import base_plate, units
from sbafab.reports.traveller.base_plate import punch
from sbafab.reports.traveller.bill import kerf_states
from sbafab.reports.traveller.job import Action, Work
from sbafab.reports.underlay import guides
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
"""What holds a film under the beam, by ``laser.hold_tpe`` and ``laser.hold_ptfe``."""
SILICONE = " PTFE hardly sticks to acrylic or rubber adhesives: the carrier's must be silicone."
RIM = 10.0
"""mm of film round a registered sheet, by which it is held down."""


def before_first_cut() -> list[Action]:
    """Return the actions before registered sheets are cut: bridges or the transfer film hold their
    parts.
    """
    return [
        Action(WIPE),
        Action(
            f"Each registered sheet is cut whole, edge and all, out of film that reaches {RIM:g} "
            "mm past it all round. Lay the film flat on smooth card, without stretching it, and "
            "hold it down all along that rim with tape or magnets; a mask sheet is held by the rim "
            "of its transfer film. Parts of the films hang on their bridges. (Our proposal, not "
            "tried.)"
        ),
        Action(AIR),
    ]


def before_cutting(works: Sequence[Work]) -> list[Action]:
    """Return the actions before cutting: films come clean and flat under the beam, their parts are
    held.

    None of it was tried, and the actions say so.
    """
    return [Action(WIPE), *(_holding(works, film) for film in _films(works)), Action(AIR)]


def _films(works: Sequence[Work]) -> list[Film]:
    return list(dict.fromkeys(layer.film for work in works for layer in work.laminate.layers))


def hold_down(work: Work, film: Film) -> HoldDown:
    """Return how a film is held under the beam: masks as PTFE is, the others as TPE."""
    laser = work.design.laser
    return laser.hold_ptfe if film.is_mask else laser.hold_tpe


def _holding(works: Sequence[Work], film: Film) -> Action:
    """Return the holding of one film on sheets of which each part comes free, as nothing bridges
    it.
    """
    count, lightest = 0, math.inf
    for work in works:
        for layers in work.laminate.patterns.values():
            # Halves of a folded film are one part.
            cut = [layer for layer in layers if work.laminate.cut_with(layer) == layer.index]
            if cut and cut[0].film == film:
                is_folded = bool(work.laminate.folds)
                shape = work.laminate.first_cut(cut[0]) if is_folded else cut[0].profile
                pieces = shape.pieces
                needed = len(cut) * work.job.copies
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
        f"{film.material}, {thin} thick: {how}{sticks}{up} No tab holds a part: {count} come free"
        f"{weight}. (Our proposal, not tried.)"
    )


def after_cutting(works: Sequence[Work]) -> list[Action]:
    """Return the actions by which parts leave the sheet clean, and none is lost."""
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
    """Return the trial on the pins that the rule pin-fit asks for; of the design that stretches
    most.
    """
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
    """Return the numbers of needed and spare pieces of masks that fall into several."""
    loose = spare = 0
    for layers in work.laminate.patterns.values():
        pieces = len(layers[0].profile.pieces)
        if layers[0].is_mask and pieces > 1:
            needed = len(layers) * work.job.copies
            loose += pieces * needed
            spare += pieces * work.design.order.spare_parts(needed)
    return loose, spare


def underlay(work: Work, part: AssemblyStep) -> list[Action]:
    """Return the printed page below the release film, in steps in which it has a line to lay by.

    One print lies in one hot cycle: paper dries and shrinks, and a worn line is no line.
    """
    patterns = [
        pattern
        for guide in guides(work.laminate)
        if part.number in guide.steps
        for pattern in guide.patterns
    ]
    if work.job.underlay is None or not patterns:
        return []
    film, over = "a see-through release film", "flush with the plate's edges"
    eye = ": lay by eye along them, as each line says"
    if part.pins:
        film, over = f"{film}, pricked likewise", "pricked at its grey rings over the pins"
        eye = ": lay by eye along them what no pin holds"
    return [
        Action(
            f"Tape a fresh print of {work.job.underlay} to the plate, {over}, cut corner at the "
            f"back right; over it {film}. The print shows the edges of "
            f"{joined_words(patterns)}{eye}."
        )
    ]


def reseat(laminate: Laminate, adds: Sequence[int], pinned: bool) -> list[Action]:
    """Return the remedy for a mask that has slipped; empty for a step that lays none."""
    if not any(layer.is_mask for layer in distinct_layers(laminate, adds)):
        return []
    home = "down on its pin" if pinned else "to its edge"
    return [
        Action(
            f"Has a mask slipped? Lift what lies over it with tweezers, push it {home}, lay the "
            "rest back and stroke it flat. Once pressed it cannot be moved: cut a new one."
        )
    ]


def closing(step: Step, heating: Heating, cycles: tuple[str, ...] = ()) -> Action:
    """Return start of the clock, as the plate goes in cold; a box for each of the ``cycles``."""
    return Action(closing_words(step, heating), (), cycles)


# Warming of the plate: the time-temperature line and its blanks.


MOST_RAISED = 5.0
"""C by which the platens may be set hotter than the schedule says: ours."""


class HeatBlank(NamedTuple):
    """A point of a step's time-temperature line, in words, with a blank for the time read; ``id``
    tells that from the others.
    """

    point: str
    words: str
    id: str


def heat_blanks(step: Step, heating: Heating) -> list[HeatBlank]:
    """Return time-temperature line of a step, from the melting point to the end of its clock."""
    return [
        HeatBlank(point.point, _heat_words(point, step, heating), f"heat-{step.step}-{number}")
        for number, point in enumerate(step.time_temperature, 1)
    ]


def _heat_words(point: HeatPoint, step: Step, heating: Heating) -> str:
    """Return the point so short that three of them fit on one line of the page."""
    if point.point == END:
        return f"end ({units.minutes(step.minutes)} later)"
    name = "melting" if point.point == MELTING else point.point
    minutes = point.after_minutes
    after = _constants(point, heating) if minutes is None else units.minutes(minutes)
    return f"{point.edge_c:g} °C ({name}, {after})"


def _constants(point: HeatPoint, heating: Heating) -> str:
    """Return the time constants to a point of known temperature, in words."""
    assert point.edge_c is not None
    return f"{heating.constants_to(point.edge_c):.2f} τ"


def note(work: Work) -> str:
    """Return what the paper states of time, what we add, and the line that all steps share."""
    heating = work.schedule.heating
    platens, warms = heating.platen_c, heating.platen_c - heating.start_c
    points = work.schedule.steps[0].time_temperature
    [start] = [point for point in points if point.point == START]
    words = (
        "Time. The paper gives 135 °C and minutes for each step; it does not say when its clock "
        "starts. Ours: plate and films go in cold, and the clock starts when a thermocouple taped "
        f"to the plate's edge reads {heating.clock_c:g} °C, not before. A first-order estimate of "
        f"that edge is T = {platens:g} - {warms:g} exp(-t/τ) °C from {heating.start_c:g} °C, τ of "
        f"this bench {units.plain(heating.time_constant_minutes)} min (measured as in Before the "
        "day). After closing, "
    )
    starts = f"the clock starts after {_after(start, heating)}"
    if heating.melting_c is None:
        words += f"{starts}; the films' melting point is not known."
    else:
        [melting] = [point for point in points if point.point == MELTING]
        molten = (start.after_constants or 0.0) - (melting.after_constants or 0.0)
        words += (
            f"the films' melting point, {heating.melting_c:g} °C, is reached after "
            f"{_after(melting, heating)}, and {starts}: the films are above it for {molten:.2f} τ "
            "before the clock starts."
        )
    return words + (
        f" Where the edge does not read {heating.clock_c:g} °C within {PATIENCE:g} τ "
        f"({_patience(heating)}): do not start the clock. Open the press, set these films aside as "
        "a sample (how long they were hot is not known) and find the cause as in Before the day."
    )


def _after(point: HeatPoint, heating: Heating) -> str:
    return f"{_constants(point, heating)} = {units.minutes(point.after_minutes)}"


def closing_words(step: Step, heating: Heating) -> str:
    """Return when the clock of a step starts; one line of the page."""
    return (
        f"Close the press. Start the clock, {units.minutes(step.minutes)}, only when the plate's "
        f"edge reads {heating.clock_c:g} °C (see Time, above)."
    )


def _patience(heating: Heating) -> str:
    tau = heating.time_constant_minutes
    return units.minutes(None if tau is None else PATIENCE * tau)


def heating_lines(heating: Heating, steps: int) -> Iterator[str]:
    """Yield how τ is measured, and what to do where the plate's edge stays too cold."""
    hot, ready = units.temperature(heating.platen_c), units.temperature(heating.clock_c)
    reach = heating.platen_c - (heating.platen_c - heating.start_c) * math.exp(-1)
    yield (
        "Time constant τ of the plate, once for a bench: lay the whole build-up without films, "
        f"plate at {heating.start_c:g} °C, a thermocouple taped to its edge; close it between "
        f"platens at {hot} and log the reading every half minute. τ is the time to {reach:.0f} "
        "°C, 63 % of the way: ________ min. Set press.time_constant to it. Add "
        f"{heating.constants_to(heating.clock_c):.2f} τ to each of the "
        f"{units.count(steps, 'press step')}."
    )
    yield (
        f"Edge temperature after {PATIENCE:g} τ: ________ °C. It must be {ready} or more. If it is "
        "less, check that the thermocouple reads 100 °C in boiling water (at sea level) and is "
        "taped down, that both platens reach their set temperature by the same thermocouple, that "
        "the plate lies flat and that the pad covers it. Then set the platens hotter by the "
        f"difference, {MOST_RAISED:g} °C at most: ________ °C, and measure again. If more is "
        "missing, do not press."
    )


# Resolution of the press's gauge and of a pressure-indicating film.


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
COLD = "checks the pressure once, cold; compare this range with its box"
WANTED = 0.05
"""Share to which a gauge should set the pressure: ours."""


def pressure_range(works: Sequence[Work]) -> tuple[float, float]:
    """Return the least and the largest pressure in kPa that any place of the films gets."""
    steps = [step for work in works for step in work.schedule.steps]
    low = min(min(step.film_kpa, step.bond_kpa, step.plate_kpa) for step in steps)
    return low, max(max(step.edge_kpa, step.film_kpa) for step in steps)


def film_classes(low: float, high: float) -> list[FilmClass]:
    """Return the fewest classes that cover a range in kPa, as far as classes do."""
    return [film for film in FILM_CLASSES if film.low < high and film.high > low]


def film_words(works: Sequence[Work]) -> str:
    """Return which pressure-indicating film covers what the films get."""
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


def notes(work: Work) -> tuple[str, ...]:
    """Return what a reading of the press's gauge is worth on the platen."""
    step = work.schedule.steps[0]
    pound = step.pressure_kpa / step.force_n * units.NEWTONS_PER_POUND
    finest = 2 * WANTED * step.pressure_kpa / pound
    return (
        f"The gauge must read {units.force(step.force_n)}; 1 lbf is {pound:.2g} kPa. Read to half "
        f"a division, a gauge sets {step.pressure_kpa:g} kPa to {WANTED:.0%} if it has a division "
        f"every {finest:.0f} lbf ({finest * units.NEWTONS_PER_POUND:.0f} N) or finer; the "
        "divisions of the paper's press (Carver 5420) are not known to us. With a coarser gauge, "
        "set the force by a load cell between the platens, cold, and mark the gauge.",
    )


UNKNOWN = "not known, the paper gives no time. Measure it once: ________ min."
"""What stands for a time that the paper does not give."""


LOUPE = "10x with a scale of 0.1 mm"
"""Half a division is read; unaided, one minute of arc is 0.09 mm at 300 mm."""


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


def before_the_day(works: Sequence[Work]) -> list[Action]:
    """Return all that must be at hand, cut, dry and measured before the press is switched on."""
    return [Action(text) for text in _before(works)]


def _before(works: Sequence[Work]) -> Iterator[str]:
    films = dict.fromkeys(layer.film for work in works for layer in work.laminate.layers)
    materials = list(dict.fromkeys(film.material for film in films))
    nominal = [name for name, _, measured in kerf_states(works[0].job, materials) if not measured]
    if nominal:
        yield (
            f"Kerf of {joined_words(nominal)} measured and the files generated again; or it is "
            "accepted that edges are nominal (warning above)."
        )
    if any(film.warning for film in films):
        yield "Laser's owner permits these films; exhaust tested (warning above)."
    if any(work.laminate.pins for work in works):
        yield (
            "Base plate made and measured (table under Cut): place and depth of each hole; every "
            "pin goes down to its shoulder by hand or with light taps, and comes out by the punch "
            "from below. Where none does, lap the hole. The corner that is cut off is marked."
        )
    release = sum(base_plate.release_films(work) for work in works)
    pads = "the press pad" if len(works) == 1 else "every press pad"
    if release:
        yield f"Cut to the size under Materials: {release} release films and {pads}."
    if any(work.job.underlay is not None for work in works):
        prints = sum(base_plate.prints(work) for work in works if work.job.underlay)
        yield (
            f"Underlay printed at 100 %, {units.count(prints, 'time', 'times')}, the bars of each "
            "print measured, each cut out along its dotted line."
        )
    plate = "base plate, pad, release films, " if release else ""
    yield f"Clean and dry: {plate}film as it comes off the roll."
    if works[0].schedule.steps:
        yield from _before_the_press(works)
    if any(work.laminate.tube_count for work in works):
        yield "Adhesive in date; curing time on its package: ________ h."


def _before_the_press(works: Sequence[Work]) -> Iterator[str]:
    first = works[0].schedule.steps[0]
    hot = units.temperature(first.temperature_c)
    yield (
        f"Pressure of {first.pressure_kpa:g} kPa checked once, cold, in the whole build-up, at "
        f"{units.force(first.force_n)}, with {film_words(works)}. Division of the press's "
        "gauge: ________."
    )
    yield f"Warming the platens from cold to {hot}: {UNKNOWN}"
    steps = sum(work.runs.count * len(work.schedule.steps) for work in works)
    yield from heating_lines(works[0].schedule.heating, steps)
    yield f"Cooling the plate until it can be touched: {UNKNOWN} It comes after each step."


def tools(works: Sequence[Work]) -> list[Tool]:
    """Return the tools, without what is used up."""
    laminates = [work.laminate for work in works]
    rows = [
        Tool("Laser or drag knife", "cuts the film sheets; exhaust on"),
        Tool("Lint-free cloths, isopropanol, clean gloves", "clean films and parts before bonding"),
    ]
    masks = [layer for laminate in laminates for layer in laminate.layers if layer.is_mask]
    holds = {
        "border" if work.laminate.panel is not None else hold_down(work, layer.film)
        for work in works
        for layer in work.laminate.layers
    }
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
