"""Tubes by closed formulas, and stacks that fill in time."""

from __future__ import annotations

import math

import pytest

import sbafab
from sbafab.errors import DesignError
from sbafab.models.elastic import time_to_fill
from sbafab.models.pneumatics import AIR, ATMOSPHERE_KPA, WATER, Line
from sbafab.models.stack import Stack


@pytest.fixture(scope="module")
def three() -> Stack:
    return sbafab.stack("3dof-15mm")


def test_water_at_35_ml_min_loses_146_pa_a_mm() -> None:
    line = Line(WATER, length=1.0, diameter=0.635)
    assert line.source_pressure(35e3 / 60, 0.0) == pytest.approx(0.146, rel=0.01)


def test_slow_air_flows_by_the_difference_of_squares() -> None:
    line = Line(AIR, length=1000.0)
    up, down = 5 + ATMOSPHERE_KPA, ATMOSPHERE_KPA
    by_hand = math.pi * 0.635**4 * (up**2 - down**2)
    by_hand /= 256 * AIR.viscosity * 1000 * ATMOSPHERE_KPA
    assert line.flow(5.0, 0.0) == pytest.approx(by_hand)
    assert line.flow(0.0, 5.0) == pytest.approx(-by_hand)


def test_fast_air_is_turbulent() -> None:
    # Blasius by hand at 2.5 l/min in 150 mm: Re = 4 Q / (pi d nu) = 5,500.
    flow, d = 2.5e6 / 60, 0.635
    speed = flow / (math.pi * d**2 / 4) / 1000
    reynolds = speed * d / 1000 * 1.204 / 1.82e-5
    drop = 0.316 * reynolds**-0.25 * 150 / d * 1.204 * speed**2 / 2 / 1000
    up = math.sqrt(ATMOSPHERE_KPA**2 + 2 * ATMOSPHERE_KPA * drop) - ATMOSPHERE_KPA
    assert 5000 < reynolds < 6000
    assert Line(AIR).source_pressure(flow, 0.0) == pytest.approx(up, rel=1e-3)


def test_a_pump_of_water_puts_in_what_it_delivers(three: Stack) -> None:
    motion = three.motion(line=Line(WATER))
    empty = motion.pose.volumes
    for _ in range(3):
        motion.step(0.1, flows=(300.0, 200.0, 0.0))
    assert motion.time == pytest.approx(0.3)
    assert motion.pose.volumes[:2] - empty[:2] == pytest.approx([90.0, 60.0], abs=0.05)
    # The third one is bent open, but its pump is shut: it keeps its volume against suction.
    assert motion.pose.volumes[2] == pytest.approx(empty[2], abs=0.05)
    assert -2.0 < motion.pressures[2] < 0.0
    assert motion.pose.volumes.sum() - empty.sum() == pytest.approx(150.0, abs=0.1)
    pressure, _, _ = motion.pressures
    tube = Line(WATER).source_pressure(300.0, 0.0)
    assert motion.sources[0] == pytest.approx(pressure + tube)


def test_a_prediction_of_water_is_what_the_motion_does(three: Stack) -> None:
    time, pose = time_to_fill(three, 35.0, 10.0)
    motion = three.motion(line=Line(WATER))
    for _ in range(4):
        motion.step(time / 4, flows=(35e3 / 60 / 3,) * 3)
    assert motion.sources[0] == pytest.approx(10.0, rel=1e-3)
    assert motion.pose.height == pytest.approx(pose.height, rel=1e-3)


def test_a_pose_has_no_suction_where_nothing_is_shut(three: Stack) -> None:
    with pytest.raises(DesignError, match="a pressure of -1 kPa is outside"):
        three.pose((5, 0, -1))


def test_a_valve_fills_to_its_pressure_and_no_further(three: Stack) -> None:
    motion = three.motion(line=Line(AIR, delay=0.02))
    motion.step(0.01, pressures=(5, 0, 0))
    assert max(motion.pressures) == 0.0
    before = 0.0
    for _ in range(6):
        pose = motion.step(0.05, pressures=(5, 0, 0))
        assert motion.pressures[0] >= before
        before = motion.pressures[0]
    assert before == pytest.approx(5.0, rel=1e-3)
    assert pose.bend == pytest.approx(three.pose((5, 0, 0)).bend, rel=1e-3)


def test_shut_chambers_keep_their_air(three: Stack) -> None:
    motion = three.motion((5, 5, 5), line=Line(AIR))
    motion.load = {"tip_load": (0.0, 0.0, -0.005)}
    pose = motion.step(1.0, flows=(0.0, 0.0, 0.0))
    tube = Line(AIR).tube_volume

    def air(volume: float, pressure: float) -> float:
        return (volume + tube) * (1 + pressure / ATMOSPHERE_KPA)

    start = three.pose((5, 5, 5))
    assert pose.pressures[0] > 5
    kept = air(start.volumes[0], 5.0)
    assert air(pose.volumes[0], pose.pressures[0]) == pytest.approx(kept, rel=5e-6)


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"dt": 0.0, "pressures": (1, 1, 1)}, "must be above 0 s"),
        ({"dt": 0.1}, "either pressures or flows"),
        ({"dt": 0.1, "pressures": (1, 1)}, "takes 3 finite numbers"),
        ({"dt": 0.1, "flows": (1e5, 0, 0)}, "more than 110 kPa"),
    ],
)
def test_a_step_that_cannot_be_is_refused(
    three: Stack, asked: dict[str, object], said: str
) -> None:
    with pytest.raises(DesignError, match=said):
        three.motion(line=Line(WATER)).step(**asked)  # type: ignore[arg-type]
    for wrong in ({"length": 0.0}, {"diameter": 1e300}, {"dead_volume": -1.0}, {"delay": math.nan}):
        with pytest.raises(DesignError, match=f"line {next(iter(wrong))} = .* must be from"):
            Line(**wrong)


def test_small_steps_and_large_ones_agree(three: Stack) -> None:
    ends = []
    for count in (8, 32):
        motion = three.motion(line=Line(WATER))
        for _ in range(count):
            motion.step(0.8 / count, pressures=(8, 8, 8))
        ends.append(motion.pose.height)
    assert ends[0] == pytest.approx(ends[1], rel=0.02)
