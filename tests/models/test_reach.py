"""Inverse kinematics of a stack: places of the tip that poses have, and places that none has."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import sbafab
from sbafab.errors import DesignError, UnreachableError
from sbafab.models.stack import Plate, Stack, StackBatch

MOST = 10.0
"""kPa to which chambers may be filled."""
CLOSE = 1e-3
"""Distance in mm at which a target is met."""
LOADS: dict[str, dict[str, Any]] = {
    "free": {},
    "tip": {"tip_load": (0.0, 0.005, -0.005)},
    "gravity": {"gravity": (0.0, 0.6, -1.0)},
    "plate": {"plate": Plate((0.5, 0.0, 14.0), (0.1, 0.0, 1.0))},
    "slippery plate": {"plate": Plate((0.5, 0.0, 14.0), (0.1, 0.0, 1.0), sticks=False)},
    "level slippery plate": {"plate": Plate((0.0, 0.0, 14.0), sticks=False)},
    "both": {"tip_load": (0.002, 0.0, -0.004), "gravity": True},
}


@pytest.fixture(scope="module")
def three() -> Stack:
    return sbafab.stack("3dof-15mm")


def targets(stack: Stack, count: int, loads: dict[str, Any]) -> Iterator[Any]:
    """Yield tips of poses at random pressures, some chambers empty or full."""
    numbers = np.random.default_rng(31)
    for _ in range(count):
        drawn = np.clip(numbers.uniform(-1.0, MOST + 1, stack.chambers), 0.0, MOST)
        yield stack.pose(drawn.tolist(), **loads).tip


def missed(stack: Stack, count: int, loads: dict[str, Any], every: int = 1) -> int:
    """Return how many targets are not met, by a pose of the stack at the pressures found; all
    together they are met by the same poses. Of ``every`` so many, one is also searched alone.
    """
    number, tips = 0, np.array(list(targets(stack, count, loads)))
    together = StackBatch(stack).reach(tips, MOST, **loads)
    assert together.tips == pytest.approx(tips, abs=CLOSE)
    for place, target in enumerate(tips):
        if place % every:
            continue
        reached = stack.reach(target, most_pressure=MOST, **loads)
        assert together.pressures[place] == pytest.approx(reached.pressures, abs=1e-3)
        assert together.freedoms[place] == pytest.approx(reached.freedoms, abs=1e-5)
        assert together.tips[place] == pytest.approx(target, abs=CLOSE)
        assert together.volumes[place] == pytest.approx(reached.volumes, abs=5e-3)
        assert together.forces[place] == pytest.approx(reached.force, abs=1e-5)
        assert min(reached.pressures) >= 0
        assert max(reached.pressures) <= MOST + 1e-9
        again = stack.pose(np.clip(reached.pressures, 0, MOST).tolist(), **loads, near=reached)
        assert reached.force == pytest.approx(again.force, abs=1e-5)
        number += not np.linalg.norm(again.tip - target) < CLOSE
    return number


@pytest.mark.parametrize("load", LOADS)
def test_random_reachable_targets_are_met(three: Stack, load: str) -> None:
    assert missed(three, 8 if "plate" in load else 20, LOADS[load]) == 0


@pytest.mark.parametrize(
    "pressures",
    [
        (0.4720, 10.0, 10.0),
        (8.3813, 0.7127, 1.6083),
        (2.8213, 9.9721, 10.0),
        (1.5470, 9.9388, 8.7676),
    ],
)
def test_a_target_behind_a_contact_that_closes_is_met(three: Stack, pressures: Any) -> None:
    """The tip's rates jump where the top's next point meets the plate: steps by the rates of one
    side alone end there.
    """
    load = LOADS["slippery plate"]
    target = three.pose(pressures, **load)
    assert target.force > 0
    reached = three.reach(target.tip, most_pressure=MOST, **load)
    assert np.linalg.norm(reached.tip - target.tip) < CLOSE


@pytest.mark.parametrize("pressures", [(0.0, 9.6, 9.7), (0.0, 9.7, 9.85)])
def test_a_folded_stack_is_met_among_its_equilibria(three: Stack, pressures: Any) -> None:
    """Two full chambers fold below a level plate to either side; at the same pressures the stack
    also stands upright.
    """
    load = LOADS["level slippery plate"]
    target = three.pose(pressures, **load)
    assert target.force > 0.1
    reached = three.reach(target.tip, most_pressure=MOST, **load)
    assert np.linalg.norm(reached.tip - target.tip) < CLOSE
    assert reached.stable


def test_a_place_along_the_edge_of_a_contact_is_met(three: Stack) -> None:
    """There one chamber gives what another takes, and descents by one at a time end."""
    load = LOADS["level slippery plate"]
    target = three.pose((9.15068128, 6.05458329, 2.70451692), **load)
    reached = three.reach(target.tip, most_pressure=MOST, **load)
    assert np.linalg.norm(reached.tip - target.tip) < CLOSE


def test_a_pose_reached_under_a_plate_is_in_equilibrium(three: Stack) -> None:
    """Where a point of the top meets the plate in the last step, and where all push hard."""
    load = LOADS["plate"]
    met, pushed = (three.pose(each, **load) for each in ((6.32, 9.94, 5.48), (10.0, 9.0, 9.5)))
    for near in (None, pushed):
        reached = three.reach(met.tip, most_pressure=MOST, near=near, **load)
        again = three.pose(reached.pressures, near=reached, **load)
        assert reached.tip == pytest.approx(again.tip, abs=1e-5)
        assert reached.force == pytest.approx(again.force, abs=1e-5)
    assert reached.force > 1e-3


@pytest.mark.long
@pytest.mark.parametrize("load", LOADS)
def test_many_random_reachable_targets_are_met(three: Stack, load: str) -> None:
    assert missed(three, 1000, LOADS[load], every=5) == 0


@pytest.mark.parametrize("count", [2, 4])
def test_stacks_with_fewer_and_more_chambers_reach_their_places(count: int) -> None:
    stack = sbafab.stack("3dof-15mm", {"chamber.count": count, "stack.balloons": 5})
    assert missed(stack, 5, {}) == 0
    assert missed(stack, 5, {"tip_load": (0.0, 0.002, -0.002)}) == 0


def test_a_path_is_followed_from_pose_to_pose() -> None:
    three = sbafab.stack("3dof-15mm", "models.calibration=none")
    load = LOADS["both"]
    turns = np.linspace(0.0, 2 * np.pi, 13)
    pose = three.reach((6.0, 0.0, 15.0), most_pressure=MOST, **load)
    for turn in turns:
        place = (6 * np.cos(turn), 6 * np.sin(turn), 15.0)
        pose = three.reach(place, most_pressure=MOST, near=pose, **load)
        assert pose.tip == pytest.approx(place, abs=CLOSE)
        assert pose.stable


def test_a_place_too_high_is_refused_with_the_highest_one(three: Stack) -> None:
    """On the axis that is the tip with all chambers full."""
    height = three.pose((MOST,) * 3).height
    with pytest.raises(UnreachableError, match="the nearest place found is") as refused:
        three.reach((0, 0, 60), most_pressure=MOST)
    assert f"(0, 0, {round(height, 3):g}) mm, {60 - height:.3g} mm away" in str(refused.value)
    assert "cannot reach (0, 0, 60) mm with 0 to 10 kPa" in str(refused.value)


@pytest.mark.parametrize("most", [37.3])
def test_the_end_of_the_range_is_inside_it(most: float) -> None:
    """Asinh and sinh, or the calibration's modulus, round these by a digit up or down."""
    stack = sbafab.stack("3dof-15mm", most_pressure=most)
    assert stack.most_pressure == most
    full = stack.pose((most,) * 3)
    assert StackBatch(stack).poses([(most,) * 3]).tips == pytest.approx(full.tip[None], abs=CLOSE)
    assert stack.reach(full.tip).pressures == pytest.approx((most,) * 3, rel=1e-3)
    for reach in (stack.reach, lambda place: StackBatch(stack).reach([place])):
        with pytest.raises(UnreachableError, match=f"with 0 to {most:g} kPa; the nearest place"):
            reach((50, 0, 12))
    with pytest.raises(DesignError, match=f"give 0 to {most:g} kPa"):
        stack.pose((most + 1e-6, 0, 0))


def test_one_chamber_reaches_places_on_its_axis_alone() -> None:
    """The nearest place to one beside the axis is its foot on the axis."""
    one = sbafab.stack("1dof-5mm")
    assert one.reach((0, 0, 10)).height == pytest.approx(10, abs=CLOSE)
    with pytest.raises(UnreachableError, match=r"is \(0, 0, 10\) mm, 1 mm away"):
        one.reach((1, 0, 10))


def test_bad_input_to_reach_is_refused(three: Stack) -> None:
    with pytest.raises(DesignError, match="the place of the tip in mm must be three finite"):
        three.reach((0, 0))
    with pytest.raises(DesignError, match="most_pressure = 120 kPa must be above 0 and at most"):
        three.reach((0, 0, 10), most_pressure=120)
    with pytest.raises(DesignError, match=r"a plate 0\.9 mm high is lower than the flat stack"):
        three.reach((0, 0, 10), plate=0.9)


def test_bad_input_to_many_targets_is_refused(three: Stack) -> None:
    batch = StackBatch(three)
    with pytest.raises(DesignError, match="positions of the tip in mm must be finite numbers"):
        batch.reach((0, 0, 10))
    with pytest.raises(DesignError, match="most_pressure = 120 kPa must be above 0 and at most"):
        batch.reach([(0, 0, 10)], most_pressure=120)
    with pytest.raises(UnreachableError, match=r"cannot reach \(0, 0, 60\) mm with 0 to 10 kPa"):
        batch.reach([(0, 0, 10), (0, 0, 60)], most_pressure=MOST)
    assert batch.reach(np.zeros((0, 3))).tips.shape == (0, 3)
