"""``sbafab map``: force and volume of the balloons over pressure and height."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from sbafab.actuators import build, load_design
from sbafab.cli import options
from sbafab.cli.options import PRESSURE, calibration_options, refuse_options, set_option
from sbafab.cli.printing import print_verdict
from sbafab.cli.progress import print_result
from sbafab.errors import DesignError, OutputError
from sbafab.models.formulas import refuse_beyond_burst, refuse_pressure
from sbafab.models.intervals import factors_of
from sbafab.models.map_files import FORMATS, map_text
from sbafab.models.stack import stack
from sbafab.simulators.mujoco.mjcf import chain_text

MUJOCO = "xml"
"""Ending of a MuJoCo model."""
MODEL_PRESSURE = 10.0
"""kPa in each chamber of a MuJoCo model, unless others are given."""


@click.command(name="map")
@click.argument("source", metavar="DESIGN", shell_complete=options.designs)
@set_option
@click.option(
    "--to",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE",
    help="Write FILE.csv, FILE.json, FILE.py, FILE.xml (MuJoCo) or FILE.urdf.  [default: CSV on "
    "standard output]",
)
@click.option(
    "--pressure",
    type=PRESSURE.read,
    default="110 kPa",
    metavar="P",
    help="Highest pressure of the map.",
)
@click.option(
    "--points",
    type=click.IntRange(2, 1000),
    default=31,
    metavar="N",
    help="Number of pressures, and of heights, in CSV and JSON.",
)
@click.option(
    "--pressures",
    metavar="P,P,...",
    help="Pressures that the .xml file is for, one a chamber.  [default: 10 kPa in each]",
)
@calibration_options
def map_(
    source: str,
    assignments: tuple[str, ...],
    to: Path | None,
    pressure: float,
    points: int,
    pressures: str | None,
    **factors: Any,
) -> None:
    """Map force and volume of the balloons.

    The map covers all pressures and heights, for use in other programs. FILE.xml is a MuJoCo model
    of the stack about its pose at the given pressures, FILE.urdf its kinematic chain.
    """
    form = "csv" if to is None else to.suffix.removeprefix(".")
    formats = (*FORMATS, MUJOCO)
    if form not in formats:
        raise DesignError(f"{to} must end with .{', .'.join(formats)}, which sets the format")
    if form != MUJOCO:
        refuse_options("is for a MuJoCo model; give --to FILE.xml, or leave it out", "pressures")
    if pressure <= 0:
        raise DesignError(f"--pressure is {pressure:g} kPa; give more than 0 kPa")
    design = load_design(source, assignments, ())
    refuse_pressure(pressure)
    refuse_beyond_burst(build(design), pressure)
    actuator = stack(design, most_pressure=pressure, factors=factors_of(design, factors))
    if form == MUJOCO:
        text = chain_text(design.name, actuator, _listed(pressures, actuator.chambers))
    else:
        text = map_text(design.name, actuator, form, points)
    if to is None:
        print_result(text.removesuffix("\n"))
        return
    try:
        to.write_text(text, encoding="utf-8", newline="\n")
    except OSError as error:
        raise OutputError(f"{to} cannot be written: {error.strerror}") from None
    print_verdict(f"{design.name} mapped up to {pressure:g} kPa. Written to {to}", to)


def _listed(pressures: str | None, chambers: int) -> tuple[float, ...]:
    """Return pressures in kPa, one a chamber. Raises BadParameter, DesignError."""
    if pressures is None:
        return (MODEL_PRESSURE,) * chambers
    each = tuple(PRESSURE.read(text) for text in pressures.split(","))
    if len(each) != chambers:
        raise DesignError(
            f"--pressures has {len(each)} of {chambers} pressures; give one a "
            "chamber, with commas between them, such as 10,0,0"
        )
    return each
