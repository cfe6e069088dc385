"""Equilibria of the paper's 3-DoF actuator, 15 balloons a chamber, with and without loads."""

from __future__ import annotations

import math
import random
import time
from collections.abc import Iterator
from typing import Any

import sbafab

DESIGN = "3dof-15mm"
POSES = 300
TURN = 400
"""Poses a round of the path on which all three pressures go from 1 to 9 kPa and back."""
MOST = 10.0
"""kPa up to which pressures are drawn."""
LOADS: dict[str, dict[str, Any]] = {
    "no load": {},
    "7 mN on the tip": {"tip_load": (0.0, 0.005, -0.005)},
    "gravity": {"gravity": True},
    "both": {"tip_load": (0.0, 0.005, -0.005), "gravity": True},
    "plate 12 mm high": {"plate": 12.0},
}


def map_seconds() -> float:
    """Processor time that mapping its balloon takes."""
    from sbafab.models.balloon_map import balloon_map

    design = sbafab.load(DESIGN)
    sbafab.build(design)
    balloon_map.cache_clear()
    began = time.process_time()
    sbafab.stack(design)
    return time.process_time() - began


def dragged() -> Iterator[list[float]]:
    """Pressures in kPa, each pose near the one before."""
    for number in range(POSES):
        turn = math.tau * number / TURN
        yield [5 + 4 * math.cos(turn - 2.1 * chamber) for chamber in range(3)]


def drawn() -> Iterator[list[float]]:
    """Pressures in kPa, each pose far from the one before."""
    numbers = random.Random(1)
    for _ in range(POSES):
        yield [numbers.uniform(0.0, MOST) for _ in range(3)]


def pose_seconds(load: str, is_dragged: bool) -> float:
    """Processor time of one equilibrium: from the one before along a path, or from nothing."""
    stack, loads = sbafab.stack(DESIGN), LOADS[load]
    pose = stack.pose((9, 7, 5), **loads)
    began = time.process_time()
    for pressures in dragged() if is_dragged else drawn():
        pose = stack.pose(pressures, near=pose if is_dragged else None, **loads)
    return (time.process_time() - began) / POSES


def derivative_seconds(load: str) -> float:
    """Processor time of one equilibrium from nothing with its derivatives."""
    stack, loads = sbafab.stack(DESIGN), LOADS[load]
    stack.derivatives((9, 7, 5), **loads)
    began = time.process_time()
    for pressures in drawn():
        stack.derivatives(pressures, **loads)
    return (time.process_time() - began) / POSES


def reach_seconds(load: str, is_dragged: bool) -> float:
    """Processor time of bringing the tip to a place that a pose has: as of ``pose_seconds``."""
    stack, loads = sbafab.stack(DESIGN), LOADS[load]
    tips = [stack.pose(each, **loads).tip for each in (dragged() if is_dragged else drawn())]
    pose = stack.reach(tips[0], MOST, **loads)
    began = time.process_time()
    for tip in tips:
        pose = stack.reach(tip, MOST, near=pose if is_dragged else None, **loads)
    return (time.process_time() - began) / POSES
