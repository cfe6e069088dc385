"""``sbafab new``: a commented design file, a kit, the kerf's calibration piece, or a test grid."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

from sbafab.cli.options import completions, json_option
from sbafab.cli.printing import print_json
from sbafab.cutting.calibration import write_coupon
from sbafab.cutting.power_grid import PowerGrid, write_grid
from sbafab.design.files import template_summaries, write_new
from sbafab.design.kits import write_kit
from sbafab.design.units import SHORTEST, millimetres
from sbafab.laminate.films import PAPER_PRODUCT, PAPER_THICKNESS
from sbafab.version import GENERATOR

COUPON = "coupon"
KIT = "kit"
TEST_GRID = "testgrid"
OTHERS = {
    COUPON: "the kerf's calibration piece",
    TEST_GRID: "powers and speeds to try on a film",
    KIT: "films, tubes, press, laser, limits",
}
"""What is no design, with a summary."""
POWERS, SPEEDS = "10,20,30,40,50", "10,20,40,80,160"


def templates(ctx: click.Context, param: click.Parameter, typed: str) -> list[CompletionItem]:
    """Complete the names of templates, "coupon", "testgrid" and "kit"."""
    return completions(typed, (template_summaries() | OTHERS).items())


@click.command()
@click.argument("template", required=False, shell_complete=templates)
@click.argument("file", type=click.Path(path_type=Path), required=False)
@click.option("--film", metavar="PRODUCT", help="testgrid: film.  [default: Stretchlon 200]")
@click.option("--thickness", metavar="LENGTH", help="testgrid: its thickness.  [default: 0.038]")
@click.option("--machine", metavar="NAME", help="testgrid: machine; required.")
@click.option("--power", metavar="LIST", help=f"testgrid: powers in %.  [default: {POWERS}]")
@click.option("--speed", metavar="LIST", help=f"testgrid: speeds in mm/s.  [default: {SPEEDS}]")
@click.option("--passes", type=click.IntRange(1, 50), help="testgrid: passes.  [default: 1]")
@json_option
def new(template: str | None, file: Path | None, as_json: bool, **grid: Any) -> None:
    """Write a commented design file to start from, or list the templates.

    Without TEMPLATE: list all, a line each. FILE is TEMPLATE.toml in this folder unless given.

    TEMPLATE "coupon" writes the calibration piece of the kerf, its picture and a table to fill in;
    FILE is then a folder, "coupon" unless given. TEMPLATE "kit" writes the films, tubes, press,
    laser and limits of the paper with their sources, for you to adapt to your lab (kit.toml).

    TEMPLATE "testgrid" writes squares to cut with each power and speed, a LightBurn layer each, and
    a table to fill in for `sbafab recipe`; FILE is a folder, "testgrid" unless given. The default
    powers and speeds are a start, not settings of your machine.
    """
    given = [name for name, value in grid.items() if value is not None]
    if as_json and template is not None:
        raise click.UsageError("--json lists the templates; leave TEMPLATE out")
    if given and template != TEST_GRID:
        raise click.UsageError(f"--{given[0]} goes with testgrid only; leave it out")
    if template is None:
        _list(as_json)
        return
    if template == TEST_GRID:
        _test_grid(file or Path(TEST_GRID), grid)
        return
    if template == COUPON:
        _coupon(file or Path(COUPON))
        return
    if template == KIT:
        _kit(file or Path("kit.toml"))
        return

    written = write_new(template, file)
    path = shlex.quote(str(written))
    click.echo(f"{written} written. Edit it, then: sbafab generate {path}")


def _list(as_json: bool) -> None:
    """Print the designs that ship, and in words what else may be written."""
    designs = template_summaries()
    if as_json:
        print_json([{"name": name, "summary": summary} for name, summary in designs.items()])
        return
    every = designs | OTHERS
    width = max(map(len, every))
    for name, summary in every.items():
        click.echo(f"{name:<{width}}  {summary}")


def _kit(file: Path) -> None:
    path = shlex.quote(str(write_kit(file)))
    click.echo(f'{path} written. Edit it, then: sbafab generate DESIGN --set kit="{path}"')


def _coupon(folder: Path) -> None:
    drawing, picture, table = write_coupon(folder, GENERATOR)
    click.echo(f"Cut {drawing} (picture: {picture}) from each film with a kerf offset of 0.")
    path = shlex.quote(str(table))
    click.echo(
        f"{folder} written. Measure the pieces, fill in {table}, then: sbafab kerf {path} "
        "--material tpe"
    )


def _test_grid(folder: Path, given: dict[str, Any]) -> None:
    if not given["machine"]:
        raise click.UsageError('testgrid needs --machine, e.g. --machine "Epilog Zing 24"')
    if given["film"] and not given["thickness"]:
        raise click.UsageError('--film needs --thickness, e.g. --thickness "50 um"')
    grid = PowerGrid(
        given["film"] or PAPER_PRODUCT,
        _thickness(given["thickness"]),
        given["machine"],
        _numbers("--power", given["power"] or POWERS),
        _numbers("--speed", given["speed"] or SPEEDS),
        given["passes"] or 1,
    )
    drawing, project, _, table = write_grid(folder, grid, GENERATOR)
    across, up = grid.size
    click.echo(
        f"{folder} written: {len(grid.cells)} squares on {across:g} x {up:g} mm of {grid.film}."
    )
    path = shlex.quote(str(table))
    click.echo(
        f"Cut {project} (LightBurn) or {drawing}, fill in {table}, then: sbafab recipe {path}"
    )


def _thickness(text: str | None) -> float:
    try:
        value = PAPER_THICKNESS if text is None else millimetres(text)
    except ValueError as error:
        raise click.BadParameter(f"{str(text)[:40]!r} {error}", param_hint="--thickness") from None
    if not SHORTEST <= value <= 1:
        raise click.BadParameter("must be at most 1 mm, and not 0", param_hint="--thickness")
    return value


def _numbers(option: str, text: str) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise click.BadParameter(
            f"{text[:40]!r} must be numbers parted by commas, e.g. 10,20,40", param_hint=option
        ) from None
