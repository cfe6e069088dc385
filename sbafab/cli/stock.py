"""``sbafab stock``: film on the shelf booked out of the stock file, and rests booked in."""

from __future__ import annotations

import re
from pathlib import Path

import click

from sbafab.cli.printing import print_line, print_verdict
from sbafab.output.artefacts import write_text
from sbafab.runs.stock import (
    bill_against,
    bill_csv,
    is_cut_from_stock,
    read_stock,
    rests,
    take,
)


@click.command()
@click.argument("folder", type=click.Path(path_type=Path))
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "--bill",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE",
    help="Write the bill of materials with what is in stock and what is lacking, as CSV.",
)
@click.option("--take", "is_taken", is_flag=True, help="Book the pieces out and their rests in.")
def stock(folder: Path, file: Path, bill: Path | None, is_taken: bool) -> None:
    """Show what an output folder takes of what is in stock, and what is lacking.

    Sheets are cut from pieces if the design names the stock FILE in sheets.stock. A run only reads
    it; --take books the run, once. A rest is one rectangle. Of a batch, every counted row of the
    bill of materials is compared.
    """
    shelf = read_stock(file)
    before = {piece.id for piece in shelf.piece}
    needs = bill_against(folder, shelf)
    if bill is not None:
        write_text(bill, bill_csv(needs))
    for need in needs:
        words = f"{need.item}, {re.split(r'; | [(]', need.specification)[0]}"
        state = f", {need.lacking} lacking" if need.lacking else ""
        print_line(f"{words}: {need.needed} needed, {need.in_stock} in stock{state}")
    for sheet, piece, rest in rests(folder) if is_taken or is_cut_from_stock(folder) else ():
        leaves = (
            "no rest worth keeping" if rest is None else f"a rest of {rest.size} at {rest.place}"
        )
        print_line(f"{Path(sheet.file).stem}: of piece {piece}; leaves {leaves}")
    if not is_taken:
        print_line(f"{file} is unchanged; --take books a run that was cut from it.")
        lacking = sum(need.lacking > 0 for need in needs)
        print_verdict(
            f"{folder.name}: {lacking} of {len(needs)} items lacking"
            if lacking
            else f"{folder.name}: all {len(needs)} items are in stock"
        )
        return
    for entry in take(folder, file).piece:
        if entry.id not in before:
            print_line(f"new piece {entry.id}: {entry.size} of {entry.film}")
    print_verdict(f"{file}: {folder.name} is taken")
