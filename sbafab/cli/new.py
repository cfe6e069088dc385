"""``sbafab new``: a commented design file to start from, or the kerf's calibration piece."""

from __future__ import annotations

import shlex
from pathlib import Path

import click

from sbafab.cli.options import templates

COUPON = "coupon"
KIT = "kit"


@click.command()
@click.argument("template", shell_complete=templates)
@click.argument("file", type=click.Path(path_type=Path), required=False)
def new(template: str, file: Path | None) -> None:
    """Write a commented design file to start from.

    FILE is by default TEMPLATE.toml, here.

    TEMPLATE "coupon" writes the kerf's calibration piece, its picture and its table to fill in
    (FILE is then a folder: by default coupon). TEMPLATE "kit" writes the paper's films, tubes,
    press, laser and limits with their sources, to be made your lab's (by default kit.toml).
    """
    if template == COUPON:
        _coupon(file or Path(COUPON))
        return
    if template == KIT:
        _kit(file or Path("kit.toml"))
        return
    from sbafab.design.files import write_new

    written = write_new(template, file)
    path = shlex.quote(str(written))
    click.echo(f"{written} is yours to edit; then: sbafab generate {path}")


def _kit(file: Path) -> None:
    from sbafab.design.kits import write_kit

    path = shlex.quote(str(write_kit(file)))
    click.echo(f'{path} is yours to edit; then: sbafab generate DESIGN --set kit="{path}"')


def _coupon(folder: Path) -> None:
    from sbafab.cutting.calibration import write_coupon
    from sbafab.version import GENERATOR

    drawing, picture, table = write_coupon(folder, GENERATOR)
    click.echo(f"Cut {drawing} (picture: {picture}) from each film, with a kerf offset of 0.")
    path = shlex.quote(str(table))
    click.echo(f"Measure it and fill in {table}; then: sbafab kerf {path} --material tpe")
