"""What single rules measure, where they say it is, and what they say to a technician."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from sbafab.geometry.contour import circle
from sbafab.geometry.edges import Arc, Edge, Line
from sbafab.geometry.nearby import EdgeIndex
from sbafab.geometry.region import Region, disc, rectangle, strip, union
from sbafab.laminate.laminate import Laminate
from sbafab.rules import (
    bond_width,
    channel_clear,
    film_limits,
    mask_overhang,
    measures,
    piece_count,
    press_fit,
    sealing,
    tube_fit,
)
from sbafab.rules.boundary import outward_reach
from sbafab.rules.finding import Finding
from sbafab.rules.measures import Measures
from tests.designs import PAPER

AXIS = (0.0, 0.0)
LIMITS = PAPER
ONE = ("1dof-5mm", "stack.balloons=3")
LOBED = ("3dof-15mm", "stack.balloons=3")
Good = Callable[..., Laminate]
Spoil = Callable[..., Laminate]


@pytest.mark.parametrize(("radius", "verdict"), [(1.2495, "pass"), (1.2485, "fail")])
def test_a_micrometre_short_still_holds(
    radius: float, verdict: str, good: Good, spoil: Spoil
) -> None:
    laminate = spoil(good(*ONE), 4, disc(AXIS, 3.75) - disc(AXIS, radius))
    (found,) = bond_width.check(Measures(laminate, LIMITS))
    assert found.verdict == verdict
    assert found.measured == pytest.approx(radius - 0.5, abs=1e-9)


def test_bond_width_names_layers_place_and_remedy(good: Good, spoil: Spoil) -> None:
    laminate = spoil(good(*ONE), 6, disc((0.0, 0.1), 2.5) - disc(AXIS, 0.5))
    (found,) = bond_width.check(Measures(laminate, LIMITS))
    assert found.where.interface == 3
    assert found.where.layers == (5, 6, 7)
    # The ring from 2.6 to 3.25 on the side the pocket has moved to.
    assert (found.where.x, found.where.y) == pytest.approx((0.0, 2.925), abs=1e-9)
    assert "chamber interface 3" in found.message
    assert "it needs 0.75" in found.message


def test_a_bond_that_tapers_to_nothing_fails(good: Good, spoil: Spoil) -> None:
    # The pocket's circle touches the outline from within: between them the ring ends in cusps.
    (found,) = bond_width.check(
        Measures(spoil(good(*ONE), 6, disc((1.0, 0.0), 2.25) - disc(AXIS, 0.5)), LIMITS)
    )
    assert (found.verdict, found.measured) == ("fail", 0.0)
    assert (found.where.x, found.where.y) == pytest.approx((3.25, 0.0), abs=1e-5)


@pytest.mark.parametrize("turn", [10.0, 25.0, 40.0])
def test_a_strip_that_leaves_aslant_is_no_narrow_bond(
    turn: float, good: Good, spoil: Spoil
) -> None:
    # A square pocket turned under the strip: their edges meet at 90 degrees less ``turn``.
    pocket = rectangle((-1.7, -1.7), (1.7, 1.7)).turned(turn)
    mask = (pocket | strip(AXIS, (8.75, 0.0), 1.6)) - disc(AXIS, 0.5)
    (found,) = bond_width.check(Measures(spoil(good(*ONE), 2, mask), LIMITS))
    assert (found.verdict, found.measured) == ("pass", pytest.approx(0.75, abs=1e-9))


def test_a_mask_that_covers_all_leaves_no_bond(good: Good, spoil: Spoil) -> None:
    (found,) = bond_width.check(
        Measures(spoil(good(*ONE), 6, disc(AXIS, 4.0) - disc(AXIS, 0.5)), LIMITS)
    )
    assert (found.verdict, found.measured) == ("fail", 0.0)
    assert "nothing bonds" in found.message


def test_a_mask_beside_the_film_fails_overhang(good: Good, spoil: Spoil) -> None:
    found = mask_overhang.check(Measures(spoil(good(*ONE), 6, disc((20.0, 0.0), 2.0)), LIMITS))
    assert (found[0].verdict, found[0].measured) == ("fail", 0.0)
    assert found[0].where.interface == 3


def test_flush_masks_at_pins_are_waived_by_name(good: Good) -> None:
    laminate = good("3dof-15mm")
    main, *waived = mask_overhang.check(Measures(laminate, LIMITS))
    assert main.verdict == "pass"
    assert main.measured == pytest.approx(0.5, abs=1e-9)
    # Each bore is in all 15 pockets; the lumen bounds the film in the 14 separator interfaces.
    counts = [15 if pin.diameter == 1.0 else 14 for pin in laminate.pins]
    assert sorted(counts) == [14, 15, 15, 15]
    for finding, pin, count in zip(waived, laminate.pins, counts, strict=True):
        assert finding.verdict == "waived"
        assert finding.measured == pytest.approx(0.0, abs=1e-9)
        assert f"the dowel pin {pin.name} holds" in finding.message
        assert f"at {count} interfaces" in finding.message


def test_a_flush_mask_without_a_pin_fails(good: Good, spoil: Spoil) -> None:
    # The wall's bore, no longer the pin's size, bounds the pocket: nothing waives it.
    base = good(*ONE)
    wall = base.layer(3).profile | disc(AXIS, 1.0)
    laminate = spoil(
        spoil(base, 3, wall - disc(AXIS, 0.6)), 2, base.layer(2).profile - disc(AXIS, 0.6)
    )
    main = mask_overhang.check(Measures(laminate, LIMITS))[0]
    assert (main.verdict, main.measured) == ("fail", pytest.approx(0.0, abs=1e-9))


UP = Line((0.0, 0.0), (0.0, 4.0))
"""Its right-hand normal points along x."""
ALONG = Line((0.0, 0.0), (4.0, 0.0))
"""Its right-hand normal points down y."""
QUARTER = Arc((2.0, 0.0), (0.0, 2.0), AXIS, 2.0, True)
REACHES: list[tuple[Edge, Edge, float | None]] = [
    (UP, Line((1.5, -1.0), (1.5, 5.0)), 1.5),
    (UP, Line((1.0, -1.0), (3.0, 1.0)), 2.0 + 1e-5),
    (UP, Line((0.5, 4.0), (3.0, 4.0)), None),
    (UP, Line((0.3, 4.0), (0.3, 9.0)), None),
    (UP, Arc((3.0, 1.0), (3.0, 3.0), (3.0, 2.0), 1.0, False), 2.0),
    (UP, Line((-0.5, 1.0), (-0.5, 2.0)), None),
    (QUARTER, Line((5.0, 0.0), (0.0, 5.0)), 12.5**0.5 - 2),
    (QUARTER, circle(AXIS, 2.5).edges[0], 0.5),
    (QUARTER, circle(AXIS, 2.5).edges[2], None),
    (QUARTER, circle((4.0, 3.0), 1.0).edges[2], 2.0),
    (QUARTER.reversed(), circle(AXIS, 1.25).edges[0], 0.75),
    (QUARTER.reversed(), Line((-1.0, 0.5), (5.0, 0.5)), 1.5),
    (QUARTER.reversed(), circle((0.5, 0.5), 0.5).edges[0], 1.5 - 0.5**0.5),
    # Slanting away from a side of the band, or from its end: nearest on that side.
    (QUARTER, Line((3.0, -2.0), (5.0, 2.0)), 2.0),
    (QUARTER, Line((-2.0, 3.0), (2.0, 5.0)), 2.0),
    (ALONG, Line((-1.0, -1.0), (1.0, -3.0)), 2.0),
    (ALONG, Line((5.0, -1.0), (3.0, -3.0)), 2.0),
]


@pytest.mark.parametrize(("edge", "other", "expected"), REACHES)
def test_reach_along_the_normal(edge: Edge, other: Edge, expected: float | None) -> None:
    reach = outward_reach(edge, EdgeIndex([other]))
    if expected is None:
        assert reach is None
    else:
        assert reach is not None
        assert reach.value == pytest.approx(expected, abs=1.5e-5)


def only(findings: list[Finding]) -> Finding:
    (finding,) = findings
    return finding


def test_sealing_names_the_leak(good: Good, spoil: Spoil) -> None:
    base = good(*LOBED).layer(1).profile - disc((4.25, 1.5), 0.5)
    found = only(sealing.check(Measures(spoil(good(*LOBED), 1, base), LIMITS)))
    assert found.measured == 1
    assert found.message.startswith("chamber1 leaks to the outside at layer 1")
    assert (found.where.x, found.where.y) == pytest.approx((4.25, 1.5))


def test_sealing_finds_a_missing_neck_ring(good: Good, spoil: Spoil) -> None:
    found = only(
        sealing.check(Measures(spoil(good(*ONE), 8, disc(AXIS, 3.75) - disc(AXIS, 0.5)), LIMITS))
    )
    assert found.verdict == "fail"
    assert "slit between two balloons at interface 4" in found.message


def test_sealing_finds_a_pocket_open_at_the_edge(good: Good, spoil: Spoil) -> None:
    mask = good(*ONE).layer(6).profile | strip((1.0, 0.0), (4.0, 0.0), 0.4)
    found = only(sealing.check(Measures(spoil(good(*ONE), 6, mask), LIMITS)))
    assert found.where.interface == 3
    assert found.where.x == pytest.approx(3.25, abs=0.01)


def test_sealing_counts_the_pockets_a_closed_wall_cuts_off(good: Good, spoil: Spoil) -> None:
    laminate = good("1dof-5mm", "stack.balloons=5")
    found = only(sealing.check(Measures(spoil(laminate, 7, disc(AXIS, 3.25)), LIMITS)))
    assert found.measured == 3
    assert "reached from no inlet" in found.message


def test_sealing_finds_an_inlet_that_is_closed(good: Good, spoil: Spoil) -> None:
    mask = disc(AXIS, 2.5) - disc(AXIS, 0.5)
    assert only(sealing.check(Measures(spoil(good(*ONE), 2, mask), LIMITS))).measured == 3


def test_sealing_finds_a_pocket_open_to_the_lumen(good: Good, spoil: Spoil) -> None:
    laminate = good(*LOBED)
    mask = laminate.layer(6).profile | (strip(AXIS, (3.0, 0.0), 0.4) - disc(AXIS, 0.9))
    found = only(sealing.check(Measures(spoil(laminate, 6, mask), LIMITS)))
    assert found.message.startswith("chamber1 leaks")
    assert math.hypot(found.where.x or 0.0, found.where.y or 0.0) < 1.05


def lens(*centres: tuple[float, float]) -> list[Region]:
    return [disc(AXIS, 3.25) - disc(centre, 0.5) for centre in centres]


def test_channel_between_two_holes_is_their_lens(good: Good, spoil: Spoil) -> None:
    laminate = good(*ONE)
    for index, profile in zip((5, 7), lens((0.03, 0.04), (-0.03, -0.04)), strict=True):
        laminate = spoil(laminate, index, profile)
    found = only(channel_clear.check(Measures(laminate, LIMITS)))
    # Two circles of 1.0 whose centres stand 0.1 apart: the lens is 0.9 across.
    assert found.measured == pytest.approx(0.9, abs=1e-4)
    assert found.verdict == "fail"


def test_channel_between_three_holes(good: Good, spoil: Spoil) -> None:
    laminate = good(*ONE)
    centres = [
        (0.06 * math.cos(math.tau * i / 3), 0.06 * math.sin(math.tau * i / 3)) for i in range(3)
    ]
    for index, profile in zip((5, 7, 9), lens(*centres), strict=True):
        laminate = spoil(laminate, index, profile)
    found = only(channel_clear.check(Measures(laminate, LIMITS)))
    assert found.measured == pytest.approx(1.0 - 0.12, abs=1e-4)


def test_channel_through_a_square_hole(good: Good, spoil: Spoil) -> None:
    square = disc(AXIS, 3.25) - rectangle((-0.45, -0.6), (0.55, 0.6))
    found = only(channel_clear.check(Measures(spoil(good(*ONE), 7, square), LIMITS)))
    # The other layers' bores of 1.0 and the sides at -0.45: 0.95 between them.
    assert found.measured == pytest.approx(0.95, abs=1e-4)


def test_tube_fit_states_half_the_perimeter_of_tube_and_strip(good: Good) -> None:
    found = only(tube_fit.check(Measures(good("1dof-5mm"), LIMITS)))
    # Half a circle of 0.8 and half one of 0.85; the strip of 1.6 less 2 x 0.1 and a kerf of 0.1.
    assert found.limit == pytest.approx(math.pi * (0.8 + 0.85) / 4)
    assert found.measured == pytest.approx(1.3, abs=1e-9)


def test_tube_fit_wants_bond_beside_the_strip(good: Good, spoil: Spoil) -> None:
    # A strip 1.6 wide moved 0.1 sideways in a tab 3.1 wide leaves 0.65 on one side.
    mask = (disc(AXIS, 2.5) | strip((0.0, 0.1), (8.75, 0.1), 1.6)) - disc(AXIS, 0.5)
    found = only(tube_fit.check(Measures(spoil(good(*ONE), 2, mask), LIMITS)))
    assert (found.verdict, found.limit) == ("fail", 0.75)
    assert found.measured == pytest.approx(0.65, abs=1e-9)


def test_tube_fit_misses_a_strip_that_ends_inside(good: Good, spoil: Spoil) -> None:
    mask = (disc(AXIS, 2.5) | strip(AXIS, (7.0, 0.0), 1.6)) - disc(AXIS, 0.5)
    found = only(tube_fit.check(Measures(spoil(good(*ONE), 2, mask), LIMITS)))
    assert (found.verdict, found.measured) == ("fail", 0.0)


def test_piece_count_points_at_the_stray_piece(good: Good, spoil: Spoil) -> None:
    mask = union([good(*ONE).layer(6).profile, disc((6.0, 1.0), 0.5)])
    found = only(piece_count.check(Measures(spoil(good(*ONE), 6, mask), LIMITS)))
    assert (found.where.layers, found.where.x, found.where.y) == ((6,), 6.0, 1.0)
    assert "2 pieces and should fall into 1" in found.message


def test_film_limits_tells_a_web_from_a_slot(good: Good, spoil: Spoil) -> None:
    wall = disc(AXIS, 3.25) - disc(AXIS, 0.5) - disc((2.45, 0.0), 0.7)
    found = only(film_limits.check(Measures(spoil(good(*ONE), 7, wall), LIMITS)))
    assert found.measured == pytest.approx(0.1, abs=1e-9)
    assert "web" in found.message


def test_more_balloons_than_validated_are_warned_about(good: Good) -> None:
    assert len(press_fit.check(Measures(good("1dof-5mm", "stack.balloons=20"), LIMITS))) == 1
    _, warning = press_fit.check(Measures(good("1dof-5mm", "stack.balloons=21"), LIMITS))
    assert (warning.verdict, warning.limit, warning.measured) == ("warn", 20, 21)


def test_a_laminate_may_lie_either_way_round(good: Good) -> None:
    # 12.5 x 7.5 with the tab's mask strip.
    laminate = good("1dof-5mm")
    for width, length, verdict in ((8, 13, "pass"), (13, 8, "pass"), (12, 12, "fail")):
        limits = PAPER.with_(press={"platen_width": width, "platen_length": length})
        assert press_fit.check(Measures(laminate, limits))[0].verdict == verdict


@pytest.mark.parametrize(("rule", "module"), [(bond_width, measures), (film_limits, film_limits)])
def test_equal_profiles_are_measured_once(
    rule: object, module: object, good: Good, monkeypatch: pytest.MonkeyPatch
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
        rule.check(Measures(good("1dof-5mm", f"stack.balloons={balloons}"), LIMITS))
        counts.append(len(measured))
    assert counts[0] == counts[1] > 0


def test_what_is_measured_once_is_measured_of_that_laminate(good: Good) -> None:
    one = Measures(good("1dof-5mm", "stack.balloons=2"), PAPER)
    more = Measures(good("1dof-5mm", "stack.balloons=4"), PAPER)
    assert len(one.moves) < len(more.moves)
    assert one.moves is one.moves
    wide = PAPER.with_("registration.hand_placement=0.4")
    assert Measures(one.laminate, wide).moves != one.moves
