"""``sbafab reproduce``: measured values of the paper, of others and of a lab beside predictions."""

from __future__ import annotations

from pathlib import Path

import click

from sbafab.cli.options import json_option, out_option
from sbafab.cli.printing import print_json, print_verdict
from sbafab.lab.evidence import load_source
from sbafab.models.calibrated import load_calibration
from sbafab.validation.comparison import ComparisonDocument, compare, table_lines
from sbafab.validation.evidence import shipped_evidence
from sbafab.validation.paper_table import PAPER, TITLE, PaperTable
from sbafab.validation.paper_table import as_json as table_json

FOLDER = "reproduction"
ALL = "all"


@click.command()
@click.argument("source", required=False)
@click.option(
    "--calibration",
    metavar="NAME",
    help="Calibration of the models beside SOURCE: one that ships, a file of calibrate, or none.  "
    "[default: paper]",
)
@out_option
@json_option
def reproduce(source: str | None, calibration: str | None, out: Path, as_json: bool) -> None:
    """Compare predictions with measurements.

    Without SOURCE: OUT/reproduction/ receives reproduction.md, reproduction.json and a chart for
    each predicted figure of the paper, with its error bars. All values stand beside the models of
    films as drawn and bought, and those that were calibrated on also beside the calibrated models.

    SOURCE is evidence that ships (paper, pneudots, ...), "all" of it, a file of your own (.toml or
    .csv), or the lab's build records (.sqlite): its curves are printed beside the models, and
    nothing is written. Ranges of model and 90 % interval span what the source leaves open.
    """
    if source is not None:
        _print_comparison(source, calibration or PAPER, as_json)
        return
    if calibration is not None:
        raise click.UsageError("--calibration goes with a SOURCE")
    table, folder = PaperTable(), out / FOLDER
    table.write(folder)
    if as_json:
        print_json(table_json(table, folder=str(folder)))
        return
    for section, rows in table.sections.items():
        click.echo(f"\n{section}")
        for row in rows:
            predicted = row.predicted_text or "-"
            click.echo(f"  {row.figure:<58}{row.measured_text:>20}{predicted:>16}  {row.model}")
    click.echo(f"\n{TITLE}")
    for line in table_lines(table.curves):
        click.echo(f"  {line}")
    count = sum(row.predicted is not None for row in table.rows)
    print_verdict(
        f"\nPaper reproduced: {count} of {len(table.rows)} values predicted; {table.summary}. "
        f"Written to {folder}: reproduction.md, reproduction.json, charts",
        folder,
    )


def _print_comparison(source: str, name: str, as_json: bool) -> None:
    calibration = load_calibration(name, key="--calibration")
    evidences = shipped_evidence() if source == ALL else (load_source(source),)
    curves = [curve for evidence in evidences for curve in compare(evidence, calibration)]
    if as_json:
        print_json(ComparisonDocument.of(None, calibration=name, sources=evidences, curves=curves))
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
    bounded = [point for point in points if point.is_within is not None]
    inside = sum(point.is_within is True for point in bounded)
    print_verdict(
        f"{source} compared: {predicted} of {len(points)} values in {len(curves)} curves predicted"
        + (f", {inside} of {len(bounded)} in their 90 % intervals" if bounded else "")
    )
