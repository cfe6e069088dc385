"""Coverage of a calibration's 90 % intervals in synthetic labs: docs/measured/synthetic_labs.json.

python -m docs.scripts.synthetic_labs takes about twenty minutes; it needs the extra "calibrate".
"""

from __future__ import annotations

from datetime import date

from docs.scripts.measured import Record, keep, texts, versions
from docs.scripts.tables import Table
from tests.validation.synthetic import held_out_inside, share_and_error

COMMAND = "python -m docs.scripts.synthetic_labs"
NAME = "synthetic_labs"
LABS, ROW = 300, 50
"""Labs in all, whose numbers are their seeds from 0 on, and in a row of the table."""
COLUMNS = ("labs", "left-out values", "in their 90 % intervals", "share")
ALL = "all"


def row_of(name: str, inside: list[list[bool]]) -> list[object]:
    """Return a row: how many values were left out, how many lay in their intervals, and the share
    with its standard error by labs.
    """
    share, error = share_and_error(inside)
    cells = sum(map(len, inside)), sum(map(sum, inside))
    return [name, *cells, f"{100 * share:.1f} +- {100 * error:.1f} %"]


def main() -> None:
    """Fit every lab but its last curve, and predict that."""
    inside: list[list[bool]] = []
    rows = []
    for first in range(0, LABS, ROW):
        these = [held_out_inside(number) for number in range(first, first + ROW)]
        rows.append(row_of(f"{first} to {first + ROW - 1}", these))
        print(*rows[-1], flush=True)
        inside += these
    rows.append(row_of(ALL, inside))
    table = Table(COLUMNS, texts(rows))
    used = versions(sbafab="sbafab", emcee="emcee", numpy="numpy")
    keep(NAME, Record(COMMAND, date.today().isoformat(), used, {"coverage": table}))


if __name__ == "__main__":
    main()
