"""JSON schemas of what the program reads and writes, each with a stable id."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, get_args

from sbafab.errors import ERROR_SCHEMA
from sbafab.output.checking import CHECKS_SCHEMA
from sbafab.output.predicting import SCHEMA as PREDICT_SCHEMA
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
    "error": (ERROR_SCHEMA, "what any command prints with `--json` when it ends in an error"),
}
"""Formats by name: the id that stands in the files, and what it describes."""


def schema_of(name: str) -> dict[str, Any]:
    """The JSON schema of a format in ``SCHEMAS``."""
    identity = SCHEMAS[name][0]
    head = {"$schema": DIALECT, "$id": f"urn:{identity.replace('/', ':')}"}
    return {**head, **_BODIES[name]()}


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


def _number(*more: str) -> dict[str, Any]:
    return {"type": ["number", *more]}


def _table(**properties: Any) -> dict[str, Any]:
    """An object with all of these; further keys may be added."""
    return {"type": "object", "required": list(properties), "properties": properties}


def _and_perhaps(table: dict[str, Any], **properties: Any) -> dict[str, Any]:
    """The same with keys that may be missing: what a command prints beside what is in the file."""
    return {**table, "properties": {**table["properties"], **properties}}


def _list(item: Mapping[str, Any]) -> dict[str, Any]:
    return {"type": "array", "items": dict(item)}


TEXT = {"type": "string"}
COUNT = {"type": "integer", "minimum": 0}


def _checks() -> dict[str, Any]:
    where = _table(
        interface={"type": ["integer", "null"], "description": "counted from 1, bottom to top"},
        layers=_list(COUNT),
        x={**_number("null"), "description": "mm"},
        y={**_number("null"), "description": "mm"},
    )
    finding = _table(
        rule=TEXT,
        verdict={"enum": list(get_args(Verdict))},
        limit=_number("null"),
        measured=_number("null"),
        unit=TEXT,
        where=where,
        message=TEXT,
    )
    counts = dict.fromkeys(get_args(Verdict), COUNT)
    advice = _table(
        target_yield=_number(),
        bond_width={**_number("null"), "description": "mm"},
        mask_overhang={**_number("null"), "description": "mm"},
        measured=_number("null"),
        interval={"type": ["array", "null"], "items": _number()},
        message=TEXT,
    )
    sizes = {"type": "object", "additionalProperties": _number()}
    printed = {
        "sizes": {
            "description": "mm by name, of each design by its name",
            "type": "object",
            "additionalProperties": sizes,
        },
        "notes": _list(TEXT),
        "advice": {**advice, "description": "of --target-yield"},
    }
    found = _table(
        schema={"const": CHECKS_SCHEMA},
        design={**TEXT, "description": "name of the design or assembly, or the folder's path"},
        source={"enum": ["design", "as-built"]},
        summary=_table(holds={"type": "boolean"}, **counts),
        kits=_list({"type": "object"}),
        findings=_list(finding),
    )
    return _and_perhaps(found, **printed)


def _error() -> dict[str, Any]:
    kinds = ["usage", "input", "too-large", "defect", "stopped", "memory", "files"]
    error = _table(kind={"enum": kinds}, message=TEXT, exit_code={"type": "integer"})
    return _table(schema={"const": ERROR_SCHEMA}, error=error)


def _press() -> dict[str, Any]:
    from pydantic import TypeAdapter

    from sbafab.pressing.schedule import Schedule

    body = TypeAdapter(Schedule).json_schema(mode="serialization")
    body["properties"] = {"schema": {"const": PRESS_SCHEMA}, **body["properties"]}
    body["properties"]["batch"] = _batch()
    body["required"] = ["schema", *body["required"]]
    return body


def _batch() -> dict[str, Any]:
    pattern = _table(pattern=TEXT, each=COUNT, cycles=_list(COUNT))
    place = {**_list(_number()), "minItems": 2, "maxItems": 2}
    times = ("press_minutes", "hands_minutes", "total_minutes")
    return _table(
        copies=COUNT,
        at_once=COUNT,
        at_once_at_most=COUNT,
        cycles={**_list(COUNT), "description": "copies pressed in each cycle"},
        places_mm=_list(place),
        **dict.fromkeys(times, _number()),
        a_day_one_by_one=COUNT,
        a_day_in_batches=COUNT,
        patterns=_list(pattern),
    )


def _predict() -> dict[str, Any]:
    asked = _table(
        pressures_kpa=_list(_number()),
        flow_ml_min=_number(),
        volumes_ul=_list(_number()),
        press_factor=_number(),
        contact_factor=_number(),
        pocket_loss={**_number(), "description": "mm"},
        modulus_mpa=_number("null"),
    )
    design_with = {
        "type": "boolean",
        "description": "false where another model gives the same quantity, and that one is to "
        "design with",
    }
    figure = _table(
        group=TEXT,
        name=TEXT,
        value=_number(),
        unit=TEXT,
        model=TEXT,
        trust=TEXT,
        design_with=design_with,
    )
    curve = {"label": TEXT, "x": _list(_number()), "y": _list(_number())}
    relation = _table(
        name=TEXT,
        title=TEXT,
        x={**TEXT, "description": "label of the axis, with its unit"},
        y={**TEXT, "description": "label of the axis, with its unit"},
        lines=_list(_table(**curve, model=TEXT, trust=TEXT)),
        measured=_list(_table(**curve, error=_list(_number()))),
        plot={**TEXT, "description": "its file in the folder"},
    )
    found = _table(
        schema={"const": PREDICT_SCHEMA},
        name=TEXT,
        family=TEXT,
        design_sha256=TEXT,
        generator=TEXT,
        asked=asked,
        figures=_list(figure),
        left_out=_list(_table(name=TEXT, reason=TEXT)),
        relations=_list(relation),
    )
    return _and_perhaps(found, failed=_list(TEXT), folder=TEXT)


def _find() -> dict[str, Any]:
    figures = {"type": "object", "additionalProperties": _number()}
    shown = _table(
        keys={"type": "object", "description": "keys of the design that were found"},
        figures={**figures, "description": "quantities in mm, N, g, kPa, ul, s or a share"},
    )
    return _table(
        schema={"const": FIND_SCHEMA},
        holds={"type": "boolean"},
        file={"type": ["string", "null"], "description": "the design file, null where none holds"},
        started_from=TEXT,
        tries=COUNT,
        best=shown,
        missed=_list(TEXT),
        binds=_list(_table(key=TEXT, value={}, breaks=TEXT)),
        without_room=_list(_table(rule=TEXT, measured=_number(), unit=TEXT, place=TEXT)),
        front=_list(shown),
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
