"""Escaping of text in XML as in ``xml.sax.saxutils``, whose import loads all of HTTP; templates;
tables for notebooks, in HTML and pandas.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape as html_escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sbafab.errors import DesignError

if TYPE_CHECKING:
    from jinja2 import Environment
    from pandas import DataFrame

SPACES = {"\n": "&#10;", "\r": "&#13;", "\t": "&#9;"}


def escape(text: str) -> str:
    """Return text escaped for use between tags."""
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


# Tables for notebooks.


def table_html(head: Sequence[str], rows: Iterable[Sequence[object]], caption: str = "") -> str:
    """Return an HTML table; numbers are aligned to the right, None is an empty cell."""
    top = "".join(f"<th>{html_escape(text)}</th>" for text in head)
    body = "".join(f"<tr>{''.join(map(_cell, row))}</tr>" for row in rows)
    title = f"<caption>{html_escape(caption)}</caption>" if caption else ""
    return f"<table>{title}<thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>"


def _cell(value: object) -> str:
    if value is None:
        return "<td></td>"
    if isinstance(value, float):
        return f'<td style="text-align:right">{value:.4g}</td>'
    return f'<td style="text-align:left">{html_escape(str(value))}</td>'


def data_frame(rows: Sequence[dict[str, Any]]) -> DataFrame:
    """Return rows as a pandas DataFrame. Raises DesignError without pandas."""
    try:
        from pandas import DataFrame
    except ImportError:
        raise DesignError(
            "frame() needs pandas, which is not installed; install it with pip install pandas, or "
            "use .rows, a list of dicts"
        ) from None
    return DataFrame(rows)
