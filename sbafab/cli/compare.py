"""``sbafab compare``: two designs side by side."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import click

from sbafab.cli.options import (
    designs,
    flow_option,
    json_option,
    out_option,
    pressures_option,
    set_option,
)
from sbafab.cli.printing import print_json, print_table, print_verdict, several
from sbafab.cli.progress import shown_progress
from sbafab.search.compare import (
    PAGE,
    DesignComparison,
    load_compared,
    margin_text,
    reached_text,
    write_page,
)
from sbafab.search.compare import compare as compared
from sbafab.search.vary import format_value


@click.command()
@click.argument("first", metavar="A", shell_complete=designs)
@click.argument("second", metavar="B", shell_complete=designs)
@pressures_option("Pressure of the figures, and the first of them of the pictures", "10")
@flow_option("Flow for the times")
@out_option
@set_option
@json_option
def compare(
    first: str,
    second: str,
    pressures: tuple[float, ...],
    flow_ml_min: float,
    out: Path,
    assignments: tuple[str, ...],
    as_json: bool,
) -> None:
    """Compare two designs: what differs, what each reaches.

    A and B are templates, design files, output folders, or rows of a sweep by number, such as
    out/1dof-5mm-sweep/sweep.csv:12. OUT/compare/compare.html has pictures of both side by side.
    """
    a, b = (load_compared(source, assignments) for source in (first, second))
    with shown_progress(as_json) as progress:
        comparison = compared(a, b, (first, second), pressures or None, flow_ml_min, progress)
        folder = write_page(comparison, out)
    if as_json:
        print_json({**comparison.as_dict(), "folder": str(folder)})
        return
    names = ("", *comparison.names)
    print_table("Keys", names, [(r.key, *map(format_value, r.values)) for r in comparison.keys])
    print_table("Rules", names, [(r.rule, *map(margin_text, r.margins)) for r in comparison.rules])
    print_figures(comparison, names)
    keys, rules = several(len(comparison.keys), "key"), several(len(comparison.rules), "rule")
    figures = several(sum(pair.differs for pair in comparison.figures), "figure")
    print_verdict(
        f"{comparison.names[0]} and {comparison.names[1]} differ in {keys}, {rules} and {figures}. "
        f"Written to {folder}: {PAGE}",
        folder,
    )


def print_figures(comparison: DesignComparison, names: Sequence[str]) -> None:
    """Print the main figures of both designs, below the names of the columns."""
    main = [
        (f"{pair.name}, {pair.unit}", *map(reached_text, pair.figures))
        for pair in comparison.figures
        if pair.is_main
    ]
    print_table("Figures, in parentheses the 90 % interval", names, main)
