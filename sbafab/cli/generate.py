"""``sbafab generate``: everything."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from sbafab.cli.options import Request, dxf_options, run_options, sheet_options
from sbafab.cli.working import run_parts

if TYPE_CHECKING:
    from sbafab.cutting.dxf_write import DxfProfile


@click.command()
@run_options
@dxf_options
@sheet_options
def generate(request: Request, dxf_profile: DxfProfile, chord_error: float) -> None:
    """Write everything: cut files, film sheets, press schedule, traveller, meshes, pictures."""
    run_parts(request, ("cut", "press", "mesh", "preview"), dxf_profile, chord_error)
