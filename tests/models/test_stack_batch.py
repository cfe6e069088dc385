"""Many states of a stack at once, against single poses and motions."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import sbafab
from sbafab.errors import DesignError
from sbafab.models import motion as motions
from sbafab.models.pneumatics import AIR, WATER, Line
from sbafab.models.stack import Plate, Stack, StackBatch


@pytest.fixture(scope="module")
def three() -> Stack:
    return sbafab.stack("3dof-15mm")


def drawn_pressures(chambers: int, count: int = 8) -> np.ndarray:
    """Return pressures (count, chambers) in kPa, some of them 0."""
    numbers = np.random.default_rng(7)
    drawn = numbers.uniform(0.0, 10.0, (count, chambers))
    drawn[: count // 2] *= numbers.integers(0, 2, (count // 2, chambers))
    return drawn


def test_levels_of_unlike_balloons_turn_each_in_its_own_plane(three: Stack) -> None:
    # The same balloons with a stiffer kind among them, which bends by less.
    kinds = (three.maps[0], three.maps[0].stiffened(2.0))
    mixed = replace(three, maps=kinds, levels=np.array([0, 0, 1, 0, 1, 1, 0]))
    pressures = np.array([[6.0, 1.0, 3.0], [0.0, 2.0, 8.0]])
    batch = StackBatch(mixed)
    poses, moving = batch.poses(pressures), batch.motion(2)
    moving.step(0.02, pressures)
    for number, row in enumerate(pressures.tolist()):
        assert poses.tips[number] == pytest.approx(mixed.pose(row).tip, abs=1e-6)
        single = mixed.motion().step(0.02, row)
        assert moving.tips[number] == pytest.approx(single.tip, abs=1e-3)


LOADS: dict[str, dict[str, Any]] = {
    "free": {},
    "tip": {"tip_load": (0.002, 0.005, -0.005)},
    "gravity": {"gravity": (0.3, 0.6, -1.0)},
    "both": {"tip_load": (0.0, 0.005, -0.005), "gravity": True},
    "plate": {"plate": Plate((0.0, 0.0, 12.0), sticks=False)},
}


@pytest.mark.parametrize("load", LOADS)
def test_loaded_poses_are_the_single_ones(three: Stack, load: str) -> None:
    pressures = drawn_pressures(3, 4)
    batch = StackBatch(three).poses(pressures, **LOADS[load])
    near = batch if load == "plate" else StackBatch(three).poses(pressures + 0.1, **LOADS[load])
    again = StackBatch(three).poses(pressures, near=near, **LOADS[load])
    for number, row in enumerate(pressures.tolist()):
        pose = three.pose(row, **LOADS[load])
        for poses in (batch, again):
            assert poses.tips[number] == pytest.approx(pose.tip, abs=1e-6)
            assert poses.freedoms[number] == pytest.approx(pose.freedoms, abs=1e-6)
            assert poses.volumes[number] == pytest.approx(pose.volumes, abs=1e-5)


@pytest.mark.parametrize("load", ["tip", "gravity"])
def test_loaded_motions_are_the_single_ones(three: Stack, load: str) -> None:
    short = replace(three, levels=three.levels[:5])
    moving = StackBatch(short).motion(2, **LOADS[load])
    singles = [short.motion(**LOADS[load]) for _ in range(2)]
    for valves in ([[8.0, 2.0, 0.0], [3.0, 3.0, 5.0]], [[1.0, 6.0, 2.0], [0.0, 0.0, 0.0]]):
        moving.step(0.02, valves)
        for single, row in zip(singles, valves, strict=True):
            single.step(0.02, pressures=row)
        assert moving.tips == pytest.approx(np.array([s.pose.tip for s in singles]), abs=2e-5)
        pressures = np.array([single.pressures for single in singles])
        assert moving.pressures == pytest.approx(pressures, rel=2e-5, abs=1e-6)
    freedoms = np.array([single.pose.freedoms for single in singles])
    assert moving.poses.freedoms == pytest.approx(freedoms, abs=2e-5)
    moving.restart([0])
    assert moving.tips[0] == pytest.approx(short.pose((0, 0, 0), **LOADS[load]).tip, abs=1e-6)


@pytest.mark.parametrize("load", [{}, {"tip_load": (0.0, 0.0, -0.002)}])
def test_a_state_that_takes_many_steps_is_solved_alone(
    three: Stack, load: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    expected = three.motion(**load).step(0.02, (5, 1, 0)).tip
    monkeypatch.setattr(motions, "MOTION_STEPS", 1)
    moving = StackBatch(three).motion(1, **load)
    moving.step(0.02, [[5.0, 1.0, 0.0]])
    assert moving.tips[0] == pytest.approx(expected, abs=1e-3)


@pytest.mark.parametrize(
    ("pressures", "sentence"),
    [
        ([[5.0, 0.0, -1.0]], "a pressure of -1 kPa is outside"),
        ([[5.0, 0.0]], "a row a state of 3"),
        ([5.0, 0.0, 0.0], "a row a state of 3"),
        ([[np.nan, 0.0, 0.0]], "finite numbers"),
        ([["a", 0.0, 0.0]], "finite numbers"),
    ],
)
def test_pressures_that_no_pose_has_are_refused(
    three: Stack, pressures: list[list[float]], sentence: str
) -> None:
    with pytest.raises(DesignError, match=sentence):
        StackBatch(three).poses(pressures)


def test_what_is_no_batch_is_refused(three: Stack) -> None:
    batch = StackBatch(three)
    with pytest.raises(DesignError, match="a load has no weight"):
        batch.poses([[1.0, 1.0, 1.0]], weight=3)
    with pytest.raises(DesignError, match="1 poses for 2 states"):
        batch.poses([[1.0] * 3] * 2, near=batch.poses([[1.0] * 3]))
    with pytest.raises(DesignError, match="dt = 0 s"):
        batch.motion(1).step(0.0, [[1.0] * 3])
    with pytest.raises(DesignError, match="2 rows of 3"):
        batch.motion(2).step(0.1, [[1.0] * 3])
    with pytest.raises(DesignError, match="count = 0"):
        batch.motion(0)
    assert batch.poses(np.zeros((0, 3))).tips.shape == (0, 3)


@pytest.mark.parametrize("line", [Line(AIR, delay=0.03), Line(WATER)])
def test_motions_are_the_single_ones(three: Stack, line: Line) -> None:
    numbers = np.random.default_rng(3)
    moving = StackBatch(three).motion(3, line)
    singles = [three.motion(line=line) for _ in range(3)]
    for number in range(6):
        valves = numbers.uniform(0.0, 10.0, (3, 3)) * (number < 4)
        moving.step(0.02, valves)
        for single, row in zip(singles, valves.tolist(), strict=True):
            single.step(0.02, pressures=row)
        assert moving.tips == pytest.approx(np.array([s.pose.tip for s in singles]), abs=2e-5)
        pressures = np.array([single.pressures for single in singles])
        assert moving.pressures == pytest.approx(pressures, rel=2e-5, abs=1e-6)
    assert moving.times == pytest.approx(0.12)
    volumes = np.array([single.pose.volumes for single in singles])
    assert moving.poses.volumes == pytest.approx(volumes, abs=0.01)


@pytest.mark.parametrize("line", [Line(AIR), Line(WATER)])
def test_flows_of_many_are_those_of_one(line: Line) -> None:
    sources, chambers = np.meshgrid([0.0, 1e-3, 0.5, 10.0, 60.0], [0.0, 2e-3, 0.6, 10.0, 50.0])
    flows, rates = line.flows(sources, chambers)
    step = 1e-7
    for at in np.ndindex(sources.shape):
        source, chamber = float(sources[at]), float(chambers[at])
        assert flows[at] == pytest.approx(line.flow(source, chamber), rel=1e-9)
        if source != chamber:
            ends = line.flow(source, chamber + step), line.flow(source, chamber - step)
            assert rates[at] == pytest.approx((ends[0] - ends[1]) / (2 * step), rel=1e-3)
