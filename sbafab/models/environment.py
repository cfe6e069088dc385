"""Gymnasium environments of a stack, single and vectorised: actions set the valves, and the tip
must reach a target.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.utils.seeding import np_random
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from sbafab.errors import DesignError
from sbafab.models.film_elements import Array
from sbafab.models.pneumatics import Line
from sbafab.models.stack import Stack, StackBatch

Stepped = tuple[Array, Array, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]
"""Observations, rewards, which arrived, which have no time left, and the times in s."""


class ReachEnvironment(gymnasium.Env[Any, Any]):
    """Task of moving the tip of a stack to a reachable point.

    An action has one number per chamber, from -1 (vented) to 1 (``most_pressure`` kPa at its
    valve). Observations: positions of tip and target and the vector between them in mm, pressures
    in the chambers in kPa. The reward is the negative distance in mm. An episode terminates within
    ``near`` mm, and is truncated after ``steps`` of ``dt`` s. ``load`` holds keyword arguments of
    ``Stack.pose`` other than pressures.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 (as in Gymnasium)

    def __init__(self, stack: Stack, line: Line | None = None, **options: Any) -> None:
        """Make the task; ``options`` are those of ``ReachVectorEnvironment``."""
        self._one = ReachVectorEnvironment(stack, 1, line, **options)
        self.action_space = self._one.single_action_space
        self.observation_space = self._one.single_observation_space

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Vent all chambers; the target is ``options["target"]`` (mm) or a random pose's tip."""
        super().reset(seed=seed)
        self._one.random[0] = self.np_random
        (observation,), _ = self._one.reset(options=options)
        return observation, {}

    def step(self, action: Any) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """The observation ``dt`` s later, the reward, and the terminated and truncated flags."""
        observations, rewards, is_there, is_late, info = self._one.moved(np.asarray(action)[None])
        is_over = bool(is_there[0]), bool(is_late[0])
        return observations[0], float(rewards[0]), *is_over, {"time": float(info["time"][0])}


class ReachVectorEnvironment(gymnasium.vector.VectorEnv[Any, Any, Any]):
    """``num_envs`` tasks of ``ReachEnvironment`` in one: its arguments, observations and rewards.

    Seeds and restarts as in ``gymnasium.vector.SyncVectorEnv``: the step after an episode's end
    starts the next one. Slow with an outer plate.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 (as in Gymnasium)
        "render_modes": [],
        "autoreset_mode": gymnasium.vector.AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        stack: Stack,
        num_envs: int,
        line: Line | None = None,
        most_pressure: float = 10.0,
        dt: float = 0.02,
        steps: int = 200,
        near: float = 0.2,
        **load: Any,
    ) -> None:
        if num_envs < 1:
            raise DesignError(f"num_envs = {num_envs} must be at least 1")
        if not 0 < most_pressure <= stack.most_pressure:
            raise DesignError(
                f"most_pressure = {most_pressure:g} kPa must be above 0 and at most "
                f"{stack.most_pressure:g} kPa, the range of the stack"
            )
        # Films may stretch: no tip is farther than this.
        far = 2 * sum(stack.maps[kind].most_height + stack.pitch for kind in stack.levels)
        most = np.array([far] * 9 + [stack.most_pressure] * stack.chambers)
        least = np.array([-far] * 9 + [0.0] * stack.chambers)
        box = gymnasium.spaces.Box
        self.single_action_space = box(-1.0, 1.0, (stack.chambers,), np.float64)
        self.single_observation_space = box(least, most, dtype=np.float64)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.num_envs, self.batch, self.load = num_envs, StackBatch(stack), load
        self.most_pressure, self.dt, self.steps, self.near = most_pressure, dt, steps, near
        self._motion = self.batch.motion(num_envs, line, **load)
        self.random = [np_random()[0] for _ in range(num_envs)]
        self._targets, self._left = np.zeros((num_envs, 3)), np.zeros(num_envs, dtype=int)
        self._is_over, self._has_begun = np.ones(num_envs, dtype=bool), False

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Array, dict[str, Any]]:
        """Vent all chambers. Targets are ``options["target"]`` in mm, (3,) or (num_envs, 3), or the
        tips of random poses; one ``seed`` is incremented for each environment.
        """
        if seed is not None:
            seeds = range(seed, seed + self.num_envs) if isinstance(seed, int) else seed
            if len(seeds) != self.num_envs:
                raise DesignError(f"give one seed, or {self.num_envs} seeds")
            for number, one in enumerate(seeds):
                if one is not None:
                    self.random[number] = np_random(one)[0]
        self._begin(np.ones(self.num_envs, dtype=bool), (options or {}).get("target"))
        self._has_begun = True
        return self._observations(), {}

    def step(self, actions: Any) -> Stepped:
        """Return observations ``dt`` s later, rewards, and which tasks terminated or were
        truncated.

        Environments whose episode was over start the next one instead, with the reward 0.
        """
        anew = self._is_over & self._has_begun
        if anew.any():
            self._begin(anew)
            actions = np.where(anew[:, None], -1.0, np.asarray(actions, dtype=float))
        seen, rewards, is_there, is_late, info = self.moved(actions)
        if anew.any():
            self._motion.restart(anew)
            self._left[anew] = self.steps
            is_there, is_late = is_there & ~anew, is_late & ~anew
            seen, rewards = self._observations(), np.where(anew, 0.0, rewards)
            self._is_over, info = is_there | is_late, {"time": self._motion.times.copy()}
        return seen, rewards, is_there, is_late, info

    def moved(self, actions: Any) -> Stepped:
        """Return the result of ``step``, without restarts."""
        if not self._has_begun:
            raise DesignError("the environment has no state yet; call reset first")
        shares = (np.clip(np.asarray(actions, dtype=float), -1.0, 1.0) + 1) / 2
        self._motion.step(self.dt, shares * self.most_pressure)
        self._left -= 1
        observations = self._observations()
        away = np.linalg.norm(observations[:, 6:9], axis=1)
        is_there, is_late = away <= self.near, self._left <= 0
        self._is_over = is_there | is_late
        return observations, -away, is_there, is_late, {"time": self._motion.times.copy()}

    def _begin(self, which: NDArray[np.bool_], target: Any = None) -> None:
        """Begin an episode in some of the environments."""
        if target is None:
            size = (self.batch.stack.chambers,)
            numbers = [self.random[number] for number in np.flatnonzero(which)]
            drawn = [one.uniform(0.0, self.most_pressure, size) for one in numbers]
            target = self.batch.poses(np.stack(drawn), **self.load).tips
        self._targets[which] = target
        self._motion.restart(which)
        self._left[which] = self.steps
        self._is_over = self._is_over & ~which

    def _observations(self) -> Array:
        tips = self._motion.tips
        parts = [tips, self._targets, self._targets - tips, self._motion.pressures]
        return np.concatenate(parts, axis=1)
