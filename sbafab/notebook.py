"""Tables for notebooks: in HTML, and of pandas."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

from sbafab.errors import DesignError

if TYPE_CHECKING:
    from pandas import DataFrame


def table_html(head: Sequence[str], rows: Iterable[Sequence[object]], caption: str = "") -> str:
    """Return an HTML table; numbers are aligned to the right, None is an empty cell."""
    top = "".join(f"<th>{escape(text)}</th>" for text in head)
    body = "".join(f"<tr>{''.join(map(_cell, row))}</tr>" for row in rows)
    title = f"<caption>{escape(caption)}</caption>" if caption else ""
    return f"<table>{title}<thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>"


def _cell(value: object) -> str:
    if value is None:
        return "<td></td>"
    if isinstance(value, float):
        return f'<td style="text-align:right">{value:.4g}</td>'
    return f'<td style="text-align:left">{escape(str(value))}</td>'


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
