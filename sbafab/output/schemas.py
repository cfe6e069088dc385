"""What JSON schemas are put together from."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, get_args

from sbafab.errors import ERROR_SCHEMA
from sbafab.output.checked import CHECKS_SCHEMA
from sbafab.output.schema_ids import (
    ASSEMBLY_PREDICT_SCHEMA,
    EXPLAIN_SCHEMA,
    EXPLAINED_SCHEMA,
    KERF_SCHEMA,
    MAP_SCHEMA,
    NESTED_SCHEMA,
    PREDICTION_SCHEMA,
    RECORDS_SCHEMA,
    REPORT_SCHEMA,
    REPRODUCTION_SCHEMA,
    RUN_SCHEMA,
    SIMULATE_SCHEMA,
    SWEEP_SCHEMA,
    TEMPLATES_SCHEMA,
)
from sbafab.output.swap import ASSEMBLY_SCHEMA, JOB_SCHEMA, SCHEMA
from sbafab.pressing.tables import PRESS_SCHEMA
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


# The ids of what commands print with ``--json``, and of what ``map`` writes (as in models).


# JSON schemas of what commands print with ``--json`` of runs and records.


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


# JSON schemas of what the program reads and writes, each with a stable id.


DIALECT = "https://json-schema.org/draft/2020-12/schema"
DESIGN_SCHEMA = "sbafab/design@1"
FIND_SCHEMA = "sbafab/find@1"

SCHEMAS: Mapping[str, tuple[str, str]] = {
    "design": (DESIGN_SCHEMA, "design and assembly files (TOML)"),
    "checks": (CHECKS_SCHEMA, "`checks.json`, and what `check --json` prints"),
    "manifest": (SCHEMA, "`manifest.json` of a design's folder"),
    "job": (JOB_SCHEMA, "`manifest.json` of several designs cut together by `nest`"),
    "assembly": (ASSEMBLY_SCHEMA, "`manifest.json` of an assembly's folder"),
    "press": (PRESS_SCHEMA, "`press.json`, the heat-press schedule"),
    "predict": (PREDICTION_SCHEMA, "`predict.json`, and what `predict --json` prints of a design"),
    "find": (FIND_SCHEMA, "what `find --json` prints"),
    "run": (RUN_SCHEMA, "what `generate`, `cut`, `press` and `mesh` print with `--json`"),
    "nested": (NESTED_SCHEMA, "what `nest --json` prints"),
    "records": (RECORDS_SCHEMA, "what `record --json` prints of records"),
    "report": (REPORT_SCHEMA, "what `record --report --json` prints"),
    "sweep": (SWEEP_SCHEMA, "what `sweep --json` prints"),
    "simulate": (
        SIMULATE_SCHEMA,
        "`result.json` of a simulator's folder, and what `simulate --json` prints",
    ),
    "assembly-predict": (
        ASSEMBLY_PREDICT_SCHEMA,
        "what `predict --json` prints of an assembly",
    ),
    "reproduction": (
        REPRODUCTION_SCHEMA,
        "`reproduction.json`, and what `reproduce --json` prints",
    ),
    "balloon-map": (MAP_SCHEMA, "what `map --to FILE.json` writes"),
    "kerf": (KERF_SCHEMA, "what `kerf --json` prints"),
    "explain": (EXPLAIN_SCHEMA, "what `explain RULE --json` prints"),
    "explained": (EXPLAINED_SCHEMA, "what `explain --json` prints of all rules"),
    "templates": (TEMPLATES_SCHEMA, "what `templates --json` prints: a list, without id"),
    "error": (ERROR_SCHEMA, "what any command prints with `--json` when it ends in an error"),
}
"""Formats by name: the id that stands in the files, and what it describes."""


def schema_of(name: str) -> dict[str, Any]:
    """The JSON schema of a format in ``SCHEMAS``."""
    identity = SCHEMAS[name][0]
    head = {"$schema": DIALECT, "$id": f"urn:{identity.replace('/', ':')}"}
    body = _BODIES.get(name) or BODIES[name]
    return {**head, **body()}


def _design() -> dict[str, Any]:
    from sbafab.actuators import schema
    from sbafab.assemblies.records import Assembly

    return {key: value for key, value in schema(Assembly).items() if key != "$schema"}


def _manifest() -> dict[str, Any]:
    from sbafab.output.manifest import Manifest

    return Manifest.model_json_schema(by_alias=True)


def _job() -> dict[str, Any]:
    from sbafab.output.manifest import JobManifest

    return _of_batch(JobManifest.model_json_schema(by_alias=True), JOB_SCHEMA)


def _assembly() -> dict[str, Any]:
    from sbafab.output.manifest import AssemblyManifest

    return _of_batch(AssemblyManifest.model_json_schema(by_alias=True), ASSEMBLY_SCHEMA)


def _of_batch(body: dict[str, Any], identity: str) -> dict[str, Any]:
    """The schema of a record that two formats share, for the one with this id."""
    body["properties"]["schema"] = {"const": identity}
    return body


def _checks() -> dict[str, Any]:
    counts = dict.fromkeys(get_args(Verdict), COUNT)
    advice = table(
        target_yield=number(),
        bond_width={**number("null"), "description": "mm"},
        mask_overhang={**number("null"), "description": "mm"},
        measured=number("null"),
        interval={"type": ["array", "null"], "items": number()},
        message=TEXT,
    )
    sizes = {"type": "object", "additionalProperties": number()}
    printed = {
        "sizes": {
            "description": "mm by name, of each design by its name",
            "type": "object",
            "additionalProperties": sizes,
        },
        "notes": array(TEXT),
        "advice": {**advice, "description": "of --target-yield"},
    }
    found = table(
        schema={"const": CHECKS_SCHEMA},
        design={**TEXT, "description": "name of the design or assembly, or the folder's path"},
        source={"enum": ["design", "as-built"]},
        summary=table(holds={"type": "boolean"}, **counts),
        kits=array({"type": "object"}),
        findings=array(finding()),
    )
    return and_perhaps(found, **printed)


def _error() -> dict[str, Any]:
    kinds = ["usage", "input", "too-large", "defect", "stopped", "memory", "files"]
    error = table(kind={"enum": kinds}, message=TEXT, exit_code={"type": "integer"})
    return table(schema={"const": ERROR_SCHEMA}, error=error)


def _press() -> dict[str, Any]:
    from pydantic import TypeAdapter

    from sbafab.pressing.schedule import Schedule

    body = TypeAdapter(Schedule).json_schema(mode="serialization")
    body["properties"] = {"schema": {"const": PRESS_SCHEMA}, **body["properties"]}
    body["properties"]["batch"] = _batch()
    body["required"] = ["schema", *body["required"]]
    return body


def _batch() -> dict[str, Any]:
    pattern = table(pattern=TEXT, each=COUNT, cycles=array(COUNT))
    place = {**array(number()), "minItems": 2, "maxItems": 2}
    times = ("press_minutes", "hands_minutes", "total_minutes")
    count_or_null = {**COUNT, "type": ["integer", "null"]}
    perhaps = {"type": ["integer", "null"], "minimum": 1}
    entry = table(
        day=COUNT,
        start_minutes={**number(), "description": "after the start of the shift"},
        minutes=number(),
        task={"enum": ["cut", "press", "finish"]},
        cycle=perhaps,
        step=perhaps,
        copies={**array(COUNT), "minItems": 2, "maxItems": 2, "description": "first and last"},
    )
    return table(
        copies=COUNT,
        at_once=COUNT,
        at_once_at_most=COUNT,
        cycles={**array(COUNT), "description": "copies pressed in each cycle"},
        places_mm=array(place),
        **{name: number() if name == "hands_minutes" else number("null") for name in times},
        a_day_one_by_one=count_or_null,
        a_day_in_batches=count_or_null,
        shift_minutes=number(),
        plan={**array(entry), "description": "empty where no minutes are stated"},
        patterns=array(pattern),
    )


def _predict() -> dict[str, Any]:
    asked = table(
        pressures_kpa=array(number()),
        flow_ml_min=number(),
        volumes_ul=array(number()),
        press_factor=number(),
        contact_factor=number(),
        pocket_loss={**number(), "description": "mm"},
        modulus_mpa=number("null"),
    )
    design_with = {
        "type": "boolean",
        "description": "false where another model gives the same quantity, and that one is to "
        "design with",
    }
    measured = _counterpart()
    measured["type"] = ["object", "null"]
    measured["description"] = (
        "what the paper measured, where validation shows the model to be off by more than a "
        "quarter of it"
    )
    between = {
        **array(number()),
        "type": ["array", "null"],
        "description": "bounds of a drawn pocket that is taken for a disc",
    }
    figure = table(
        group=TEXT,
        name=TEXT,
        value=number(),
        unit=TEXT,
        model=TEXT,
        trust=TEXT,
        design_with=design_with,
        measured=measured,
        between=between,
    )
    curve = {"label": TEXT, "x": array(number()), "y": array(number())}
    relation = table(
        name=TEXT,
        title=TEXT,
        x={**TEXT, "description": "label of the axis, with its unit"},
        y={**TEXT, "description": "label of the axis, with its unit"},
        lines=array(table(**curve, model=TEXT, trust=TEXT)),
        measured=array(table(**curve, error=array(number()))),
        plot={**TEXT, "description": "its file in the folder"},
    )
    found = table(
        schema={"const": PREDICTION_SCHEMA},
        name=TEXT,
        family=TEXT,
        design_sha256=TEXT,
        generator=TEXT,
        asked=asked,
        verdict=array(table(quantity=TEXT, figure=TEXT, note=TEXT)),
        figures=array(figure),
        left_out=array(table(name=TEXT, reason=TEXT)),
        relations=array(relation),
    )
    return and_perhaps(found, failed=array(TEXT), folder=TEXT)


def _counterpart() -> dict[str, Any]:
    return table(
        sentence=TEXT,
        value=number(),
        error={**number(), "description": "0 where the paper gives none"},
        unit=TEXT,
        actuator=TEXT,
        source=TEXT,
        model_gave={**number(), "description": "the same model for that actuator, in the unit"},
    )


def _find() -> dict[str, Any]:
    figures = {"type": "object", "additionalProperties": number()}
    shown = table(
        keys={"type": "object", "description": "keys of the design that were found"},
        figures={**figures, "description": "quantities in mm, deg, N, g or a share"},
    )
    return table(
        schema={"const": FIND_SCHEMA},
        holds={"type": "boolean"},
        file={"type": ["string", "null"], "description": "the design file, null where none holds"},
        started_from=TEXT,
        tries=COUNT,
        is_cut_short={"type": "boolean", "description": "whether more tries might lead further"},
        best=shown,
        full_stroke={**number("null"), "description": "mm, of the best, as predict has it"},
        measured={
            "type": "object",
            "description": "what the paper measured, by quantity, where the model is off by more "
            "than a quarter of it",
            "additionalProperties": _counterpart(),
        },
        missed=array(TEXT),
        binds=array(table(key=TEXT, value={}, breaks=TEXT)),
        range_ends=array(table(key=TEXT, value={}, low=number(), high=number())),
        without_room=array(table(rule=TEXT, measured=number(), unit=TEXT, place=TEXT)),
        front=array(shown),
        on_front=COUNT,
    )


_BODIES = {
    "design": _design,
    "checks": _checks,
    "manifest": _manifest,
    "job": _job,
    "assembly": _assembly,
    "press": _press,
    "predict": _predict,
    "find": _find,
    "error": _error,
}
