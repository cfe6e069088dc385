"""Every rule has faulty laminates that it alone catches; good laminates pass every rule."""

from __future__ import annotations

import gc
import math
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from typing import NamedTuple

import pytest

from sbafab.actuators import build, load_design
from sbafab.design.files import rule_names
from sbafab.design.records import Design
from sbafab.design.sections import Laser, Rules
from sbafab.geometry.offset import grow
from sbafab.geometry.region import Region, disc, rectangle, strip
from sbafab.laminate.laminate import Laminate
from sbafab.rules import bond_width, film_limits, measures, pin_holes
from sbafab.rules.deck import lowered, run_deck
from sbafab.rules.measures import Measures
from tests.designs import PAPER, errors
from tests.quick import few
from tests.rules.conftest import built

AXIS = (0.0, 0.0)
# Layers of one chamber of three balloons: 1 base, 2 chamber mask, 3 wall, 4 separator mask, 5 wall,
# 6 chamber mask, 7 wall, 8 separator mask, 9 wall, 10 chamber mask, 11 cap.
ONE = ("1dof-5mm", "stack.balloons=3")
LOBED = ("3dof-15mm", "stack.balloons=3")
RADIAL = ("radial-15mm", "stack.balloons=2")
EARS = 'registration.method="ears"'
# The middle balloon ends at 3.25, the others at 4.75.
WAIST = (*ONE, "chamber.diameter=[8, 5, 8]")
# The largest balloon, out to 6.75, lies over the inlet tab, 3.1 wide from 3.25 to 8.25.
TOP = (*ONE, "chamber.diameter=[5, 5, 12]")


class Fault(NamedTuple):
    rule: str
    design: tuple[str, ...]
    layer: int
    change: Callable[[Region], Region]
    measured: float
    pieces: int | None = None


def between_axes(start: int, end: int, width: float) -> Region:
    """A strip from one chamber's axis to another's (3-DoF: axes 4.25 from the lumen's)."""
    a, b = (
        (4.25 * math.cos(math.tau * i / 3), 4.25 * math.sin(math.tau * i / 3)) for i in (start, end)
    )
    return strip(a, b, width)


TESTED_APART = {
    "press-fit",
    "pressure-rating",
    "pin-fit",
    "registration-worst-case",
    "registration-yield",
    "nets",
}
"""Rules that no change of one layer's profile breaks alone; nets has its own faults."""
SILENT = {"nets"}
"""Rules that say nothing of a design without the keys that they read."""
# The first fault of a rule is the one that its reference page shows.
FAULTS = {
    "narrow neck ring": Fault(
        "bond-width", ONE, 4, lambda mask: disc(AXIS, 3.75) - disc(AXIS, 1.2), 0.7
    ),
    "wide pocket": Fault(
        "bond-width", ONE, 10, lambda mask: disc(AXIS, 2.55) - disc(AXIS, 0.5), 0.7
    ),
    "pocket off its axis": Fault(
        "bond-width", ONE, 6, lambda mask: disc((0.1, 0.0), 2.5) - disc(AXIS, 0.5), 0.65
    ),
    "separator grown too little": Fault(
        "mask-overhang", ONE, 8, lambda mask: disc(AXIS, 3.65) - disc(AXIS, 1.25), 0.4
    ),
    # The outline ends 5.75 past the third axis, the mask 0.5 further.
    "bite out of the sheet's separator": Fault(
        "mask-overhang",
        RADIAL,
        2,
        lambda mask: mask - rectangle((5 * math.pi + 6.05, -3), (30, 3)),
        0.3,
    ),
    "strip flush with the tab's end": Fault(
        "mask-overhang", ONE, 2, lambda mask: mask - rectangle((8.25, -1), (10, 1)), 0.0
    ),
    "mask no larger than the smaller neighbour": Fault(
        "facing-films",
        WAIST,
        8,
        lambda mask: disc(AXIS, 3.75) - disc(AXIS, 1.25),
        math.pi * (4.75**2 - 3.75**2),
    ),
    "mask that just covers the films": Fault(
        "facing-films", WAIST, 8, lambda mask: disc(AXIS, 5.1) - disc(AXIS, 1.25), 0.35
    ),
    "tab under a larger balloon": Fault(
        "facing-films",
        TOP,
        8,
        lambda mask: mask - rectangle((4.5, -3.0), (5.5, 3.0)) - rectangle((6.0, -3.0), (8.0, 3.0)),
        3.1,
        2,
    ),
    "mask that ends within the rim": Fault(
        "facing-films",
        ONE,
        4,
        lambda mask: disc(AXIS, 2.4) - disc(AXIS, 1.25),
        math.pi * (3.25**2 - 2.4**2),
    ),
    # Three pockets of each chamber, two of which have become one.
    "strip between two chambers": Fault(
        "sealing", LOBED, 6, lambda mask: mask | between_axes(0, 1, 0.7) - bores(), 5.0, 2
    ),
    "hole in the base": Fault("sealing", ONE, 1, lambda base: base - disc((1.5, 0.0), 0.5), 1.0),
    "hole in a wall between two balloons": Fault(
        "sealing", ONE, 7, lambda wall: wall - disc((0.0, 1.7), 0.3), 1.0
    ),
    "hole in the cap": Fault("sealing", ONE, 11, lambda cap: cap - disc((-1.5, 0.0), 0.2), 1.0),
    "pocket left out": Fault(
        "sealing", LOBED, 10, lambda mask: mask - disc((4.25, 0.0), 2.6), 1.0, 2
    ),
    "narrow bore in a mask": Fault(
        "channel-clear", ONE, 6, lambda mask: disc(AXIS, 2.5) - disc(AXIS, 0.4), 0.8
    ),
    "no bore in a mask": Fault("channel-clear", ONE, 6, lambda mask: disc(AXIS, 2.5), 0.0),
    "mask over the lumen": Fault(
        "channel-clear", LOBED, 8, lambda mask: mask | disc(AXIS, 1.1), 0.0
    ),
    "strip with a narrow place": Fault(
        "tube-fit", ONE, 2, lambda mask: mask - rectangle((5.0, 0.5), (6.0, 1.0)), 1.2
    ),
    "narrow strip": Fault(
        "tube-fit",
        ONE,
        2,
        lambda mask: (disc(AXIS, 2.5) | strip(AXIS, (8.75, 0.0), 1.3)) - disc(AXIS, 0.5),
        1.2,
    ),
    "mask island in the waste": Fault(
        "piece-count", ONE, 6, lambda mask: mask | disc((6.0, 0.0), 0.5), 1.0
    ),
    "slit in a mask": Fault(
        "film-limits",
        ONE,
        4,
        lambda mask: grow(mask, 1.5) - rectangle((3.95, -0.05), (4.45, 0.05)) - disc(AXIS, 1.25),
        0.1,
    ),
    "neck ring off its axis": Fault(
        "registration-nominal",
        ("1dof-5mm", "stack.balloons=3", "bond.width=1.0", "mask.overhang=0.7"),
        4,
        lambda mask: (mask | disc(AXIS, 2.0)) - disc((0.0, 0.02), 1.5),
        0.02,
    ),
    "cap off its place": Fault(
        "registration-nominal",
        ("1dof-5mm", "stack.balloons=3", "bond.width=1.0", "mask.overhang=0.7"),
        11,
        lambda cap: cap.moved(0.01, 0.0),
        0.01,
    ),
}
# One layer of its kind: no other tells that its hole is missing.
FAULTS |= {
    "sheet without a tooling hole": Fault(
        "pin-holes", ("radial-15mm", EARS), 1, lambda sheet: closed(sheet, "sheet1"), 2.0
    ),
    "sheet's separator without a tooling hole": Fault(
        "pin-holes", ("radial-15mm", EARS), 2, lambda mask: closed(mask, "mask2.1"), 2.0
    ),
    "tail without its hole": Fault(
        "pin-holes", (*ONE, EARS), 2, lambda mask: closed(mask, "strip1", ONE), 2.0
    ),
}


def closed(part: Region, pin: str, design: tuple[str, ...] = ("radial-15mm",)) -> Region:
    """The part without the hole that it has at a pin."""
    pins = built(*design, EARS).pins
    (centre,) = (p.centre for p in pins if p.name == pin)
    assert not part.contains(centre)
    return part | disc(centre, 0.8)


def bores() -> Region:
    a, b = ((4.25 * math.cos(math.tau * i / 3), 4.25 * math.sin(math.tau * i / 3)) for i in (0, 1))
    return disc(a, 0.5) | disc(b, 0.5)


# Without a target no share of good builds fails, so a few builds will do.
FEW = PAPER.with_("rules.yield_builds=100")
# Faults as drawn; what errors add is tested apart.
EXACT = FEW.with_(registration=errors())


def failing(laminate: Laminate, limits: Design = FEW) -> set[str]:
    findings = run_deck(laminate, limits)
    return {finding.rule for finding in findings if finding.verdict == "fail"}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_caught_by_its_rule_alone(
    name: str, good: Callable[..., Laminate], spoil: Callable[..., Laminate]
) -> None:
    fault = FAULTS[name]
    laminate = good(*fault.design)
    faulty = spoil(
        laminate, fault.layer, fault.change(laminate.layer(fault.layer).profile), fault.pieces
    )
    (found,) = (f for f in run_deck(faulty, EXACT) if f.verdict == "fail")
    assert found.rule == fault.rule
    assert found.measured == pytest.approx(fault.measured, abs=1e-5)
    assert fault.layer in found.where.layers or fault.rule == "sealing"
    assert found.where.x is not None


def test_a_laminate_past_the_platen_fails_press_fit_alone(good: Callable[..., Laminate]) -> None:
    laminate = good("1dof-5mm", "chamber.diameter=150")
    assert failing(laminate) == {"press-fit"}
    assert failing(good("1dof-5mm", "chamber.diameter=140")) == set()


def test_a_pocket_too_wide_for_its_pressure_fails_pressure_rating_alone(
    good: Callable[..., Laminate], spoil: Callable[..., Laminate]
) -> None:
    """367 kPa with a radius of 2.5 mm (paper, Sec. 4), in proportion: 340 at 2.7."""
    laminate, limits = (
        good("1dof-5mm", "bond.width=1"),
        FEW.with_("acceptance.working_pressure_kpa=170.0"),
    )
    assert failing(laminate, limits) == set()
    wider = spoil(laminate, 6, disc(AXIS, 2.71) - disc(AXIS, 0.5), None)
    assert failing(wider, FEW.with_("acceptance.working_pressure_kpa=169.0")) == set()
    (found,) = (f for f in run_deck(wider, limits) if f.verdict == "fail")
    assert found.rule == "pressure-rating"
    assert found.measured == pytest.approx(367 * 2.5 / 2.71)
    assert 6 in found.where.layers


def test_kerf_that_closes_a_bore_fails_film_limits_alone(good: Callable[..., Laminate]) -> None:
    laminate = good(*ONE, "bore.diameter=0.95")
    assert failing(laminate, EXACT.with_("laser.kerf_tpe=0.1", "laser.kerf_ptfe=0.1")) == set()
    assert failing(laminate, EXACT.with_("laser.kerf_ptfe=1")) == {"film-limits"}


def test_a_pin_too_thick_for_its_holes_fails_pin_fit_alone(good: Callable[..., Laminate]) -> None:
    # A hole of 1.0 with the cutting error of 0.1 on each side, and a pin of 1.19 to m6.
    cut = EXACT.with_(registration=errors(cutting=0.1), rules={"worst_bond_width": 0.0})
    cut = cut.with_("rules.worst_mask_overhang=0.0")
    thick = good(*ONE, "bore.pin_diameter=1.19")
    assert failing(good(*ONE), cut) == set()
    assert failing(thick, cut) == {"pin-fit"}
    (found,) = (f for f in run_deck(thick, cut) if f.rule == "pin-fit")
    assert found.measured == pytest.approx(1.198 / 0.8 - 1)
    assert found.where.layers == (2,)


def test_every_rule_has_a_fault_of_its_own() -> None:
    assert {fault.rule for fault in FAULTS.values()} | TESTED_APART == set(rule_names())


GOOD = [
    *dict.fromkeys(fault.design for fault in FAULTS.values()),
    *((template,) for template in ("1dof-5mm", "1dof-10mm", "3dof-15mm", "radial-15mm", "pouch")),
    *few([("3dof-15mm", f"chamber.count={n}", "stack.balloons=2") for n in range(2, 9)], 3),
    ("1dof-5mm", "stack.balloons=1"),
    ("1dof-5mm", "stack.balloons=3", "chamber.diameter=[7, 6, 5]"),
    RADIAL,
    ("radial-15mm", "stack.balloons=2", "inlet.manifold=true"),
]


@pytest.mark.parametrize("design", GOOD)
def test_good_laminates_pass(design: tuple[str, ...], good: Callable[..., Laminate]) -> None:
    assert failing(good(*design)) == set()


def test_findings_come_in_the_decks_order(good: Callable[..., Laminate]) -> None:
    found = list(dict.fromkeys(finding.rule for finding in run_deck(good(*LOBED), FEW)))
    assert found == [name for name in rule_names() if name not in SILENT]


def test_ears_that_vanished_from_all_films(good: Callable[..., Laminate]) -> None:
    """The plate is drilled for them; where no hole tells an ear, its bond past the mask counts."""
    laminate = good("1dof-5mm", "stack.balloons=3", EARS)
    tools = [pin for pin in laminate.pins if pin.name.startswith("film")]

    def earless(profile: Region) -> Region:
        for pin in tools:
            profile = profile | disc(pin.centre, 0.8)
        return profile

    layers = tuple(
        layer
        if layer.is_mask
        else replace(layer, profile=earless(layer.profile), pattern=f"{layer.pattern}x")
        for layer in laminate.layers
    )
    laminate = replace(laminate, layers=layers)
    assert failing(laminate, EXACT) == {"pin-holes", "facing-films"}
    (found,) = pin_holes.check(Measures(laminate, EXACT))
    assert found.id == "pin-holes.loose"
    # Three patterns of film (tabbed base, tabbed wall, wall, cap) hang on nothing, two pins idle.
    assert found.measured >= 5


@pytest.mark.parametrize(("rule", "module"), [(bond_width, measures), (film_limits, film_limits)])
def test_equal_profiles_are_measured_once(
    rule: object, module: object, good: Callable[..., Laminate], monkeypatch: pytest.MonkeyPatch
) -> None:
    measured: list[Region] = []
    original = module.least_width

    def counting(region: Region, *more: float) -> object:
        measured.append(region)
        return original(region, *more)

    monkeypatch.setattr(module, "least_width", counting)
    counts = []
    for balloons in (4, 40):
        measured.clear()
        rule.check(Measures(good("1dof-5mm", f"stack.balloons={balloons}"), PAPER))
        counts.append(len(measured))
    assert counts[0] == counts[1] > 0


def test_what_is_measured_once_is_measured_of_that_laminate(good: Callable[..., Laminate]) -> None:
    one = Measures(good("1dof-5mm", "stack.balloons=2"), PAPER)
    more = Measures(good("1dof-5mm", "stack.balloons=4"), PAPER)
    assert len(one.moves) < len(more.moves)
    assert one.moves is one.moves
    wide = PAPER.with_("registration.hand_placement=0.4")
    assert Measures(one.laminate, wide).moves != one.moves


# Limits below the usual ones are named, each with its key; stricter ones are not.


WEAKER = [
    ("rules.bond_width=0.3", "bond_width 0.3 (paper 0.75)"),
    ("rules.mask_overhang=0.4", "mask_overhang 0.4 (paper 0.5)"),
    ("rules.worst_bond_width=0", "worst_bond_width 0 (default 0.5)"),
    ("rules.worst_mask_overhang=0.1", "worst_mask_overhang 0.1 (default 0.25)"),
    ("rules.validated_balloons=40", "validated_balloons 40 (paper 20)"),
    ("laser.least_feature=0.1", "least_feature 0.1 (default 0.2)"),
    ("laser.unknown_kerf=0.05", "unknown_kerf 0.05 (default 0.1)"),
    ("registration.pin_stretch=0.5", "pin_stretch 0.5 (default 0.3)"),
    ("registration.cutting_error=0.05", "cutting_error 0.05 (paper 0.1)"),
    ("registration.pin_error=0.001", "pin_error 0.001 (paper 0.004)"),
    ("registration.hand_placement=0.05", "hand_placement 0.05 (default 0.08)"),
    ("registration.hand_turn=0.2", "hand_turn 0.2 (default 0.4)"),
    ("rules.opening_pressure_kpa=150", "opening_pressure_kpa 150 (default 100)"),
    ("rules.dead_end=5", "dead_end 5 (default 2)"),
]
NO_LIMITS = {"waive", "target_yield", "yield_builds", "kerf_tpe", "kerf_ptfe"} | {
    "cut_speed",
    "travel_speed",
    "pierce_seconds",
    "heat_distance",
    "machine",
    "recipe",
    "hold_tpe",
    "hold_ptfe",
}


@pytest.mark.parametrize(("setting", "said"), WEAKER)
def test_a_lower_limit_is_named(setting: str, said: str) -> None:
    assert lowered(load_design("1dof-5mm", [setting])) == (said,)


def test_stricter_ones_are_not() -> None:
    stricter = ["rules.bond_width=0.8", "rules.validated_balloons=10", "laser.least_feature=0.3"]
    stricter += ["registration.hand_turn=2", "rules.dead_end=1", "rules.target_yield=0.5"]
    for template in ("1dof-5mm", "3dof-15mm", "radial-15mm"):
        assert lowered(load_design(template, stricter)) == lowered(load_design(template)) == ()


def test_every_key_of_rules_and_laser_is_decided_on() -> None:
    keys = {*Rules.model_fields, *Laser.model_fields} - NO_LIMITS
    named = {said.split()[0] for _, said in WEAKER}
    assert keys <= named


def test_the_findings_of_its_rules_say_so() -> None:
    design = load_design("1dof-5mm", ["stack.balloons=2", "rules.bond_width=0.3"])
    findings = run_deck(build(design), design)
    said = {f.rule for f in findings if "limits lowered: bond_width 0.3 (paper 0.75)" in f.message}
    assert said == {"bond-width", "tube-fit"}
    assert not any("lowered" in f.message for f in findings if f.rule not in said)


# The deck makes no objects that hold each other: what it leaves is freed at once, and memory stays
# flat however seldom Python looks for rings.


@pytest.mark.parametrize(
    ("template", "method"),
    few(product(("1dof-5mm", "3dof-15mm", "radial-15mm"), ("channel-pin", "ears")), 3, names=2),
)
def test_a_deck_leaves_no_rings(template: str, method: str) -> None:
    def asked(overhang: float) -> tuple[Laminate, Design]:
        made = load_design(
            template, [f'registration.method="{method}"', f"mask.overhang={overhang}"]
        )
        return build(made), made

    # Once before, for what is loaded and compiled at the first time.
    run_deck(*asked(0.53))
    other = asked(0.57)
    gc.collect()
    gc.disable()
    try:
        run_deck(*other)
        assert gc.collect() == 0
    finally:
        gc.enable()
