"""``sbafab press``: the heat-press schedule only."""

from __future__ import annotations

import click

from sbafab.cli.exit import run_parts
from sbafab.cli.options import Request, run_options


@click.command()
@run_options
def press(request: Request) -> None:
    """Write the heat-press schedule."""
    run_parts(request, ("press",))
