"""A build with its sheets, as the pages for the bench show it, and the time that it takes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from sbafab.cutting.fixture import PATH as FIXTURE
from sbafab.cutting.sheets import SheetFile
from sbafab.design.identity import cure_hours
from sbafab.folders.build import Build
from sbafab.laminate.films import Film
from sbafab.pressing.plate_heating import START, cool_minutes, warm_minutes
from sbafab.pressing.press_force import BASE_PLATE
from sbafab.pressing.schedule import HANDLING_MINUTES
from sbafab.reports.prints import NAME as UNDERLAY
from sbafab.reports.prints import guides

CONNECT_MINUTES = 2.0  # to connect one tube to the test bench and disconnect it: ours
CURE_HOURS = 24.0  # of the tubes' adhesive if neither order nor kit states them: ours


@dataclass(frozen=True, eq=False)
class Work(Build):
    """A build with the ``sheets`` for all copies.

    ``folder`` is the path from the page to the design's files, ``solid_png`` the bytes of the
    solid's picture.
    """

    sheets: Sequence[SheetFile] = ()
    folder: str = ""
    solid_png: bytes | None = None

    @property
    def copies(self) -> int:
        """Number of actuators to make."""
        return self.design.order.quantity

    @cached_property
    def films(self) -> list[Film]:
        """Every film once, in the order of the layers."""
        return list(dict.fromkeys(layer.film for layer in self.laminate.layers))

    @property
    def fixture(self) -> str | None:
        """The path of the base plate's cut file; None if no pins are used."""
        return f"{self.folder}{FIXTURE}" if self.laminate.pins else None

    @cached_property
    def underlay(self) -> str | None:
        """The path of the page to lay up on; None if pins hold every part in every step."""
        return f"{self.folder}{UNDERLAY}" if guides(self.laminate) else None


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
    cure = 60 * (cure_hours(work.design) or CURE_HOURS) if tubes else 0.0
    test = max(1, tubes) * (tested + CONNECT_MINUTES)
    return Times(warm, cool, cure, test, HANDLING_MINUTES + pressed + len(steps) * (warm + cool))


class AssemblyTimes(NamedTuple):
    """Minutes of all designs of an assembly: ``waited`` for plates to warm and cool, ``worked``
    until all tubes are glued, and the longest ``cure``; ``is_known``: all press minutes are stated.
    """

    waited: float
    worked: float
    cure: float
    is_known: bool


def assembly_times(works: Sequence[Work]) -> AssemblyTimes:
    """Return the times that an assembly takes before its parts can be joined."""
    waited = handled = pressed = cure = 0.0
    for work in works:
        each, count = times(work), work.cycles.count
        waited += count * len(work.schedule.steps) * (each.warm + each.cool)
        pressed += count * (work.schedule.total_press_minutes or 0.0)
        handled += HANDLING_MINUTES * work.cycles.copies
        cure = max(cure, each.cure)
    is_known = all(work.schedule.total_press_minutes is not None for work in works)
    return AssemblyTimes(waited, handled + pressed + waited, cure, is_known)
