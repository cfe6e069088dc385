"""``sbafab mesh``: the meshes alone, with volume and shell meshes for simulation."""

from __future__ import annotations

import click

from sbafab.cli.options import LENGTH, VOLUME, OfChamber, Request, by_chamber, run_options
from sbafab.cli.run import run_parts
from sbafab.meshing.conforming.layup import Element, MeshSettings, Symmetry
from sbafab.meshing.formats import CONFORMING_ENDINGS
from sbafab.runs.run import Conforming


def _positive(ctx: click.Context, param: click.Parameter, value: float) -> float:
    if value <= 0:
        raise click.BadParameter("must be a length above 0 mm", ctx, param)
    return value


def _fill(
    ctx: click.Context, param: click.Parameter, values: tuple[tuple[str, float], ...]
) -> float | dict[str, float] | None:
    """Return one volume for all balloons, one by chamber, or None."""
    volumes = by_chamber(ctx, param, values)
    if "" in volumes and len(volumes) > 1:
        raise click.BadParameter("give one volume for all, or one for each chamber", ctx, param)
    return volumes.get("", volumes) if volumes else None


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
    help="Edge length of the triangles.",
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
    help="Part of the actuator that is meshed.",
)
@click.option(
    "--fill",
    multiple=True,
    type=OfChamber(VOLUME, all_chambers=True).read,
    callback=_fill,
    metavar="UL|CHAMBER=UL",
    help="Air volume of each balloon, e.g. 5ul. Repeatable for chambers.  [default: flat]",
)
@click.option("--gaps", is_flag=True, help="Keep films a mask thickness apart.")
@click.option("--flat", is_flag=True, help="Do not wrap designs for a tube.")
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

    Volume and shell meshes need the extra "mesh": pip install "sbafab[mesh]".
    """
    settings = MeshSettings(size, element, symmetry, fill, gaps, not flat)
    conforming = Conforming(settings, formats or CONFORMING_ENDINGS)
    run_parts(request, ("mesh",), conforming=conforming)
