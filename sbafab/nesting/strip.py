"""The spyrrow engine: strip packing that imitates sheets.

The strip runs along a sheet's length and is as high as the sheet is wide. What reaches past the
sheet's end goes to the next sheet, for which a new search begins. It ends by the clock, so its
result is no function of the design: it is worth saving.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from sbafab.errors import SbafabError
from sbafab.geometry.contour import Contour, run_chords
from sbafab.geometry.edges import Point
from sbafab.nesting.records import (
    TURNS,
    NestPart,
    Placement,
    Stock,
    pins_unknown,
    placed,
    too_tight,
)

if TYPE_CHECKING:
    from spyrrow import Item, PlacedItem

SAGITTA = 0.01
"""mm by which the polygons handed over may reach past arcs."""
ROOM = 0.002
"""mm added to the spacing and kept along the sides: spyrrow reckons in single precision."""
SEED = 1


def strip(parts: Sequence[NestPart], stock: Stock, seconds: float) -> tuple[Placement, ...]:
    """Places for every part, after about ``seconds`` of search for each sheet.

    Raises DesignError if the sheet has pins or a part fits it only just, SbafabError if spyrrow
    is not installed.
    """
    if stock.pins:
        raise pins_unknown(parts[0].material, stock)
    left = [part.count for part in parts]
    done: list[Placement] = []
    sheet = 0
    while any(left):
        for placement in _sheet(parts, left, stock, sheet, seconds):
            left[placement.part] -= 1
            done.append(placement)
        sheet += 1
    return tuple(done)


def _sheet(
    parts: Sequence[NestPart], left: Sequence[int], stock: Stock, sheet: int, seconds: float
) -> list[Placement]:
    """What of the best strip ends before the sheet does; at least one part."""
    found = [_placement(item, sheet, stock) for item in _solved(parts, left, stock, seconds)]
    tops = [_extent(parts[place.part], place)[1] for place in found]
    whole = [place for place, top in zip(found, tops, strict=True) if top <= stock.usable[3]]
    if whole:
        return whole
    first = found[tops.index(min(tops))]
    x, y = first.shift
    down = _extent(parts[first.part], first)[0] - stock.usable[1]
    return [Placement(first.part, sheet, first.turn, (x, y - down))]


def _solved(
    parts: Sequence[NestPart], left: Sequence[int], stock: Stock, seconds: float
) -> list[PlacedItem]:
    try:
        import spyrrow
    except ImportError as error:
        raise SbafabError(
            'engine "spyrrow" is not installed; run pip install "sbafab[nest]", or use '
            '"bottom-left".'
        ) from error
    items = [_item(number, part, left[number], stock) for number, part in enumerate(parts)]
    separation = stock.spacing + ROOM
    instance = spyrrow.StripPackingInstance(
        "sheet", _height(stock) + 2 * separation, [item for item in items if item is not None]
    )
    config = spyrrow.StripPackingConfig(
        min_items_separation=separation,
        total_computation_time=max(1, round(seconds)),
        num_workers=1,
        seed=SEED,
    )
    return instance.solve(config).placed_items


def _height(stock: Stock) -> float:
    return stock.usable[2] - stock.usable[0] - 2 * ROOM


def _item(number: int, part: NestPart, count: int, stock: Stock) -> Item | None:
    from spyrrow import Item

    if count == 0:
        return None
    low_x, low_y, high_x, high_y = part.region.bounds
    along, across = high_x - low_x, high_y - low_y
    length = stock.usable[3] - stock.usable[1]
    angles: list[float] = []
    for (u, v), pair in (((along, across), (0.0, 180.0)), ((across, along), (90.0, 270.0))):
        # The strip's x runs along the sheet's y.
        if TURNS[round(pair[0] / 90) + 1] not in stock.turns:
            continue
        if u <= length - ROOM and v <= _height(stock) - 3 * SAGITTA:
            angles += pair
    if not angles:
        raise too_tight(part)
    return Item(str(number), _outline(part.region.outers[0]), count, angles)


def _placement(item: PlacedItem, sheet: int, stock: Stock) -> Placement:
    """The strip's x runs along the sheet's y: one quarter turn more.

    spyrrow keeps the separation from the strip's ends and sides, too; a sheet's border needs none.
    """
    _, bottom, right, _ = stock.usable
    along, across = item.translation
    separation = stock.spacing + ROOM
    shift = (right - ROOM + separation - across, bottom + ROOM - separation + along)
    return Placement(int(item.id), sheet, TURNS[(round(item.rotation / 90) + 1) % 4], shift)


def _extent(part: NestPart, place: Placement) -> tuple[float, float]:
    """Lowest and highest y of a placed part."""
    _, low, _, high = placed(part.region, place.turn, place.shift).bounds
    return low, high


def _outline(contour: Contour) -> list[Point]:
    """A polygon that holds the contour, nowhere more than ``SAGITTA`` outside it."""
    return [p for run in contour.runs for p in run_chords(run, True, SAGITTA)]
