"""``sbafab generate``: every file of a design or an assembly."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from sbafab.assemblies.files import load
from sbafab.cli.options import (
    Request,
    dxf_options,
    run_options,
    sheet_options,
    target_yield_option,
)
from sbafab.cli.printing import console, facts_table, print_line
from sbafab.cli.run import add_batch, print_run, print_run_verdict, run_request
from sbafab.design.records import Design
from sbafab.errors import DesignError
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
@target_yield_option(
    "Change the design as little as this share of good random builds needs, e.g. 0.95: order of "
    "stacking, bond and overhang, plate, ears. Keys of --set stay."
)
@click.option("--decks", is_flag=True, help="Also write the input files of the simulators.")
def generate(request: Request, curves: Curves, target_yield: float | None, decks: bool) -> None:
    """Write everything: cut files, schedule, traveller, meshes.

    --decks also writes calculix/, sofa/ and mujoco/, like `sbafab simulate --export`. An assembly
    has a folder for each of its designs, and sheets, a traveller and a solid of the whole.
    --target-yield prints what it changed and what that costs, and the folder's design.toml is the
    changed design; where the share is not reached, nothing is written and the exit code is 1.
    """
    source = load(request.designs[0], request.assignments, request.waivers)
    if decks and not isinstance(source, Design):
        raise click.UsageError("--decks goes with one design; leave it out for an assembly")
    parts = (*EVERYTHING, *NAMES) if decks else EVERYTHING
    wanted = RunRequest(source, request.out, parts, curves)
    if target_yield is not None:
        if not isinstance(source, Design):
            raise DesignError(
                "--target-yield goes with a design, and this is an assembly; generate its parts' "
                "designs one by one, and name the files it writes in the assembly"
            )
        # It predicts both designs, which a plain run does not: models load slowly.
        from sbafab.cli.target_yield import generate_for_yield

        generate_for_yield(source, target_yield, wanted, request)
        return
    run_request(wanted, request, print_run if isinstance(source, Design) else print_assembly)


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
