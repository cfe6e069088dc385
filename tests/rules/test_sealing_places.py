"""Which leak, which pocket and which place sealing names first, and what it tells to do."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import pytest

from sbafab.geometry.region import disc, polygon, strip, union
from sbafab.laminate.laminate import Laminate
from sbafab.rules.finding import Finding, Place
from sbafab.rules.measures import Measures
from sbafab.rules.sealing import check
from sbafab.rules.voids import _gap
from tests.designs import PAPER

AXIS = (0.0, 0.0)
ONE = ("1dof-5mm", "stack.balloons=3")
LOBED = ("3dof-15mm", "stack.balloons=3")
# The axes of the three chambers, 4.25 from the lumen's.
FIRST = (4.25, 0.0)
SECOND = (4.25 * math.cos(math.tau / 3), 4.25 * math.sin(math.tau / 3))
Good = Callable[..., Laminate]
Spoil = Callable[..., Laminate]


def found_in(laminate: Laminate) -> Finding:
    (finding,) = check(Measures(laminate, PAPER))
    return finding


@pytest.mark.parametrize(("design", "pockets"), [(ONE, 3), (LOBED, 9)])
def test_sealed_pockets_are_counted(design: tuple[str, ...], pockets: int, good: Good) -> None:
    sealed = Finding(
        "sealing",
        "pass",
        0.0,
        0.0,
        "voids",
        Place(),
        f"{pockets} pockets sealed, each reached from the inlet of its own chamber alone",
    )
    assert found_in(good(*design)) == sealed


def test_a_single_pocket_is_one_pocket(good: Good) -> None:
    assert found_in(good("1dof-5mm", "stack.balloons=1")).message.startswith("1 pocket sealed")


BRIDGE = strip(FIRST, SECOND, 0.4) - disc(FIRST, 0.5) - disc(SECOND, 0.5)


def test_a_strip_between_two_chambers_feeds_a_foreign_pocket(good: Good, spoil: Spoil) -> None:
    laminate = good(*LOBED)
    found = found_in(spoil(laminate, 6, laminate.layer(6).profile | BRIDGE))
    # Air comes down to the lowest pocket of the second chamber, through its bore.
    assert (found.where.interface, found.where.layers) == (1, (1, 2, 3))
    assert math.dist((found.where.x or 0, found.where.y or 0), SECOND) == pytest.approx(0.5)
    # The joined pocket and two more of each chamber.
    assert found.measured == 5
    assert found.message.startswith(
        "the inlet of chamber1 feeds a pocket of chamber2 at chamber interface 1 (x -1.771, y "
    )
    assert found.message.endswith("; separate them by a bond there (and 4 more)")


def test_a_strip_between_two_chambers_at_their_inlets(good: Good, spoil: Spoil) -> None:
    laminate = good(*LOBED)
    joined = laminate.layer(2).profile | BRIDGE
    found = found_in(spoil(laminate, 2, joined))
    assert "feeds a pocket of chamber1 and chamber2 at chamber interface 1" in found.message
    # The middle of the box round both pockets and their strips.
    two = max((laminate.layer(1).profile & joined).pieces, key=lambda piece: piece.area)
    low_x, low_y, high_x, high_y = two.bounds
    assert found.where.x == pytest.approx((low_x + high_x) / 2)
    assert found.where.y == pytest.approx((low_y + high_y) / 2)


def test_pockets_without_a_chamber_are_fed_all_the_same(good: Good) -> None:
    found = found_in(replace(good(*ONE), chambers=()))
    # From the pocket's far side at -2.5 to the mouth at 8.25.
    assert (found.where.x, found.where.y) == pytest.approx((2.875, 0.0))
    assert found.message == (
        "the inlet of chamber1 feeds a pocket of no chamber at chamber interface 1 (x 2.875, "
        "y 0.000); separate them by a bond there (and 2 more)"
    )


def test_a_strip_that_misses_its_pocket_leaves_all_without_inlet(good: Good, spoil: Spoil) -> None:
    mask = (disc(AXIS, 2.5) - disc(AXIS, 0.5)) | strip((3.45, 0.0), (8.75, 0.0), 1.6)
    found = found_in(spoil(good(*ONE), 2, mask))
    assert found.message == (
        "the pocket of chamber1 at chamber interface 1 (x 0.000, y 0.000) is reached from no "
        "inlet; open a bore or a strip to it (and 3 more)"
    )


def test_a_pocket_that_no_bore_reaches_is_named_with_its_chamber(good: Good, spoil: Spoil) -> None:
    laminate = good(*LOBED)
    wall = laminate.layer(9).profile | disc(SECOND, 0.6)
    found = found_in(spoil(laminate, 9, wall))
    assert (found.limit, found.measured, found.unit) == (0.0, 1.0, "voids")
    assert found.where.interface == 5
    assert (found.where.x, found.where.y) == pytest.approx(SECOND)
    assert found.message == (
        "the pocket of chamber2 at chamber interface 5 (x -2.125, y 3.681) is reached from no "
        "inlet; open a bore or a strip to it"
    )


def test_a_pocket_of_two_chambers_that_no_bore_reaches(good: Good, spoil: Spoil) -> None:
    laminate = good(*LOBED)
    wall = laminate.layer(9).profile | disc(FIRST, 0.6) | disc(SECOND, 0.6)
    closed = spoil(laminate, 9, wall)
    found = found_in(spoil(closed, 10, laminate.layer(10).profile | BRIDGE))
    assert (found.where.interface, found.measured) == (5, 1.0)
    assert found.message.startswith(
        "the pocket of chamber1 and chamber2 at chamber interface 5 (x "
    )


def test_a_pocket_of_no_chamber_is_to_be_removed(good: Good, spoil: Spoil) -> None:
    mask = (disc(AXIS, 1.5) - disc(AXIS, 0.5)) | disc((2.4, 0.5), 0.3)
    found = found_in(spoil(good(*ONE), 6, mask))
    assert (found.where.interface, found.measured) == (3, 1.0)
    assert found.message == (
        "a pocket of no chamber lies at chamber interface 3 (x 2.400, y 0.500); remove that part "
        "of the mask"
    )


def test_a_missing_pocket_is_named_with_its_centre(good: Good, spoil: Spoil) -> None:
    laminate = good(*LOBED)
    found = found_in(spoil(laminate, 10, laminate.layer(10).profile - disc(SECOND, 2.6)))
    assert (found.where.interface, found.where.layers) == (5, (9, 10, 11))
    assert (found.where.x, found.where.y) == pytest.approx(SECOND)
    assert found.message == (
        "chamber2 has no pocket at chamber interface 5 (x -2.125, y 3.681); add its disc to the "
        "mask there"
    )


@pytest.mark.parametrize("balloons", [2, 4])
def test_balloons_without_a_chamber_interface_each(balloons: int, good: Good) -> None:
    found = found_in(replace(good(*ONE), balloons=balloons))
    assert (found.verdict, found.measured, found.where) == ("fail", 1.0, Place())
    assert found.message == (
        f"the laminate has 3 chamber interfaces for {balloons} balloons; each balloon needs one "
        "chamber mask between two films"
    )


def test_a_hole_over_a_separator_leaks_at_its_interface(good: Good, spoil: Spoil) -> None:
    laminate = good(*ONE)
    found = found_in(spoil(laminate, 7, laminate.layer(7).profile - disc((0.0, 1.7), 0.3)))
    assert (found.where.interface, found.where.layers) == (4, (7, 8, 9))
    assert math.dist((found.where.x or 0, found.where.y or 0), (0.0, 1.7)) < 0.31
    assert found.message.startswith(
        "chamber1 leaks into the slit between two balloons at interface 4 (x "
    )
    assert found.message.endswith(
        "), from its pocket at chamber interface 3; close the opening or bond round it"
    )


def test_a_pocket_open_at_the_edge_leaks_there(good: Good, spoil: Spoil) -> None:
    mask = good(*ONE).layer(6).profile | strip((1.0, 0.0), (4.0, 0.0), 0.4)
    found = found_in(spoil(good(*ONE), 6, mask))
    assert (found.where.interface, found.where.layers) == (3, (5, 6, 7))
    assert math.hypot(found.where.x or 0, found.where.y or 0) == pytest.approx(3.25)
    assert found.message.startswith("chamber1 leaks to the outside at interface 3 (x 3.2")
    assert found.message.endswith(
        "), from its pocket at chamber interface 3; close the opening or bond round it"
    )


def test_a_hole_in_the_cap_leaks_from_the_pocket_below(good: Good, spoil: Spoil) -> None:
    found = found_in(spoil(good(*ONE), 11, disc(AXIS, 3.25) - disc((-1.5, 0.5), 0.2)))
    assert (found.where.interface, found.where.layers) == (5, (9, 10, 11))
    assert found.message == (
        "chamber1 leaks to the outside at layer 11 (x -1.500, y 0.500), from its pocket at "
        "chamber interface 5; close the opening or bond round it"
    )


def test_a_lobe_that_nothing_holds_lies_loose(good: Good, spoil: Spoil) -> None:
    # The separator covers a whole lobe of the balloon above, cut off from the others.
    laminate = good(*ONE)
    island = disc((10.0, 2.0), 1.0)
    for index in (5, 7):
        laminate = spoil(laminate, index, laminate.layer(index).profile | island)
    found = found_in(laminate)
    assert found.message == (
        "the film of layer 5 (005_TPE_wall) at x 10.000, y 2.000 is bonded to nothing below it; "
        "open the mask at interface 2 there"
    )
    assert (found.where.interface, found.where.layers) == (2, (3, 4, 5))
    assert (found.where.x, found.where.y) == pytest.approx((10.0, 2.0))


def test_a_leak_of_pockets_without_an_inlet(good: Good, spoil: Spoil) -> None:
    # The strip is left out, so no inlet feeds the pockets that leak through the cap.
    closed = spoil(good(*ONE), 2, disc(AXIS, 2.5) - disc(AXIS, 0.5))
    found = found_in(spoil(closed, 11, disc(AXIS, 3.25) - disc((-1.5, 0.5), 0.2)))
    assert found.measured == 3
    assert (found.where.interface, found.where.layers) == (5, (9, 10, 11))
    assert found.message.startswith("chamber1 leaks to the outside at layer 11 (x -1.500, y 0.500)")


def test_a_second_mouth_beside_the_inlet_leaks(good: Good, spoil: Spoil) -> None:
    laminate = good(*ONE)
    beside = laminate.layer(2).profile | strip((0.0, 1.3), (8.75, 1.3), 0.2)
    found = found_in(spoil(laminate, 2, beside))
    assert (found.where.x, found.where.y) == pytest.approx((8.25, 1.3))
    assert found.message == (
        "chamber1 leaks to the outside at interface 1 (x 8.250, y 1.300), from its pocket at "
        "chamber interface 1; close the opening or bond round it"
    )


def test_voids_that_touch_at_a_point_are_told_apart() -> None:
    """A pocket round a hole of radius 2. A square of film stands in the hole on its corners and
    leaves four voids; or two wedges of bond reach the hole's edge and leave two pockets.
    """
    hole, frame = disc((0, 0), 2), disc((0, 0), 9)
    ring, film = disc((0, 0), 3) - hole, disc((0, 0), 5) - hole
    square = polygon([(2, 0), (0, 2), (-2, 0), (0, -2)])
    gap = _gap(ring, film | square, frame, ())
    # Four segments of 4 (pi / 4 - 1 / 2) each, and what is round the film.
    segments = [number for number, void in enumerate(gap.missing) if void.area < 2]
    assert [gap.missing[n].area for n in segments] == [pytest.approx(math.pi - 2)] * 4
    assert sorted({(pocket, void) for pocket, void, _ in gap.touching}) == [
        (0, number) for number in segments
    ]
    wedges = union(polygon([(way * 2, 0), (way * 4, 1), (way * 4, -1)]) for way in (1, -1))
    gap = _gap(ring - wedges, film, frame, ())
    assert len(gap.unbonded) == 2
    joined = {(pocket, gap.missing[void].area) for pocket, void, _ in gap.touching}
    assert sorted(joined) == [(0, pytest.approx(4 * math.pi)), (1, pytest.approx(4 * math.pi))]
