"""``sbafab stock``: film on the shelf booked out of the stock file, and rests booked in."""

from __future__ import annotations

from pathlib import Path

import click

from sbafab.cli.printing import print_line, print_verdict
from sbafab.runs.stock import read_stock, rests, take


@click.command()
@click.argument("folder", type=click.Path(path_type=Path))
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--take", "is_taken", is_flag=True, help="Book the pieces out and their rests in.")
def stock(folder: Path, file: Path, is_taken: bool) -> None:
    """Show what an output folder takes of the film in stock.

    The design names the stock FILE in sheets.stock. A run only reads it; --take books the run,
    once. A rest is one rectangle.
    """
    before = {piece.id for piece in read_stock(file).piece}
    for sheet, piece, rest in rests(folder):
        leaves = (
            "no rest worth keeping" if rest is None else f"a rest of {rest.size} at {rest.place}"
        )
        print_line(f"{Path(sheet.file).stem}: of piece {piece}; leaves {leaves}")
    if not is_taken:
        print_line(f"{file} is unchanged; --take books the run.")
        return
    for entry in take(folder, file).piece:
        if entry.id not in before:
            print_line(f"new piece {entry.id}: {entry.size} of {entry.film}")
    print_verdict(f"{file}: {folder.name} is taken")
