"""The import formats: how to recognise a source, and the function that reads it."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import NamedTuple

from sbafab import plugins
from sbafab.design.files import read_text
from sbafab.design.laminate_file import SCHEMA
from sbafab.errors import DesignError
from sbafab.importing.laminates import DESIGN, import_folder, import_laminate
from sbafab.importing.layer_table import MOST_OF_POLYGONS, import_table, refuse_polygons
from sbafab.importing.parchmint import import_parchmint
from sbafab.importing.popupcad import SUFFIX, refuse_alone
from sbafab.importing.records import (
    LAYERS,
    Imported,
    Written,
    json_of,
    write_imported,
)


class SourceFormat(NamedTuple):
    """A format: its name in messages, a test for sources, and a reader."""

    name: str
    matches: Callable[[Path], bool]
    read: Callable[[Path], Imported]


def import_source(source: Path) -> tuple[str, Imported]:
    """Return the format of a file or folder, and its content. Raises DesignError."""
    if not source.exists():
        raise DesignError(f"{source} does not exist; give a file or folder to import")
    for entry in _formats():
        if entry.matches(source):
            return entry.name, entry.read(source)
    if source.suffix.lower() == ".json":
        json_of(source, read_text(source, MOST_OF_POLYGONS))
    what = "folder" if source.is_dir() else "file"
    raise DesignError(
        f"{source} is a {what} in an unsupported format; supported formats: "
        + "; ".join(f.name for f in _formats())
    )


def import_to(
    source: Path, file: Path | None, folder: Path = Path()
) -> tuple[str, tuple[str, ...], Written]:
    """Write a source as a design into ``file``, by default into ``folder`` under its own name.

    Return the format, remarks about items that are not imported, and the design. Raises DesignError
    and OutputError.
    """
    name, imported = import_source(source)
    file = file or folder / f"{imported.tables['name']}.toml"
    return name, imported.remarks, write_imported(imported, file, source.name)


def _is_file(*suffixes: str, mark: str = "") -> Callable[[Path], bool]:
    """Return a test for a file with one of these suffixes, or for JSON that contains this text."""

    def matches(source: Path) -> bool:
        suffix = source.suffix.lower()
        if mark and suffix == ".json" and source.is_file():
            return mark in source.read_bytes().decode("utf-8", errors="replace")
        return suffix in suffixes and source.is_file()

    return matches


_OWN = (
    SourceFormat(
        f"a folder of drawings with {LAYERS}", lambda s: (s / LAYERS).is_file(), import_table
    ),
    SourceFormat(
        "an output folder, with its design.toml", lambda s: (s / DESIGN).is_file(), import_folder
    ),
    SourceFormat("a laminate.json", _is_file(mark=SCHEMA), import_laminate),
    SourceFormat("a circuit in ParchMint JSON", _is_file(mark='"components"'), import_parchmint),
    SourceFormat(
        "a laminate of polygons, with a table of its layers",
        _is_file(".yaml", ".yml", mark='"geoms"'),
        refuse_polygons,
    ),
    SourceFormat("a popupCAD design, with a table of its layers", _is_file(SUFFIX), refuse_alone),
)


@cache
def _formats() -> tuple[SourceFormat, ...]:
    """All formats, of other packages last."""
    return _OWN + plugins.added(plugins.IMPORTERS, "import format", SourceFormat)
