"""underlay.pdf: pages to print at 1:1 and to lay up on, below the release film; seams.pdf: the
paths of seams on their films.

It shows the edges of every layer without pins at its place in the stack, seen from above, with the
actuator's axis at the cross. If a cycle of many laminates does not fit one page, it is spread over
several, with whole laminates on each: their dotted frames are cut out and laid edge to edge. Ours;
its effect on placement by hand was not measured.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from sbafab.cutting.fixture import whole_plate
from sbafab.cutting.seam_files import shift_words
from sbafab.geometry.contour import Contour
from sbafab.geometry.edges import Arc, Bounds, Edge, Point, box_round
from sbafab.geometry.region import Region, coord, disc, union
from sbafab.laminate.assembly import AssemblyStep, assembly, distinct_layers, laying
from sbafab.laminate.joints import Seam
from sbafab.laminate.laminate import Laminate, Layer
from sbafab.pressing.schedule import joined_words, layers_in_words
from sbafab.reports.traveller.shapes import Bed, beds

NAME = "underlay.pdf"
PAPER = (210.0, 279.4)
"""mm: as wide as A4 and as long as Letter, so that either prints it whole at 100 %."""
PLATEN = (152.4, 152.4)
"""mm: the paper's heated area."""
BAR = 100.0
"""Length of the bars that check the size of a print, mm."""
CLOSE = 0.3
"""Tolerance of a bar, mm: at 15 mm from the middle the print is then 0.05 mm off."""
SIDE, HEAD = 25.0, 52.0
"""Margins of the page: left and right, and above, mm."""
BEYOND = 8.0
"""Length of the cross beyond the outermost line, mm."""
FILM: Rgb = (0.05, 0.25, 0.55)
MASK: Rgb = (0.85, 0.4, 0.0)
GREY: Rgb = (0.55, 0.55, 0.55)
THIN, SMALL, WORDS, TITLE, ROW = 0.1, 2.2, 3.0, 5.0, 4.5
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

    ``trim`` is the frame to cut out, in the frame of the places. ``is_plate``: it is the base
    plate's own edge, with its cut corner.
    """

    size: tuple[float, float]
    places: tuple[int, ...]
    trim: Bounds
    is_plate: bool = False


@dataclass(frozen=True)
class Guide:
    """An outline to align to: contours of films or masks, its patterns, the steps."""

    region: Region
    is_mask: bool
    films: tuple[str, ...]
    patterns: tuple[str, ...]
    steps: tuple[int, ...]

    @property
    def words(self) -> str:
        materials = joined_words(self.films) + (", dashed" if self.is_mask else "")
        return (
            f"{joined_words(self.patterns)} ({materials}): outer edge, press step"
            f"{'s' if len(self.steps) > 1 else ''} {joined_words([str(n) for n in self.steps])}"
        )


def underlay_pdf(
    laminate: Laminate,
    design_sha256: str,
    places: Sequence[Point] = ((0.0, 0.0),),
    platen: tuple[float, float] = PLATEN,
) -> bytes | None:
    """The pages; None for a laminate whose parts are all held by pins in every step.

    They show the laminate at each of its ``places`` in the press, and the edge of the base plate,
    as large as the ``platen`` (mm), as a line to cut along.
    """
    outlines = guides(laminate)
    if not outlines:
        return None
    spread = leaves(laminate, places, platen)
    plate = whole_plate(laminate, platen, places).outers[0]
    pages = []
    for number, leaf in enumerate(spread, 1):
        page = PdfPage(*leaf.size)
        _draw(page, laminate, outlines, places, leaf, plate)
        _bars(page)
        which = f", page {number} of {len(spread)}" if len(spread) > 1 else ""
        _words(page, f"{laminate.name}: alignment underlay{which}, seen from above, 1:1")
        _notes(page, outlines, design_sha256, leaf)
        pages.append(page)
    return pdf(pages, f"{laminate.name}: alignment underlay")


def leaves(
    laminate: Laminate, places: Sequence[Point], platen: tuple[float, float] = PLATEN
) -> tuple[Leaf, ...]:
    """Return the places on each page, in whole rows and columns; empty without a guide.

    A laminate larger than the paper gets a page that fits it. No page reaches past the base plate,
    which is as large as the ``platen``.
    """
    outlines = guides(laminate)
    if not outlines:
        return ()
    box = _bounds(outlines)
    xs, ys = (sorted({place[axis] for place in places}) for axis in (0, 1))
    margins = 2 * SIDE, HEAD + _foot(outlines)
    room = [PAPER[axis] - margins[axis] - 2 * BEYOND for axis in (0, 1)]
    columns = _runs(xs, box[2] - box[0], room[0])
    rows = _runs(ys, box[3] - box[1], room[1])
    plate = whole_plate(laminate, platen, places).bounds
    has_room = all(plate[axis + 2] - plate[axis] <= PAPER[axis] - margins[axis] for axis in (0, 1))
    spread = []
    for row in rows:
        for column in columns:
            numbers = tuple(n for n, (x, y) in enumerate(places, 1) if x in column and y in row)
            if not numbers:
                continue
            wide = max(column) - min(column) + box[2] - box[0] + 2 * BEYOND
            high = max(row) - min(row) + box[3] - box[1] + 2 * BEYOND
            size = max(PAPER[0], wide + margins[0]), max(PAPER[1], high + margins[1])
            if len(rows) * len(columns) == 1 and has_room:
                spread.append(Leaf(size, numbers, plate, is_plate=True))
            else:
                spans = _between(xs, column, box, plate, 0), _between(ys, row, box, plate, 1)
                (x0, x1), (y0, y1) = spans
                spread.append(Leaf(size, numbers, (x0, y0, x1, y1)))
    return tuple(spread)


def _runs(steps: Sequence[float], size: float, room: float) -> list[list[float]]:
    """Rows or columns per page, as even as possible, at least one on each."""
    pitch = steps[1] - steps[0] if len(steps) > 1 else 0.0
    most = max(1, int((room - size) / pitch + 1 + 1e-9)) if pitch else 1
    pages = -(-len(steps) // most)
    each = -(-len(steps) // pages)
    return [list(steps[first : first + each]) for first in range(0, len(steps), each)]


def _between(
    steps: Sequence[float], here: Sequence[float], box: Bounds, plate: Bounds, axis: int
) -> tuple[float, float]:
    """From midway to the previous page to midway to the next; at an end up to the cross, or the
    plate.
    """
    low, high = box[axis], box[axis + 2]
    pitch = steps[1] - steps[0] if len(steps) > 1 else 0.0
    half = (pitch - (high - low)) / 2
    ends = min(here) + low, max(here) + high
    first = ends[0] - (half if min(here) > steps[0] else _beyond(ends[0] - plate[axis]))
    last = ends[1] + (half if max(here) < steps[-1] else _beyond(plate[axis + 2] - ends[1]))
    return first, last


def _beyond(free: float) -> float:
    """Return the margin of paper beyond the drawing, where that much of the plate is free."""
    return min(BEYOND, max(free, 0.0))


def _foot(outlines: Sequence[Guide]) -> float:
    """Room for the legend below the drawing, mm."""
    return 24 + ROW * (len(outlines) + len(NOTES))


def _draw(
    page: PdfPage,
    laminate: Laminate,
    outlines: tuple[Guide, ...],
    places: Sequence[Point],
    leaf: Leaf,
    plate: Contour,
) -> None:
    """The laminates of a page, numbered if there are several, with its trim frame in the middle."""
    box = _bounds(outlines)
    foot = _foot(outlines)
    x0, low, right, top = leaf.trim
    x = page.width / 2 - (x0 + right) / 2
    y = foot + (page.height - HEAD - foot) / 2 - (low + top) / 2
    for number in leaf.places:
        place = places[number - 1]
        at = x + place[0], y + place[1]
        _laminate(page, laminate, outlines, at)
        if len(places) > 1:
            page.text((at[0] + box[0], at[1] + box[1] - 2.3), f"{number}", SMALL)
    page.stroke(BLACK, THIN, (0.2, 0.8))
    if leaf.is_plate:
        (frame,) = _moved(Region((plate,)), (x, y))
        page.contour(frame)
        return
    ring = [(x0, low), (right, low), (right, top), (x0, top), (x0, low)]
    for start, end in zip(ring, ring[1:], strict=False):
        page.line((start[0] + x, start[1] + y), (end[0] + x, end[1] + y))


def _laminate(page: PdfPage, laminate: Laminate, outlines: tuple[Guide, ...], shift: Point) -> None:
    """The cross, the pins and the lines of one laminate."""
    _cross(page, _bounds(outlines), shift)
    for pin in laminate.pins:
        page.stroke(GREY, THIN)
        for contour in disc(pin.centre, pin.diameter / 2).moved(*shift).contours:
            page.contour(contour)
    for guide in outlines:
        _stroke(page, guide)
        for contour in _moved(guide.region, shift):
            page.contour(contour)


def guides(laminate: Laminate) -> tuple[Guide, ...]:
    """Return everything laid by hand in any step, equal outlines once, in order of steps."""
    shapes: dict[tuple[object, bool], tuple[Region, list[Layer], list[int]]] = {}
    parts = assembly(laminate)
    # A whole stack that is laid down again has no edge to align to.
    for step in (part for part in parts if part.adds):
        for bed in beds(parts, step):
            for layer in _loose(laminate, step, bed):
                outline = Region(tuple(layer.profile.outers))
                key = outline.key, layer.is_mask
                _, laid, steps = shapes.setdefault(key, (outline, [], []))
                laid.append(layer)
                steps.append(step.number)
    return tuple(
        Guide(
            region,
            is_mask,
            tuple(dict.fromkeys(layer.film.material for layer in laid)),
            tuple(dict.fromkeys(layer.pattern for layer in laid)),
            tuple(dict.fromkeys(steps)),
        )
        for (_, is_mask), (region, laid, steps) in shapes.items()
    )


def _loose(laminate: Laminate, step: AssemblyStep, bed: Bed) -> Iterator[Layer]:
    """The layers with visible edges where a part without a pin lies in the step."""
    layers = distinct_layers(laminate, bed.layers)
    pinned = [layer for layer in layers if set(step.pins) & set(laminate.pins_holding(layer))]
    if bed.made_in is None:
        yield from (layer for layer in layers if layer not in pinned)
    elif not pinned:
        yield max(layers, key=lambda layer: sum(contour.area for contour in layer.profile.outers))


def _bounds(outlines: tuple[Guide, ...]) -> Bounds:
    boxes = [guide.region.bounds for guide in outlines]
    lows, highs = [box[:2] for box in boxes], [box[2:] for box in boxes]
    return (
        min(x for x, _ in lows),
        min(y for _, y in lows),
        max(x for x, _ in highs),
        max(y for _, y in highs),
    )


def _moved(region: Region, shift: Point) -> tuple[Contour, ...]:
    return tuple(region.moved(*shift).contours)


def _stroke(page: PdfPage, guide: Guide) -> None:
    page.stroke(MASK if guide.is_mask else FILM, THIN, (1.0, 0.6) if guide.is_mask else ())


def _cross(page: PdfPage, bounds: Bounds, shift: Point) -> None:
    """Lines through the axis, extending past the page's content."""
    low_x, low_y, high_x, high_y = bounds
    x, y = shift
    page.stroke(GREY, THIN)
    page.line((low_x - BEYOND + x, y), (high_x + BEYOND + x, y))
    page.line((x, low_y - BEYOND + y), (x, high_y + BEYOND + y))


def _bars(page: PdfPage) -> None:
    """One bar along each direction of the page."""
    page.stroke(BLACK, THIN)
    y, x = page.height - HEAD + 8, 14.0
    x0, low = (page.width - BAR) / 2, page.height - HEAD - BAR
    page.line((x0, y), (x0 + BAR, y))
    page.line((x, low), (x, low + BAR))
    for end in (0.0, BAR):
        page.line((x0 + end, y - 2), (x0 + end, y + 2))
        page.line((x - 2, low + end), (x + 2, low + end))
    page.text((x0 + BAR / 2 - 8, y + 1.5), f"{BAR:g} mm", WORDS)
    page.text((x - 4, low - 6), f"{BAR:g} mm", WORDS)


def _words(page: PdfPage, title: str) -> None:
    """Title and use, above the drawing."""
    top = page.height - 16
    page.text((14, top), title, TITLE, bold=True)
    for number, line in enumerate(USE, 1):
        page.text((14, top - 1 - ROW * number), line, WORDS)


def _notes(page: PdfPage, outlines: tuple[Guide, ...], sha256: str, leaf: Leaf) -> None:
    """Write the meaning of the lines below the drawing."""
    y = _foot(outlines) - 8
    for guide in outlines:
        _stroke(page, guide)
        page.line((14, y + 1), (24, y + 1))
        page.text((27, y), guide.words, WORDS)
        y -= ROW
    join = () if leaf.is_plate else (TRIM,)
    for line in (*join, *NOTES):
        page.text((14, y), line, WORDS)
        y -= ROW
    page.text((page.width - 46, y + ROW), f"design {sha256[:12]}", WORDS)


# Paths of seams on their films.


SEAMS = "seams.pdf"
START = 0.8
"""Radius of the circle at the start of a path, mm."""
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
    Paths are at the seams, also for tools with ``offsets``, which a line of text says.
    """
    steps: dict[tuple[int, ...], list[tuple[int, Seam]]] = {}
    for step in laying(laminate):
        if step.joining is not None and step.joining.seam is not None:
            steps.setdefault(step.layers, []).append((step.number, step.joining.seam))
    offsets = offsets or {}
    pages = [
        _seam_page(laminate, layers, seams, design_sha256, offsets)
        for layers, seams in steps.items()
    ]
    return pdf(pages, f"{laminate.name}: paths of seams") if pages else None


def _seam_page(
    laminate: Laminate,
    layers: Sequence[int],
    seams: Sequence[tuple[int, Seam]],
    sha256: str,
    offsets: Mapping[str, Point],
) -> PdfPage:
    shifted = [tool for tool in dict.fromkeys(seam.tool for _, seam in seams) if tool in offsets]
    films = union([laminate.layer(index).profile for index in layers])
    low_x, low_y, high_x, high_y = box_round(
        [films.bounds, *(seam.region.bounds for _, seam in seams)]
    )
    foot = 24 + ROW * (len(seams) + len(shifted) + 2)
    width = max(PAPER[0], high_x - low_x + 2 * SIDE)
    height = max(PAPER[1], high_y - low_y + HEAD + foot)
    page = PdfPage(width, height)
    x = (width - low_x - high_x) / 2
    y = foot + (height - HEAD - foot - low_y - high_y) / 2
    page.stroke(FILM, THIN)
    for contour in films.moved(x, y).contours:
        page.contour(contour)
    for step, seam in seams:
        page.stroke(MASK, THIN, (1.0, 0.6))
        for contour in seam.region.moved(x, y).contours:
            page.contour(contour)
        page.stroke(BLACK, THIN)
        for chain in seam.path:
            page.chain(chain, (x, y))
        start = seam.path[0][0].start
        dot = start[0] + x, start[1] + y
        for contour in disc(dot, START).contours:
            page.contour(contour)
        page.text((dot[0] + 1.5, dot[1] + 1.0), f"{step}", SMALL)
    _bars(page)
    top = page.height - 16
    page.text((14, top), f"{laminate.name}: paths of seams, from above, 1:1", TITLE, bold=True)
    for number, line in enumerate(SEAM_USE, 1):
        page.text((14, top - 1 - ROW * number), line, WORDS)
    y = foot - 8
    for step, seam in seams:
        words = f"step {step}: seam {seam.name}, {seam.tool}, {seam.width:g} mm wide, layers "
        page.text((14, y), f"{words}{seam.below} and {seam.above}; begins at its circle", WORDS)
        y -= ROW
    for tool in shifted:
        page.text((14, y), f"As made: the {shift_words(tool, offsets[tool])}.", WORDS)
        y -= ROW
    lines = f"Blue: edges of {layers_in_words(layers)}. Black: the middle of the tool. Dashed: its"
    page.text((14, y), f"{lines} width.", WORDS)
    page.text((page.width - 46, y - ROW), f"design {sha256[:12]}", WORDS)
    return page


# Pages of lines, curves and words as PDF, in millimetres and to scale.
#
# PDF 1.4 without compression, dates or embedded fonts: the same pages give the same bytes with
# every version of every library. Arcs become Bezier curves, within 5e-6 of their radius.


POINTS = 72 / 25.4
"""PDF points per mm."""
MOST_SWEEP = math.pi / 4
ENCODING = "cp1252"
"""Encoding of the fonts that every reader has."""
Rgb = tuple[float, float, float]
BLACK: Rgb = (0.0, 0.0, 0.0)


class PdfPage:
    """A page, its lower left corner at (0, 0); later elements cover earlier ones.

    The content of the page ``under``, which several pages may share, lies below.
    """

    def __init__(self, width: float, height: float, under: PdfPage | None = None) -> None:
        self.width, self.height, self.under = width, height, under
        self._drawn: list[str] = [f"{POINTS:.10f} 0 0 {POINTS:.10f} 0 0 cm 1 J 1 j"]

    def stroke(self, colour: Rgb, width: float, dashes: Iterable[float] = ()) -> None:
        """Set colour, width and dashes (mm) of the following lines."""
        shades = " ".join(map(coord, colour))
        on = " ".join(map(coord, dashes))
        self._drawn.append(f"{shades} RG {coord(width)} w [{on}] 0 d")

    def contour(self, contour: Contour) -> None:
        """A closed line of straight edges and arcs."""
        path = [f"{_at(contour.edges[0].start)} m", *map(_drawn, contour.edges), "h S"]
        self._drawn.append(" ".join(path))

    def chain(self, edges: Sequence[Edge], by: Point) -> None:
        """An open line of straight edges and arcs, shifted by an offset in mm."""
        x, y = coord(by[0]), coord(by[1])
        path = [f"{_at(edges[0].start)} m", *map(_drawn, edges), "S"]
        self._drawn.append(f"q 1 0 0 1 {x} {y} cm {' '.join(path)} Q")

    def line(self, start: Point, end: Point) -> None:
        self._drawn.append(f"{_at(start)} m {_at(end)} l S")

    def text(self, at: Point, words: str, size: float, bold: bool = False) -> None:
        """Words that begin at a point, ``size`` mm; characters outside Windows-1252 become "?"."""
        font = "F2" if bold else "F1"
        self._drawn.append(f"BT /{font} {coord(size)} Tf {_at(at)} Td {_string(words)} Tj ET")

    def objects(self, number: int, under: int | None = None) -> tuple[bytes, bytes]:
        """The page and its content as PDF objects; ``number`` is the content's, ``under`` the
        underlay's.
        """
        box = f"[0 0 {self.width * POINTS:.4f} {self.height * POINTS:.4f}]"
        contents = f"{number} 0 R" if under is None else f"[{under} 0 R {number} 0 R]"
        return (
            f"<< /Type /Page /Parent 2 0 R /MediaBox {box} /Contents {contents} /Resources "
            "<< /Font << /F1 3 0 R /F2 4 0 R >> >> >>".encode(),
            _stream(self._drawn),
        )

    def beneath(self) -> bytes:
        """The page's content, as an object that leaves the scale of the page unchanged."""
        return _stream(["q", *self._drawn, "Q"])


def pdf(pages: Sequence[PdfPage], title: str) -> bytes:
    """The whole file, set to print at actual size."""
    font = "<< /Type /Font /Subtype /Type1 /BaseFont /%s /Encoding /WinAnsiEncoding >>"
    unders = list(dict.fromkeys(page.under for page in pages if page.under is not None))
    numbers = {under: 5 + 2 * len(pages) + n for n, under in enumerate(unders)}
    drawn = [
        page.objects(6 + 2 * place, None if page.under is None else numbers[page.under])
        for place, page in enumerate(pages)
    ]
    kids = " ".join(f"{5 + 2 * place} 0 R" for place in range(len(pages)))
    return _file(
        [
            b"<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>",
            f"<< /Type /Pages /Kids [{kids}] /Count {len(pages)} >>".encode(),
            (font % "Helvetica").encode(),
            (font % "Helvetica-Bold").encode(),
            *(part for pair in drawn for part in pair),
            *(under.beneath() for under in unders),
            f"<< /Title {_string(title)} >>".encode(ENCODING, "replace"),
        ]
    )


def _stream(drawn: Sequence[str]) -> bytes:
    content = "\n".join(drawn).encode(ENCODING, "replace")
    return b"<< /Length %d >>\nstream\n%s\nendstream" % (len(content), content)


def _file(objects: Iterable[bytes]) -> bytes:
    """Numbered objects with the table of their offsets; the last one is the file's title."""
    data = bytearray(b"%PDF-1.4\n%\xe2\xe3\xcf\xd3\n")
    places = []
    for index, body in enumerate(objects, 1):
        places.append(len(data))
        data += b"%d 0 obj\n%s\nendobj\n" % (index, body)
    start, count = len(data), len(places) + 1
    data += b"xref\n0 %d\n0000000000 65535 f \n" % count
    data += b"".join(b"%010d 00000 n \n" % place for place in places)
    data += b"trailer\n<< /Size %d /Root 1 0 R /Info %d 0 R >>\n" % (count, count - 1)
    data += b"startxref\n%d\n%%%%EOF\n" % start
    return bytes(data)


def _string(words: str) -> str:
    for mark in "\\()":
        words = words.replace(mark, f"\\{mark}")
    return f"({words})"


def _at(p: Point) -> str:
    return f"{coord(p[0])} {coord(p[1])}"


def _drawn(edge: Edge) -> str:
    if not isinstance(edge, Arc):
        return f"{_at(edge.end)} l"
    parts = max(1, math.ceil(abs(edge.sweep) / MOST_SWEEP - 1e-9))
    step = edge.sweep / parts
    # Handles of this length put the curve's middle on the arc.
    handle = 4 / 3 * math.tan(step / 4) * edge.radius
    curves = []
    for part in range(parts):
        first, last = (edge.start_angle + step * n for n in (part, part + 1))
        (x0, y0), (x1, y1) = (_round(edge, angle) for angle in (first, last))
        leave = x0 - handle * math.sin(first), y0 + handle * math.cos(first)
        arrive = x1 + handle * math.sin(last), y1 - handle * math.cos(last)
        curves.append(f"{_at(leave)} {_at(arrive)} {_at((x1, y1))} c")
    return " ".join(curves)


def _round(edge: Arc, angle: float) -> Point:
    return (
        edge.centre[0] + edge.radius * math.cos(angle),
        edge.centre[1] + edge.radius * math.sin(angle),
    )
