"""The result of an import: the tables of a design file, and the drawings beside it."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from sbafab.errors import DesignError

MOST_NAMED = 20
"""At most this many places of one kind are named one by one."""


@dataclass(frozen=True)
class Imported:
    """A design of drawn layers as ``tables`` of its file, and the content of its ``drawings``.

    Shapes, kit and calibration name a drawing by its key. ``remarks`` name, by place, what was not
    carried over and how ambiguous input was read.
    """

    tables: Mapping[str, Any]
    drawings: Mapping[str, bytes] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()


def toml_text(tables: Mapping[str, Any], head: Iterable[str] = ()) -> str:
    """Return a design file: single keys, lists with one row per line, then tables."""
    import tomli_w

    lines = [f"# {line}" for line in head]
    singles = {key: value for key, value in tables.items() if not isinstance(value, dict)}
    for key, value in singles.items():
        if isinstance(value, list) and value and isinstance(value[0], dict):
            rows = "".join(f"  {_inline(row)},\n" for row in value)
            lines.append(f"{key} = [\n{rows}]")
        else:
            lines.append(f"{key} = {_inline(value)}")
    shapes = tables.get("shapes", {})
    if shapes:
        lines += ["", "[shapes]", *(f"{name} = {_inline(row)}" for name, row in shapes.items())]
    rest = {
        key: value
        for key, value in tables.items()
        if isinstance(value, dict) and value and key != "shapes"
    }
    return "\n".join(lines) + "\n" + ("\n" + tomli_w.dumps(rest) if rest else "")


def _inline(value: Any) -> str:
    """A value of TOML on one line."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key} = {_inline(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_inline, value)) + "]"
    # A JSON string with only JSON's own escapes is a TOML string; so are numbers and booleans.
    return json.dumps(value, ensure_ascii=False)


def not_json(path: Path, error: ValueError | RecursionError) -> DesignError:
    """Return the error of a file that is not valid JSON, with the line and column at fault."""
    where = "its lists and objects are nested too deep"
    if isinstance(error, json.JSONDecodeError):
        where = f"line {error.lineno} column {error.colno}: {error.msg.lower()}"
    elif isinstance(error, ValueError):
        where = "a number in it is too long"
    return DesignError(f"{path} is not valid JSON: {where}; correct it, or save it again")


def file_name(text: str, fallback: str = "import") -> str:
    """Return a text as a design's name: letters, digits, dot, dash and underscore, up to 64."""
    name = re.sub(r"[^A-Za-z0-9._-]+", "-", text).strip("-._")[:64]
    return name or fallback


def key_name(text: str, taken: Iterable[str], fallback: str = "x") -> str:
    """Return a text as a shape's or film's name, unique among ``taken``: small letters, digits,
    -.
    """
    stem = re.sub(r"[^a-z0-9-]+", "-", text.lower()).strip("-")[:24]
    if not stem or not stem[0].isalpha():
        stem = f"{fallback}{stem}"
    taken = set(taken)
    number, name = 1, stem
    while name in taken:
        number += 1
        name = f"{stem}-{number}"
    return name


def named(what: str, places: list[str]) -> list[str]:
    """Return a remark for each of the places, or one for all if they are many."""
    remarks = [f"{place}: {what}" for place in places[:MOST_NAMED]]
    if len(places) > MOST_NAMED:
        remarks.append(f"and {len(places) - MOST_NAMED} more places: {what}")
    return remarks


def read_text(path: Path, most_bytes: int) -> str:
    """Return the text of a UTF-8 file. Raises DesignError for other encodings or too large a
    file.
    """
    try:
        size = path.stat().st_size
        text = path.read_text(encoding="utf-8-sig") if size <= most_bytes else ""
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "it is not text in UTF-8"
        raise DesignError(f"{path} cannot be read: {reason}; check the file") from None
    if size > most_bytes:
        raise DesignError(f"{path} has {size:,} bytes, where at most {most_bytes:,} are allowed")
    return text


def yaml_of(path: Path) -> Any:
    """Return PyYAML. Raises DesignError if the extra is not installed."""
    try:
        import yaml
    except ImportError:
        raise DesignError(
            f'{path} is YAML, which takes PyYAML to read; pip install "sbafab[yaml]"'
        ) from None
    return yaml
