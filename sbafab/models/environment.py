"""A Gymnasium environment of a stack: actions set the valves, the tip is to reach a target."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np

from sbafab.errors import DesignError

if TYPE_CHECKING:
    from sbafab.models.film_elements import Array
    from sbafab.models.pneumatics import Line
    from sbafab.models.stack import Motion, Stack


class ReachEnvironment(gymnasium.Env[Any, Any]):
    """Task of moving the tip of a stack to a point that it can reach.

    An action has a number a chamber from -1 (vented) to 1 (``most_pressure`` kPa at its valve).
    Observations: positions of tip and target and the vector between them in mm, pressures in the
    chambers in kPa. The reward is the negative distance in mm. An episode ends within ``near`` mm,
    and is cut off after ``steps`` of ``dt`` s. ``load`` are keyword arguments of ``Stack.pose``
    beside pressures.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 (as Gymnasium has it)

    def __init__(
        self,
        stack: Stack,
        line: Line | None = None,
        most_pressure: float = 10.0,
        dt: float = 0.02,
        steps: int = 200,
        near: float = 0.2,
        **load: Any,
    ) -> None:
        if not 0 < most_pressure <= stack.most_pressure:
            raise DesignError(
                f"most_pressure = {most_pressure:g} kPa must be above 0 and at most "
                f"{stack.most_pressure:g} kPa, to which the stack was made"
            )
        self.stack, self.line, self.load = stack, line, load
        self.most_pressure, self.dt, self.steps, self.near = most_pressure, dt, steps, near
        count = stack.chambers
        # Films may stretch: no tip is farther than this.
        far = 2 * sum(stack.maps[kind].most_height + stack.pitch for kind in stack.levels)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (count,), np.float64)
        most = np.array([far] * 9 + [stack.most_pressure] * count)
        least = np.array([-far] * 9 + [0.0] * count)
        self.observation_space = gymnasium.spaces.Box(least, most, dtype=np.float64)
        self._motion: Motion | None = None
        self._target = np.zeros(3)
        self._left = 0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Vent all chambers; the target is ``options["target"]`` (mm) or a random pose's tip."""
        super().reset(seed=seed)
        target = (options or {}).get("target")
        if target is None:
            pressures = self.np_random.uniform(0.0, self.most_pressure, self.stack.chambers)
            target = self.stack.pose(pressures.tolist(), **self.load).tip
        self._target = np.asarray(target, dtype=float)
        self._motion = self.stack.motion(line=self.line, **self.load)
        self._left = self.steps
        return self._observation(self._motion), {}

    def step(self, action: Any) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Return the observation ``dt`` s later, the reward, if it arrived, and if time is up."""
        if self._motion is None:
            raise DesignError("the environment is at no place yet; call reset first")
        valves = (np.clip(np.asarray(action, dtype=float), -1.0, 1.0) + 1) / 2 * self.most_pressure
        self._motion.step(self.dt, pressures=valves.tolist())
        self._left -= 1
        observation = self._observation(self._motion)
        away = float(np.linalg.norm(observation[6:9]))
        return observation, -away, away <= self.near, self._left <= 0, {"time": self._motion.time}

    def _observation(self, motion: Motion) -> Array:
        tip = motion.pose.tip
        return np.concatenate([tip, self._target, self._target - tip, motion.pressures])
