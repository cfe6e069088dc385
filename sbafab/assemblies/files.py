"""Assembly files: TOML to records, with one sentence for each error."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, get_args

from sbafab.actuators import load_design, records
from sbafab.assemblies.records import KINDS, AnyPart, Assembly, CheckName, Sba
from sbafab.design.files import (
    ASSEMBLY,
    Change,
    add_waivers,
    changed_keys,
    checked,
    design_path,
    kit_names,
    listed,
    override,
    read_toml,
    shown,
    toml_tables,
    validated,
)
from sbafab.design.records import Design, RuleName
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
    return changed_assembly(data, path, changes, waivers)


def load_text(text: str, path: Path) -> Design | Assembly:
    """Return the design or assembly of a text as if read from ``path``. Raises DesignError."""
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
        f'{result.name} is no assembly; give a file with family = "{ASSEMBLY}" and [parts.NAME] '
        "tables"
    )


def changed_assembly(
    data: dict[str, Any], path: Path, changes: Sequence[Change], waivers: Sequence[str]
) -> Assembly:
    """Return the assembly of a file's tables with the changes made. Raises DesignError."""
    _start_where_the_user_stands(data, changes)
    names = (*get_args(RuleName), *get_args(CheckName))
    return assembly_of(add_waivers(data, waivers, names), path)


def assembly_of(data: Mapping[str, Any], path: Path) -> Assembly:
    """Return the record of an assembly file's tables. Raises DesignError with one sentence."""
    tables = data.get("parts")
    if not isinstance(tables, dict) or not tables:
        raise DesignError(
            "an assembly has a table for each part; add [parts.NAME] with kind = one of "
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
        near = difflib.get_close_matches(shown(kind).strip("'"), KINDS, 1)
        hint = f"; did you mean {near[0]}?" if near else ""
        raise DesignError(f"{where}.kind = {shown(kind)} must be one of {listed(KINDS)}{hint}")
    return checked(KINDS[kind], table, {}, f"{where}.")


def part_design(assembly: Assembly, name: str, part: Sba) -> Design:
    """Return the design of an SBA part, with the part's and the assembly's own keys set.

    Raises DesignError that names the part.
    """
    try:
        path = design_path(_place_of(part.design, assembly.folder))
        table = read_toml(path)
        if table.get("family") == ASSEMBLY:
            raise DesignError(
                f"design = {shown(part.design)} is an assembly; a part is made from the design of "
                "one actuator"
            )
        data = override(table, [part.set, assembly.shared])
        data.setdefault("name", path.stem)
        _keep_outline(data, part, assembly.folder)
        _keep_kit(data, part, assembly)
        waived = _waivers(data)
        rules = [r for r in assembly.rules.waive if r in get_args(RuleName) and r not in waived]
        return validated(add_waivers(data, rules), records(), path.parent)
    except DesignError as error:
        raise DesignError(f"parts.{name}: {error}") from None


def _place_of(design: str, folder: Path) -> str | Path:
    """The source of a design: a bare word names a template, a path starts at the file's folder."""
    return folder / design if Path(design).name != design or "." in design else design


def _waivers(data: Mapping[str, Any]) -> list[Any]:
    """Return the rules that a design file's tables waive, if they are a list."""
    rules = data.get("rules")
    waived = rules.get("waive") if isinstance(rules, dict) else None
    return waived if isinstance(waived, list) else []


def _keep_outline(data: dict[str, Any], part: Sba, folder: Path) -> None:
    """Resolve an outline that the assembly's file names against its folder, not the design's."""
    chamber = part.set.get("chamber")
    if isinstance(chamber, dict) and isinstance(chamber.get("outline"), str):
        data["chamber"]["outline"] = str((folder / chamber["outline"]).absolute())


def _keep_kit(data: dict[str, Any], part: Sba, assembly: Assembly) -> None:
    """Resolve a kit's file likewise."""
    kit = data.get("kit")
    is_named_here = assembly.kit is not None or "kit" in part.set
    if is_named_here and isinstance(kit, str) and kit not in kit_names():
        data["kit"] = str((assembly.folder / kit).absolute())


def _start_where_the_user_stands(data: dict[str, Any], changes: Sequence[Change]) -> None:
    """Resolve a design's path on the command line against the current folder."""
    for key in changed_keys(changes):
        match key.split("."):
            case ["parts", name, "design"] if source := data["parts"][name].get("design"):
                if isinstance(_place_of(str(source), Path()), Path):
                    data["parts"][name]["design"] = str(Path(str(source)).absolute())
