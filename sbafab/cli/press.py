"""``sbafab press``: the heat-press schedule alone."""

from __future__ import annotations

import click

from sbafab.cli.options import Request, run_options
from sbafab.cli.run import run_parts


@click.command()
@run_options
def press(request: Request) -> None:
    """Write the heat-press schedule."""
    run_parts(request, ("press",))
