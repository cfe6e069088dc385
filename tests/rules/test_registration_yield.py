"""The share of good builds against closed formulas for simple sums of errors."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import pytest

from sbafab.geometry.region import disc, rectangle
from sbafab.laminate.laminate import Laminate
from sbafab.rules.limits import Limits, Tolerances
from sbafab.rules.measures import Measures
from sbafab.rules.registration_yield import Share, check, simulate

Good = Callable[..., Laminate]
Spoil = Callable[..., Laminate]

ONE = ("1dof-5mm", "stack.balloons=3")
EARS = "registration.method=ears"
BUILDS = 20_000
# Four standard errors of a share of a half.
ROOM = 4 * 0.5 / BUILDS**0.5
CUT_ONLY = Tolerances(cutting=0.1, pin=0, placement=0, turn=0)


def limits(bond: float, tolerances: Tolerances) -> Limits:
    return Limits(
        worst_bond_width=bond, worst_mask_overhang=0.0, tolerances=tolerances, yield_builds=BUILDS
    )


@pytest.mark.parametrize("missing", [0.02, 0.06, 0.1, 0.15])
def test_two_cut_edges_add_to_a_triangle(missing: float, good: Good, spoil: Spoil) -> None:
    # A larger cap: the ring of the last pocket lies between the wall's edge and the mask's alone.
    laminate = spoil(good(*ONE), 11, disc((0.0, 0.0), 4.0))
    found = simulate(laminate, limits(0.75 - missing, CUT_ONLY))
    s = missing / 0.2
    # Slightly more: a build within a micrometre of its limit holds it.
    assert found.interfaces[5].value == pytest.approx(s + (1 - s * s) / 2, abs=ROOM + 0.005)


@pytest.mark.parametrize("missing", [0.02, 0.06, 0.1, 0.15])
def test_two_outlines_over_one_mask(missing: float, good: Good) -> None:
    found = simulate(good(*ONE), limits(0.75 - missing, CUT_ONLY))
    s = missing / 0.2
    # The nearer of two uniform errors against a third.
    assert found.interfaces[3].value == pytest.approx(s + (1 - s**3) / 3, abs=ROOM + 0.005)


def test_a_disc_laid_by_hand_keeps_a_ring_within_a_smaller_disc(good: Good) -> None:
    by_hand = Tolerances(cutting=0, pin=0, placement=0.2, turn=0)
    found = simulate(good(*ONE), limits(0.65, by_hand))
    # The cap may lie anywhere within 0.2; within 0.1 of its place it is good.
    assert found.interfaces[5].value == pytest.approx(0.25, abs=ROOM + 0.01)
    assert found.interfaces[3].value == 1.0


@pytest.mark.parametrize("turn", [0.0, 90.0, 180.0, 270.0])
def test_a_disc_laid_by_hand_keeps_a_straight_bond_beyond_a_chord(
    turn: float, good: Good, spoil: Spoil
) -> None:
    # A cap with one edge 0.7 from a square pocket's, all other edges far off.
    wall = rectangle((-9.0, -9.0), (9.0, 9.0)) - disc((0.0, 0.0), 0.5)
    pocket = rectangle((-2.5, -1.0), (1.0, 1.0)) - disc((0.0, 0.0), 0.5)
    cap = rectangle((-3.2, -8.0), (8.0, 8.0))
    laminate = good(*ONE)
    for layer, profile in ((9, wall), (10, pocket), (11, cap)):
        laminate = spoil(laminate, layer, profile.turned(turn))
    by_hand = Tolerances(cutting=0, pin=0, placement=0.2, turn=0)
    found = simulate(laminate, limits(0.6, by_hand))
    # Bad where it lies more than 0.1 towards the pocket: a segment of the disc of 0.2.
    segment = (math.acos(0.5) - 0.5 * math.sqrt(0.75)) / math.pi
    assert found.interfaces[5].value == pytest.approx(1 - segment, abs=ROOM + 0.003)


def test_the_whole_is_good_where_every_interface_is(good: Good) -> None:
    by_hand = Tolerances(cutting=0, pin=0, placement=0.2, turn=0)
    found = simulate(good(*ONE), limits(0.65, by_hand))
    # Cap, the separator in the middle, and the first separator are laid by hand, each by itself.
    product = 1.0
    for share in found.interfaces.values():
        product *= share.value
    assert found.whole.value < min(share.value for share in found.interfaces.values())
    assert found.whole.value == pytest.approx(product, abs=ROOM)


@pytest.mark.parametrize("cut", [0.0, 0.06, 0.15])
def test_builds_are_drawn_until_the_share_is_within_a_point(cut: float, good: Good) -> None:
    errors = Tolerances(cutting=0.1, pin=0, placement=0, turn=0)
    asked = Limits(worst_bond_width=0.75 - cut, worst_mask_overhang=0.0, tolerances=errors)
    share = simulate(good(*ONE), asked).whole
    low, high = share.interval
    assert high - low <= 0.0101
    # No more than that takes: a batch above 1.96^2 p (1 - p) / 0.005^2, or the first 10,000.
    p = min(max(0.5, low - 0.01), high + 0.01)
    assert share.builds <= max(10_000, p * (1 - p) * 392.0**2 + 5_000)


def test_middle_first_takes_a_placement_by_hand_less(good: Good) -> None:
    by_hand = Tolerances(cutting=0, pin=0, placement=0.2, turn=0)
    two = ("1dof-5mm", "stack.balloons=2")
    shares = [
        simulate(good(*two, f"registration.sequence={word}"), limits(0.6, by_hand)).whole.value
        for word in ("bottom-first", "middle-first")
    ]
    # Base, separator and cap are each laid by hand, and good within 0.15 of 0.2.
    assert shares[1] == pytest.approx((0.15 / 0.2) ** 6, abs=0.02)
    # With the bottom balloon pressed first, the upper one is laid on it by hand as well.
    assert shares[0] < 0.6 * shares[1]


def test_without_errors_every_build_is_good(good: Good) -> None:
    found = simulate(good(*ONE), limits(0.75, Tolerances(0, 0, 0, 0)))
    assert found.whole.value == 1.0


def test_a_seed_gives_the_same_builds_again(good: Good) -> None:
    laminate = good(*ONE)
    assert simulate(laminate, Limits()) == simulate(laminate, Limits())
    assert simulate(laminate, Limits(), 1).whole != simulate(laminate, Limits(), 2).whole


def test_smaller_errors_give_more_good_builds(good: Good) -> None:
    shares = [
        simulate(good(*ONE), Limits(tolerances=Tolerances(placement=p))).whole.value
        for p in (0.3, 0.2, 0.1, 0.0)
    ]
    assert shares == sorted(shares)
    assert shares[0] < shares[-1]


@pytest.mark.parametrize(
    ("good_builds", "builds", "low", "high"),
    [
        # Nine of ten, of a hundred: tabulated.
        (90, 100, 0.82563, 0.94477),
        # None and all: z^2 / (n + z^2) from the end.
        (0, 10, 0.0, 3.841459 / 13.841459),
        (10, 10, 10 / 13.841459, 1.0),
    ],
)
def test_wilson_intervals(good_builds: int, builds: int, low: float, high: float) -> None:
    assert Share(good_builds, builds).interval == pytest.approx((low, high), abs=1e-5)


def with_a_free_strip(laminate: Laminate) -> Laminate:
    """The pin of the inlet strip's tail left out, so that the bottom mask may turn."""
    pins = tuple(pin for pin in laminate.pins if pin.name != "strip1")
    return replace(laminate, pins=pins)


def test_a_target_decides_by_the_intervals_lower_end(good: Good) -> None:
    laminate = with_a_free_strip(good(*ONE, EARS))
    whole = simulate(laminate, Limits()).whole
    low, _ = whole.interval
    assert low < whole.value < 1
    (reached,) = check(Measures(laminate, Limits(target_yield=low)))
    (missed,) = check(Measures(laminate, Limits(target_yield=whole.value)))
    assert (reached.verdict, missed.verdict) == ("pass", "fail")
    assert missed.limit == missed.measured == whole.value
    assert missed.where.interface == 1


def test_without_a_target_less_than_the_papers_success_warns(good: Good) -> None:
    (many,) = check(Measures(with_a_free_strip(good(*ONE, EARS)), Limits()))
    (few,) = check(Measures(good(*ONE), Limits(tolerances=Tolerances(placement=0.2, turn=1.0))))
    assert (many.verdict, few.verdict) == ("pass", "warn")
    assert many.measured is not None
    assert few.measured is not None
    assert few.measured < 0.9 <= many.measured
    assert "by interface: " in few.message


def test_with_ears_every_build_is_good(good: Good) -> None:
    # No sum of the errors exceeds what bond and overhang have to spare.
    assert simulate(good(*ONE, EARS), Limits()).whole.value == 1
