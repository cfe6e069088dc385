"""JSON schemas of what the program reads and writes, each with a stable id."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, get_args

from sbafab.errors import ERROR_SCHEMA
from sbafab.output.checking import CHECKS_SCHEMA
from sbafab.output.swap import ASSEMBLY_SCHEMA, SCHEMA
from sbafab.rules.finding import Verdict

DIALECT = "https://json-schema.org/draft/2020-12/schema"
DESIGN_SCHEMA = "sbafab/design@1"

SCHEMAS: Mapping[str, tuple[str, str]] = {
    "design": (DESIGN_SCHEMA, "design and assembly files (TOML)"),
    "checks": (CHECKS_SCHEMA, "`checks.json`, and what `check --json` prints"),
    "manifest": (SCHEMA, "`manifest.json` of a design's folder"),
    "assembly": (ASSEMBLY_SCHEMA, "`manifest.json` of an assembly's folder"),
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


def _assembly() -> dict[str, Any]:
    from sbafab.output.manifest_records import AssemblyManifest

    return AssemblyManifest.model_json_schema(by_alias=True)


def _number(*more: str) -> dict[str, Any]:
    return {"type": ["number", *more]}


def _table(**properties: Any) -> dict[str, Any]:
    """An object with all of these; further keys may be added."""
    return {"type": "object", "required": list(properties), "properties": properties}


TEXT = {"type": "string"}
COUNT = {"type": "integer", "minimum": 0}


def _checks() -> dict[str, Any]:
    where = _table(
        interface={"type": ["integer", "null"], "description": "counted from 1, bottom to top"},
        layers={"type": "array", "items": COUNT},
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
    kit = {"type": "array", "items": {"type": "object"}}
    return _table(
        schema={"const": CHECKS_SCHEMA},
        design={**TEXT, "description": "name of the design or assembly, or the folder's path"},
        source={"enum": ["design", "as-built"]},
        summary=_table(holds={"type": "boolean"}, **counts),
        kits=kit,
        findings={"type": "array", "items": finding},
    )


def _error() -> dict[str, Any]:
    kinds = ["usage", "input", "too-large", "defect", "stopped", "memory", "files"]
    error = _table(kind={"enum": kinds}, message=TEXT, exit_code={"type": "integer"})
    return _table(schema={"const": ERROR_SCHEMA}, error=error)


_BODIES = {
    "design": _design,
    "checks": _checks,
    "manifest": _manifest,
    "assembly": _assembly,
    "error": _error,
}
