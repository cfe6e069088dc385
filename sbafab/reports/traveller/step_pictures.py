"""The pictures of a press step: from above, taken apart, and as a section from platen to platen."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sbafab.cutting.fixture import shown
from sbafab.geometry.cache import cached
from sbafab.geometry.edges import Bounds, Point
from sbafab.geometry.region import coord, section
from sbafab.laminate.laminate import Inlet, Laminate, Layer, Pin
from sbafab.laminate.lay_up import LayUpStep, distinct_layers, stack_count
from sbafab.pressing.build_up import BASE_PLATE, PAD, RELEASE, UNDERLAY
from sbafab.pressing.dowels import PinSetting, push_out
from sbafab.pressing.schedule import Step
from sbafab.reports import drawing as draw
from sbafab.reports.drawing import layer_numbers
from sbafab.reports.traveller.formatting import millimetres, stacks, temperature
from sbafab.reports.traveller.shapes import (
    Bed,
    Picture,
    Round,
    flat,
    inlets_in,
    label,
    pattern_id,
    rounds,
)

DIRECTIONS = 16
STEPS = (0.0, 2.0, 4.0, 6.5, 9.0)
"""Distances of a name from touching its place, mm."""
LED = 1.5
"""Distance from which a thin line leads from the name to its place, mm."""
ASIDE, FAR, OUTSIDE = 0.4, 0.25, 4.0
"""Cost of a name out of its direction, of a mm of distance, and of a mm2 outside the picture, in
mm2 of covering."""


# Names beside the places of a picture, covering neither each other nor the places.


class PlanName(NamedTuple):
    """A name to put beside ``at``, a place ``clear`` mm around, best in the direction ``out``."""

    words: str
    at: Point
    clear: float
    out: Point


def named(names: list[PlanName], size: float, room: Bounds, taken: list[Bounds]) -> list[str]:
    """Return the names as SVG, each where it covers least of ``taken`` and of earlier names."""
    taken, drawn = list(taken), []
    away = np.repeat(STEPS, DIRECTIONS)
    turns = np.tile(2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS, len(STEPS))
    for name in names:
        half = np.array([draw.text_width(name.words, size) / 2, size / 2])
        turn = turns + math.atan2(name.out[1], name.out[0])
        way = np.stack([np.cos(turn), np.sin(turn)], axis=1)
        middles = np.array(name.at) + (name.clear + away[:, None] + half) * way
        boxes = np.concatenate([middles - half, middles + half], axis=1)
        covered = sum(_shared(boxes, box) for box in taken)
        outside = 4 * half[0] * half[1] - _shared(boxes, room)
        off = middles - name.at
        along = off @ np.array(name.out) / np.linalg.norm(off, axis=1)
        cost = covered + OUTSIDE * outside + ASIDE * (1 - along) + FAR * away
        best = int(np.argmin(cost.round(6)))
        x, y = middles[best].tolist()
        taken.append(tuple(boxes[best].tolist()))
        if away[best] >= LED:
            drawn.append(draw.line([name.at, (x, y)], width=0.12))
        drawn.append(label((x, y + 0.35 * size), name.words, size))
    return drawn


def _shared(boxes: NDArray[np.float64], other: Bounds) -> NDArray[np.float64]:
    """Return the area that each box shares with another one, mm2."""
    low = np.maximum(boxes[:, :2], other[:2])
    high = np.minimum(boxes[:, 2:], other[2:])
    shared: NDArray[np.float64] = np.prod(np.clip(high - low, 0, None), axis=1)
    return shared


# The step seen from above: plate, layers, pins in or out, inlet tabs.


WIDEST, TALLEST = 64.0, 28.0
NARROWEST = 66.0
"""Room for the text under the picture, mm."""
EDGE, HEAD, FOOT = 5.0, 5.0, 5.5
NAMES = 2.0
"""Height of the names of pins and chambers, mm."""
FREE = 6.0
"""Margin around a laminate without a base plate, mm."""

KEY = 19.0
"""Height of the line of pin marks under the picture, mm."""
AT_DATUM = 1e-3
"""Distance from the datum within which a pin hides it, mm."""


PINS = {
    is_in: draw.style(draw.DARK, 0.3, fill=draw.DARK if is_in else "#ffffff")
    for is_in in (True, False)
}
"""Looks of a pin that is in, and of one that is not."""
_section = cached(section)
"""Every step of a laminate needs the same."""


class _View(NamedTuple):
    """The scale and the bounds (mm of the laminate) of a step seen from above."""

    bounds: Bounds
    scale: float

    @property
    def width(self) -> float:
        return max((self.bounds[2] - self.bounds[0]) * self.scale + 2 * EDGE, NARROWEST)

    @property
    def height(self) -> float:
        return (self.bounds[3] - self.bounds[1]) * self.scale + HEAD + FOOT

    @property
    def origin(self) -> Point:
        return EDGE - self.bounds[0] * self.scale, HEAD + self.bounds[3] * self.scale

    def at(self, p: Point) -> Point:
        x, y = self.origin
        return x + p[0] * self.scale, y - p[1] * self.scale


def _view(bounds: Bounds) -> _View:
    low_x, low_y, high_x, high_y = bounds
    return _View(bounds, min(WIDEST / (high_x - low_x), TALLEST / (high_y - low_y)))


def plan(laminate: Laminate, step: LayUpStep, lying: tuple[Bed, ...], name: str) -> str:
    """Return the step from above; earlier stacks grey, new layers in their film's colour."""
    plate = shown(laminate)
    low_x, low_y, high_x, high_y = laminate.bounds
    wide = low_x - FREE, low_y - FREE, high_x + FREE, high_y + FREE
    view = _view(wide if plate is None else plate.bounds)
    matrix, is_pinned = flat(view.scale, view.origin), bool(step.pins)
    state = "pins in" if is_pinned else "no pins"
    words = f"step {step.number} from above, {state}; the text beside it says the same"
    picture = Picture(name, view.width, view.height, words)
    if plate is not None:
        picture.plate(plate, matrix, is_pinned)
    for bed in lying:
        look = "made" if bed.made_in else "clear"
        for layer in distinct_layers(laminate, bed.layers):
            picture.part(pattern_id(layer.pattern), layer.film, matrix, look)
    inlets = inlets_in(laminate, step.layers)
    # An arrow at its tab also names the pin of a chamber.
    arrow_names = {inlet.chamber for inlet in inlets}
    names, taken = [], []
    for pin in laminate.pins:
        at, radius = view.at(pin.centre), max(pin.diameter * view.scale / 2, 0.7)
        picture.add(draw.circle(at, radius, PINS[pin in step.pins]))
        taken.append((at[0] - radius, at[1] - radius, at[0] + radius, at[1] + radius))
        if pin in step.pins and pin.name not in arrow_names:
            names.append(PlanName(pin.name, at, radius + 0.6, _outward(pin)))
    arrows = []
    for inlet in inlets:
        start, tip = _arrow(inlet, _reach(laminate, inlet), view)
        (u, v), xs, ys = inlet.direction, (start[0], tip[0]), (start[1], tip[1])
        picture.add(draw.line([start, tip], width=0.35), draw.arrow(tip, (u, -v)))
        taken.append((min(xs) - 0.7, min(ys) - 0.7, max(xs) + 0.7, max(ys) + 0.7))
        arrows.append(PlanName(inlet.chamber, tip, 0.9, (u, -v)))
    room = 0.5, HEAD + 0.3, view.width - 0.5, view.height - FOOT + 1.0
    picture.add(*named([*arrows, *names], NAMES, room, taken))
    picture.add(*_datum(view, step, plate is not None))
    if plate is not None:
        picture.add(*_captions(view, is_pinned))
    return picture.svg()


def _outward(pin: Pin) -> Point:
    """Return the direction on the page from the datum to a pin; upward for the pin at the datum."""
    far = math.hypot(*pin.centre)
    return (pin.centre[0] / far, -pin.centre[1] / far) if far > AT_DATUM else (0.0, -1.0)


def _reach(laminate: Laminate, inlet: Inlet) -> float:
    """Return the largest distance in mm by which an inlet's strip passes its mouth."""
    shapes = (layers[0].profile for layers in laminate.patterns.values())
    spans = [span for shape in shapes for span in _section(shape, inlet.mouth, inlet.direction)]
    return max((end for _, end in spans), default=0.0)


def _arrow(inlet: Inlet, reach: float, view: _View) -> tuple[Point, Point]:
    """Return start and tip of an arrow outward from the end of the tab and its strip."""
    u, v = inlet.direction
    (x, y), v = view.at((inlet.mouth[0] + reach * u, inlet.mouth[1] + reach * v)), -v
    return (x + 0.8 * u, y + 0.8 * v), (x + 4.0 * u, y + 4.0 * v)


def _datum(view: _View, step: LayUpStep, has_plate: bool) -> list[str]:
    """Return the cross at the actuator's axis, as in every cut file, unless a pin stands there, and
    its words under the picture.
    """
    at = EDGE + KEY * has_plate, view.height - 1.2
    for pin in step.pins:
        if math.hypot(*pin.centre) < AT_DATUM:
            return [draw.text(at, f"datum: middle of pin {pin.name}", size=2.2)]
    x, y = view.origin
    return [
        draw.line([(x - 1.6, y), (x + 1.6, y)], width=0.2),
        draw.line([(x, y - 1.6), (x, y + 1.6)], width=0.2),
        draw.text(at, "+ datum", size=2.2),
    ]


def _captions(view: _View, is_pinned: bool) -> list[str]:
    """Return the key of the pins under the picture, and the words on the plate above it."""
    y = view.height - 1.2
    words = "on the base plate, cut corner back right" if is_pinned else "no pins"
    return [
        draw.circle((EDGE + 0.8, y - 0.8), 0.8, PINS[True]),
        draw.text((EDGE + 2.4, y), "pin", size=2.2),
        draw.circle((EDGE + 8.0, y - 0.8), 0.8, PINS[False]),
        draw.text((EDGE + 9.6, y), "no pin", size=2.2),
        draw.text((EDGE, HEAD - 1.2), f"from above, {words}", size=2.2),
    ]


# The step taken apart: every layer or finished stack in its place over the plate.


WIDE = 58.0
TILT = 0.34
"""Foreshortening of a layer's depth, seen from the front and above."""
LABELS = 50.0
TALLEST_STACK = 40.0
NEAREST, FARTHEST, TWO_LINES = 4.0, 10.0, 6.0
COLUMN, BRACKET = 4.0, 13.0
"""mm from the layers to their labels, and for a bracket with its count."""
BOLD = 1.25
"""Largest ratio of the width of bold letters to normal ones."""
PAGE = 1.1
"""mm on the page between the layers of a finished stack."""
MOST = 20
TOP, STACK_FOOT = 5.0, 2.0
DEEP = 32.0
STANDS_OUT = 4.0
"""Height of a pin above the highest level, mm on the page."""


@dataclass(frozen=True)
class Level:
    """The layers at one height, drawn on each other, and their label.

    ``made``: bonded in an earlier step; ``round``: laid repeatedly.
    """

    layers: tuple[Layer, ...]
    words: str
    detail: str
    made: bool
    round: Round | None = None


@dataclass(frozen=True)
class _Tilted:
    """The view of a step taken apart: the laminate's origin is at ``middle`` and ``ground``."""

    scale: float
    middle: float
    ground: float
    gap: float
    height: float
    plate: bool

    def matrix(self, height: float) -> tuple[float, ...]:
        """Return the matrix from a layer's plan to the page, its origin at a page height."""
        return self.scale, 0.0, 0.0, -self.scale * TILT, self.middle, height

    def level(self, place: int) -> float:
        """Return the page height of a level, counted from the lowest; the plate is below all."""
        return self.ground - self.gap * (place + self.plate)


def exploded(laminate: Laminate, step: LayUpStep, lying: Sequence[Bed], name: str) -> str:
    """Return the step's layers one above the other, lowest first, with numbers and patterns.

    They are drawn from the front and above, so that outlines and tabs show the orientation of each.
    """
    levels = _shortened([level for bed in lying for level in _levels(laminate, bed)])
    plate = shown(laminate) if step.pins else None
    view = _tilted(plate.bounds if plate is not None else laminate.bounds, len(levels), bool(plate))
    words = "; ".join(f"{level.words} {level.detail}" for level in levels)
    width = WIDE + _labels(levels, view.gap)
    picture = Picture(name, width, view.height, f"step {step.number} taken apart: {words}")
    if plate is not None:
        picture.plate(plate, view.matrix(view.ground))
        edge = view.middle + plate.bounds[2] * view.scale, view.ground
        picture.add(*_beside(edge, "base plate", "cut corner: back right", view.gap))
    under = view.ground
    for place, level in enumerate(levels):
        here = view.level(place)
        picture.add(*_pin_stretches(step.pins, view, under, here))
        look = "made" if level.made else "fresh"
        for lift, layer in enumerate(level.layers):
            matrix = view.matrix(here - PAGE * lift)
            picture.part(pattern_id(layer.pattern), layer.film, matrix, look)
        reach = max(layer.profile.bounds[2] for layer in level.layers)
        edge = view.middle + reach * view.scale, here
        picture.add(*_beside(edge, level.words, level.detail, view.gap))
        under = here - PAGE * (len(level.layers) - 1)
    picture.add(*_pin_stretches(step.pins, view, under, under - STANDS_OUT))
    picture.add(*_brackets(levels, view, width))
    return picture.svg()


def _tilted(bounds: Bounds, levels: int, plate: bool) -> _Tilted:
    low_x, low_y, high_x, high_y = bounds
    scale = min(WIDE / (high_x - low_x), DEEP / ((high_y - low_y) * TILT))
    depth = (high_y - low_y) * scale * TILT
    between = max(levels - (not plate), 1)
    gap = min(max((TALLEST_STACK - depth) / between, NEAREST), FARTHEST)
    height = TOP + depth + gap * between + STACK_FOOT
    middle = WIDE / 2 - (low_x + high_x) / 2 * scale
    return _Tilted(scale, middle, height - STACK_FOOT + low_y * scale * TILT, gap, height, plate)


def _levels(laminate: Laminate, bed: Bed) -> Iterator[Level]:
    if bed.made_in is not None:
        shown = distinct_layers(laminate, bed.layers)[:4]
        words = f"layers {layer_numbers(bed.layers)}"
        many = stack_count(laminate, bed.layers)
        yield Level(shown, words, f"the {stacks(many)} from step {bed.made_in}", True)
        return
    for turn in rounds([laminate.layer(index) for index in bed.layers]):
        for place in turn.places:
            first = place[0]
            numbers = layer_numbers([layer.index for layer in place])
            detail = f"{first.film.material} {first.role.replace('-', ' ')} {first.pattern}"
            yield Level((first,), numbers, detail, False, turn if turn.count > 1 else None)


def _shortened(levels: list[Level]) -> list[Level]:
    """Return the levels to draw, few enough; the lay-up table has them all."""
    if len(levels) <= MOST:
        return levels
    hidden = levels[MOST - 5 : -4]
    middle = hidden[len(hidden) // 2]
    gap = Level(middle.layers, f"{len(hidden)} more layers", "see the list", middle.made)
    return [*levels[: MOST - 5], gap, *levels[-4:]]


def _labels(levels: Sequence[Level], gap: float) -> float:
    """Return the room beside the layers for the longest label and the bracket behind it, mm."""
    if gap >= TWO_LINES:
        return LABELS
    longest = max((_one_line(level.words, level.detail) for level in levels), default=0.0)
    return max(LABELS, COLUMN + longest + 2.0 + BRACKET)


def _one_line(words: str, detail: str) -> float:
    """Return the length of a label with its detail on the same line, mm."""
    return BOLD * draw.text_width(words, 2.5) + 1.2 + draw.text_width(detail, 2.2)


def _beside(edge: Point, words: str, detail: str, gap: float) -> list[str]:
    """Return labels with leaders to their features; on one line if the next are near."""
    x, y = edge
    column = WIDE + COLUMN
    leader = draw.line([(min(x, WIDE) + 0.4, y), (column - 0.8, y)], colour=draw.GREY, width=0.12)
    if gap < TWO_LINES:
        after = column + BOLD * draw.text_width(words, 2.5) + 1.2
        return [
            leader,
            draw.text((column, y + 0.9), words, size=2.5, bold=True),
            draw.text((after, y + 0.9), detail, size=2.2),
        ]
    return [
        leader,
        draw.text((column, y + 0.1), words, size=2.7, bold=True),
        draw.text((column, y + 3.0), detail, size=2.3),
    ]


def _pin_stretches(pins: Sequence[Pin], view: _Tilted, under: float, over: float) -> list[str]:
    """Return the stretch of every pin between two levels, rear pins first."""
    parts = []
    for pin in sorted(pins, key=lambda pin: (-pin.centre[1], pin.centre[0])):
        x = view.middle + pin.centre[0] * view.scale
        back = pin.centre[1] * view.scale * TILT
        width = max(pin.diameter * view.scale * 0.8, 0.6)
        parts.append(
            f'<path d="M{coord(x)} {coord(under - back)}V{coord(over - back)}" fill="none" '
            f'stroke="#6b7178" stroke-width="{coord(width)}" stroke-linecap="round"/>'
        )
    return parts


def _brackets(levels: Sequence[Level], view: _Tilted, width: float) -> list[str]:
    """Return a bracket beside the levels of a round, with the number of turns."""
    parts: list[str] = []
    marked = [(i, level.round) for i, level in enumerate(levels) if level.round is not None]
    for turn in {id(turn): turn for _, turn in marked}.values():
        places = [i for i, level_turn in marked if level_turn is turn]
        low, high = view.level(places[0]) + 3.2, view.level(places[-1]) - 2.4
        x = width - BRACKET
        parts.append(draw.line([(x - 1.2, low), (x, low), (x, high), (x - 1.2, high)], width=0.3))
        words = f"{draw.TIMES} {turn.count}"
        parts.append(draw.text((x + 1.2, (low + high) / 2 + 1.0), words, size=3.4, bold=True))
    return parts


# The section between the platens, to scale in two classes of thickness.


SECTION_WIDE, SECTION_LABELS, SECTION_EDGE = 26.0, 43.0, 1.0
THICK = 0.5
"""Height of the base plate and of the pad on the page, mm each."""
PLATEN = 3.0
FACTORS = (50, 20, 10, 5, 2, 1)
TALLEST_LAMINATE = 10.0
"""Largest height of a laminate on the page, mm, if a factor allows it."""
PIN_REACH = 0.7
"""Share of the pad that a pin may reach into on the page."""
STACK = 8.0, 19.0
"""Extent of the laminate along x."""
GAP = 3.0
LEAST = 24.0
"""Room for the text beside the section, mm on the page."""
LAMINATE_ROW = 3
"""Place of the laminate among the labels, from above."""
PLATEN_INK, PLATE_INK, FILM_INK = "#c9ccd1", "#e3e5e8", "#e0872f"


def factor(step: Step) -> int:
    """Return the magnification of films: pins above the stack must end inside the pad."""
    thick = {item.part: item.thickness_mm for item in step.build_up}
    over = max((pin.stands_mm for pin in step.pin_settings), default=step.top_mm) - step.top_mm
    films = step.stack_mm + thick.get(UNDERLAY, 0.0)
    room = PIN_REACH * thick[PAD] * THICK
    fits = (by for by in FACTORS if films * by <= TALLEST_LAMINATE and over * by <= room)
    return next(fits, FACTORS[-1])


def build_up_svg(step: Step, name: str) -> str:
    """Return the section of one step, platen to platen, each part with its thickness beside it.

    Base plate and press pad are drawn 1:2; films, laminate and the pins above the plate are
    magnified by a factor stated in the picture. Widths are not to scale.
    """
    thick = {item.part: item.thickness_mm for item in step.build_up}
    by, paper = factor(step), thick.get(UNDERLAY, 0.0)
    pad, plate, film = thick[PAD] * THICK, thick[BASE_PLATE] * THICK, thick[RELEASE] * by
    laminate = step.stack_mm * by
    heights = [PLATEN, pad, film, laminate, film, paper * by, plate, PLATEN]
    start = SECTION_EDGE + max(0.0, LEAST + paper * by - sum(heights)) / 2
    tops = [*accumulate(heights, initial=start)]
    top, over, upper, lower, bed, face, bottom, end = tops[1:]
    end = max(end, SECTION_EDGE + LEAST)
    words = "; ".join(f"{item.part} {item.thickness_mm:g} mm" for item in reversed(step.build_up))
    words = f"build-up of step {step.step}: {words}"
    picture = Picture(name, SECTION_WIDE + SECTION_LABELS, end + 5.0, words)
    low, high = STACK
    picture.add(
        _bar(start, top, PLATEN_INK),
        _bar(bottom, bottom + PLATEN, PLATEN_INK),
        _bar(face, bottom, PLATE_INK),
        _bar(bed, face, "#ffffff", 0.1) if paper else "",
        _pad(top, over, bed - 2 * film),
        *_release(upper, bed, film),
        draw.box((low, upper), (high, lower), fill="#bcd3ea", stroke=draw.DARK),
        *_section_pins(step.pin_settings, face, bottom, by),
    )
    state = "pins in" if step.pin_settings else "no pins"
    heat, release = temperature(step.temperature_c), millimetres(thick[RELEASE])
    labels = [
        f"upper platen, {heat}",
        f"press pad {millimetres(thick[PAD])}",
        f"release film {release}",
        f"laminate {millimetres(step.stack_mm)}, ~{step.film_kpa:.0f} kPa",
        "release film",
        f"underlay {millimetres(paper)}, paper" if paper else "",
        f"base plate {millimetres(thick[BASE_PLATE])}, {state}",
        f"lower platen, {heat}",
    ]
    lines = [(y + h / 2, text) for y, h, text in zip(tops, heights, labels, strict=False) if text]
    rows = draw.spread([y for y, _ in lines], GAP, SECTION_EDGE + 2.0, end)
    for place, ((y, text), row) in enumerate(zip(lines, rows, strict=True)):
        x = (high if place == LAMINATE_ROW else SECTION_WIDE) - 1.5
        picture.add(*draw.leader((x, y), (SECTION_WIDE + 2.0, row), (SECTION_WIDE + 3.5, row)))
        picture.add(draw.text((SECTION_WIDE + 4.2, row + 0.8), text, size=2.3))
    scale = f"plate and pad 1:2; what lies between {by}:1; widths not to scale"
    picture.add(draw.text((SECTION_EDGE, end + 3.6), scale, size=2.2))
    return picture.svg()


def _bar(top: float, bottom: float, fill: str, width: float = draw.THIN) -> str:
    """Return a part as wide as the platen."""
    ends = (SECTION_EDGE, top), (SECTION_WIDE, bottom)
    return draw.box(*ends, fill=fill, stroke=draw.DARK, width=width)


def _pad(top: float, over: float, beside: float) -> str:
    """Return the pad, compressed above the laminate; beside it, it meets the plate."""
    (low, high), slope = STACK, min(4.0, beside - over)
    path = (
        f"M{SECTION_EDGE} {top}H{SECTION_WIDE}V{beside:.3f}H{high + slope:.3f}L{high} {over:.3f}"
        f"H{low}L{low - slope:.3f} {beside:.3f}H{SECTION_EDGE}Z"
    )
    return f'<path d="{path}" fill="#f3ddd6" stroke="{draw.DARK}" stroke-width="{draw.THIN}"/>'


def _release(upper: float, bed: float, release: float) -> list[str]:
    """Return the flat lower film and the upper one, which rises over the laminate."""
    (low, high), slope = STACK, min(4.0, bed - release - upper)
    beside, over = bed - 1.5 * release, upper - release / 2
    ends = [(SECTION_EDGE, beside), (low - slope, beside), (low, over), (high, over)]
    ends += [(high + slope, beside), (SECTION_WIDE, beside)]
    flat = bed - release / 2
    return [
        draw.line([(SECTION_EDGE, flat), (SECTION_WIDE, flat)], colour=FILM_INK, width=release),
        draw.line(ends, colour=FILM_INK, width=release),
    ]


def _section_pins(
    settings: tuple[PinSetting, ...], face: float, bottom: float, by: int
) -> list[str]:
    """The pins on the shoulders of their holes, seat 1:2, the part above the plate magnified.

    Below each is its push-out hole; the tips press into the pad.
    """
    (low, high), parts = STACK, []
    for place, pin in enumerate(settings[:4]):
        x = low + (high - low) * (place + 1) / (min(len(settings), 4) + 1)
        tip, shoulder = face - pin.stands_mm * by, face + pin.seat_mm * THICK
        for half, top, end, fill in (
            (push_out(pin.diameter_mm) / 2, shoulder, bottom, "#ffffff"),
            (pin.diameter_mm / 2, tip, shoulder, "#6d737c"),
        ):
            parts.append(draw.box((x - half, top), (x + half, end), fill=fill, stroke=draw.DARK))
    return parts


def equal_pins(step: Step) -> list[tuple[list[str], PinSetting]]:
    """Return the names of equal pins, and one pin of each kind."""
    groups: dict[PinSetting, list[str]] = {}
    for pin in sorted(step.pin_settings, key=lambda pin: (pin.diameter_mm, pin.length_mm)):
        groups.setdefault(replace(pin, pin=""), []).append(pin.pin)
    return [(names, pin) for pin, names in groups.items()]
