"""``sbafab new``: a commented design file, a kit, or the calibration piece of the kerf."""

from __future__ import annotations

import shlex
from pathlib import Path

import click
from click.shell_completion import CompletionItem

from sbafab.cli.options import completions
from sbafab.cutting.calibration import write_coupon
from sbafab.design.files import template_summaries, write_new
from sbafab.design.kits import write_kit
from sbafab.version import GENERATOR

COUPON = "coupon"
KIT = "kit"


def templates(ctx: click.Context, param: click.Parameter, typed: str) -> list[CompletionItem]:
    """Complete the names of templates, "coupon" and "kit"."""
    extra = {COUPON: "the kerf's calibration piece", KIT: "films, tubes, press, laser, limits"}
    return completions(typed, (template_summaries() | extra).items())


@click.command()
@click.argument("template", shell_complete=templates)
@click.argument("file", type=click.Path(path_type=Path), required=False)
def new(template: str, file: Path | None) -> None:
    """Write a commented design file to start from.

    FILE is TEMPLATE.toml in this folder unless given.

    TEMPLATE "coupon" writes the calibration piece of the kerf, its picture and a table to fill in;
    FILE is then a folder, "coupon" unless given. TEMPLATE "kit" writes the films, tubes, press,
    laser and limits of the paper with their sources, for you to adapt to your lab (kit.toml).
    """
    if template == COUPON:
        _coupon(file or Path(COUPON))
        return
    if template == KIT:
        _kit(file or Path("kit.toml"))
        return

    written = write_new(template, file)
    path = shlex.quote(str(written))
    click.echo(f"{written} written. Edit it, then: sbafab generate {path}")


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
