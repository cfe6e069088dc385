"""Text in XML, escaped as ``xml.sax.saxutils`` does, whose import fetches the whole of HTTP."""

from __future__ import annotations

from html import escape as html_escape

SPACES = {"\n": "&#10;", "\r": "&#13;", "\t": "&#9;"}


def escape(text: str) -> str:
    """The text between two tags."""
    return html_escape(text, quote=False)


def quoteattr(text: str) -> str:
    """The text as the value of an attribute, with its quotes."""
    for space, code in {"&": "&amp;", ">": "&gt;", "<": "&lt;", **SPACES}.items():
        text = text.replace(space, code)
    if '"' not in text:
        return f'"{text}"'
    if "'" not in text:
        return f"'{text}'"
    return '"{}"'.format(text.replace('"', "&quot;"))
