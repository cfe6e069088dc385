"""The page of a design file's keys, from the JSON schema that the program gives out."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

import sbafab

HEAD = """# Keys of a design file

Written from the JSON schema, which `sbafab schema` prints. Lengths are millimetres or carry a unit (`"0.75 mm"`,
`"38 um"`, `"6 in"`). Every key but `family` and `name` may be left out: the kit gives it, or it has the default below,
which is the paper's value where the paper gives one. `--set section.key=value` overrides a key on the command line.

To have an editor complete and check keys, save the schema (`sbafab schema > design.schema.json`) and begin a design
file with `#:schema ./design.schema.json`, which Taplo and its editor plug-ins read.
"""

ALL = "Shared by {}, which `family` names.\n"
LENGTH = "^\\s*\\+?(?:"
"""How the pattern of a length with a unit begins."""


def page(schema: Mapping[str, Any] | None = None) -> str:
    """The whole page, as MyST Markdown: shared sections first, then those of each family."""
    schema = schema or sbafab.schema()
    found = schema["$defs"]
    families = _families(schema)
    usual = found[next(iter(families))]
    sections = {name: _sections(found[name], found) for name in families}
    shared = {
        key: record
        for key, record in _sections(usual, found).items()
        if all(sections[name].get(key) == record for name in families)
    }
    *others, last = (f"`{family}`" for family in families.values())
    common = ALL.format(f"{', '.join(others)} and {last}")
    parts = [HEAD, "\n## All families\n", common, *_table("", usual, found)]
    for key, record in shared.items():
        parts += [f"\n### [{key}]\n", *_section(key, record, found)]
    for name, family in families.items():
        parts.append(f"\n## Family {family}\n\n{found[name]['description']}\n")
        parts += _further(found[name], usual, found)
        for key, record in sections[name].items():
            if key not in shared:
                parts += [f"\n### [{key}] of {family}\n", *_section(key, record, found)]
    parts += ["\n## Assemblies\n", "See [assemblies](../assemblies.md) for what each part is.\n"]
    parts += _table("", found["Assembly"], found)
    return "\n".join(parts) + "\n"


def _families(schema: Mapping[str, Any]) -> dict[str, str]:
    """The record of every family of single designs, with the family's name."""
    names = map(_name, schema["oneOf"])
    family_of = {name: schema["$defs"][name]["properties"]["family"] for name in names}
    return {
        name: family["const"]
        for name, family in family_of.items()
        if "stack" in schema["$defs"][name]["properties"]
    }


def _further(record: dict[str, Any], usual: dict[str, Any], found: dict[str, Any]) -> Iterator[str]:
    """Keys that stand outside tables, and are not those of all families; then rows of lists."""
    further = {k: v for k, v in record["properties"].items() if k not in usual["properties"]}
    plain = {key: value for key, value in further.items() if "$ref" not in value}
    if plain:
        yield from _table("", {"properties": plain}, found)
    for key, value in further.items():
        rows = value.get("items") or _named_rows(value, found)
        if "$ref" in rows:
            yield f"\n### Each of `{key}`\n"
            yield from _section(key, _name(rows), found)


def _named_rows(value: dict[str, Any], found: dict[str, Any]) -> dict[str, Any]:
    """What each table under a name of the user's is, where all are."""
    table = found[_name(value)] if "$ref" in value else {}
    rows = table.get("additionalProperties")
    return rows if isinstance(rows, dict) and not table["properties"] else {}


def _name(reference: dict[str, Any]) -> str:
    return str(reference["$ref"]).rpartition("/")[2]


def _sections(record: dict[str, Any], found: dict[str, Any]) -> dict[str, str]:
    """Names of the tables of a design, with that of their record."""
    return {
        key: _name(value)
        for key, value in record["properties"].items()
        if "$ref" in value and not _named_rows(value, found)
    }


def _section(key: str, name: str, found: dict[str, Any]) -> Iterator[str]:
    record = found[name]
    if record.get("description"):
        yield f"{record['description']}\n"
    yield from _table(f"{key}.", record, found)


def _table(prefix: str, record: dict[str, Any], found: dict[str, Any]) -> Iterator[str]:
    """A row for every key that holds a value; tables within a section follow with theirs."""
    yield "| key | default | what it is |\n|---|---|---|"
    deeper = []
    for key, value in record["properties"].items():
        if "$ref" in value:
            deeper.append((f"{prefix}{key}.", found[value["$ref"].rpartition("/")[2]]))
            continue
        said = " ".join(value.get("description", "").split())
        yield f"| `{prefix}{key}` | {_default(value)} | {_cell(said)} {_allowed(value)} |"
    for longer, inner in deeper if prefix else ():
        for key, value in inner["properties"].items():
            said = " ".join(value.get("description", "").split())
            yield f"| `{longer}{key}` | {_default(value)} | {_cell(said)} {_allowed(value)} |"


def _default(value: dict[str, Any]) -> str:
    if "const" in value:
        return "required"
    if "default" not in value:
        return "required"
    default = value["default"]
    if default is None:
        return "none"
    return f"`{json.dumps(default)}`" if default not in ({}, []) else "empty"


def _allowed(value: dict[str, Any]) -> str:
    """What is allowed beside what the description says: choices and limits."""
    if "enum" in value:
        return "One of " + ", ".join(f"`{choice}`" for choice in value["enum"]) + "."
    choices = [value, *value.get("anyOf", ())]
    for one in choices:
        low = one.get("minimum", one.get("exclusiveMinimum"))
        high = one.get("maximum", one.get("exclusiveMaximum"))
        if low is not None and high is not None:
            unit = " mm" if any(c.get("pattern", "").startswith(LENGTH) for c in choices) else ""
            return f"({low:g} to {high:g}{unit})"
        if low is not None or high is not None:
            return f"(from {low:g})" if low is not None else f"(to {high:g})"
    return ""


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("<", "&lt;").replace("*", "\\*")
