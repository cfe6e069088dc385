"""The stack as an environment of Gymnasium, by Gymnasium's own checker."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import sbafab
from sbafab.errors import DesignError

pytest.importorskip("gymnasium")

from sbafab.models.environment import ReachEnvironment, ReachVectorEnvironment


def test_gymnasium_s_checker_has_nothing_to_say() -> None:
    from gymnasium.utils.env_checker import check_env

    made = ReachEnvironment(sbafab.stack("1dof-5mm"), steps=20)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(made, skip_render_check=True)


def test_pressures_that_made_the_target_reach_it() -> None:
    stack = sbafab.stack("3dof-15mm")
    made = ReachEnvironment(stack, most_pressure=8.0, dt=0.1, steps=50)
    target = stack.pose((6.0, 2.0, 0.0)).tip
    seen, _ = made.reset(seed=1, options={"target": target})
    assert seen[3:6] == pytest.approx(target)
    assert seen[9:] == pytest.approx([0.0, 0.0, 0.0])
    for _ in range(50):
        seen, reward, is_there, is_over, _ = made.step(np.array([0.5, -0.5, -1.0]))
        if is_there or is_over:
            break
    assert is_there
    assert reward == pytest.approx(-np.linalg.norm(seen[:3] - target))
    assert made.observation_space.contains(seen)


def test_more_pressure_than_the_stack_was_made_for_is_refused() -> None:
    with pytest.raises(DesignError, match="at most 110 kPa"):
        ReachEnvironment(sbafab.stack("1dof-5mm"), most_pressure=500.0)


@pytest.mark.parametrize(
    ("design", "load"), [("3dof-15mm", {}), ("1dof-5mm", {"tip_load": (0.0, 0.0, -0.005)})]
)
def test_many_at_once_do_what_single_ones_do(design: str, load: dict[str, object]) -> None:
    from gymnasium.vector import SyncVectorEnv

    stack = sbafab.stack(design)

    def one() -> ReachEnvironment:
        return ReachEnvironment(stack, steps=4, near=2.0, **load)

    singles = SyncVectorEnv([one] * 3)
    many = ReachVectorEnvironment(stack, 3, steps=4, near=2.0, **load)
    assert many.single_observation_space == singles.single_observation_space
    assert many.observation_space == singles.observation_space
    assert many.action_space == singles.action_space
    assert many.metadata["autoreset_mode"] == singles.metadata["autoreset_mode"]
    seen, _ = singles.reset(seed=5)
    assert many.reset(seed=5)[0] == pytest.approx(seen, abs=1e-4)
    numbers, ends = np.random.default_rng(2), 0
    for _ in range(9):
        actions = numbers.uniform(-1.2, 1.2, (3, stack.chambers))
        expected, got = singles.step(actions), many.step(actions)
        assert many.observation_space.contains(got[0])
        # Single motions end within 1e-5 of a chamber's content.
        assert got[0] == pytest.approx(expected[0], abs=2e-3)
        assert got[1] == pytest.approx(expected[1], abs=2e-3)
        assert (got[2] == expected[2]).all()
        assert (got[3] == expected[3]).all()
        assert got[4]["time"][~got[2]] == pytest.approx(many._motion.times[~got[2]])
        ends += int((got[2] | got[3]).sum())
    assert ends >= 3  # some of them began anew


def test_many_that_reach_their_target_begin_anew() -> None:
    stack = sbafab.stack("1dof-5mm")
    many = ReachVectorEnvironment(stack, 2, dt=0.5)
    with pytest.raises(DesignError, match="call reset first"):
        many.step(np.zeros((2, 1)))
    target = stack.pose((5.0,)).tip
    seen, _ = many.reset(options={"target": target})
    assert seen[:, 3:6] == pytest.approx(np.tile(target, (2, 1)))
    seen, rewards, is_there, _, _ = many.step(np.array([[0.0], [-1.0]]))
    assert is_there.tolist() == [True, False]
    seen, rewards, is_there, _, info = many.step(np.zeros((2, 1)))
    assert rewards[0] == 0.0
    assert is_there.tolist() == [False, True]
    assert seen[0, -1] == 0.0
    assert info["time"].tolist() == [0.0, 1.0]
    with pytest.raises(DesignError, match="num_envs = 0"):
        ReachVectorEnvironment(stack, 0)
    with pytest.raises(DesignError, match="give one seed, or 2"):
        many.reset(seed=[1, 2, 3])
