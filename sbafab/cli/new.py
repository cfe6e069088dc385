"""``sbafab new``: a commented design file, a kit, or the kerf's calibration piece."""

from __future__ import annotations

import shlex
from pathlib import Path

import click
from click.shell_completion import CompletionItem

from sbafab.cli.options import completions, json_option
from sbafab.cli.printing import print_json
from sbafab.design.files import template_summaries, write_new
from sbafab.design.kits import write_kit
from sbafab.version import GENERATOR

COUPON = "coupon"
KIT = "kit"
OTHERS = {
    COUPON: "the kerf's calibration piece",
    KIT: "films, tubes, press, laser, limits",
}
"""Files to start from other than designs, with a summary."""


def templates(ctx: click.Context, param: click.Parameter, typed: str) -> list[CompletionItem]:
    """Complete the names of templates, "coupon" and "kit"."""
    return completions(typed, (template_summaries() | OTHERS).items())


@click.command()
@click.argument("template", required=False, shell_complete=templates)
@click.argument("file", type=click.Path(path_type=Path), required=False)
@json_option
def new(template: str | None, file: Path | None, as_json: bool) -> None:
    """Write a commented design file to start from, or list the templates.

    Without TEMPLATE: list all, a line each. FILE is TEMPLATE.toml in this folder unless given.

    TEMPLATE "coupon" writes the calibration piece of the kerf, its picture and a table to fill in;
    FILE is then a folder, "coupon" unless given. TEMPLATE "kit" writes the films, tubes, press,
    laser and limits of the paper with their sources, for you to adapt to your lab (kit.toml).
    """
    if as_json and template is not None:
        raise click.UsageError("--json lists the templates; leave TEMPLATE out")
    if template is None:
        _list(as_json)
    elif template == COUPON:
        _coupon(file or Path(COUPON))
    elif template == KIT:
        path = shlex.quote(str(write_kit(file or Path("kit.toml"))))
        click.echo(f'{path} written. Edit it, then: sbafab generate DESIGN --set kit="{path}"')
    else:
        written = write_new(template, file)
        path = shlex.quote(str(written))
        click.echo(f"{written} written. Edit it, then: sbafab generate {path}")


def _list(as_json: bool) -> None:
    """Print the designs that ship, and a line on the other files."""
    designs = template_summaries()
    if as_json:
        print_json([{"name": name, "summary": summary} for name, summary in designs.items()])
        return
    every = designs | OTHERS
    width = max(map(len, every))
    for name, summary in every.items():
        click.echo(f"{name:<{width}}  {summary}")


def _coupon(folder: Path) -> None:
    # Its drawing takes numpy, which no other file to start from does.
    from sbafab.lab.coupon import write_coupon

    drawing, picture, table = write_coupon(folder, GENERATOR)
    click.echo(f"Cut {drawing} (picture: {picture}) from each film with a kerf offset of 0.")
    path = shlex.quote(str(table))
    click.echo(
        f"{folder} written. Measure the pieces, fill in {table}, then: sbafab kerf {path} "
        "--material tpe"
    )
