"""What good hands know: one line each where it happens. All of it is ours; the paper gives none."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from sbafab.design.records import HoldDown
from sbafab.laminate.assembly import AssemblyStep, distinct_layers
from sbafab.laminate.films import Film
from sbafab.laminate.laminate import Laminate
from sbafab.pressing.schedule import END, MELTING, PATIENCE, START, Heating, HeatPoint, Step, listed
from sbafab.reports.traveller import job as say
from sbafab.reports.traveller.job import Action, Work
from sbafab.reports.underlay import guides
from sbafab.rules.pin_fit import NAME as PIN_FIT
from sbafab.rules.pin_fit import most_on_a_pin

WIPE = (
    "Wipe bench and film with isopropanol and a lint-free cloth, let them dry. Gloves on; hold "
    "film by its border: grease and dust keep TPE from bonding."
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
TAPE = "polyimide tape (silicone adhesive, rated 260 °C)"


def before_first_cut() -> list[Action]:
    """The same of registered sheets, whose parts hang on bridges or lie on the transfer film."""
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
    """How films come clean and flat under the beam, and what holds their parts once they are cut.

    None of it was tried, and the actions say so.
    """
    return [Action(WIPE), *(_held(works, film) for film in _films(works)), Action(AIR)]


def _films(works: Sequence[Work]) -> list[Film]:
    return list(dict.fromkeys(layer.film for work in works for layer in work.laminate.layers))


def hold_down(work: Work, film: Film) -> HoldDown:
    """Return how a film is held under the beam: masks as PTFE is, the others as TPE."""
    laser = work.design.laser
    return laser.hold_ptfe if film.is_mask else laser.hold_tpe


def _held(works: Sequence[Work], film: Film) -> Action:
    """How one film is held: on sheets of which each part comes free, for nothing bridges it."""
    count, lightest = 0, math.inf
    for work in works:
        for layers in work.laminate.patterns.values():
            if layers[0].film == film:
                pieces = layers[0].profile.pieces
                needed = len(layers) * work.job.copies
                count += len(pieces) * (needed + work.design.order.spare_parts(needed))
                lightest = min(lightest, *(piece.area for piece in pieces))
    weight = ""
    if film.density is not None:
        weight = f", the lightest of {lightest * film.thickness * film.density / 1000:.2g} mg"
    thin = say.millimetres(film.thickness)
    how = HOLDING[hold_down(works[0], film)]
    sticks = SILICONE if film.is_mask and hold_down(works[0], film) == "carrier" else ""
    return Action(
        f"{film.material}, {thin} thick: {how}{sticks} No tab holds a part: {count} come free"
        f"{weight}. (Our proposal, not tried.)"
    )


def after_cutting(works: Sequence[Work]) -> list[Action]:
    """How parts leave the sheet: clean, and none lost."""
    actions = [
        Action(
            "Wipe the soot off both faces of every part with isopropanol, let it dry: soot in a "
            "bond leaks."
        )
    ]
    actions += _threading(works)
    loose = sum(_loose(work.laminate) * work.job.copies for work in works)
    if loose:
        actions.append(
            Action(
                f"{say.count(loose, 'loose mask piece')}: pick them up with antistatic tweezers on "
                "an earthed mat, keep them in a dish with a lid. PTFE charges itself and flies."
            )
        )
    return actions


def _threading(works: Sequence[Work]) -> list[Action]:
    """What the rule pin-fit means at the bench, for the design whose films stretch most."""
    tight = [
        (finding.measured, finding.limit or 0.0, work)
        for work in works
        for finding in work.job.findings
        if finding.rule == PIN_FIT and finding.measured
    ]
    if not tight:
        return []
    stretch, allowed, work = max(tight, key=lambda one: one[0])
    error = say.millimetres(work.design.registration.cutting_error)
    return [
        Action(
            "Try one part of every pattern on its pins before you lay up. With edges off by "
            f"{error}, the worst case, a film must stretch by {stretch:.0%} over its pin "
            f"({allowed:.0%} is allowed; nobody has tried it), and up to "
            f"{say.count(most_on_a_pin(work.laminate), 'film')} go on one pin. If one tears or "
            "wrinkles, stop: the designer takes a thinner pin or a wider bore."
        )
    ]


def _loose(laminate: Laminate) -> int:
    """Pieces of masks that fall into several."""
    pieces = (len(layer.profile.pieces) for layer in laminate.layers if layer.is_mask)
    return sum(count for count in pieces if count > 1)


def underlay(work: Work, part: AssemblyStep) -> list[Action]:
    """The printed page below the release film, in steps in which it has a line to lay by.

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
        film, over, eye = f"{film}, pricked likewise", "pricked at its grey rings over the pins", ""
    return [
        Action(
            f"Tape a fresh print of {work.job.underlay} to the plate, {over}, cut corner at the "
            f"back right; over it {film}. The print shows the edges of {listed(patterns)}{eye}."
        )
    ]


def reseat(laminate: Laminate, adds: Sequence[int], pinned: bool) -> list[Action]:
    """What to do with a mask that has slipped; empty for a step that lays none."""
    if not any(layer.is_mask for layer in distinct_layers(laminate, adds)):
        return []
    home = "down on its pin" if pinned else "to its edge"
    return [
        Action(
            f"Has a mask slipped? Lift what lies over it with tweezers, push it {home}, lay the "
            "rest back and stroke it flat. After the flash bond it cannot be moved: cut a new one."
        )
    ]


def closing(step: Step, heating: Heating, cycles: tuple[str, ...] = ()) -> Action:
    """When the clock starts, as the plate goes in cold; a box for each of the ``cycles``."""
    return Action(closing_words(step, heating), (), cycles)


# How the plate warms, as the bench reads it: the time-temperature line and its blanks.


MOST_RAISED = 5.0
"""C by which the platens may be set hotter than the schedule says: ours."""


class HeatBlank(NamedTuple):
    """A point of a step's time-temperature line, in words, with a blank for the time read; ``id``
    tells that from the others.
    """

    point: str
    said: str
    id: str


def heat_blanks(step: Step, heating: Heating) -> list[HeatBlank]:
    """Return the line of a step, from the melting point to the end of its clock."""
    return [
        HeatBlank(point.point, _heat_words(point, step, heating), f"heat-{step.step}-{number}")
        for number, point in enumerate(step.time_temperature, 1)
    ]


def _heat_words(point: HeatPoint, step: Step, heating: Heating) -> str:
    """Return the point so short that three of them fit on one line of the page."""
    if point.point == END:
        return f"end ({say.minutes(step.minutes)} later)"
    what = "melting" if point.point == MELTING else point.point
    minutes = point.after_minutes
    after = _constants(point, heating) if minutes is None else say.minutes(minutes)
    return f"{point.edge_c:g} °C ({what}, {after})"


def _constants(point: HeatPoint, heating: Heating) -> str:
    """Return the time constants to a point of known temperature, in words."""
    assert point.edge_c is not None
    return f"{heating.constants_to(point.edge_c):.2f} τ"


def note(work: Work) -> str:
    """Return what the paper says of time, what we add, and the line that all steps share."""
    heating = work.schedule.heating
    platens, warms = heating.platen_c, heating.platen_c - heating.start_c
    points = work.schedule.steps[0].time_temperature
    [start] = [point for point in points if point.point == START]
    words = (
        "Time. The paper gives 135 °C and minutes for each step; it does not say when its clock "
        "starts. Ours: plate and films go in cold, and the clock starts when a thermocouple taped "
        f"to the plate's edge reads {heating.clock_c:g} °C, not before. A first-order estimate of "
        f"that edge is T = {platens:g} - {warms:g} exp(-t/τ) °C from {heating.start_c:g} °C, τ of "
        f"this bench {say.plain(heating.time_constant_minutes)} min (measured as in Before the "
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
    return f"{_constants(point, heating)} = {say.minutes(point.after_minutes)}"


def closing_words(step: Step, heating: Heating) -> str:
    """Return when the clock of a step starts; one line of the page."""
    return (
        f"Close the press. Start the clock, {say.minutes(step.minutes)}, only when the plate's "
        f"edge reads {heating.clock_c:g} °C (see Time, above)."
    )


def _patience(heating: Heating) -> str:
    tau = heating.time_constant_minutes
    return say.minutes(None if tau is None else PATIENCE * tau)


def before_the_day(heating: Heating, steps: int) -> Iterator[str]:
    """Yield how τ is measured, and what to do where the plate's edge stays too cold."""
    hot, ready = say.temperature(heating.platen_c), say.temperature(heating.clock_c)
    reach = heating.platen_c - (heating.platen_c - heating.start_c) * math.exp(-1)
    yield (
        "Time constant τ of the plate, once for a bench: lay the whole build-up without films, "
        f"plate at {heating.start_c:g} °C, a thermocouple taped to its edge; close it between "
        f"platens at {hot} and log the reading every half minute. τ is the time to {reach:.0f} "
        "°C, 63 % of the way: ________ min. Set press.time_constant to it. Add "
        f"{heating.constants_to(heating.clock_c):.2f} τ to each of the "
        f"{say.count(steps, 'press step')}."
    )
    yield (
        f"Edge temperature after {PATIENCE:g} τ: ________ °C. It must be {ready} or more. If it is "
        "less, check that the thermocouple reads 100 °C in boiling water (at sea level) and is "
        "taped down, that both platens reach their set temperature by the same thermocouple, that "
        "the plate lies flat and that the pad covers it. Then set the platens hotter by the "
        f"difference, {MOST_RAISED:g} °C at most: ________ °C, and measure again. If more is "
        "missing, do not press."
    )


# What the press's gauge and a pressure-indicating film must resolve.


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
        f"The gauge must read {say.force(step.force_n)}; 1 lbf is {pound:.2g} kPa. Read to half a "
        f"division, a gauge sets {step.pressure_kpa:g} kPa to {WANTED:.0%} if it has a division "
        f"every {finest:.0f} lbf ({finest * say.NEWTONS_PER_POUND:.0f} N) or finer; the divisions "
        "of the paper's press (Carver 5420) are not known to us. With a coarser gauge, set the "
        "force by a load cell between the platens, cold, and mark the gauge.",
    )
