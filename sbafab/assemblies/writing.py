"""Assemblies out: resolved TOML, hashes, and the entries of parts."""

from __future__ import annotations

import hashlib
import json
from typing import Any

from sbafab.assemblies.build import Assembled, PlacedPart
from sbafab.assemblies.records import Assembly
from sbafab.design.files import (
    actuator_sha256,
    design_sha256,
)

DESIGN_FILE = "design.toml"


def plain_tables(assembly: Assembly) -> dict[str, Any]:
    """Return the assembly's own keys as tables, with every default written out."""
    return _without_none(assembly.model_dump(mode="json"))


def resolved(assembled: Assembled) -> dict[str, Any]:
    """The assembly with every default written out; designs are those of the parts' folders."""
    assembly = assembled.assembly
    table = assembly.model_dump(mode="json", exclude={"kit", "sheets", "laser", "press"})
    for name, part in table["parts"].items():
        source = assembled[name].made
        if source is not None:
            # The folder's design holds the keys that were set, the assembly's own among them.
            part["design"] = f"{source.design.name}/{DESIGN_FILE}"
            del part["set"]
    return _without_none(table)


def _without_none(table: dict[str, Any]) -> dict[str, Any]:
    return {
        key: _without_none(value) if isinstance(value, dict) else value
        for key, value in table.items()
        if value is not None
    }


def assembly_toml(assembled: Assembled) -> str:
    """Return the ``design.toml`` of an output folder; it builds the same assembly again."""
    import tomli_w

    return tomli_w.dumps(resolved(assembled))


def assembly_sha256(assembled: Assembled) -> str:
    """Return the hash of all inputs of the output, the designs of the parts included."""
    table = resolved(assembled)
    digests = {source.design.name: design_sha256(source.design) for source in assembled.designs}
    text = json.dumps([table, digests], sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return hashlib.sha256(text.encode()).hexdigest()


def assembled_sha256(assembled: Assembled) -> str:
    """Return the hash of the assembly itself: parts, places, glue, and the actuators among them.

    Without name, order, pose of the pictures, notes and limits.
    """
    parts = {}
    for name, part in resolved(assembled)["parts"].items():
        source = assembled[name].made
        actuator = {} if source is None else {"design": actuator_sha256(source.design)}
        parts[name] = {**part, **actuator, "note": None}
    text = json.dumps(parts, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return hashlib.sha256(text.encode()).hexdigest()


def part_entry(placed: PlacedPart) -> dict[str, Any]:
    """A part and its place: turned about its own axis, bent round a radius, rows and shift."""
    part = placed.part
    rounded = [[round(value, 9) + 0.0 for value in row] for row in placed.pose.rows]
    return {
        "name": placed.name,
        "kind": part.kind,
        "design": None if placed.made is None else placed.made.design.name,
        "on": part.on,
        "at": part.at,
        "glue": part.glue,
        "turn": part.turn,
        "bent_radius": placed.radius,
        "rows": rounded,
        "shift": [round(value, 6) + 0.0 for value in placed.pose.shift],
    }
