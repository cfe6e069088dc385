"""``sbafab generate``: every file of a design or an assembly."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import click

from sbafab.assemblies.files import load
from sbafab.cli.exit import RULE_FAILED, Exit, end
from sbafab.cli.options import (
    Request,
    dxf_options,
    run_options,
    sheet_options,
    target_yield_option,
)
from sbafab.cli.printing import console, facts_table, print_line, print_table, print_wrapped
from sbafab.cli.progress import shown_progress
from sbafab.cli.run import add_batch, print_run, print_run_verdict, run_json, run_request
from sbafab.design.files import changed_keys
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
        _generate_for_yield(source, target_yield, wanted, request)
        return
    run_request(wanted, request, print_run if isinstance(source, Design) else print_assembly)


def _generate_for_yield(
    design: Design, target: float, wanted: RunRequest, request: Request
) -> None:
    """Write the folder of a design changed for a yield; exits with 1 if none reaches it."""
    # Both designs are predicted, which a plain run does not do: models load slowly.
    from sbafab.cli.compare import print_figures
    from sbafab.search.compare import value_text
    from sbafab.search.target_yield import DESIGNS, reach_yield

    with shown_progress(request.as_json) as progress:
        reached = reach_yield(
            design, target, frozenset(changed_keys(request.assignments)), progress
        )
    if reached.design is None:
        end(Exit("yield", reached.sentence, RULE_FAILED), request.as_json)

    def show(run: Run) -> None:
        if reached.comparison is not None:
            names = ("", *DESIGNS)
            rows = [(row.key, *map(value_text, row.values)) for row in reached.changes]
            print_table("Changed for the yield", names, rows)
            print_figures(reached.comparison, names)
        print_wrapped(reached.sentence)
        print_line("")
        print_run(run)

    def as_json(run: Run) -> dict[str, object]:
        return {**run_json(run), "yield": reached.as_dict()}

    run_request(replace(wanted, source=reached.design), request, show, as_json)


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
