"""``sbafab reproduce``: measured values of the paper beside predictions."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from sbafab.cli.options import json_option, out_option
from sbafab.cli.printing import print_json, print_verdict
from sbafab.reproduction import page

if TYPE_CHECKING:
    from sbafab.reproduction.rows import Row

FOLDER = "reproduction"


@click.command()
@out_option
@json_option
def reproduce(out: Path, as_json: bool) -> None:
    """Compare predictions with the paper's measurements.

    OUT/reproduction/ receives reproduction.md, reproduction.json and a chart for each predicted
    figure of the paper, with its error bars.
    """
    sections = page.reproduce(out / FOLDER)
    if as_json:
        print_json({**page.as_json(sections), "folder": str(out / FOLDER)})
        return
    for section, rows in sections.items():
        click.echo(f"\n{section}")
        for row in rows:
            click.echo(f"  {row.figure:<58}{_measured(row):>20}{_predicted(row):>16}  {row.model}")
    rows = [row for section in sections.values() for row in section]
    predicted = sum(row.predicted is not None for row in rows)
    print_verdict(
        f"\nPaper reproduced: {predicted} of {len(rows)} values predicted. Written to "
        f"{out / FOLDER}: reproduction.md, reproduction.json, charts"
    )


def _measured(row: Row) -> str:
    return str(row.measured) if row.measured.unit else ""


def _predicted(row: Row) -> str:
    return "-" if row.predicted is None else f"{row.predicted:.4g} {row.measured.unit}"
