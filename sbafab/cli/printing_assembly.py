"""What ``sbafab generate`` prints of an assembly."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sbafab.cli.lines import console, facts_table, print_wrapped
from sbafab.cli.printing import add_batch, print_verdict

if TYPE_CHECKING:
    from rich.table import Table

    from sbafab.output.run import Run
    from sbafab.reports.assembly_prediction import AssemblyPrediction


def print_assembly(run: Run) -> None:
    """What was made of an assembly, what the rules found, and the checks between its parts."""
    out = console()
    if not run.kept:
        out.print(_made(run))
        out.print()
    print_verdict(run, "assembly")


def _made(run: Run) -> Table:
    from rich.text import Text

    made = facts_table()
    index = run.manifest
    parts = (f"{p['name']} ({p['design'] or p['kind']})" for p in index["parts"])
    made.add_row("assembly", Text(f"{index['name']}, {index['design_sha256'][:12]}"))
    made.add_row("parts", Text(", ".join(parts)))
    add_batch(made, run)
    return made


def print_assembly_prediction(found: AssemblyPrediction) -> None:
    """What the parts of an assembly do inflated, and what they then touch."""
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, pad_edge=False, header_style="bold")
    table.add_column("part", no_wrap=True)
    table.add_column("figure")
    table.add_column("value", justify="right", no_wrap=True)
    table.add_column("unit", no_wrap=True)
    table.add_column("model")
    table.add_column("paper")
    part = ""
    for figure in found.figures:
        table.add_row(
            figure.part if figure.part != part else "",
            Text(figure.name),
            f"{figure.value:.4g}",
            figure.unit,
            Text(figure.model),
            Text(figure.paper),
        )
        part = figure.part
    out = console()
    out.print(Text(f"{found.name} at {found.pressure_kpa:g} kPa", style="bold"))
    out.print(table)
    for measured in dict.fromkeys(figure.measured for figure in found.figures if figure.measured):
        names = [figure.name for figure in found.figures if figure.measured == measured]
        print_wrapped(f"{'; '.join(dict.fromkeys(names))}: {measured}")
    for sentence in found.met():
        out.print(Text(sentence))
    for one in found.left_out:
        out.print(Text(f"left out: {one}"))
