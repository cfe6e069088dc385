"""Derivatives of a stack in equilibrium, against central differences of its poses."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

import sbafab
from sbafab.errors import DesignError
from sbafab.models.derivatives import hessian
from sbafab.models.stack import NO_LOAD, Plate, Pose, Stack
from sbafab.models.stack_balance import Balance
from sbafab.models.stack_loads import (
    Load,
    loaded_energy,
)

Array = NDArray[np.float64]
DESIGNS: dict[str, tuple[str, dict[str, Any]]] = {
    "three chambers": ("3dof-15mm", {}),
    "two chambers": ("3dof-15mm", {"chamber.count": 2, "stack.balloons": 4}),
    "one chamber": ("1dof-5mm", {"stack.balloons": 4}),
    "tapered": ("1dof-5mm", {"chamber.diameter": [8, 6, 5], "stack.balloons": 3}),
}
LOADS: dict[str, dict[str, Any]] = {
    "free": {},
    "tip": {"tip_load": (0.002, 0.003, -0.004)},
    "both": {"tip_load": (0.0, 0.005, -0.005), "gravity": (0.0, 0.6, -1.0)},
}
EXACT = 1e-5
ROUNDING = 1e-11
"""What is lost of a pose to rounding, in mm or N."""


@cache
def stack_of(name: str) -> Stack:
    source, changes = DESIGNS[name]
    return sbafab.stack(source, changes)


def acting(stack: Stack, loads: dict[str, Any]) -> Load:
    """Return the loads; none are a tip load of nothing, so that all levels are solved together."""
    load = stack.load(**{**NO_LOAD, **loads})
    return load or Load(np.zeros(3), None, None)


def settled(stack: Stack, pressures: Array, load: Load, start: Array) -> Pose:
    """Return the pose in equilibrium to rounding."""
    springs, at = stack.springs(pressures, by_level=True), start
    for _ in range(40):
        now = loaded_energy(springs, stack.pitch, load, at)
        move = np.linalg.solve(hessian(now, now.rest(), at, stack.pitch), now.gradient).reshape(
            -1, 3
        )
        after = loaded_energy(springs, stack.pitch, load, at - move)
        while np.abs(move).max() > 1e-6 and after.value > now.value:
            move = move / 2
            after = loaded_energy(springs, stack.pitch, load, at - move)
        at = at - move
        if np.abs(move).max() < 1e-13:
            break
    balance = Balance.of(at[None], now.push[None])
    return stack.pose_of(stack.settled(pressures[None], balance, load))


def figures(pose: Pose) -> Array:
    """Return tip, volumes and force on a plate."""
    return np.concatenate([pose.tip, pose.volumes, [pose.force]])


def turn_rate(low: Pose, high: Pose, step: float) -> Array:
    """Return the turn of the top by a unit of what changed by two steps."""
    middle = (high.frames[1][-1] + low.frames[1][-1]) / 2
    rate = (high.frames[1][-1] - low.frames[1][-1]) / (2 * step) @ middle.T
    return np.array([rate[2, 1] - rate[1, 2], rate[0, 2] - rate[2, 0], rate[1, 0] - rate[0, 1]]) / 2


def closed(stack: Stack, pose: Pose, load: Load) -> bytes:
    """Return which contacts are closed: derivatives jump where they change."""
    shut = stack.level_places.closed(pose.freedoms)
    springs = stack.springs(pose.pressures, by_level=True)
    touch = loaded_energy(springs, stack.pitch, load, pose.freedoms).touch
    deep = np.zeros(0) if touch is None else touch.deep
    return bytes(shut.ravel()) + bytes(deep > 0)


class Case(NamedTuple):
    """Rates by one quantity: a step of it, and pressures and load a share of the step ahead."""

    rates: list[Array]
    step: float
    ahead: Callable[[float], tuple[Array, Load]]


def cases(stack: Stack, pressures: Array, loads: dict[str, Any]) -> Iterator[Case]:
    each, load = stack.derivatives(pressures.tolist(), **loads), acting(stack, loads)
    plate: Plate | None = loads.get("plate")
    for chamber, pressure in enumerate(pressures):
        step = 2e-4 * max(float(pressure), 0.1)

        def pressed(share: float, chamber: int = chamber, step: float = step) -> tuple[Array, Load]:
            return pressures + share * step * np.eye(stack.chambers)[chamber], load

        yield Case([part[..., chamber] for part in each.by_pressure], step, pressed)
    # A stiff plate leaves fewer digits to a force on it, and bends less. At twice this step the
    # differences themselves are 1.4e-5 off at a pose of three chambers.
    step = 2e-6 if plate is None else 5e-5
    for way in range(3):

        def pulled(share: float, way: int = way) -> tuple[Array, Load]:
            more = 1000 * step * share * np.eye(3)[way]
            return pressures, load._replace(tip=load.tip + more)

        yield Case([part[..., way] for part in each.by_wrench], step, pulled)
    assert (each.by_plate is None) == (plate is None)
    if each.by_plate is not None and plate is not None:
        shift = 1e-5

        def shifted(share: float) -> tuple[Array, Load]:
            way = np.array(plate.normal) / np.linalg.norm(plate.normal)
            x, y, z = (np.array(plate.point) + share * shift * way).tolist()
            return pressures, acting(stack, {**loads, "plate": replace(plate, point=(x, y, z))})

        yield Case([part[..., 0] for part in each.by_plate], shift, shifted)


def differences(poses: list[Pose], step: float) -> list[Array]:
    """Return the rates of two poses two steps apart: as of ``Rates``."""
    low, high = poses
    volumes, force = high.volumes - low.volumes, np.array(high.force - low.force)
    parts = [high.tip - low.tip, volumes, force, high.freedoms - low.freedoms]
    tip, volumes, force, freedoms = (part / (2 * step) for part in parts)
    return [tip, turn_rate(low, high, step), volumes, force, freedoms]


def compare(stack: Stack, pressures: Array, loads: dict[str, Any]) -> int:
    """Compare derivatives with differences; return by how many quantities."""
    start = stack.pose(pressures.tolist(), **loads).freedoms
    pose = settled(stack, pressures, acting(stack, loads), start)
    compared = 0
    for case in cases(stack, pressures, loads):
        ends = [case.ahead(share) for share in (-1.0, 1.0, -0.5, 0.5)]
        poses = [settled(stack, *end, pose.freedoms) for end in ends]
        contacts = {closed(stack, each, end[1]) for each, end in zip(poses, ends, strict=True)}
        if len(contacts) > 1:
            continue
        compared += 1
        wide, near = (
            differences(pair, step)
            for pair, step in ((poses[:2], case.step), (poses[2:], case.step / 2))
        )
        for rate, rough, fine in zip(case.rates, wide, near, strict=True):
            # Richardson's extrapolation: the error falls with the fourth power of the step.
            exact = (4 * fine - rough) / 3
            room = EXACT * float(np.abs(exact).max()) + ROUNDING / case.step
            assert rate == pytest.approx(exact, rel=0, abs=room)
    return compared


def drawn(stack: Stack, seed: int, count: int = 1) -> list[Array]:
    """Return random pressures in kPa, as many low ones as high ones."""
    numbers = np.random.default_rng(seed)
    return [10 ** numbers.uniform(-1, 1.3, stack.chambers) for _ in range(count)]


def loads_of(stack: Stack) -> dict[str, dict[str, Any]]:
    """Return the loads, with plates that the chambers reach at about 1 kPa."""
    height = 2.5 * stack.flat_height
    leaning = Plate((0.2, 0.0, height), (0.1, 0.0, 1.0), sticks=False)
    level = Plate((0.0, 0.0, height))
    return {**LOADS, "level plate": {"plate": level}, "leaning plate": {"plate": leaning}}


@pytest.mark.parametrize("name", DESIGNS)
def test_derivatives_are_central_differences_of_poses(name: str) -> None:
    stack = stack_of(name)
    compared = [compare(stack, drawn(stack, 1)[0], loads) for loads in loads_of(stack).values()]
    # Where a contact opens or closes within the steps there is no derivative to compare.
    assert sum(compared) >= 0.7 * len(compared) * (stack.chambers + 3)


@pytest.mark.long
@pytest.mark.parametrize("name", DESIGNS)
def test_derivatives_are_central_differences_of_many_poses(name: str) -> None:
    stack, compared, most = stack_of(name), 0, 0
    for loads in loads_of(stack).values():
        for pressures in drawn(stack, 2, 20):
            try:
                pose = stack.pose(pressures.tolist(), **loads)
            except DesignError:
                # A top that slides under a leaning plate may find no balance.
                continue
            if pose.stable:
                compared += compare(stack, pressures, loads)
                most += stack.chambers + 3
    assert compared >= 0.7 * most


@pytest.mark.parametrize("plate", [None, Plate((0.3, 0.0, 9.0), (0.1, 0.0, 1.0))])
def test_second_derivatives_are_those_of_the_energy(plate: Plate | None) -> None:
    """And first ones; far from equilibrium too, where forces turn all levels."""
    stack = stack_of("three chambers")
    springs = stack.springs((8, 5, 2), by_level=True)
    load = stack.load((0.1, 0.2, -0.3), (0.0, 0.3, -1.0), plate)
    assert load is not None
    at = np.random.default_rng(1).uniform(-0.2, 0.2, (15, 3))
    at[:, 0] += 0.8
    now = loaded_energy(springs, stack.pitch, load, at)
    matrix = hessian(now, now.rest(), at, stack.pitch)
    step = 1e-6
    for number in (0, 1, 2, 22, 23, 43, 44):
        ahead = step * np.eye(45)[number].reshape(15, 3)
        low, high = (
            loaded_energy(springs, stack.pitch, load, at + side * ahead) for side in (-1, 1)
        )
        slope = (high.value - low.value) / (2 * step)
        assert now.gradient[number] == pytest.approx(slope, rel=1e-4, abs=1e-2)
        room = 1e-9 * np.abs(matrix).max() + 1e-4
        rates = (high.gradient - low.gradient) / (2 * step)
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
