"""``sbafab recipe``: power and speed of a film from a filled test grid."""

from __future__ import annotations

import re
from pathlib import Path

import click

from sbafab.cutting.power_grid import chosen_result, read_grid
from sbafab.design.kits import add_recipe, recipe_toml
from sbafab.design.recipes import Operation

OPERATIONS: dict[str, Operation] = {"cut": "cut", "engrave": "engrave"}


def _date(context: click.Context, option: click.Parameter, text: str | None) -> str | None:
    if text is not None and not re.fullmatch(r"\d{4}-\d{2}-\d{2}", text):
        raise click.BadParameter(f"{text[:40]!r} is no date; write year-month-day")
    return text


@click.command()
@click.argument("table", type=click.Path(path_type=Path))
@click.option("--cell", help="Cell to take.  [default: the cleanest that cut through]")
@click.option(
    "--operation",
    type=click.Choice(list(OPERATIONS)),
    default="cut",
    show_default=True,
    help="Operation of the recipe.",
)
@click.option(
    "--kit",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Kit to add the recipe to, e.g. lab.toml.",
)
@click.option("--source", help="Source of the settings.  [default: the table's name]")
@click.option("--date", callback=_date, help="Day of the test, e.g. 2026-05-12.")
def recipe(
    table: Path,
    cell: str | None,
    operation: str,
    kit: Path | None,
    source: str | None,
    date: str | None,
) -> None:
    """Take power and speed of a film from a filled testgrid.csv.

    `sbafab new testgrid` writes the grid to cut and the table to fill in. Of the cells that cut
    through, the one with the best edge is taken, then the narrowest kerf, then the least energy.
    """
    kind = OPERATIONS[operation]
    result = chosen_result(read_grid(table, kind, source, date), kind, cell)
    settings = result.recipe
    click.echo(f"Cell {result.cell}: {settings.settings}, to {kind} {settings.film}")
    if kit is None:
        click.echo(f"\nPaste at the end of a kit or design:\n\n{recipe_toml(settings)}")
        return
    is_named = add_recipe(kit, settings)
    click.echo(f"Added to {kit}. Raise its version.")
    if not is_named:
        click.echo(f'LightBurn projects take it with machine = "{settings.machine}" under [laser].')
