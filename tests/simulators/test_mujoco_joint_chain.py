"""The stack as plates on springs, settled by MuJoCo."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import sbafab
from sbafab.models.stack import Stack
from sbafab.simulators.mujoco_chain import ACCURACY, JOINTS, chain_text, joint_values, length_of

mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed")

STEPS = 300
CASES = [
    ("1dof-5mm", (10.0,)),
    ("short", (10.0, 5.0, 0.0)),
    ("lobed", (10.0, 0.0, 0.0)),
    ("lobed", (20.0, 3.0, 9.0)),
]


@pytest.fixture(scope="module")
def stacks() -> dict[str, Stack]:
    return {
        "1dof-5mm": sbafab.stack("1dof-5mm"),
        "short": sbafab.stack("3dof-15mm", "stack.balloons=1"),
        "lobed": sbafab.stack("3dof-15mm", "stack.balloons=5"),
    }


def loaded(stack: Stack, pressures: tuple[float, ...]) -> tuple[Any, Any]:
    model = mujoco.MjModel.from_xml_string(chain_text("a--b", stack, pressures))
    return model, mujoco.MjData(model)


def settled(model: Any, state: Any) -> np.ndarray:
    mujoco.mj_step(model, state, STEPS)
    mujoco.mj_kinematics(model, state)
    assert not any(warning.number for warning in state.warning)
    return np.array(state.site("tip").xpos)


@pytest.mark.parametrize(("name", "pressures"), CASES)
def test_it_settles_from_flat_in_the_stack_s_pose(
    stacks: dict[str, Stack], name: str, pressures: tuple[float, ...]
) -> None:
    stack = stacks[name]
    model, state = loaded(stack, pressures)
    mujoco.mj_kinematics(model, state)
    assert state.site("tip").xpos == pytest.approx([0, 0, stack.flat_height])
    pose = stack.pose(pressures)
    tip = settled(model, state)
    assert np.linalg.norm(tip - pose.tip) < ACCURACY * length_of(pose)
    # The key is that state, at rest.
    mujoco.mj_resetDataKeyframe(model, state, model.key("pressed").id)
    mujoco.mj_kinematics(model, state)
    assert state.site("tip").xpos == pytest.approx(tip, abs=1e-3)


@pytest.mark.parametrize(("name", "pressures"), CASES)
@pytest.mark.parametrize("end", [0, 1])
def test_the_tip_follows_pressures_to_both_ends_of_the_range(
    stacks: dict[str, Stack], name: str, pressures: tuple[float, ...], end: int
) -> None:
    stack = stacks[name]
    model, state = loaded(stack, pressures)
    state.ctrl[:] = model.actuator_ctrlrange[:, end]
    assert state.ctrl.any()
    pose = stack.pose(tuple(np.array(pressures) + state.ctrl))
    moved = np.linalg.norm(settled(model, state) - pose.tip)
    assert moved < 1.05 * ACCURACY * length_of(pose)


def test_a_force_on_the_tip_moves_it_as_the_stack_s_compliance_says(
    stacks: dict[str, Stack],
) -> None:
    stack, pressures = stacks["lobed"], (20.0, 3.0, 9.0)
    at = stack.derivatives(pressures).by_wrench.tip[:, :3]
    for force in np.eye(3):
        small = force * 1e-3 / np.linalg.norm(at @ force)  # N that move it by 0.001 mm
        model, state = loaded(stack, pressures)
        rest = settled(model, state)
        state.xfrc_applied[-1, :3] = 1000 * small
        assert settled(model, state) - rest == pytest.approx(at @ small, abs=3e-5)


def test_where_balloons_are_flat_there_are_no_controls(stacks: dict[str, Stack]) -> None:
    text = chain_text("flat", stacks["1dof-5mm"], (0.0,))
    assert "there are no controls" in text
    assert mujoco.MjModel.from_xml_string(text).nu == 0


def test_a_film_without_density_has_a_mass_that_stands_in(stacks: dict[str, Stack]) -> None:
    stack = replace(stacks["1dof-5mm"], weight=None)
    text = chain_text("light", stack, (10.0,))
    assert "a film has no density" in text
    model = mujoco.MjModel.from_xml_string(text)
    assert float(model.body_mass.sum()) == pytest.approx(6e-5)


def test_plates_of_a_pose_stand_as_in_the_stack(stacks: dict[str, Stack]) -> None:
    stack = stacks["lobed"]
    model, state = loaded(stack, (10.0, 0.0, 0.0))
    pose = stack.pose((10.0, 0.0, 0.0))
    for (level, place), value in np.ndenumerate(joint_values(pose.freedoms)):
        state.joint(f"level{level + 1}_{JOINTS[place]}").qpos = value
    mujoco.mj_kinematics(model, state)
    for level, place in enumerate(pose.frames[0][1:], start=1):
        assert state.body(f"plate{level}").xpos == pytest.approx(place, abs=1e-3)
    assert float(model.body_mass.sum()) == pytest.approx(5 * stack.level_weight / 9806.65)
