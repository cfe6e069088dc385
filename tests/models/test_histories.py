"""Random, harsh histories of pumps and valves: nothing gives up, and no fluid is lost.

SBAFAB_HISTORIES=200 python -m pytest tests/models/test_histories.py runs as many of each kind.
"""

from __future__ import annotations

import math
import os
from typing import Any

import numpy as np
import pytest

import sbafab
from sbafab.models.motion import SUCTION, Motion
from sbafab.models.pneumatics import AIR, WATER, Line
from sbafab.models.stack import Stack

COUNT = int(os.environ.get("SBAFAB_HISTORIES", "3"))
STEPS = 15
TOLERANCE, LEAST_CONTENT = 1e-5, 20.0
"""Tolerance as a share of a chamber's content; in ul, the least content it is taken of."""
LOADS: list[dict[str, Any]] = [{}, {"tip_load": (0.0, 0.005, -0.005)}]


@pytest.fixture(scope="module")
def three() -> Stack:
    # Pockets as drawn, which hold what is asked for.
    return sbafab.stack("3dof-15mm", "models.calibration=none")


def contents(motion: Motion) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Fluid in each chamber and, of a gas, in its tube, in ul at the atmosphere."""
    line, pose = motion.line, motion.pose
    more = line.tube_volume if line.fluid.is_gas else 0.0
    pairs = zip(pose.volumes, pose.pressures, strict=True)
    return np.array([line.content(volume + more, p) for volume, p in pairs])


@pytest.mark.parametrize("load", LOADS, ids=["free", "7 mN"])
@pytest.mark.parametrize("fluid", [WATER, AIR], ids=["water", "air"])
def test_no_history_gives_up_and_no_fluid_is_lost(
    three: Stack, fluid: Any, load: dict[str, Any]
) -> None:
    for seed in range(math.ceil(COUNT / 3) if load and COUNT < 10 else COUNT):
        numbers = np.random.default_rng(seed)
        motion = three.motion(line=Line(fluid), **load)
        for _ in range(STEPS):
            dt = float(10 ** numbers.uniform(-3, 0))
            before = contents(motion)
            if numbers.random() < 0.5:
                sources = numbers.uniform(0, 1, 3) ** 3 * 100
                motion.step(dt, pressures=tuple(sources))
                pairs = zip(sources, motion.pressures, strict=True)
                wanted = before + dt * np.array([motion.line.flow(float(s), p) for s, p in pairs])
            else:
                # To anywhere from much less than nothing to as much as some 15 kPa hold.
                wanted = numbers.uniform(-60, 300, 3)
                motion.step(dt, flows=tuple((wanted - before) / dt))
            missed = contents(motion) - wanted
            close = (
                2
                * TOLERANCE
                * np.maximum(np.maximum(np.abs(before), np.abs(wanted)), LEAST_CONTENT)
            )
            at = np.array(motion.pressures)
            empty = (at == 0.0) | (at <= -SUCTION * (1 - 1e-9))
            # What a valve leaves without pressure draws in what it lacks, and no pump takes out
            # more than there is; all else keeps count.
            assert (missed >= -close).all(), (seed, missed)
            assert (missed <= close)[~empty].all(), (seed, missed)
            assert np.isfinite(motion.pose.tip).all()
            assert motion.pose.stable


def test_two_half_steps_of_a_pump_end_where_the_whole_one_does(three: Stack) -> None:
    """What a pump of water puts in decides where a stack without a load stands, not the steps."""
    looked_at = 0
    for seed in range(2 * COUNT):
        numbers = np.random.default_rng(seed)
        whole, halves = (three.motion(line=Line(WATER)) for _ in range(2))
        for _ in range(4):
            goal = numbers.uniform(80, 280, 3)
            flows = (goal - whole.pose.volumes) / 0.5
            whole.step(0.5, flows=tuple(flows))
            heights = [halves.pose.height]
            for left in (0.5, 0.25):
                halves.step(0.25, flows=tuple((goal - contents(halves)) / left))
                heights.append(halves.pose.height)
            if min(*whole.pressures, *halves.pressures) == 0.0:
                break
            looked_at += 1
            assert halves.pressures == pytest.approx(whole.pressures, rel=1e-3, abs=1e-4)
            assert halves.pose.tip == pytest.approx(whole.pose.tip, abs=1e-3)
    assert looked_at > COUNT
