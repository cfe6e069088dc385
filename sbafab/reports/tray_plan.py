"""tray.pdf: pages to print at 1:1, with a place for every part in the order of laying.

Each laminate of a press cycle has its own pages, which all cycles reuse. Parts lie on their
outlines, upper side up, so that a wrong or missing part is noticed. Ours; not tried.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from sbafab.geometry.edges import Point
from sbafab.geometry.region import Region
from sbafab.laminate.assembly import laying
from sbafab.laminate.laminate import Laminate, Layer
from sbafab.pressing.cycles import Runs, serial
from sbafab.pressing.schedule import layers_in_words
from sbafab.reports.underlay import BAR, BLACK, CLOSE, FILM, GREY, MASK, PAPER, PdfPage, pdf

SIDE, HEAD, FOOT = 12.0, 34.0, 12.0
"""Margins of the page: left and right, above and below, mm."""
GAP, WORDS, HEADING = 2.5, 2.6, 3.4
"""mm between two places, and the sizes of labels and of a step's heading."""
LABEL = 3.6
"""Height of a place's label below its part, mm."""
LETTER = 0.58
"""Mean width of a label's letters, in font sizes: slightly above Helvetica's digits."""
MOST_NAMED = 8
"""Up to this many serials of a place are in its heading; otherwise the first and the last."""


@dataclass(frozen=True)
class TrayPlace:
    """A part on a page: its frame's origin in mm from the page's lower left corner."""

    layer: Layer
    region: Region
    at: Point


@dataclass(frozen=True)
class TraySheet:
    """One page of a laminate: its size in mm, its parts, and the heading of each step with its
    position.
    """

    size: tuple[float, float]
    places: tuple[TrayPlace, ...]
    headings: tuple[tuple[Point, str], ...]


def tray_pdf(laminate: Laminate, runs: Runs, design_sha256: str, batch: str | None = None) -> bytes:
    """Return the pages of all places of a cycle."""
    sheets = tray_sheets(laminate)
    drawn = [_drawn(sheet) for sheet in sheets]
    pages = []
    for place in range(1, runs.together + 1):
        for number, under in enumerate(drawn, 1):
            page = PdfPage(under.width, under.height, under)
            which = f", page {number} of {len(sheets)}" if len(sheets) > 1 else ""
            _head(page, f"{laminate.name}: tray{_place_words(runs, place, batch)}{which}")
            page.text((SIDE, 6), f"design {design_sha256[:12]}", WORDS)
            pages.append(page)
    return pdf(pages, f"{laminate.name}: tray plan")


def tray_sheets(laminate: Laminate) -> tuple[TraySheet, ...]:
    """Return the pages of one laminate; a part wider than the paper gets a wider page."""
    steps = [*_laid(laminate)]
    boxes = [region.bounds for _, parts in steps for _, region in parts]
    wide = max(box[2] - box[0] for box in boxes) + 2 * SIDE
    high = max(box[3] - box[1] for box in boxes) + LABEL + HEADING + 3 + HEAD + FOOT
    return tuple(_Flow((max(PAPER[0], wide), max(PAPER[1], high))).pages(steps))


def _laid(laminate: Laminate) -> Iterator[tuple[str, list[tuple[Layer, Region]]]]:
    """Yield the heading of each step that lays parts, and the parts in their order.

    Folded halves are one part, with the half that is laid first.
    """
    taken: set[int] = set()
    for step in laying(laminate):
        parts = []
        for index in step.adds:
            root = laminate.layer(laminate.cut_with(laminate.layer(index)))
            if root.index not in taken:
                taken.add(root.index)
                parts.append((root, laminate.as_cut(root)))
        if parts:
            yield f"Step {step.number}: {layers_in_words(step.adds)}", parts


class _Flow:
    """Parts in rows from the upper left, a new row for each step, over as many pages as needed."""

    def __init__(self, size: tuple[float, float]) -> None:
        self.size = size
        self.sheets: list[TraySheet] = []
        self._clear()

    def _clear(self) -> None:
        self.places: list[TrayPlace] = []
        self.headings: list[tuple[Point, str]] = []
        self.top = self.size[1] - HEAD

    def _turn_page(self) -> None:
        self.sheets.append(TraySheet(self.size, tuple(self.places), tuple(self.headings)))
        self._clear()

    def pages(self, steps: Sequence[tuple[str, list[tuple[Layer, Region]]]]) -> list[TraySheet]:
        for heading, parts in steps:
            words = heading
            for row in self._rows(parts):
                high = max(_height(region) for _, region in row)
                if self.places and self.top - (HEADING + 3 if words else 0) - high < FOOT:
                    self._turn_page()
                    words = words or f"{heading} (continued)"
                if words:
                    self.top -= HEADING
                    self.headings.append(((SIDE, self.top), words))
                    self.top -= 3
                    words = ""
                self._lay(row, high)
        self._turn_page()
        return self.sheets

    def _rows(self, parts: Sequence[tuple[Layer, Region]]) -> Iterator[list[tuple[Layer, Region]]]:
        row: list[tuple[Layer, Region]] = []
        x = SIDE
        for layer, region in parts:
            wide = _width(layer, region)
            if row and x + wide > self.size[0] - SIDE:
                yield row
                row, x = [], SIDE
            row.append((layer, region))
            x += wide + GAP
        yield row

    def _lay(self, row: Sequence[tuple[Layer, Region]], high: float) -> None:
        x = SIDE
        for layer, region in row:
            low_x, low_y = region.bounds[:2]
            at = x - low_x, self.top - high + LABEL - low_y
            self.places.append(TrayPlace(layer, region, at))
            x += _width(layer, region) + GAP
        self.top -= high + GAP


def _label(layer: Layer) -> str:
    return f"{layer.index} {layer.pattern}"


def _width(layer: Layer, region: Region) -> float:
    """Return the width of a place, mm: the wider of its part and its label."""
    return max(region.bounds[2] - region.bounds[0], LETTER * WORDS * len(_label(layer)))


def _height(region: Region) -> float:
    return region.bounds[3] - region.bounds[1] + LABEL


def _place_words(runs: Runs, place: int, batch: str | None) -> str:
    """Return the laminates that use a page, as text; empty for a single one."""
    if runs.copies == 1:
        return ""
    last = runs.copies + 1
    names = [serial(runs, copy, batch) for copy in range(place, last, runs.together)]
    if len(names) > MOST_NAMED:
        names = [names[0], "...", names[-1]]
    return f", place {place} ({', '.join(names)})"


def _head(page: PdfPage, title: str) -> None:
    """Title, use, and the bars that check the size of the print."""
    top = page.height - 12
    page.text((SIDE, top), title, 4.4, bold=True)
    lines = (
        f"Print at 100 %: both bars must be {BAR:g} mm, {CLOSE:g} more or less. Lay each part, "
        "upper side up, on its outline; its",
        "layer and pattern stand below it. Take the parts up in this order, from left to right, "
        "row by row.",
    )
    for number, line in enumerate(lines, 1):
        page.text((SIDE, top - 1 - 4 * number), line, 2.8)
    page.stroke(BLACK, 0.1)
    y, x = page.height - 29, page.width - 6
    page.line((SIDE, y), (SIDE + BAR, y))
    page.line((x, page.height - HEAD - BAR), (x, page.height - HEAD))
    for end in (0.0, BAR):
        page.line((SIDE + end, y - 1.5), (SIDE + end, y + 1.5))
        page.line((x - 1.5, page.height - HEAD - end), (x + 1.5, page.height - HEAD - end))
    page.text((SIDE + BAR + 2, y - 1), f"{BAR:g} mm", WORDS)


def _drawn(sheet: TraySheet) -> PdfPage:
    """Return the content common to all laminates of a cycle: the places with their labels."""
    page = PdfPage(*sheet.size)
    for at, words in sheet.headings:
        page.text(at, words, HEADING, bold=True)
    for place in sheet.places:
        is_mask = place.layer.is_mask
        page.stroke(MASK if is_mask else FILM, 0.15, (1.0, 0.6) if is_mask else ())
        for contour in place.region.moved(*place.at).contours:
            page.contour(contour)
        low_x, low_y = place.region.bounds[:2]
        page.stroke(GREY, 0.1)
        at = place.at[0] + low_x, place.at[1] + low_y - LABEL + 0.6
        page.text(at, _label(place.layer), WORDS)
    return page
