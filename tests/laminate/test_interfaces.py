"""Interfaces: contact, bond and what stays open, by areas of discs."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from sbafab.actuators import build, load_design
from sbafab.errors import DesignError
from sbafab.geometry.region import disc
from sbafab.laminate.laminate import LOOSE, Laminate, Pin, interface_regions

AXIS = (0.0, 0.0)


@pytest.fixture(scope="module")
def laminate() -> Laminate:
    return build(load_design("1dof-5mm", ["stack.balloons=3"]))


def annulus(outer: float, inner: float) -> float:
    return math.pi * (outer**2 - inner**2)


def test_regions_between_two_films_and_two_masks() -> None:
    mask, contact, bond, unbonded = interface_regions(
        disc(AXIS, 4.0), disc(AXIS, 3.0), [disc((1.0, 0.0), 1.0), disc((-1.0, 0.0), 1.0)]
    )
    assert mask.area == pytest.approx(2 * math.pi)
    assert contact.area == pytest.approx(9 * math.pi)
    assert bond.area == pytest.approx(7 * math.pi)
    assert unbonded.area == pytest.approx(2 * math.pi)


def test_interfaces_of_three_balloons(laminate: Laminate) -> None:
    assert [interface.index for interface in laminate.interfaces] == [1, 2, 3, 4, 5]
    kinds = ["chamber", "separator", "chamber", "separator", "chamber"]
    assert [interface.kind for interface in laminate.interfaces] == kinds
    assert [interface.layer_indices for interface in laminate.interfaces] == [
        (i, i + 1, i + 2) for i in (1, 3, 5, 7, 9)
    ]
    with pytest.raises(DesignError, match="no layer 12; give 1 to 11"):
        laminate.layer(12)
    third, fourth = laminate.interfaces[2:4]
    # Pocket 2.5, outline 3.25, bore 0.52, neck ring 1.27.
    assert third.bond.area == pytest.approx(annulus(3.25, 2.5))
    assert third.unbonded.area == pytest.approx(annulus(2.5, 0.52))
    assert fourth.bond.area == pytest.approx(annulus(1.27, 0.52))
    assert fourth.contact.area == pytest.approx(annulus(3.25, 0.52))


def test_heights_are_sums_of_films(laminate: Laminate) -> None:
    # 0.038 of TPE and 0.025 of PTFE: five of each lie below the cap.
    assert laminate.thickness == pytest.approx(6 * 0.038 + 5 * 0.025)
    assert [gap.z for gap in laminate.interfaces] == pytest.approx(
        [0.038 + 0.063 * i for i in range(5)]
    )
    assert {gap.gap for gap in laminate.interfaces} == {0.025}


def test_films_that_touch_bond_all_over(laminate: Laminate) -> None:
    films = [layer for layer in laminate.layers if not layer.is_mask]
    bare = replace(laminate, layers=tuple(films))
    assert {interface.kind for interface in bare.interfaces} == {"bond"}
    assert bare.interfaces[1].bond.area == pytest.approx(annulus(3.25, 0.52))


@pytest.mark.parametrize(
    ("dx", "diameter", "is_held"),
    [
        (0.0, 1.04, True),
        (LOOSE - 0.001, 1.04, True),
        (LOOSE + 0.001, 1.04, False),
        (0.0, 1.04 + LOOSE - 0.001, True),
        (0.0, 1.04 + LOOSE + 0.001, False),
        (0.0, 1.04 - LOOSE - 0.001, False),
    ],
)
def test_a_hole_near_enough_to_its_pin_is_held(
    dx: float, diameter: float, is_held: bool, laminate: Laminate
) -> None:
    pinned = replace(laminate, pins=(Pin("bore", (dx, 0.0), diameter),))
    pins = pinned.pins_holding(pinned.layer(5))
    assert pins == (pinned.pins if is_held else ())
    assert pinned.pins_in(disc(AXIS, 3.25)) == ()
