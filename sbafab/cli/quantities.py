"""Pressures, volumes and flows as people write them: ``6``, ``"60 mbar"``, ``5ul``.

What reads them is an option's ``type``.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

import click

from sbafab.design.pressure_units import KILOPASCALS

_WRITTEN = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\S*)\s*")


@dataclass(frozen=True)
class MeasuredQuantity:
    """A number with or without one of ``units``, whose sizes are in the first one's."""

    name: str
    units: dict[str, float]
    example: str

    def read(self, written: str) -> float:
        found = _WRITTEN.fullmatch(written)
        unit = found and (found[2] or next(iter(self.units)))
        if found is None or unit not in self.units:
            allowed = f"a {self.name} such as {self.example}; the units are {', '.join(self.units)}"
            raise click.BadParameter(f"{written!r} must be {allowed}")
        number = float(found[1]) * self.units[unit]
        if not math.isfinite(number):
            raise click.BadParameter(f"{written!r} must be a finite {self.name}")
        return number


LENGTH = MeasuredQuantity(
    "length", {"mm": 1.0, "um": 0.001, "cm": 10.0, "in": 25.4}, '0.35 or "350 um"'
)
PRESSURE = MeasuredQuantity("pressure", KILOPASCALS, '6, "6 kPa" or "60 mbar"')
MODULUS = MeasuredQuantity("modulus", {"MPa": 1.0, "kPa": 0.001, "GPa": 1000.0}, '10 or "10 MPa"')
VOLUME = MeasuredQuantity("volume", {"ul": 1.0, "ml": 1000.0, "mm3": 1.0}, '5, 5ul or "0.005 ml"')
FLOW = MeasuredQuantity(
    "flow",
    {"ml/min": 1.0, "ul/min": 0.001, "ml/s": 60.0, "l/min": 1000.0},
    '35, "35 ml/min" or "0.6 ml/s"',
)


@dataclass(frozen=True)
class OfChamber:
    """``NAME=QUANTITY``; where ``all_chambers``, also a quantity alone, with "" for the name."""

    quantity: MeasuredQuantity
    all_chambers: bool = False

    def read(self, written: str) -> tuple[str, float]:
        chamber, equals, text = written.rpartition("=")
        if not (chamber.strip() if equals else self.all_chambers):
            short = self.quantity.example.split(",")[0]
            pattern = f"NAME={self.quantity.name.upper()}"
            raise click.BadParameter(f"{written!r} must be {pattern}, such as chamber1={short}")
        return chamber.strip(), self.quantity.read(text)


def by_chamber(
    ctx: click.Context, param: click.Parameter, values: tuple[tuple[str, float], ...]
) -> dict[str, float]:
    """What was given by chamber: the callback of an option of several OfChamber."""
    found = dict(values)
    if len(found) < len(values):
        raise click.BadParameter("gives a chamber more than once", ctx, param)
    return found
