"""How the plate warms, as the bench reads it: the time-temperature line and its blanks."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from sbafab.pressing.heating import END, MELTING, PATIENCE, START, Heating, HeatPoint
from sbafab.pressing.schedule import Step
from sbafab.reports.traveller import quantities as say
from sbafab.reports.traveller.job import Work

MOST_RAISED = 5.0
"""C by which the platens may be set hotter than the schedule says: ours."""


class HeatBlank(NamedTuple):
    """A point of a step's time-temperature line, in words, with a blank for the time read; ``id``
    tells that from the others.
    """

    point: str
    said: str
    id: str


def line(step: Step) -> list[HeatBlank]:
    """Return the line of a step, from the melting point to the end of its clock."""
    return [
        HeatBlank(point.point, _said(point, step), f"heat-{step.step}-{number}")
        for number, point in enumerate(step.time_temperature, 1)
    ]


def _said(point: HeatPoint, step: Step) -> str:
    """The point as short as one line of the page asks for three of them."""
    if point.point == END:
        return f"end ({say.minutes(step.minutes)} later)"
    what = "melting" if point.point == MELTING else point.point
    minutes = point.after_minutes
    after = f"{point.after_constants:.2f} τ" if minutes is None else say.minutes(minutes)
    return f"{point.edge_c:g} °C ({what}, {after})"


def note(work: Work) -> str:
    """Return what the paper says of time, what we add, and the line that all steps share."""
    found = work.schedule.heating
    platens, warms = found.platen_c, found.platen_c - found.start_c
    points = work.schedule.steps[0].time_temperature
    [start] = [point for point in points if point.point == START]
    words = (
        "Time. The paper says 135 °C and minutes for each step; it does not say when its clock "
        "starts. Ours: plate and films go in cold, and the clock starts when a thermocouple taped "
        f"to the plate's edge reads {found.clock_c:g} °C, not before. A first-order estimate of "
        f"that edge is T = {platens:g} - {warms:g} exp(-t/τ) °C from {found.start_c:g} °C, τ of "
        f"this bench {say.plain(found.time_constant_minutes)} min (Before the day says how it is "
        "measured). After closing, "
    )
    starts = f"the clock starts after {_after(start)}"
    if found.melting_c is None:
        words += f"{starts}; the films' melting point is not known."
    else:
        [melting] = [point for point in points if point.point == MELTING]
        apart = (start.after_constants or 0.0) - (melting.after_constants or 0.0)
        words += (
            f"the films' melting point, {found.melting_c:g} °C, is reached after "
            f"{_after(melting)}, and {starts}: for {apart:.2f} τ they melt beside the minutes."
        )
    return words + (
        f" Where the edge does not read {found.clock_c:g} °C within {PATIENCE:g} τ "
        f"({_patience(found)}): do not start the clock; open, set these films aside as a sample, "
        "for nobody knows how long they were pressed, and find the cause as under Before the day."
    )


def _after(point: HeatPoint) -> str:
    return f"{point.after_constants:.2f} τ = {say.minutes(point.after_minutes)}"


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
        f"platens at {hot} and write the reading every half minute. τ is the time to {reach:.0f} "
        "°C, 63 % of the way: ________ min. Give it to press.time_constant. "
        f"{heating.constants_to(heating.clock_c):.2f} τ come on top of each of the "
        f"{say.count(steps, 'press step')}."
    )
    yield (
        f"Where the edge ends after {PATIENCE:g} τ: ________ °C. It must be {ready} or more. If it "
        "is less: is the thermocouple right (100 °C in boiling water at sea level) and taped down; "
        "do both platens read what they are set to, with the same thermocouple; does the plate lie "
        "flat and the pad cover it? Then set the platens hotter by what is missing, by "
        f"{MOST_RAISED:g} °C at most, here: ________ °C, and measure again. More is missing: do "
        "not press."
    )
