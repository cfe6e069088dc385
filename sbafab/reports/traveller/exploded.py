"""A press step taken apart: every layer or finished stack in its place over the plate.

Drawn from the front and above, so that outlines and tabs show which way round each layer goes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from sbafab.cutting.fixture import shown
from sbafab.geometry.edges import Bounds, Point
from sbafab.geometry.region import Region, coord, path_data
from sbafab.laminate.assembly import AssemblyStep, distinct_layers, stack_count
from sbafab.laminate.laminate import Laminate, Layer, Pin
from sbafab.reports import drawing as draw
from sbafab.reports.drawing import layer_numbers
from sbafab.reports.traveller import job as say
from sbafab.reports.traveller.shapes import Bed, Picture, Round, pattern_id, rounds

WIDE = 58.0
TILT = 0.34
"""How much of its depth a layer keeps, seen from the front and above."""
LABELS = 50.0
TALLEST = 64.0
NEAREST, FARTHEST, TWO_LINES = 4.0, 12.0, 6.0
COLUMN, BRACKET = 4.0, 13.0
"""mm from the layers to their labels, and for a bracket with its count."""
BOLD = 1.25
"""How much wider bold letters are, at most."""
PAGE = 1.1
"""mm on the page between the layers of a finished stack."""
MOST = 20
TOP, FOOT = 5.0, 2.0
DEEP = 50.0
STANDS_OUT = 4.0
"""mm on the page of a pin above the highest level."""


@dataclass(frozen=True)
class Level:
    """What lies at one height: layers drawn on each other, and what to call them.

    ``made`` says that an earlier step has bonded them, ``round`` that they are laid repeatedly.
    """

    layers: tuple[Layer, ...]
    words: str
    detail: str
    made: bool
    round: Round | None = None


@dataclass(frozen=True)
class _View:
    """Where the laminate's frame lands on the page: its origin at ``middle`` and ``ground``."""

    scale: float
    middle: float
    ground: float
    gap: float
    height: float
    plate: bool

    def matrix(self, height: float) -> tuple[float, ...]:
        """From the plan of a layer to the page, the layer's origin at a page height."""
        return self.scale, 0.0, 0.0, -self.scale * TILT, self.middle, height

    def level(self, place: int) -> float:
        """Page height of a level, counted from the lowest; the plate lies under them all."""
        return self.ground - self.gap * (place + self.plate)


def exploded(laminate: Laminate, step: AssemblyStep, lying: Sequence[Bed], name: str) -> str:
    """The step's layers one over another, lowest first, with numbers and patterns beside them."""
    levels = _shortened([level for bed in lying for level in _levels(laminate, bed)])
    plate = shown(laminate) if step.pins else None
    view = _view(plate.bounds if plate is not None else laminate.bounds, len(levels), bool(plate))
    words = "; ".join(f"{level.words} {level.detail}" for level in levels)
    width = WIDE + _labels(levels, view.gap)
    picture = Picture(name, width, view.height, f"step {step.number} taken apart: {words}")
    if plate is not None:
        picture.add(*_plate(plate, view))
    under = view.ground
    for place, level in enumerate(levels):
        here = view.level(place)
        picture.add(*_pins(step.pins, view, under, here))
        look = "made" if level.made else "fresh"
        for lift, layer in enumerate(level.layers):
            matrix = view.matrix(here - PAGE * lift)
            picture.part(pattern_id(layer.pattern), layer.film, matrix, look)
        reach = max(layer.profile.bounds[2] for layer in level.layers)
        edge = view.middle + reach * view.scale, here
        picture.add(*_beside(edge, level.words, level.detail, view.gap))
        under = here - PAGE * (len(level.layers) - 1)
    picture.add(*_pins(step.pins, view, under, under - STANDS_OUT))
    picture.add(*_brackets(levels, view, width))
    return picture.svg()


def _view(bounds: Bounds, levels: int, plate: bool) -> _View:
    low_x, low_y, high_x, high_y = bounds
    scale = min(WIDE / (high_x - low_x), DEEP / ((high_y - low_y) * TILT))
    depth = (high_y - low_y) * scale * TILT
    between = max(levels - (not plate), 1)
    gap = min(max((TALLEST - depth) / between, NEAREST), FARTHEST)
    height = TOP + depth + gap * between + FOOT
    middle = WIDE / 2 - (low_x + high_x) / 2 * scale
    return _View(scale, middle, height - FOOT + low_y * scale * TILT, gap, height, plate)


def _plate(plate: Region, view: _View) -> list[str]:
    moved = " ".join(map(coord, view.matrix(view.ground)))
    shape = (
        f'<path d="{path_data(plate)}" fill="#f1f1ef" fill-rule="evenodd" stroke="{draw.GREY}" '
        f'stroke-width="{coord(0.25 / view.scale)}" transform="matrix({moved})"/>'
    )
    edge = view.middle + plate.bounds[2] * view.scale, view.ground
    return [shape, *_beside(edge, "base plate", "cut corner: back right", view.gap)]


def _levels(laminate: Laminate, bed: Bed) -> Iterator[Level]:
    if bed.made_in is not None:
        shown = distinct_layers(laminate, bed.layers)[:4]
        words = f"layers {layer_numbers(bed.layers)}"
        many = stack_count(laminate, bed.layers)
        yield Level(shown, words, f"the {say.stacks(many)} from step {bed.made_in}", True)
        return
    for turn in rounds([laminate.layer(index) for index in bed.layers]):
        for place in turn.places:
            first = place[0]
            numbers = layer_numbers([layer.index for layer in place])
            detail = f"{first.film.material} {first.role.replace('-', ' ')} {first.pattern}"
            yield Level((first,), numbers, detail, False, turn if turn.count > 1 else None)


def _shortened(levels: list[Level]) -> list[Level]:
    """Few enough levels to draw; the lay-up table has them all."""
    if len(levels) <= MOST:
        return levels
    hidden = levels[MOST - 5 : -4]
    middle = hidden[len(hidden) // 2]
    gap = Level(middle.layers, f"{len(hidden)} more layers", "see the list", middle.made)
    return [*levels[: MOST - 5], gap, *levels[-4:]]


def _labels(levels: Sequence[Level], gap: float) -> float:
    """Room beside the layers for the longest label and the bracket behind it, mm."""
    if gap >= TWO_LINES:
        return LABELS
    longest = max((_one_line(level.words, level.detail) for level in levels), default=0.0)
    return max(LABELS, COLUMN + longest + 2.0 + BRACKET)


def _one_line(words: str, detail: str) -> float:
    """How long a label is whose detail follows on the same line."""
    return BOLD * draw.text_width(words, 2.5) + 1.2 + draw.text_width(detail, 2.2)


def _beside(edge: Point, words: str, detail: str, gap: float) -> list[str]:
    """Words with a leader to what they name; on one line where the next are near."""
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


def _pins(pins: Sequence[Pin], view: _View, under: float, over: float) -> list[str]:
    """The stretch of every pin between two levels, rear pins first."""
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


def _brackets(levels: Sequence[Level], view: _View, width: float) -> list[str]:
    """A bracket beside the levels of a round, with how often they are laid."""
    parts: list[str] = []
    marked = [(i, level.round) for i, level in enumerate(levels) if level.round is not None]
    for turn in {id(turn): turn for _, turn in marked}.values():
        places = [i for i, other in marked if other is turn]
        low, high = view.level(places[0]) + 3.2, view.level(places[-1]) - 2.4
        x = width - BRACKET
        parts.append(draw.line([(x - 1.2, low), (x, low), (x, high), (x - 1.2, high)], width=0.3))
        words = f"{draw.TIMES} {turn.count}"
        parts.append(draw.text((x + 1.2, (low + high) / 2 + 1.0), words, size=3.4, bold=True))
    return parts
