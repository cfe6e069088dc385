"""``sbafab mesh``: the meshes only."""

from __future__ import annotations

import click

from sbafab.cli.options import Request, run_options
from sbafab.cli.working import run_parts


@click.command()
@run_options
def mesh(request: Request) -> None:
    """Write the solid and its cavities as meshes."""
    run_parts(request, ("mesh",))
