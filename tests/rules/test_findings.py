"""Whole findings of the rules: verdict, limit, value, unit, place, and the sentence they say."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from sbafab.geometry.region import Region, disc
from sbafab.laminate.laminate import Laminate
from sbafab.rules import bond_width, film_limits, mask_overhang, piece_count
from sbafab.rules.finding import Finding, Place
from sbafab.rules.measures import Measures
from tests.designs import PAPER
from tests.rules.compared import only, same

AXIS = (0.0, 0.0)
LIMITS = PAPER
ONE = ("1dof-5mm", "stack.balloons=3")
FILM = disc(AXIS, 3.25) - disc(AXIS, 0.5)
NOWHERE = Place()
Good = Callable[..., Laminate]
Spoil = Callable[..., Laminate]


def test_bond_width_of_a_narrow_ring(good: Good, spoil: Spoil) -> None:
    narrow = spoil(good(*ONE), 10, disc((0.1, 0.0), 2.5) - disc(AXIS, 0.5))
    assert same(
        only(bond_width.check(Measures(narrow, LIMITS))),
        Finding(
            "bond-width",
            "fail",
            0.75,
            0.65,
            "mm",
            Place(5, (9, 10, 11), 2.925, 0.0),
            "the narrowest bond is 0.650 mm, at chamber interface 5 (layers 9 and 11), x 2.925, "
            "y 0.000; it needs 0.75: raise bond.width, or move the edges on either side apart "
            "there",
        ),
    )


def test_bond_width_of_interfaces_that_are_alike(good: Good, spoil: Spoil) -> None:
    laminate = good("1dof-5mm", "stack.balloons=4")
    for layer in (6, 10):
        laminate = spoil(laminate, layer, disc((0.1, 0.0), 2.5) - disc(AXIS, 0.5))
    found = only(bond_width.check(Measures(laminate, LIMITS)))
    assert "chamber interface 3 (layers 5 and 7) (and 1 like it), x 2.925" in found.message


def test_bond_width_where_nothing_bonds(good: Good, spoil: Spoil) -> None:
    covered = spoil(good(*ONE), 10, disc(AXIS, 4.0) - disc(AXIS, 0.5))
    assert same(
        only(bond_width.check(Measures(covered, LIMITS))),
        Finding(
            "bond-width",
            "fail",
            0.75,
            0.0,
            "mm",
            Place(5, (9, 10, 11)),
            "nothing bonds at chamber interface 5 (layers 9 and 11): the mask covers all of it; "
            "make the mask smaller",
        ),
    )


def test_bond_width_of_a_cusp_asks_for_round_corners(good: Good, spoil: Spoil) -> None:
    touching = spoil(good(*ONE), 6, disc((1.0, 0.0), 2.25) - disc(AXIS, 0.5))
    assert only(bond_width.check(Measures(touching, LIMITS))).message.endswith(
        "; it needs 0.75: round the sharp corner there"
    )


def test_bond_width_without_any_interface(good: Good) -> None:
    single = replace(good(*ONE), layers=good(*ONE).layers[:1])
    assert only(bond_width.check(Measures(single, LIMITS))) == Finding(
        "bond-width", "fail", 0.75, None, "mm", NOWHERE, "the laminate has no bond to measure"
    )


def test_mask_overhang_that_is_short(good: Good, spoil: Spoil) -> None:
    # Film 3.25 across, its edge 3.55 away on one side only.
    moved = spoil(good(*ONE), 8, disc((0.0, 0.2), 3.75) - disc(AXIS, 1.25))
    assert same(
        mask_overhang.check(Measures(moved, LIMITS))[0],
        Finding(
            "mask-overhang",
            "fail",
            0.5,
            0.3,
            "mm",
            Place(4, (7, 8, 9), 0.0, -3.25),
            "the least overhang of a mask past a film edge is 0.300 mm, at separator interface 4 "
            "(layers 7 and 9), x 0.000, y -3.250; it needs 0.5: let the mask reach further past "
            "the edge there",
        ),
    )


def test_mask_overhang_beside_the_film(good: Good, spoil: Spoil) -> None:
    beside = spoil(good(*ONE), 6, disc((20.0, 0.0), 2.0))
    assert mask_overhang.check(Measures(beside, LIMITS))[0] == Finding(
        "mask-overhang",
        "fail",
        0.5,
        0.0,
        "mm",
        Place(3, (5, 6, 7)),
        "the mask at chamber interface 3 (layers 5 and 7) lies outside the film, so all of it "
        "bonds; put the mask where the film is",
    )


def test_mask_overhang_without_masks(good: Good) -> None:
    films = tuple(layer for layer in good(*ONE).layers if not layer.is_mask)
    assert mask_overhang.check(Measures(replace(good(*ONE), layers=films), LIMITS)) == [
        Finding(
            "mask-overhang", "pass", 0.5, None, "mm", NOWHERE, "no free film edge lies on a mask"
        )
    ]


@pytest.mark.parametrize(
    ("design", "pin", "place", "where"),
    [
        (ONE, "chamber1", Place(1, (1, 2, 3), 0.0, 0.0), "3 interfaces"),
        (("3dof-15mm", "stack.balloons=2"), "lumen", Place(2, (3, 4, 5), 0.0, 0.0), "1 interface"),
    ],
)
def test_mask_overhang_waived_for_a_pin(
    design: tuple[str, ...], pin: str, place: Place, where: str, good: Good
) -> None:
    message = (
        f"the dowel pin {pin} holds the layers by this opening, so at {where} the mask may end "
        "0.000 mm past its edge"
    )
    waived = mask_overhang.check(Measures(good(*design), LIMITS))[-1]
    assert same(waived, Finding("mask-overhang", "waived", 0.5, 0.0, "mm", place, message))


def test_mask_overhang_counts_the_interfaces_of_each_pattern(good: Good, spoil: Spoil) -> None:
    # A mask that does reach past its bore's edge is not among the waived.
    reaching = spoil(good(*ONE), 6, disc(AXIS, 2.5))
    _, waived = mask_overhang.check(Measures(reaching, LIMITS))
    assert "at 2 interfaces" in waived.message


def test_every_layer_in_its_pieces(good: Good) -> None:
    assert piece_count.check(Measures(good(*ONE), LIMITS)) == [
        Finding(
            "piece-count",
            "pass",
            0.0,
            0.0,
            "pieces",
            NOWHERE,
            "every layer falls into the pieces its role asks for",
        )
    ]


@pytest.mark.parametrize(
    ("profile", "pieces", "off", "place", "says"),
    [
        (
            FILM | disc((6.0, 1.0), 0.5),
            1,
            1.0,
            Place(None, (7,), 6.0, 1.0),
            "2 pieces and should fall into 1; remove the stray one or join it to the rest",
        ),
        (
            FILM,
            3,
            2.0,
            Place(None, (7,), 0.0, 0.0),
            "1 piece and should fall into 3; separate what has grown together or restore what is "
            "lost",
        ),
        (
            Region(),
            1,
            1.0,
            Place(None, (7,)),
            "0 pieces and should fall into 1; separate what has grown together or restore what is "
            "lost",
        ),
    ],
)
def test_a_layer_in_other_pieces(
    profile: Region,
    pieces: int,
    off: float,
    place: Place,
    says: str,
    good: Good,
    spoil: Spoil,
) -> None:
    found = only(piece_count.check(Measures(spoil(good(*ONE), 7, profile, pieces), LIMITS)))
    message = f"layer 7 (007_TPE_wall) falls into {says}"
    assert same(found, Finding("piece-count", "fail", 0.0, off, "pieces", place, message))


def test_film_limits_of_a_wide_kerf(good: Good) -> None:
    laminate = good(*ONE, "bore.diameter=0.95")
    found = only(film_limits.check(Measures(laminate, PAPER.with_("laser.kerf_ptfe=1"))))
    assert (found.verdict, found.limit, found.measured, found.unit) == ("fail", 1.0, None, "mm")
    assert found.where.layers == (2,)
    assert found.message.startswith("layer 2 (002_PTFE_chamber-mask) ")
    assert found.message.endswith("; widen what is narrower than the kerf")


def test_film_limits_of_a_coarse_laser(good: Good) -> None:
    assert same(
        only(film_limits.check(Measures(good(*ONE), PAPER.with_("laser.least_feature=1.2")))),
        Finding(
            "film-limits",
            "fail",
            1.2,
            1.0,
            "mm",
            Place(None, (2,), 0.0, 0.0),
            "the finest feature is a slot or hole of 1.000 mm in layer 2 (002_PTFE_chamber-mask), "
            "x 0.000, y 0.000; the laser needs 1.2: widen it or leave it out",
        ),
    )
