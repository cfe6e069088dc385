"""Equilibria of the paper's 3-DoF actuator of 15 balloons, following a motion."""

from __future__ import annotations

import math
import time

import sbafab

POSES = 300


def map_seconds() -> float:
    """Processor time that mapping its balloon takes."""
    from sbafab.models.balloon_map import balloon_map

    design = sbafab.load("3dof-15mm")
    sbafab.build(design)
    balloon_map.cache_clear()
    began = time.process_time()
    sbafab.stack(design)
    return time.process_time() - began


def pose_seconds(loaded: bool) -> float:
    """Processor time of one equilibrium, with or without a load on the tip."""
    stack = sbafab.stack("3dof-15mm")
    load = (0.0, 0.005, -0.005) if loaded else (0.0, 0.0, 0.0)
    pose = stack.pose((9, 7, 5), load)
    began = time.process_time()
    for number in range(POSES):
        turn = math.tau * number / 400
        pressures = [5 + 4 * math.cos(turn - 2.1 * chamber) for chamber in range(3)]
        pose = stack.pose(pressures, load, near=pose)
    return (time.process_time() - began) / POSES
