"""The share of good builds against closed formulas for simple sums of errors."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from sbafab.actuators import build, load_design
from sbafab.design.records import Design
from sbafab.geometry.region import disc, rectangle
from sbafab.laminate.laminate import Laminate
from sbafab.rules.finding import Place
from sbafab.rules.limits import TOLERANCE
from sbafab.rules.measures import Measures
from sbafab.rules.registration_yield import (
    Share,
    Yield,
    check,
    finding_of,
    short_builds,
    short_margins,
    simulate,
)
from tests.designs import PAPER, errors

Good = Callable[..., Laminate]
Spoil = Callable[..., Laminate]

ONE = ("1dof-5mm", "stack.balloons=3")
EARS = "registration.method=ears"
BUILDS = 20_000
# Four standard errors of a share of a half.
ROOM = 4 * 0.5 / BUILDS**0.5
CUT_ONLY = errors(cutting=0.1)


def limits(bond: float, tolerances: dict[str, float]) -> Design:
    return PAPER.with_(
        rules={"worst_bond_width": bond, "worst_mask_overhang": 0.0, "yield_builds": BUILDS},
        registration=tolerances,
    )


@pytest.mark.parametrize("missing", [0.02, 0.06, 0.1, 0.15])
def test_two_cut_edges_add_to_a_triangle(missing: float, good: Good, spoil: Spoil) -> None:
    # A larger cap: the ring of the last pocket lies between the wall's edge and the mask's alone.
    laminate = spoil(good(*ONE), 11, disc((0.0, 0.0), 4.0))
    found = simulate(laminate, limits(0.75 - missing, CUT_ONLY))
    s = missing / 0.2
    # Slightly more: a build within a micrometre of its limit holds it.
    assert found.interfaces[5].value == pytest.approx(s + (1 - s * s) / 2, abs=ROOM + 0.005)


def test_a_disc_laid_by_hand_keeps_a_ring_within_a_smaller_disc(good: Good) -> None:
    by_hand = errors(placement=0.2)
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
    by_hand = errors(placement=0.2)
    found = simulate(laminate, limits(0.6, by_hand))
    # Bad where it lies more than 0.1 towards the pocket: a segment of the disc of 0.2.
    segment = (math.acos(0.5) - 0.5 * math.sqrt(0.75)) / math.pi
    assert found.interfaces[5].value == pytest.approx(1 - segment, abs=ROOM + 0.003)


@pytest.mark.parametrize("cut", [0.0, 0.06, 0.15])
def test_builds_are_drawn_until_the_share_is_within_a_point(cut: float, good: Good) -> None:
    asked = PAPER.with_(
        rules={"worst_bond_width": 0.75 - cut, "worst_mask_overhang": 0.0},
        registration=errors(cutting=0.1),
    )
    share = simulate(good(*ONE), asked).whole
    low, high = share.interval
    assert high - low <= 0.0101
    # No more than that takes: a batch above 1.96^2 p (1 - p) / 0.005^2, or the first 10,000.
    p = min(max(0.5, low - 0.01), high + 0.01)
    assert share.builds <= max(10_000, p * (1 - p) * 392.0**2 + 5_000)


def test_middle_first_takes_a_placement_by_hand_less(good: Good) -> None:
    by_hand = errors(placement=0.2)
    two = ("1dof-5mm", "stack.balloons=2")
    shares = [
        simulate(good(*two, f"registration.sequence={word}"), limits(0.6, by_hand)).whole.value
        for word in ("bottom-first", "middle-first")
    ]
    # Base, separator and cap are each laid by hand, and good within 0.15 of 0.2.
    assert shares[1] == pytest.approx((0.15 / 0.2) ** 6, abs=0.02)
    # With the bottom balloon pressed first, the upper one is laid on it by hand as well.
    assert shares[0] < 0.6 * shares[1]


def test_a_seed_gives_the_same_builds_again(good: Good) -> None:
    laminate = good(*ONE)
    assert simulate(laminate, PAPER) == simulate(laminate, PAPER)
    assert simulate(laminate, PAPER, 1).whole != simulate(laminate, PAPER, 2).whole


def test_smaller_errors_give_more_good_builds(good: Good) -> None:
    shares = [
        simulate(good(*ONE), PAPER.with_(registration={"hand_placement": p})).whole.value
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
    whole = simulate(laminate, PAPER).whole
    low, _ = whole.interval
    assert low < whole.value < 1
    (reached,) = check(Measures(laminate, PAPER.with_(rules={"target_yield": low})))
    (missed,) = check(Measures(laminate, PAPER.with_(rules={"target_yield": whole.value})))
    assert (reached.verdict, missed.verdict) == ("pass", "fail")
    assert missed.limit == missed.measured == whole.value
    assert missed.where.interface == 1


def test_without_a_target_less_than_the_papers_success_warns(good: Good) -> None:
    (many,) = check(Measures(with_a_free_strip(good(*ONE, EARS)), PAPER))
    (few,) = check(
        Measures(
            good(*ONE), PAPER.with_("registration.hand_placement=0.2", "registration.hand_turn=1.0")
        )
    )
    assert (many.verdict, few.verdict) == ("pass", "warn")
    assert many.measured is not None
    assert few.measured is not None
    assert few.measured < 0.9 <= many.measured


@pytest.mark.parametrize(("template", "has_keys"), [("1dof-5mm", True), ("pouch", False)])
def test_only_where_keys_widen_bonds_is_their_width_to_be_asked_for(
    template: str, has_keys: bool
) -> None:
    """Drawn layers take no bond.width: `check --target-yield` has none to advise."""
    design = load_design(template).with_("registration.hand_placement=0.6")
    (finding,) = check(Measures(build(design), design))
    assert finding.verdict == "warn"
    assert ("--target-yield" in finding.remedy) == has_keys
    assert ("draw bonds and overhangs wider" in finding.remedy) != has_keys


# Builds that come short, against plain sums of their errors.


FEW = 400


@pytest.mark.parametrize(
    ("design", "bond"), [(ONE, 0.62), (("3dof-15mm", "stack.balloons=2"), 0.6)]
)
def test_builds_that_come_short_are_those_of_plain_sums(
    design: tuple[str, ...], bond: float, good: Good
) -> None:
    """Of every margin and build, without leaving out any; each error by its own numbers."""
    asked = PAPER.with_(rules={"worst_bond_width": bond})
    measures, cutting = Measures(good(*design), asked), asked.registration.cutting_error
    seen = set()
    for margins in measures.margins:
        short = short_margins(margins, asked)
        if short is None:
            continue
        drawn = np.random.default_rng(5).random((2 * len(short.errors), FEW))
        first = 2 * np.arange(len(short.errors))[:, None]
        interface, builds = short_builds(short, first, cutting, drawn)
        places = margins.places
        room, normal = places.nominal - bond, places.normal
        if margins.quantity == "overhang":
            room = places.nominal - asked.rules.worst_mask_overhang
        left = room[:, None] + sum(
            sign * cutting * (2 * drawn[2 * k] - 1) for k, sign in enumerate(short.signs)
        )
        for k, (freedom, sign) in enumerate(margins.moves, start=2):
            if freedom.centre is not None:
                turn = freedom.most * (2 * drawn[2 * k] - 1)
                left = left + margins.levers[k - 2][:, None] * turn
                continue
            angle, far = math.tau * drawn[2 * k + 1], freedom.most * np.sqrt(drawn[2 * k])
            away = np.array([np.cos(angle), np.sin(angle)]) * far
            left = left + sign * normal.T @ away
        expected = np.flatnonzero((left < -TOLERANCE).any(axis=0))
        assert sorted(builds.tolist()) == expected.tolist()
        assert not interface.any()
        seen.add(0 < len(expected) < FEW)
    assert True in seen


def test_forms_lose_what_their_moves_cost(good: Good) -> None:
    """A shift costs its most; a turn its angle times the lever of the end or the start it moves."""
    measures = Measures(good("3dof-15mm", "stack.balloons=2"), PAPER)
    for margins in measures.margins:
        start, end = margins.places.ends
        normal = margins.places.normal
        costs = zip(margins.moves, margins.costs, strict=True)
        for (freedom, sign), cost in costs:
            if freedom.centre is None:
                assert cost == pytest.approx(freedom.most)
                continue
            p, (x, y) = end if sign > 0 else start, freedom.centre
            lever = (p[0] - x) * normal[1] - (p[1] - y) * normal[0]
            assert cost == pytest.approx(freedom.most * abs(lever))
        held = [freedom.most for freedom, _ in margins.moves if not freedom.by_hand]
        assert margins.pinned_loss == pytest.approx(sum(held))


def shares(*good_builds: int) -> Yield:
    found = {index: Share(count, 400) for index, count in enumerate(good_builds, 1)}
    return Yield(Share(min(good_builds), 400), found)


def test_the_interfaces_that_lose_most_are_told_first(good: Good) -> None:
    for found, first, others, place in (
        (shares(400, 400, 400), None, None, Place()),
        (shares(400, 380, 400), "2 95.00%", -2, Place(2, (3, 4, 5))),
        (shares(399, 380, 390, 380), "2 95.00%, 4 95.00%, 3 97.50%", 1, Place(2, (3, 4, 5))),
    ):
        told = finding_of(found, good(*ONE), PAPER)
        losing = dict(dict(told.says.facts)["losing"].facts)
        assert (losing.get("first"), losing.get("others"), told.where) == (first, others, place)
        assert (told.measured, told.interval) == (found.whole.value, found.whole.interval)


@pytest.mark.parametrize(
    ("count", "target", "verdict"),
    [(349, None, "pass"), (348, None, "warn"), (400, 0.99, "pass"), (400, 0.995, "fail")],
)
def test_a_yields_verdict(count: int, target: float | None, verdict: str, good: Good) -> None:
    # All of 400: 1 - 3.8415 / 403.8415 = 0.9905 at least. Of 348 the interval ends at 0.8995,
    # of 349 at 0.9017 (Wilson): below 0.9 for sure is what warns.
    told = finding_of(shares(count), good(*ONE), PAPER.with_(rules={"target_yield": target}))
    assert (told.verdict, told.limit) == (verdict, target)
    assert told.id.endswith({"pass": "", "warn": ".low-ears", "fail": ".target-fail"}[verdict])
