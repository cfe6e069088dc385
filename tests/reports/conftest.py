"""Film sheets laid out by hand, row by row, so that a traveller can be made without nesting."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator

import pytest

from sbafab.cutting.placements import Nest, NestPart, Placement, Stock, Turn
from sbafab.cutting.sheets import SheetFile
from sbafab.laminate.films import Material
from sbafab.laminate.laminate import Laminate

STOCK = Stock(pins=((5.0, 5.0, 4.0),))
MATERIALS: tuple[Material, ...] = ("TPE", "PTFE")
TURNS: tuple[Turn, ...] = (0, 1, 2, 3)

SheetMaker = Callable[..., list[SheetFile]]


def _placements(parts: tuple[NestPart, ...]) -> Iterator[Placement]:
    """Parts side by side, a quarter turn on from one to the next, a new row where one is full."""
    least, most = STOCK.border, STOCK.width - STOCK.border
    x, y, tall, sheet = least, least, 0.0, 0
    for index, part in enumerate(parts):
        for number in range(part.count):
            turn = TURNS[number % 4]
            low_x, low_y, high_x, high_y = part.region.turned(90.0 * turn).bounds
            if x + high_x - low_x > most:
                x, y, tall = least, y + tall + STOCK.spacing, 0.0
            if y + high_y - low_y > most:
                x, y, tall, sheet = least, least, 0.0, sheet + 1
            yield Placement(index, sheet, turn, (x - low_x, y - low_y))
            x += high_x - low_x + STOCK.spacing
            tall = max(tall, high_y - low_y)


def _nest(laminate: Laminate, material: Material, copies: int) -> Nest:
    parts = tuple(
        NestPart(laminate.name, pattern, number, material, piece, len(layers) * copies)
        for pattern, layers in laminate.patterns.items()
        if layers[0].film.material == material
        for number, piece in enumerate(layers[0].profile.pieces, 1)
    )
    return Nest(material, STOCK, parts, tuple(_placements(parts)))


def _file(nest: Nest, number: int) -> SheetFile:
    lying = [nest.parts[placement.part] for placement in nest.on_sheet(number - 1)]
    counts = Counter((part.design, part.pattern) for part in lying)
    path = f"sheets/{nest.material}_{number}"
    return SheetFile(
        path=f"{path}.dxf",
        picture=f"{path}.svg",
        project=f"{path}.lbrn2",
        sha256="0" * 64,
        nest=nest,
        number=number,
        width=STOCK.width,
        length=STOCK.length,
        counts=tuple((*key, count) for key, count in counts.items()),
        contours=sum(len(part.region.contours) for part in lying),
        parts_area=sum(part.region.area for part in lying),
        cut_length=sum(contour.length for part in lying for contour in part.region.contours),
        travel=900.0,
        unsorted_travel=1500.0,
        minutes=2.0,
    )


@pytest.fixture(scope="session")
def sheet_files() -> SheetMaker:
    """Makes the sheets of a laminate, all its ``copies`` on them."""

    def make(laminate: Laminate, copies: int = 1) -> list[SheetFile]:
        nests = [_nest(laminate, material, copies) for material in MATERIALS]
        return [_file(nest, number + 1) for nest in nests for number in range(nest.sheets)]

    return make
