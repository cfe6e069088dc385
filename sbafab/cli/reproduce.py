"""``sbafab reproduce``: measured values of the paper, of others and of a lab beside predictions."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from sbafab.cli.options import json_option, out_option
from sbafab.cli.printing import print_json, print_verdict
from sbafab.evidence.files import shipped_evidence
from sbafab.reproduction import page
from sbafab.reproduction.comparison import as_json as as_document
from sbafab.reproduction.comparison import compare, table_lines
from sbafab.results.evidence import load_source

if TYPE_CHECKING:
    from sbafab.reproduction.rows import Row

FOLDER = "reproduction"
ALL = "all"


@click.command()
@click.argument("source", required=False)
@out_option
@json_option
def reproduce(source: str | None, out: Path, as_json: bool) -> None:
    """Compare predictions with measurements.

    Without SOURCE: OUT/reproduction/ receives reproduction.md, reproduction.json and a chart for
    each predicted figure of the paper, with its error bars.

    SOURCE is evidence that ships (paper, pneudots, ...), "all" of it, a file of your own (.toml or
    .csv), or the lab's build records (.sqlite): its curves are printed beside the models, and
    nothing is written. A range of a model spans what the source leaves open.
    """
    if source is not None:
        _print_comparison(source, as_json)
        return
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


def _print_comparison(source: str, as_json: bool) -> None:
    evidences = shipped_evidence() if source == ALL else (load_source(source),)
    curves = [curve for evidence in evidences for curve in compare(evidence)]
    if as_json:
        print_json(as_document(evidences, curves))
        return
    for evidence in evidences:
        click.echo(evidence.citation + (f", doi:{evidence.doi}" if evidence.doi else ""))
        for line in table_lines([curve for curve in curves if curve.source == evidence.id]):
            click.echo(line)
        for sentence in evidence.missing:
            click.echo(f"Not had: {sentence}")
        click.echo()
    points = [point for curve in curves for point in curve.points]
    predicted = sum(point.model is not None for point in points)
    print_verdict(
        f"{source} compared: {predicted} of {len(points)} values in {len(curves)} curves predicted"
    )


def _measured(row: Row) -> str:
    return str(row.measured) if row.measured.unit else ""


def _predicted(row: Row) -> str:
    return "-" if row.predicted is None else f"{row.predicted:.4g} {row.measured.unit}"
