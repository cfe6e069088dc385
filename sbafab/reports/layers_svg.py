"""preview/layers.svg: every distinct pattern, dimensioned, with the quantity needed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

from sbafab.geometry.edges import Point, box_round
from sbafab.geometry.region import chain_data, coord, path_data
from sbafab.laminate.films import ink
from sbafab.laminate.folding import lies_on
from sbafab.laminate.joints import Fold, Seam
from sbafab.laminate.laminate import Laminate, Layer, Pin
from sbafab.laminate.lay_up import pins_when_added
from sbafab.reports import drawing as draw
from sbafab.reports.drawing import (
    Circle,
    Dimension,
    WidthDimension,
    balloons,
    dimensions,
    is_disc,
    layer_numbers,
    length,
)

PAGE = (420.0, 297.0)  # A3: the largest drawing
MARGIN = 10.0
BLOCK, NOTE_ROW = 22.5, 4.2
"""Height of the title block with up to one note, and of every further one."""
FILM_ROW = 5.4
SCALES = (20.0, 15.0, 12.0, 10.0, 8.0, 6.0, 5.0, 4.0, 3.0, 2.5, 2.0, 1.5, 1.0, 0.5, 0.2, 0.1)
LEAST_DRAWN = 30.0
TICKS = {1: 2, 2: 4, 5: 5, 10: 5, 20: 4, 50: 5, 100: 5, 200: 4}
"""Lengths of the scale bar, mm, and into how many parts each is divided."""
MOST_NAMES = 3  # most seams that a caption names
PAST_FOLD = 3.0  # length by which a fold's line extends past the film, mm on the page
CAPTION, LEFT, UNDER, PAD = 17.0, 11.0, 10.0, 3.0
ROW = 4.8
LEAD = 5.0


def layers_svg(laminate: Laminate) -> str:
    """Return every distinct pattern in plan at one scale, as an A3 drawing (longer if needed)."""
    holding = pins_when_added(laminate)
    cards = [Card(laminate, layers, holding) for layers in laminate.patterns.values()]
    pinned = any(card.pins for card in cards)
    keys = list(_keys(laminate, pinned))
    warnings = list(filter(None, dict.fromkeys(x.film.warning for x in laminate.layers)))
    rows = max(0, len(laminate.notes) - 1) + max(0, len(warnings) - 1)
    block = BLOCK + max(NOTE_ROW * rows, FILM_ROW * max(0, len(keys) - pinned - 2))
    scale, columns, cell, page = _grid(cards, block)
    elements: list[str] = []
    for place, card in enumerate(cards):
        row, column = divmod(place, columns)
        corner = MARGIN + column * cell[0], MARGIN + row * cell[1]
        elements += _drawn(card, scale, corner, cell)
    elements += _title_block(laminate, warnings, keys, page, block)
    elements += _scale_bar(scale, (page[0] - MARGIN - 4.0, page[1] - MARGIN - block + 6.0))
    return draw.document(*page, f"{laminate.name}: layers", elements)


def _grid(cards: Sequence[Card], block: float) -> tuple[float, int, Point, Point]:
    """Return the largest scale at which all cards fit A3 (or a longer page), the columns, and the
    sizes of a cell and of the page.
    """
    wide = PAGE[0] - 2 * MARGIN
    largest = max(max(card.size) for card in cards)
    best: tuple[float, int, Point, Point] | None = None
    for scale in SCALES:
        widths, heights = zip(*(card.cell(scale) for card in cards), strict=True)
        cell = max(widths), max(heights)
        columns = min(len(cards), math.floor(wide / cell[0]))
        if columns:
            rows = math.ceil(len(cards) / columns)
            columns = math.ceil(len(cards) / rows)
            height = rows * cell[1] + 2 * MARGIN + block
            if best is None or height <= PAGE[1] or largest * scale >= LEAST_DRAWN:
                best = scale, columns, (wide / columns, cell[1]), (PAGE[0], height)
            if height <= PAGE[1]:
                break
    page = cell[0] + 2 * MARGIN, len(cards) * cell[1] + 2 * MARGIN + block
    return best or (SCALES[-1], 1, cell, page)


def _keys(laminate: Laminate, pinned: bool) -> Iterator[tuple[str, str]]:
    """Yield symbol and name of the films, and of pins, seams and folds if there are any."""
    for film in dict.fromkeys(layer.film for layer in laminate.layers):
        distinct = film.product.startswith(film.material)
        name = film.product if distinct else f"{film.material}, {film.product}"
        sign = draw.swatch(draw.film_fill(film), ink(film).line)
        yield sign, f"{name}, {coord(film.thickness)} thick"
    if pinned:
        yield _pin((3.0, -1.0), 2.0), "dowel pin that holds the layer"
    if laminate.seams:
        tools = " or ".join(dict.fromkeys(seam.tool for seam in laminate.seams))
        sign = draw.strokes(draw.seam_styles(3.0, is_round=False))
        yield sign, f"seam: its width, and the path of the {tools}"
    if laminate.folds:
        yield draw.strokes([draw.fold_style()]), draw.FOLD


def _title_block(
    laminate: Laminate,
    warnings: Sequence[str],
    keys: Sequence[tuple[str, str]],
    page: Point,
    block: float,
) -> Iterator[str]:
    width, height = page
    x, y = low = MARGIN, height - MARGIN - block
    chambers = len(laminate.chambers)
    facts = (
        f"{laminate.family}: {balloons(laminate)}, "
        f"{chambers} chamber{'' if chambers == 1 else 's'}, {len(laminate.layers)} layers of "
        f"{len(laminate.patterns)} patterns, {coord(laminate.thickness)} thick (nominal)"
    )
    far = width - MARGIN, height - MARGIN
    yield draw.box(low, far, fill="none", stroke=draw.DARK, width=0.25)
    yield draw.text((x + 3.0, y + 7.2), laminate.name, size=4.6, bold=True)
    yield draw.text((x + 3.0, y + 12.0), facts)
    for row, note in enumerate(laminate.notes):
        yield draw.text((x + 3.0, y + 16.2 + NOTE_ROW * row), note, bold=True)
    for row, warning in enumerate(reversed(warnings)):
        yield draw.text((x + 3.0, y + block - 2.1 - NOTE_ROW * row), warning)
    for row, key in enumerate(keys):
        yield draw.key((width / 2 + 18.0, y + 6.2 + FILM_ROW * row), *key)


def _scale_bar(scale: float, end: Point) -> Iterator[str]:
    """Yield a bar with a round length of at most 60 mm on the page, with ticks, and the units."""
    long = max(step for step in TICKS if step * scale <= 60.0)
    x1, y = end
    tick, x0 = long * scale / TICKS[long], x1 - long * scale
    ratio = f"{coord(scale)}:1" if scale >= 1 else f"1:{coord(1 / scale)}"
    for n in range(TICKS[long]):
        ends = (x0 + n * tick, y - 0.6), (x0 + (n + 1) * tick, y + 0.6)
        yield draw.box(*ends, fill="#ffffff" if n % 2 else draw.DARK, stroke=draw.DARK)
    yield draw.text((x0, y - 1.8), "0", anchor="middle", size=draw.SMALL)
    yield draw.text((x1, y - 1.8), f"{long} mm", anchor="end", size=draw.SMALL)
    yield draw.text((x1, y + 6.6), f"scale {ratio}, all dimensions in mm", anchor="end")


# The drawing of one pattern: exact outline, dimensions, callouts, caption.


class Card:
    """One pattern with all content of its drawing; ``bounds`` includes phantom circles.

    ``pins`` are the dowel pins that hold all its layers during lay-up (``holding``: those of each
    layer); ``seams`` and ``folds`` join any of its layers to others.
    """

    def __init__(
        self, laminate: Laminate, layers: tuple[Layer, ...], holding: Mapping[int, Sequence[Pin]]
    ) -> None:
        self.layers = layers
        self.marks = dimensions(laminate, layers[0])
        around = [mark.radius for mark in self.marks if isinstance(mark, Circle) and mark.phantom]
        boxes = [layers[0].profile.bounds, *((-r, -r, r, r) for r in around)]
        low_x, low_y, high_x, high_y = self.bounds = box_round(boxes)
        self.size = high_x - low_x, high_y - low_y
        joined = {layer.index for layer in layers}
        self.pins = [p for p in laminate.pins if all(p in holding[x.index] for x in layers)]
        self.seams = [seam for seam in laminate.seams if joined & {seam.below, seam.above}]
        self.folds = [fold for fold in laminate.folds if joined & {fold.lower, fold.upper}]
        words = [draw.text_width(mark.words) for mark in self.marks]
        self.words_width = max(words, default=0.0) + LEAD

    @cached_property
    def caption(self) -> tuple[str, str, str]:
        first, count = self.layers[0], len(self.layers)
        roles = ", ".join(dict.fromkeys(layer.role.replace("-", " ") for layer in self.layers))
        numbers = layer_numbers([layer.index for layer in self.layers])
        joints = ", ".join(seam.name for seam in self.seams)
        if joints:
            joints = f"; seam{'s' if len(self.seams) > 1 else ''} {joints}"
        if len(self.seams) > MOST_NAMES:
            joints = f"; {len(self.seams)} seams"
        return (
            f"{first.pattern}  {roles}",
            f"{first.film.material} film {coord(first.film.thickness)}, {count} needed",
            f"layer{'' if count == 1 else 's'} {numbers}{joints}",
        )

    def cell(self, scale: float) -> Point:
        """The width and height in mm of the card on the page."""
        width = LEFT + self.size[0] * scale + self.words_width + 2 * PAD
        caption = max(map(draw.text_width, self.caption)) + 9.0
        height = max(self.size[1] * scale, ROW * len(self.marks))
        return max(width, caption), CAPTION + height + UNDER + 2 * PAD


class CardFrame(NamedTuple):
    """The position of profile coordinates on the page."""

    left: float
    top: float
    scale: float

    def at(self, p: Point) -> Point:
        return self.left + p[0] * self.scale, self.top - p[1] * self.scale


def _drawn(card: Card, scale: float, corner: Point, cell: Point) -> Iterator[str]:
    """Yield the card's elements, in a cell whose upper left corner is given."""
    x, y = corner
    low_x, _, high_x, high_y = card.bounds
    spare_x = cell[0] - LEFT - card.size[0] * scale - card.words_width
    spare_y = cell[1] - CAPTION - UNDER - card.size[1] * scale
    left, top = x + LEFT + spare_x / 2, y + CAPTION + spare_y / 2
    frame = CardFrame(left - low_x * scale, top + high_y * scale, scale)
    column = frame.at((high_x, 0.0))[0] + LEAD
    yield f'<g id="{card.layers[0].pattern}">'
    yield from _heading(card, corner, cell)
    yield from _outline(card, frame)
    for seam in card.seams:
        yield from _seam(seam, frame)
    for fold in card.folds:
        yield from _fold(fold, card.layers[0], frame)
    yield from _overall(card, frame)
    yield from _callouts(card, frame, column, (y + CAPTION + 2.0, y + cell[1] - UNDER))
    yield "</g>"


def _heading(card: Card, corner: Point, cell: Point) -> Iterator[str]:
    (x, y), film = corner, card.layers[0].film
    line = ink(film).line
    name, material, numbers = card.caption
    yield draw.box(corner, (x + cell[0], y + cell[1]), fill="none", stroke="#c8c8c8")
    yield draw.box((x + 2.5, y + 2.7), (x + 5.0, y + 5.2), fill=draw.film_fill(film), stroke=line)
    yield draw.text((x + 6.5, y + 5.0), name, bold=True)
    yield draw.text((x + 6.5, y + 9.4), material, colour=line)
    yield draw.text((x + 6.5, y + 13.6), numbers)


def _outline(card: Card, frame: CardFrame) -> Iterator[str]:
    """Yield the profile, phantom circles around it, centre marks of its holes, and pins."""
    layer, scale = card.layers[0], frame.scale
    shape = layer.profile.mapped(frame.at, scale, mirror=True)
    look = draw.style(ink(layer.film).line, 0.25, fill=draw.film_fill(layer.film))
    yield draw.path(path_data(shape), look)
    for mark in card.marks:
        if isinstance(mark, Circle) and mark.phantom:
            phantom = draw.style(draw.GREY, dashes="3 0.8 0.6 0.8")
            yield draw.circle(frame.at(mark.centre), mark.radius * scale, phantom)
    for hole in layer.profile.holes:
        if hole.circle is not None:
            (x, y), arm = frame.at(hole.circle[0]), min(0.6 * hole.circle[1] * scale, 1.2)
            yield draw.line([(x - arm, y), (x + arm, y)], colour=draw.GREY, width=0.1)
            yield draw.line([(x, y - arm), (x, y + arm)], colour=draw.GREY, width=0.1)
    for pin in card.pins:
        yield _pin(frame.at(pin.centre), pin.diameter * scale / 2)


def _pin(centre: Point, radius: float) -> str:
    """Return a dowel pin in its hole, seen from above."""
    return draw.circle(centre, 0.62 * radius, f'fill="{draw.DARK}"')


def _seam(seam: Seam, frame: CardFrame) -> Iterator[str]:
    """Yield a seam at its bond width, and the path of its tool."""
    data = "".join(
        f"{chain_data(chain)}{'Z' if chain[0].start == chain[-1].end else ''}"
        for chain in seam.path
    )
    x, y, scale = map(coord, frame)
    yield f'<g transform="translate({x} {y}) scale({scale} -{scale})">'
    for look in draw.seam_styles(seam.width, draw.THIN / frame.scale, seam.tool != "roller"):
        yield draw.path(data, look)
    yield "</g>"


def _fold(fold: Fold, layer: Layer, frame: CardFrame) -> Iterator[str]:
    """Yield a fold line along the edges of a layer that end there, and past them."""
    for edge in layer.profile.edges:
        if lies_on(edge, [fold.line]):
            (x, y), (u, v) = frame.at(edge.start), frame.at(edge.end)
            past = PAST_FOLD / math.dist((x, y), (u, v))
            dx, dy = past * (u - x), past * (v - y)
            ends = f"M{coord(x - dx)} {coord(y - dy)}L{coord(u + dx)} {coord(v + dy)}"
            yield draw.path(ends, draw.fold_style())


def _overall(card: Card, frame: CardFrame) -> list[str]:
    """Return width below and height at the left, outside the whole drawing."""
    profile = card.layers[0].profile
    low_x, low_y, high_x, high_y = profile.bounds
    (x0, top), (right, bottom) = frame.at((low_x, high_y)), frame.at((high_x, low_y))
    edge_left, edge_bottom = frame.at((card.bounds[0], card.bounds[1]))
    below, beside = edge_bottom - bottom + 3.8, x0 - edge_left + 3.8
    corners, width = ((x0, bottom), (right, bottom)), length(high_x - low_x)
    if is_disc(profile, profile.outers[0]):
        return draw.dimension(*corners, f"⌀{width}", (0.0, 1.0), below)
    sides, height = ((x0, top), (x0, bottom)), length(high_y - low_y)
    across = draw.dimension(*corners, width, (0.0, 1.0), below)
    return across + draw.dimension(*sides, height, (-1.0, 0.0), beside)


def _callouts(card: Card, frame: CardFrame, column: float, room: Point) -> Iterator[str]:
    """Yield labels in a column at the right, each with a leader to its feature."""
    aims = sorted(((_aim(mark, frame), mark) for mark in card.marks), key=lambda item: item[0][1])
    rows = draw.spread([aim[1] for aim, _ in aims], ROW, *room)
    for (aim, mark), row in zip(aims, rows, strict=True):
        elbow, label = (column - 1.6, row), (column - 0.4, row)
        yield draw.text((column, row + 1.05), mark.words)
        if isinstance(mark, WidthDimension):
            yield from draw.across(frame.at(mark.start), frame.at(mark.end))
            yield draw.line([aim, elbow, label], colour=draw.GREY)
            continue
        (x, y), r = aim, 0.0
        if mark.toward is None and not mark.phantom:
            # The arrow meets the circle radially under its leader.
            r = mark.radius * frame.scale / math.dist(aim, elbow)
        tip = x + r * (elbow[0] - x), y + r * (elbow[1] - y)
        yield from draw.leader(tip, elbow, label, dot=False)


def _aim(mark: Dimension, frame: CardFrame) -> Point:
    """Return the target point on the page for the label of a mark."""
    if isinstance(mark, WidthDimension):
        return min(frame.at(mark.start), frame.at(mark.end), key=lambda p: (-p[0], p[1]))
    if mark.phantom:
        r = mark.radius * math.sqrt(0.5)
        return frame.at((mark.centre[0] + r, mark.centre[1] - r))
    return frame.at(mark.toward or mark.centre)
