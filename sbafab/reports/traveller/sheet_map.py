"""A film sheet as it lies on the machine, every part labelled with its pattern."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import tee
from typing import NamedTuple

from sbafab.cutting.sheets import SheetFile
from sbafab.geometry.edges import Bounds, Point
from sbafab.geometry.region import Region
from sbafab.geometry.svg import number
from sbafab.laminate.films import Film
from sbafab.nesting.records import Placement
from sbafab.reports import drawing as draw
from sbafab.reports.traveller.part_labels import PlacedLabel, first_free, labels
from sbafab.reports.traveller.shapes import Picture, label

HIGHEST = 118.0
"""mm on the page that a sheet which is not long may take down."""
ROW, TALLEST, LARGEST = 180.0, 210.0, 0.7
"""mm on the page that a long sheet may take across and down, and its largest scale."""
LONG = 2.0
"""Longer side over shorter one from which a sheet is drawn in rows."""
GAP = 3.0
EDGE = 0.5
QUARTERS = ((1, 0), (0, 1), (-1, 0), (0, -1))
"""Cosine and sine of the turns."""


class _Strip(NamedTuple):
    """A rectangle of the sheet (mm of the sheet) and where it lands on the page.

    ``turned`` lays the sheet's length across the page, its lower left corner at the upper left.
    """

    bounds: Bounds
    corner: Point
    scale: float
    turned: bool

    @property
    def size(self) -> Point:
        wide, high = self.bounds[2] - self.bounds[0], self.bounds[3] - self.bounds[1]
        return (
            (high * self.scale, wide * self.scale)
            if self.turned
            else (
                wide * self.scale,
                high * self.scale,
            )
        )

    def at(self, p: Point) -> Point:
        x, y = self.corner
        if self.turned:
            return x + (p[1] - self.bounds[1]) * self.scale, y + (
                p[0] - self.bounds[0]
            ) * self.scale
        return x + (p[0] - self.bounds[0]) * self.scale, y + (self.bounds[3] - p[1]) * self.scale

    def matrix(self, placement: Placement) -> tuple[float, ...]:
        """A quarter turn and a shift in the sheet's frame, then to the page."""
        u, v = QUARTERS[placement.turn]
        s = self.scale
        # The columns are where the part's axes go.
        turned = (s * v, s * u, s * u, -s * v) if self.turned else (s * u, -s * v, -s * v, -s * u)
        return (*turned, *self.at(placement.shift))


def part_regions(sheets: Sequence[SheetFile]) -> Iterator[tuple[str, Region]]:
    """The parts that lie on the sheets by id; all sheets of a material share one nest."""
    seen: set[str] = set()
    for sheet in sheets:
        for index, part in enumerate(sheet.nest.parts):
            name = _part_id(sheet, index)
            if name not in seen:
                seen.add(name)
                yield name, part.region


def _part_id(sheet: SheetFile, index: int) -> str:
    return f"part-{sheet.material}-{index + 1}"


def is_long(sheet: SheetFile) -> bool:
    """Whether the sheet is drawn in rows across the page, each a part of its length."""
    return max(sheet.width, sheet.length) > LONG * min(sheet.width, sheet.length)


def rows_said(sheet: SheetFile) -> str:
    """What is not seen at once in the picture of a sheet: rows, a turn, an empty rest."""
    if not is_long(sheet):
        used = _used(sheet)
        return f"the sheet above {used:.0f} mm is empty" if used < sheet.length else ""
    strips = _strips(sheet)
    said = f"shown in {len(strips)} rows, one after the other" if len(strips) > 1 else ""
    if not strips[0].turned:
        return said
    turn = "turned by 90°: its lower left corner is at the upper left"
    return f"{turn}; {said}" if said else turn


def sheet_map(sheet: SheetFile, film: Film, marks: Mapping[str, str], name: str) -> str:
    """The sheet in plan, its lower left corner at the lower left; a long one in rows.

    A part is labelled with its pattern after the mark of its design, or the design's name.
    """
    strips = _strips(sheet)
    width, height = strips[-1].size
    low = strips[-1].corner[1] + height
    words = f"{sheet.path}: where every part lies"
    picture = Picture(name, width + 2 * EDGE, low + EDGE, words)
    for strip in strips:
        picture.add(*_window(strip))
        _draw(picture, sheet, film, strip, marks)
        picture.add("</svg>")
        (x, y), (wide, high) = strip.corner, strip.size
        frame = (x, y), (x + wide, y + high)
        picture.add(draw.box(*frame, fill="none", stroke=draw.DARK))
    return picture.svg()


def _strips(sheet: SheetFile) -> list[_Strip]:
    width, length = sheet.width, sheet.length
    if not is_long(sheet):
        used = _used(sheet)
        scale = min(ROW / width, HIGHEST / used)
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
    """How far up a sheet its parts and pins reach, and a border more; mm."""
    nest = sheet.nest
    tops = [nest.region(placement).bounds[3] for placement in nest.on_sheet(sheet.number - 1)]
    tops += [y + diameter / 2 for _, y, diameter in nest.stock.pins]
    return min(sheet.length, max(tops) + nest.stock.border)


def _window(strip: _Strip) -> list[str]:
    """Opens a picture in the picture that shows nothing beside the strip."""
    (x, y), (wide, high) = strip.corner, strip.size
    place = " ".join(map(number, (x, y, wide, high)))
    return [
        f'<svg x="{number(x)}" y="{number(y)}" width="{number(wide)}" height="{number(high)}" '
        f'viewBox="{place}">',
        draw.box(strip.corner, (x + wide, y + high), fill="#ffffff", stroke="none"),
    ]


def _draw(
    picture: Picture, sheet: SheetFile, film: Film, strip: _Strip, marks: Mapping[str, str]
) -> None:
    """Parts, pins and labels of a strip."""
    seen = [
        (placement, sheet.nest.region(placement))
        for placement in sheet.nest.on_sheet(sheet.number - 1)
    ]
    seen = [(placement, region) for placement, region in seen if _meets(region.bounds, strip)]
    for placement, _ in seen:
        name = _part_id(sheet, placement.part)
        picture.part(name, film, strip.matrix(placement), "fresh")
    for x, y, diameter in sheet.nest.stock.pins:
        at = strip.at((x, y))
        radius = number(diameter * strip.scale / 2)
        picture.add(
            f'<circle cx="{number(at[0])}" cy="{number(at[1])}" r="{radius}" fill="#777777"/>'
        )
    _label(picture, sheet, strip, marks, seen)


def _label(
    picture: Picture,
    sheet: SheetFile,
    strip: _Strip,
    marks: Mapping[str, str],
    seen: Sequence[tuple[Placement, Region]],
) -> None:
    """Every part's pattern; parts that lie alike are labelled alike unless labels would meet."""
    known: dict[tuple[int, int], tuple[Bounds, Iterator[PlacedLabel]]] = {}
    taken: list[Bounds] = []
    page = (*strip.corner, *_far(strip))
    for placement, region in seen:
        part = sheet.nest.parts[placement.part]
        words = marked(part.design, part.pattern, marks)
        alike = placement.part, placement.turn
        if alike not in known:
            shape = region.mapped(strip.at, strip.scale, mirror=True)
            known[alike] = region.bounds, labels(words, shape)
        bounds, places = known[alike]
        places, kept = tee(places)
        known[alike] = bounds, kept
        (x, y), (first_x, first_y) = strip.at(region.bounds[:2]), strip.at(bounds[:2])
        moved = (place.moved(x - first_x, y - first_y) for place in places)
        found = first_free(moved, page, taken)
        if found is not None:
            taken.append(found.box)
            picture.add(label(found.at, words, found.size))


def _far(strip: _Strip) -> Point:
    return strip.corner[0] + strip.size[0], strip.corner[1] + strip.size[1]


def _meets(bounds: Bounds, strip: _Strip) -> bool:
    low_x, low_y, high_x, high_y = strip.bounds
    return bounds[0] < high_x and bounds[2] > low_x and bounds[1] < high_y and bounds[3] > low_y


def marked(design: str, pattern: str, marks: Mapping[str, str]) -> str:
    """A pattern after the mark of its design, the design's name where it has none."""
    return f"{marks.get(design, design)} {pattern}".lstrip()
