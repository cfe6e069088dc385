"""Minutes and hours of one actuator, of a batch and of an assembly; the words are the page's."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from sbafab.design.identity import cure_hours
from sbafab.pressing.build_up import BASE_PLATE
from sbafab.pressing.plate_heating import START, cool_minutes, warm_minutes
from sbafab.pressing.schedule import HANDLING_MINUTES
from sbafab.reports.traveller.work import Work

CONNECT_MINUTES = 2.0
"""Minutes to connect one tube to the test bench and disconnect it: ours."""
CURE_HOURS = 24.0
"""Curing time of the tubes' adhesive in hours if neither order nor kit states one: ours."""


class Times(NamedTuple):
    """Minutes: ``warm`` before the clock of every step, ``cool`` after it, ``cure`` and ``test`` of
    one actuator, and the minutes ``worked`` until its tubes are glued, at least: press minutes
    that are not stated count as 0.
    """

    warm: float
    cool: float
    cure: float
    test: float
    worked: float

    @property
    def total(self) -> float:
        return self.worked + self.cure + self.test


def times(work: Work) -> Times:
    """Return the times of one actuator; warming and cooling are estimates until measured."""
    press, acceptance, steps = work.design.press, work.design.acceptance, work.schedule.steps
    built = [part for step in steps for part in step.build_up]
    plate = next((part.thickness_mm for part in built if part.part == BASE_PLATE), 0.0)
    points = [point for step in steps[:1] for point in step.time_temperature]
    measured = next((p.after_minutes for p in points if p.point == START), None)
    warm = warm_minutes(plate, press.temperature_c) if measured is None else measured
    cool = press.cool_minutes or cool_minutes(plate, press.temperature_c)
    tubes = work.laminate.tube_count
    tested = (2 * acceptance.leak_seconds + acceptance.proof_seconds) / 60
    pressed = work.schedule.total_press_minutes or 0.0
    return Times(
        warm,
        cool,
        60 * (cure_hours(work.design) or CURE_HOURS) if tubes else 0.0,
        max(1, tubes) * (tested + CONNECT_MINUTES),
        HANDLING_MINUTES + pressed + len(steps) * (warm + cool),
    )


class AssemblyTimes(NamedTuple):
    """Minutes of all designs of an assembly: ``waited`` for plates to warm and cool, ``worked``
    until all tubes are glued, and the longest ``cure``; ``is_known``: all press minutes are stated.
    """

    waited: float
    worked: float
    cure: float
    is_known: bool


def assembly_times(works: Sequence[Work]) -> AssemblyTimes:
    """Return the times of an assembly until its parts can be joined."""
    each = [(work, times(work)) for work in works]
    waited = sum(
        work.cycles.count * len(work.schedule.steps) * (minutes.warm + minutes.cool)
        for work, minutes in each
    )
    pressed = [work.schedule.total_press_minutes for work in works]
    pressing = sum(work.cycles.count * (work.schedule.total_press_minutes or 0.0) for work in works)
    handled = HANDLING_MINUTES * sum(work.cycles.copies for work in works)
    cure = max(minutes.cure for _, minutes in each)
    return AssemblyTimes(waited, handled + pressing + waited, cure, None not in pressed)


class LaserEstimate(NamedTuple):
    """The laser's estimate for all sheets: minutes, metres of cut and travel, contours."""

    minutes: float
    cut: float
    travel: float
    contours: int


def laser(work: Work) -> LaserEstimate:
    """Return the estimate for the sheets, which all designs on them share."""
    return LaserEstimate(
        sum(sheet.minutes for sheet in work.sheets),
        sum(sheet.cut_length for sheet in work.sheets) / 1000,
        sum(sheet.travel for sheet in work.sheets) / 1000,
        sum(sheet.contours for sheet in work.sheets),
    )
