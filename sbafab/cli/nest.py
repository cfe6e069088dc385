"""``sbafab nest``: several designs cut together, from the same film sheets."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from sbafab.cli.exit import tell
from sbafab.cli.options import Request, dxf_options, several_run_options, sheet_options

if TYPE_CHECKING:
    from sbafab.cutting.properties import Curves


@click.command()
@several_run_options
@click.option("--name", default="job", show_default=True, help="Names the folder OUT/<name>/.")
@dxf_options
@sheet_options
def nest(request: Request, name: str, curves: Curves) -> None:
    """Cut several designs from the same film sheets.

    OUT/<name>/ gets a folder for each DESIGN and sheets/ with the parts of all. Overrides count
    for every design; how many of each is its own order.copies, or --copies of every one.
    """
    from sbafab.actuators import load_design
    from sbafab.cli.printing import job_json, print_job, shown_progress
    from sbafab.runs.run import RunRequest, generate

    designs = [
        load_design(design, request.assignments, request.waivers) for design in request.designs
    ]
    with shown_progress(request.as_json) as progress:
        job = generate(RunRequest(designs, request.out, curves=curves, name=name), progress)
    tell(job, request, job_json, print_job)
