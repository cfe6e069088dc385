"""A right and a wrong laminate for every rule of the deck, drawn; the wrong ones are the tests'."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

from sbafab.design.records import Design
from sbafab.geometry.edges import Bounds, Point
from sbafab.geometry.region import Region, coord, disc, path_data, rectangle
from sbafab.laminate.films import MASKS, STRUCTURAL, Ink, ink
from sbafab.laminate.laminate import Laminate, Layer
from sbafab.rules.deck import RULES, run_rule
from sbafab.rules.finding import Finding
from sbafab.rules.measures import Measures
from sbafab.rules.registration_yield import simulate
from tests.designs import PAPER, errors
from tests.rules.conftest import built, spoiled
from tests.rules.routed import cut_through, laminate_of, straight
from tests.rules.test_deck import EARS, EXACT, FAULTS, ONE

WIDE = 260
"""Pixels of a picture."""
RED = "#c1121f"

ZOOM = {"bond-width": 1.7, "mask-overhang": 1.7, "tube-fit": 2.5, "film-limits": 1.7}
"""Rules whose pictures show this many mm round the place only: what is wrong is small."""


class Shape(NamedTuple):
    region: Region
    colours: Ink
    opacity: float = 0.5


class Pair(NamedTuple):
    """Drawings of what passes and what fails, and what the rule says of the latter."""

    right: str
    wrong: str
    said: str


def pair(rule: str) -> Pair:
    """The two drawings of a rule, made from laminates that it passes and fails."""
    return OTHERS[rule]() if rule in OTHERS else _of_fault(rule)


def _found(rule: str, laminate: Laminate, limits: Design = EXACT) -> Finding:
    (one,) = (own for own in RULES if own.name == rule)
    findings = run_rule(one, Measures(laminate, limits))
    return next((f for f in findings if f.verdict in ("fail", "warn")), findings[0])


def _of_fault(rule: str) -> Pair:
    fault = next(fault for fault in FAULTS.values() if fault.rule == rule)
    good = built(*fault.design)
    profile = fault.change(good.layer(fault.layer).profile)
    bad = spoiled(good, fault.layer, profile, fault.pieces)
    found = _found(rule, bad)
    assert found.verdict == "fail"
    return _drawn(good, bad, found, fault.layer)


def _drawn(good: Laminate, bad: Laminate, found: Finding, layer: int) -> Pair:
    layers = sorted({*found.where.layers, layer})
    shown = [max(layers[0], layer - 1), min(layers[-1], layer + 1)]
    indices = range(shown[0], min(shown[1], len(good.layers)) + 1)
    place = _place(found)
    box = _box((bad.layer(i) for i in indices), place)
    if found.rule in ZOOM and place is not None:
        (x, y), half = place, ZOOM[found.rule]
        box = (x - half, y - half, x + half, y + half)
    wrong = svg(_layers(bad, indices), box, place)
    return Pair(svg(_layers(good, indices), box), wrong, found.message)


def _layers(laminate: Laminate, indices: Iterable[int]) -> Iterator[Shape]:
    for index in indices:
        own = laminate.layer(index)
        yield Shape(own.profile, ink(own.film))


def _place(found: Finding) -> Point | None:
    where = found.where
    return None if where.x is None or where.y is None else (where.x, where.y)


def _box(layers: Iterable[Layer], place: Point | None) -> Bounds:
    """The layers as a whole, with the place in view."""
    boxes = [layer.profile.bounds for layer in layers]
    xs, ys = ([place[0]], [place[1]]) if place else ([], [])
    xs += [x for box in boxes for x in (box[0], box[2])]
    ys += [y for box in boxes for y in (box[1], box[3])]
    return min(xs), min(ys), max(xs), max(ys)


def svg(shapes: Iterable[Shape], box: Bounds, mark: Point | None = None) -> str:
    """A drawing of regions in plan, with a red ring where something is wrong."""
    low_x, low_y, high_x, high_y = box
    margin = 0.06 * max(high_x - low_x, high_y - low_y)
    width, height = high_x - low_x + 2 * margin, high_y - low_y + 2 * margin
    view = " ".join(map(coord, (low_x - margin, -high_y - margin, width, height)))
    line = max(width, height) / WIDE
    ring = ""
    if mark is not None:
        ring = (
            f'<circle cx="{coord(mark[0])}" cy="{coord(mark[1])}" r="{coord(14 * line)}" '
            f'fill="none" stroke="{RED}" stroke-width="{coord(2.5 * line)}"/>'
        )
    paths = "".join(
        f'<path d="{path_data(one.region)}" fill="{one.colours.fill}" '
        f'stroke="{one.colours.line}" fill-opacity="{coord(one.opacity)}"/>'
        for one in shapes
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{view}" width="{WIDE}" '
        f'height="{coord(WIDE * height / width)}"><g transform="scale(1 -1)" fill-rule="evenodd" '
        f'stroke-width="{coord(line)}">{paths}{ring}</g></svg>\n'
    )


def _press_fit() -> Pair:
    platen = Shape(rectangle((-76.2, -76.2), (76.2, 76.2)), Ink("#eceff1", "#607d8b"), 1)
    good, bad = (built("1dof-5mm", f"chamber.diameter={d}") for d in (140, 150))
    found = _found("press-fit", bad)
    box = _box(bad.layers[:1], (-80.0, -80.0))
    right = svg([platen, *_layers(good, [1])], box)
    return Pair(right, svg([platen, *_layers(bad, [1])], box, _place(found)), found.message)


def _pressure_rating() -> Pair:
    """The mask of a balloon as drawn, and wider than the film bears at twice the pressure."""
    good = built("1dof-5mm", "bond.width=1")
    limits = EXACT.with_("acceptance.working_pressure_kpa=170")
    bad = spoiled(good, 6, disc((0, 0), 2.71) - disc((0, 0), 0.5))
    found = _found("pressure-rating", bad, limits)
    box = _box([good.layer(6), good.layer(7)], None)
    wrong = svg(_layers(bad, (6, 7)), box, _place(found))
    return Pair(svg(_layers(good, (6, 7)), box), wrong, found.message)


def _pin_fit() -> Pair:
    cut = EXACT.with_(registration=errors(cutting=0.1))
    drawings = []
    for pin in (1.0, 1.19):
        laminate = built(*ONE, f"bore.pin_diameter={pin}")
        hole = disc((0, 0), 2.0) - disc((0, 0), 0.4)
        shapes = [Shape(hole, MASKS[0]), Shape(disc((0, 0), pin / 2), Ink("#90a4ae", "#37474f"))]
        drawings.append(svg(shapes, (-2, -2, 2, 2), (0.4, 0.0) if pin > 1 else None))
        found = _found("pin-fit", laminate, cut)
    return Pair(*drawings, found.message)


def _worst_case() -> Pair:
    """The wall of the lowest balloon as drawn, and moved by what a rough hand may move it."""
    good = built(*ONE)
    rough = PAPER.with_(registration=errors(cutting=0.1, pin=0.004, placement=0.5))
    found = _found("registration-worst-case", good, rough)
    layer = good.layer(3)
    bad = spoiled(good, 3, layer.profile.moved(0.5, 0.0))
    box = _box([good.layer(3), good.layer(4)], None)
    wrong = svg(_layers(bad, (2, 3)), box, _place(found))
    return Pair(svg(_layers(good, (2, 3)), box), wrong, found.message)


def _nets() -> Pair:
    """A channel as drawn and cut through, with its mask on the film below."""
    good, bad = (laminate_of(routes) for routes in (straight(), cut_through()))
    found = _found("nets", bad)
    box = _box([good.layer(1)], None)
    right, wrong = (
        svg(_layers(own, (1, 2)), box, mark) for own, mark in ((good, None), (bad, _place(found)))
    )
    return Pair(right, wrong, found.message)


def _yield() -> Pair:
    """A hundred builds each, those that miss a limit in red, as many as the rule counts."""
    few = PAPER.with_("rules.yield_builds=2000")
    rough = few.with_("registration.hand_placement=0.12", "registration.hand_turn=0.6")
    good, usual = built(*ONE, EARS), built(*ONE)
    shares = (simulate(good, few).whole.value, simulate(usual, rough).whole.value)
    found = _found("registration-yield", usual, rough)
    return Pair(_waffle(shares[0]), _waffle(shares[1]), found.message)


def _waffle(share: float) -> str:
    good = round(100 * share)
    shapes = (
        Shape(
            rectangle((i % 10, -(i // 10)), (i % 10 + 0.8, 0.8 - i // 10)),
            STRUCTURAL[0] if i < good else Ink("#f3b6bb", RED),
            1.0,
        )
        for i in range(100)
    )
    return svg(shapes, (0, -9, 10, 1))


OTHERS: dict[str, Callable[[], Pair]] = {
    "press-fit": _press_fit,
    "pressure-rating": _pressure_rating,
    "pin-fit": _pin_fit,
    "nets": _nets,
    "registration-worst-case": _worst_case,
    "registration-yield": _yield,
}
