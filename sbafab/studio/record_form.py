"""The record page: entries of a device's history from a form on a phone."""

from __future__ import annotations

import base64
import binascii
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from sbafab import api
from sbafab.errors import DesignError
from sbafab.studio import places


def lab_file(folder: Path) -> Path:
    """Return the lab's file: SBAFAB_LAB, or lab.sqlite in the chosen folder."""
    return folder / os.environ.get("SBAFAB_LAB", "lab.sqlite")


def choices(folder: Path) -> dict[str, Any]:
    """Return the designs that may be recorded, and the lab's file."""
    return {
        "files": places.listed(folder),
        "templates": list(api.templates()),
        "lab": str(lab_file(folder)),
    }


def sheet(folder: Path, request: Mapping[str, Any]) -> dict[str, Any]:
    """Return the tables of the record page of the named design."""
    tables = api.record_sheet(_source(folder, request))
    return {
        "tables": [
            {
                "title": table.title,
                "fields": [field._asdict() for field in table.fields],
                "rows": [
                    {"values": dict(row), "nominal": nominal}
                    for row, nominal in zip(table.rows, table.nominal, strict=True)
                ],
            }
            for table in tables
        ]
    }


def stored(folder: Path, request: Mapping[str, Any]) -> dict[str, Any]:
    """Store the filled entries, all or none, and return their numbers and warnings."""
    lines = request.get("entries")
    if not isinstance(lines, list) or not lines or not all(isinstance(x, dict) for x in lines):
        raise DesignError("no line is filled in; fill in a reading, a lot, a decision or a note")
    entries = api.record_history(
        _source(folder, request),
        entries=[_line(line) for line in lines],
        lab=lab_file(folder),
        again=request.get("again") is True,
    )
    warnings = [
        f"{entry.item} lot {entry.lot} expired on {entry.expires}"
        for entry in entries
        if entry.is_expired
    ]
    return {
        "entries": [f"e{entry.id}" for entry in entries],
        "warnings": list(dict.fromkeys(warnings)),
    }


def _source(folder: Path, request: Mapping[str, Any]) -> str | Path:
    """Return the template or the file of the folder that a request names. Raises DesignError."""
    name = str(request.get("design", ""))
    if name in api.templates():
        return name
    path = places.design_file(folder, name)
    places.named_files(places.read(path)[0], folder)
    return path


def _line(line: Mapping[str, Any]) -> dict[str, Any]:
    """Return an entry with its photograph as bytes: a page cannot name files of this machine."""
    values = {str(name): value for name, value in line.items() if name != "photograph"}
    packed = line.get("photograph")
    if packed:
        try:
            values["photograph"] = base64.b64decode(str(packed), validate=True)
        except (binascii.Error, ValueError):
            raise DesignError("the photograph did not arrive whole; send it again") from None
    return values
