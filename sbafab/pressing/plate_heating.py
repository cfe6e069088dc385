"""Heating and cooling of a base plate in the press: the time-temperature curve of a step."""

from __future__ import annotations

import math
from dataclasses import dataclass

from sbafab.design.sections import NOT_MEASURED, Press
from sbafab.laminate.laminate import Laminate

# Warming of a cold plate between hot platens: a time-temperature line, first order.
#
# The paper states minutes at 135 C (Sec. 2); it does not say when its clock starts, nor what lay
# between platens and films. Ours: the plate goes in cold, its edge follows T(t) = platen - (platen
# - start) exp(-t / tau), and the clock starts when the edge reads 5 C less than the platens, or
# the melting point where that is higher. tau is the bench's own, measured once.


ROOM = 20.0
"""Temperature of plate and films when the press closes, C: ours."""
CLOCK_SHORTFALL = 5.0
"""Largest shortfall of the plate's edge behind the platens when the clock starts, C: ours."""
PATIENCE = 5.0
"""Time constants after which a first-order plate is within 1 C of its final temperature: ours."""
MELTING, START, END = "melting point", "clock starts", "clock ends"


@dataclass(frozen=True)
class HeatPoint:
    """A point of the curve: ``edge_c`` of the plate's edge, ``after_constants`` and
    ``after_minutes`` from closing the press; None if unknown.
    """

    point: str
    edge_c: float | None
    after_constants: float | None
    after_minutes: float | None


@dataclass(frozen=True)
class Heating:
    """Parameters of the time-temperature curve.

    ``melting_c`` is the highest melting point of the structural films, ``time_constant_minutes``
    that of the bench; None if unknown.
    """

    start_c: float
    platen_c: float
    melting_c: float | None
    clock_c: float
    time_constant_minutes: float | None
    basis: str

    def constants_to(self, edge_c: float) -> float:
        """Return the number of time constants until the plate's edge reaches ``edge_c``."""
        if edge_c <= self.start_c:
            return 0.0
        return math.log((self.platen_c - self.start_c) / (self.platen_c - edge_c))

    def edge_after(self, minutes: float) -> float | None:
        """Return the temperature of the plate's edge, C, ``minutes`` after the press closed."""
        tau = self.time_constant_minutes
        if tau is None:
            return None
        return self.platen_c - (self.platen_c - self.start_c) * math.exp(-minutes / tau)

    def line(self, minutes: float | None) -> tuple[HeatPoint, ...]:
        """Return melting point, start and end of the clock for a step of ``minutes``."""
        start = self._point(START, self.clock_c)
        end = edge = None
        if minutes is not None and start.after_minutes is not None:
            end = start.after_minutes + minutes
            edge = self.edge_after(end)
        rounded = HeatPoint(
            END,
            None if edge is None else round(edge, 1),
            None,
            None if end is None else round(end, 2),
        )
        melting = [] if self.melting_c is None else [self._point(MELTING, self.melting_c)]
        return (*melting, start, rounded)

    def _point(self, name: str, edge_c: float) -> HeatPoint:
        constants = self.constants_to(edge_c)
        tau = self.time_constant_minutes
        after = None if tau is None else round(constants * tau, 2)
        return HeatPoint(name, edge_c, round(constants, 3), after)


def heating(laminate: Laminate, press: Press) -> Heating:
    """Return the heating of the plate; the press must be hotter than the films' melting point."""
    platen_c = press.temperature_c
    tau = None if press.time_constant == NOT_MEASURED else press.time_constant
    films = {layer.film for layer in laminate.layers if not layer.is_mask}
    melting = [film.softens_above for film in films if film.softens_above is not None]
    is_known = bool(melting) and not any(
        film.softens_above is None and not film.stays_solid for film in films
    )
    hottest = max(melting) if is_known else None
    clock = max(platen_c - CLOCK_SHORTFALL, hottest or 0.0)
    return Heating(
        start_c=ROOM,
        platen_c=platen_c,
        melting_c=hottest,
        clock_c=clock,
        time_constant_minutes=tau,
        basis=f"estimate, ours: first order from {ROOM:g} C, tau "
        + ("not measured (press.time_constant)" if tau is None else f"{tau:g} min as measured")
        + "; the paper states its minutes at 135 C and not when its clock starts",
    )


# A steel plate between dry platens, and in still air: first order.


TOUCH = 40.0
"""Temperature of a plate that can be touched, C."""
STEEL = 3.8e6
"""Heat capacity of a base plate, J/(m3 K): 7,850 kg/m3 of steel with 490 J/(kg K)."""
CONTACT, AIR = 500.0, 10.0
"""W/(m2 K): from a platen into a plate that lies dry on it, and from each face of a plate into
still air. Handbook orders, ours: neither was measured in a press."""


def warm_minutes(plate: float, platen_c: float) -> float:
    """Return the estimated minutes for a cold plate, ``plate`` mm thick, to approach the platen's
    temperature.
    """
    heat = STEEL * plate / 1000
    return round(heat / CONTACT * math.log((platen_c - ROOM) / CLOCK_SHORTFALL) / 60, 1)


def cool_minutes(plate: float, platen_c: float) -> float:
    """Return the estimated minutes until a plate at platen temperature is safe to touch."""
    heat = STEEL * plate / 1000
    return round(heat / (2 * AIR) * math.log((platen_c - ROOM) / (TOUCH - ROOM)) / 60, 1)
