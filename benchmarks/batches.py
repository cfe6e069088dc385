"""Many states of the paper's 3-DoF actuator at once: poses, places of the tip, and steps of
environments.
"""

from __future__ import annotations

import os
import time
from concurrent.futures import ProcessPoolExecutor
from functools import lru_cache
from typing import Any

import numpy as np

import sbafab
from benchmarks.processes import by_another_process
from benchmarks.stacks import DESIGN, LOADS, MOST
from sbafab.models.stack import Plate
from sbafab.runtime import prepare

STATES = 1024
STEPS, WARM = 60, 10
"""Steps that count, and those before."""
STEP_SECONDS = 0.02
PLACES = 1000
PLATES: dict[str, dict[str, Any]] = {
    "tilted plate 14 mm high": {"plate": Plate((0.5, 0.0, 14.0), (0.1, 0.0, 1.0))},
    "the same, slippery": {"plate": Plate((0.5, 0.0, 14.0), (0.1, 0.0, 1.0), sticks=False)},
}
"""Outer plates beside the ``LOADS``."""


def pose_seconds(is_dragged: bool) -> float:
    """Processor time of one of ``STATES`` equilibria: from poses of a little other pressures, or
    from nothing.
    """
    from sbafab.models.stack import StackBatch

    batch, numbers = StackBatch(sbafab.stack(DESIGN)), np.random.default_rng(1)
    pressures = numbers.uniform(0.1, 0.98 * MOST, (STATES, 3))
    poses = batch.poses(pressures)
    began = time.process_time()
    for _ in range(STEPS):
        moved = np.clip(pressures + numbers.uniform(-0.1, 0.1, pressures.shape), 0.0, MOST)
        if is_dragged:
            poses = batch.poses(moved, near=poses)
        else:
            batch.poses(numbers.uniform(0.0, MOST, pressures.shape))
        pressures = moved
    return (time.process_time() - began) / STEPS / STATES


@lru_cache
def places(load: str) -> Any:
    """Tips (PLACES, 3) in mm of poses at random pressures, some chambers empty or full."""
    stack, numbers = sbafab.stack(DESIGN), np.random.default_rng(31)
    drawn = np.clip(numbers.uniform(-1.0, MOST + 1.0, (PLACES, 3)), 0.0, MOST)
    loads = (LOADS | PLATES)[load]
    return np.array([stack.pose(pressures, **loads).tip for pressures in drawn.tolist()])


def reach_seconds(load: str) -> float:
    """Processor time of bringing the tip to one of ``PLACES``, all at once."""
    from sbafab.models.stack import StackBatch

    batch, loads = StackBatch(sbafab.stack(DESIGN)), (LOADS | PLATES)[load]
    tips = places(load)
    batch.reach(tips[:8], MOST, **loads)
    began = time.process_time()
    batch.reach(tips, MOST, **loads)
    return (time.process_time() - began) / PLACES


def _begun(states: int) -> tuple[Any, Any]:
    """Return environments in motion, and their next actions: uniform, new at every step."""
    from sbafab.models.environment import ReachVectorEnvironment

    made = ReachVectorEnvironment(sbafab.stack(DESIGN), states, dt=STEP_SECONDS)
    made.reset(seed=1)
    actions = np.random.default_rng(2).uniform(-1, 1, (WARM + STEPS, states, 3))
    for action in actions[:WARM]:
        made.step(action)
    return made, actions[WARM:]


def step_seconds(states: int = STATES) -> float:
    """Processor time of one step of one of so many environments."""
    made, actions = _begun(states)
    began = time.process_time()
    for action in actions:
        made.step(action)
    return (time.process_time() - began) / STEPS / states


def clock_rate(processes: int) -> float:
    """Steps of ``STATES`` environments a second by the clock, shared among processes."""
    return by_another_process(f"benchmarks.batches.measured({processes})")


def measured(processes: int) -> float:
    """Steps a second by the clock: of the slowest process, times the processes."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, range(os.cpu_count() or 1))
    with ProcessPoolExecutor(processes, initializer=prepare) as pool:
        shares = [STATES // processes] * processes
        return sum(shares) * STEPS / max(pool.map(_clock_seconds, shares))


def _clock_seconds(states: int) -> float:
    made, actions = _begun(states)
    began = time.perf_counter()
    for action in actions:
        made.step(action)
    return time.perf_counter() - began
