"""Escaping of text in XML as in ``xml.sax.saxutils``, whose import loads all of HTTP."""

from __future__ import annotations

from html import escape as html_escape

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
