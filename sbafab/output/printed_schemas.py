"""JSON schemas of what commands print with ``--json`` of runs and records."""

from __future__ import annotations

from typing import Any

from sbafab.output.printed import NESTED_SCHEMA, RECORDS_SCHEMA, REPORT_SCHEMA, RUN_SCHEMA
from sbafab.output.schema_parts import COUNT, TEXT, array, finding, number, table

YES = {"type": "boolean"}
PATHS = {**array(TEXT), "description": "what lies in the folder"}
SHARE = {"passed": COUNT, "tested": COUNT, "share": number(), "low": number(), "high": number()}


def _run() -> dict[str, Any]:
    return table(
        schema={"const": RUN_SCHEMA},
        folder=TEXT,
        failed=YES,
        findings=array(finding()),
        notes=array(TEXT),
        files=PATHS,
    )


def _nested() -> dict[str, Any]:
    one = table(name=TEXT, failed=YES, findings=array(finding()), notes=array(TEXT))
    return table(
        schema={"const": NESTED_SCHEMA}, folder=TEXT, failed=YES, designs=array(one), files=PATHS
    )


def _records() -> dict[str, Any]:
    numbers = {
        "type": "object",
        "additionalProperties": number(),
        "description": "units stand in the keys",
    }
    errors = {"type": "object", "additionalProperties": array(number())}
    texts = dict.fromkeys(("serial", "leak", "operator", "kit", "note"), TEXT)
    one = table(
        **texts,
        numbers=numbers,
        errors=errors,
        withdrawn=YES,
        id=COUNT,
        recorded={**TEXT, "description": "UTC"},
        design_sha256=TEXT,
        corrects={"type": ["integer", "null"]},
        design=TEXT,
        corrected_by={"type": ["integer", "null"]},
    )
    return table(schema={"const": RECORDS_SCHEMA}, records=array(one))


def _report() -> dict[str, Any]:
    measured = table(
        design=TEXT,
        quantity=TEXT,
        unit=TEXT,
        count=COUNT,
        mean=number(),
        low=number("null"),
        high=number("null"),
        predicted=number("null"),
        model=TEXT,
        ratio=number("null"),
        verdict=TEXT,
    )
    tolerance = table(
        kit=TEXT,
        operator=TEXT,
        quantity=TEXT,
        unit=TEXT,
        key=TEXT,
        stated=number(),
        found=table(errors=COUNT, largest=number(), highest=number()),
        verdict=TEXT,
    )
    return table(
        schema={"const": REPORT_SCHEMA},
        records=COUNT,
        actuators=COUNT,
        success=array(table(by=TEXT, name=TEXT, **SHARE)),
        measured=array(measured),
        tolerances=array(tolerance),
        promises=array(table(design=TEXT, promised=number(), **SHARE, verdict=TEXT)),
    )


BODIES = {"run": _run, "nested": _nested, "records": _records, "report": _report}
