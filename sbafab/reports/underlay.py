"""underlay.pdf: a page to print at 1:1 and to lay up on, below the release film.

It shows the edges of all that no pin holds, as it lies in the stack: seen from above, the axis of
the actuator where the cross is. Ours; how much steadier it makes a hand was not measured.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from sbafab.geometry.edges import Bounds, Point
from sbafab.geometry.region import Contour, Region
from sbafab.geometry.shapes import disc
from sbafab.laminate.assembly import AssemblyStep, assembly, distinct_layers
from sbafab.laminate.laminate import Laminate, Layer
from sbafab.reports.pdf import BLACK, PdfPage, Rgb
from sbafab.reports.traveller import quantities as say
from sbafab.reports.traveller.layup import Bed, beds

NAME = "underlay.pdf"
A4 = (210.0, 297.0)
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
THIN, WORDS, TITLE, ROW = 0.1, 3.0, 5.0, 4.5
USE = (
    "Print at 100 % (“actual size”, not “fit to page”) on plain paper. Measure both bars:",
    f"if either is not {BAR:g} mm, {CLOSE:g} more or less, do not use this print.",
    "Tape it to the plate, a see-through release film over it. Lay edges on their lines.",
)
NOTES = (
    "Grey: pins, and a cross through the actuator's axis. In a step with pins prick them through.",
    "Plain paper stands the press; toner may soften and mark the release film. Not tried by us.",
)


@dataclass(frozen=True)
class Guide:
    """An outline to lay by: contours of films or masks, the patterns that have it, the steps."""

    region: Region
    is_mask: bool
    patterns: tuple[str, ...]
    steps: tuple[int, ...]

    @property
    def words(self) -> str:
        what = "PTFE, dashed" if self.is_mask else "TPE"
        return (
            f"{say.listed(self.patterns)} ({what}): outer edge, press step"
            f"{'s' if len(self.steps) > 1 else ''} {say.listed([str(n) for n in self.steps])}"
        )


def underlay_pdf(
    laminate: Laminate, design_sha256: str, places: Sequence[Point] = ((0.0, 0.0),)
) -> bytes | None:
    """The page; None for a laminate of which pins hold every part in every step.

    It shows the laminate at each of the ``places`` that it has in the press.
    """
    found = guides(laminate)
    if not found:
        return None
    own = _bounds(found)
    xs, ys = [x for x, _ in places], [y for _, y in places]
    low_x, low_y, high_x, high_y = (
        min(xs) + own[0],
        min(ys) + own[1],
        max(xs) + own[2],
        max(ys) + own[3],
    )
    foot = 20 + ROW * (len(found) + len(NOTES))
    wide, high = high_x - low_x + 2 * BEYOND, high_y - low_y + 2 * BEYOND
    page = PdfPage(max(A4[0], wide + 2 * SIDE), max(A4[1], high + HEAD + foot))
    middle = page.width / 2, foot + (page.height - HEAD - foot) / 2
    x, y = middle[0] - (low_x + high_x) / 2, middle[1] - (low_y + high_y) / 2
    for place in places:
        _laminate(page, laminate, found, (x + place[0], y + place[1]))
    _bars(page)
    _words(page, laminate, design_sha256, found, foot)
    return page.pdf(f"{laminate.name}: alignment underlay")


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
    shapes: dict[tuple[object, bool], tuple[Region, list[str], list[int]]] = {}
    parts = assembly(laminate)
    # What is laid down again as one whole stack has no edge to lie by.
    for step in (part for part in parts if part.adds):
        for bed in beds(parts, step):
            for layer in _loose(laminate, step, bed):
                outline = Region(tuple(layer.profile.outers))
                key = outline.key, layer.is_mask
                _, patterns, steps = shapes.setdefault(key, (outline, [], []))
                patterns.append(layer.pattern)
                steps.append(step.number)
    return tuple(
        Guide(region, is_mask, tuple(dict.fromkeys(patterns)), tuple(dict.fromkeys(steps)))
        for (_, is_mask), (region, patterns, steps) in shapes.items()
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


def _words(
    page: PdfPage, laminate: Laminate, sha256: str, found: tuple[Guide, ...], foot: float
) -> None:
    """Title and use above the drawing, what its lines are below."""
    top = page.height - 16
    title = f"{laminate.name}: alignment underlay, seen from above, 1:1"
    page.text((14, top), title, TITLE, bold=True)
    page.text((page.width - 60, top), f"design {sha256[:12]}", WORDS)
    for number, line in enumerate(USE, 1):
        page.text((14, top - 1 - ROW * number), line, WORDS)
    y = foot - 8
    for guide in found:
        _stroke(page, guide)
        page.line((14, y + 1), (24, y + 1))
        page.text((27, y), guide.words, WORDS)
        y -= ROW
    for line in NOTES:
        page.text((14, y), line, WORDS)
        y -= ROW
