"""Escaping of text in XML as in ``xml.sax.saxutils``, whose import loads all of HTTP; templates."""

from __future__ import annotations

from html import escape as html_escape
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jinja2 import Environment

SPACES = {"\n": "&#10;", "\r": "&#13;", "\t": "&#9;"}


def escape(text: str) -> str:
    """Return text escaped for a place between tags."""
    return html_escape(text, quote=False)


def quoteattr(text: str) -> str:
    """Return text as the value of an attribute, in quotes."""
    for space, code in {"&": "&amp;", ">": "&gt;", "<": "&lt;", **SPACES}.items():
        text = text.replace(space, code)
    if '"' not in text:
        return f'"{text}"'
    if "'" not in text:
        return f"'{text}'"
    return '"{}"'.format(text.replace('"', "&quot;"))


def environment(folder: Path) -> Environment:
    """Return the environment of a folder's templates; an undefined name is an error."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    return Environment(
        loader=FileSystemLoader(folder),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
