"""Before the day: what must be ready, and the tools. The paper gives times of the press alone."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from sbafab.design.records import HoldDown
from sbafab.pressing.words import listed
from sbafab.reports.traveller import base_plate
from sbafab.reports.traveller import quantities as say
from sbafab.reports.traveller.action import Action
from sbafab.reports.traveller.bench import WARM, hold_down
from sbafab.reports.traveller.bill import kerf_states
from sbafab.reports.traveller.job import Work
from sbafab.reports.traveller.taking_down import punch

UNKNOWN = "not known, the paper gives no time. Measure it once: ________ min."
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
    """What must be at hand, cut, dry and measured before the press is switched on."""
    return [Action(text) for text in _before(works)]


def _before(works: Sequence[Work]) -> Iterator[str]:
    films = dict.fromkeys(layer.film for work in works for layer in work.laminate.layers)
    materials = list(dict.fromkeys(film.material for film in films))
    unknown = [name for name, _, known in kerf_states(works[0].job, materials) if not known]
    if unknown:
        yield (
            f"Kerf of {listed(unknown)} measured and the files generated again; or it is accepted "
            "that edges are nominal (warning above)."
        )
    if any(film.warning for film in films):
        yield "Leave to cut these films, from the laser's owner; exhaust tried (warning above)."
    if any(work.laminate.pins for work in works):
        yield (
            "Base plate made and measured (table under Cut): place and depth of each hole; every "
            "pin goes down to its shoulder by hand or with light taps, and comes out by the punch "
            "from below. Where none does, lap the hole. The corner that is cut off is marked."
        )
    release = sum(2 * len(work.schedule.steps) for work in works)
    yield f"Cut to the size above: {release} release films and the press pad."
    if any(work.job.underlay is not None for work in works):
        prints = sum(base_plate.hot_prints(work) for work in works if work.job.underlay)
        yield (
            f"Underlay printed at 100 %, {say.count(prints, 'time', 'times')}, the bars of each "
            "print measured, each cut out along its dotted line."
        )
    yield "Clean and dry: base plate, pad, release films, film as it comes off the roll."
    first = works[0].schedule.steps[0]
    hot, ready = (say.temperature(t) for t in (first.temperature_c, first.temperature_c - WARM))
    yield (
        f"Pressure of {first.pressure_kpa:g} kPa found once, cold, with pressure-indicating film "
        f"in the whole build-up, at {say.force(first.force_n)}."
    )
    yield f"Warming the platens from cold to {hot}: {UNKNOWN}"
    steps = sum(work.runs.count * len(work.schedule.steps) for work in works)
    yield (
        f"Warming the cold plate with the pad on it, between platens at {hot}, to {ready} at its "
        f"edge: {UNKNOWN} It comes on top of each of the {say.count(steps, 'press step')}."
    )
    yield f"Cooling the plate until it can be touched: {UNKNOWN} It comes after each step."
    if any(work.laminate.inlets for work in works):
        yield "Adhesive in date; how long it cures stands on its package: ________ h."


def tools(works: Sequence[Work]) -> list[Tool]:
    """What is worked with, but for what is used up."""
    laminates = [work.laminate for work in works]
    first = works[0].schedule.steps[0]
    width, length = first.platen_mm
    found = [
        Tool("Laser or drag knife", "cuts the film sheets; exhaust on"),
        Tool("Lint-free cloths, isopropanol, clean gloves", "films and parts, before they bond"),
    ]
    masks = [layer for one in laminates for layer in one.layers if layer.is_mask]
    held = {
        "border" if work.laminate.panel is not None else hold_down(work, layer.film)
        for work in works
        for layer in work.laminate.layers
    }
    found += [tool for hold, tool in HOLDERS.items() if hold in held]
    if any(len(layer.profile.pieces) > 1 for layer in masks):
        found.append(Tool("Antistatic tweezers, earthed mat, dish with a lid", "loose mask pieces"))
    sizes = sorted({pin.diameter for one in laminates for pin in one.pins})
    if sizes:
        said = listed([f"⌀{say.millimetres(size)}" for size in sizes])
        thin = listed([f"⌀{say.millimetres(punch(size))}" for size in sizes])
        found += [
            Tool(f"Drills, flat cutters, reamers H7 {said}", "base plate, if you make it yourself"),
            Tool("Depth gauge, small hammer", "pins to their shoulders, their heights checked"),
            Tool(f"Pin punches {thin}, or shanks of drills", "pins out, from below"),
            Tool("Flat tweezers, pliers", "to hold the films down and to draw the pins"),
            Tool("Needle", "to prick what lies under the films over the pins"),
        ]
    if any(work.job.underlay is not None for work in works):
        found.append(Tool("Knife, steel rule, 100 mm at least", "underlay: its bars, its cut"))
    hands = [w.design.registration for w in works if w.laminate.registration == "channel-pin"]
    if hands:
        finest = say.millimetres(min(hand.hand_placement for hand in hands))
        found.append(
            Tool(
                f"Measuring loupe, {LOUPE}; bright light",
                f"to lay by eye to {finest}, and to measure what came out (sbafab record "
                "--offset): the bare eye tells about 0.1 mm",
            )
        )
    found += [
        Tool(
            f"Heat press, {say.size(width, length)}",
            f"both platens to {say.temperature(first.temperature_c)}, {say.force(first.force_n)}",
        ),
        Tool("Thermocouple with a reader, timer", "edge of the base plate: when a step begins"),
        Tool("Pressure-indicating film", "once, to find the pressure"),
        Tool("Heat-proof gloves", "the plate comes out as hot as the platens"),
    ]
    if any(one.inlets for one in laminates):
        ears = "ears, " if any(one.registration == "ears" for one in laminates) else ""
        found += [
            Tool("Fine scissors, razor blade, pen", f"{ears}strips, tubes; marks on tabs"),
            Tool(
                "Regulator or syringe with a gauge, water or soapy water, eye protection",
                "leak test",
            ),
        ]
    return found
