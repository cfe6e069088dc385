"""``sbafab calibrate``: the models fitted to measurements, as a file that designs and kits name."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from sbafab.cli.options import folder_option, json_option
from sbafab.cli.printing import print_json, print_table, print_verdict
from sbafab.cli.progress import shown_progress
from sbafab.design.files import shown
from sbafab.design.sections import NAME_PATTERN
from sbafab.errors import DesignError, OutputError
from sbafab.folders.swap import replace_text
from sbafab.lab.evidence import load_source
from sbafab.models.calibrated import NONE, shipped_names
from sbafab.models.unknowns import UNKNOWNS
from sbafab.validation.fit import Fit, HeldOutPoint, calibration_text, fit


@click.command()
@click.argument("evidence", nargs=-1)
@click.option(
    "--name",
    default="lab",
    metavar="NAME",
    help="Name of the calibration, and of its file, NAME.toml.",
)
@folder_option("Folder in which NAME.toml is written.")
@json_option
def calibrate(evidence: tuple[str, ...], name: str, out: Path, as_json: bool) -> None:
    """Fit the models to measurements.

    EVIDENCE is what reproduce takes: evidence that ships (paper), a file of your own (.toml or
    .csv), or build records (.sqlite); several are fitted together. By default it is the paper's.
    The fit gives modulus ratio, pocket loss, press factor and delays with their uncertainty, and
    what the models miss beyond that. Each test is then predicted from a fit without it. A design
    or kit uses the file that is written with models.calibration = "NAME.toml".
    """
    _check_name(name)
    sources = [load_source(source) for source in evidence or ("paper",)]
    with shown_progress(as_json) as progress:
        fitted = fit(name, sources, progress)
    path = out / f"{name}.toml"
    try:
        out.mkdir(parents=True, exist_ok=True)
        replace_text(path, calibration_text(fitted.calibration))
    except OSError as error:
        raise OutputError(f"{path} cannot be written: {error.strerror}") from None
    if as_json:
        print_json(_as_json(fitted, path))
        return
    _print(fitted)
    calibration = fitted.calibration
    judged = (
        f"{calibration.inside} of {calibration.points} left-out values in their 90 % intervals"
        if calibration.points
        else "one test alone, so that none could be left out"
    )
    print_verdict(f"\n{name} calibrated: {judged}. Written to {path}", path)


def _check_name(name: str) -> None:
    if not re.fullmatch(NAME_PATTERN, name):
        raise DesignError(
            f"--name is {shown(name)}; use letters, digits, dot, dash and underscore, such as lab"
        )
    if name in (NONE, *shipped_names()):
        raise DesignError(
            f"--name is {shown(name)}, which stands for another one; give another name"
        )


def _print(fitted: Fit) -> None:
    calibration = fitted.calibration
    rows = []
    for unknown in UNKNOWNS:
        low, high = calibration.bounds(unknown.field)
        value = unknown.shown(calibration.values[unknown.field])
        prior = f"{unknown.shown(unknown.middle)}: {unknown.source}"
        rows.append((unknown.title, str(value), f"{low:.3g} to {high:.3g}", prior))
    print_table("Unknowns", ("", "median", "90 % interval", "prior"), rows)
    for sentence in calibration.sentences:
        click.echo(f"Not distinguished by the evidence: {sentence}")
    missed = ", ".join(
        f"{group} {100 * spread:.0f} %" for group, spread in calibration.discrepancy.items()
    )
    click.echo(f"What the models miss beyond that (one standard deviation): {missed}")
    names = ("", "measured", "predicted", "90 % interval", "")
    print_table("Left out", names, [*map(_held_out, fitted.points)])
    for name, set_ups in fitted.open_set_ups.items():
        shares = ", ".join(f"{phrase} {100 * share:.0f} %" for phrase, share in set_ups.items())
        click.echo(f"Left open by {name}: {shares}")
    for curve, reason in fitted.left_out:
        click.echo(f"Not fitted: {curve}: {reason}")


def _held_out(point: HeldOutPoint) -> Sequence[str]:
    at = "" if point.place is None else f" at {point.place:g}"
    interval = f"{point.low:.3g} to {point.high:.3g} {point.unit}".rstrip()
    outside = "" if point.is_inside else "outside"
    return point.curve + at, f"{point.measured:.3g}", f"{point.median:.3g}", interval, outside


def _as_json(fitted: Fit, path: Path) -> dict[str, Any]:
    return {
        "schema": "sbafab/calibrate@1",
        "file": str(path),
        "calibration": fitted.calibration.as_dict(),
        "held_out": [{**asdict(point), "inside": point.is_inside} for point in fitted.points],
        "left_open": [
            {"curve": curve, "probabilities": shares}
            for curve, shares in fitted.open_set_ups.items()
        ],
        "not_fitted": [{"curve": curve, "reason": reason} for curve, reason in fitted.left_out],
    }
