"""The maps of film sheets on the machine, with every part labelled by its pattern."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from sbafab.cutting.nest import Placement
from sbafab.cutting.sheets import SheetFile
from sbafab.design.records import Design
from sbafab.geometry.edges import Bounds, Point
from sbafab.geometry.region import Region, coord
from sbafab.laminate.films import Film
from sbafab.reports import drawing as draw
from sbafab.reports.traveller.shapes import Picture, label

HIGHEST, BESIDE = 118.0, 90.0
"""Size of a sheet that is not long, down and across the page, mm: two fit side by side."""
ROW, TALLEST, LARGEST = 180.0, 210.0, 0.7
"""Size of a long sheet across and down the page, mm, and its largest scale."""
LONG = 2.0
"""From this ratio of the sides on, a sheet is drawn in rows."""
GAP = 3.0
EDGE = 0.5
QUARTERS = ((1, 0), (0, 1), (-1, 0), (0, -1))
"""Cosine and sine of the turns."""


class _Strip(NamedTuple):
    """A rectangle of the sheet (mm of the sheet) and its place on the page.

    ``turned`` lays the sheet's length across the page, its lower left corner at the upper left.
    """

    bounds: Bounds
    corner: Point
    scale: float
    turned: bool

    @property
    def size(self) -> Point:
        low_x, low_y, high_x, high_y = self.bounds
        wide, high = self.scale * (high_x - low_x), self.scale * (high_y - low_y)
        return (high, wide) if self.turned else (wide, high)

    @property
    def window(self) -> Bounds:
        """The place on the page."""
        (x, y), (wide, high) = self.corner, self.size
        return x, y, x + wide, y + high

    def at(self, p: Point) -> Point:
        (x, y), (low_x, low_y, _, high_y) = self.corner, self.bounds
        across, down = (
            (p[1] - low_y, p[0] - low_x) if self.turned else (p[0] - low_x, high_y - p[1])
        )
        return x + across * self.scale, y + down * self.scale

    def matrix(self, placement: Placement) -> tuple[float, ...]:
        """Return the matrix of a quarter turn and a shift in the sheet's frame, then to the
        page.
        """
        u, v = QUARTERS[placement.turn]
        s = self.scale
        # The columns are the images of the part's axes.
        turned = (s * v, s * u, s * u, -s * v) if self.turned else (s * u, -s * v, -s * v, -s * u)
        return (*turned, *self.at(placement.shift))


def part_regions(sheets: Sequence[SheetFile]) -> Iterator[tuple[str, Region]]:
    """Yield the parts that lie on the sheets by id; all sheets of a material share one nest."""
    names: set[str] = set()
    for sheet in sheets:
        for index, part in enumerate(sheet.nest.parts):
            name = _part_id(sheet, index)
            if name not in names:
                names.add(name)
                yield name, part.region


def _part_id(sheet: SheetFile, index: int) -> str:
    return f"part-{sheet.material}-{index + 1}"


class SheetRow(NamedTuple):
    """A sheet of the cut list, with the count of each pattern, and its picture.

    A long sheet is drawn in ``rows`` across the page, each a part of its length, and may be turned;
    the picture of another ends above ``used`` mm.
    """

    sheet: SheetFile
    film: Film
    counts: list[tuple[str, int]]
    picture: str
    rows: int
    is_turned: bool
    is_long: bool
    used: float


def sheet_rows(
    design: Design, sheets: Sequence[SheetFile], marks: Mapping[str, str]
) -> list[SheetRow]:
    """Return the film sheets of a design; patterns carry the mark or the name of their design."""
    films = {film.material: film for film in design.films.stock.values()}
    rows = []
    for number, sheet in enumerate(sheets, 1):
        film, strips, is_long = films[sheet.material], _strips(sheet), _is_long(sheet)
        counts = [(_marked(name, pattern, marks), n) for name, pattern, n in sheet.counts]
        picture = sheet_map(sheet, film, marks, f"sheet-{number}")
        used = sheet.length if is_long else _used(sheet)
        turned = strips[0].turned
        rows.append(SheetRow(sheet, film, counts, picture, len(strips), turned, is_long, used))
    return rows


def _is_long(sheet: SheetFile) -> bool:
    return max(sheet.width, sheet.length) > LONG * min(sheet.width, sheet.length)


def sheet_map(sheet: SheetFile, film: Film, marks: Mapping[str, str], name: str) -> str:
    """Return the sheet in plan, its lower left corner at the lower left; a long one in rows.

    The label of a part is its pattern after the mark of its design, or the design's name.
    """
    strips = _strips(sheet)
    _, _, right, foot = strips[-1].window
    picture = Picture(name, right + EDGE, foot + EDGE, f"{sheet.path}: where every part lies")
    for strip in strips:
        _draw(picture, sheet, film, strip, marks)
    return picture.svg()


def _strips(sheet: SheetFile) -> list[_Strip]:
    width, length = sheet.width, sheet.length
    if not _is_long(sheet):
        used = _used(sheet)
        scale = min(BESIDE / width, HIGHEST / used)
        return [_Strip((0.0, 0.0, width, used), (EDGE, EDGE), scale, False)]
    long, short = max(width, length), min(width, length)
    count = 1
    while (
        ROW * (count + 1) / long <= LARGEST
        and (count + 1) * (short * ROW * (count + 1) / long + GAP) <= TALLEST
    ):
        count += 1
    scale = min(ROW * count / long, LARGEST)
    strips = []
    for row in range(count):
        start, end = long * row / count, long * (row + 1) / count
        turned = length > width
        bounds = (0.0, start, width, end) if turned else (start, 0.0, end, length)
        corner = EDGE, EDGE + row * (short * scale + GAP)
        strips.append(_Strip(bounds, corner, scale, turned))
    return strips


def _used(sheet: SheetFile) -> float:
    """Return the length in mm used by parts and pins, plus a border."""
    nest = sheet.nest
    tops = [nest.region(placement).bounds[3] for placement in nest.on_sheet(sheet.number - 1)]
    tops += [y + diameter / 2 for _, y, diameter in nest.stock.pins]
    return min(sheet.length, max(tops) + nest.stock.border)


def _draw(
    picture: Picture, sheet: SheetFile, film: Film, strip: _Strip, marks: Mapping[str, str]
) -> None:
    """Draw parts, pins and labels of a strip, clipped to it."""
    left, top, right, foot = strip.window
    x, y, wide, high = map(coord, (left, top, right - left, foot - top))
    picture.add(
        f'<svg x="{x}" y="{y}" width="{wide}" height="{high}" viewBox="{x} {y} {wide} {high}">',
        draw.box((left, top), (right, foot), fill="#ffffff"),
    )
    placed = [(place, sheet.nest.region(place)) for place in sheet.nest.on_sheet(sheet.number - 1)]
    visible = [(place, region) for place, region in placed if _meet(region.bounds, strip.bounds)]
    for placement, _ in visible:
        name = _part_id(sheet, placement.part)
        picture.part(name, film, strip.matrix(placement), "fresh")
    for pin_x, pin_y, diameter in sheet.nest.stock.pins:
        at = strip.at((pin_x, pin_y))
        picture.add(draw.circle(at, diameter * strip.scale / 2, 'fill="#777777"'))
    _label(picture, sheet, strip, marks, visible)
    picture.add("</svg>", draw.box((left, top), (right, foot), fill="none", stroke=draw.DARK))


def _label(
    picture: Picture,
    sheet: SheetFile,
    strip: _Strip,
    marks: Mapping[str, str],
    visible: Sequence[tuple[Placement, Region]],
) -> None:
    """Label every part; equal parts get equal labels unless labels would collide."""
    places: dict[tuple[int, int], tuple[Point, list[PlacedLabel]]] = {}
    taken: list[Bounds] = []
    for placement, region in visible:
        part = sheet.nest.parts[placement.part]
        words = _marked(part.design, part.pattern, marks)
        x, y = strip.at(region.bounds[:2])
        key = placement.part, placement.turn
        if key not in places:
            shape = region.mapped(strip.at, strip.scale, mirror=True)
            places[key] = (x, y), labels(words, shape)
        (first_x, first_y), ranked = places[key]
        for place in (free.moved(x - first_x, y - first_y) for free in ranked):
            if _within(place.box, strip.window) and not any(_meet(place.box, box) for box in taken):
                taken.append(place.box)
                picture.add(label(place.at, words, place.size))
                break


def _marked(design: str, pattern: str, marks: Mapping[str, str]) -> str:
    """Return a pattern after the mark of its design, or after the design's name without a mark."""
    return f"{marks.get(design, design)} {pattern}".lstrip()


# Positions of labels: on the part, off its holes and off other labels.


LEGIBLE = 1.5
"""Smallest legible label on the page, mm."""
STEPS = 4
"""Positions tried from the middle of a part to each of its ends."""
SIZES = (1.0, 0.8, 0.6)
OVER = 1.1
"""Share of its part's width that a label may fill."""
HIGH = 0.8
"""Height of a label, in font sizes."""
OFF = 2.0
"""Cost of a label off the film of its part; as far from the middle as the corners costs 1."""
SAMPLES = 7
"""Points along a label at which its part is looked up."""
CHORD = 0.05
"""Distance of a chord from an arc of a part, mm on the page."""


class PlacedLabel(NamedTuple):
    """``at`` is the middle of the text's base line; ``size`` and ``box`` are mm on the page."""

    at: Point
    size: float
    box: Bounds

    def moved(self, dx: float, dy: float) -> PlacedLabel:
        (x, y), (low_x, low_y, high_x, high_y) = self.at, self.box
        box = low_x + dx, low_y + dy, high_x + dx, high_y + dy
        return PlacedLabel((x + dx, y + dy), self.size, box)


def labels(words: str, part: Region) -> list[PlacedLabel]:
    """Return legible positions for a text on a drawn part, the best first: on its film, near its
    middle and large.
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
    across, down = np.meshgrid(at, at[::2])
    on = shapely.contains_xy(
        film,
        x + wide * across.reshape(-1, 1),
        y + high * down.reshape(-1, 1),
    )
    cost = np.sqrt((u**2 + v**2) / 2) + (1 - share) + OFF * (1 - on.mean(axis=0))
    bounds = x - wide, y - high, x + wide, y + high
    rows = np.stack([x, y + 0.35 * size, size, *bounds], axis=1)
    ranked = rows[np.argsort(cost.round(9), kind="stable")].tolist()
    return [PlacedLabel((at_x, at_y), size, tuple(box)) for at_x, at_y, size, *box in ranked]


def _meet(a: Bounds, b: Bounds) -> bool:
    return a[0] < b[2] and a[2] > b[0] and a[1] < b[3] and a[3] > b[1]


def _within(box: Bounds, page: Bounds) -> bool:
    return box[0] >= page[0] and box[1] >= page[1] and box[2] <= page[2] and box[3] <= page[3]
