"""The stack as an environment of Gymnasium, by Gymnasium's own checker."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import sbafab
from sbafab.errors import DesignError

pytest.importorskip("gymnasium")

from sbafab.models.environment import ReachEnvironment


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
