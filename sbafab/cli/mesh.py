"""``sbafab mesh``: the meshes only, volume and shell meshes for simulation included."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from sbafab.cli.exit import run_parts
from sbafab.cli.options import LENGTH, VOLUME, OfChamber, Request, by_chamber, run_options
from sbafab.meshing.formats.table import CONFORMING_ENDINGS

if TYPE_CHECKING:
    from sbafab.meshing.conforming.layup import Element, Symmetry


def _positive(ctx: click.Context, param: click.Parameter, value: float) -> float:
    if value <= 0:
        raise click.BadParameter("must be a length above 0 mm", ctx, param)
    return value


def _fill(
    ctx: click.Context, param: click.Parameter, values: tuple[tuple[str, float], ...]
) -> float | dict[str, float] | None:
    """One volume for every balloon, or one for the balloons of each chamber."""
    found = by_chamber(ctx, param, values)
    if "" in found and len(found) > 1:
        raise click.BadParameter("give one volume for all, or one for each chamber", ctx, param)
    return found.get("", found) if found else None


@click.command()
@run_options
@click.option(
    "--h",
    "size",
    type=LENGTH.read,
    callback=_positive,
    default="0.35",
    show_default=True,
    metavar="MM",
    help="Side of the triangles.",
)
@click.option(
    "--element",
    type=click.Choice(["wedge", "tet"]),
    default="wedge",
    show_default=True,
    help="Second-order wedges or tetrahedra.",
)
@click.option(
    "--symmetry",
    type=click.Choice(["full", "half", "quarter", "sector"]),
    default="full",
    show_default=True,
    help="Which part is meshed.",
)
@click.option(
    "--fill",
    multiple=True,
    type=OfChamber(VOLUME, all_chambers=True).read,
    callback=_fill,
    metavar="UL|CHAMBER=UL",
    help="Air in each balloon, e.g. 5ul. Repeatable for chambers.  [default: flat]",
)
@click.option("--gaps", is_flag=True, help="Keep films as far apart as the masks hold them.")
@click.option("--flat", is_flag=True, help="Leave flat what is made for a tube.")
@click.option(
    "--format",
    "formats",
    type=click.Choice(CONFORMING_ENDINGS),
    multiple=True,
    help="Formats of the volume, shell and cavity meshes. Repeatable.  [default: all]",
)
def mesh(  # noqa: PLR0913, PLR0917 - one an option
    request: Request,
    size: float,
    element: Element,
    symmetry: Symmetry,
    fill: float | dict[str, float] | None,
    gaps: bool,
    flat: bool,
    formats: tuple[str, ...],
) -> None:
    """Write meshes: solid, cavities, volume and shell.

    The conforming ones take the extra "mesh": pip install "sbafab[mesh]".
    """
    from sbafab.meshing.conforming.layup import MeshSettings
    from sbafab.runs.run import Conforming

    settings = MeshSettings(size, element, symmetry, fill, gaps, not flat)
    conforming = Conforming(settings, formats or CONFORMING_ENDINGS)
    run_parts(request, ("mesh",), conforming=conforming)
