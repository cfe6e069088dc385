"""Derivatives of a stack in equilibrium, against central differences of its poses."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import sbafab
from sbafab.models.derivatives import Rates
from sbafab.models.stack import Plate, Pose, Stack
from sbafab.models.stack_loads import energy

Array = NDArray[np.float64]
DESIGNS: dict[str, tuple[str, dict[str, Any]]] = {
    "three chambers": ("3dof-15mm", {}),
    "two chambers": ("3dof-15mm", {"chamber.count": 2, "stack.balloons": 4}),
    "one chamber": ("1dof-5mm", {"stack.balloons": 4}),
    "tapered": ("1dof-5mm", {"chamber.diameter": [6, 5], "stack.balloons": 2}),
}
LEANING = Plate((0.2, 0.0, 0.0), (0.1, 0.0, 1.0), sticks=False)
LOADS: dict[str, dict[str, Any]] = {
    "free": {},
    "tip": {"tip_load": (0.002, 0.003, -0.004)},
    "both": {"tip_load": (0.0, 0.005, -0.005), "gravity": (0.0, 0.6, -1.0)},
    "level plate": {"plate": Plate((0.0, 0.0, 0.0))},
    "leaning plate": {"plate": LEANING},
}
"""Plates stand where the chambers reach them at about 1 kPa."""
JUMP = 0.02
"""Share by which differences to either side differ where a contact opens or closes."""


@cache
def stack_of(name: str) -> Stack:
    source, changes = DESIGNS[name]
    return sbafab.stack(source, changes)


def figures(pose: Pose) -> Array:
    """Return tip, turn of the top, volumes and force on a plate."""
    top = pose.frames[1][-1]
    turn = [top[2, 1] - top[1, 2], top[0, 2] - top[2, 0], top[1, 0] - top[0, 1]]
    return np.concatenate([pose.tip, turn, pose.volumes, [pose.force]])


def expected(rates: Rates, pose: Pose, column: int) -> Array:
    """Return the rates of ``figures``: a turn t moves the axes a by t x a."""
    turn = rates.turn[:, column]
    moved = np.cross(turn, pose.frames[1][-1].T).T
    twist = [moved[2, 1] - moved[1, 2], moved[0, 2] - moved[2, 0], moved[1, 0] - moved[0, 1]]
    parts = rates.tip[:, column], twist, rates.volumes[:, column], [rates.force[column]]
    return np.concatenate(parts)


def is_met(pose: Pose, steps: list[Pose], step: float, wanted: Array) -> bool:
    """Compare with central differences, unless a contact opens or closes within the steps."""
    low, middle, high = (figures(each) for each in (steps[0], pose, steps[1]))
    behind, ahead = (middle - low) / step, (high - middle) / step
    size = np.abs(wanted).max()
    if np.abs(ahead - behind).max() > JUMP * size:
        return False
    assert (ahead + behind) / 2 == pytest.approx(wanted, rel=0, abs=5e-3 * size)
    return True


@pytest.mark.parametrize("load", LOADS)
@pytest.mark.parametrize("name", DESIGNS)
def test_derivatives_are_central_differences_of_poses(name: str, load: str) -> None:
    stack, loads, met = stack_of(name), dict(LOADS[load]), 0
    if "plate" in loads:
        x, y, _ = loads["plate"].point
        loads["plate"] = replace(loads["plate"], point=(x, y, 2.5 * stack.flat_height))
    pressures = 10 ** np.random.default_rng(1).uniform(-0.5, 1.3, stack.chambers)
    each = stack.derivatives(pressures.tolist(), **loads)
    for chamber in range(stack.chambers):
        step = 4e-4 * pressures[chamber]
        ends = [pressures + side * step * np.eye(stack.chambers)[chamber] for side in (-1, 1)]
        steps = [stack.pose(end.tolist(), near=each.pose, **loads) for end in ends]
        met += is_met(each.pose, steps, step, expected(each.by_pressure, each.pose, chamber))
    force = np.array(loads.get("tip_load", (0.0, 0.0, 0.0)))
    for way in range(3):
        step, steps = 5e-4 if "plate" in loads else 2e-5, []
        for side in (-1, 1):
            pulled = {**loads, "tip_load": force + side * step * np.eye(3)[way]}
            steps.append(stack.pose(pressures.tolist(), near=each.pose, **pulled))
        met += is_met(each.pose, steps, step, expected(each.by_wrench, each.pose, way))
    assert met >= (stack.chambers + 3) / 2
    assert (each.by_plate is None) == ("plate" not in loads)
    if each.by_plate is not None:
        plate, step, steps = loads["plate"], 2e-3, []
        way = np.array(plate.normal) / np.linalg.norm(plate.normal)
        for side in (-1, 1):
            x, y, z = (np.array(plate.point) + side * step * way).tolist()
            shifted = {**loads, "plate": replace(plate, point=(x, y, z))}
            steps.append(stack.pose(pressures.tolist(), near=each.pose, **shifted))
        is_met(each.pose, steps, step, expected(each.by_plate, each.pose, 0))


@pytest.mark.parametrize("plate", [None, Plate((0.3, 0.0, 9.0), (0.1, 0.0, 1.0))])
def test_second_derivatives_are_those_of_the_energy(plate: Plate | None) -> None:
    """And first ones; far from equilibrium too, where forces turn all levels."""
    stack = stack_of("three chambers")
    springs = stack.springs(np.array([[8.0, 5.0, 2.0]]), by_level=True)
    loads = {"tip_load": (0.1, 0.2, -0.3), "gravity": (0.0, 0.3, -1.0), "plate": plate}
    load = stack.acting(loads)
    at = np.random.default_rng(1).uniform(-0.2, 0.2, (1, 15, 3))
    at[..., 0] += 0.8
    now = energy(springs, stack.pitch, load, at)
    gradient, matrix = now.gradient[0], now.matrix[0, 0]
    step = 1e-6
    for number in (0, 1, 2, 22, 23, 43, 44):
        ahead = step * np.eye(45)[number].reshape(1, 15, 3)
        low, high = (energy(springs, stack.pitch, load, at + side * ahead) for side in (-1, 1))
        slope = (high.value - low.value)[0] / (2 * step)
        assert gradient[number] == pytest.approx(slope, rel=1e-4, abs=1e-2)
        room = 1e-9 * np.abs(matrix).max() + 1e-4
        rates = (high.gradient - low.gradient)[0] / (2 * step)
        assert matrix[number] == pytest.approx(rates, rel=1e-6, abs=room)


def test_responses_are_mutual() -> None:
    """Maxwell and Betti: forces at the tip and pressures act on each other's motions alike."""
    stack = stack_of("three chambers")
    each = stack.derivatives((6, 3, 1), tip_load=(0.002, 0.003, -0.004), gravity=True)
    assert each.compliance == pytest.approx(each.compliance.T, rel=1e-9)
    assert each.by_pressure.volumes == pytest.approx(each.by_pressure.volumes.T, rel=1e-9)
    # ul by N are mm by kPa times 1000 mN.
    filled = each.by_wrench.volumes[:, :3]
    assert filled == pytest.approx(1000 * each.by_pressure.tip.T, rel=1e-9)
    assert each.stiffness @ each.compliance == pytest.approx(np.eye(6), abs=1e-6)
    assert (np.linalg.eigvalsh(each.compliance) > 0).all()


def test_a_straight_column_is_as_stiff_as_its_balloons_in_series() -> None:
    """And it does not twist, whatever the moment."""
    stack = stack_of("one chamber")
    stiffness = stack.stiffness((5,))
    balloon, rise = stack.maps[0], float(stack.pose((5,)).gaps[0, 0])
    pair = balloon.force(5, np.array([rise - 1e-4, rise + 1e-4]))
    assert stiffness[2, 2] == pytest.approx((pair[0] - pair[1]) / 2e-4 / 1000 / 4, rel=1e-5)
    assert np.abs(stiffness[5]).max() < 1e-9 * np.abs(stiffness).max()


def test_volumes_of_a_map_grow_as_their_slopes_say() -> None:
    balloon = stack_of("three chambers").maps[0]
    pressures, step = np.array([-0.05, 0.03, 1.0, 40.0]), 1e-5
    low, high = (balloon.splines(pressures + side * step, 2, sucked=True) for side in (-1, 1))
    difference = (high - low)[:, :, 1] / (2 * step)
    slopes = balloon.splines(pressures, 3, sucked=True)[:, :, 2]
    assert slopes == pytest.approx(difference, rel=1e-5, abs=1e-5 * np.abs(difference).max())
