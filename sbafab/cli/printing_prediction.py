"""What ``sbafab predict`` prints of a design: a verdict, on request all figures and their validity.

Of the figures what to design with comes first, each quantity once; other models of the same follow.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from sbafab.cli.lines import console, wrapped
from sbafab.models.verdict import LEFT_OUT

if TYPE_CHECKING:
    from sbafab.models.figures import Figure, Model, Prediction

NAME, VALUE = 56, 10
"""Columns of a name, at most, and of a value."""
FIRST = "Figures to design with"
OTHERS = "Other models of the same: design with the figures above"


def print_prediction(found: Prediction, verbose: bool = False) -> None:
    """The verdict; ``verbose`` also all figures, and what each model is good for."""
    from rich.text import Text

    out = console()
    label = max((len(line.quantity) for line in found.verdict), default=0) + 2
    before = ""
    for line in found.verdict:
        head = "" if line.quantity == before else f"{line.quantity}:"
        before = line.quantity
        said = f"{line.figure}: {line.note}" if line.quantity == LEFT_OUT else line.figure
        for row in wrapped(said, out.width, head.ljust(label), " " * label):
            out.print(Text(row), soft_wrap=True)
        if line.quantity != LEFT_OUT:
            for row in wrapped(line.note, out.width, " " * (label + 2), " " * (label + 2)):
                out.print(Text(row), soft_wrap=True)
    if verbose:
        _print_figures(found)
    else:
        out.print(Text(f"{len(found.figures)} figures, each with its model and validity: -v"))


def _print_figures(found: Prediction) -> None:
    """All figures, then what each model is good for."""
    from rich.text import Text

    out = console()
    first = sorted(found.figures, key=lambda figure: figure.other)
    models = list(dict.fromkeys(figure.model for figure in first))
    others = [figure for figure in first if figure.other]
    own = first[: len(first) - len(others)]

    def part(title: str, lines: Iterator[str]) -> None:
        out.print(Text(f"\n{title}", style="bold"))
        for line in lines:
            # A heading starts at the margin.
            is_head = title in (FIRST, OTHERS) and not line.startswith(" ")
            out.print(Text(line, style="bold" if is_head else ""), soft_wrap=True)

    part(FIRST, figure_lines(own, models, out.width))
    if others:
        part(OTHERS, figure_lines(others, models, out.width))
    part("Models and validity", _numbered(models, out.width))
    out.print()


def figure_lines(figures: Sequence[Figure], models: Sequence[Model], width: int) -> Iterator[str]:
    """A heading for each model of a group, and below it a line a figure.

    What a name has in common with the one above it, up to a comma, is left blank.
    """
    unit = max((len(figure.unit) for figure in figures), default=0)
    room = min(NAME, width - VALUE - unit - 4)
    for group in dict.fromkeys(figure.group for figure in figures):
        for number, model in enumerate(models, start=1):
            own = [one for one in figures if one.group == group and one.model == model]
            if own:
                yield f"{group}: {model.name} [{number}]"
            before = ""
            for one in own:
                head, comma, _ = one.name.partition(", ")
                name = one.name
                if comma and head == before:
                    name = " " * (len(head) + 2) + name.removeprefix(f"{head}, ")
                before = head
                *over, last = textwrap.wrap(name, room, subsequent_indent="  ") or [name]
                yield from (f"  {line}" for line in over)
                yield f"  {last:{room}}{one.value:>{VALUE}.4g}  {one.unit}".rstrip()
                yield from wrapped(one.aside, width, "    ", "    ") if one.aside else ()


def _numbered(models: Sequence[Model], width: int) -> Iterator[str]:
    for number, model in enumerate(models, start=1):
        said = f"{model.title}: {model.trust}"
        yield from wrapped(said, width, f"[{number}]".ljust(5), " " * 5)
