"""How a cold plate warms between hot platens: a time-temperature line, first order.

The paper states minutes at 135 C (Sec. 2); it does not say when its clock starts, nor what lay
between platens and films. Ours: the plate goes in cold, its edge follows T(t) = platen - (platen -
start) exp(-t / tau), and the clock starts when the edge reads 5 C less than the platens, or the
melting point where that is higher. tau is the bench's own, measured once. Temperatures are C.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from sbafab.laminate.films import Film, unstated
from sbafab.laminate.laminate import Laminate
from sbafab.pressing.words import listed

if TYPE_CHECKING:
    from sbafab.pressing.schedule import PressSettings

ROOM = 20.0
"""C at which plate and films are when the press closes: ours."""
WARM = 5.0
"""C by which the plate's edge may be colder than the platens when the clock starts: ours."""
PATIENCE = 5.0
"""Time constants after which a first-order plate is within 1 C of where it ends: ours."""
MELTING, START, END = "melting point", "clock starts", "clock ends"


@dataclass(frozen=True)
class HeatPoint:
    """A point of the line: ``edge_c`` of the plate's edge, ``after_constants`` and
    ``after_minutes`` from closing the press; None where it is not known.
    """

    point: str
    edge_c: float | None
    after_constants: float | None
    after_minutes: float | None


@dataclass(frozen=True)
class Heating:
    """What the line is drawn with. ``melting_c`` is the highest melting point of the structural
    films, ``time_constant_minutes`` the bench's; None where they are not known.
    """

    start_c: float
    platen_c: float
    melting_c: float | None
    clock_c: float
    time_constant_minutes: float | None
    basis: str

    def constants_to(self, edge_c: float) -> float:
        """Return the time constants in which the edge of the plate comes to ``edge_c``."""
        if edge_c <= self.start_c:
            return 0.0
        return math.log((self.platen_c - self.start_c) / (self.platen_c - edge_c))

    def edge_after(self, minutes: float) -> float | None:
        """Return the temperature of the plate's edge so many minutes after the press closed."""
        tau = self.time_constant_minutes
        if tau is None:
            return None
        return self.platen_c - (self.platen_c - self.start_c) * math.exp(-minutes / tau)

    def line(self, minutes: float | None) -> tuple[HeatPoint, ...]:
        """Return melting point, start and end of the clock of a step of so many minutes."""
        points = []
        if self.melting_c is not None:
            points.append(self._point(MELTING, self.melting_c))
        start = self._point(START, self.clock_c)
        end = None
        if minutes is not None and start.after_minutes is not None:
            end = start.after_minutes + minutes
        edge = None if end is None else self.edge_after(end)
        after = None if end is None else round(end, 2)
        return (
            *points,
            start,
            HeatPoint(END, None if edge is None else round(edge, 1), None, after),
        )

    def _point(self, name: str, edge_c: float) -> HeatPoint:
        constants = self.constants_to(edge_c)
        tau = self.time_constant_minutes
        after = None if tau is None else round(constants * tau, 2)
        return HeatPoint(name, edge_c, round(constants, 3), after)


def heating(laminate: Laminate, press: PressSettings) -> Heating:
    """Return how the plate under a laminate warms; the press must be hotter than its films melt."""
    films = {layer.film for layer in laminate.layers if not layer.is_mask}
    melting = [film.softens_above for film in films if film.softens_above is not None]
    is_known = bool(melting) and not any(
        film.softens_above is None and not film.stays_solid for film in films
    )
    hottest = max(melting) if is_known else None
    clock = max(press.temperature_c - WARM, hottest or 0.0)
    return Heating(
        start_c=ROOM,
        platen_c=press.temperature_c,
        melting_c=hottest,
        clock_c=clock,
        time_constant_minutes=press.time_constant,
        basis=f"estimate, ours: first order from {ROOM:g} C, tau "
        + (
            "not measured (press.time_constant)"
            if press.time_constant is None
            else f"{press.time_constant:g} min as measured"
        )
        + "; the paper states its minutes at 135 C and not when its clock starts",
    )


def unstated_minutes(films: list[Film], press: PressSettings) -> str:
    """Return the warning that the minutes are nobody's for these films; empty for none."""
    if not films:
        return ""
    names = [f'"{film.said}"' for film in films]
    stated = listed([f"{product}, {thickness:g} mm" for product, thickness in press.minutes_for])
    return (
        f"the minutes are blank: they were stated for {stated or 'no film'}, and none for "
        f"{listed(names)}; try the bond on a sample at {press.temperature_c:g} C, set "
        "press.temperature_c, press.pressure_kpa and the press minutes to what held, and name the "
        "film in press.minutes_for"
    )


def films_without_minutes(laminate: Laminate, press: PressSettings) -> list[Film]:
    """Return the structural films of a laminate that the minutes were not stated for."""
    return unstated((layer.film for layer in laminate.layers), press.minutes_for)
