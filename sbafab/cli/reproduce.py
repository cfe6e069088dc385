"""``sbafab reproduce``: the paper's figures beside ours."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from sbafab.cli.options import json_option, out_option

if TYPE_CHECKING:
    from sbafab.reproduction.rows import Row

FOLDER = "reproduction"


@click.command()
@out_option
@json_option
def reproduce(out: Path, as_json: bool) -> None:
    """Put the paper's figures beside ours.

    OUT/reproduction/ gets reproduction.md, reproduction.json and a chart for each figure of the
    paper that is predicted, with the paper's error bars.
    """
    from sbafab.cli.printing import print_json
    from sbafab.reproduction import page

    found = page.reproduce(out / FOLDER)
    if as_json:
        print_json({**page.as_json(found), "folder": str(out / FOLDER)})
        return
    for section, rows in found.items():
        click.echo(f"\n{section}")
        for row in rows:
            click.echo(f"  {row.figure:<58}{_measured(row):>20}{_predicted(row):>16}  {row.model}")
    click.echo(f"\nwritten to {out / FOLDER}: reproduction.md, reproduction.json, charts")


def _measured(row: Row) -> str:
    return str(row.measured) if row.measured.unit else ""


def _predicted(row: Row) -> str:
    return "-" if row.predicted is None else f"{row.predicted:.4g} {row.measured.unit}"
