"""How the plate warms, as the bench reads it: the time-temperature line and its blanks."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from sbafab.pressing.heating import END, PATIENCE, START, Heating, HeatPoint
from sbafab.pressing.schedule import Step
from sbafab.reports.traveller import quantities as say
from sbafab.reports.traveller.job import Work

MOST_RAISED = 5.0
"""C by which the platens may be set hotter than the schedule says: ours."""


class HeatRow(NamedTuple):
    """A row of a step's time-temperature line; ``id`` tells its blank from the others."""

    point: str
    edge: str
    after: str
    id: str


def rows(step: Step, heating: Heating) -> list[HeatRow]:
    """Return the line of a step, from closing the press to the end of its clock."""
    return [
        HeatRow(
            point.point,
            "" if point.edge_c is None else f"{point.edge_c:g} °C",
            _after(point, step),
            f"heat-{step.step}-{number}",
        )
        for number, point in enumerate(
            (
                HeatPoint("press closes", heating.start_c, 0.0, 0.0),
                *step.time_temperature,
            ),
            1,
        )
    ]


def _after(point: HeatPoint, step: Step) -> str:
    if point.point == END:
        total = "" if point.after_minutes is None else f", {say.minutes(point.after_minutes)} in all"
        return f"{say.minutes(step.minutes)} on the clock{total}"
    if not point.after_constants:
        return "0"
    return f"{point.after_constants:.2f} τ = {say.minutes(point.after_minutes)}"


def note(work: Work) -> str:
    """Return what the paper says of time, what we add, and the line that all steps share."""
    found = work.schedule.heating
    step = work.schedule.steps[0]
    named = {point.point: point for point in step.time_temperature}
    start = named[START].after_constants or 0.0
    words = (
        f"Time. The paper says 135 °C and minutes for each step; it does not say when its clock "
        f"starts. Ours: plate and films go in cold, and the clock starts when the plate's edge "
        f"reads {found.clock_c:g} °C. A first-order estimate of that edge is T = "
        f"{found.platen_c:g} - {found.platen_c - found.start_c:g} exp(-t/τ) °C from "
        f"{found.start_c:g} °C, τ of this bench {say.plain(found.time_constant_minutes)} min"
    )
    words += " (Before the day says how it is measured)."
    if found.melting_c is None:
        return words + " The films' melting point is not known."
    melting = found.constants_to(found.melting_c)
    return words + (
        f" It passes {found.melting_c:g} °C, where the films melt, {start - melting:.2f} τ before "
        "the clock starts: for so long they are melting beside the minutes."
    )


def closing_words(step: Step, heating: Heating) -> str:
    """Return when the clock of a step starts, and what to do where it never does."""
    tau = heating.time_constant_minutes
    patience = say.minutes(None if tau is None else PATIENCE * tau)
    return (
        f"Close the press; note the time. Start the clock, {say.minutes(step.minutes)}, when a "
        f"thermocouple at the plate's edge reads {heating.clock_c:g} °C, not before. Does it not "
        f"read {heating.clock_c:g} °C within {PATIENCE:g} τ ({patience})? Do not start the clock: "
        "open, set these films aside as a sample, for nobody knows how long they were pressed, "
        "and find the cause as under Before the day."
    )


def before_the_day(heating: Heating) -> Iterator[str]:
    """Yield how τ is measured, and what to do where the plate's edge stays too cold."""
    reach = heating.platen_c - (heating.platen_c - heating.start_c) * 0.3679
    yield (
        "Time constant τ of the plate, once for a bench: lay the whole build-up without films, "
        f"plate at {heating.start_c:g} °C, a thermocouple taped to its edge; close it between "
        f"platens at {heating.platen_c:g} °C and write the reading every half minute. τ is the "
        f"time to {reach:.0f} °C, 63 % of the way: ________ min. Give it to press.time_constant."
    )
    yield (
        f"Where the edge ends after {PATIENCE:g} τ: ________ °C. It must be {heating.clock_c:g} °C "
        "or more. If it is less: is the thermocouple right (boiling water at sea level: 100 °C) and "
        "taped down; do both platens read what they are set to, with the same thermocouple; does "
        "the plate lie flat and the pad cover it? Then set the platens hotter by what is missing, "
        f"by {MOST_RAISED:g} °C at most, here: ________ °C, and measure again. More is missing: do "
        "not press."
    )
