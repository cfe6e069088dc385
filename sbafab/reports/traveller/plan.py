"""A press step seen from above: plate, layers, pins in or out, inlet tabs."""

from __future__ import annotations

import math
from typing import NamedTuple

from sbafab.cutting.fixture import shown
from sbafab.geometry.edges import Bounds, Point
from sbafab.geometry.region import Region
from sbafab.geometry.remembered import remembered
from sbafab.geometry.section import section
from sbafab.geometry.svg import number, path_data
from sbafab.laminate.assembly import AssemblyStep, distinct_layers
from sbafab.laminate.laminate import Inlet, Laminate, Pin
from sbafab.reports import drawing as draw
from sbafab.reports.traveller.layup import Bed, inlets_in
from sbafab.reports.traveller.named_places import PlanName, named
from sbafab.reports.traveller.shapes import Picture, flat, pattern_id

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


_section = remembered(section)
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
        f'<circle cx="{number(x)}" cy="{number(y)}" r="{number(r)}" fill="{fill}" '
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
        mark.format(number(EDGE + 0.8), number(y - 0.8), draw.DARK),
        draw.text((EDGE + 2.4, y), "pin in", size=2.2),
        mark.format(number(EDGE + 13.0), number(y - 0.8), "#ffffff"),
        draw.text((EDGE + 14.6, y), "no pin", size=2.2),
    ]
    words = "on the base plate, cut corner back right" if pinned else "no pins in"
    parts.append(draw.text((EDGE, HEAD - 1.2), words, size=2.2))
    return parts
