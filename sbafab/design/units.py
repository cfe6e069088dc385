"""Lengths as people write them: ``0.75``, ``"0.75 mm"``, ``"6 in"``, ``"38 um"``."""

from __future__ import annotations

import math
import re
from typing import Annotated

from pydantic import BeforeValidator, Field, WithJsonSchema

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


SHORTEST, LONGEST = 0.001, 1000.0


def _json_schema(number: dict[str, float]) -> WithJsonSchema:
    units = "|".join(MILLIMETRES)
    text = {"type": "string", "pattern": rf"^\s*\+?{_NUMBER}\s*({units})?\s*$"}
    return WithJsonSchema({"anyOf": [{"type": "number", **number, "maximum": LONGEST}, text]})


Length = Annotated[
    float,
    BeforeValidator(millimetres),
    Field(ge=SHORTEST, le=LONGEST),
    _json_schema({"minimum": SHORTEST}),
]
"""A length in mm between 1 um and 1 m."""

LengthOrZero = Annotated[
    float, BeforeValidator(millimetres), Field(ge=0, le=LONGEST), _json_schema({"minimum": 0})
]
"""A length in mm that may be 0."""
