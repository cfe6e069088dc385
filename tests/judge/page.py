"""What a traveller says: parts, holes, pins and lists of layers, by the headings of its tables."""

from __future__ import annotations

import re
from collections.abc import Iterator
from html.parser import HTMLParser
from typing import Any, NamedTuple

VOID = {"br", "col", "hr", "img", "input", "link", "meta", "wbr"}
TIMES = "\N{MULTIPLICATION SIGN}"
NUMBERS = re.compile(r"\d+(?:\.\d+)?")
PINS = re.compile(
    rf"(.+): ⌀([\d.]+) {TIMES} ([\d.]+) mm, ([\d.]+) mm in the plate, ([\d.]+) to ([\d.]+) mm over "
    r"it, ([\d.]+) mm or more over the stack"
)


class Tags(HTMLParser):
    """Which end tags close nothing, and which tags stay open."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.wrong: list[str] = []

    def handle_starttag(self, tag: str, attrs: object) -> None:
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: object) -> None:
        pass

    def handle_endtag(self, tag: str) -> None:
        if self.open and self.open[-1] == tag:
            self.open.pop()
        elif tag not in VOID:
            self.wrong.append(f"</{tag}> in line {self.getpos()[0]} closes nothing")


def words(node: Any) -> str:
    return " ".join(node.text_content().split())


def rows(page: Any, *heads: str) -> Iterator[dict[str, str]]:
    """The rows of the table that has all these headings, a cell for each heading."""
    for table in page.iter("table"):
        names = [words(cell) for cell in table.iterfind("thead/tr/th")]
        if not set(heads) <= set(names):
            continue
        spanned = ""
        for row in table.iterfind("tbody/tr"):
            cells = [words(cell) for cell in row]
            if len(cells) == len(names):
                spanned = cells[0]
            else:
                cells = [spanned, *cells]
            yield dict(zip(names, cells, strict=True))


def listed(said: str) -> tuple[int, ...]:
    """``4, 8, 12 … 20`` and ``7 to 9``: equal steps up to the last."""
    found: list[int] = []
    for group in said.split(", "):
        ends = [int(number) for number in NUMBERS.findall(group)]
        if " to " in group:
            found += range(ends[0], ends[1] + 1)
        elif "…" in group:
            step = ends[0] - found[-1]
            found += range(ends[0], ends[1] + 1, step)
        else:
            found += ends
    return tuple(found)


class Part(NamedTuple):
    """A row of the list that the parts are sorted and counted by."""

    pattern: str
    film: str
    role: str
    layers: tuple[int, ...]
    count: int
    spares: int
    pieces: int
    cut: float


def parts(page: Any) -> Iterator[Part]:
    for row in rows(page, "Counted", "Pattern", "Layers", "Number"):
        numbers = re.fullmatch(
            rf"(\d+)(?: \+ (\d+) spare)?(?: ?{TIMES} (\d+) pieces)?", row["Number"]
        )
        assert numbers, row
        count, spares, each = (int(number or 0) for number in numbers.groups())
        yield Part(
            row["Pattern"],
            row["Film"],
            row["Used as"],
            listed(row["Layers"]),
            count,
            spares,
            each or 1,
            float(NUMBERS.findall(row["Cut, each"])[0]),
        )


class PinHole(NamedTuple):
    """A hole of the base plate as the page has it: mm from the datum, and from the corner."""

    pin: str
    diameter: float
    corner: tuple[float, float]
    datum: tuple[float, float]
    films: float


def pin_holes(page: Any) -> list[PinHole]:
    found = []
    for table in page.xpath("//table[contains(@class, 'holes')]"):
        for row in table.iterfind("tbody/tr"):
            # After the diameter come the shoulder's depth and the push-out hole.
            name, diameter, _, _, *numbers = [words(cell) for cell in row]
            d, x, y, u, v, films = (float(number) for number in (diameter, *numbers[:5]))
            found.append(PinHole(name, d, (x, y), (u, v), films))
    return found


class Standing(NamedTuple):
    """A pin in the plate during a step: its diameter, length, and how much of it is where, mm.

    It stands ``low`` to ``high`` over the plate, and ``clear`` at least over the stack.
    """

    pin: str
    diameter: float
    length: float
    inside: float
    low: float
    high: float
    clear: float


def standing(step: Any) -> Iterator[Standing]:
    """``a, b and c: diameter and length, ...; d: ...``, a pin each."""
    for paragraph in step.xpath(".//p[b[text()='Pins:']]"):
        for group in words(paragraph).removeprefix("Pins: ").removesuffix(".").split("; "):
            said = PINS.fullmatch(group)
            assert said, group
            names, *numbers = said.groups()
            for name in re.split(r", | and ", names):
                yield Standing(name, *map(float, numbers))
