"""The map of a film sheet on the machine, with every part labelled by its pattern."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache
from heapq import heappop, heappush, merge
from itertools import tee
from typing import NamedTuple

from sbafab.cutting.sheets import SheetFile
from sbafab.geometry.edges import Bounds, Point
from sbafab.geometry.region import Region, coord
from sbafab.laminate.films import Film
from sbafab.nesting.records import Placement
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


def is_long(sheet: SheetFile) -> bool:
    """Return True if the sheet is drawn in rows across the page, each a part of its length."""
    return max(sheet.width, sheet.length) > LONG * min(sheet.width, sheet.length)


def picture_note(sheet: SheetFile) -> str:
    """Return what the picture of a sheet does not show directly: rows, a turn, an empty rest."""
    if not is_long(sheet):
        used = _used(sheet)
        return f"the sheet above {used:.0f} mm is empty" if used < sheet.length else ""
    strips = _strips(sheet)
    rows = f"shown in {len(strips)} rows, one after the other" if len(strips) > 1 else ""
    if not strips[0].turned:
        return rows
    turn = "turned by 90°: its lower left corner is at the upper left"
    return f"{turn}; {rows}" if rows else turn


def sheet_map(sheet: SheetFile, film: Film, marks: Mapping[str, str], name: str) -> str:
    """Return the sheet in plan, its lower left corner at the lower left; a long one in rows.

    The label of a part is its pattern after the mark of its design, or the design's name.
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


def _window(strip: _Strip) -> list[str]:
    """Return the opening tags of a nested picture clipped to the strip."""
    (x, y), (wide, high) = strip.corner, strip.size
    place = " ".join(map(coord, (x, y, wide, high)))
    return [
        f'<svg x="{coord(x)}" y="{coord(y)}" width="{coord(wide)}" height="{coord(high)}" '
        f'viewBox="{place}">',
        draw.box(strip.corner, (x + wide, y + high), fill="#ffffff", stroke="none"),
    ]


def _draw(
    picture: Picture, sheet: SheetFile, film: Film, strip: _Strip, marks: Mapping[str, str]
) -> None:
    """Draw parts, pins and labels of a strip."""
    visible = [
        (placement, sheet.nest.region(placement))
        for placement in sheet.nest.on_sheet(sheet.number - 1)
    ]
    visible = [(placement, region) for placement, region in visible if _meets(region.bounds, strip)]
    for placement, _ in visible:
        name = _part_id(sheet, placement.part)
        picture.part(name, film, strip.matrix(placement), "fresh")
    for x, y, diameter in sheet.nest.stock.pins:
        at = strip.at((x, y))
        radius = coord(diameter * strip.scale / 2)
        picture.add(
            f'<circle cx="{coord(at[0])}" cy="{coord(at[1])}" r="{radius}" fill="#777777"/>'
        )
    _label(picture, sheet, strip, marks, visible)


def _label(
    picture: Picture,
    sheet: SheetFile,
    strip: _Strip,
    marks: Mapping[str, str],
    visible: Sequence[tuple[Placement, Region]],
) -> None:
    """Label every part; equal parts get equal labels unless labels would collide."""
    by_placement: dict[tuple[int, int], tuple[Bounds, Iterator[PlacedLabel]]] = {}
    taken: list[Bounds] = []
    page = (*strip.corner, *_far(strip))
    for placement, region in visible:
        part = sheet.nest.parts[placement.part]
        words = marked(part.design, part.pattern, marks)
        key = placement.part, placement.turn
        if key not in by_placement:
            shape = region.mapped(strip.at, strip.scale, mirror=True)
            by_placement[key] = region.bounds, labels(words, shape)
        bounds, places = by_placement[key]
        places, copy = tee(places)
        by_placement[key] = bounds, copy
        (x, y), (first_x, first_y) = strip.at(region.bounds[:2]), strip.at(bounds[:2])
        moved = (place.moved(x - first_x, y - first_y) for place in places)
        free = first_free(moved, page, taken)
        if free is not None:
            taken.append(free.box)
            picture.add(label(free.at, words, free.size))


def _far(strip: _Strip) -> Point:
    return strip.corner[0] + strip.size[0], strip.corner[1] + strip.size[1]


def _meets(bounds: Bounds, strip: _Strip) -> bool:
    low_x, low_y, high_x, high_y = strip.bounds
    return bounds[0] < high_x and bounds[2] > low_x and bounds[1] < high_y and bounds[3] > low_y


def marked(design: str, pattern: str, marks: Mapping[str, str]) -> str:
    """Return a pattern after the mark of its design, or after the design's name without a mark."""
    return f"{marks.get(design, design)} {pattern}".lstrip()


# Positions of labels: on the part, off its holes and off other labels.


LEGIBLE = 1.5
"""Smallest legible label on the page, mm."""
STEPS = 6
"""Positions tried from the middle of a part to each of its ends."""
SIZES = (1.0, 0.8, 0.6)
OVER = 1.1
"""Share of its part's width that a label may fill."""
HIGH = 0.8
"""Height of a label, in font sizes."""
OUTSIDE, HOLE = 3.0, 1.0
"""Cost of a corner off the part, and of a covered hole; the distance from the middle costs 1."""


class PlacedLabel(NamedTuple):
    """``at`` is the middle of the text's base line; ``size`` and ``box`` are mm on the page."""

    at: Point
    size: float
    box: Bounds

    def moved(self, dx: float, dy: float) -> PlacedLabel:
        (x, y), (low_x, low_y, high_x, high_y) = self.at, self.box
        box = low_x + dx, low_y + dy, high_x + dx, high_y + dy
        return PlacedLabel((x + dx, y + dy), self.size, box)


def labels(words: str, part: Region) -> Iterator[PlacedLabel]:
    """Yield positions for a text on a drawn part, the best first.

    They are off its holes if possible, near its middle and as large as possible; illegible ones are
    not yielded. Positions are measured lazily: the first one is nearly always taken.
    """
    low_x, _, high_x, _ = part.bounds
    width = OVER * (high_x - low_x)
    most = min(draw.SMALL * width / draw.text_width(words, draw.SMALL), draw.SMALL)
    holes = [hole.bounds for hole in part.holes]
    em = draw.text_width(words, 1.0)
    middles = list(_middles(part.bounds))
    sizes = [(1 - share, share * most) for share in SIZES if share * most >= LEGIBLE]
    # Nearest first for each size, so labels are only made when needed.
    fresh = merge(*([(far + less, at, size) for far, at in middles] for less, size in sizes))
    ahead = next(fresh, None)
    waiting: list[_Candidate] = []
    while waiting or ahead is not None:
        while ahead is not None and (not waiting or ahead[0] <= waiting[0].cost):
            far, middle, size = ahead
            heappush(waiting, _Candidate(far, _placed_label(em, middle, size), far))
            ahead = next(fresh, None)
        best = heappop(waiting)
        if best.sides is None:
            covered = [hole for hole in holes if _meet(best.label.box, hole)]
            heappush(waiting, best.covering(len(covered), _sides(best.label.box, covered)))
        elif best.sides:
            heappush(waiting, best.beside(part))
        else:
            yield best.label


class _Candidate(NamedTuple):
    """A label with its least possible cost: ``far`` from the middle and small, holes ``covered``,
    points ``off`` the part; quickly measured costs come first.

    ``sides``: points of its box not yet tested against the part; None if the holes have not been
    counted either.
    """

    cost: float
    label: PlacedLabel
    far: float
    covered: int = 0
    off: int = 0
    sides: tuple[Point, ...] | None = None

    def covering(self, covered: int, sides: tuple[Point, ...]) -> _Candidate:
        return self._measured(covered, 0, sides)

    def beside(self, part: Region) -> _Candidate:
        """Return the candidate measured up to its first point off the part, which costs much."""
        assert self.sides is not None
        for number, point in enumerate(self.sides):
            if not part.contains(point):
                return self._measured(self.covered, self.off + 1, self.sides[number + 1 :])
        return self._measured(self.covered, self.off, ())

    def _measured(self, covered: int, off: int, sides: tuple[Point, ...]) -> _Candidate:
        cost = self.far + (HOLE * covered + OUTSIDE * off)
        return _Candidate(cost, self.label, self.far, covered, off, sides)


def first_free(
    candidates: Iterable[PlacedLabel], page: Bounds, taken: Sequence[Bounds]
) -> PlacedLabel | None:
    """Return the first label that is on the page and off the boxes of other labels; None if none
    is.
    """
    return next(
        (
            label
            for label in candidates
            if _within(label.box, page) and not any(_meet(label.box, box) for box in taken)
        ),
        None,
    )


def _placed_label(em: float, middle: Point, size: float) -> PlacedLabel:
    """Return the label of a text that is ``em`` font sizes wide."""
    x, y = middle
    wide, high = size * em / 2, HIGH * size / 2
    box = x - wide, y - high, x + wide, y + high
    return PlacedLabel((x, y + 0.35 * size), size, box)


def _middles(bounds: Bounds) -> Iterator[tuple[float, Point]]:
    """Yield distance from the middle, 0 to 1, and point, over a part's box; nearest first."""
    low_x, low_y, high_x, high_y = bounds
    x, y = (low_x + high_x) / 2, (low_y + high_y) / 2
    for off, u, v in _grid():
        yield off, (x + u * (high_x - low_x) / 2, y + v * (high_y - low_y) / 2)


@cache
def _grid() -> list[tuple[float, float, float]]:
    """Return distances and coordinates of a grid over a box from -1 to 1, nearest first."""
    steps = range(-STEPS, STEPS + 1)
    grid = [(i / (STEPS + 1), j / (STEPS + 1)) for i in steps for j in steps]
    nearest = sorted(grid, key=lambda p: (p[0] ** 2 + p[1] ** 2, p))
    return [(((u**2 + v**2) / 2) ** 0.5, u, v) for u, v in nearest]


def _sides(box: Bounds, holes: Sequence[Bounds]) -> tuple[Point, ...]:
    """Return corners and middles of the text's box that are off the part's holes."""
    points = [(x, y) for y in (box[1], box[3]) for x in (box[0], (box[0] + box[2]) / 2, box[2])]
    return tuple([p for p in points if not any(_meet((*p, *p), hole) for hole in holes)])


def _meet(a: Bounds, b: Bounds) -> bool:
    return a[0] < b[2] and a[2] > b[0] and a[1] < b[3] and a[3] > b[1]


def _within(box: Bounds, page: Bounds) -> bool:
    return box[0] >= page[0] and box[1] >= page[1] and box[2] <= page[2] and box[3] <= page[3]
