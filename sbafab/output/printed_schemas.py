"""JSON schemas of what commands print with ``--json`` of runs and records."""

from __future__ import annotations

from typing import Any

from sbafab.output.printed import (
    ASSEMBLY_PREDICT_SCHEMA,
    EXPLAIN_SCHEMA,
    EXPLAINED_SCHEMA,
    KERF_SCHEMA,
    MAP_SCHEMA,
    NESTED_SCHEMA,
    RECORDS_SCHEMA,
    REPORT_SCHEMA,
    REPRODUCTION_SCHEMA,
    RUN_SCHEMA,
    SIMULATE_SCHEMA,
    SWEEP_SCHEMA,
)
from sbafab.output.schema_parts import COUNT, TEXT, and_perhaps, array, finding, number, table

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
        attempt=COUNT,
        actuator_sha256={**TEXT, "description": "the same for all designs that build this"},
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
    by_errors = table(
        low=number(),
        high=number(),
        tolerances={
            "type": "object",
            "additionalProperties": array(number()),
            "description": "of each key the largest error measured and the most it leaves room for",
        },
    )
    promise = table(
        design=TEXT,
        promised=number(),
        by_measured_errors={**by_errors, "type": ["object", "null"]},
        **SHARE,
        verdict=TEXT,
    )
    return table(
        schema={"const": REPORT_SCHEMA},
        records=COUNT,
        actuators=COUNT,
        success=array(table(by=TEXT, name=TEXT, **SHARE, passed_later=COUNT)),
        measured=array(measured),
        tolerances=array(tolerance),
        promises=array(promise),
        contradictions=array(TEXT),
    )


def _sweep() -> dict[str, Any]:
    counts = {"type": "object", "additionalProperties": COUNT}
    return table(
        schema={"const": SWEEP_SCHEMA},
        folder=TEXT,
        designs=COUNT,
        measured_now=COUNT,
        no_longer_asked=COUNT,
        outcomes={**counts, "description": "designs by what became of them"},
        files=PATHS,
    )


def _kerf() -> dict[str, Any]:
    value = table(value=number(), uncertainty=number(), half_width=number())
    maybe = {**value, "type": ["object", "null"]}
    offsets = {
        "type": "object",
        "additionalProperties": value,
        "description": "mm that each instrument reads too much; empty where it cannot be told",
    }
    estimate = table(kerf=value, scale=maybe, scaled=YES, offsets=offsets, count=COUNT)
    of_axis = {**estimate, "type": ["object", "null"]}
    return table(
        schema={"const": KERF_SCHEMA},
        all={**estimate, "description": "kerf in mm, scale as a ratio, with 95 % half widths"},
        x=of_axis,
        y=of_axis,
        difference={**maybe, "description": "kerf along x less that along y, mm"},
        differs=YES,
        warnings=array(TEXT),
        remarks=array(TEXT),
        toml={**TEXT, "description": "lines for the design file"},
    )


def _explanation() -> dict[str, Any]:
    return {"holds": TEXT, "why": TEXT, "mend": TEXT, "keys": array(TEXT)}


def _explain() -> dict[str, Any]:
    return table(schema={"const": EXPLAIN_SCHEMA}, rule=TEXT, **_explanation())


def _explained() -> dict[str, Any]:
    rules = {"type": "object", "additionalProperties": table(**_explanation())}
    return table(schema={"const": EXPLAINED_SCHEMA}, rules=rules)


def _templates() -> dict[str, Any]:
    return array(table(name=TEXT, summary=TEXT))


def _simulate() -> dict[str, Any]:
    numbers = {"type": "object", "additionalProperties": number("null")}
    place = {**array(number()), "minItems": 3, "maxItems": 3}
    tip = table(time=number(), place=place, tilt=number())
    state = {"type": "object", "description": "pressures, stroke, tip, tilt, volumes, stress, work"}
    body = table(
        schema={"const": SIMULATE_SCHEMA},
        units={"type": "object", "additionalProperties": TEXT},
        stopped={"type": ["string", "null"], "description": "why it ended early, if it did"},
    )
    return and_perhaps(
        body,
        folder=TEXT,
        states={**array(state), "description": "calculix"},
        scene={**TEXT, "description": "sofa"},
        tips={**array(tip), "description": "sofa, mujoco"},
        rate={**number("null"), "description": "sofa, mujoco"},
        stroke={**number(), "description": "mujoco"},
        volumes={**numbers, "description": "mujoco"},
        drift={**number(), "description": "mujoco: mm in the last 0.5 s"},
    )


def _assembly_predict() -> dict[str, Any]:
    measured = {
        **TEXT,
        "description": "what the paper measured of one actuator, where the model is off by more "
        "than a quarter of it",
    }
    figure = table(
        part=TEXT,
        name=TEXT,
        value=number(),
        unit=TEXT,
        model=TEXT,
        paper=TEXT,
        measured=measured,
    )
    touch = {"part": TEXT, "other": TEXT, "volume": {**number(), "description": "mm3"}}
    bent = table(
        **touch,
        chambers=TEXT,
        from_kpa=number(),
        bend={**number(), "description": "degrees"},
    )
    return table(
        schema={"const": ASSEMBLY_PREDICT_SCHEMA},
        name=TEXT,
        pressure_kpa=number(),
        load_g=number(),
        figures=array(figure),
        touches=array(table(**touch)),
        left_out=array(TEXT),
        bent_touches=array(bent),
    )


def _balloon_map() -> dict[str, Any]:
    rows = array(array(number()))
    grid = {**rows, "description": "a row a pressure, a column a height"}
    sizes = ("pocket_radius_mm", "neck_radius_mm", "bore_radius_mm", "film_mm", "modulus_kpa")
    balloon = table(
        **dict.fromkeys((*sizes, "poisson"), number()),
        pressure=array(number()),
        height=array(number()),
        force=grid,
        volume=grid,
        potential=grid,
    )
    return table(
        schema={"const": MAP_SCHEMA},
        design=TEXT,
        units={"type": "object", "additionalProperties": TEXT},
        levels={**array(COUNT), "description": "which of the balloons stands there, from 1"},
        flat_level_mm=number(),
        chamber_axes_mm=rows,
        balloons=array(balloon),
    )


def _reproduction() -> dict[str, Any]:
    row = table(
        section=TEXT,
        figure=TEXT,
        unit=TEXT,
        where=TEXT,
        paper=number("null"),
        error=number("null"),
        predicted=number("null"),
        model=TEXT,
        why=TEXT,
    )
    found = table(schema={"const": REPRODUCTION_SCHEMA}, rows=array(row))
    return and_perhaps(found, folder=TEXT)


BODIES = {
    "run": _run,
    "nested": _nested,
    "records": _records,
    "report": _report,
    "sweep": _sweep,
    "simulate": _simulate,
    "assembly-predict": _assembly_predict,
    "reproduction": _reproduction,
    "balloon-map": _balloon_map,
    "kerf": _kerf,
    "explain": _explain,
    "explained": _explained,
    "templates": _templates,
}
