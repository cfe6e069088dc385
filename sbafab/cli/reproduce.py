"""``sbafab reproduce``: measured values of the paper, of others and of a lab beside predictions."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from sbafab.cli.options import json_option, out_option
from sbafab.cli.printing import print_json, print_verdict
from sbafab.lab.evidence import load_source
from sbafab.models.calibrated import load_calibration
from sbafab.validation import page
from sbafab.validation.comparison import (
    ComparisonDocument,
    compare,
    compare_calibrated,
    table_lines,
)
from sbafab.validation.files import shipped_evidence
from sbafab.validation.paper_calibrated import PAPER, TITLE

if TYPE_CHECKING:
    from sbafab.validation.rows import Row

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
    sections, calibrated = page.reproduce(out / FOLDER)
    if as_json:
        document = page.as_json(sections, calibrated)
        print_json({**document, "folder": str(out / FOLDER)})
        return
    for section, rows in sections.items():
        click.echo(f"\n{section}")
        for row in rows:
            click.echo(f"  {row.figure:<58}{_measured(row):>20}{_predicted(row):>16}  {row.model}")
    click.echo(f"\n{TITLE}")
    for line in table_lines(calibrated.curves):
        click.echo(f"  {line}")
    rows = [row for section in sections.values() for row in section]
    predicted = sum(row.predicted is not None for row in rows)
    print_verdict(
        f"\nPaper reproduced: {predicted} of {len(rows)} values predicted; "
        f"{calibrated.summary}. Written to "
        f"{out / FOLDER}: reproduction.md, reproduction.json, charts",
        out / FOLDER,
    )


def _print_comparison(source: str, name: str, as_json: bool) -> None:
    calibration = load_calibration(name, key="--calibration")
    evidences = shipped_evidence() if source == ALL else (load_source(source),)
    curves = [
        curve
        for evidence in evidences
        for curve in (
            compare_calibrated(evidence, calibration) if calibration else compare(evidence)
        )
    ]
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


def _measured(row: Row) -> str:
    return str(row.measured) if row.measured.unit else ""


def _predicted(row: Row) -> str:
    return "-" if row.predicted is None else f"{row.predicted:.4g} {row.measured.unit}"
