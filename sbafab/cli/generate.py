"""``sbafab generate``: everything."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from sbafab.cli.exit import run_request
from sbafab.cli.options import Request, dxf_options, run_options, sheet_options

if TYPE_CHECKING:
    from sbafab.cutting.properties import Curves


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
    from sbafab.runs.run import RunRequest
    from sbafab.simulators.simulator import NAMES

    found = load(request.designs[0], request.assignments, request.waivers)
    if decks and not isinstance(found, Design):
        raise click.UsageError("--decks goes with one design; leave it out for an assembly")
    parts = (*EVERYTHING, *NAMES) if decks else EVERYTHING
    run_request(RunRequest(found, request.out, parts, curves), request)
