"""preview/layers.svg: every distinct pattern, dimensioned, with how many are needed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from sbafab.geometry.edges import Bounds, Point
from sbafab.geometry.region import chain_data, coord, path_data
from sbafab.laminate.assembly import pins_when_added
from sbafab.laminate.films import ink
from sbafab.laminate.folding import lies_on
from sbafab.laminate.joints import Fold, Seam
from sbafab.laminate.laminate import Laminate, Layer, Pin
from sbafab.reports import drawing as draw
from sbafab.reports.drawing import (
    Circle,
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


@dataclass(frozen=True)
class PageGrid:
    """Equal cells on a page, and the scale of everything drawn in them."""

    scale: float
    columns: int
    cell: Point
    page: Point


def layers_svg(laminate: Laminate) -> str:
    """Every distinct pattern in plan at one scale, as a drawing for A3 (longer if need be)."""
    holding = pins_when_added(laminate)
    cards = [pattern_card(laminate, layers, holding) for layers in laminate.patterns.values()]
    films = dict.fromkeys(layer.film for layer in laminate.layers)
    rows = max(0, len(laminate.notes) - 1) + max(0, len(_warnings(laminate)) - 1)
    keyed = len(films) + bool(laminate.seams) + bool(laminate.folds)
    block = BLOCK + max(NOTE_ROW * rows, FILM_ROW * max(0, keyed - 2))
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
        f"{len(laminate.patterns)} patterns, {coord(laminate.thickness)} thick (nominal)"
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
            draw.text((x + 3.0, y + block - 2.1 - NOTE_ROW * row), warning)
            for row, warning in enumerate(reversed(_warnings(laminate) or ("",)))
        ),
        *_films(laminate, pinned, (width / 2 + 18.0, y)),
        *_scale_bar(grid.scale, (width - MARGIN - 4.0, y)),
    ]


def _warnings(laminate: Laminate) -> tuple[str, ...]:
    warnings = dict.fromkeys(layer.film.warning for layer in laminate.layers)
    return tuple(filter(None, warnings))


def _count(count: int, noun: str) -> str:
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def _films(laminate: Laminate, pinned: bool, at: Point) -> list[str]:
    """The key: films, and the marks of pins, seams and folds if there are any."""
    parts: list[str] = []
    films = dict.fromkeys(layer.film for layer in laminate.layers)
    for row, film in enumerate(films):
        x, y = at[0], at[1] + 3.4 + FILM_ROW * row
        fill = draw.film_fill(film)
        parts.append(draw.box((x, y), (x + 6.0, y + 3.6), fill=fill, stroke=ink(film).line))
        distinct = film.product.startswith(film.material)
        name = film.product if distinct else f"{film.material}, {film.product}"
        words = f"{name}, {coord(film.thickness)} thick"
        parts.append(draw.text((x + 8.0, y + 2.8), words))
    if pinned:
        x, y = at[0] + 3.0, at[1] + 3.4 + FILM_ROW * len(films) + 1.4
        parts.append(pin_mark((x, y), 2.0))
        parts.append(draw.text((x + 5.0, y + 1.0), "dowel pin that holds the layer"))
    middle, row = f"of the {_tools(laminate)}", len(films) + pinned
    for styles, words, is_drawn in (
        (
            draw.seam_styles(3.0, is_round=False),
            f"seam: its width, and the path {middle}",
            bool(laminate.seams),
        ),
        ((draw.fold_style(),), "fold: the film goes on in its other half", bool(laminate.folds)),
    ):
        if is_drawn:
            x, y = at[0], at[1] + 3.4 + FILM_ROW * row + 1.8
            parts += [f'<path d="M{coord(x)} {coord(y)}h6" {style}/>' for style in styles]
            parts.append(draw.text((x + 8.0, y + 1.0), words))
            row += 1
    return parts


def _tools(laminate: Laminate) -> str:
    return " or ".join(dict.fromkeys(seam.tool for seam in laminate.seams))


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
    ratio = f"{coord(scale)}:1" if scale >= 1 else f"1:{coord(1 / scale)}"
    return [
        *parts,
        draw.text((x0, y - 1.8), "0", anchor="middle", size=draw.SMALL),
        draw.text((x1, y - 1.8), f"{length} mm", anchor="end", size=draw.SMALL),
        draw.text((x1, y + 6.6), f"scale {ratio}, all dimensions in mm", anchor="end"),
    ]


# The drawing of one pattern: exact outline, dimensions, callouts, caption.


MOST_NAMES = 3
"""Most seams that a caption names."""
PAST_FOLD = 3.0
"""Length by which a fold's line extends past the film, mm on the page."""
CAPTION, LEFT, UNDER, PAD = 17.0, 11.0, 10.0, 3.0
ROW = 4.8
LEAD = 5.0


@dataclass(frozen=True)
class CardFrame:
    """The place of profile coordinates on the page."""

    left: float
    top: float
    scale: float

    def at(self, p: Point) -> Point:
        return self.left + p[0] * self.scale, self.top - p[1] * self.scale


@dataclass(frozen=True)
class Card:
    """One pattern with all content of its drawing; ``bounds`` includes phantom circles.

    ``pins`` are the dowel pins that hold all its layers when they are laid; ``seams`` and ``folds``
    join any of its layers to others.
    """

    layers: tuple[Layer, ...]
    pins: tuple[Pin, ...]
    marks: tuple[Circle | WidthDimension, ...]
    bounds: Bounds
    seams: tuple[Seam, ...] = ()
    folds: tuple[Fold, ...] = ()

    @property
    def size(self) -> Point:
        low_x, low_y, high_x, high_y = self.bounds
        return high_x - low_x, high_y - low_y

    @cached_property
    def words_width(self) -> float:
        return max((draw.text_width(mark.words) for mark in self.marks), default=0.0) + LEAD

    @cached_property
    def caption(self) -> tuple[str, str, str]:
        first = self.layers[0]
        roles = ", ".join(dict.fromkeys(layer.role.replace("-", " ") for layer in self.layers))
        word = "layer" if len(self.layers) == 1 else "layers"
        return (
            f"{first.pattern}  {roles}",
            f"{first.film.material} film {coord(first.film.thickness)}, {len(self.layers)} needed",
            f"{word} {layer_numbers([layer.index for layer in self.layers])}{self._seam_words}",
        )

    @property
    def _seam_words(self) -> str:
        if not self.seams:
            return ""
        names = ", ".join(seam.name for seam in self.seams)
        if len(self.seams) == 1:
            return f"; seam {names}"
        return f"; seams {names}" if len(self.seams) <= MOST_NAMES else f"; {len(self.seams)} seams"

    def cell(self, scale: float) -> Point:
        """Width and height in mm that the card takes on the page."""
        width = LEFT + self.size[0] * scale + self.words_width + 2 * PAD
        caption = max(map(draw.text_width, self.caption)) + 9.0
        height = max(self.size[1] * scale, ROW * len(self.marks))
        return max(width, caption), CAPTION + height + UNDER + 2 * PAD


def pattern_card(
    laminate: Laminate, layers: tuple[Layer, ...], holding: Mapping[int, Sequence[Pin]]
) -> Card:
    """The card of the layers that share one pattern; ``held`` says which pins hold each layer."""
    profile = layers[0].profile
    marks = dimensions(laminate, layers[0])
    low_x, low_y, high_x, high_y = profile.bounds
    around = next((mark for mark in marks if isinstance(mark, Circle) and mark.phantom), None)
    if around is not None:
        r = around.radius
        low_x, low_y, high_x, high_y = (
            min(low_x, -r),
            min(low_y, -r),
            max(high_x, r),
            max(high_y, r),
        )
    pins = tuple(pin for pin in laminate.pins if all(pin in holding[x.index] for x in layers))
    joined = {layer.index for layer in layers}
    return Card(
        layers,
        pins,
        tuple(marks),
        (low_x, low_y, high_x, high_y),
        tuple(seam for seam in laminate.seams if joined & {seam.below, seam.above}),
        tuple(fold for fold in laminate.folds if joined & {fold.lower, fold.upper}),
    )


def drawn(card: Card, scale: float, corner: Point, cell: Point) -> list[str]:
    """The card's elements, in a cell whose upper left corner is given."""
    x, y = corner
    low_x, _, high_x, high_y = card.bounds
    width, height = card.size[0] * scale, card.size[1] * scale
    spare_x = cell[0] - LEFT - width - card.words_width
    spare_y = cell[1] - CAPTION - UNDER - height
    frame = CardFrame(
        x + LEFT + spare_x / 2 - low_x * scale,
        y + CAPTION + spare_y / 2 + high_y * scale,
        scale,
    )
    column = frame.at((high_x, 0.0))[0] + LEAD
    return [
        f'<g id="{card.layers[0].pattern}">',
        *_heading(card, corner, cell),
        *_outline(card, frame),
        *_joints(card, frame),
        *_overall(card, frame),
        *_callouts(card, frame, column, (y + CAPTION + 2.0, y + cell[1] - UNDER)),
        "</g>",
    ]


def fill_of(layer: Layer) -> str:
    """Plain for structural films, hatched for masks."""
    return draw.film_fill(layer.film)


def _heading(card: Card, corner: Point, cell: Point) -> list[str]:
    x, y = corner
    layer = card.layers[0]
    line = ink(layer.film).line
    name, film, numbers = card.caption
    return [
        draw.box(corner, (x + cell[0], y + cell[1]), fill="none", stroke="#c8c8c8"),
        draw.box((x + 2.5, y + 2.7), (x + 5.0, y + 5.2), fill=fill_of(layer), stroke=line),
        draw.text((x + 6.5, y + 5.0), name, bold=True),
        draw.text((x + 6.5, y + 9.4), film, colour=line),
        draw.text((x + 6.5, y + 13.6), numbers),
    ]


def _outline(card: Card, frame: CardFrame) -> list[str]:
    layer = card.layers[0]
    shape = layer.profile.mapped(frame.at, frame.scale, mirror=True)
    parts = [
        f'<path d="{path_data(shape)}" fill="{fill_of(layer)}" fill-rule="evenodd" '
        f'stroke="{ink(layer.film).line}" stroke-width="0.25"/>'
    ]
    for mark in card.marks:
        if isinstance(mark, Circle) and mark.phantom:
            (cx, cy), r = frame.at(mark.centre), mark.radius * frame.scale
            parts.append(
                f'<circle cx="{coord(cx)}" cy="{coord(cy)}" r="{coord(r)}" fill="none" '
                f'stroke="{draw.GREY}" stroke-width="{draw.THIN}" '
                'stroke-dasharray="3 0.8 0.6 0.8"/>'
            )
    for contour in layer.profile.holes:
        if contour.circle is not None:
            parts += _centre_mark(frame.at(contour.circle[0]), contour.circle[1] * frame.scale)
    parts += [pin_mark(frame.at(pin.centre), pin.diameter * frame.scale / 2) for pin in card.pins]
    return parts


def _joints(card: Card, frame: CardFrame) -> list[str]:
    """Seams as wide as they bond, with their paths, and the lines of folds."""
    folds = (part for fold in card.folds for part in _fold(fold, card.layers[0], frame))
    return [*(part for seam in card.seams for part in _seam(seam, frame)), *folds]


def _seam(seam: Seam, frame: CardFrame) -> list[str]:
    data = "".join(
        f"{chain_data(chain)}{'Z' if chain[0].start == chain[-1].end else ''}"
        for chain in seam.path
    )
    styles = draw.seam_styles(seam.width, draw.THIN / frame.scale, seam.tool != "roller")
    x, y, scale = coord(frame.left), coord(frame.top), coord(frame.scale)
    return [
        f'<g transform="translate({x} {y}) scale({scale} -{scale})">',
        *(f'<path d="{data}" {style}/>' for style in styles),
        "</g>",
    ]


def _fold(fold: Fold, layer: Layer, frame: CardFrame) -> list[str]:
    """The line of a fold along the edges of a layer that end there, and past them."""
    parts = []
    for edge in layer.profile.edges:
        if lies_on(edge, [fold.line]):
            (x, y), (u, v) = frame.at(edge.start), frame.at(edge.end)
            past = PAST_FOLD / math.dist((x, y), (u, v))
            dx, dy = past * (u - x), past * (v - y)
            ends = f"M{coord(x - dx)} {coord(y - dy)}L{coord(u + dx)} {coord(v + dy)}"
            parts.append(f'<path d="{ends}" {draw.fold_style()}/>')
    return parts


def pin_mark(centre: Point, radius: float) -> str:
    """A dowel pin in its hole, seen from above."""
    x, y = centre
    return (
        f'<circle cx="{coord(x)}" cy="{coord(y)}" r="{coord(0.62 * radius)}" fill="{draw.DARK}"/>'
    )


def _centre_mark(centre: Point, radius: float) -> list[str]:
    x, y = centre
    arm = min(0.6 * radius, 1.2)
    return [
        draw.line([(x - arm, y), (x + arm, y)], colour=draw.GREY, width=0.1),
        draw.line([(x, y - arm), (x, y + arm)], colour=draw.GREY, width=0.1),
    ]


def _overall(card: Card, frame: CardFrame) -> list[str]:
    """Width below and height at the left, outside the whole drawing."""
    profile = card.layers[0].profile
    low_x, low_y, high_x, high_y = profile.bounds
    x0, top = frame.at((low_x, high_y))
    right, bottom = frame.at((high_x, low_y))
    edge_left, edge_bottom = frame.at((card.bounds[0], card.bounds[1]))
    below, beside = edge_bottom - bottom + 3.8, x0 - edge_left + 3.8
    width, height = length(high_x - low_x), length(high_y - low_y)
    corners = (x0, bottom), (right, bottom)
    if is_disc(profile, profile.outers[0]):
        return draw.dimension(*corners, f"⌀{width}", (0.0, 1.0), below)
    return [
        *draw.dimension(*corners, width, (0.0, 1.0), below),
        *draw.dimension((x0, top), (x0, bottom), height, (-1.0, 0.0), beside),
    ]


def _callouts(card: Card, frame: CardFrame, column: float, room: Point) -> list[str]:
    """Labels in a column at the right, each with a leader to its feature."""
    aims = sorted(((_aim(mark, frame), mark) for mark in card.marks), key=lambda item: item[0][1])
    rows = draw.spread([aim[1] for aim, _ in aims], ROW, *room)
    parts: list[str] = []
    for (aim, mark), row in zip(aims, rows, strict=True):
        elbow, label = (column - 1.6, row), (column - 0.4, row)
        parts.append(draw.text((column, row + 1.05), mark.words))
        if isinstance(mark, WidthDimension):
            start, end = frame.at(mark.start), frame.at(mark.end)
            parts += draw.across(start, end)
            parts.append(draw.line([aim, elbow, label], colour=draw.GREY))
        else:
            parts += draw.leader(_touch(mark, frame, elbow), elbow, label, dot=False)
    return parts


def _aim(mark: Circle | WidthDimension, frame: CardFrame) -> Point:
    """Return the point on the page that a mark's label should be near."""
    if isinstance(mark, WidthDimension):
        return min(frame.at(mark.start), frame.at(mark.end), key=lambda p: (-p[0], p[1]))
    if mark.phantom:
        r = mark.radius * math.sqrt(0.5)
        return frame.at((mark.centre[0] + r, mark.centre[1] - r))
    return frame.at(mark.toward or mark.centre)


def _touch(mark: Circle, frame: CardFrame, elbow: Point) -> Point:
    """Return point where the arrow meets the circle: radially under its leader, or on the arc."""
    if mark.toward is not None or mark.phantom:
        return _aim(mark, frame)
    x, y = frame.at(mark.centre)
    away = math.dist((x, y), elbow)
    r = mark.radius * frame.scale / away
    return x + r * (elbow[0] - x), y + r * (elbow[1] - y)


def cells(cards: Sequence[Card], scale: float) -> Point:
    """The cell size that holds every card at this scale."""
    sizes = [card.cell(scale) for card in cards]
    return max(size[0] for size in sizes), max(size[1] for size in sizes)
