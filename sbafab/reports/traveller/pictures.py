"""The pages' pictures: patterns, a step in plan and exploded, sheets with labelled parts.

Pictures are inline SVG in millimetres. Masks are hatched as well as coloured, so that they differ
from structural films in a grey print.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from sbafab.cutting.fixture import shown
from sbafab.cutting.placements import Placement
from sbafab.cutting.sheets import SheetFile
from sbafab.design.records import Design
from sbafab.geometry.cache import cached
from sbafab.geometry.edges import Bounds, Point
from sbafab.geometry.region import Region, coord, path_data, section
from sbafab.laminate.films import Film, Ink, ink
from sbafab.laminate.laminate import Inlet, Laminate, Layer, Pin
from sbafab.laminate.lay_up import LayUpStep, distinct_layers, stack_count
from sbafab.markup import escape, quoteattr
from sbafab.reports import drawing as draw
from sbafab.reports.drawing import layer_numbers
from sbafab.reports.traveller.lay_up import Bed, Round, inlets_in, rounds

Matrix = tuple[float, ...]
LINE = 0.22  # width of a part's outline on the page, mm
THUMB = (24.0, 12.5)
HATCH_STEP = 1.3
PLATE = "#f1f1ef"


def definitions(regions: Iterable[tuple[str, Region]]) -> str:
    """Return the outlines that pictures reference by id, in a picture of zero size."""
    paths = (
        f'<path id="{name}" d="{path_data(region)}" fill-rule="evenodd"/>'
        for name, region in regions
    )
    return (
        '<svg width="0" height="0" class="shapes" aria-hidden="true"><defs>'
        f"{''.join(paths)}</defs></svg>"
    )


def pattern_id(pattern: str, is_flat: bool = False) -> str:
    """Return the id of the outline of a pattern, or of a part cut unfolded or turned over, without
    spaces.
    """
    return f"shape-{pattern.replace(' ', '-')}{'-flat' if is_flat else ''}"


def pattern_regions(laminate: Laminate) -> Iterator[tuple[str, Region]]:
    for pattern, layers in laminate.patterns.items():
        yield pattern_id(pattern), layers[0].profile
        is_folded = any(fold.lower == layers[0].index for fold in laminate.folds)
        if is_folded or layers[0].turned:
            yield pattern_id(pattern, is_flat=True), laminate.as_cut(layers[0])


class Picture:
    """An inline SVG under construction: its elements in drawing order, and its hatches.

    ``name`` is unique on the page; ``words`` is its text alternative.
    """

    def __init__(self, name: str, width: float, height: float, words: str) -> None:
        self.name = name.replace(" ", "-")
        self.width, self.height, self.words = width, height, words
        self._elements: list[str] = []
        self._hatches: dict[tuple[float, Ink], str] = {}

    def add(self, *elements: str) -> None:
        self._elements += elements

    def part(self, shape: str, film: Film, matrix: Matrix, look: str) -> None:
        """Add a shape by its id; ``matrix`` maps its frame to the page, ``look`` is fresh, made
        (both opaque) or clear.
        """
        scale, colours = abs(matrix[0]) or abs(matrix[1]), ink(film)
        fill = "#e4e7ea" if look == "made" else colours.fill
        if film.is_mask and look != "made":
            name = f"hatch-{self.name}-{len(self._hatches) + 1}"
            fill = f"url(#{self._hatches.setdefault((scale, colours), name)})"
        opacity = ' fill-opacity="0.6"' if look == "clear" else ""
        moved = " ".join(map(coord, matrix))
        self.add(
            f'<use href="#{shape}" transform="matrix({moved})" fill="{fill}"{opacity} '
            f'stroke="{colours.line}" stroke-width="{coord(LINE / scale)}"/>'
        )

    def place(self, matrix: Matrix, *elements: str) -> None:
        """Add elements in a frame that ``matrix`` maps to the page."""
        self.add(f'<g transform="matrix({" ".join(map(coord, matrix))})">', *elements, "</g>")

    def plate(self, plate: Region, matrix: Matrix, is_used: bool = True) -> None:
        """Add the base plate; dashed if unused, since it still shows the orientation."""
        scale = matrix[0]
        dashes = "" if is_used else f"{coord(1.6 / scale)} {coord(1.2 / scale)}"
        look = draw.style(draw.GREY, 0.25 / scale, fill=PLATE if is_used else "none", dashes=dashes)
        self.place(matrix, draw.path(path_data(plate), look))

    def label(self, at: Point, words: str, size: float = draw.SMALL) -> None:
        """Add text over a drawing, with a white outline for legibility."""
        x, y = map(coord, at)
        self.add(
            f'<text x="{x}" y="{y}" font-size="{coord(size)}" text-anchor="middle" '
            f'stroke="#ffffff" stroke-width="{coord(size / 4)}" stroke-linejoin="round" '
            f'paint-order="stroke" fill="{draw.DARK}">{escape(words)}</text>'
        )

    def svg(self) -> str:
        w, h, step = coord(self.width), coord(self.height), coord(HATCH_STEP)
        # Oblique lines, equally dense on the page at every scale.
        hatches = "".join(
            f'<pattern id="{name}" patternUnits="userSpaceOnUse" width="{step}" height="{step}" '
            f'patternTransform="rotate(45) scale({coord(1 / scale)})"><rect width="{step}" '
            f'height="{step}" fill="{colours.fill}"/><rect width="0.18" height="{step}" '
            f'fill="{colours.line}" fill-opacity="0.6"/></pattern>'
            for (scale, colours), name in self._hatches.items()
        )
        return (
            f'<svg class="picture" role="img" aria-label={quoteattr(self.words)} '
            f'width="{w}mm" height="{h}mm" viewBox="0 0 {w} {h}" font-family="{draw.FONT}" '
            f'font-size="{coord(draw.TEXT)}" fill="{draw.DARK}">'
            f"<defs>{hatches}</defs>{''.join(self._elements)}</svg>"
        )


def flat(scale: float, at: Point) -> Matrix:
    """Return the matrix of a plan view: the part's origin is at ``at`` on the page, y upward."""
    return scale, 0.0, 0.0, -scale, at[0], at[1]


def thumbnail(pattern: str, is_flat: bool, film: Film, bounds: Bounds) -> str:
    """Return a small picture of a pattern as cut."""
    low_x, low_y, high_x, high_y = bounds
    scale = min((THUMB[0] - 1) / (high_x - low_x), (THUMB[1] - 1) / (high_y - low_y))
    picture = Picture(f"thumb-{pattern}", *THUMB, f"outline of pattern {pattern}")
    middle = (low_x + high_x) / 2, (low_y + high_y) / 2
    at = THUMB[0] / 2 - scale * middle[0], THUMB[1] / 2 + scale * middle[1]
    picture.part(pattern_id(pattern, is_flat), film, flat(scale, at), "fresh")
    return picture.svg()


def _shared(a: Bounds, b: Bounds) -> float:
    """Return the common area of two boxes."""
    wide, high = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
    return max(wide, 0.0) * max(high, 0.0)


# The step seen from above: plate, layers, pins in or out, inlet tabs.


WIDEST, TALLEST = 64.0, 28.0
NARROWEST = 66.0  # room for the text under the picture, mm
EDGE, HEAD, FOOT = 5.0, 5.0, 5.5
NAMES = 2.0  # height of the names of pins and chambers, mm
FREE = 6.0  # margin around a laminate without a base plate, mm
KEY = 19.0  # length of the line of pin marks under the picture, mm
AT_DATUM = 1e-3  # within this distance from the datum a pin hides it, mm
AWAY = (0.0, 2.0, 4.0, 6.5, 9.0)  # distances of a name from touching its place, mm
LED = 1.5  # from this distance on a thin line leads from the name to its place, mm
OUTSIDE = 4.0  # cost of a mm2 outside the picture, in mm2 of covering
TURNS = sorted(range(-7, 9), key=abs)  # of a name about its place, in sixteenths
PINS = {
    is_in: draw.style(draw.DARK, 0.3, fill=draw.DARK if is_in else "#ffffff")
    for is_in in (True, False)
}
"""Looks of a pin that is in, and of one that is not."""
_section = cached(section)
"""Every step of a laminate needs the same."""


class PlanName(NamedTuple):
    """A name for ``at``, a place ``clear`` mm around, preferably in the direction ``out``."""

    words: str
    at: Point
    clear: float
    out: Point


def plan(laminate: Laminate, step: LayUpStep, lying: tuple[Bed, ...], name: str) -> str:
    """Return the step in plan; earlier stacks grey, new layers in the colour of their film."""
    plate = shown(laminate)
    low_x, low_y, high_x, high_y = laminate.bounds
    if plate is None:
        low_x, low_y, high_x, high_y = low_x - FREE, low_y - FREE, high_x + FREE, high_y + FREE
    else:
        low_x, low_y, high_x, high_y = plate.bounds
    scale = min(WIDEST / (high_x - low_x), TALLEST / (high_y - low_y))
    width = max((high_x - low_x) * scale + 2 * EDGE, NARROWEST)
    height = (high_y - low_y) * scale + HEAD + FOOT
    view, is_pinned = flat(scale, (EDGE - low_x * scale, HEAD + high_y * scale)), bool(step.pins)
    state = "pins in" if is_pinned else "no pins"
    words = f"step {step.number} from above, {state}; the text beside it says the same"
    picture = Picture(name, width, height, words)
    if plate is not None:
        picture.plate(plate, view, is_pinned)
    for bed in lying:
        look = "made" if bed.made_in else "clear"
        for layer in distinct_layers(laminate, bed.layers):
            picture.part(pattern_id(layer.pattern), layer.film, view, look)
    _mark(picture, laminate, step, view)
    _datum(picture, step, view, plate is not None)
    if plate is not None:
        _captions(picture, is_pinned)
    return picture.svg()


def _at(view: Matrix, p: Point) -> Point:
    return view[4] + view[0] * p[0], view[5] - view[0] * p[1]


def _mark(picture: Picture, laminate: Laminate, step: LayUpStep, view: Matrix) -> None:
    """Add the pins and an arrow at each inlet tab, with their names."""
    inlets = inlets_in(laminate, step.layers)
    # An arrow at its tab also names the pin of a chamber.
    arrow_names = {inlet.chamber for inlet in inlets}
    names, taken = [], []
    for pin in laminate.pins:
        (x, y), radius = _at(view, pin.centre), max(pin.diameter * view[0] / 2, 0.7)
        picture.add(draw.circle((x, y), radius, PINS[pin in step.pins]))
        taken.append((x - radius, y - radius, x + radius, y + radius))
        if pin in step.pins and pin.name not in arrow_names:
            far = math.hypot(*pin.centre)
            out = (pin.centre[0] / far, -pin.centre[1] / far) if far > AT_DATUM else (0.0, -1.0)
            names.append(PlanName(pin.name, (x, y), radius + 0.6, out))
    arrows = []
    for inlet in inlets:
        (u, v), reach = inlet.direction, _reach(laminate, inlet)
        x, y = _at(view, (inlet.mouth[0] + reach * u, inlet.mouth[1] + reach * v))
        start, tip = (x + 0.8 * u, y - 0.8 * v), (x + 4.0 * u, y - 4.0 * v)
        picture.add(draw.line([start, tip], width=0.35), draw.arrow(tip, (u, -v)))
        xs, ys = (start[0], tip[0]), (start[1], tip[1])
        taken.append((min(xs) - 0.7, min(ys) - 0.7, max(xs) + 0.7, max(ys) + 0.7))
        arrows.append(PlanName(inlet.chamber, tip, 0.9, (u, -v)))
    room = 0.5, HEAD + 0.3, picture.width - 0.5, picture.height - FOOT + 1.0
    for name in [*arrows, *names]:
        middle, away, box = _free_place(name, room, taken)
        taken.append(box)
        if away >= LED:
            picture.add(draw.line([name.at, middle], width=0.12))
        picture.label((middle[0], middle[1] + 0.35 * NAMES), name.words, NAMES)


def _free_place(
    name: PlanName, room: Bounds, taken: Sequence[Bounds]
) -> tuple[Point, float, Bounds]:
    """Return centre, distance and box of the position within the room where a name covers least; of
    equal ones the nearest to its preferred position.
    """
    (x, y), half = name.at, (draw.text_width(name.words, NAMES) / 2, NAMES / 2)
    best = math.atan2(name.out[1], name.out[0])
    places = []
    for away, sixteenths in product(AWAY, TURNS):
        turn, far = best + sixteenths * math.tau / 16, name.clear + away
        u, v = x + (far + half[0]) * math.cos(turn), y + (far + half[1]) * math.sin(turn)
        places.append(((u, v), away, (u - half[0], v - half[1], u + half[0], v + half[1])))

    def cost(place: tuple[Point, float, Bounds]) -> float:
        outside = 4 * half[0] * half[1] - _shared(place[2], room)
        covered = sum(_shared(place[2], box) for box in taken)
        return round(covered + OUTSIDE * outside, 6)

    return min(places, key=cost)


def _reach(laminate: Laminate, inlet: Inlet) -> float:
    """Return the largest extension in mm of an inlet strip past its mouth."""
    shapes = (layers[0].profile for layers in laminate.patterns.values())
    spans = [span for shape in shapes for span in _section(shape, inlet.mouth, inlet.direction)]
    return max((end for _, end in spans), default=0.0)


def _datum(picture: Picture, step: LayUpStep, view: Matrix, has_plate: bool) -> None:
    """Add the cross at the actuator's axis, as in every cut file, unless there is a pin."""
    at = EDGE + KEY * has_plate, picture.height - 1.2
    pin = next((pin for pin in step.pins if math.hypot(*pin.centre) < AT_DATUM), None)
    words = "+ datum" if pin is None else f"datum: middle of pin {pin.name}"
    if pin is None:
        x, y = _at(view, (0.0, 0.0))
        picture.add(draw.line([(x - 1.6, y), (x + 1.6, y)], width=0.2))
        picture.add(draw.line([(x, y - 1.6), (x, y + 1.6)], width=0.2))
    picture.add(draw.text(at, words, size=2.2))


def _captions(picture: Picture, is_pinned: bool) -> None:
    """Add the key of the pins below the picture, and the text about the plate above it."""
    y = picture.height - 1.2
    for x, is_in, words in ((EDGE, True, "pin"), (EDGE + 7.2, False, "no pin")):
        picture.add(draw.circle((x + 0.8, y - 0.8), 0.8, PINS[is_in]))
        picture.add(draw.text((x + 2.4, y), words, size=2.2))
    words = "on the base plate, cut corner back right" if is_pinned else "no pins"
    picture.add(draw.text((EDGE, HEAD - 1.2), f"from above, {words}", size=2.2))


# The step taken apart: every layer or finished stack in its place over the plate.


WIDE = 58.0
TILT = 0.34  # foreshortening of a layer's depth, seen from the front and above
LABELS = 50.0
TALLEST_STACK = 40.0
NEAREST, FARTHEST, TWO_LINES = 4.0, 10.0, 6.0
COLUMN, BRACKET = 4.0, 13.0  # mm from the layers to their labels, and for a bracket with its count
BOLD = 1.25  # largest ratio of the width of bold letters to normal ones
PAGE = 1.1  # mm on the page between the layers of a finished stack
MOST = 20
TOP, STACK_FOOT = 5.0, 2.0
DEEP = 32.0
STANDS_OUT = 4.0  # height of a pin above the highest level, mm on the page


class Level(NamedTuple):
    """The superimposed layers of one height, and their label.

    ``made``: bonded in an earlier step; ``round``: laid repeatedly.
    """

    layers: tuple[Layer, ...]
    words: str
    detail: str
    made: bool = False
    round: Round | None = None


class _Tilted(NamedTuple):
    """The exploded view of a step: the laminate's origin is at ``middle`` and ``ground``."""

    scale: float
    middle: float
    ground: float
    gap: float
    height: float

    def matrix(self, height: float) -> Matrix:
        """Return the matrix from a layer's plan to the page, its origin at a page height."""
        return self.scale, 0.0, 0.0, -self.scale * TILT, self.middle, height


def exploded(laminate: Laminate, step: LayUpStep, lying: Sequence[Bed], name: str) -> str:
    """Return the step's layers exploded, lowest first, with numbers and patterns.

    They are drawn from the front and above, so that outlines and tabs show the orientation of each.
    """
    levels = _shortened([level for bed in lying for level in _levels(laminate, bed)])
    plate = shown(laminate) if step.pins else None
    base = () if plate is None else (Level((), "base plate", "cut corner: back right"),)
    view = _tilted(laminate.bounds if plate is None else plate.bounds, len(levels) + len(base))
    words = "; ".join(f"{level.words} {level.detail}" for level in levels)
    width = WIDE + _labels(levels, view.gap)
    picture = Picture(name, width, view.height, f"step {step.number} taken apart: {words}")
    if plate is not None:
        picture.plate(plate, view.matrix(view.ground))
    under, heights = view.ground, []
    for place, level in enumerate((*base, *levels)):
        here = view.ground - view.gap * place
        heights.append(here)
        if level.layers:
            picture.add(*_pin_stretches(step.pins, view, under, here))
        for lift, layer in enumerate(level.layers):
            matrix = view.matrix(here - PAGE * lift)
            look = "made" if level.made else "fresh"
            picture.part(pattern_id(layer.pattern), layer.film, matrix, look)
        shapes = [layer.profile for layer in level.layers] or [plate] * (plate is not None)
        reach = max(shape.bounds[2] for shape in shapes if shape is not None)
        _name_level(picture, level, (view.middle + reach * view.scale, here), view.gap)
        under = here - PAGE * max(len(level.layers) - 1, 0)
    picture.add(*_pin_stretches(step.pins, view, under, under - STANDS_OUT))
    picture.add(*_brackets(levels, heights[len(base) :], width - BRACKET))
    return picture.svg()


def _tilted(bounds: Bounds, levels: int) -> _Tilted:
    low_x, low_y, high_x, high_y = bounds
    scale = min(WIDE / (high_x - low_x), DEEP / ((high_y - low_y) * TILT))
    depth, between = (high_y - low_y) * scale * TILT, max(levels - 1, 1)
    gap = min(max((TALLEST_STACK - depth) / between, NEAREST), FARTHEST)
    height = TOP + depth + gap * between + STACK_FOOT
    middle = WIDE / 2 - (low_x + high_x) / 2 * scale
    return _Tilted(scale, middle, height - STACK_FOOT + low_y * scale * TILT, gap, height)


def _levels(laminate: Laminate, bed: Bed) -> Iterator[Level]:
    if bed.made_in is not None:
        words = f"layers {layer_numbers(bed.layers)}"
        count = stack_count(laminate, bed.layers)
        detail = f"the {'stack' if count == 1 else f'{count} stacks'} from step {bed.made_in}"
        yield Level(distinct_layers(laminate, bed.layers)[:4], words, detail, True)
        return
    for turn in rounds([laminate.layer(index) for index in bed.layers]):
        for place in turn.places:
            first = place[0]
            numbers = layer_numbers([layer.index for layer in place])
            detail = f"{first.film.material} {first.role.replace('-', ' ')} {first.pattern}"
            yield Level((first,), numbers, detail, False, turn if turn.count > 1 else None)


def _shortened(levels: list[Level]) -> list[Level]:
    """Return the levels to draw; the lay-up table lists them all."""
    if len(levels) <= MOST:
        return levels
    hidden = levels[MOST - 5 : -4]
    middle = hidden[len(hidden) // 2]
    gap = Level(middle.layers, f"{len(hidden)} more layers", "see the list", middle.made)
    return [*levels[: MOST - 5], gap, *levels[-4:]]


def _labels(levels: Sequence[Level], gap: float) -> float:
    """Return the space beside the layers for the longest label and its bracket, mm."""
    if gap >= TWO_LINES:
        return LABELS
    lengths = (
        BOLD * draw.text_width(level.words, 2.5) + draw.text_width(level.detail, 2.2)
        for level in levels
    )
    return max(LABELS, COLUMN + 3.2 + BRACKET + max(lengths, default=0.0))


def _name_level(picture: Picture, level: Level, edge: Point, gap: float) -> None:
    """Add a level's label with a leader to its edge; on one line if the next are near."""
    (x, y), column = edge, WIDE + COLUMN
    ends = [(min(x, WIDE) + 0.4, y), (column - 0.8, y)]
    picture.add(draw.line(ends, colour=draw.GREY, width=0.12))
    if gap < TWO_LINES:
        after = column + BOLD * draw.text_width(level.words, 2.5) + 1.2
        picture.add(draw.text((column, y + 0.9), level.words, size=2.5, bold=True))
        picture.add(draw.text((after, y + 0.9), level.detail, size=2.2))
    else:
        picture.add(draw.text((column, y + 0.1), level.words, size=2.7, bold=True))
        picture.add(draw.text((column, y + 3.0), level.detail, size=2.3))


def _pin_stretches(pins: Sequence[Pin], view: _Tilted, under: float, over: float) -> Iterator[str]:
    """Yield the part of every pin between two levels, rear pins first."""
    for pin in sorted(pins, key=lambda pin: (-pin.centre[1], pin.centre[0])):
        x, back = view.middle + pin.centre[0] * view.scale, pin.centre[1] * view.scale * TILT
        look = draw.style("#6b7178", max(pin.diameter * view.scale * 0.8, 0.6))
        data = f"M{coord(x)} {coord(under - back)}V{coord(over - back)}"
        yield draw.path(data, f'{look} stroke-linecap="round"')


def _brackets(levels: Sequence[Level], heights: Sequence[float], x: float) -> Iterator[str]:
    """Yield a bracket beside the levels of a round, with the number of turns."""
    ends: dict[int, tuple[Round, list[float]]] = {}
    for level, height in zip(levels, heights, strict=True):
        if level.round is not None:
            ends.setdefault(id(level.round), (level.round, []))[1].append(height)
    for turn, places in ends.values():
        low, high = places[0] + 3.2, places[-1] - 2.4
        yield draw.line([(x - 1.2, low), (x, low), (x, high), (x - 1.2, high)], width=0.3)
        at, words = (x + 1.2, (low + high) / 2 + 1.0), f"{draw.TIMES} {turn.count}"
        yield draw.text(at, words, size=3.4, bold=True)


# The maps of film sheets on the machine, with every part labelled by its pattern.


HIGHEST, BESIDE = 118.0, 90.0
"""Size of a sheet that is not long, down and across the page, mm: two fit side by side."""
ROW, ROWS_TALLEST, LARGEST = 180.0, 210.0, 0.7
"""Size of a long sheet across and down the page, mm, and its largest scale."""
LONG = 2.0  # from this ratio of the sides on, a sheet is drawn in rows
GAP = 3.0
RIM = 0.5
QUARTERS = ((1, 0), (0, 1), (-1, 0), (0, -1))  # cosine and sine of the turns


def part_regions(sheets: Sequence[SheetFile]) -> Iterator[tuple[str, Region]]:
    """Yield the parts on the sheets by id; all sheets of a material share one nest."""
    for sheet in {sheet.material: sheet for sheet in reversed(sheets)}.values():
        for index, part in enumerate(sheet.nest.parts):
            yield _part_id(sheet, index), part.region


def _part_id(sheet: SheetFile, index: int) -> str:
    return f"part-{sheet.material}-{index + 1}"


class SheetView(NamedTuple):
    """The sheet's scale and length on the page, mm, if drawn in one row.

    It is drawn in ``rows``, each a part of its length, the first at the top. ``turned`` lays the
    sheet's length across the page, with its lower left corner at the upper left. The picture ends
    above ``used`` mm of the sheet.
    """

    scale: float
    length: float
    height: float
    rows: int
    turned: bool
    used: float

    def at(self, p: Point) -> Point:
        x, y = self.scale * p[0], self.scale * p[1]
        return (y, x) if self.turned else (x, self.height - y)

    def matrix(self, placement: Placement) -> Matrix:
        """Return the matrix of a quarter turn and a shift on the sheet, then to the page."""
        (u, v), s = QUARTERS[placement.turn], self.scale
        # The columns are the images of the part's axes.
        turned = (s * v, s * u, s * u, -s * v) if self.turned else (s * u, -s * v, -s * v, -s * u)
        return (*turned, *self.at(placement.shift))

    def in_one_row(self, box: Bounds) -> bool:
        (left, top, right, foot), row = box, self.length / self.rows
        is_inside = left >= 0 and top >= 0 and right <= self.length and foot <= self.height
        return is_inside and math.floor(left / row) == math.floor(right / row)


def sheet_rows(
    design: Design, sheets: Sequence[SheetFile], marks: Mapping[str, str]
) -> list[dict[str, Any]]:
    """Return the film sheets of a design, with the count of each pattern, prefixed by the mark or
    name of its design, and their pictures.
    """
    films = {film.material: film for film in design.films.stock.values()}
    return [
        {
            "sheet": sheet,
            "film": films[sheet.material],
            "counts": [(_marked(name, pattern, marks), n) for name, pattern, n in sheet.counts],
            "picture": sheet_map(sheet, films[sheet.material], marks, f"sheet-{number}"),
            "view": _sheet_view(sheet),
        }
        for number, sheet in enumerate(sheets, 1)
    ]


def _marked(design: str, pattern: str, marks: Mapping[str, str]) -> str:
    """A pattern prefixed by the mark of its design, or by the design's name without a mark."""
    return f"{marks.get(design, design)} {pattern}".lstrip()


def _sheet_view(sheet: SheetFile) -> SheetView:
    width, length, nest = sheet.width, sheet.length, sheet.nest
    long, short = max(width, length), min(width, length)
    if long <= LONG * short:
        tops = [nest.region(placement).bounds[3] for placement in nest.on_sheet(sheet.number - 1)]
        tops += [y + diameter / 2 for _, y, diameter in nest.stock.pins]
        used = min(length, max(tops) + nest.stock.border)
        scale = min(BESIDE / width, HIGHEST / used)
        return SheetView(scale, scale * width, scale * used, 1, False, used)
    count = 1
    while (
        ROW * (count + 1) / long <= LARGEST
        and (count + 1) * (short * ROW * (count + 1) / long + GAP) <= ROWS_TALLEST
    ):
        count += 1
    scale = min(ROW * count / long, LARGEST)
    return SheetView(scale, scale * long, scale * short, count, length > width, length)


def sheet_map(sheet: SheetFile, film: Film, marks: Mapping[str, str], name: str) -> str:
    """Return the sheet in plan, with its lower left corner at the lower left; a long one in rows.

    The label of a part is its pattern, prefixed by the mark of its design or the design's name.
    """
    view = _sheet_view(sheet)
    wide, high = view.length / view.rows, view.height
    down = view.rows * (high + GAP) - GAP
    picture = Picture(name, wide + 2 * RIM, down + 2 * RIM, f"{sheet.path}: where every part lies")
    for row in range(view.rows):
        top = RIM + row * (high + GAP)
        window = " ".join(map(coord, (row * wide, 0.0, wide, high)))
        picture.add(
            f'<svg x="{RIM}" y="{coord(top)}" width="{coord(wide)}" height="{coord(high)}" '
            f'viewBox="{window}">'
        )
        if row:
            picture.add(f'<use href="#{picture.name}-whole"/>')
        else:
            picture.add(f'<g id="{picture.name}-whole">')
            _draw_sheet(picture, sheet, film, view, marks)
            picture.add("</g>")
        ends = (RIM, top), (RIM + wide, top + high)
        picture.add("</svg>", draw.box(*ends, fill="none", stroke=draw.DARK))
    return picture.svg()


def _draw_sheet(
    picture: Picture, sheet: SheetFile, film: Film, view: SheetView, marks: Mapping[str, str]
) -> None:
    """Add parts, pins and labels; equal parts get equal labels unless labels would collide."""
    picture.add(draw.box((0.0, 0.0), (view.length, view.height), fill="#ffffff"))
    placements = sheet.nest.on_sheet(sheet.number - 1)
    for placement in placements:
        picture.part(_part_id(sheet, placement.part), film, view.matrix(placement), "fresh")
    for x, y, diameter in sheet.nest.stock.pins:
        picture.add(draw.circle(view.at((x, y)), diameter * view.scale / 2, 'fill="#777777"'))
    places: dict[tuple[int, int], tuple[Point, list[PlacedLabel]]] = {}
    taken: list[Bounds] = []
    for placement in placements:
        part, region = sheet.nest.parts[placement.part], sheet.nest.region(placement)
        words, (x, y) = _marked(part.design, part.pattern, marks), view.at(region.bounds[:2])
        key = placement.part, placement.turn
        if key not in places:
            places[key] = (x, y), labels(words, region.mapped(view.at, view.scale, mirror=True))
        (first_x, first_y), ranked = places[key]
        dx, dy = x - first_x, y - first_y
        for (u, v), size, (left, top, right, foot) in ranked:
            box = left + dx, top + dy, right + dx, foot + dy
            if view.in_one_row(box) and not any(_shared(box, other) for other in taken):
                taken.append(box)
                picture.label((u + dx, v + dy), words, size)
                break


LEGIBLE = 1.5  # smallest legible label on the page, mm
STEPS = 4  # positions tried from the middle of a part to each of its ends
SIZES = (1.0, 0.8, 0.6)
OVER = 1.1  # share of its part's width that a label may fill
HIGH = 0.8  # height of a label, in font sizes
OFF = 2.0  # cost of a label off the film of its part; as far from the middle as the corners costs 1
SAMPLES = 7  # points along a label at which its part is looked up
CHORD = 0.05  # distance of a chord from an arc of a part, mm on the page


PlacedLabel = tuple[Point, float, Bounds]
"""The middle of the text's base line, its size and its box, mm on the page."""


def labels(words: str, part: Region) -> list[PlacedLabel]:
    """Return legible positions for a text on a drawn part, best first: on its film, near its middle
    and large.
    """
    import shapely

    low_x, low_y, high_x, high_y = part.bounds
    em = draw.text_width(words, 1.0)
    most = min(OVER * (high_x - low_x) / em, draw.SMALL)
    shares = [share for share in SIZES if share * most >= LEGIBLE]
    grid = np.arange(-STEPS, STEPS + 1) / (STEPS + 1)
    u, v, share = (axis.ravel() for axis in np.meshgrid(grid, grid, shares))
    x = (low_x + high_x) / 2 + u * (high_x - low_x) / 2
    y = (low_y + high_y) / 2 + v * (high_y - low_y) / 2
    size = share * most
    wide, high = size * em / 2, HIGH * size / 2
    film = part.shapely(CHORD)
    shapely.prepare(film)
    at = np.linspace(-1, 1, SAMPLES)
    across, down = (grid.reshape(-1, 1) for grid in np.meshgrid(at, at[::2]))
    on = shapely.contains_xy(film, x + wide * across, y + high * down)
    cost = np.sqrt((u**2 + v**2) / 2) + (1 - share) + OFF * (1 - on.mean(axis=0))
    rows = np.stack([x, y + 0.35 * size, size, x - wide, y - high, x + wide, y + high], axis=1)
    ranked = rows[np.argsort(cost.round(9), kind="stable")].tolist()
    return [((at_x, at_y), size, tuple(box)) for at_x, at_y, size, *box in ranked]
