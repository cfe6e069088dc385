"""What the page asks for and is told first, whether a server answers or Python in the page."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from sbafab import __version__, api
from sbafab.errors import SbafabError
from sbafab.studio import forms, places

SURROGATE = re.compile("[\ud800-\udfff]")
"""Half of a character as JSON may write it alone; no file in UTF-8 can hold it."""


def started(
    folder: Path | None,
    opened: str | None = None,
    text: str | None = None,
    template: str | None = None,
) -> Any:
    """What the page begins with; no ``folder`` where it has no disk to read from.

    ``opened`` names a file of the folder, ``text`` is a link's design, ``template`` a template.
    """
    schema = api.schema()
    return {
        "version": __version__,
        "folder": str(folder or ""),
        "opened": opened,
        "text": text,
        "template": template,
        "files": places.listed(folder) if folder else [],
        "templates": api.templates(),
        "families": forms.families(schema),
        "assembly": forms.assembly(schema),
    }


def table(body: bytes | str) -> dict[str, Any]:
    """The table that a request holds. Raises SbafabError where it is none."""
    try:
        asked = json.loads(body)
    except (ValueError, RecursionError):
        asked = None
    if not isinstance(asked, dict):
        raise SbafabError("the request is not a table in JSON")
    _refuse_surrogates(asked)
    return asked


def _refuse_surrogates(asked: dict[str, Any]) -> None:
    text = asked.get("text")
    half = SURROGATE.search(text) if isinstance(text, str) else None
    if half is not None:
        line = half.string.count("\n", 0, half.start()) + 1
        raise SbafabError(
            f"line {line} of the text holds half a character (U+{ord(half[0]):04X}), which no file "
            "can; delete it and type it again"
        )
    try:
        json.dumps(asked, ensure_ascii=False).encode("utf-8")
    except UnicodeEncodeError as error:
        raise SbafabError(
            f"the request holds half a character (U+{ord(error.object[error.start]):04X}), which "
            "no file can; delete it and type it again"
        ) from None


def job(folder: Path, asked: dict[str, Any]) -> dict[str, Any]:
    """What a job may be told: texts of the design, edits, and places that the page cannot choose.

    Raises SbafabError.
    """
    edits = asked.get("edits") or []
    good = isinstance(edits, list) and all(
        isinstance(edit, list)
        and len(edit) == 2
        and isinstance(edit[0], str)
        and (edit[1] is None or isinstance(edit[1], str))
        for edit in edits
    )
    if not good or not isinstance(asked.get("text"), str):
        raise SbafabError("a request holds a text, and edits as [key, value]")
    name = asked.get("name")
    path = name if isinstance(name, str) and name.endswith(".toml") and "/" not in name else None
    has = asked.get("has") or []
    return {
        "tab": str(asked.get("tab", ""))[:40],
        "text": asked["text"],
        "edits": [(key, value) for key, value in edits],
        "has": [key for key in has if isinstance(key, str)] if isinstance(has, list) else [],
        "folder": str(folder),
        "path": path or "design.toml",
        "pose": asked.get("pose"),
    }
