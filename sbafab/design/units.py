"""Lengths as users write them: ``0.75``, ``"0.75 mm"``, ``"6 in"``, ``"38 um"``; also moduli,
densities and temperatures; units of pressure and flow.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import BeforeValidator, GetCoreSchemaHandler, PlainValidator

MILLIMETRES = {
    "mm": 1.0,
    "um": 0.001,
    "\u00b5m": 0.001,
    "\u03bcm": 0.001,
    "cm": 10.0,
    "m": 1000.0,
    "in": 25.4,
    "inch": 25.4,
    '"': 25.4,
    "mil": 0.0254,
}
KILOPASCALS = {
    "kPa": 1.0,
    "Pa": 0.001,
    "MPa": 1000.0,
    "mbar": 0.1,
    "bar": 100.0,
    "psi": 6.894757293168,
}
"""Size of each unit in kPa (psi: NIST SP 811, App. B)."""
MILLILITRES_PER_MINUTE = {"ml/min": 1.0, "ul/min": 0.001, "ml/s": 60.0, "l/min": 1000.0}
"""Size of each unit in ml/min."""
_NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
MEASURED = re.compile(rf"\s*([-+]?{_NUMBER})\s*(\S*)\s*")
"""A number, and the unit after it."""


def in_first_unit(text: str, units: Mapping[str, float]) -> float | None:
    """Return the number in a text, in the first of ``units``; None for other text."""
    written = MEASURED.fullmatch(text)
    size = written and units.get(written[2] or next(iter(units)))
    return float(written[1]) * size if written and size is not None else None


def share_of(text: str) -> float | None:
    """Return the fraction in a text such as 0.95 or 95%; None for other text."""
    number = in_first_unit(text, {"": 1.0, "%": 0.01})
    return None if number is None else round(number, 12)


def millimetres(value: object) -> float:
    """Return a length in mm from a number (mm) or a text with a unit.

    Raises ValueError with a sentence about the allowed form.
    """
    if isinstance(value, str):
        read = in_first_unit(value, MILLIMETRES)
        value = None if read is None else round(read, 9)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError('must be a length such as 0.75, "0.75 mm", "38 um" or "6 in"')
    try:
        length = float(value)
    except OverflowError:
        length = math.inf
    if not math.isfinite(length):
        raise ValueError("must be a finite length")
    return length


@dataclass(frozen=True)
class Millimetres:
    """Parser of a length in mm with an allowed range.

    Use it as ``Annotated[float, Millimetres(least, most)]``; the JSON schema allows numbers in this
    range, and texts with a unit.
    """

    least: float
    most: float

    def read(self, value: object) -> float:
        """Return the length. Raises ValueError with a sentence about the allowed form."""
        length = millimetres(value)
        if length < self.least:
            raise ValueError(f"must be at least {self.least:g} mm")
        if length > self.most:
            raise ValueError(f"must be at most {self.most:g} mm")
        return length

    def __get_pydantic_core_schema__(self, source: object, handler: GetCoreSchemaHandler) -> Any:
        return PlainValidator(self.read).__get_pydantic_core_schema__(source, handler)

    def __get_pydantic_json_schema__(self, schema: object, handler: object) -> dict[str, object]:
        units = "|".join(MILLIMETRES)
        sign = r"[-+]?" if self.least < 0 else r"\+?"
        number = {"type": "number", "minimum": self.least, "maximum": self.most}
        text = {"type": "string", "pattern": rf"^\s*{sign}{_NUMBER}\s*({units})?\s*$"}
        return {"anyOf": [number, text]}


@dataclass(frozen=True, eq=False)
class InUnit:
    """Parser of a number with an optional unit; without one it is in the first of ``units``.

    ``units`` gives their sizes in the first one; ``example`` is such a text. Use it as
    ``Annotated[float, Field(gt=0), InUnit(...)]``; the JSON schema has both forms.
    """

    units: Mapping[str, float]
    example: str

    def read(self, value: object) -> object:
        """Return the number. Raises ValueError with a sentence about the allowed form."""
        if not isinstance(value, str):
            return value
        number = in_first_unit(value, self.units)
        if number is None:
            first, *more_units = self.units
            more = f" (or {', '.join(more_units)})" if more_units else ""
            raise ValueError(
                f'must be a number, in {first}, or a text with its unit{more}, such as "'
                f'{self.example}"'
            )
        return number

    def __get_pydantic_core_schema__(self, source: object, handler: GetCoreSchemaHandler) -> Any:
        return BeforeValidator(self.read).__get_pydantic_core_schema__(source, handler)

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> dict[str, object]:
        units = "|".join(map(re.escape, self.units))
        text = {"type": "string", "pattern": rf"^\s*[-+]?{_NUMBER}\s*({units})?\s*$"}
        return {"anyOf": [handler(schema), text]}


MEGAPASCALS = InUnit({"MPa": 1.0, "kPa": 0.001, "GPa": 1000.0}, "20 MPa")
CELSIUS = InUnit({"C": 1.0, "\u00b0C": 1.0}, "150 C")
DENSITIES = InUnit({"kg/m3": 1.0, "g/cm3": 1000.0}, "1200 kg/m3")
UNITS = (*MILLIMETRES, *MEGAPASCALS.units, *CELSIUS.units, *DENSITIES.units)


def is_measured(text: str) -> bool:
    """Return True for the text of a number, with or without a unit that files accept."""
    written = MEASURED.fullmatch(text)
    return written is not None and written[2] in ("", *UNITS)


SHORTEST, LONGEST = 0.001, 1000.0

Length = Annotated[float, Millimetres(SHORTEST, LONGEST)]
"""A length in mm between 1 um and 1 m."""

LengthOrZero = Annotated[float, Millimetres(0, LONGEST)]
"""A length in mm that may be 0."""
