"""Whole findings of the rules on channels and tubes."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import pytest

from sbafab.actuators import build, load_design
from sbafab.geometry.region import Region, disc, rectangle, strip
from sbafab.laminate.joints import Port
from sbafab.laminate.laminate import Laminate
from sbafab.rules import channel_clear, sealing, tube_fit
from sbafab.rules.finding import Finding, Place
from sbafab.rules.measures import Measures
from tests.designs import PAPER
from tests.rules.compared import only, same

AXIS = (0.0, 0.0)
LIMITS = PAPER
ONE = ("1dof-5mm", "stack.balloons=3")
LOBED = ("3dof-15mm", "stack.balloons=3")
TUBE = math.pi / 2 * (0.8 + 0.025)
"""A tube of 0.8 and the strip of 0.025 beside it, opened flat."""
WIDER = "make it 1.596 mm wide, by inlet.width or in the shape of a drawn layer"
"""That, 0.1 for the cutting error of each edge, and 0.1 for a kerf that nobody measured."""
NOWHERE = Place()
Good = Callable[..., Laminate]
Spoil = Callable[..., Laminate]


def test_channel_clear_of_a_narrow_bore(good: Good, spoil: Spoil) -> None:
    narrow = spoil(good(*ONE), 6, disc(AXIS, 2.5) - disc(AXIS, 0.4))
    assert same(
        only(channel_clear.check(Measures(narrow, LIMITS))),
        Finding(
            "channel-clear",
            "fail",
            1.0,
            0.8,
            "mm",
            Place(None, (6,), 0.0, 0.0),
            "the bore of chamber1 passes 0.800 mm, x 0.000, y 0.000, and should pass 1; layer 6 "
            "(006_PTFE_chamber-mask) stands in the way: open or align its hole",
        ),
    )


def test_channel_clear_of_the_lumen_in_the_cap(good: Good, spoil: Spoil) -> None:
    laminate = good(*LOBED)
    cap = (laminate.layer(11).profile | disc(AXIS, 1.5)) - disc(AXIS, 0.9)
    assert same(
        only(channel_clear.check(Measures(spoil(laminate, 11, cap), LIMITS))),
        Finding(
            "channel-clear",
            "fail",
            2.0,
            1.8,
            "mm",
            Place(None, (11,), 0.0, 0.0),
            "the lumen passes 1.800 mm, x 0.000, y 0.000, and should pass 2; layer 11 "
            "(011_TPE_cap) stands in the way: open or align its hole",
        ),
    )


def test_channel_clear_of_an_open_bore(good: Good) -> None:
    assert same(
        only(channel_clear.check(Measures(good(*ONE), LIMITS))),
        Finding(
            "channel-clear",
            "pass",
            1.0,
            1.0,
            "mm",
            Place(None, (2,), 0.0, 0.0),
            "the bore of chamber1 passes 1.000 mm, x 0.000, y 0.000",
        ),
    )


def test_channel_clear_beside_an_island_in_a_wide_bore(good: Good, spoil: Spoil) -> None:
    # The island's edge lies 0.4 from the axis; 0.05 to its other side both it and the other
    # layers' bores of 1.0 leave 0.45.
    island = (disc(AXIS, 2.5) - disc(AXIS, 0.9)) | disc((0.6, 0.0), 0.2)
    found = only(channel_clear.check(Measures(spoil(good(*ONE), 6, island), LIMITS)))
    assert found.measured == pytest.approx(0.9, abs=1e-4)
    assert found.where.x == pytest.approx(-0.05, abs=1e-3)


def test_channel_clear_without_channels(good: Good) -> None:
    bare = replace(good(*ONE), bores=())
    assert channel_clear.check(Measures(bare, LIMITS)) == [
        Finding(
            "channel-clear",
            "pass",
            None,
            None,
            "mm",
            NOWHERE,
            "no balloon is joined to another, so there is no channel to keep clear",
        )
    ]


def test_a_bore_ends_below_the_cap(good: Good, spoil: Spoil) -> None:
    # Neither base nor cap has a hole; the topmost mask must have one.
    closed = spoil(good(*ONE), 10, disc(AXIS, 2.5))
    found = only(channel_clear.check(Measures(closed, LIMITS)))
    assert (found.measured, found.where) == (0.0, Place(None, (10,), 0.0, 0.0))


@pytest.mark.parametrize("turn", [0.0, 120.0, 240.0])
@pytest.mark.parametrize(("left", "right"), [(-0.05, 0.1), (-0.1, 0.05), (-0.2, 0.3)])
def test_a_channel_through_a_slit(
    turn: float, left: float, right: float, good: Good, spoil: Spoil
) -> None:
    # A slit aside of each chamber's axis; its width is all that passes.
    laminate = good(*LOBED)
    slit = rectangle((4.25 + left, -2.0), (4.25 + right, 2.0)).turned(turn)
    wall = laminate.layer(7).profile
    bore = disc((4.25, 0.0), 0.6).turned(turn)
    found = only(channel_clear.check(Measures(spoil(laminate, 7, (wall | bore) - slit), LIMITS)))
    assert found.measured == pytest.approx(right - left, abs=1e-4)
    assert found.where.layers == (7,)


@pytest.mark.parametrize("diameter", [0.6, 1.0, 1.4])
def test_channels_of_other_diameters(diameter: float, good: Good, spoil: Spoil) -> None:
    laminate = good(*ONE, f"bore.diameter={diameter}")
    radius = diameter / 2
    for layer, y in ((5, 0.1), (7, -0.1)):
        laminate = spoil(laminate, layer, disc(AXIS, 3.25) - disc((0.0, y), radius))
    found = only(channel_clear.check(Measures(laminate, LIMITS)))
    assert found.measured == pytest.approx(diameter - 0.2, abs=1e-4)


def test_a_round_hole_is_measured_exactly(good: Good, spoil: Spoil) -> None:
    narrow = spoil(good(*ONE), 6, disc(AXIS, 2.5) - disc(AXIS, 0.3))
    assert only(channel_clear.check(Measures(narrow, LIMITS))).measured == pytest.approx(
        0.6, abs=1e-12
    )


def test_tube_fit_at_the_mouth(good: Good) -> None:
    assert same(
        only(tube_fit.check(Measures(good(*ONE), LIMITS))),
        Finding(
            "tube-fit",
            "pass",
            TUBE,
            1.3,
            "mm",
            Place(1, (1, 2, 3), 8.25, 0.0),
            "the mouth of chamber1 is drawn 1.600 mm wide, x 8.250, y 0.000, and cut 1.300 at "
            "worst (0.1 on each edge, kerf up to 0.1); a tube of 0.8 beside its strip needs 1.296",
        ),
    )


def test_tube_fit_of_a_strip_with_a_narrow_place(good: Good, spoil: Spoil) -> None:
    mask = good(*ONE).layer(2).profile - rectangle((5.0, 0.65), (6.0, 1.0))
    found = only(tube_fit.check(Measures(spoil(good(*ONE), 2, mask), LIMITS)))
    assert (found.verdict, found.where.interface) == ("fail", 1)
    assert found.message.startswith("the strip of chamber1 is drawn 1.450 mm wide, x ")
    assert found.message.endswith(f"; a tube of 0.8 beside its strip needs 1.296: {WIDER}")


def test_tube_fit_of_a_narrow_mouth(good: Good, spoil: Spoil) -> None:
    mask = (disc(AXIS, 2.5) | strip(AXIS, (8.75, 0.0), 1.4)) - disc(AXIS, 0.5)
    assert same(
        only(tube_fit.check(Measures(spoil(good(*ONE), 2, mask), LIMITS))),
        Finding(
            "tube-fit",
            "fail",
            TUBE,
            1.1,
            "mm",
            Place(1, (1, 2, 3), 8.25, 0.0),
            "the mouth of chamber1 is drawn 1.400 mm wide, x 8.250, y 0.000, and cut 1.100 at "
            "worst (0.1 on each edge, kerf up to 0.1); a tube of 0.8 beside its strip needs 1.296: "
            f"{WIDER}",
        ),
    )


def test_a_strip_as_wide_as_the_remedy_says_passes(good: Good, spoil: Spoil) -> None:
    for width, verdict in ((1.590, "fail"), (1.596, "pass")):
        mask = (disc(AXIS, 2.5) | strip(AXIS, (8.75, 0.0), width)) - disc(AXIS, 0.5)
        (found, *_) = tube_fit.check(Measures(spoil(good(*ONE), 2, mask), LIMITS))
        assert found.verdict == verdict


def test_drawn_layers_are_told_to_draw_their_strip_wider() -> None:
    laminate = build(load_design("pouch", ("inlet.tube_outer_diameter=2",)))
    (found, *_) = tube_fit.check(Measures(laminate, LIMITS))
    assert found.verdict == "fail"
    # No mask's film is thicker than 0.025 mm.
    needed = math.pi / 2 * (2 + 0.025) + 0.3
    assert f"make it {math.ceil(needed * 1000) / 1000:.3f} mm wide" in found.message
    assert "in the shape of a drawn layer" in found.message


def test_tube_fit_of_a_closed_mouth(good: Good, spoil: Spoil) -> None:
    mask = (disc(AXIS, 2.5) | strip(AXIS, (7.0, 0.0), 1.6)) - disc(AXIS, 0.5)
    assert same(
        only(tube_fit.check(Measures(spoil(good(*ONE), 2, mask), LIMITS))),
        Finding(
            "tube-fit",
            "fail",
            math.pi / 2 * 0.8,
            0.0,
            "mm",
            Place(None, (), 8.25, 0.0),
            "the mouth of chamber1 is drawn 0.000 mm wide, x 8.250, y 0.000, and cut 0.000 at "
            "worst (0.1 on each edge, kerf up to 0.1); a tube of 0.8 beside its strip needs 1.257: "
            "open a mask strip to the tab's end",
        ),
    )


def test_tube_fit_of_a_narrow_bond(good: Good, spoil: Spoil) -> None:
    mask = (disc(AXIS, 2.5) | strip((0.0, 0.1), (8.75, 0.1), 1.6)) - disc(AXIS, 0.5)
    found = only(tube_fit.check(Measures(spoil(good(*ONE), 2, mask), LIMITS)))
    assert found.message.startswith("the bond beside the strip of chamber1 is 0.650 mm wide, x ")
    assert found.message.endswith(
        "; to hold the tube it needs 0.750: make the tab wider, by bond.width or in the shape of a "
        "drawn layer"
    )


def test_tube_fit_of_two_faults_tells_the_worse(good: Good, spoil: Spoil) -> None:
    # A strip cut 1.0 wide is 0.296 too narrow;
    # 0.25 off the tab's middle it leaves 0.1 too little bond.
    mask = (disc(AXIS, 2.5) | strip((0.0, 0.25), (8.75, 0.25), 1.3)) - disc(AXIS, 0.5)
    found = only(tube_fit.check(Measures(spoil(good(*ONE), 2, mask), LIMITS)))
    assert found.limit == pytest.approx(TUBE)
    assert found.measured == pytest.approx(1.0)


def test_tube_fit_counts_no_kerf_that_is_known(good: Good) -> None:
    found = only(tube_fit.check(Measures(good(*ONE), PAPER.with_("laser.kerf_ptfe=0.12"))))
    assert found.measured == pytest.approx(1.4)
    assert "cut 1.400 at worst (0.1 on each edge); " in found.message


def test_tube_fit_of_a_mouth_off_its_place(good: Good, spoil: Spoil) -> None:
    # Its middle 0.6 from the inlet's, still within half the strip's width: 0.15 of bond is left.
    mask = (disc(AXIS, 2.5) | strip((0.0, 0.6), (8.75, 0.6), 1.6)) - disc(AXIS, 0.5)
    shifted = spoil(good(*ONE), 2, mask)
    found = only(tube_fit.check(Measures(shifted, LIMITS)))
    assert found.measured == pytest.approx(0.15)
    assert (found.where.interface, found.where.layers) == (1, (1, 2, 3))
    # The mouth ends 0.8 off its middle, the strip 1.4.
    leak = only(sealing.check(Measures(shifted, LIMITS)))
    assert (leak.verdict, leak.where.interface, leak.where.x) == ("fail", 1, 8.25)
    assert (
        "1.600 mm wide and reaches 0.600 mm past the end of the mouth of chamber1" in leak.message
    )


def test_tube_fit_without_inlets(good: Good) -> None:
    assert tube_fit.check(Measures(replace(good(*ONE), inlets=()), LIMITS)) == [
        Finding(
            "tube-fit",
            "fail",
            None,
            None,
            "mm",
            NOWHERE,
            "the laminate has no inlet, so no tube can be fitted; give every chamber one",
        )
    ]


def test_a_strip_that_opens_beside_its_inlet_is_no_mouth(good: Good, spoil: Spoil) -> None:
    """Moved by 1.62, its end lies 0.82 and more from the inlet's axis, outside the tube's 0.8."""
    laminate = good(*ONE)
    (inlet,) = laminate.inlets
    (x, y), (dx, dy) = inlet.mouth, inlet.direction

    def at(depth: float, off: float) -> tuple[float, float]:
        return x - depth * dx - off * dy, y - depth * dy + off * dx

    run = strip(at(inlet.length, 0.0), at(-5.0, 0.0), inlet.width)
    aside = strip(at(inlet.length, 1.62), at(-5.0, 1.62), inlet.width)
    mask = (laminate.layer(2).profile - run) | aside
    (found,) = tube_fit.check(Measures(spoil(laminate, 2, mask), LIMITS))
    assert (found.verdict, found.measured) == ("fail", 0.0)
    assert "open a mask strip to the tab's end" in found.message


def test_a_slit_farther_off_than_the_strip_is_wide_is_none_of_its_sides(
    good: Good, spoil: Spoil
) -> None:
    """On a tab that was widened: 2.0 from the inlet's axis, where 1.6 is looked at."""
    laminate = good(*ONE)
    (inlet,) = laminate.inlets
    (x, y), (dx, dy) = inlet.mouth, inlet.direction

    def at(depth: float, off: float) -> tuple[float, float]:
        return x - depth * dx - off * dy, y - depth * dy + off * dx

    wide = strip(at(inlet.length, 0.0), at(0.0, 0.0), 8.0)
    for index in (1, 3):
        laminate = spoil(laminate, index, laminate.layer(index).profile | wide)
    slit = strip(at(0.5, 2.15), at(inlet.length - 0.5, 2.15), 0.3)
    # A strip that bulges, which no shortcut for straight ones takes.
    bulge = disc(at(inlet.length / 2, 0.8), 0.1)
    laminate = spoil(laminate, 2, laminate.layer(2).profile | slit | bulge)
    (found,) = tube_fit.check(Measures(laminate, LIMITS))
    assert (found.verdict, found.measured) == ("pass", pytest.approx(1.6 - 0.3))


def test_a_strip_that_is_narrow_inside_the_mouth_is_so_wide_less_the_errors(
    good: Good, spoil: Spoil
) -> None:
    """0.9 wide from 1.2 inside the mouth on: 0.1 is lost on each edge, and a kerf of 0.1."""
    laminate = good(*ONE)
    (inlet,) = laminate.inlets
    (x, y), (dx, dy) = inlet.mouth, inlet.direction
    mask = laminate.layer(2).profile
    for off in (0.45 + 0.5, -0.45 - 0.5):
        ends = [(x - d * dx - off * dy, y - d * dy + off * dx) for d in (1.2, inlet.length + 5.0)]
        mask = mask - strip(*ends, 1.0)
    (found,) = tube_fit.check(Measures(spoil(laminate, 2, mask), LIMITS))
    assert (found.verdict, found.measured) == ("fail", pytest.approx(0.6))


def on_hole(good: Good, tube: float | None, *cut: Region) -> Laminate:
    """A pouch of 5 mm without an inlet, and a tube on the cap, from which more is ``cut``."""
    laminate = good(*ONE)
    cap = laminate.tpe_layers[-1]
    profile = cap.profile
    for region in cut:
        profile = profile - region
    gap = laminate.interfaces[-1]
    return replace(
        laminate,
        layers=(*laminate.layers[:-1], replace(cap, profile=profile, pattern="cap-with-hole")),
        inlets=(),
        ports=(Port("supply", gap.below.index, gap.above.index, AXIS, "hole", tube),),
    )


HOLE = disc(AXIS, 0.5)


def test_a_tube_covers_its_hole_as_cut_at_its_widest(good: Good) -> None:
    found = only(tube_fit.check(Measures(on_hole(good, 1.35, HOLE), LIMITS)))
    # A hole of 1.0, 0.1 off on each side, and a kerf of up to 0.1.
    assert (found.verdict, found.measured) == ("pass", 1.35)
    assert found.limit == pytest.approx(1.0 + 2 * 0.1 + 0.1)
    assert found.message == (
        "the hole of supply, x 0.000, y 0.000, is drawn 1.000 mm wide and cut 1.300 at worst; a "
        "tube of 1.35 is glued on it"
    )
    narrow = only(tube_fit.check(Measures(on_hole(good, 1.25, HOLE), LIMITS)))
    assert narrow.verdict == "fail"
    assert narrow.message.endswith(
        ": make the hole smaller, or take a wider tube (inlet.tube_outer_diameter)"
    )
    measured = PAPER.with_("laser.kerf_tpe=0.12")
    assert only(tube_fit.check(Measures(on_hole(good, 1.25, HOLE), measured))).verdict == "pass"


def test_a_hole_off_its_port_is_covered_by_so_much_less(good: Good) -> None:
    aside = disc((0.1, 0.0), 0.5)
    found = only(tube_fit.check(Measures(on_hole(good, 1.35, aside), LIMITS)))
    assert (found.verdict, found.limit) == ("fail", pytest.approx(2 * 0.6 + 0.3))


def test_a_tube_on_a_hole_needs_film_to_glue_it_on(good: Good) -> None:
    slot = rectangle((1.2, -0.5), (1.5, 0.5))
    found = only(tube_fit.check(Measures(on_hole(good, 3.0, HOLE, slot), LIMITS)))
    assert (found.verdict, found.limit) == ("fail", 0.75)
    assert found.measured == pytest.approx(1.2 - 0.5)
    assert "has 0.700 mm of film round it; to glue its tube on it needs 0.75: " in found.message
    farther = rectangle((1.3, -0.5), (1.5, 0.5))
    assert (
        only(tube_fit.check(Measures(on_hole(good, 3.0, HOLE, farther), LIMITS))).verdict == "pass"
    )


def test_a_tube_needs_its_hole(good: Good) -> None:
    found = only(tube_fit.check(Measures(on_hole(good, 3.0), LIMITS)))
    assert (found.verdict, found.measured) == ("fail", 0.0)
    assert found.message == (
        "the hole of supply, x 0.000, y 0.000, is in no outer film, so no tube can be glued there: "
        "draw it in the film"
    )


def test_a_tube_of_unknown_size_is_measured_by_the_film_round_its_hole(good: Good) -> None:
    found = only(tube_fit.check(Measures(on_hole(good, None, HOLE), LIMITS)))
    assert (found.verdict, found.limit) == ("pass", 0.75)


def test_a_laminate_without_inlet_and_hole_takes_no_tube(good: Good) -> None:
    found = only(tube_fit.check(Measures(replace(on_hole(good, 3.0, HOLE), ports=()), LIMITS)))
    assert (found.verdict, found.message) == (
        "fail",
        "the laminate has no inlet, so no tube can be fitted; give every chamber one",
    )
