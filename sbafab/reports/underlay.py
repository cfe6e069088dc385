"""underlay.pdf: pages to print at 1:1 and to lay up on, below the release film.

It shows the edges of all that no pin holds, as it lies in the stack: seen from above, the axis of
the actuator where the cross is. A cycle of many laminates that one page does not hold is spread
over several, whole laminates on each: their dotted frames are cut out and laid edge to edge. Ours;
how much steadier it makes a hand was not measured.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from sbafab.cutting.fixture import whole_plate
from sbafab.geometry.edges import Bounds, Point
from sbafab.geometry.region import Contour, Region
from sbafab.geometry.shapes import disc
from sbafab.laminate.assembly import AssemblyStep, assembly, distinct_layers
from sbafab.laminate.laminate import Laminate, Layer
from sbafab.pressing.words import listed
from sbafab.reports.pdf import BLACK, PdfPage, Rgb, pdf
from sbafab.reports.traveller.layup import Bed, beds

NAME = "underlay.pdf"
PAPER = (210.0, 279.4)
"""mm: as wide as A4 and as long as Letter, so that either prints it whole at 100 %."""
PLATEN = (152.4, 152.4)
"""mm: the paper's heated area."""
BAR = 100.0
"""mm of the bars that show whether a print has the right size."""
CLOSE = 0.3
"""mm by which a bar may be off: at 15 mm from the middle the print is then 0.05 mm off."""
SIDE, HEAD = 25.0, 52.0
"""mm of the page that stay free of the drawing: left and right, and above."""
BEYOND = 8.0
"""mm by which the cross reaches past the outermost line."""
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
    """One page: its size in mm, and which places of a cycle lie on it, counted from 1.

    ``trim`` is the frame to cut out, in the frame of the places. ``is_plate``: it is the base
    plate's own edge, with its cut corner.
    """

    size: tuple[float, float]
    places: tuple[int, ...]
    trim: Bounds
    is_plate: bool = False


@dataclass(frozen=True)
class Guide:
    """An outline to lay by: contours of films or masks, the patterns that have it, the steps."""

    region: Region
    is_mask: bool
    films: tuple[str, ...]
    patterns: tuple[str, ...]
    steps: tuple[int, ...]

    @property
    def words(self) -> str:
        what = listed(self.films) + (", dashed" if self.is_mask else "")
        return (
            f"{listed(self.patterns)} ({what}): outer edge, press step"
            f"{'s' if len(self.steps) > 1 else ''} {listed([str(n) for n in self.steps])}"
        )


def underlay_pdf(
    laminate: Laminate,
    design_sha256: str,
    places: Sequence[Point] = ((0.0, 0.0),),
    platen: tuple[float, float] = PLATEN,
) -> bytes | None:
    """The pages; None for a laminate of which pins hold every part in every step.

    They show the laminate at each of the ``places`` that it has in the press, and the edge of the
    base plate, as large as the ``platen`` (mm), to be cut out along.
    """
    found = guides(laminate)
    if not found:
        return None
    spread = leaves(laminate, places, platen)
    plate = whole_plate(laminate, platen, places).outers[0]
    pages = []
    for number, leaf in enumerate(spread, 1):
        page = PdfPage(*leaf.size)
        _draw(page, laminate, found, places, leaf, plate)
        _bars(page)
        which = f", page {number} of {len(spread)}" if len(spread) > 1 else ""
        _words(page, f"{laminate.name}: alignment underlay{which}, seen from above, 1:1")
        _notes(page, found, design_sha256, leaf)
        pages.append(page)
    return pdf(pages, f"{laminate.name}: alignment underlay")


def leaves(
    laminate: Laminate, places: Sequence[Point], platen: tuple[float, float] = PLATEN
) -> tuple[Leaf, ...]:
    """Which places lie on which page, whole rows and columns of them; none without a guide.

    A laminate that is itself larger than the paper gets a page as large as it takes. No page
    reaches past the base plate, which is as large as the ``platen``.
    """
    found = guides(laminate)
    if not found:
        return ()
    own = _bounds(found)
    xs, ys = (sorted({place[axis] for place in places}) for axis in (0, 1))
    margins = 2 * SIDE, HEAD + _foot(found)
    room = [PAPER[axis] - margins[axis] - 2 * BEYOND for axis in (0, 1)]
    columns = _runs(xs, own[2] - own[0], room[0])
    rows = _runs(ys, own[3] - own[1], room[1])
    plate = whole_plate(laminate, platen, places).bounds
    has_room = all(plate[axis + 2] - plate[axis] <= PAPER[axis] - margins[axis] for axis in (0, 1))
    spread = []
    for row in rows:
        for column in columns:
            numbers = tuple(n for n, (x, y) in enumerate(places, 1) if x in column and y in row)
            if not numbers:
                continue
            wide = max(column) - min(column) + own[2] - own[0] + 2 * BEYOND
            high = max(row) - min(row) + own[3] - own[1] + 2 * BEYOND
            size = max(PAPER[0], wide + margins[0]), max(PAPER[1], high + margins[1])
            if len(rows) * len(columns) == 1 and has_room:
                spread.append(Leaf(size, numbers, plate, is_plate=True))
            else:
                spans = _between(xs, column, own, plate, 0), _between(ys, row, own, plate, 1)
                (x0, x1), (y0, y1) = spans
                spread.append(Leaf(size, numbers, (x0, y0, x1, y1)))
    return tuple(spread)


def _runs(steps: Sequence[float], own: float, room: float) -> list[list[float]]:
    """Rows or columns page by page, as evenly as may be, at least one on each."""
    pitch = steps[1] - steps[0] if len(steps) > 1 else 0.0
    most = max(1, int((room - own) / pitch + 1 + 1e-9)) if pitch else 1
    pages = -(-len(steps) // most)
    each = -(-len(steps) // pages)
    return [list(steps[first : first + each]) for first in range(0, len(steps), each)]


def _between(
    steps: Sequence[float], here: Sequence[float], own: Bounds, plate: Bounds, axis: int
) -> tuple[float, float]:
    """From half-way to the page before to half-way to the next; at an end as far as the cross, or
    the plate.
    """
    low, high = own[axis], own[axis + 2]
    pitch = steps[1] - steps[0] if len(steps) > 1 else 0.0
    half = (pitch - (high - low)) / 2
    ends = min(here) + low, max(here) + high
    first = ends[0] - (half if min(here) > steps[0] else _beyond(ends[0] - plate[axis]))
    last = ends[1] + (half if max(here) < steps[-1] else _beyond(plate[axis + 2] - ends[1]))
    return first, last


def _beyond(free: float) -> float:
    """How far paper reaches past what is drawn on it, with so much of the plate free there."""
    return min(BEYOND, max(free, 0.0))


def _foot(found: Sequence[Guide]) -> float:
    """Room below the drawing for what its lines are, mm."""
    return 24 + ROW * (len(found) + len(NOTES))


def _draw(
    page: PdfPage,
    laminate: Laminate,
    found: tuple[Guide, ...],
    places: Sequence[Point],
    leaf: Leaf,
    plate: Contour,
) -> None:
    """The laminates of a page, numbered where there are several, its trim frame in its middle."""
    own = _bounds(found)
    foot = _foot(found)
    left, low, right, top = leaf.trim
    x = page.width / 2 - (left + right) / 2
    y = foot + (page.height - HEAD - foot) / 2 - (low + top) / 2
    for number in leaf.places:
        place = places[number - 1]
        at = x + place[0], y + place[1]
        _laminate(page, laminate, found, at)
        if len(places) > 1:
            page.text((at[0] + own[0], at[1] + own[1] - 2.3), f"{number}", SMALL)
    page.stroke(BLACK, THIN, (0.2, 0.8))
    if leaf.is_plate:
        (frame,) = _moved(Region((plate,)), (x, y))
        page.contour(frame)
        return
    ring = [(left, low), (right, low), (right, top), (left, top), (left, low)]
    for start, end in zip(ring, ring[1:], strict=False):
        page.line((start[0] + x, start[1] + y), (end[0] + x, end[1] + y))


def _laminate(page: PdfPage, laminate: Laminate, found: tuple[Guide, ...], shift: Point) -> None:
    """The cross, the pins and the lines of one laminate."""
    _cross(page, _bounds(found), shift)
    for pin in laminate.pins:
        page.stroke(GREY, THIN)
        for contour in disc(pin.centre, pin.diameter / 2).moved(*shift).contours:
            page.contour(contour)
    for guide in found:
        _stroke(page, guide)
        for contour in _moved(guide.region, shift):
            page.contour(contour)


def guides(laminate: Laminate) -> tuple[Guide, ...]:
    """What is laid by hand in any step, equal outlines once, in the order of the steps."""
    shapes: dict[tuple[object, bool], tuple[Region, list[Layer], list[int]]] = {}
    parts = assembly(laminate)
    # What is laid down again as one whole stack has no edge to lie by.
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
    """The layers whose edges show where a bed lies that no pin of the step holds."""
    layers = distinct_layers(laminate, bed.layers)
    held = [layer for layer in layers if set(step.pins) & set(laminate.pins_holding(layer))]
    if bed.made_in is None:
        yield from (layer for layer in layers if layer not in held)
    elif not held:
        yield max(layers, key=lambda layer: sum(contour.area for contour in layer.profile.outers))


def _bounds(found: tuple[Guide, ...]) -> Bounds:
    boxes = [guide.region.bounds for guide in found]
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
    """Lines through the axis, seen past all that lies on the page."""
    low_x, low_y, high_x, high_y = bounds
    x, y = shift
    page.stroke(GREY, THIN)
    page.line((low_x - BEYOND + x, y), (high_x + BEYOND + x, y))
    page.line((x, low_y - BEYOND + y), (x, high_y + BEYOND + y))


def _bars(page: PdfPage) -> None:
    """A bar along each way of the page."""
    page.stroke(BLACK, THIN)
    y, x = page.height - HEAD + 8, 14.0
    left, low = (page.width - BAR) / 2, page.height - HEAD - BAR
    page.line((left, y), (left + BAR, y))
    page.line((x, low), (x, low + BAR))
    for end in (0.0, BAR):
        page.line((left + end, y - 2), (left + end, y + 2))
        page.line((x - 2, low + end), (x + 2, low + end))
    page.text((left + BAR / 2 - 8, y + 1.5), f"{BAR:g} mm", WORDS)
    page.text((x - 4, low - 6), f"{BAR:g} mm", WORDS)


def _words(page: PdfPage, title: str) -> None:
    """Title and use, above the drawing."""
    top = page.height - 16
    page.text((14, top), title, TITLE, bold=True)
    for number, line in enumerate(USE, 1):
        page.text((14, top - 1 - ROW * number), line, WORDS)


def _notes(page: PdfPage, found: tuple[Guide, ...], sha256: str, leaf: Leaf) -> None:
    """What the lines are, below the drawing."""
    y = _foot(found) - 8
    for guide in found:
        _stroke(page, guide)
        page.line((14, y + 1), (24, y + 1))
        page.text((27, y), guide.words, WORDS)
        y -= ROW
    join = () if leaf.is_plate else (TRIM,)
    for line in (*join, *NOTES):
        page.text((14, y), line, WORDS)
        y -= ROW
    page.text((page.width - 46, y + ROW), f"design {sha256[:12]}", WORDS)
