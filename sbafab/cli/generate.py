"""``sbafab generate``: everything."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from sbafab.cli.exit import run_design, tell
from sbafab.cli.options import Request, dxf_options, run_options, sheet_options

if TYPE_CHECKING:
    from sbafab.assemblies.records import Assembly
    from sbafab.cutting.properties import Curves
    from sbafab.laminate.laminate import Laminate


@click.command()
@run_options
@dxf_options
@sheet_options
@click.option("--decks", is_flag=True, help="Write what each simulator reads, too.")
def generate(request: Request, curves: Curves, decks: bool) -> None:
    """Write everything: cut files, schedule, traveller, meshes.

    With --decks also calculix/, sofa/ and mujoco/, as `sbafab simulate --export` writes them.
    An assembly gets a folder for each of its designs, and sheets, traveller and solid of the whole.
    """
    from sbafab.assemblies.files import load
    from sbafab.design.records import Design
    from sbafab.output.checked import EVERYTHING
    from sbafab.output.run import Extras

    found = load(request.designs[0], request.assignments, request.waivers)
    if not isinstance(found, Design):
        if decks:
            raise click.UsageError("--decks goes with one design; leave it out for an assembly")
        _generate_assembly(found, request, curves)
        return
    extras = Extras(also=_write_decks) if decks else None
    run_design(found, request, EVERYTHING, curves, extras)


def _generate_assembly(assembly: Assembly, request: Request, curves: Curves) -> None:
    from sbafab.cli.printing import print_assembly, run_json, shown_progress
    from sbafab.output.assembly import generate_assembly

    with shown_progress(request.as_json) as progress:
        run = generate_assembly(assembly, request.out, progress, curves)
    tell(run, request, run_json, print_assembly)


def _write_decks(laminate: Laminate, folder: Path) -> None:
    from sbafab.output.decks import write_decks

    for name, why in write_decks(laminate, folder):
        click.echo(f"sbafab: nothing for {name}: {why}", err=True)
