"""What is wrong with a design file, in one sentence: field, value, what is allowed."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from sbafab.design.records import Design


def listed(values: Iterable[object]) -> str:
    return ", ".join(f'"{value}"' for value in values)


def shown(value: object) -> str:
    """A value as it may appear in a message: short, on one line."""
    try:
        text = repr(str(value)) if isinstance(value, str | Path) else str(value)
        if isinstance(value, bool):
            text = text.lower()
    except ValueError:
        # Python does not write out integers of thousands of digits.
        text = "a number of thousands of digits"
    text = " ".join(text.split())
    return text if len(text) <= 60 else text[:57] + "..."


def sentence(
    error: ValidationError,
    record: type[BaseModel],
    families: Mapping[str, type[Design]],
    prefix: str,
) -> str:
    problems = error.errors(include_url=False)
    unknown = [problem for problem in problems if problem["type"] == "extra_forbidden"]
    first = (unknown or problems)[0]
    # Alternatives of a union put their own name in the location; a key is what the file holds.
    where = [_plain(part) for part in first["loc"] if not _is_alternative(part)]
    field = (prefix + ".".join(where)).rstrip(".")
    count = len({tuple(problem["loc"][:2]) for problem in problems}) - 1
    more = f" (and {count} more problem{'s' if count > 1 else ''} like it)" if count > 0 else ""
    if first["type"] == "extra_forbidden":
        return prefix + _unknown_key(where, record, families) + more
    if first["type"] == "missing" and isinstance(first["loc"][-1], int):
        short = ".".join(where[:-1])
        return f"{short} is a list without value {first['loc'][-1] + 1}; add it{more}"
    if first["type"] == "missing":
        return f"{field} is missing; add it to the design file{more}"
    if not where:
        return f"{field} {_allowed(first)}{more}"
    return f"{field} = {shown(first['input'])} {_allowed(first)}{more}"


def _plain(part: int | str) -> str:
    """A key as it may appear in a message."""
    text = str(part)
    return text if text.isprintable() and len(text) <= 60 else shown(text)


def _is_alternative(part: int | str) -> bool:
    text = str(part)
    return text in {"float", "int", "str"} or "[" in text or "(" in text


def _allowed(problem: Any) -> str:
    kind, context = problem["type"], problem.get("ctx", {})
    if kind == "value_error":
        return str(context["error"])
    limits = {
        "greater_than": "must be greater than {gt}",
        "greater_than_equal": "must be at least {ge}",
        "less_than": "must be less than {lt}",
        "less_than_equal": "must be at most {le}",
        "string_too_long": "must have at most {max_length} letters",
        "too_long": "must have at most {max_length} entries",
        "too_short": "must have at least {min_length} entries",
    }
    if kind == "literal_error":
        near = difflib.get_close_matches(
            str(problem["input"]), re.findall("'([^']*)'", context["expected"]), 1
        )
        hint = f"; did you mean {near[0]}?" if near else ""
        return f"must be {context['expected']}{hint}"
    if kind in limits:
        return limits[kind].format(**context)
    plain = {
        "string_pattern_mismatch": "must be 1 to 64 letters, digits, dots, dashes or underscores, "
        "beginning with a letter or digit",
        "finite_number": "must be a finite number",
        "int_type": "must be a whole number",
        "int_from_float": "must be a whole number",
        "int_parsing_size": "is out of range",
        "float_type": "must be a number",
        "string_type": "must be a text in quotes",
        "string_unicode": "must be plain text; remove what is no letter in it",
        "bool_type": "must be true or false",
        "model_type": "must be a table of keys",
        "model_attributes_type": "must be a table of keys",
        "tuple_type": "must be a list in brackets",
        "list_type": "must be a list in brackets",
    }
    return plain.get(kind, f"is not allowed: {problem['msg'].lower()}")


def _unknown_key(
    where: Sequence[str], record: type[BaseModel], families: Mapping[str, type[Design]]
) -> str:
    field = ".".join(where)
    other = [name for name, model in families.items() if field in key_paths(model)]
    if other:
        return f"{field} is not a key of this family; it belongs to {listed(other)}"
    known = key_paths(record)
    siblings = [path for path in known if path.split(".")[:-1] == list(where[:-1])]
    near = _nearest(where[-1], siblings, 0.6) or _nearest(where[-1], known, 0.75)
    if near:
        return f"{field} is not a key of a design file; did you mean {near}?"
    return f"{field} is not a key of a design file; known here: {', '.join(siblings)}"


def _nearest(key: str, paths: Iterable[str], cutoff: float) -> str | None:
    """The path whose last part is most like ``key``."""
    leaves = {path.split(".")[-1]: path for path in paths}
    near = difflib.get_close_matches(key, leaves, 1, cutoff)
    return leaves[near[0]] if near else None


def key_paths(record: type[BaseModel], prefix: str = "") -> dict[str, object]:
    """Every dotted key a record knows, as a file spells it, with its annotation."""
    found: dict[str, object] = {}
    for name, info in record.model_fields.items():
        key = info.alias or name
        found[prefix + key] = info.annotation
        if isinstance(info.annotation, type) and issubclass(info.annotation, BaseModel):
            found.update(key_paths(info.annotation, f"{prefix}{key}."))
    return found
