"""Assembly files: TOML to records, resolved TOML, hashes, and the entries of parts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from sbafab import catalogue
from sbafab.actuators import load_design, records
from sbafab.assemblies.build import Assembled, PlacedPart, design_source
from sbafab.assemblies.records import KINDS, AnyPart, Assembly
from sbafab.design.files import (
    ASSEMBLY,
    Change,
    add_waivers,
    changed_keys,
    checked,
    design_path,
    hint,
    listed,
    override,
    read_toml,
    shown,
    toml_tables,
)
from sbafab.design.identity import actuator_sha256, design_sha256, tables_sha256
from sbafab.design.records import Design, validated, without_none
from sbafab.errors import DesignError


def load(
    source: str | Path, changes: Iterable[Change] = (), waivers: Sequence[str] = ()
) -> Design | Assembly:
    """Return a design or an assembly, whichever the file holds. Raises DesignError."""
    changes = list(changes)
    path = design_path(source)
    data = override(read_toml(path), changes)
    if data.get("family") != ASSEMBLY:
        return load_design(source, changes, waivers)
    # A design's path on the command line starts at the current folder.
    for key in changed_keys(changes):
        match key.split("."):
            case ["parts", name, "design"] if source := data["parts"][name].get("design"):
                if isinstance(design_source(str(source), Path()), Path):
                    data["parts"][name]["design"] = str(Path(str(source)).absolute())
    return assembly_of(add_waivers(data, waivers, catalogue.names("assemblies")), path)


def load_text(text: str, path: Path) -> Design | Assembly:
    """Return the design or assembly in a text, as if read from ``path``. Raises DesignError."""
    data = toml_tables(text, path.name)
    if data.get("family") == ASSEMBLY:
        return assembly_of(data, path)
    data.setdefault("name", path.stem)
    return validated(data, records(), path.parent)


def load_assembly(
    source: str | Path, changes: Iterable[Change] = (), waivers: Sequence[str] = ()
) -> Assembly:
    """Return an assembly from a template's name or a TOML file. Raises DesignError."""
    result = load(source, changes, waivers)
    if isinstance(result, Assembly):
        return result
    raise DesignError(
        f'{result.name} is not an assembly; give a file with family = "{ASSEMBLY}" and '
        "[parts.NAME] tables"
    )


def assembly_of(data: Mapping[str, Any], path: Path) -> Assembly:
    """Return the record of an assembly file's tables. Raises DesignError with one sentence."""
    tables = data.get("parts")
    if not isinstance(tables, dict) or not tables:
        raise DesignError(
            "an assembly needs a table for each part; add [parts.NAME] with kind = one of "
            f"{listed(KINDS)}"
        )
    parts = {name: _part(name, table) for name, table in tables.items()}
    whole = checked(Assembly, {"name": path.stem, **data, "parts": parts}, {})
    return whole.placed(path.parent)


def _part(name: str, table: object) -> AnyPart:
    where = f"parts.{shown(name).strip(chr(39))}"
    if not isinstance(table, dict):
        raise DesignError(f"{where} = {shown(table)} must be a table of keys, [{where}]")
    kind = table.get("kind")
    if kind is None:
        raise DesignError(f"{where}.kind is missing; add kind = one of {listed(KINDS)}")
    if not isinstance(kind, str) or kind not in KINDS:
        kinds = hint(kind, KINDS)
        raise DesignError(f"{where}.kind = {shown(kind)} is not a kind of part; {kinds}")
    return checked(KINDS[kind], table, {}, f"{where}.")


DESIGN_FILE = "design.toml"


def plain_tables(assembly: Assembly) -> dict[str, Any]:
    """Return the assembly's own keys as tables, with every default written out."""
    return without_none(assembly.model_dump(mode="json"))


def resolved(assembled: Assembled) -> dict[str, Any]:
    """Return the assembly with every default written out; designs refer to the parts' folders."""
    assembly = assembled.assembly
    table = assembly.model_dump(mode="json", exclude={"kit", "sheets", "laser", "press"})
    for name, part in table["parts"].items():
        source = assembled[name].made
        if source is not None:
            # The folder's design holds the keys that were set, the assembly's own among them.
            part["design"] = f"{source.design.name}/{DESIGN_FILE}"
            del part["set"]
    return without_none(table)


def assembly_toml(assembled: Assembled) -> str:
    """Return the ``design.toml`` of an output folder, which builds the same assembly again."""
    import tomli_w

    return tomli_w.dumps(resolved(assembled))


def assembly_sha256(assembled: Assembled) -> str:
    """Return the hash of all inputs of the output, including the designs of the parts."""
    table = resolved(assembled)
    digests = {source.design.name: design_sha256(source.design) for source in assembled.designs}
    return tables_sha256([table, digests])


def assembled_sha256(assembled: Assembled) -> str:
    """Return the hash of the assembly itself: parts, places, glue, and its actuators.

    Name, order, pose of the pictures, notes and limits are excluded.
    """
    parts = {}
    for name, part in resolved(assembled)["parts"].items():
        source = assembled[name].made
        actuator = {} if source is None else {"design": actuator_sha256(source.design)}
        parts[name] = {**part, **actuator, "note": None}
    return tables_sha256(parts)


def part_entry(placed: PlacedPart) -> dict[str, Any]:
    """Return a part and its place: rotation about its axis, bending radius, rows and shift."""
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
