"""tray.pdf: pages to print at 1:1, with a place for every part in the order of laying.

Each laminate of a press cycle has its own pages, which all cycles reuse. Parts lie on their
outlines in rows, upper side up, so that a wrong or missing part is noticed. Ours; not tried.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from sbafab.geometry.edges import Point
from sbafab.geometry.region import Region
from sbafab.laminate.assembly import laying
from sbafab.laminate.laminate import Laminate, Layer
from sbafab.pressing.cycles import Runs, serial
from sbafab.pressing.schedule import layers_in_words
from sbafab.reports.underlay import BAR, CLOSE, PAPER, PdfPage, bars, head, look, pdf

SIDE, HEAD, FOOT = 12.0, 34.0, 12.0
"""Margins of the page: left and right, above and below, mm."""
GAP, LABEL, HEADING = 2.5, 2.6, 3.4
"""mm between two places, and the sizes of labels and of a step's heading."""
BELOW = 3.6
"""Height of a place's label below its part, mm."""
LETTER = 0.58
"""Mean width of a label's letters, in font sizes: slightly above Helvetica's digits."""
MOST_NAMED = 8
"""Up to this many serials of a place are in its heading; otherwise the first and the last."""
USE = (
    f"Print at 100 %: both bars must be {BAR:g} mm, {CLOSE:g} more or less. Lay each part, "
    "upper side up, on its outline; its",
    "layer and pattern stand below it. Take the parts up in this order, from left to right, "
    "row by row.",
)


class TrayPart(NamedTuple):
    """A part as it is cut, by its lowest layer."""

    layer: Layer
    region: Region

    @property
    def label(self) -> str:
        return f"{self.layer.index} {self.layer.pattern}"

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of its place, with its label, mm."""
        low_x, low_y, high_x, high_y = self.region.bounds
        return max(high_x - low_x, LETTER * LABEL * len(self.label)), high_y - low_y + BELOW


class TraySheet(NamedTuple):
    """One page of a laminate: its size in mm, and its parts and the headings of its steps, each
    with its place: where a part's frame has its origin, or where words begin.
    """

    size: tuple[float, float]
    parts: list[tuple[Point, TrayPart]]
    headings: list[tuple[Point, str]]


def tray_pdf(laminate: Laminate, runs: Runs, design_sha256: str, batch: str | None = None) -> bytes:
    """Return the pages of all places of a cycle."""
    sheets = [_drawn(sheet) for sheet in tray_sheets(laminate)]
    pages = []
    for place in range(1, runs.together + 1):
        for number, under in enumerate(sheets, 1):
            page = PdfPage(under.width, under.height, under)
            which = f", page {number} of {len(sheets)}" if len(sheets) > 1 else ""
            title = f"{laminate.name}: tray{_place_words(runs, place, batch)}{which}"
            head(page, (SIDE, page.height - 12), title, USE, 4.4)
            across = SIDE, page.height - 29
            bars(page, across, (page.width - 6, page.height - HEAD - BAR))
            page.text((across[0] + BAR + 2, across[1] - 1), f"{BAR:g} mm", LABEL)
            page.text((SIDE, 6), f"design {design_sha256[:12]}", LABEL)
            pages.append(page)
    return pdf(pages, f"{laminate.name}: tray plan")


def tray_sheets(laminate: Laminate) -> list[TraySheet]:
    """Return the pages of one laminate; a part wider than the paper gets a wider page."""
    steps = [*_laid(laminate)]
    boxes = [part.region.bounds for _, parts in steps for part in parts]
    wide = max(box[2] - box[0] for box in boxes) + 2 * SIDE
    high = max(box[3] - box[1] for box in boxes) + BELOW + HEADING + 3 + HEAD + FOOT
    size = max(PAPER[0], wide), max(PAPER[1], high)
    sheets = [TraySheet(size, [], [])]
    top = size[1] - HEAD
    for heading, parts in steps:
        words = heading
        for row in _in_rows(parts, size[0] - 2 * SIDE):
            high = max(part.size[1] for part in row)
            if sheets[-1].parts and top - (HEADING + 3 if words else 0) - high < FOOT:
                sheets.append(TraySheet(size, [], []))
                top = size[1] - HEAD
                words = words or f"{heading} (continued)"
            if words:
                sheets[-1].headings.append(((SIDE, top - HEADING), words))
                top -= HEADING + 3
                words = ""
            x = SIDE
            for part in row:
                low_x, low_y = part.region.bounds[:2]
                sheets[-1].parts.append(((x - low_x, top - high + BELOW - low_y), part))
                x += part.size[0] + GAP
            top -= high + GAP
    return sheets


def _laid(laminate: Laminate) -> Iterator[tuple[str, list[TrayPart]]]:
    """Yield the heading of each step that lays parts, and the parts in their order.

    Folded halves are one part, with the half that is laid first.
    """
    taken: set[int] = set()
    for step in laying(laminate):
        cut_with = [laminate.cut_with(laminate.layer(index)) for index in step.adds]
        roots = [laminate.layer(i) for i in dict.fromkeys(cut_with) if i not in taken]
        taken.update(cut_with)
        if roots:
            parts = [TrayPart(root, laminate.as_cut(root)) for root in roots]
            yield f"Step {step.number}: {layers_in_words(step.adds)}", parts


def _in_rows(parts: Sequence[TrayPart], width: float) -> Iterator[list[TrayPart]]:
    row: list[TrayPart] = []
    x = 0.0
    for part in parts:
        if row and x + part.size[0] > width:
            yield row
            row, x = [], 0.0
        row.append(part)
        x += part.size[0] + GAP
    yield row


def _place_words(runs: Runs, place: int, batch: str | None) -> str:
    """Return the laminates that use a page, as text; empty for a single one."""
    if runs.copies == 1:
        return ""
    last = runs.copies + 1
    names = [serial(runs, copy, batch) for copy in range(place, last, runs.together)]
    if len(names) > MOST_NAMED:
        names = [names[0], "...", names[-1]]
    return f", place {place} ({', '.join(names)})"


def _drawn(sheet: TraySheet) -> PdfPage:
    """Return the content common to all laminates of a cycle: the places with their labels."""
    page = PdfPage(*sheet.size)
    for at, words in sheet.headings:
        page.text(at, words, HEADING, bold=True)
    for at, part in sheet.parts:
        look(page, part.layer.is_mask, 0.15)
        page.contours(part.region.contours, at)
        low_x, low_y = part.region.bounds[:2]
        page.text((at[0] + low_x, at[1] + low_y - BELOW + 0.6), part.label, LABEL)
    return page
