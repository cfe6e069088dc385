"""Lines and labelled facts on standard output, coloured where somebody looks at them."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

KEPT = "\u00a0"
"""A space at which no line is broken."""


def console() -> Console:
    """A console on standard output; 80 columns where there is no terminal and no COLUMNS."""
    from rich.console import Console

    class Told(Console):
        """A console that leaves it to its caller what a closed pipe means."""

        def on_broken_pipe(self) -> None:
            raise BrokenPipeError

    return Told(highlight=False, soft_wrap=False)


def wrapped(said: str, width: int, first: str = "", rest: str = "") -> list[str]:
    """Lines of a sentence, broken between words; ``first`` stands before the first, ``rest`` before
    the others.
    """
    return textwrap.wrap(
        said,
        width,
        initial_indent=first,
        subsequent_indent=rest,
        break_long_words=False,
        break_on_hyphens=False,
    )


def print_wrapped(said: str, style: str = "", indent: str = "") -> None:
    """A sentence, broken between words where it is longer than a line; the rest indented.

    All of it stands behind ``indent``.

    Words joined by ``KEPT`` stay on one line.
    """
    rest = indent or "  "
    for line in wrapped(said, console().width, indent, rest):
        print_line(line.replace(KEPT, " "), style)


def print_line(said: str, style: str = "") -> None:
    """One line, however long."""
    from rich.text import Text

    console().print(Text(said, style=style), soft_wrap=True)


def print_facts(facts: Iterable[tuple[str, str]]) -> None:
    """Labels, and beside them what is said of each."""
    from rich.text import Text

    made = facts_table()
    for label, text in facts:
        made.add_row(label, Text(text))
    console().print(made)


def facts_table() -> Table:
    """Without rows yet: a bold label and what is said of it."""
    from rich.table import Table

    made = Table(box=None, pad_edge=False, show_header=False)
    made.add_column(no_wrap=True, style="bold")
    made.add_column(ratio=1, overflow="fold")
    return made
