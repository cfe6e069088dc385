"""Lengths as people write them: ``0.75``, ``"0.75 mm"``, ``"6 in"``, ``"38 um"``; units of pressure
and flow.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import GetCoreSchemaHandler, PlainValidator

MILLIMETRES = {
    "um": 0.001,
    "\u00b5m": 0.001,
    "\u03bcm": 0.001,
    "mm": 1.0,
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
"""How many kPa each unit is (psi: NIST SP 811, App. B)."""
MILLILITRES_PER_MINUTE = {"ml/min": 1.0, "ul/min": 0.001, "ml/s": 60.0, "l/min": 1000.0}
"""How many ml/min each unit is."""
_NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_WRITTEN = re.compile(rf"\s*([-+]?{_NUMBER})\s*([^\d\s]*)\s*")


def millimetres(value: object) -> float:
    """A length in mm from a number (mm) or a text with a unit.

    Raises ValueError with a sentence that says what is allowed.
    """
    if isinstance(value, str):
        written = _WRITTEN.fullmatch(value)
        if written is None or (written[2] and written[2] not in MILLIMETRES):
            raise ValueError('must be a length such as 0.75, "0.75 mm", "38 um" or "6 in"')
        return round(float(written[1]) * MILLIMETRES[written[2] or "mm"], 9)
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
    """How a length in mm is read, and the range it must lie in.

    To be used as ``Annotated[float, Millimetres(least, most)]``; the JSON schema has the same range
    for numbers, and texts with a unit.
    """

    least: float
    most: float

    def read(self, value: object) -> float:
        """Raises ValueError with a sentence that says what is allowed."""
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


SHORTEST, LONGEST = 0.001, 1000.0

Length = Annotated[float, Millimetres(SHORTEST, LONGEST)]
"""A length in mm between 1 um and 1 m."""

LengthOrZero = Annotated[float, Millimetres(0, LONGEST)]
"""A length in mm that may be 0."""
