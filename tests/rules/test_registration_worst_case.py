"""What the worst errors leave, against closed formulas and against profiles that shapely moves."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
import shapely
from shapely import affinity

from sbafab.actuators import load_design
from sbafab.design.records import Design
from sbafab.geometry.edges import Point
from sbafab.geometry.region import Region, disc
from sbafab.laminate.laminate import Laminate
from sbafab.rules import pin_fit
from sbafab.rules.deck import run_deck
from sbafab.rules.finding import Finding
from sbafab.rules.limits import TOLERANCE
from sbafab.rules.measures import Measures
from sbafab.rules.placement_errors import Freedom, Laid, Part, freedoms
from sbafab.rules.registration_worst_case import check, least_remaining
from tests.designs import PAPER, errors

Good = Callable[..., Laminate]
Spoil = Callable[..., Laminate]

AXIS = (0.0, 0.0)
# Layers: 1 base, 2 chamber mask, 3 wall, 4 separator mask, 5 wall, 6 chamber mask, ... 11 cap.
ONE = ("1dof-5mm", "stack.balloons=3")
LOBED = ("3dof-15mm", "stack.balloons=3")
EARS = "registration.method=ears"
DEGREE = math.radians(1)
STRIP_END = 2.5 + 0.75 + 5  # pocket, bond and tab


def measured(laminate: Laminate, tolerances: dict[str, float]) -> tuple[float, float]:
    bond, overhang = check(Measures(laminate, PAPER.with_(registration=tolerances)))
    assert bond.measured is not None
    assert overhang.measured is not None
    return bond.measured, overhang.measured


def left(laminate: Laminate, interface: int, quantity: str, tolerances: dict[str, float]) -> float:
    """What is left at an interface (or at one like it)."""
    return next(
        place.worst
        for place in least_remaining(Measures(laminate, PAPER.with_(registration=tolerances)))
        if place.quantity == quantity and interface in {i.index for i in place.interfaces}
    )


def test_cutting_and_pins_leave_what_the_papers_errors_say(good: Good) -> None:
    # Two cut edges at 0.1 and two layers on pins at 0.004.
    bond, overhang = measured(good(*ONE), {"hand_placement": 0, "hand_turn": 0})
    assert bond == pytest.approx(0.75 - 0.2 - 0.008, abs=1e-6)
    assert overhang == pytest.approx(0.5 - 0.2 - 0.008, abs=1e-6)


def test_a_plate_that_is_less_true_leaves_less(good: Good) -> None:
    """Four pins off their places cost twice that; the place of one pin alone costs nothing."""
    for machine, error in (("cnc-mill", 0.025 + 0.008 / 2), ("drill-press", 0.2 + 0.008 / 2)):
        made = f"registration.plate_made_by={machine}"
        tolerances = {"pin_error": load_design("3dof-15mm", [made]).pin_error, "hand_turn": 0}
        lobed, usual = good(*LOBED), {"hand_turn": 0}
        # Chamber mask and wall of a balloon in the middle: both hang on pins.
        lost = left(lobed, 3, "bond", usual) - left(lobed, 3, "bond", tolerances)
        assert lost == pytest.approx(2 * (error - 0.004), abs=1e-6)
        alone = check(Measures(good(*ONE), load_design("1dof-5mm", [made])))
        assert tuple(found.measured for found in alone) == measured(good(*ONE), {})


def test_without_errors_the_nominal_widths_are_left(good: Good) -> None:
    for design in (ONE, LOBED, (*LOBED, EARS)):
        assert measured(good(*design), errors()) == pytest.approx((0.75, 0.5))


def test_hand_placement_counts_once_for_each_time_a_layer_is_laid_by_hand(good: Good) -> None:
    only = errors(placement=0.2)
    laminate = good(*ONE)
    # Between walls on the pin a separator mask, which no pin holds, lies by hand.
    assert left(laminate, 4, "bond", only) == pytest.approx(0.55, abs=1e-6)
    # The first one lies so in the middle stack, and that stack so on the bottom balloon.
    assert left(laminate, 2, "bond", only) == pytest.approx(0.35, abs=1e-6)
    assert left(laminate, 2, "overhang", only) == pytest.approx(0.1, abs=1e-6)
    assert left(laminate, 3, "bond", only) == pytest.approx(0.75, abs=1e-6)
    # The cap.
    assert left(laminate, 5, "bond", only) == pytest.approx(0.55, abs=1e-6)


def without_tails(laminate: Laminate) -> Laminate:
    """The same laminate with the pins of the inlet strips' tails left out."""
    pins = tuple(pin for pin in laminate.pins if not pin.name.startswith("strip"))
    assert len(pins) < len(laminate.pins)
    return replace(laminate, pins=pins)


def test_a_turned_strip_costs_its_lever_arm(good: Good) -> None:
    # Only the chamber masks can turn then, about the pin in their bore.
    bond, _ = measured(without_tails(good(*ONE, EARS)), errors(turn=1))
    assert bond == pytest.approx(0.75 - STRIP_END * DEGREE, abs=1e-6)


def test_a_mask_on_the_lumens_pin_turns_about_the_lumen(good: Good) -> None:
    # The neck rings stand 4.25 from the lumen.
    neck = left(good(*LOBED), 4, "bond", errors(turn=1))
    assert neck == pytest.approx(0.75 - 4.25 * DEGREE, abs=1e-6)


@pytest.mark.parametrize(
    "more",
    [{"cutting_error": 0.15}, {"pin_error": 0.02}, {"hand_placement": 0.3}, {"hand_turn": 2}],
)
@pytest.mark.parametrize("design", [ONE, LOBED, (*LOBED, EARS)])
def test_larger_errors_never_leave_more(
    more: dict[str, float], design: tuple[str, ...], good: Good
) -> None:
    small = errors(cutting=0.01, pin=0.001, placement=0.02, turn=0.1)
    before = measured(good(*design), small)
    after = measured(good(*design), {**small, **more})
    assert after[0] <= before[0] + 1e-9
    assert after[1] <= before[1] + 1e-9
    by_hand = {"hand_placement", "hand_turn"}.intersection(more)
    assert after != before or (EARS in design and by_hand)


def shape(region: Region) -> shapely.Geometry:
    return shapely.union_all(
        [shapely.Polygon(rings[0], rings[1:]) for rings in region.polygons(1e-4)]
    )


def test_shapely_finds_the_same_ring_left_of_moved_and_miscut_layers(good: Good) -> None:
    laminate = good(*ONE)
    wall = shape(laminate.layer(5).profile).buffer(-0.1, quad_segs=64)
    mask = affinity.translate(shape(laminate.layer(6).profile).buffer(0.1, quad_segs=64), 0.008)
    ring = wall.exterior.distance(mask)
    predicted = left(laminate, 3, "bond", {"hand_placement": 0, "hand_turn": 0})
    assert ring == pytest.approx(predicted, abs=1e-3)


def by_rule(findings: tuple[Finding, ...], verdict: str) -> set[str]:
    return {finding.rule for finding in findings if finding.verdict == verdict}


def test_a_neck_ring_that_just_holds_as_drawn_is_caught_by_this_rule_alone(
    good: Good, spoil: Spoil
) -> None:
    narrow = spoil(good(*ONE), 8, disc(AXIS, 3.75) - disc(AXIS, 1.2))
    findings = run_deck(narrow, PAPER.with_("rules.bond_width=0.7"))
    assert by_rule(findings, "fail") == {"registration-worst-case"}
    (found,) = [f for f in findings if f.verdict == "fail"]
    # 0.7 - 0.2 - 0.008, and at least 0.08 less by hand.
    assert dict(facts(found)["firm"].facts)["value"] == pytest.approx(0.492, abs=1e-6)
    assert 8 in found.where.layers or found.measured < 0.412


@pytest.mark.parametrize("template", ["1dof-5mm", "1dof-10mm", "3dof-15mm", "radial-15mm"])
def test_templates_are_short_by_the_hand_only(template: str, good: Good) -> None:
    bond, overhang = check(Measures(good(template), PAPER))
    assert {bond.verdict, overhang.verdict} == {"warn"}
    assert cause(bond)[0] == f"{RULE}.hand"
    assert facts(bond)["advice"].id == f"{RULE}.align-or-ears"
    steady = check(
        Measures(
            good(template), PAPER.with_("registration.hand_placement=0", "registration.hand_turn=0")
        )
    )
    assert {finding.verdict for finding in steady} == {"pass"}


@pytest.mark.parametrize(
    "design",
    [
        ("1dof-5mm",),
        ("1dof-5mm", "stack.balloons=1"),
        ("1dof-10mm",),
        ("3dof-15mm",),
        ("3dof-15mm", "stack.balloons=1"),
        ("radial-15mm",),
        ("radial-15mm", "inlet.manifold=true"),
    ],
)
def test_ears_leave_nothing_to_the_hand(design: tuple[str, ...], good: Good) -> None:
    laminate = good(*design, EARS)
    held = check(Measures(laminate, PAPER))
    assert {finding.verdict for finding in held} == {"pass"}
    clumsy = check(
        Measures(laminate, PAPER.with_("registration.hand_placement=5", "registration.hand_turn=3"))
    )
    assert [f.measured for f in clumsy] == pytest.approx([f.measured for f in held])


def test_without_its_tails_pin_the_strip_turns(good: Good) -> None:
    bond, overhang = check(Measures(without_tails(good("3dof-15mm", EARS)), PAPER))
    assert (bond.verdict, overhang.verdict) == ("warn", "pass")
    assert cause(bond)[0] == f"{RULE}.turn"
    assert facts(bond)["count"] == 1
    assert facts(bond)["advice"].id == f"{RULE}.align"


def test_pieces_of_a_layer_move_by_themselves(good: Good) -> None:
    moves = Measures(good(*LOBED), PAPER).moves
    turns = [
        next(f for f in moves[Part(2, piece)] if f.step == 1 and f.centre is not None)
        for piece in range(3)
    ]
    assert len({turn.body for turn in turns}) == 3
    assert sorted(math.hypot(*(turn.centre or AXIS)) for turn in turns) == pytest.approx([4.25] * 3)
    # In step 2 the three are bonded to their wall, and lie with it on the base.
    assert len({f for piece in range(3) for f in moves[Part(2, piece)] if f.step == 2}) == 2


def test_more_balloons_cost_no_more_patterns(good: Good) -> None:
    few = least_remaining(Measures(good("1dof-5mm", "stack.balloons=6"), PAPER))
    many = least_remaining(Measures(good("1dof-5mm", "stack.balloons=60"), PAPER))
    assert [place.worst for place in many] == pytest.approx([place.worst for place in few])
    assert sum(len(p.interfaces) for p in many if p.quantity == "bond") == 119


# Why, by how much, and what helps: the facts of a finding.


def worst_of(laminate: Laminate, limits: Design) -> list[Finding]:
    return check(Measures(laminate, limits))


def facts(found: Finding) -> dict[str, Any]:
    return dict(found.says.facts)


def cause(found: Finding) -> tuple[str, float | None]:
    """What takes most, and how much, mm."""
    clause = facts(found)["cause"]
    own = dict(clause.facts)
    return (own["source"].id, own["cost"]) if "source" in own else (clause.id, None)


RULE = "registration-worst-case"
TURN = math.radians(2)
STEADY = ("registration.hand_placement=0", "registration.hand_turn=0")


@pytest.mark.parametrize(
    ("design", "limits", "source", "cost"),
    [
        (ONE, PAPER.with_(registration=errors()), "cutting", None),
        (ONE, PAPER.with_(*STEADY), "turn", 0.004),
        # Walls stand on the pins of three bores and of the lumen.
        (LOBED, PAPER.with_(*STEADY), "play", 0.004),
        # Wall and mask each turn about the pin in step 1, at the tab's end 8.25 from it.
        (ONE, PAPER.with_(registration=errors(turn=2)), "turn", 8.25 * TURN),
        # The first separator lies by hand in the middle stack, which lies so on the bottom balloon.
        (ONE, PAPER.with_(registration=errors(placement=0.3)), "hand", 0.3),
    ],
)
def test_the_largest_contribution_is_named(
    design: tuple[str, ...], limits: Design, source: str, cost: float | None, good: Good
) -> None:
    laminate = good(*design)
    if source == "play":
        films = (layer for layer in laminate.layers if not layer.is_mask)
        layers = tuple(replace(layer, index=i) for i, layer in enumerate(films, 1))
        laminate = replace(laminate, layers=layers)
        assert worst_of(laminate, limits)[1].id == f"{RULE}.no-overhang"
    bond = worst_of(laminate, limits)[0]
    assert cause(bond) == (f"{RULE}.{source}", cost and pytest.approx(cost))


def test_a_failure_tells_what_is_left_without_the_hand(good: Good) -> None:
    limits = PAPER.with_(registration=errors(cutting=0.2, pin=0.004, placement=0.2, turn=1.0))
    for found, firm in zip(worst_of(good(*ONE), limits), (0.342, 0.092), strict=True):
        assert (found.verdict, found.id) == ("fail", f"{RULE}.fails")
        # 0.75 - 2 x 0.2 - 2 x 0.004, and likewise from 0.5; less than nothing is reported as none.
        assert dict(facts(found)["firm"].facts)["value"] == pytest.approx(firm)
        assert found.measured == 0.0
        assert "at worst nothing remains of the " in found.message


def test_what_is_short_as_drawn_says_so(good: Good) -> None:
    limits = PAPER.with_(
        rules={
            "bond_width": 0.8,
            "worst_bond_width": 0.76,
            "mask_overhang": 0.6,
            "worst_mask_overhang": 0.55,
        },
        registration=errors(),
    )
    for found, count in zip(worst_of(good(*ONE), limits), (5, 3), strict=True):
        # Every ring is 0.75; at the walls' pin the mask's bore is flush, and meant to be.
        assert (found.verdict, facts(found)["count"]) == ("warn", count)
        assert facts(found)["why"].id == f"{RULE}.drawn-short"


@pytest.mark.parametrize(
    ("registration", "errs", "advice"),
    [
        ("channel-pin", {"placement": 0.3}, ("align-or-ears", "align-or-ears")),
        # As if its pins were ears already: what is still loose is for the hand.
        ("ears", {"placement": 0.3}, ("align", "align")),
        # The strip turns about the bore: 0.8 to the side at the mouth.
        ("channel-pin", {"turn": 2}, ("align-or-ears", "align")),
    ],
)
def test_care_is_advised_and_ears_where_they_help(
    registration: str, errs: dict[str, float], advice: tuple[str, str], good: Good
) -> None:
    limits = PAPER.with_(rules={"worst_mask_overhang": 0.48}, registration=errors(**errs))
    found = worst_of(replace(good(*ONE), registration=registration), limits)
    for one, sentence in zip(found, advice, strict=True):
        assert (one.verdict, facts(one)["advice"].id) == ("warn", f"{RULE}.{sentence}")
        assert one.remedy.startswith("align layer")
        assert one.message.startswith(f"{one.remedy}: at worst")


def test_a_plate_that_takes_a_jig_borer_names_the_command_for_a_mill(good: Good) -> None:
    tip, one = good("3dof-15mm", "stack.balloons=3"), good(*ONE)
    milled = load_design("1dof-5mm", ["registration.plate_made_by=cnc-mill"])
    plates = [
        (tip, load_design("1dof-5mm"), "jig-borer"),
        # A mill's plate, 0.029, leaves too little of the 0.75.
        (tip, milled, "how-much"),
        # The place of a plate's only pin does not matter.
        (one, load_design("1dof-5mm"), "no-plate"),
        (tip, PAPER, "no-plate"),
    ]
    for laminate, design, sentence in plates:
        bond, overhang = worst_of(laminate, design)
        assert facts(bond)["plate"].id == f"{RULE}.{sentence}"
        assert facts(overhang)["plate"].id == f"{RULE}.no-plate"
        assert (bond.verdict == "fail") == (design is milled)


# Layers on their pins: by how much they shift and turn, and how narrow a hole may come out.


BASE = Part(1, 0)


def ways_on(laminate: Laminate, pins: dict[Point, float]) -> tuple[Freedom, ...]:
    """Return the freedoms of the base, laid on pins with such play, mm."""
    laid = Laid([BASE], 1, pins, next(iter(pins)), None, stays=False)
    return freedoms(laminate, PAPER, [laid])[BASE]


@pytest.mark.parametrize(
    ("pins", "shift", "turn", "centre"),
    [
        # A lever: x and 10 - x from its fulcrum the ends go 0.1 and 0.3, so x = 2.5.
        ({(0.0, 0.0): 0.1, (10.0, 0.0): 0.3}, 0.1, 0.4 / 10, (2.5, 0.0)),
        ({(0.0, 0.0): 0.3, (10.0, 0.0): 0.1}, 0.1, 0.4 / 10, (7.5, 0.0)),
        ({(1.0, 2.0): 0.1, (1.0, 22.0): 0.1}, 0.1, 0.2 / 20, (1.0, 12.0)),
        # 3, 4, 5: where one pin has no play, the body turns about it.
        ({(0.0, 0.0): 0.0, (3.0, 4.0): 0.2}, 0.0, 0.2 / 5, (0.0, 0.0)),
        # The pair that leaves least decides: 0.2 in 20 before 0.4 in 10 and 0.4 in 22.4.
        ({(0.0, 0.0): 0.1, (10.0, 0.0): 0.3, (0.0, 20.0): 0.1}, 0.1, 0.2 / 20, (0.0, 10.0)),
    ],
)
def test_a_body_turns_about_the_point_that_divides_its_play(
    good: Good, pins: dict[Point, float], shift: float, turn: float, centre: Point
) -> None:
    aside, about = ways_on(good("1dof-5mm"), pins)
    assert aside.centre is None
    assert aside.most == pytest.approx(0.004 + shift)
    assert about.most == pytest.approx(turn)
    assert about.centre == pytest.approx(centre)


def test_pins_without_play_let_nothing_turn(good: Good) -> None:
    [aside] = ways_on(good("1dof-5mm"), {(0.0, 0.0): 0.0, (10.0, 0.0): 0.0})
    assert (aside.centre, aside.most) == (None, 0.004)


def test_cutting_and_pins_both_narrow_a_hole(good: Good) -> None:
    """A hole of 1 mm, its edge and its place off by 0.01 and 0.02 all round: 0.94. The pin of 0.6
    to m6 is up to 0.608 thick, which leaves 0.332; one of 0.99, up to 0.998, widens it.
    """
    limits = PAPER.with_("registration.cutting_error=0.01", "registration.pin_error=0.02")
    [loose] = pin_fit.check(Measures(good("1dof-5mm", "bore.pin_diameter=0.6"), limits))
    assert (loose.id, loose.verdict, loose.measured) == ("pin-fit.fit", "pass", 0.0)
    assert "(clearance 0.332 mm at worst)" in loose.message
    assert "may be cut 0.940 mm wide" in loose.message
    [tight] = pin_fit.check(Measures(good("1dof-5mm", "bore.pin_diameter=0.99"), limits))
    assert (tight.id, tight.verdict) == ("pin-fit.fit", "pass")
    # Findings are rounded to the sixth digit.
    assert tight.measured == pytest.approx(0.998 / 0.94 - 1, abs=5e-7)


@pytest.mark.parametrize(("missed", "verdict"), [(1.9, "pass"), (2.1, "fail")])
def test_a_stretch_may_miss_what_is_allowed_by_what_a_hole_may(
    good: Good, missed: float, verdict: str
) -> None:
    """The hole of 0.94 may miss its drawing by the tolerance on each side, two of them in all."""
    allowed = 0.998 / 0.94 - 1 - missed * TOLERANCE / 0.94
    limits = PAPER.with_(
        registration={"cutting_error": 0.01, "pin_error": 0.02, "pin_stretch": allowed}
    )
    [found] = pin_fit.check(Measures(good("1dof-5mm", "bore.pin_diameter=0.99"), limits))
    assert found.verdict == verdict
