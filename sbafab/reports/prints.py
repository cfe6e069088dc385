"""Pages to print at 1:1.

underlay.pdf lies below the release film for the lay-up; seams.pdf has the paths of seams on their
films; tray.pdf has a place for every part in lay-up order.

The underlay shows the edges of every layer without pins at its position in the stack, seen from
above, with the actuator's axis at the cross. If a cycle of many laminates does not fit one page, it
is spread over several, with whole laminates on each: their dotted frames are cut out and laid edge
to edge. On the tray plan, whose pages serve all cycles, parts lie on their outlines, upper side up,
so that a wrong or missing part is noticed. The paper has no such pages; their effect on hand
placement was not measured.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise, product
from typing import NamedTuple

from sbafab.cutting.fixture import whole_plate
from sbafab.cutting.layer_files import shift_words
from sbafab.geometry.contour import Contour
from sbafab.geometry.edges import Arc, Bounds, Edge, Point, box_round
from sbafab.geometry.region import Region, coord, disc, rectangle, union
from sbafab.laminate.joints import Seam
from sbafab.laminate.laminate import Laminate, Layer
from sbafab.laminate.lay_up import LayUpStep, distinct_layers, lay_up_steps, press_steps
from sbafab.pressing.cycles import Runs, serial
from sbafab.pressing.schedule import joined_words, layers_in_words
from sbafab.reports.traveller.lay_up import Bed, beds

# PDF 1.4 without compression, dates or embedded fonts: the same pages give the same bytes with
# every version of every library. Arcs become Bezier curves, within 5e-6 of their radius.


POINTS = 72 / 25.4  # of PDF per mm
MOST_SWEEP = math.pi / 4
ENCODING = "cp1252"  # of the fonts that every reader has; other characters become "?"
FONT = "<< /Type /Font /Subtype /Type1 /BaseFont /%s /Encoding /WinAnsiEncoding >>"


def pen(colour: tuple[float, float, float], width: float = 0.1, dashes: str = "") -> str:
    """Return the operators for colour (0 to 1), width and dashes (mm) of lines."""
    return f"{' '.join(map(coord, colour))} RG {coord(width)} w [{dashes}] 0 d"


BLACK, GREY = pen((0.0, 0.0, 0.0)), pen((0.55, 0.55, 0.55))
TRIM_LINE = pen((0.0, 0.0, 0.0), dashes="0.2 0.8")


def edge_pen(is_mask: bool, width: float = 0.1) -> str:
    """Return the pen for the edges of masks or films."""
    return pen((0.85, 0.4, 0.0), width, "1 0.6") if is_mask else pen((0.05, 0.25, 0.55), width)


class PdfPage:
    """A page in mm, its lower left corner at (0, 0); later elements cover earlier ones.

    The contents of the page ``under``, which several pages may share, are drawn first.
    """

    def __init__(self, width: float, height: float, under: PdfPage | None = None) -> None:
        self.width, self.height = width, height
        self._under = under.streams if under else []
        self._drawn = [f"q {POINTS:.10f} 0 0 {POINTS:.10f} 0 0 cm 1 J 1 j"]

    def contours(self, look: str, contours: Iterable[Contour], by: Point = (0.0, 0.0)) -> None:
        """Closed lines of straight edges and arcs, shifted by an offset in mm."""
        self.chains(look, [contour.edges for contour in contours], by, "h S")

    def chains(
        self, look: str, chains: Iterable[Sequence[Edge]], by: Point, end: str = "S"
    ) -> None:
        """Open lines of straight edges and arcs, shifted by an offset in mm."""
        paths = [
            " ".join([f"{_at(edges[0].start)} m", *map(_curve, edges), end]) for edges in chains
        ]
        self._drawn += [look, f"q 1 0 0 1 {_at(by)} cm {' '.join(paths)} Q"]

    def lines(self, look: str, *ends: tuple[Point, Point]) -> None:
        self._drawn += [look, *(f"{_at(start)} m {_at(end)} l S" for start, end in ends)]

    def centred(self, box: Bounds, foot: float) -> Point:
        """Return the offset that centres a box between the head and foot of a work page."""
        low_x, low_y, high_x, high_y = box
        x = self.width / 2 - (low_x + high_x) / 2
        return x, foot + (self.height - HEAD - foot - low_y - high_y) / 2

    def text(self, at: Point, words: str, size: float, bold: bool = False) -> None:
        """Write text that starts at a point, ``size`` mm."""
        font = "F2" if bold else "F1"
        self._drawn.append(f"BT /{font} {coord(size)} Tf {_at(at)} Td {_string(words)} Tj ET")

    @property
    def streams(self) -> list[str]:
        """The content streams, lowest first."""
        return [*self._under, "\n".join([*self._drawn, "Q"])]


def pdf(pages: Sequence[PdfPage], title: str) -> bytes:
    """Return the whole file, set to print at actual size."""
    streams = list(dict.fromkeys(stream for page in pages for stream in page.streams))
    numbers = {stream: f"{5 + len(pages) + n} 0 R" for n, stream in enumerate(streams)}
    kids = " ".join(f"{5 + n} 0 R" for n in range(len(pages)))
    objects = [
        "<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>",
        f"<< /Type /Pages /Kids [{kids}] /Count {len(pages)} >>",
        FONT % "Helvetica",
        FONT % "Helvetica-Bold",
    ]
    for page in pages:
        box = f"[0 0 {page.width * POINTS:.4f} {page.height * POINTS:.4f}]"
        contents = " ".join(numbers[stream] for stream in page.streams)
        objects.append(
            f"<< /Type /Page /Parent 2 0 R /MediaBox {box} /Contents [{contents}] /Resources "
            "<< /Font << /F1 3 0 R /F2 4 0 R >> >> >>"
        )
    objects += [f"<< /Length {len(s)} >>\nstream\n{s}\nendstream" for s in streams]
    data, places = bytearray(b"%PDF-1.4\n%\xe2\xe3\xcf\xd3\n"), ["0000000000 65535 f \n"]
    for index, body in enumerate([*objects, f"<< /Title {_string(title)} >>"], 1):
        places.append(f"{len(data):010d} 00000 n \n")
        data += f"{index} 0 obj\n{body}\nendobj\n".encode(ENCODING, "replace")
    start, count = len(data), len(places)
    data += f"xref\n0 {count}\n{''.join(places)}trailer\n".encode()
    data += f"<< /Size {count} /Root 1 0 R /Info {count - 1} 0 R >>\n".encode()
    return bytes(data + f"startxref\n{start}\n%%EOF\n".encode())


def _string(words: str) -> str:
    for mark in "\\()":
        words = words.replace(mark, f"\\{mark}")
    return f"({words})"


def _at(p: Point) -> str:
    return f"{coord(p[0])} {coord(p[1])}"


def _curve(edge: Edge) -> str:
    if not isinstance(edge, Arc):
        return f"{_at(edge.end)} l"
    parts = max(1, math.ceil(abs(edge.sweep) / MOST_SWEEP - 1e-9))
    # Handles of this length, in radii, put the curve's middle on the arc.
    handle, (x, y) = 4 / 3 * math.tan(edge.sweep / parts / 4), edge.centre
    curves = []
    for (x0, y0), (x1, y1) in pairwise(edge.at(part / parts) for part in range(parts + 1)):
        leave = x0 - handle * (y0 - y), y0 + handle * (x0 - x)
        arrive = x1 + handle * (y1 - y), y1 - handle * (x1 - x)
        curves.append(f"{_at(leave)} {_at(arrive)} {_at((x1, y1))} c")
    return " ".join(curves)


# What all pages have: a title, how to use the print, and bars that check its size.


PAPER = (210.0, 279.4)
"""mm: as wide as A4 and as long as Letter, so that either prints it whole at 100 %."""
BAR = 100.0  # length of the bars that check the size of a print, mm
CLOSE = 0.3  # tolerance of a bar, mm: at 15 mm from the middle the print is then 0.05 mm off
SIDE, HEAD = 25.0, 52.0  # margins of a page to work on: left and right, and above, mm
LEFT = 14.0
SMALL, WORDS, TITLE, ROW = 2.2, 3.0, 5.0, 4.5


def _head(page: PdfPage, at: Point, title: str, lines: Iterable[str], size: float = TITLE) -> None:
    page.text(at, title, size, bold=True)
    for number, line in enumerate(lines, 1):
        page.text((at[0], at[1] - 1 - ROW * number), line, WORDS)


def _bars(page: PdfPage, across: Point, up: Point) -> None:
    """Draw a bar along each direction of the page, from a point."""
    (x0, y), (x, y0) = across, up
    ticks = [((x0 + end, y - 2), (x0 + end, y + 2)) for end in (0.0, BAR)]
    ticks += [((x - 2, y0 + end), (x + 2, y0 + end)) for end in (0.0, BAR)]
    page.lines(BLACK, ((x0, y), (x0 + BAR, y)), ((x, y0), (x, y0 + BAR)), *ticks)


def _work_page(
    size: tuple[float, float],
    title: str,
    use: Sequence[str],
    legend: Sequence[tuple[str, str]],
    foot: float,
    sha256: str,
) -> PdfPage:
    """Return a work page: title, use and bars above, and the legend in the foot. Each legend entry
    follows a line of its pen, or starts at the margin without one.
    """
    page = PdfPage(*size)
    _head(page, (LEFT, page.height - 16), title, use)
    across, up = ((page.width - BAR) / 2, page.height - HEAD + 8), (LEFT, page.height - HEAD - BAR)
    _bars(page, across, up)
    page.text((across[0] + BAR / 2 - 8, across[1] + 1.5), f"{BAR:g} mm", WORDS)
    page.text((up[0] - 4, up[1] - 6), f"{BAR:g} mm", WORDS)
    y = foot - 8
    for look, words in legend:
        if look:
            page.lines(look, ((LEFT, y + 1), (LEFT + 10, y + 1)))
        page.text((LEFT + 13 * bool(look), y), words, WORDS)
        y -= ROW
    page.text((page.width - 46, y + ROW), f"design {sha256[:12]}", WORDS)
    return page


def _foot(rows: int) -> float:
    """Return the height of the legend below the drawing, mm."""
    return 24 + ROW * rows


# The underlay.


NAME = "underlay.pdf"
PLATEN = (152.4, 152.4)  # mm: the paper's heated area
BEYOND = 8.0  # length of the cross beyond the outermost line, mm
USE = (
    "Print at 100 % (“actual size”, not “fit to page”) on plain paper. Measure both bars:",
    f"if either is not {BAR:g} mm, {CLOSE:g} more or less, do not use this print.",
    "Cut it out along the dotted line. Lay it flush on the plate, tape two edges down, a",
    "see-through release film over it. Lay edges on their lines.",
)
NOTES = (
    "Grey: pins, and a cross through the actuator's axis. In a step with pins prick them through.",
    "A fresh print for every hot cycle: paper dries and shrinks. Toner softens in the press and",
    "may mark the release film or stick to it: print with ink if you can. Not tried by us.",
)
TRIM = (
    "Cut along the dotted frames and lay pages edge to edge on the plate: crosses go on across the "
    "cut."
)


@dataclass(frozen=True)
class Leaf:
    """One page: its size in mm, and its places of a cycle, counted from 1.

    ``trim`` is the cutting line, in the frame of the places. ``is_plate``: it is the edge of the
    base plate, with its cut corner.
    """

    size: tuple[float, float]
    places: tuple[int, ...]
    trim: Contour
    is_plate: bool = False


class Guide(NamedTuple):
    """An outline for alignment, its layers, and the steps that lay them."""

    region: Region
    layers: list[Layer]
    steps: list[int]

    @property
    def patterns(self) -> list[str]:
        return list(dict.fromkeys(layer.pattern for layer in self.layers))

    @property
    def pen(self) -> str:
        return edge_pen(self.layers[0].is_mask)

    @property
    def words(self) -> str:
        films = joined_words(list(dict.fromkeys(layer.film.material for layer in self.layers)))
        dashed = ", dashed" if self.layers[0].is_mask else ""
        many = "s" if len(self.steps) > 1 else ""
        steps = joined_words([str(number) for number in self.steps])
        patterns = joined_words(self.patterns)
        return f"{patterns} ({films}{dashed}): outer edge, press step{many} {steps}"


def underlay_pdf(
    laminate: Laminate,
    design_sha256: str,
    places: Sequence[Point] = ((0.0, 0.0),),
    platen: tuple[float, float] = PLATEN,
) -> bytes | None:
    """Return the pages; None for a laminate with pins for all parts in every step.

    They show the laminate at each of its ``places`` in the press, and the edge of the base plate,
    as large as the ``platen`` (mm), as a cutting line.
    """
    outlines = guides(laminate)
    spread = leaves(laminate, places, platen)
    pages = []
    for number, leaf in enumerate(spread, 1):
        which = f", page {number} of {len(spread)}" if len(spread) > 1 else ""
        title = f"{laminate.name}: alignment underlay{which}, seen from above, 1:1"
        notes = NOTES if leaf.is_plate else (TRIM, *NOTES)
        legend = [*((each.pen, each.words) for each in outlines), *(("", note) for note in notes)]
        page = _work_page(leaf.size, title, USE, legend, _foot_of(outlines), design_sha256)
        _draw_leaf(page, laminate, outlines, places, leaf)
        pages.append(page)
    return pdf(pages, f"{laminate.name}: alignment underlay") if pages else None


def _foot_of(outlines: Sequence[Guide]) -> float:
    return _foot(len(outlines) + len(NOTES))


def leaves(
    laminate: Laminate, places: Sequence[Point], platen: tuple[float, float] = PLATEN
) -> list[Leaf]:
    """Return the places on each page, in whole rows and columns; empty without a guide.

    A laminate larger than the paper gets a page of its size. No page extends past the base plate,
    which is as large as the ``platen``.
    """
    outlines = guides(laminate)
    if not outlines:
        return []
    box = box_round([guide.region.bounds for guide in outlines])
    edge = whole_plate(laminate, platen, places).outers[0]
    margins = 2 * SIDE, HEAD + _foot_of(outlines)
    room = PAPER[0] - margins[0], PAPER[1] - margins[1]
    columns, rows = (
        [*_tiles(sorted({place[axis] for place in places}), box, edge.bounds, room[axis], axis)]
        for axis in (0, 1)
    )
    low_x, low_y, high_x, high_y = edge.bounds
    is_plate = len(rows) * len(columns) == 1 and high_x - low_x <= room[0]
    is_plate = is_plate and high_y - low_y <= room[1]
    spread = []
    for (ys, length, low, top), (xs, width, left, right) in product(rows, columns):
        numbers = tuple(n for n, (x, y) in enumerate(places, 1) if x in xs and y in ys)
        size = max(PAPER[0], width + margins[0]), max(PAPER[1], length + margins[1])
        frame = rectangle((left, low), (right, top)).outers[0]
        if numbers:
            spread.append(Leaf(size, numbers, edge if is_plate else frame, is_plate))
    return spread


def _tiles(
    steps: Sequence[float], box: Bounds, plate: Bounds, room: float, axis: int
) -> Iterator[tuple[Sequence[float], float, float, float]]:
    """Yield rows or columns per page, as even as possible, their length, and the ends of the paper,
    mm. An end is midway to the next page; beyond the cross, if the plate has room, at an end.
    """
    low, high = box[axis], box[axis + 2]
    pitch = steps[1] - steps[0] if len(steps) > 1 else 0.0
    most = max(1, int((room - 2 * BEYOND - (high - low)) / pitch + 1 + 1e-9)) if pitch else 1
    each = -(-len(steps) // -(-len(steps) // most))
    half = (pitch - (high - low)) / 2
    for first in range(0, len(steps), each):
        here = steps[first : first + each]
        start, end = here[0] + low, here[-1] + high
        before = half if first else min(BEYOND, max(start - plate[axis], 0.0))
        is_last = here[-1] == steps[-1]
        after = min(BEYOND, max(plate[axis + 2] - end, 0.0)) if is_last else half
        yield here, end - start + 2 * BEYOND, start - before, end + after


def _draw_leaf(
    page: PdfPage,
    laminate: Laminate,
    outlines: Sequence[Guide],
    places: Sequence[Point],
    leaf: Leaf,
) -> None:
    """Draw the laminates of a page, numbered if there are several, with the trim frame in the
    middle. Each has the cross through the axis, the pins and the lines.
    """
    low_x, low_y, high_x, high_y = box_round([guide.region.bounds for guide in outlines])
    by = page.centred(leaf.trim.bounds, _foot_of(outlines))
    for number in leaf.places:
        x, y = at = by[0] + places[number - 1][0], by[1] + places[number - 1][1]
        level = (low_x - BEYOND + x, y), (high_x + BEYOND + x, y)
        page.lines(GREY, level, ((x, low_y - BEYOND + y), (x, high_y + BEYOND + y)))
        for pin in laminate.pins:
            page.contours(GREY, disc(pin.centre, pin.diameter / 2).contours, at)
        for guide in outlines:
            page.contours(guide.pen, guide.region.contours, at)
        if len(places) > 1:
            page.text((x + low_x, y + low_y - 2.3), f"{number}", SMALL)
    page.contours(TRIM_LINE, [leaf.trim], by)


def guides(laminate: Laminate) -> list[Guide]:
    """Return all parts placed by hand in any step, equal outlines once, in order of steps."""
    shapes: dict[tuple[object, bool], Guide] = {}
    parts = press_steps(laminate)
    # A whole stack that is laid down again has no edge to align to.
    for step in (part for part in parts if part.adds):
        for layer in (layer for bed in beds(parts, step) for layer in _loose(laminate, step, bed)):
            outline = Region(tuple(layer.profile.outers))
            guide = shapes.setdefault((outline.key, layer.is_mask), Guide(outline, [], []))
            guide.layers.append(layer)
            if step.number not in guide.steps:
                guide.steps.append(step.number)
    return list(shapes.values())


def _loose(laminate: Laminate, step: LayUpStep, bed: Bed) -> Iterator[Layer]:
    """Yield the layers with visible edges of a part without a pin in the step."""
    layers = distinct_layers(laminate, bed.layers)
    loose = [layer for layer in layers if not {*step.pins} & {*laminate.pins_holding(layer)}]
    if bed.made_in is None:
        yield from loose
    elif len(loose) == len(layers):
        yield max(layers, key=lambda layer: sum(contour.area for contour in layer.profile.outers))


# Paths of seams on their films.


START = 0.8  # radius of the circle at the start of a path, mm
SEAM_USE = (
    "Print at 100 % (“actual size”, not “fit to page”). Measure both bars: if either is not",
    f"{BAR:g} mm, {CLOSE:g} more or less, do not use this print. Lay the films over it, edges on",
    "blue lines, and mark the path on them, or the print over the films, and prick its corners.",
    "No paper under a hot tool. Not tried by us.",
)


def seams_pdf(
    laminate: Laminate, design_sha256: str, offsets: Mapping[str, Point] | None = None
) -> bytes | None:
    """Return pages of seam paths at 1:1, one for all seams of the same films; None without a seam.

    Paths are at the seams, even for tools with ``offsets``, which a line of text states.
    """
    steps: dict[tuple[int, ...], dict[int, Seam]] = {}
    for step in lay_up_steps(laminate):
        if step.joining is not None and step.joining.seam is not None:
            steps.setdefault(step.layers, {})[step.number] = step.joining.seam
    pages = [
        _seam_page(laminate, layers, seams, design_sha256, offsets or {})
        for layers, seams in steps.items()
    ]
    return pdf(pages, f"{laminate.name}: paths of seams") if pages else None


def _seam_page(
    laminate: Laminate,
    layers: Sequence[int],
    seams: Mapping[int, Seam],
    sha256: str,
    offsets: Mapping[str, Point],
) -> PdfPage:
    films = union([laminate.layer(index).profile for index in layers])
    box = box_round([films.bounds, *(seam.region.bounds for seam in seams.values())])
    tools = dict.fromkeys(seam.tool for seam in seams.values())
    words = [
        *(
            f"step {step}: seam {seam.name}, {seam.tool}, {seam.width:g} mm wide, layers "
            f"{seam.below} and {seam.above}; begins at its circle"
            for step, seam in seams.items()
        ),
        *(f"As made: the {shift_words(tool, offsets[tool])}." for tool in tools if tool in offsets),
        f"Blue: edges of {layers_in_words(layers)}. Black: the middle of the tool. Dashed: its "
        "width.",
        "",
    ]
    foot = _foot(len(words))
    width = max(PAPER[0], box[2] - box[0] + 2 * SIDE)
    height = max(PAPER[1], box[3] - box[1] + HEAD + foot)
    title = f"{laminate.name}: paths of seams, from above, 1:1"
    legend = [("", line) for line in words]
    page = _work_page((width, height), title, SEAM_USE, legend, foot, sha256)
    at = page.centred(box, foot)
    page.contours(edge_pen(is_mask=False), films.contours, at)
    for step, seam in seams.items():
        x, y = seam.path[0][0].start
        page.contours(edge_pen(is_mask=True), seam.region.contours, at)
        page.chains(BLACK, seam.path, at)
        page.contours(BLACK, disc((x, y), START).contours, at)
        page.text((x + at[0] + 1.5, y + at[1] + 1.0), f"{step}", SMALL)
    return page


# The tray plan: places for parts in rows, a new row for each step, over as many pages as needed.


TRAY_SIDE, TRAY_HEAD, TRAY_FOOT = 12.0, 34.0, 12.0
"""Margins of the page: left and right, above and below, mm."""
GAP, LABEL, HEADING = 2.5, 2.6, 3.4
"""mm between two places, and the sizes of labels and of a step's heading."""
BELOW = 3.6  # height of a place's label below its part, mm
LETTER = 0.58  # mean width of a label's letters, in font sizes: slightly above Helvetica's digits
MOST_NAMED = 8  # up to this many serials of a place are in its heading; else the first and the last
TRAY_USE = (
    f"Print at 100 %: both bars must be {BAR:g} mm, {CLOSE:g} more or less. Lay each part, "
    "upper side up, on its outline; its",
    "layer and pattern stand below it. Take the parts up in this order, from left to right, "
    "row by row.",
)


class TrayPart(NamedTuple):
    """A part as cut, represented by its lowest layer."""

    layer: Layer
    region: Region

    @property
    def label(self) -> str:
        return f"{self.layer.index} {self.layer.pattern}"

    @property
    def size(self) -> tuple[float, float]:
        """The width and height of its place, with its label, mm."""
        low_x, low_y, high_x, high_y = self.region.bounds
        return max(high_x - low_x, LETTER * LABEL * len(self.label)), high_y - low_y + BELOW


def tray_pdf(laminate: Laminate, runs: Runs, design_sha256: str, batch: str | None = None) -> bytes:
    """Return the pages with all places of a cycle."""
    sheets = tray_sheets(laminate)
    pages = []
    for place in range(1, runs.together + 1):
        for number, under in enumerate(sheets, 1):
            page = PdfPage(under.width, under.height, under)
            which = f", page {number} of {len(sheets)}" if len(sheets) > 1 else ""
            title = f"{laminate.name}: tray{_place_words(runs, place, batch)}{which}"
            _head(page, (TRAY_SIDE, page.height - 12), title, TRAY_USE, 4.4)
            across = TRAY_SIDE, page.height - 29
            _bars(page, across, (page.width - 6, page.height - TRAY_HEAD - BAR))
            page.text((across[0] + BAR + 2, across[1] - 1), f"{BAR:g} mm", LABEL)
            page.text((TRAY_SIDE, 6), f"design {design_sha256[:12]}", LABEL)
            pages.append(page)
    return pdf(pages, f"{laminate.name}: tray plan")


def tray_sheets(laminate: Laminate) -> list[PdfPage]:
    """Return the pages of one laminate, common to all places of a cycle; a part wider than the
    paper gets a wider page.
    """
    steps = [*_laid(laminate)]
    boxes = [part.region.bounds for _, parts in steps for part in parts]
    wide = max(box[2] - box[0] for box in boxes) + 2 * TRAY_SIDE
    high = max(box[3] - box[1] for box in boxes) + BELOW + HEADING + 3 + TRAY_HEAD + TRAY_FOOT
    size = max(PAPER[0], wide), max(PAPER[1], high)
    pages: list[PdfPage] = []
    top = 0.0
    for heading, parts in steps:
        words = heading
        for row in _in_rows(parts, size[0] - 2 * TRAY_SIDE):
            high = max(part.size[1] for part in row)
            if top - (HEADING + 3 if words else 0) - high < TRAY_FOOT:
                words = words or f"{heading} (continued)"
                pages.append(PdfPage(*size))
                top = size[1] - TRAY_HEAD
            if words:
                pages[-1].text((TRAY_SIDE, top - HEADING), words, HEADING, bold=True)
                top, words = top - HEADING - 3, ""
            _draw_row(pages[-1], row, top - high)
            top -= high + GAP
    return pages


def _draw_row(page: PdfPage, row: Sequence[TrayPart], foot: float) -> None:
    x = TRAY_SIDE
    for part in row:
        low_x, low_y = part.region.bounds[:2]
        at = x - low_x, foot + BELOW - low_y
        page.contours(edge_pen(part.layer.is_mask, 0.15), part.region.contours, at)
        page.text((x, foot + 0.6), part.label, LABEL)
        x += part.size[0] + GAP


def _laid(laminate: Laminate) -> Iterator[tuple[str, list[TrayPart]]]:
    """Yield the heading of each step that lays parts, and the parts in order.

    Folded halves are one part, listed with the half that is laid first.
    """
    taken: set[int] = set()
    for step in lay_up_steps(laminate):
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
    """Return the laminates on a page, as text; empty for a single one."""
    names = [serial(runs, copy, batch) for copy in range(place, runs.copies + 1, runs.together)]
    if len(names) > MOST_NAMED:
        names = [names[0], "...", names[-1]]
    return "" if runs.copies == 1 else f", place {place} ({', '.join(names)})"
