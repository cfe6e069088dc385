"""The drawing of one pattern: exact outline, dimensions, callouts, caption."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from sbafab.geometry.edges import Bounds, Point
from sbafab.geometry.svg import number, path_data
from sbafab.laminate.inks import ink
from sbafab.laminate.laminate import Laminate, Layer, Pin
from sbafab.reports import drawing as draw
from sbafab.reports.features import (
    Circle,
    WidthDimension,
    dimensions,
    is_disc,
    layer_numbers,
    length,
)

CAPTION, LEFT, UNDER, PAD = 17.0, 11.0, 10.0, 3.0
ROW = 4.8
LEAD = 5.0


@dataclass(frozen=True)
class CardFrame:
    """Where profile coordinates land on the page."""

    left: float
    top: float
    scale: float

    def at(self, p: Point) -> Point:
        return self.left + p[0] * self.scale, self.top - p[1] * self.scale


@dataclass(frozen=True)
class Card:
    """One pattern with all that its drawing says; ``bounds`` holds phantom circles too.

    ``pins`` are the dowel pins that hold all its layers when they are laid.
    """

    layers: tuple[Layer, ...]
    pins: tuple[Pin, ...]
    marks: tuple[Circle | WidthDimension, ...]
    bounds: Bounds

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
            f"{first.film.material} film {number(first.film.thickness)}, {len(self.layers)} needed",
            f"{word} {layer_numbers([layer.index for layer in self.layers])}",
        )

    def cell(self, scale: float) -> Point:
        """Width and height in mm that the card takes on the page."""
        width = LEFT + self.size[0] * scale + self.words_width + 2 * PAD
        caption = max(map(draw.text_width, self.caption)) + 9.0
        height = max(self.size[1] * scale, ROW * len(self.marks))
        return max(width, caption), CAPTION + height + UNDER + 2 * PAD


def pattern_card(
    laminate: Laminate, layers: tuple[Layer, ...], held: Mapping[int, Sequence[Pin]]
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
    pins = tuple(pin for pin in laminate.pins if all(pin in held[x.index] for x in layers))
    if laminate.panel is not None:
        # Corner pins stand in the sheet round the part.
        pins = ()
    return Card(layers, pins, tuple(marks), (low_x, low_y, high_x, high_y))


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
                f'<circle cx="{number(cx)}" cy="{number(cy)}" r="{number(r)}" fill="none" '
                f'stroke="{draw.GREY}" stroke-width="{draw.THIN}" '
                'stroke-dasharray="3 0.8 0.6 0.8"/>'
            )
    for contour in layer.profile.holes:
        if contour.circle is not None:
            parts += _centre_mark(frame.at(contour.circle[0]), contour.circle[1] * frame.scale)
    parts += [pin_mark(frame.at(pin.centre), pin.diameter * frame.scale / 2) for pin in card.pins]
    return parts


def pin_mark(centre: Point, radius: float) -> str:
    """A dowel pin in its hole, seen from above."""
    x, y = centre
    return (
        f'<circle cx="{number(x)}" cy="{number(y)}" r="{number(0.62 * radius)}" '
        f'fill="{draw.DARK}"/>'
    )


def _centre_mark(centre: Point, radius: float) -> list[str]:
    x, y = centre
    arm = min(0.6 * radius, 1.2)
    return [
        draw.line([(x - arm, y), (x + arm, y)], colour=draw.GREY, width=0.1),
        draw.line([(x, y - arm), (x, y + arm)], colour=draw.GREY, width=0.1),
    ]


def _overall(card: Card, frame: CardFrame) -> list[str]:
    """Width below and height at the left, outside everything that is drawn."""
    profile = card.layers[0].profile
    low_x, low_y, high_x, high_y = profile.bounds
    left, top = frame.at((low_x, high_y))
    right, bottom = frame.at((high_x, low_y))
    edge_left, edge_bottom = frame.at((card.bounds[0], card.bounds[1]))
    below, beside = edge_bottom - bottom + 3.8, left - edge_left + 3.8
    width, height = length(high_x - low_x), length(high_y - low_y)
    corners = (left, bottom), (right, bottom)
    if is_disc(profile, profile.outers[0]):
        return draw.dimension(*corners, f"⌀{width}", (0.0, 1.0), below)
    return [
        *draw.dimension(*corners, width, (0.0, 1.0), below),
        *draw.dimension((left, top), (left, bottom), height, (-1.0, 0.0), beside),
    ]


def _callouts(card: Card, frame: CardFrame, column: float, room: Point) -> list[str]:
    """Words in a column at the right, each with a leader to what it measures."""
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
    """Where on the page a mark pulls its words to."""
    if isinstance(mark, WidthDimension):
        return min(frame.at(mark.start), frame.at(mark.end), key=lambda p: (-p[0], p[1]))
    if mark.phantom:
        r = mark.radius * math.sqrt(0.5)
        return frame.at((mark.centre[0] + r, mark.centre[1] - r))
    return frame.at(mark.toward or mark.centre)


def _touch(mark: Circle, frame: CardFrame, elbow: Point) -> Point:
    """Where the arrow meets the circle: radially under its leader, or on the arc itself."""
    if mark.toward is not None or mark.phantom:
        return _aim(mark, frame)
    x, y = frame.at(mark.centre)
    away = math.dist((x, y), elbow)
    r = mark.radius * frame.scale / away
    return x + r * (elbow[0] - x), y + r * (elbow[1] - y)


def cells(cards: Sequence[Card], scale: float) -> Point:
    """The cell that holds every card at this scale."""
    sizes = [card.cell(scale) for card in cards]
    return max(size[0] for size in sizes), max(size[1] for size in sizes)
