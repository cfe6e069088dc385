"""``sbafab generate``: every file of a design or an assembly."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from sbafab.cli.exit import print_error
from sbafab.cli.options import Request, dxf_options, run_options, sheet_options
from sbafab.cli.printing import console, facts_table, print_line
from sbafab.cli.progress import shown_progress
from sbafab.cli.run import add_batch, finish, print_run_verdict, run_design, run_json

if TYPE_CHECKING:
    from rich.table import Table

    from sbafab.assemblies.records import Assembly
    from sbafab.cutting.properties import Curves
    from sbafab.laminate.laminate import Laminate
    from sbafab.output.run import Run


@click.command()
@run_options
@dxf_options
@sheet_options
@click.option("--decks", is_flag=True, help="Also write the input files of the simulators.")
def generate(request: Request, curves: Curves, decks: bool) -> None:
    """Write everything: cut files, schedule, traveller, meshes.

    --decks also writes calculix/, sofa/ and mujoco/, like `sbafab simulate --export`. An assembly
    has a folder for each of its designs, and sheets, a traveller and a solid of the whole.
    """
    from sbafab.assemblies.files import load
    from sbafab.design.records import Design
    from sbafab.output.checked import EVERYTHING
    from sbafab.output.run import Extras

    source = load(request.designs[0], request.assignments, request.waivers)
    if not isinstance(source, Design):
        if decks:
            raise click.UsageError("--decks goes with one design; leave it out for an assembly")
        _generate_assembly(source, request, curves)
        return
    extras = Extras(also=_write_decks) if decks else None
    run_design(source, request, EVERYTHING, curves, extras)


def _generate_assembly(assembly: Assembly, request: Request, curves: Curves) -> None:
    from sbafab.output.assembly import generate_assembly

    with shown_progress(request.as_json) as progress:
        run = generate_assembly(assembly, request.out, progress, curves)
    finish(run, request, run_json, print_assembly)


def _write_decks(laminate: Laminate, folder: Path) -> None:
    from sbafab.output.decks import write_decks

    for name, why in write_decks(laminate, folder):
        print_error(f"no input files for {name}: {why}")


def print_assembly(run: Run) -> None:
    """Print the table of an assembly's files and the verdict, checks between parts included."""
    if not run.kept:
        console().print(_assembly_table(run))
        print_line("")
    print_run_verdict(run, "assembly")


def _assembly_table(run: Run) -> Table:
    from rich.text import Text

    table = facts_table()
    index = run.manifest
    parts = (f"{p['name']} ({p['design'] or p['kind']})" for p in index["parts"])
    table.add_row("assembly", Text(f"{index['name']}, {index['design_sha256'][:12]}"))
    table.add_row("parts", Text(", ".join(parts)))
    add_batch(table, run)
    return table
