"""The formats of files and of what commands print with ``--json``: a JSON schema and an id each.

Most come from the documents that are written, some from the types of records (``of``); the rest is
written here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, get_args, get_type_hints

from pydantic import Field, TypeAdapter

from sbafab import actuators
from sbafab.assemblies.records import Assembly
from sbafab.cli.explain import DesignKey
from sbafab.cli.find import FindDocument
from sbafab.cli.kerf import KerfDocument
from sbafab.cli.nest import NestedDocument
from sbafab.cli.run import RunDocument
from sbafab.cli.sweep import SweepDocument
from sbafab.design.laminate_file import SCHEMA as LAMINATE_SCHEMA
from sbafab.design.laminate_file import LaminateDocument
from sbafab.documents import json_schema
from sbafab.errors import ERROR_SCHEMA
from sbafab.inspection.inspection import InspectionDocument
from sbafab.laminate.joints import PortKind
from sbafab.laminate.netlist import SCHEMA as NETS_SCHEMA
from sbafab.models.map_files import MapDocument
from sbafab.models.sensitivities import SensitivityRow
from sbafab.output import schema_ids as ids
from sbafab.output.artefacts import PredictDocument
from sbafab.output.checked import Checks
from sbafab.output.manifest import AssemblyManifest, JobManifest, Manifest
from sbafab.output.swap import ASSEMBLY_SCHEMA, JOB_SCHEMA, SCHEMA
from sbafab.pressing.schedule_files import PressDocument
from sbafab.reports.assembly_prediction import AssemblyPrediction
from sbafab.reproduction.comparison import ComparisonDocument
from sbafab.reproduction.page import ReproductionDocument
from sbafab.results.records import HistoryEntry, LabRow, Record
from sbafab.results.report import ReportDocument
from sbafab.rules.sentences import Explanation
from sbafab.search.compare import CompareDocument
from sbafab.search.quantities import QuantityName
from sbafab.search.target_yield import YieldEntry
from sbafab.simulators.simulator import NAMES as SIMULATORS

DIALECT = "https://json-schema.org/draft/2020-12/schema"
TEXT = {"type": "string"}
COUNT = {"type": "integer", "minimum": 0}


def number(*more: str) -> dict[str, Any]:
    return {"type": ["number", *more]}


def table(**properties: Any) -> dict[str, Any]:
    """An object with all of these; further keys may be added."""
    return {"type": "object", "required": list(properties), "properties": properties}


def of(record: type, *left_out: str, **changed: Any) -> dict[str, Any]:
    """Return an object with the fields of a record but those left out, each of its own type."""
    own = {
        name: TypeAdapter(hint).json_schema()
        for name, hint in get_type_hints(record, include_extras=True).items()
        if name not in (*left_out, *changed)
    }
    return table(**own, **changed)


def and_perhaps(body: dict[str, Any], **properties: Any) -> dict[str, Any]:
    """Add keys that may be missing, as those which a command prints beside what is in the file."""
    return {**body, "properties": {**body["properties"], **properties}}


def array(item: Mapping[str, Any]) -> dict[str, Any]:
    return {"type": "array", "items": dict(item)}


# Runs, records, measurements.


YES = {"type": "boolean"}


class YieldRunDocument(RunDocument, schema=RunDocument.SCHEMA):
    """A folder, and of --target-yield what was changed; figures as given and as changed."""

    reached: YieldEntry | None = Field(None, alias="yield")


class PrintedPrediction(PredictDocument, schema=PredictDocument.SCHEMA):
    """The contents of ``predict.json``, and what is printed besides."""

    failed: tuple[str, ...] = ()
    folder: str = ""
    sensitivity: tuple[SensitivityRow, ...] = ()


UTC = {**TEXT, "description": "UTC"}
NUMBERS = {
    "type": "object",
    "additionalProperties": number(),
    "description": "units stand in the keys",
}
ERRORS = {"type": "object", "additionalProperties": array(number()), "description": "sizes"}


def _row(kind: type[LabRow], **more: Any) -> dict[str, Any]:
    """Return the schema of a row of a lab's file, its measured numbers in groups."""
    grouped = {column for names in kind.GROUPS.values() for column in names}
    fields = kind.model_json_schema()["properties"].items()
    plain = {name: body for name, body in fields if name not in grouped}
    return table(**{**plain, "recorded": UTC, **more})


def _rows(**more: Any) -> dict[str, Any]:
    return {
        "records": array(_row(Record, numbers=NUMBERS, errors=ERRORS, **more)),
        "entries": array(_row(HistoryEntry, readings=NUMBERS, expired=YES, **more)),
    }


def _records() -> dict[str, Any]:
    more = {
        "actuator_sha256": {**TEXT, "description": "equal for all designs that build this"},
        "design": TEXT,
        "corrected_by": {"type": ["integer", "null"]},
    }
    return table(schema={"const": ids.RECORDS_SCHEMA}, **_rows(**more))


def _history() -> dict[str, Any]:
    device = table(serial=TEXT, design=TEXT, actuator_sha256=TEXT, **_rows())
    return table(schema={"const": ids.HISTORY_SCHEMA}, devices=array(device))


def _explain() -> dict[str, Any]:
    schema = {"const": ids.EXPLAIN_SCHEMA}
    rule = of(Explanation, schema=schema, rule=TEXT)
    keys = table(schema=schema, keys=array(of(DesignKey)))
    quantities = table(schema=schema, quantities=array(of(QuantityName)))
    return {"oneOf": [rule, keys, quantities, table(schema=schema, term=TEXT, meaning=TEXT)]}


def _explained() -> dict[str, Any]:
    rules = {"type": "object", "additionalProperties": of(Explanation)}
    return table(schema={"const": ids.EXPLAINED_SCHEMA}, rules=rules)


def _templates() -> dict[str, Any]:
    return array(table(name=TEXT, summary=TEXT))


def _simulate() -> dict[str, Any]:
    numbers = {"type": "object", "additionalProperties": number()}
    place = {**array(number()), "type": ["array", "null"], "minItems": 3, "maxItems": 3}
    moment = {
        "time": number(),
        "pressures": {**numbers, "description": "over the air outside, by chamber"},
        "height": {**number("null"), "description": "of the tip over the underside of the base"},
        "tip": {**place, "description": "by how much its middle moved since flat: x, y, z"},
        "tilt": number("null"),
        "volumes": {**numbers, "description": "of air, by chamber"},
    }
    loads = {
        "stress": {**number(), "description": "calculix: von Mises, the largest"},
        "work": {**number(), "description": "calculix: of the air"},
    }
    body = table(
        schema={"const": ids.SIMULATE_SCHEMA},
        units={"type": "object", "additionalProperties": TEXT},
    )
    return and_perhaps(
        body,
        folder=TEXT,
        simulator={"enum": [*SIMULATORS]},
        **moment,
        **loads,
        drift={**number(), "description": "sofa, mujoco: mm of the tip in the last 0.5 s"},
        overlap={**number(), "description": "sofa, mujoco: where films passed through each other"},
        diameter={**number(), "description": "sofa, round a tube: mm over the crowns"},
        rate={**number(), "description": "sofa, mujoco"},
        states={**array(and_perhaps(table(**moment), **loads)), "description": "in order of time"},
        stopped={"type": ["string", "null"], "description": "why it ended early, if it did"},
    )


def _design() -> dict[str, Any]:
    schema = actuators.schema(Assembly)
    return {key: value for key, value in schema.items() if key != "$schema"}


def _manifest(record: type[Manifest | JobManifest], identity: str) -> dict[str, Any]:
    body = record.model_json_schema(by_alias=True)
    body["properties"]["schema"] = {"const": identity}
    return body


def _laminate() -> dict[str, Any]:
    return LaminateDocument.model_json_schema(mode="serialization")


def _nets() -> dict[str, Any]:
    place = {**array(number()), "description": "x, y, mm", "minItems": 2, "maxItems": 2}
    layers = {
        **array({"type": "integer", "minimum": 1}),
        "description": "structural layers below and above, from 1",
        "minItems": 2,
        "maxItems": 2,
    }
    kind = {"enum": [*get_args(PortKind)]}
    port = and_perhaps(table(name=TEXT), at=place, layers=layers, kind=kind)
    nets = {
        "type": "object",
        "minProperties": 1,
        "additionalProperties": {**array({"oneOf": [TEXT, port]}), "minItems": 1},
        "description": "by name: ports and chambers of the design, or ports with their place",
    }
    return table(schema={"const": NETS_SCHEMA}, nets=nets)


def _error() -> dict[str, Any]:
    kinds = ["usage", "input", "too-large", "defect", "stopped", "memory", "files"]
    error = table(kind={"enum": kinds}, message=TEXT, exit_code={"type": "integer"})
    return table(schema={"const": ERROR_SCHEMA}, error=error)


# All formats.


class Format(NamedTuple):
    """A format: the id in its files, what it describes, and what its schema comes from."""

    identity: str
    about: str
    body: type | Callable[[], dict[str, Any]]


FORMATS: Mapping[str, Format] = {
    "design": Format(ids.DESIGN_SCHEMA, "design and assembly files (TOML)", _design),
    "checks": Format(Checks.SCHEMA, "`checks.json`, and what `check --json` prints", Checks),
    "laminate": Format(
        LAMINATE_SCHEMA, "`laminate.json`: layers with exact edges, films, inlets", _laminate
    ),
    "nets": Format(NETS_SCHEMA, "a netlist, for `check --nets`", _nets),
    "manifest": Format(
        SCHEMA, "`manifest.json` of a design's folder", lambda: _manifest(Manifest, SCHEMA)
    ),
    "job": Format(
        JOB_SCHEMA,
        "`manifest.json` of several designs cut together by `nest`",
        lambda: _manifest(JobManifest, JOB_SCHEMA),
    ),
    "assembly": Format(
        ASSEMBLY_SCHEMA,
        "`manifest.json` of an assembly's folder",
        lambda: _manifest(AssemblyManifest, ASSEMBLY_SCHEMA),
    ),
    "press": Format(PressDocument.SCHEMA, "`press.json`, the heat-press schedule", PressDocument),
    "predict": Format(
        PredictDocument.SCHEMA,
        "`predict.json`, and what `predict --json` prints of a design",
        PrintedPrediction,
    ),
    "find": Format(FindDocument.SCHEMA, "what `find --json` prints", FindDocument),
    "compare": Format(CompareDocument.SCHEMA, "what `compare --json` prints", CompareDocument),
    "run": Format(
        RunDocument.SCHEMA,
        "what `generate`, `cut`, `press` and `mesh` print with `--json`",
        YieldRunDocument,
    ),
    "nested": Format(NestedDocument.SCHEMA, "what `nest --json` prints", NestedDocument),
    "records": Format(ids.RECORDS_SCHEMA, "what `record --json` prints of records", _records),
    "history": Format(ids.HISTORY_SCHEMA, "what `record --export FILE.json` writes", _history),
    "report": Format(ReportDocument.SCHEMA, "what `record --report --json` prints", ReportDocument),
    "sweep": Format(SweepDocument.SCHEMA, "what `sweep --json` prints", SweepDocument),
    "simulate": Format(
        ids.SIMULATE_SCHEMA,
        "`result.json` of a simulator's folder, and what `simulate --json` prints",
        _simulate,
    ),
    "assembly-predict": Format(
        ids.ASSEMBLY_PREDICT_SCHEMA,
        "what `predict --json` prints of an assembly",
        AssemblyPrediction,
    ),
    "reproduction": Format(
        ReproductionDocument.SCHEMA,
        "`reproduction.json`, and what `reproduce --json` prints",
        ReproductionDocument,
    ),
    "comparison": Format(
        ComparisonDocument.SCHEMA, "what `reproduce SOURCE --json` prints", ComparisonDocument
    ),
    "balloon-map": Format(MapDocument.SCHEMA, "what `map --to FILE.json` writes", MapDocument),
    "inspection": Format(
        InspectionDocument.SCHEMA,
        "what `inspect` writes, and prints with `--json`",
        InspectionDocument,
    ),
    "kerf": Format(KerfDocument.SCHEMA, "what `kerf --json` prints", KerfDocument),
    "explain": Format(ids.EXPLAIN_SCHEMA, "what `explain NAME --json` prints", _explain),
    "explained": Format(
        ids.EXPLAINED_SCHEMA, "what `explain --json` prints of all rules", _explained
    ),
    "templates": Format(
        ids.TEMPLATES_SCHEMA, "what `new --json` prints: a list, without id", _templates
    ),
    "error": Format(
        ERROR_SCHEMA, "what any command prints with `--json` when it ends in an error", _error
    ),
}


def schema_of(name: str) -> dict[str, Any]:
    """Return the JSON schema of a format in ``FORMATS``."""
    form = FORMATS[name]
    head = {"$schema": DIALECT, "$id": f"urn:{form.identity.replace('/', ':')}"}
    body = form.body
    return {**head, **(json_schema(body, form.identity) if isinstance(body, type) else body())}
