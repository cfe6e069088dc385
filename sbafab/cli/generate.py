"""``sbafab generate``: every file of a design or an assembly."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from sbafab.assemblies.files import load
from sbafab.cli.options import Request, dxf_options, run_options, sheet_options
from sbafab.cli.printing import console, facts_table, print_line
from sbafab.cli.run import add_batch, print_run, print_run_verdict, run_request
from sbafab.design.records import Design
from sbafab.output.checked import EVERYTHING
from sbafab.runs.run import Run, RunRequest
from sbafab.simulators.simulator import NAMES

if TYPE_CHECKING:
    from rich.table import Table

    from sbafab.cutting.properties import Curves


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
    source = load(request.designs[0], request.assignments, request.waivers)
    if decks and not isinstance(source, Design):
        raise click.UsageError("--decks goes with one design; leave it out for an assembly")
    parts = (*EVERYTHING, *NAMES) if decks else EVERYTHING
    show = print_run if isinstance(source, Design) else print_assembly
    run_request(RunRequest(source, request.out, parts, curves), request, show)


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
