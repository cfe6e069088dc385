"""``sbafab reproduce`` and ``calibrate``: measurements against predictions, and model fits."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from sbafab.api import evidence as api
from sbafab.cli import options as opt
from sbafab.cli import show
from sbafab.documents import Document, attribute
from sbafab.errors import DesignError

FOLDER = "reproduction"


@click.command()
@click.argument("source", required=False)
@opt.option(
    "--calibration NAME",
    "Calibration of the models beside SOURCE: one that ships, a file of calibrate, or none.  "
    "[default: paper]",
)
@opt.out_option
@opt.json_option
def reproduce(source: str | None, calibration: str | None, out: Path, as_json: bool) -> None:
    """Compare predictions with measurements.

    Without SOURCE: OUT/reproduction/ receives reproduction.md, reproduction.json and a chart for
    each predicted figure of the paper, with its error bars. All values are compared with the models
    of films as drawn and bought, and those used for calibration also with the calibrated models.

    SOURCE is the bundled evidence (paper), your own file (.toml or .csv), or the lab's build
    records (.sqlite): its curves are printed beside the models, and no files are written. Ranges of
    model and 90 % interval cover the set-ups that the source leaves open.
    """
    if source is not None:
        _print_comparison(source, calibration or api.PAPER, as_json)
        return
    if calibration is not None:
        raise click.UsageError("--calibration needs a SOURCE")
    table, folder = api.PaperTable(), out / FOLDER
    table.write(folder)
    if as_json:
        show.document(api.table_json(table, folder=str(folder)))
        return
    for section, rows in table.sections.items():
        click.echo(f"\n{section}")
        for row in rows:
            predicted = row.predicted_text or "-"
            click.echo(f"  {row.figure:<58}{row.measured_text:>20}{predicted:>16}  {row.model}")
    click.echo(f"\n{api.TITLE}")
    _print_curves(table.curves)
    count = sum(row.predicted is not None for row in table.rows)
    show.verdict(
        f"\nPaper reproduced: {count} of {len(table.rows)} values predicted; {table.summary}. "
        f"Written to {folder}: reproduction.md, reproduction.json, charts",
        folder,
    )


def _print_comparison(source: str, name: str, as_json: bool) -> None:
    calibration = api.load_calibration(name, key="--calibration")
    evidence = api.load_source(source)
    curves = api.compare(evidence, calibration)
    if as_json:
        show.document(
            api.ComparisonDocument.of(None, calibration=name, sources=[evidence], curves=curves)
        )
        return
    click.echo(evidence.citation + (f", doi:{evidence.doi}" if evidence.doi else ""))
    _print_curves(curves)
    for sentence in evidence.missing:
        show.wrapped(f"Not had: {sentence}")
    points = [point for curve in curves for point in curve.points]
    predicted = sum(point.model is not None for point in points)
    bounded = [point for point in points if point.within is not None]
    inside = sum(point.within is True for point in bounded)
    show.verdict(
        f"\n{source} compared: {predicted} of {len(points)} values in {len(curves)} curves "
        "predicted" + (f", {inside} of {len(bounded)} in their 90 % intervals" if bounded else "")
    )


def _print_curves(curves: Sequence[api.ComparedCurve]) -> None:
    """Print a table of each curve, then its assumptions and the reasons for missing models."""
    for curve in curves:
        axis = api.AXES[curve.x_name]
        rows = [
            ("" if point.x is None else f"{point.x:g} {axis}".rstrip(), *point.texts(curve.unit))
            for point in curve.points
        ]
        names = (curve.x_name, "measured", "model", "deviation", "90 % interval", "inside")
        title = f"\n{curve.curve}: {api.QUANTITIES[curve.quantity].title}, {curve.place}"
        show.table(title, names, rows)
        if curve.no_model:
            show.wrapped(f"{curve.no_model[:1].upper()}{curve.no_model[1:]}.")
        if curve.assumptions:
            show.wrapped(f"Not stated, so assumed: {'; '.join(curve.assumptions)}.")
        if not curve.comparable:
            show.wrapped(f"Not comparable: {curve.reason}")


# Fits.


class OpenEntry(Document):
    """The possible set-ups of a curve with an ambiguous source, with their probabilities."""

    curve: str
    probabilities: Mapping[str, float]


class CalibrateDocument(Document, schema="sbafab/calibrate@1"):
    """The output of ``calibrate --json``."""

    file: Path
    calibration: dict[str, Any]
    """contents of the file"""
    held_out: list[api.HeldOutPoint] = attribute("points")
    left_open: list[OpenEntry]
    not_fitted: list[dict[str, str]]


@click.command()
@click.argument("evidence", nargs=-1)
@opt.option("--name NAME", "Name of the calibration, and of its file, NAME.toml.", default="lab")
@opt.folder_option("Folder in which NAME.toml is written.")
@opt.json_option
def calibrate(evidence: tuple[str, ...], name: str, out: Path, as_json: bool) -> None:
    """Fit the models to measurements.

    EVIDENCE is a source as for reproduce: the bundled evidence (paper), your own file (.toml or
    .csv), or build records (.sqlite); several are fitted together. The default is the paper's. The
    fit gives modulus ratio, pocket loss, press factor and delays with their uncertainty, and the
    remaining model error. Each test is then predicted from a fit without it. A design or kit uses
    the resulting file with models.calibration = "NAME.toml".
    """
    _check_name(name)
    path = out / f"{name}.toml"
    _refuse_another_file(path)
    sources = [api.load_source(source) for source in evidence or ("paper",)]
    with show.progress(as_json) as progress:
        fitted = api.fit(name, sources, progress)
    out.mkdir(parents=True, exist_ok=True)
    api.replace_text(path, api.calibration_text(fitted.calibration))
    calibration, held_out = fitted.calibration, fitted.calibration.held_out
    if as_json:
        unfitted = [{"curve": curve, "reason": reason} for curve, reason in fitted.left_out]
        left_open = [
            OpenEntry(curve=k, probabilities=v) for k, v in fitted.calibration.set_ups.items()
        ]
        more = {"file": path, "calibration": calibration.as_dict(), "not_fitted": unfitted}
        show.document(CalibrateDocument.of(fitted, left_open=left_open, **more))
        return
    _print(fitted)
    judged = (
        f"{held_out.inside} of {held_out.points} left-out values in their 90 % intervals"
        if held_out.points
        else "one test alone, so that none could be left out"
    )
    show.verdict(f"\n{name} calibrated: {judged}. Written to {path}", path)


def _check_name(name: str) -> None:
    if not re.fullmatch(api.NAME_PATTERN, name):
        raise DesignError(
            f"--name is {api.shown(name)}; use letters, digits, dot, dash and underscore, such "
            "as lab"
        )
    if name in (api.NONE, api.PAPER):
        raise DesignError(f"--name is {api.shown(name)}, which is reserved; give another name")


def _refuse_another_file(path: Path) -> None:
    """Raise DesignError if an existing file at this path is not a calibration, such as a kit."""
    try:
        schema = str(api.read_toml(path).get("schema"))
    except DesignError:
        schema = ""
    if path.exists() and not schema.startswith("sbafab/calibration@"):
        raise DesignError(f"{path} exists and is not a calibration; give another --name")


def _print(fitted: api.CalibrationFit) -> None:
    calibration = fitted.calibration
    rows = []
    for unknown in api.UNKNOWNS:
        low, high = calibration.bounds(unknown.field)
        value = unknown.shown(calibration.values[unknown.field])
        prior = f"{unknown.shown(unknown.middle)}: {unknown.source}"
        rows.append((unknown.title, str(value), f"{low:.3g} to {high:.3g}", prior))
    show.table("Unknowns", ("", "median", "90 % interval", "prior"), rows)
    for sentence in calibration.sentences:
        click.echo(f"Not distinguished by the evidence: {sentence}")
    missed = ", ".join(
        f"{group} {100 * spread:.0f} %" for group, spread in calibration.discrepancy.items()
    )
    click.echo(f"What the models miss beyond that (one standard deviation): {missed}")
    names = ("", "measured", "predicted", "90 % interval", "")
    show.table("Left out", names, [*map(_held_out, fitted.points)])
    for curve, set_ups in fitted.calibration.set_ups.items():
        shares = ", ".join(f"{phrase} {100 * share:.0f} %" for phrase, share in set_ups.items())
        click.echo(f"Left open by {curve}: {shares}")
    for curve, reason in fitted.left_out:
        click.echo(f"Not fitted: {curve}: {reason}")


def _held_out(point: api.HeldOutPoint) -> Sequence[str]:
    at = "" if point.place is None else f" at {point.place:g}"
    interval = f"{point.low:.3g} to {point.high:.3g} {point.unit}".rstrip()
    outside = "" if point.inside else "outside"
    return point.curve + at, f"{point.measured:.3g}", f"{point.median:.3g}", interval, outside
