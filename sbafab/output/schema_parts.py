"""What JSON schemas are put together from."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, get_args

from sbafab.rules.finding import Verdict

TEXT = {"type": "string"}
COUNT = {"type": "integer", "minimum": 0}


def number(*more: str) -> dict[str, Any]:
    return {"type": ["number", *more]}


def table(**properties: Any) -> dict[str, Any]:
    """An object with all of these; further keys may be added."""
    return {"type": "object", "required": list(properties), "properties": properties}


def and_perhaps(body: dict[str, Any], **properties: Any) -> dict[str, Any]:
    """The same with keys that may be missing: what a command prints beside what is in the file."""
    return {**body, "properties": {**body["properties"], **properties}}


def array(item: Mapping[str, Any]) -> dict[str, Any]:
    return {"type": "array", "items": dict(item)}


def finding() -> dict[str, Any]:
    """What a rule found."""
    where = table(
        interface={"type": ["integer", "null"], "description": "counted from 1, bottom to top"},
        layers=array(COUNT),
        x={**number("null"), "description": "mm"},
        y={**number("null"), "description": "mm"},
    )
    return table(
        rule=TEXT,
        verdict={"enum": list(get_args(Verdict))},
        limit=number("null"),
        measured=number("null"),
        unit=TEXT,
        where=where,
        message=TEXT,
    )
