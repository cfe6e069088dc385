"""JSON schemas of what the program reads and writes, each with a stable id."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, get_args

from sbafab.errors import ERROR_SCHEMA
from sbafab.output import printed
from sbafab.output.checking import CHECKS_SCHEMA
from sbafab.output.predicting import SCHEMA as PREDICT_SCHEMA
from sbafab.output.schema_parts import COUNT, TEXT, and_perhaps, array, finding, number, table
from sbafab.output.swap import ASSEMBLY_SCHEMA, JOB_SCHEMA, SCHEMA
from sbafab.pressing.tables import PRESS_SCHEMA
from sbafab.rules.finding import Verdict

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
    "predict": (PREDICT_SCHEMA, "`predict.json`, and what `predict --json` prints of a design"),
    "find": (FIND_SCHEMA, "what `find --json` prints"),
    "run": (printed.RUN_SCHEMA, "what `generate`, `cut`, `press` and `mesh` print with `--json`"),
    "nested": (printed.NESTED_SCHEMA, "what `nest --json` prints"),
    "records": (printed.RECORDS_SCHEMA, "what `record --json` prints of records"),
    "report": (printed.REPORT_SCHEMA, "what `record --report --json` prints"),
    "sweep": (printed.SWEEP_SCHEMA, "what `sweep --json` prints"),
    "simulate": (
        printed.SIMULATE_SCHEMA,
        "`result.json` of a simulator's folder, and what `simulate --json` prints",
    ),
    "assembly-predict": (
        printed.ASSEMBLY_PREDICT_SCHEMA,
        "what `predict --json` prints of an assembly",
    ),
    "reproduction": (
        printed.REPRODUCTION_SCHEMA,
        "`reproduction.json`, and what `reproduce --json` prints",
    ),
    "balloon-map": (printed.MAP_SCHEMA, "what `map --to FILE.json` writes"),
    "kerf": (printed.KERF_SCHEMA, "what `kerf --json` prints"),
    "explain": (printed.EXPLAIN_SCHEMA, "what `explain RULE --json` prints"),
    "explained": (printed.EXPLAINED_SCHEMA, "what `explain --json` prints of all rules"),
    "templates": (printed.TEMPLATES_SCHEMA, "what `templates --json` prints: a list, without id"),
    "error": (ERROR_SCHEMA, "what any command prints with `--json` when it ends in an error"),
}
"""Formats by name: the id that stands in the files, and what it describes."""


def schema_of(name: str) -> dict[str, Any]:
    """The JSON schema of a format in ``SCHEMAS``."""
    from sbafab.output.printed_schemas import BODIES as PRINTED

    identity = SCHEMAS[name][0]
    head = {"$schema": DIALECT, "$id": f"urn:{identity.replace('/', ':')}"}
    body = _BODIES.get(name) or PRINTED[name]
    return {**head, **body()}


def _design() -> dict[str, Any]:
    from sbafab.actuators import schema
    from sbafab.assemblies.records import Assembly

    return {key: value for key, value in schema(Assembly).items() if key != "$schema"}


def _manifest() -> dict[str, Any]:
    from sbafab.output.manifest_records import Manifest

    return Manifest.model_json_schema(by_alias=True)


def _job() -> dict[str, Any]:
    from sbafab.output.manifest_records import JobManifest

    return _of_batch(JobManifest.model_json_schema(by_alias=True), JOB_SCHEMA)


def _assembly() -> dict[str, Any]:
    from sbafab.output.manifest_records import AssemblyManifest

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
        schema={"const": PREDICT_SCHEMA},
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
