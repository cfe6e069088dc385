"""``sbafab generate``: everything."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from sbafab.cli.options import Request, dxf_options, run_options, sheet_options
from sbafab.cli.working import run_parts

if TYPE_CHECKING:
    from sbafab.cutting.dxf_write import DxfProfile
    from sbafab.laminate.laminate import Laminate


@click.command()
@run_options
@dxf_options
@sheet_options
@click.option("--decks", is_flag=True, help="Write what each simulator reads, too.")
def generate(request: Request, dxf_profile: DxfProfile, chord_error: float, decks: bool) -> None:
    """Write everything: cut files, film sheets, press schedule, traveller, meshes, pictures.

    With --decks also calculix/ and sofa/, as `sbafab simulate --export` does with its defaults.
    """
    from sbafab.output.run import EVERYTHING, Extras

    extras = Extras(also=_write_decks) if decks else None
    run_parts(request, EVERYTHING, dxf_profile, chord_error, extras)


def _write_decks(laminate: Laminate, folder: Path) -> None:
    from sbafab.output.decks import write_decks

    for name, why in write_decks(laminate, folder):
        click.echo(f"sbafab: nothing for {name}: {why}", err=True)
