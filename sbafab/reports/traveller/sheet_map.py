"""A film sheet as it lies on the machine, every part labelled with its pattern."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from sbafab.cutting.sheets import SheetFile
from sbafab.geometry.edges import Bounds, Point
from sbafab.geometry.region import Region
from sbafab.geometry.svg import number
from sbafab.nesting.records import Placement
from sbafab.reports import drawing as draw
from sbafab.reports.traveller.shapes import Picture, label

SHOWN = 84.0
"""mm on the page of a sheet's longer side."""
EDGE = 0.5
OVER = 1.1
"""Share of its part's width that a label may take."""
QUARTERS = ((1, 0), (0, 1), (-1, 0), (0, -1))
"""Cosine and sine of the turns."""
LEGIBLE = 1.5
"""mm on the page: smaller labels help nobody."""


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


def sheet_map(sheet: SheetFile, design: str, name: str) -> str:
    """The sheet in plan, its lower left corner at the lower left; names of other designs too."""
    scale = SHOWN / max(sheet.width, sheet.length)
    width, height = sheet.width * scale, sheet.length * scale
    origin = EDGE, height + EDGE
    picture = Picture(
        name, width + 2 * EDGE, height + 2 * EDGE, f"{sheet.path}: where every part lies"
    )
    frame = (EDGE, EDGE), (width + EDGE, height + EDGE)
    picture.add(draw.box(*frame, fill="#ffffff", stroke=draw.DARK))
    placements = sheet.nest.on_sheet(sheet.number - 1)
    for placement in placements:
        matrix = _matrix(placement, scale, origin)
        picture.part(_part_id(sheet, placement.part), sheet.material, matrix, "fresh")
    for x, y, diameter in sheet.nest.stock.pins:
        at = number(origin[0] + x * scale), number(origin[1] - y * scale)
        radius = number(diameter * scale / 2)
        picture.add(f'<circle cx="{at[0]}" cy="{at[1]}" r="{radius}" fill="#777777"/>')
    for placement in placements:
        part = sheet.nest.parts[placement.part]
        words = part.pattern if part.design == design else f"{part.design} {part.pattern}"
        picture.add(*_label(words, sheet.nest.region(placement).bounds, scale, origin))
    return picture.svg()


def _matrix(placement: Placement, scale: float, origin: Point) -> tuple[float, ...]:
    """A quarter turn and a shift in the sheet's frame, then y down and enlarged."""
    u, v = QUARTERS[placement.turn]
    x, y = placement.shift
    turned = scale * u, -scale * v, -scale * v, -scale * u
    return (*turned, origin[0] + scale * x, origin[1] - scale * y)


def _label(words: str, bounds: Bounds, scale: float, origin: Point) -> list[str]:
    """The words in the middle of a part, as large as it allows; none where nobody could read it."""
    low_x, low_y, high_x, high_y = bounds
    room = OVER * (high_x - low_x) * scale
    size = min(draw.SMALL * room / draw.text_width(words, draw.SMALL), draw.SMALL)
    if size < LEGIBLE:
        return []
    x = origin[0] + (low_x + high_x) / 2 * scale
    y = origin[1] - (low_y + high_y) / 2 * scale + 0.35 * size
    return [label((x, y), words, size)]
