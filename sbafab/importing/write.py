"""Write an imported design and its drawings: all or nothing, never over an existing file."""

from __future__ import annotations

import contextlib
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from sbafab.actuators import build, load_design
from sbafab.design.records import Design
from sbafab.errors import DesignError, OutputError
from sbafab.importing.records import Imported, file_name, toml_text
from sbafab.laminate.laminate import Laminate

FOLDER = "-drawings"
"""Suffix of the folder for drawings beside a design."""


class Written(NamedTuple):
    """An imported design on disk: its file, record and laminate."""

    file: Path
    design: Design
    laminate: Laminate


def write_imported(imported: Imported, file: Path, source: str) -> Written:
    """Write a design file and the folder of its drawings beside it.

    The design is read and its laminate built before anything is written. Raises DesignError if the
    design cannot be built, OutputError if a file already exists.
    """
    folder = file.with_name(f"{file.stem}{FOLDER}")
    for path in (file, folder) if imported.drawings else (file,):
        if path.exists():
            raise OutputError(
                f"{path} is there already; move it, or name another place with -o or --to"
            )
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=file.parent, prefix=f".{file.stem}.") as name:
            fresh = Path(name)
            drawings = fresh / folder.name
            if imported.drawings:
                drawings.mkdir()
            for drawing, content in imported.drawings.items():
                (drawings / drawing).write_bytes(content)
            tables = _in_folder(imported.tables, imported.drawings, folder.name)
            text = toml_text(tables, [f"Imported from {source}. Layers go bottom to top."])
            (fresh / file.name).write_text(text, encoding="utf-8", newline="\n")
            _built(fresh / file.name)
            if imported.drawings:
                drawings.rename(folder)
            try:
                (fresh / file.name).rename(file)
            except OSError:
                with contextlib.suppress(OSError):
                    shutil.rmtree(folder)
                raise
    except OSError as error:
        raise OutputError(
            f"{file} cannot be written: {error.strerror or error}; choose another folder with -o"
        ) from None
    return Written(file, *_built(file))


def default_file(imported: Imported) -> Path:
    """Return the default path of an imported design file in this folder."""
    return Path(f"{file_name(str(imported.tables['name']))}.toml")


def _built(file: Path) -> tuple[Design, Laminate]:
    try:
        design = load_design(file)
        return design, build(design)
    except DesignError as error:
        # The folder in the message is gone by the time it is read.
        raise DesignError(str(error).replace(f"{file.parent}/", "")) from None


def _in_folder(
    tables: Mapping[str, Any], drawings: Mapping[str, bytes], folder: str
) -> dict[str, Any]:
    """The tables with the drawings' paths relative to the design file."""

    def place(value: Any) -> Any:
        return f"{folder}/{value}" if value in drawings else value

    placed = dict(tables)
    placed["shapes"] = {
        name: {**row, "file": place(row["file"])} if "file" in row else row
        for name, row in tables.get("shapes", {}).items()
    }
    if "kit" in tables:
        placed["kit"] = place(tables["kit"])
    if "calibration" in tables.get("models", {}):
        models = tables["models"]
        placed["models"] = {**models, "calibration": place(models["calibration"])}
    return placed
