"""A found design as a file that generates: the one it started from, with the found keys."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import tomli_w

from sbafab.design.reading import (
    KIT,
    OUTLINE,
    changed_keys,
    design_path,
    override,
    read_toml,
    start_where_the_user_stands,
)
from sbafab.design.templates import kit_names
from sbafab.errors import DesignError, OutputError
from sbafab.search.find import FoundDesign
from sbafab.search.quantities import shown_value
from sbafab.search.trial import keys_said

FOUND = "found.toml"
"""The file in a folder that ``-o`` names."""


def found_file(out: Path) -> Path:
    """Return the file that ``-o`` asks for: itself where it ends in .toml, else one in the folder.

    Raises DesignError where no file can come to be: nobody's design is overwritten.
    """
    is_file = out.suffix.lower() == ".toml"
    if is_file and not out.parent.is_dir():
        raise DesignError(f"{out.parent} is no folder; make it first, or name another with -o")
    if not is_file and out.exists() and not out.is_dir():
        raise DesignError(f"{out} is a file; name a folder with -o, or a file that ends in .toml")
    target = out if is_file else out / FOUND
    if target.exists():
        raise DesignError(
            f"{target} exists; name another file or folder with -o, or remove it first: a search "
            "may take minutes and overwrites nothing"
        )
    return target


def found_toml(
    source: str | Path, assignments: Sequence[str], name: str, found: FoundDesign
) -> str:
    """The design file of what was found, its figures as comments."""
    path = design_path(source)
    data = override(read_toml(path), [*assignments, dict(found.best.values), {"name": name}])
    start_where_the_user_stands(data, assignments)
    _from_anywhere(data, path.parent, set(changed_keys(assignments)))
    first = {key: value for key, value in data.items() if not isinstance(value, dict)}
    tables = {key: value for key, value in data.items() if isinstance(value, dict)}
    said = [
        f"# {one.quantity.said} = {shown_value(one.quantity, found.best.value(one))} ({one.bound})"
        for one in found.wanted.requirements
    ]
    goal = found.wanted.goal
    value = shown_value(goal.quantity, found.best.value(goal))
    best = f"# {goal.quantity.said} = {value} (the goal)"
    keys = keys_said(found.best.values)
    measured = [f"# {name}: {one.sentence()}" for name, one in found.measured.items()]
    head = [f"# Found by sbafab find, from {Path(source).name}: {keys}.", *said, best, *measured]
    return "\n".join(line.rstrip() for line in head) + "\n\n" + tomli_w.dumps(first | tables)


def _from_anywhere(data: dict[str, Any], folder: Path, given: set[str]) -> None:
    """Paths of the file that it started from, made absolute: the new one may lie elsewhere."""
    chamber: Any = data.get("chamber")
    if OUTLINE not in given and isinstance(chamber, Mapping) and "outline" in chamber:
        chamber = dict(chamber)
        chamber["outline"] = str((folder / str(chamber["outline"])).absolute())
        data["chamber"] = chamber
    if KIT not in given and KIT in data and data[KIT] not in kit_names():
        data[KIT] = str((folder / str(data[KIT])).absolute())


def write_found(text: str, target: Path) -> None:
    """Raises OutputError where it cannot be written, also where a file came to be meanwhile."""
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with target.open("x", encoding="utf-8", newline="\n") as opened:
            opened.write(text)
    except OSError as error:
        raise OutputError(
            f"{target} cannot be written: {error.strerror or error}; name another folder with -o"
        ) from None
