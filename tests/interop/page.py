"""How far off the sheets' area is in each program, as docs/testing.md says.

``SBAFAB_MEASURE=1 SBAFAB_LONG=1 python -m pytest tests/interop`` measures it anew for the page.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from datetime import date

from docs.scripts.measured import keep, record
from docs.scripts.tables import Table
from tests.interop.made import Sheet

NAME, TABLE = "programs", "areas"
FILM, CONTOUR = "film area off by", "a contour by at most"
SLACK = 1.5
"""Times the page's figure that a test lets pass: machines differ a little."""

is_measuring = bool(os.environ.get("SBAFAB_MEASURE"))
measured: dict[tuple[str, str], float] = {}
"""The worst share so far, by program and column."""


def film_is_as_on_the_page(program: str, sheet: Sheet, film: float) -> None:
    """Fails where the film area that a program found is further off than the page says."""
    _hold(program, FILM, film / sheet.film - 1)


def contours_are_as_on_the_page(
    program: str, sheet: Sheet, outers: Sequence[float], holes: Sequence[float]
) -> None:
    """The same of the film area and of every contour; areas are in mm2, least first."""
    film_is_as_on_the_page(program, sheet, sum(outers) - sum(holes))
    wanted = [*sheet.outers, *sheet.holes]
    for found, expected in zip([*outers, *holes], wanted, strict=True):
        _hold(program, CONTOUR, found / expected - 1)


def _hold(program: str, column: str, off: float) -> None:
    if is_measuring:
        measured[program, column] = max(measured.get((program, column), 0.0), abs(off))
        return
    said = record(NAME).tables[TABLE].cell(program, column)
    assert abs(off) <= SLACK * float(said.removesuffix(" %")) / 100, (program, column, off)


def write_page() -> None:
    """Puts what was measured into the record and the page; other programs keep their figures."""
    known = record(NAME)
    table = known.tables[TABLE]
    places = {column: list(table.columns).index(column) for column in (FILM, CONTOUR)}
    rows = [list(row) for row in table.rows]
    for (program, column), off in measured.items():
        (row,) = (row for row in rows if row[0] == program)
        row[places[column]] = f"{100 * off:.2g} %"
    keep(
        NAME,
        known._replace(day=date.today().isoformat(), tables={TABLE: Table(table.columns, rows)}),
    )
