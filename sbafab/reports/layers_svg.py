"""preview/layers.svg: every distinct pattern, dimensioned, with how many are needed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from sbafab.geometry.edges import Point
from sbafab.geometry.svg import number
from sbafab.laminate.assembly import pins_when_added
from sbafab.laminate.inks import ink
from sbafab.laminate.laminate import Laminate
from sbafab.reports import drawing as draw
from sbafab.reports.features import balloons
from sbafab.reports.pattern_card import Card, cells, drawn, pattern_card, pin_mark

PAGE = (420.0, 297.0)  # A3: the most a drawing may fill
MARGIN = 10.0
BLOCK, NOTE_ROW = 22.5, 4.2
"""Height of the title block with up to one note, and of every further one."""
FILM_ROW = 5.4
SCALES = (20.0, 15.0, 12.0, 10.0, 8.0, 6.0, 5.0, 4.0, 3.0, 2.5, 2.0, 1.5, 1.0, 0.5, 0.2, 0.1)
LEAST_DRAWN = 30.0


@dataclass(frozen=True)
class PageGrid:
    """Equal cells on a page, and the scale of everything drawn in them."""

    scale: float
    columns: int
    cell: Point
    page: Point


def layers_svg(laminate: Laminate) -> str:
    """Every distinct pattern in plan at one scale, as a drawing for A3 (longer if need be)."""
    held = pins_when_added(laminate)
    cards = [pattern_card(laminate, layers, held) for layers in laminate.patterns.values()]
    films = dict.fromkeys(layer.film for layer in laminate.layers)
    rows = max(0, len(laminate.notes) - 1) + max(0, len(_warnings(laminate)) - 1)
    block = BLOCK + max(NOTE_ROW * rows, FILM_ROW * max(0, len(films) - 2))
    grid = _grid(cards, block)
    elements: list[str] = []
    for place, card in enumerate(cards):
        row, column = divmod(place, grid.columns)
        corner = MARGIN + column * grid.cell[0], MARGIN + row * grid.cell[1]
        elements += drawn(card, grid.scale, corner, grid.cell)
    elements += _title_block(laminate, grid, block, any(card.pins for card in cards))
    return draw.document(*grid.page, f"{laminate.name}: layers", elements)


def _grid(cards: Sequence[Card], block: float) -> PageGrid:
    """The largest scale at which all cards fit A3; a longer page rather than tiny drawings."""
    wide = PAGE[0] - 2 * MARGIN
    largest = max(max(card.size) for card in cards)
    best: PageGrid | None = None
    for scale in SCALES:
        cell = cells(cards, scale)
        columns = min(len(cards), math.floor(wide / cell[0]))
        if columns == 0:
            continue
        rows = math.ceil(len(cards) / columns)
        columns = math.ceil(len(cards) / rows)
        height = rows * cell[1] + 2 * MARGIN + block
        if best is None or height <= PAGE[1] or largest * scale >= LEAST_DRAWN:
            best = PageGrid(scale, columns, (wide / columns, cell[1]), (PAGE[0], height))
        if height <= PAGE[1]:
            break
    if best is not None:
        return best
    cell = cells(cards, SCALES[-1])
    page = cell[0] + 2 * MARGIN, len(cards) * cell[1] + 2 * MARGIN + block
    return PageGrid(SCALES[-1], 1, cell, page)


def _title_block(laminate: Laminate, grid: PageGrid, block: float, pinned: bool) -> list[str]:
    width, height = grid.page
    low = (MARGIN, height - MARGIN - block)
    x, y = low
    needed = len(laminate.layers)
    facts = (
        f"{laminate.family}: {balloons(laminate)}, "
        f"{_count(len(laminate.chambers), 'chamber')}, {needed} layers of "
        f"{len(laminate.patterns)} patterns, {number(laminate.thickness)} thick (nominal)"
    )
    return [
        draw.box(low, (width - MARGIN, height - MARGIN), fill="none", stroke=draw.DARK, width=0.25),
        draw.text((x + 3.0, y + 7.2), laminate.name, size=4.6, bold=True),
        draw.text((x + 3.0, y + 12.0), facts),
        *(
            draw.text((x + 3.0, y + 16.2 + NOTE_ROW * row), note, bold=True)
            for row, note in enumerate(laminate.notes or ("",))
        ),
        *(
            draw.text((x + 3.0, y + block - 2.1 - NOTE_ROW * row), said)
            for row, said in enumerate(reversed(_warnings(laminate) or ("",)))
        ),
        *_films(laminate, pinned, (width / 2 + 18.0, y)),
        *_scale_bar(grid.scale, (width - MARGIN - 4.0, y)),
    ]


def _warnings(laminate: Laminate) -> tuple[str, ...]:
    said = dict.fromkeys(layer.film.warning for layer in laminate.layers)
    return tuple(filter(None, said))


def _count(count: int, noun: str) -> str:
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def _films(laminate: Laminate, pinned: bool, at: Point) -> list[str]:
    """The key: films, and the mark of a pin where one is drawn."""
    parts: list[str] = []
    films = dict.fromkeys(layer.film for layer in laminate.layers)
    for row, film in enumerate(films):
        x, y = at[0], at[1] + 3.4 + FILM_ROW * row
        fill = draw.film_fill(film)
        parts.append(draw.box((x, y), (x + 6.0, y + 3.6), fill=fill, stroke=ink(film).line))
        known = film.product.startswith(film.material)
        name = film.product if known else f"{film.material}, {film.product}"
        words = f"{name}, {number(film.thickness)} thick"
        parts.append(draw.text((x + 8.0, y + 2.8), words))
    if pinned:
        x, y = at[0] + 3.0, at[1] + 3.4 + FILM_ROW * len(films) + 1.4
        parts.append(pin_mark((x, y), 2.0))
        parts.append(draw.text((x + 5.0, y + 1.0), "dowel pin that holds the layer"))
    return parts


def _scale_bar(scale: float, end: Point) -> list[str]:
    """A bar of a round length up to 60 mm on the page, ticked, and the units."""
    length = max(step for step in (1, 2, 5, 10, 20, 50, 100, 200) if step * scale <= 60.0)
    x1, y = end[0], end[1] + 6.0
    x0 = x1 - length * scale
    ticks = 5 if length in (5, 10, 50, 100) else 4 if length in (2, 20, 200) else 2
    parts = []
    for i in range(ticks):
        a, b = x0 + (x1 - x0) * i / ticks, x0 + (x1 - x0) * (i + 1) / ticks
        fill = draw.DARK if i % 2 == 0 else "#ffffff"
        parts.append(draw.box((a, y - 0.6), (b, y + 0.6), fill=fill, stroke=draw.DARK))
    ratio = f"{number(scale)}:1" if scale >= 1 else f"1:{number(1 / scale)}"
    return [
        *parts,
        draw.text((x0, y - 1.8), "0", anchor="middle", size=draw.SMALL),
        draw.text((x1, y - 1.8), f"{length} mm", anchor="end", size=draw.SMALL),
        draw.text((x1, y + 6.6), f"scale {ratio}, all dimensions in mm", anchor="end"),
    ]
