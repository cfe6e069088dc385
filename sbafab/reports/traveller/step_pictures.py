"""Names beside the places of a picture, where they cover neither each other nor what they name."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from sbafab.cutting.fixture import shown
from sbafab.geometry.cache import cached
from sbafab.geometry.edges import Bounds, Point
from sbafab.geometry.region import Region, coord, path_data, section
from sbafab.laminate.assembly import AssemblyStep, distinct_layers
from sbafab.laminate.laminate import Inlet, Laminate, Layer, Pin
from sbafab.reports import drawing as draw
from sbafab.reports.drawing import layer_numbers
from sbafab.reports.traveller import job as say
from sbafab.reports.traveller.shapes import Bed, Picture, flat, inlets_in, label, pattern_id

DIRECTIONS = 16
STEPS = (0.0, 2.0, 4.0, 6.5, 9.0)
"""mm from where a name would touch its place, in the order in which they are tried."""
LED = 1.5
"""mm from which on a thin line leads from the name to its place."""
ASIDE, FAR = 0.4, 0.25
"""What a name out of its direction costs, and a mm of distance, in mm2 of covering."""
ROUNDED = 1e-6
"""mm2, far more than sums of costs are off."""


class PlanName(NamedTuple):
    """A name to be put beside ``at``, a place ``clear`` mm round, best in the direction ``out``."""

    words: str
    at: Point
    clear: float
    out: Point


def named(names: list[PlanName], size: float, room: Bounds, taken: list[Bounds]) -> list[str]:
    """The names as SVG, each where it covers least of ``taken`` and of those before it."""
    taken, drawn = list(taken), []
    for name in names:
        half = draw.text_width(name.words, size) / 2, size / 2
        middle, away = _best(name, half, room, taken)
        taken.append(_box(middle, half))
        if away >= LED:
            drawn.append(draw.line([name.at, middle], width=0.12))
        drawn.append(label((middle[0], middle[1] + 0.35 * size), name.words, size))
    return drawn


def _best(
    name: PlanName, half: Point, room: Bounds, taken: Sequence[Bounds]
) -> tuple[Point, float]:
    """The middle of the place that costs least, and how far it stands off; the first of several.

    ``half`` of the name's width and height.
    """
    least, best = math.inf, (name.at, 0.0)
    for away in STEPS:
        # Nothing costs less than the distance alone, but for rounding.
        if FAR * away > least + ROUNDED:
            break
        for middle in _places(name, half, away):
            cost = _cost(name, middle, half, room, taken) + FAR * away
            if cost < least:
                least, best = cost, (middle, away)
    return best


def _places(name: PlanName, half: Point, away: float) -> Iterator[Point]:
    """Middles of the name that stand so far off, from its own direction round."""
    reach = name.clear + away
    for step in range(DIRECTIONS):
        turn = 2 * math.pi * step / DIRECTIONS + math.atan2(name.out[1], name.out[0])
        u, v = math.cos(turn), math.sin(turn)
        yield name.at[0] + (reach + half[0]) * u, name.at[1] + (reach + half[1]) * v


def _box(middle: Point, half: Point) -> Bounds:
    x, y = middle
    return x - half[0], y - half[1], x + half[0], y + half[1]


def _cost(
    name: PlanName, middle: Point, half: Point, room: Bounds, taken: Sequence[Bounds]
) -> float:
    """What a place costs but for its distance."""
    box = _box(middle, half)
    covered = sum([_shared(box, other) for other in taken])
    outside = _area(box) - _shared(box, room)
    u, v = middle[0] - name.at[0], middle[1] - name.at[1]
    along = (u * name.out[0] + v * name.out[1]) / (math.hypot(u, v) or 1.0)
    return covered + 4 * outside + ASIDE * (1 - along)


def _area(box: Bounds) -> float:
    return (box[2] - box[0]) * (box[3] - box[1])


def _shared(a: Bounds, b: Bounds) -> float:
    width = min(a[2], b[2]) - max(a[0], b[0])
    height = min(a[3], b[3]) - max(a[1], b[1])
    return width * height if width > 0 and height > 0 else 0.0


# A press step seen from above: plate, layers, pins in or out, inlet tabs.


WIDEST, TALLEST = 64.0, 36.0
NARROWEST = 66.0
"""mm: room for the words under the picture."""
EDGE, HEAD, FOOT = 5.0, 5.0, 9.0
NAMES = 2.0
"""Height of the names of pins and chambers, mm."""
FREE = 6.0
"""mm of air round a laminate that has no base plate."""
PLATE = "#f1f1ef"
AT_DATUM = 1e-3
"""mm from the datum within which a pin hides it."""


_section = cached(section)
"""Every step of a laminate asks for the same."""


class _View(NamedTuple):
    """Where the step's frame (mm of the laminate) lands on the page."""

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


def plan(laminate: Laminate, step: AssemblyStep, lying: tuple[Bed, ...], name: str) -> str:
    """The step from above; earlier stacks grey, what joins in its own colour."""
    plate = shown(laminate)
    view = _view(plate.bounds if plate is not None else _widened(laminate.bounds))
    state = "pins in" if step.pins else "no pins"
    words = f"step {step.number} from above, {state}; the text beside it says the same"
    picture = Picture(name, view.width, view.height, words)
    if plate is not None:
        picture.add(_plate(plate, bool(step.pins), view))
    for bed in lying:
        for layer in distinct_layers(laminate, bed.layers):
            look = "made" if bed.made_in else "clear"
            picture.part(
                pattern_id(layer.pattern),
                layer.film,
                flat(view.scale, view.origin),
                look,
            )
    inlets = inlets_in(laminate, step.layers)
    # An arrow at its tab names the pin of a chamber, too.
    told = {inlet.chamber for inlet in inlets}
    names, taken = [], []
    for pin in laminate.pins:
        at, r = view.at(pin.centre), _radius(pin, view)
        picture.add(_pin(at, r, pin in step.pins))
        taken.append((at[0] - r, at[1] - r, at[0] + r, at[1] + r))
        if pin in step.pins and pin.name not in told:
            names.append(PlanName(pin.name, at, r + 0.6, _outward(pin)))
    arrows = []
    for inlet in inlets:
        start, tip = _arrow(inlet, _reach(laminate, inlet), view)
        (u, v), xs, ys = inlet.direction, (start[0], tip[0]), (start[1], tip[1])
        picture.add(draw.line([start, tip], width=0.35), draw.arrow(tip, (u, -v)))
        taken.append((min(xs) - 0.7, min(ys) - 0.7, max(xs) + 0.7, max(ys) + 0.7))
        arrows.append(PlanName(inlet.chamber, tip, 0.9, (u, -v)))
    room = 0.5, HEAD + 0.3, view.width - 0.5, view.height - FOOT + 1.0
    picture.add(*named([*arrows, *names], NAMES, room, taken))
    at_datum = next((pin.name for pin in step.pins if math.hypot(*pin.centre) < AT_DATUM), None)
    if at_datum is None:
        picture.add(*_datum(view))
    datum = "+ datum" if at_datum is None else f"the datum is the middle of pin {at_datum}"
    picture.add(*_captions(view, plate is not None, bool(step.pins), datum))
    return picture.svg()


def _plate(plate: Region, used: bool, view: _View) -> str:
    """The base plate, dashed where it is not used: it still tells which way round things go."""
    shape = path_data(plate.mapped(view.at, view.scale, mirror=True))
    dash = "" if used else ' stroke-dasharray="1.6 1.2"'
    return (
        f'<path d="{shape}" fill="{PLATE if used else "none"}" fill-rule="evenodd" '
        f'stroke="{draw.GREY}" stroke-width="0.25"{dash}/>'
    )


def _widened(bounds: Bounds) -> Bounds:
    low_x, low_y, high_x, high_y = bounds
    return low_x - FREE, low_y - FREE, high_x + FREE, high_y + FREE


def _radius(pin: Pin, view: _View) -> float:
    return max(pin.diameter * view.scale / 2, 0.7)


def _outward(pin: Pin) -> Point:
    """On the page, from the datum to the pin; upward for the pin that stands there."""
    far = math.hypot(*pin.centre)
    return (pin.centre[0] / far, -pin.centre[1] / far) if far > AT_DATUM else (0.0, -1.0)


def _pin(at: Point, r: float, is_in: bool) -> str:
    """A pin that is in: filled; out: hollow."""
    x, y = at
    fill = draw.DARK if is_in else "#ffffff"
    return (
        f'<circle cx="{coord(x)}" cy="{coord(y)}" r="{coord(r)}" fill="{fill}" '
        f'stroke="{draw.DARK}" stroke-width="0.3"/>'
    )


def _reach(laminate: Laminate, inlet: Inlet) -> float:
    """How far past its mouth an inlet's strip goes at most, mm."""
    shapes = (layers[0].profile for layers in laminate.patterns.values())
    spans = [span for shape in shapes for span in _section(shape, inlet.mouth, inlet.direction)]
    return max((end for _, end in spans), default=0.0)


def _arrow(inlet: Inlet, reach: float, view: _View) -> tuple[Point, Point]:
    """Start and tip of an arrow outward from the end of the tab and its strip."""
    u, v = inlet.direction
    (x, y), v = view.at((inlet.mouth[0] + reach * u, inlet.mouth[1] + reach * v)), -v
    return (x + 0.8 * u, y + 0.8 * v), (x + 4.0 * u, y + 4.0 * v)


def _datum(view: _View) -> list[str]:
    """The cross that every cut file carries at the actuator's axis."""
    x, y = view.origin
    return [
        draw.line([(x - 1.6, y), (x + 1.6, y)], width=0.2),
        draw.line([(x, y - 1.6), (x, y + 1.6)], width=0.2),
    ]


def _captions(view: _View, plate: bool, pinned: bool, datum: str) -> list[str]:
    """What the marks mean, under the picture, and the plate's corner, above it."""
    y = view.height - 4.6
    parts = [draw.text((EDGE, view.height - 1.2), f"seen from above; {datum}", size=2.2)]
    if not plate:
        return parts
    mark = '<circle cx="{}" cy="{}" r="0.8" fill="{}" stroke="#1a1a1a" stroke-width="0.3"/>'
    parts += [
        mark.format(coord(EDGE + 0.8), coord(y - 0.8), draw.DARK),
        draw.text((EDGE + 2.4, y), "pin in", size=2.2),
        mark.format(coord(EDGE + 13.0), coord(y - 0.8), "#ffffff"),
        draw.text((EDGE + 14.6, y), "no pin", size=2.2),
    ]
    words = "on the base plate, cut corner back right" if pinned else "no pins in"
    parts.append(draw.text((EDGE, HEAD - 1.2), words, size=2.2))
    return parts


# How parts are laid that no pin holds: along which edge, or where on their sheet.


APART = 0.25
"""mm between the points at which two edges are compared."""
ALIKE = 0.02
"""mm by which a distance may differ and still be the same to a hand."""


class Lip(NamedTuple):
    """How far an edge lies outside another in mm, below 0 inside; ``all_round`` without breaks."""

    outside: float
    all_round: bool


@dataclass(frozen=True)
class PiecePlace:
    """Where a piece lies: mm from the lower left corner of its sheet.

    ``x`` and ``y`` are those of the balloon's middle, ``left`` and ``low`` of the piece's edges.
    """

    what: str
    piece: int
    x: float
    y: float
    left: float
    low: float


class Things:
    """What a step lays, lowest first: single layers, and stacks from earlier steps as one."""

    def __init__(self, laminate: Laminate, lying: Sequence[Bed]) -> None:
        self.laminate = laminate
        self.things: list[tuple[int, ...]] = []
        for bed in lying:
            self.things += [(i,) for i in bed.layers] if bed.made_in is None else [bed.layers]

    def is_lowest(self, index: int) -> bool:
        """Whether nothing lies under this layer in the step."""
        return self.things[0][0] == index

    def line_up(self, index: int, numbered: bool = True) -> str:
        """Along what the edge of a layer, or of the stack that it begins, is laid.

        It is what lies below, or above the lowest; a sheet's edges are too far off.
        """
        place = next(i for i, thing in enumerate(self.things) if thing[0] == index)
        if len(self.things) < 2:
            return ""
        side, beside = ("below", place - 1) if place else ("above", 1)
        own = _widest(self.laminate, self.things[place], highest=False)
        other = _widest(self.laminate, self.things[beside], highest=place > 0)
        each = "each" if len(own.profile.pieces) > 1 else "its"
        found = lip(own.profile, other.profile)
        if found is None:
            return f"{each} piece at its place in the table" if other.role == "sheet" else ""
        alone = len(self.things[place]) == 1
        words = [f"{each} edge" + ("" if alone else f" (layer {own.index})")]
        upper = self._top_film(self.things[beside]) if place else other
        if upper is not other and lip(own.profile, upper.profile) == (0.0, True):
            words.append(f"on that of {_seen(upper, side, numbered)},")
        if abs(found.outside) < ALIKE:
            words.append("on")
        else:
            way = "outside" if found.outside > 0 else "inside"
            words.append(f"{say.millimetres(abs(found.outside))} {way}")
        words.append(f"that of {_seen(other, side, numbered)},")
        words.append("all round" if found.all_round else "all round but for the tabs")
        return " ".join(words)

    def _top_film(self, thing: Sequence[int]) -> Layer:
        films = [self.laminate.layer(i) for i in thing if not self.laminate.layer(i).is_mask]
        return films[-1] if films else self.laminate.layer(thing[-1])


def over_tab(laminate: Laminate, layers: Sequence[int]) -> Layer | None:
    """The lowest separator mask among layers round one axis that reaches out to one side.

    It does so over the inlet tab, under a balloon larger than those between.
    """
    if len(laminate.chambers) > 1 or len(laminate.chambers[0].centres) > 1:
        return None
    (x, y), (dx, dy) = laminate.chambers[0].centres[0], laminate.inlets[0].direction
    turn = -math.degrees(math.atan2(dy, dx))
    masks = [layer for layer in map(laminate.layer, layers) if layer.role == "separator-mask"]
    for mask in masks:
        low_x, _, high_x, _ = mask.profile.moved(-x, -y).turned(turn).bounds
        if high_x + low_x > ALIKE:
            return mask
    return None


@cached
def lip(region: Region, other: Region) -> Lip | None:
    """How the outline of a region follows another's; None where it mostly does not."""
    outline = Region(other.outers)
    found = []
    for contour in region.outers:
        for edge in contour.edges:
            count = math.ceil(edge.length / APART)
            for i in range(count):
                p = edge.at((i + 0.5) / count)
                distance = outline.distance_to_edge(p)
                found.append(-distance if outline.contains(p) else distance)
    found.sort()
    usual = found[len(found) // 2]
    alike = sum(abs(distance - usual) < ALIKE for distance in found)
    if 2 * alike < len(found):
        return None
    return Lip(round(usual, 2) + 0.0, alike == len(found))


def places(laminate: Laminate, step: AssemblyStep, lying: Sequence[Bed]) -> tuple[PiecePlace, ...]:
    """Places of all that is laid on a sheet by hand; empty for steps without a sheet."""
    sheet = laminate.layers[0]
    if step.pins or sheet.role != "sheet" or sheet.index not in step.layers:
        return ()
    things = Things(laminate, lying).things
    return tuple(place for thing in things[1:] for place in _piece_places(laminate, sheet, thing))


def pitch(found: Sequence[PiecePlace]) -> float | None:
    """From one piece to the next along x; None for a single piece."""
    first, second = (next((p for p in found if p.piece == number), None) for number in (1, 2))
    return second.x - first.x if first and second else None


def _piece_places(laminate: Laminate, sheet: Layer, thing: Sequence[int]) -> Iterator[PiecePlace]:
    layer = _widest(laminate, thing, highest=False)
    left, low = sheet.profile.bounds[:2]
    named = f"layer {layer.index}, {_name(layer)}"
    what = named if len(thing) == 1 else f"stack of layers {layer_numbers(thing)}"
    centres = [centre for chamber in laminate.chambers for centre in chamber.centres]
    pieces = sorted(layer.profile.pieces, key=lambda piece: piece.bounds)
    for number, piece in enumerate(pieces, 1):
        outline = Region(piece.outers)
        own = [centre for centre in centres if outline.contains(centre)] or [_middle(piece.bounds)]
        x, y = (sum(values) / len(own) for values in zip(*own, strict=True))
        yield PiecePlace(
            what, number, x - left, y - low, piece.bounds[0] - left, piece.bounds[1] - low
        )


def _middle(bounds: Bounds) -> Point:
    return (bounds[0] + bounds[2]) / 2, (bounds[1] + bounds[3]) / 2


def _widest(laminate: Laminate, layers: Sequence[int], highest: bool) -> Layer:
    """The layer whose outline is seen round all others, of several the highest or the lowest."""
    reach = {
        layer.pattern: round(sum(contour.area for contour in layer.profile.outers), 6)
        for layer in distinct_layers(laminate, layers)
    }
    most = max(reach.values())
    wide = [i for i in layers if reach[laminate.layer(i).pattern] == most]
    return laminate.layer(wide[-1] if highest else wide[0])


def _seen(layer: Layer, side: str, numbered: bool) -> str:
    return f"the {_name(layer)} {side}" + (f" (layer {layer.index})" if numbered else "")


def _name(layer: Layer) -> str:
    return f"{layer.film.material} {layer.role.replace('-', ' ')}"
