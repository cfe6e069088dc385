"""What ``sbafab generate`` prints of an assembly."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sbafab.cli.printing import (
    add_batch,
    console,
    facts_table,
    print_verdict,
)

if TYPE_CHECKING:
    from rich.table import Table

    from sbafab.output.run import Run


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
