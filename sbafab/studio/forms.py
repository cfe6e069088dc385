"""The form of each family, from the JSON schema, and the requests of the page."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pydantic import BaseModel, Field, ValidationError

from sbafab.api import designs
from sbafab.api.designs import NAMED, ROW, JsonSchema, family_tables, schema_keys
from sbafab.errors import SbafabError
from sbafab.studio import design_files
from sbafab.version import __version__

PLACING = ("on", "at", "angle", "turn", "along", "offset", "glue", "note")
"""Keys of a part's position; its form ends with them."""
FormField = dict[str, Any]
# key: least, most, step of its slider; values beyond it are typed.
SLIDERS: dict[str, tuple[float, float, float]] = {
    "stack.balloons": (1, 24, 1),
    "chamber.diameter": (2, 15, 0.1),
    "chamber.count": (2, 8, 1),
    "chamber.width": (5, 25, 0.25),
    "chamber.length": (8, 40, 0.5),
    "lumen.diameter": (0.5, 8, 0.1),
    "bore.diameter": (0.5, 3, 0.02),
    "bond.width": (0.3, 2, 0.05),
    "mask.overhang": (0.1, 1.5, 0.05),
    "fillet.radius": (0, 3, 0.1),
    "inlet.tab_length": (2, 15, 0.25),
    "tube.outer_diameter": (6, 40, 0.5),
    "films.tpe.thickness": (0.01, 0.15, 0.001),
    "films.ptfe.thickness": (0.01, 0.1, 0.001),
}
FIRST = ("stack", "chamber", "lumen", "bore", "bond", "mask", "fillet", "inlet", "tube", "sheet")
"""Sections that shape the actuator; the form begins with them."""
UNITS = (
    (re.compile(r"temperature_c$|melting_point$|temperature_limit$"), "\u00b0C"),
    (re.compile(r"_kpa$"), "kPa"),
    (re.compile(r"minutes$"), "min"),
    (re.compile(r"seconds$"), "s"),
    (re.compile(r"density$"), "kg/m\u00b3"),
    (re.compile(r"(^|[._])(turn|angle)$"), "\u00b0"),
    (re.compile(r"_speed$"), "mm/s"),
    (re.compile(r"pad_hardness$"), "Shore A"),
)


def families(schema: JsonSchema) -> dict[str, list[FormField]]:
    """Return the fields of every family of single designs."""
    return {
        name: sorted(_fields(table, schema), key=_rank)
        for name, table in family_tables(schema)
        if name != "assembly"
    }


def cards(schema: JsonSchema) -> dict[str, dict[str, str]]:
    """Return the words and the drawing for choosing each family, from its record."""
    return {
        name: {
            "title": table["title"] if "symbol" in table else name,
            "symbol": table.get("symbol", ""),
            "meaning": " ".join(table.get("description", "").split()),
        }
        for name, table in family_tables(schema)
        if name != "assembly"
    }


def summaries() -> dict[str, str]:
    """Return the templates, each with the first sentence of its file."""
    first = {name: designs.template(name).partition("\n")[0] for name in designs.templates()}
    return {name: line.lstrip("# ") if line[:1] == "#" else "" for name, line in first.items()}


def assembly(schema: JsonSchema) -> dict[str, Any]:
    """Return the fields of an assembly, and of a part by kind, whose keys start at its table."""
    table = _named("Assembly", schema)
    assembly_fields = sorted(_fields(table, schema), key=_rank)
    (parts,) = table["properties"]["parts"]["patternProperties"].values()
    kinds = {}
    for kind, reference in parts["discriminator"]["mapping"].items():
        part = _named(reference, schema)
        fields = [field for field in _fields(part, schema) if field["key"] != "kind"]
        needed = set(part.get("required", ()))
        kinds[kind] = {
            "meaning": part["properties"]["kind"].get("description", ""),
            "fields": sorted(fields, key=lambda field: field["key"] in PLACING),
            "needs": [field["key"] for field in fields if field["key"] in needed],
        }
    return {"fields": assembly_fields, "kinds": kinds}


def keys(schema: JsonSchema) -> set[str]:
    """Return every dotted key of any family, and of an assembly."""
    fields = [field for group in families(schema).values() for field in group]
    return {field["key"] for field in [*fields, *assembly(schema)["fields"]]}


def _rank(field: FormField) -> int:
    section, dot, _ = field["key"].partition(".")
    return (FIRST.index(section) if section in FIRST else len(FIRST)) if dot else -1


def _fields(table: JsonSchema, schema: JsonSchema) -> Iterator[FormField]:
    """Yield the fields of a table; keys of tables named by the user have separate views."""
    for key, rule in schema_keys(table, schema):
        ways = rule.get("anyOf", [rule])
        is_own = ROW in key or NAMED in key.split(".")
        is_table = any(way.get("type") == "object" or "$ref" in way for way in ways)
        if key != "family" and not is_own and not is_table:
            yield _field(key, rule)


def _field(key: str, rule: JsonSchema) -> FormField:
    ways = rule.get("anyOf", [rule])
    kinds = [way.get("type") for way in ways]
    number = next((way for way in ways if way.get("type") in {"number", "integer"}), None)
    is_length = number is not None and any("mm" in way.get("pattern", "") for way in ways)
    choices = next((way["enum"] for way in ways if "enum" in way), None)
    unit = next((unit for pattern, unit in UNITS if pattern.search(key)), "")
    field: FormField = {
        "key": key,
        "meaning": " ".join(rule.get("description", "").split()),
        "default": rule.get("default"),
        "unit": "mm" if is_length else unit,
        "kind": _kind(kinds, choices),
        "list": "array" in kinds,
        "optional": "null" in kinds,
    }
    if choices:
        field["choices"] = choices
    if "items" in rule and "enum" in rule["items"]:
        field["choices"], field["kind"] = rule["items"]["enum"], "set"
    if number is not None:
        field["least"] = number.get("minimum", number.get("exclusiveMinimum"))
        field["most"] = number.get("maximum", number.get("exclusiveMaximum"))
    if key in SLIDERS:
        field["slider"] = SLIDERS[key]
    return field


def _kind(kinds: list[str | None], choices: object) -> str:
    names = {"boolean": "switch", "integer": "whole", "number": "number", "array": "list"}
    named = [name for kind, name in names.items() if kind in kinds]
    return "choice" if choices else next(iter(named), "text")


def _named(reference: str, schema: JsonSchema) -> JsonSchema:
    definition: JsonSchema = schema["$defs"][reference.rpartition("/")[2]]
    return definition


# Requests of the page.


def started(folder: Path) -> dict[str, Any]:
    """Return the first answer to the page, without its design."""
    schema = designs.schema()
    return {
        "version": __version__,
        "folder": str(folder),
        "files": design_files.listed(folder),
        "templates": designs.templates(),
        "summaries": summaries(),
        "families": families(schema),
        "cards": cards(schema),
        "assembly": assembly(schema),
    }


def table(body: bytes) -> dict[str, Any]:
    """Return the table of a request. Raises SbafabError if there is none."""
    try:
        parsed = json.loads(body)
    except (ValueError, RecursionError):
        parsed = None
    if not isinstance(parsed, dict):
        raise SbafabError("the request is not a JSON object")
    return parsed


class PageRequest(BaseModel):
    """A request of a page for a job: its ``tab``, text and edits of the design, the name of its
    file, keys of its shapes, and the requested pose.
    """

    tab: str = Field("", max_length=40)
    text: str
    edits: list[tuple[str, str | None]] = []
    name: str = ""
    has: list[str] = []
    pose: dict[str, Any] = {}


def job(folder: Path, request: dict[str, Any]) -> dict[str, Any]:
    """Return the job of a request: design text, edits, and paths that the page cannot choose.

    Raises SbafabError.
    """
    try:
        stated = {key: value for key, value in request.items() if value is not None}
        read = PageRequest.model_validate(stated)
    except ValidationError:
        raise SbafabError(
            "a request needs a text, edits as [key, value], and a pose as a table"
        ) from None
    is_file = read.name.endswith(".toml") and "/" not in read.name
    path = read.name if is_file else "design.toml"
    return {**read.model_dump(exclude={"name"}), "folder": str(folder), "path": path}
