"""Change keys of a design's text one by one; comments and order are kept."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, MutableMapping, MutableSequence
from typing import Any

import tomlkit
import tomlkit.items
from tomlkit.exceptions import TOMLKitError

from sbafab.errors import DesignError

Edit = tuple[str, str | None]
"""A dotted key and its value as TOML writes it; None removes the key.

An integer in a key is the index of a list's row, from 0: ``layers.2.shape``.
"""
MOST_EDITS = 200


def edited(text: str, edits: Iterable[Edit]) -> str:
    """The text with every key changed. Raises DesignError if text or value is not TOML."""
    try:
        document = tomlkit.parse(text)
    except (TOMLKitError, ValueError, RecursionError) as error:
        raise DesignError(f"the text is not valid TOML ({error}); mend it first") from None
    for key, value in edits:
        parts = key.split(".")
        if value is None:
            _take_out(document, parts)
            continue
        if _has_table(document, parts):
            _put(document, parts, _value(key, value))
            continue
        before = tomlkit.dumps(document)
        _put(document, parts, _value(key, value))
        if not _holds(document, parts):
            # A table of dotted keys cannot contain a header; it gets another dotted key.
            document = tomlkit.parse(before)
            _put(document, parts, _value(key, value), dotted=True)
            if not _holds(document, parts):
                raise DesignError(f"{key} cannot be put in here; change it in the text")
    return tomlkit.dumps(document)


def _has_table(table: Any, parts: list[str]) -> bool:
    """Return True if the table of the key exists."""
    for part in parts[:-1]:
        table = _inner(table, part)
    return isinstance(table, MutableMapping)


def _inner(table: Any, part: str) -> Any:
    """Return a table's value by name, or a list's by index; None if there is none."""
    if isinstance(table, MutableMapping):
        return table.get(part)
    is_row = isinstance(table, MutableSequence) and part.isdecimal() and int(part) < len(table)
    return table[int(part)] if is_row else None


def _holds(document: tomlkit.TOMLDocument, parts: list[str]) -> bool:
    """Return True if the written text has the document's value at the key."""
    try:
        written: Any = tomllib.loads(tomlkit.dumps(document))
        intended: Any = document.unwrap()
        for part in parts:
            written, intended = _inner(written, part), _inner(intended, part)
    except tomllib.TOMLDecodeError:
        return False
    return intended is not None and bool(written == intended)


def _value(key: str, text: str) -> Any:
    try:
        return tomlkit.value(text)
    except (TOMLKitError, ValueError, RecursionError, IndexError):
        raise DesignError(f"{key} = {text[:60]} is not a value; write a number or a text") from None


def _put(
    document: tomlkit.TOMLDocument, parts: list[str], value: Any, dotted: bool = False
) -> None:
    *above, last = parts
    table: Any = document
    for depth, part in enumerate(above):
        inner = _inner(table, part)
        if inner is None and dotted and isinstance(table, tomlkit.items.Table):
            table.append(tomlkit.key(parts[depth:]), value)
            return
        if inner is None and isinstance(table, MutableMapping):
            within = isinstance(table, tomlkit.items.InlineTable)
            table[part] = tomlkit.inline_table() if within else tomlkit.table()
            inner = table[part]
        if not isinstance(inner, MutableMapping | MutableSequence):
            missing = "is not there" if inner is None else "is a value, not a table"
            raise DesignError(f"{'.'.join(parts)}: {part} {missing}; change it in the text")
        table = inner
    if not isinstance(table, MutableMapping):
        raise DesignError(f"{'.'.join(parts)} is not a key of a table; change it in the text")
    old = table.get(last)
    if old is not None and hasattr(old, "trivia") and hasattr(value, "trivia"):
        _comment_like(old, value)
    if isinstance(table, tomlkit.items.InlineTable) and last not in table:
        table.append(last, value)
    else:
        table[last] = value


def _comment_like(old: Any, value: Any) -> None:
    """Gives the value the old one's comment, in the same column."""
    trivia = value.trivia
    trivia.comment, trivia.trail = old.trivia.comment, old.trivia.trail
    column = len(old.as_string()) + len(old.trivia.comment_ws)
    trivia.comment_ws = " " * max(1, column - len(value.as_string())) if trivia.comment else ""


def _take_out(table: MutableMapping[str, Any], parts: list[str]) -> None:
    inner: Any = table
    for part in parts[:-1]:
        inner = _inner(inner, part)
    if isinstance(inner, MutableMapping):
        inner.pop(parts[-1], None)
