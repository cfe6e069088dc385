"""``sbafab cut``: the cut files only."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from sbafab.cli.exit import run_parts
from sbafab.cli.options import Request, dxf_options, run_options, sheet_options

if TYPE_CHECKING:
    from sbafab.cutting.properties import Curves


@click.command()
@run_options
@dxf_options
@sheet_options
def cut(request: Request, curves: Curves) -> None:
    """Write the cut files: a DXF a layer, and film sheets."""
    run_parts(request, ("cut",), curves)
