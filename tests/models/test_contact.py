"""Contact within a stack against closed geometry: levers over touching rims, Mylar side by side."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import sbafab
from sbafab.models.elastic import chamber_clearances, rim_gap
from sbafab.models.film_elements import Balloon
from sbafab.models.stack import Stack
from sbafab.models.stack_loads import RING_POINTS

OUTER = -4.25 / 2 - 3.25
"""x of the rims opposite the first chamber: its axis lies at 4.25, lobes have a radius of 3.25."""


@pytest.fixture(scope="module")
def three() -> Stack:
    return sbafab.stack("3dof-15mm", "models.calibration=none")


def moment(three: Stack, pressures: tuple[float, ...], tilt: float) -> float:
    """Moment in mN mm of the balloons' forces about the rims that a level turns on by ``tilt``."""
    balloon = three.maps[0].balloon
    turn = np.arange(RING_POINTS) * math.tau / RING_POINTS
    across = (balloon.neck + balloon.pocket) / 2 * np.cos(turn)
    total = 0.0
    for (x, _), pressure in zip(three.axes, pressures, strict=True):
        arm = x + across - OUTER
        force = three.maps[0].force(np.full(RING_POINTS, pressure), tilt * arm)
        total += float((force * arm).mean())
    return total


@pytest.mark.parametrize("pressure", [1.0, 2.7, 5.0])
def test_with_one_chamber_a_level_is_a_lever_over_its_rims(three: Stack, pressure: float) -> None:
    pressures = (pressure, 0.0, 0.0)
    low, high = 0.01, 0.3
    for _ in range(40):
        tilt = (low + high) / 2
        low, high = (tilt, high) if moment(three, pressures, tilt) > 0 else (low, tilt)
    pose = three.pose(pressures)
    assert pose.bend == pytest.approx(15 * math.degrees(low), rel=0.01)
    assert rim_gap(three, pose) == 0.0
    # The touching rims push: what balloons pull by on their own is not in balance.
    left = sum(
        float(three.maps[0].force(np.full(RING_POINTS, p), low * (x + ring - OUTER)).mean())
        for (x, _), p in zip(three.axes, pressures, strict=True)
        for ring in [1.885 * np.cos(np.arange(RING_POINTS) * math.tau / RING_POINTS)]
    )
    assert left < -0.3


def test_rims_that_do_not_touch_leave_balance_to_the_balloons(three: Stack) -> None:
    pose = three.pose((5, 5, 0))
    rise, tilt = pose.freedoms[0, 0], np.hypot(*pose.freedoms[0, 1:])
    # The lobe of the empty chamber, its axis 4.25 out, reaches 7.5 from the middle.
    assert rim_gap(three, pose) == pytest.approx(rise - 7.5 * tilt, abs=0.01)
    assert rim_gap(three, pose) > 0.2
    assert rim_gap(three, three.pose((5, 5, 5))) == pytest.approx(three.pose((5, 5, 5)).gaps.min())


def test_rims_hold_a_bent_stack_under_load_too(three: Stack) -> None:
    for load in ({"tip_load": (0.01, 0, -0.01)}, {"gravity": True}, {"plate": 5.0}):
        pose = three.pose((5, 0, 0), **load)
        rims = three.rims[0] @ pose.freedoms[..., None]
        assert rims.min() > -5e-3


def test_mylar_balloons_side_by_side_leave_what_their_equators_do(three: Stack) -> None:
    # A Mylar balloon of flat radius l has an equator of 0.7627 l (Paulsen, 1994), and is 0.9139 l
    # high; axes lie 4.25 sqrt 3 apart.
    ideal = Balloon(thickness=1e-4, modulus=1e11, inextensible=True)
    maps = (replace(three.maps[0], balloon=ideal),)
    pose = replace(three.pose((5, 5, 5)), gaps=np.full((15, 3), 0.9139 * 2.5))
    apart = 0.5 * 4.25 * math.sqrt(3) - 2 * 0.7627 * 2.5
    assert apart < 0  # so near together they would pass through each other
    close = replace(three, maps=maps, axes=three.axes * 0.5)
    assert chamber_clearances([(close, pose)])[0] == pytest.approx(apart, abs=0.01)


def test_predict_tells_the_room_within_a_bent_stack() -> None:
    found = sbafab.predict("3dof-15mm", "models.calibration=none", pressures_kpa=(2.7,))
    assert found.value("rim_room", chambers=1) == 0.0
    assert found.value("rim_room", chambers=2) > 0.1
    # Inflated balloons are drawn in: more than flat ones, 4.25 sqrt 3 less their diameter, leave.
    assert found.value("chamber_clearance", chambers=2) > 4.25 * math.sqrt(3) - 5.0
