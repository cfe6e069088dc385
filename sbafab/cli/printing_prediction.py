"""What ``sbafab predict`` prints of a design: figures by group and model, and their validity.

What to design with comes first, each quantity once; other models of the same follow.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from sbafab.cli.lines import console, wrapped

if TYPE_CHECKING:
    from sbafab.models.figures import Figure, Model, Prediction

NAME, VALUE = 56, 10
"""Columns of a name, at most, and of a value."""
OTHERS = "Other models of the same: design with the figures above"


def print_prediction(found: Prediction) -> None:
    """The figures, then what each model is good for, and what is not predicted and why."""
    from rich.text import Text

    out = console()
    first = sorted(found.figures, key=lambda figure: figure.other)
    models = list(dict.fromkeys(figure.model for figure in first))
    others = [figure for figure in first if figure.other]
    own = first[: len(first) - len(others)]

    def part(title: str, lines: Iterator[str]) -> None:
        if title:
            out.print(Text(f"\n{title}", style="bold"))
        for line in lines:
            # A heading starts at the margin.
            is_head = title in ("", OTHERS) and not line.startswith(" ")
            out.print(Text(line, style="bold" if is_head else ""), soft_wrap=True)

    part("", figure_lines(own, models, out.width))
    if others:
        part(OTHERS, figure_lines(others, models, out.width))
    part("Models and validity", _numbered(models, out.width))
    if found.left_out:
        # What is left out for one reason is said together.
        why: dict[str, list[str]] = {}
        for one in found.left_out:
            why.setdefault(one.reason, []).append(one.name)
        left = (f"{', '.join(names)}: {reason}" for reason, names in why.items())
        part("Left out", (line for said in left for line in wrapped(said, out.width, "- ", "  ")))
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


def _numbered(models: Sequence[Model], width: int) -> Iterator[str]:
    for number, model in enumerate(models, start=1):
        said = f"{model.title}: {model.trust}"
        yield from wrapped(said, width, f"[{number}]".ljust(5), " " * 5)
