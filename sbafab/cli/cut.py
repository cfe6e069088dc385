"""``sbafab cut``: the cut files alone."""

from __future__ import annotations

import click

from sbafab.cli.options import Request, dxf_options, run_options, sheet_options
from sbafab.cli.run import run_parts
from sbafab.cutting.properties import Curves


@click.command()
@run_options
@dxf_options
@sheet_options
def cut(request: Request, curves: Curves) -> None:
    """Write the cut files: a DXF for each layer, and film sheets."""
    run_parts(request, ("cut",), curves)
