"""``sbafab map``: force and volume of the balloons over pressure and height."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from sbafab.actuators import load_design
from sbafab.cli import options
from sbafab.cli.options import PRESSURE, calibration_options, set_option
from sbafab.cli.printing import print_verdict
from sbafab.errors import DesignError, OutputError
from sbafab.models.formulas import force
from sbafab.models.intervals import factors_of
from sbafab.models.map_files import FORMATS, map_text
from sbafab.models.stack import stack


@click.command(name="map")
@click.argument("source", metavar="DESIGN", shell_complete=options.designs)
@set_option
@click.option(
    "--to",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE",
    help="Write FILE.csv, FILE.json or FILE.py.  [default: CSV on standard output]",
)
@click.option(
    "--pressure",
    type=PRESSURE.read,
    default="110 kPa",
    show_default=True,
    metavar="P",
    help="Highest pressure of the map.",
)
@click.option(
    "--points",
    type=click.IntRange(2, 1000),
    default=31,
    show_default=True,
    metavar="N",
    help="Number of pressures, and of heights, in CSV and JSON.",
)
@calibration_options
def map_(
    source: str,
    assignments: tuple[str, ...],
    to: Path | None,
    pressure: float,
    points: int,
    **factors: Any,
) -> None:
    """Map force and volume of the balloons.

    The map covers all pressures and heights, for use in other programs.
    """
    form = "csv" if to is None else to.suffix.removeprefix(".")
    if form not in FORMATS:
        raise DesignError(f"{to} must end with .{', .'.join(FORMATS)}, which sets the format")
    if pressure <= 0:
        raise DesignError(f"--pressure is {pressure:g} kPa; give more than 0 kPa")
    force(pressure, 0.0)  # raises past the burst pressure
    design = load_design(source, assignments, ())
    actuator = stack(design, most_pressure=pressure, factors=factors_of(design, factors))
    text = map_text(design.name, actuator, form, points)
    if to is None:
        click.echo(text, nl=False)
        return
    try:
        to.write_text(text, encoding="utf-8", newline="\n")
    except OSError as error:
        raise OutputError(f"{to} cannot be written: {error.strerror}") from None
    print_verdict(f"{design.name} mapped up to {pressure:g} kPa. Written to {to}")
