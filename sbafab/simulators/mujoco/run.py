"""MuJoCo: the inflation of a model, the motion of its tip, and the interface of a simulator."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sbafab.errors import OutputError
from sbafab.laminate.laminate import Laminate
from sbafab.process import Progress
from sbafab.simulators.coarse.shell import PRESSURE
from sbafab.simulators.mujoco.model import DATA, MODEL, SECTORS, why_no_model, write_model
from sbafab.simulators.simulator import (
    Result,
    SimulationRequest,
    Tip,
    chamber_pressures,
    refuse_time,
    tip_at,
)

SECONDS = 5.0
RAMP = 1.0
"""s in which a pressure rises from 0."""
LEAST_TIME = 2 * RAMP
TIP_PERIOD = 0.1
"""s between two records of the tip."""
OLDEST = 4
"""Up to version 3.17 a flex of dimension 2 stretches with a quarter of its modulus."""
INSTALL = 'install it with: pip install "sbafab[mujoco]"'


@dataclass(frozen=True)
class MujocoRun:
    """A valid run: the motion of the tip, and how it ended.

    ``stroke`` in mm is by how much the films' centres at both ends have parted upward since flat;
    ``volumes`` in ul by chamber; ``rate`` in steps per s of real time; ``stopped`` is one sentence
    if it was stopped early.
    """

    model: Path
    tips: tuple[Tip, ...]
    stroke: float
    volumes: tuple[tuple[str, float], ...]
    steps: int
    rate: float
    stopped: str | None = None

    @property
    def last(self) -> Tip:
        return self.tips[-1]

    @property
    def drift(self) -> float:
        """Distance in mm that the tip moved in the last half second; small if it is at rest."""
        since = [tip for tip in self.tips if tip.time >= self.last.time - 0.5 - TIP_PERIOD / 2]
        return math.dist(since[0].place, self.last.place)


def simulate(
    laminate: Laminate,
    folder: Path,
    pressures: Mapping[str, float] | None = None,
    seconds: float = SECONDS,
    progress: Progress | None = None,
    sectors: int = SECTORS,
    limit: float | None = None,
) -> MujocoRun:
    """Writes the model of a laminate into a folder and inflates it.

    ``pressures`` in kPa by chamber, 0 for those left out, or 5 kPa everywhere; ``sectors`` nodes
    make a ring; ``limit`` is the most real time in s. Raises DesignError where no such model can
    be made of the laminate, OutputError where mujoco is missing or its run cannot be believed.
    """
    refuse_time(seconds, LEAST_TIME)
    write_model(laminate, folder, pressures, sectors)
    return run_model(folder, seconds, progress, limit)


def find_mujoco() -> Any:
    """The package mujoco. Raises OutputError with what to do where it is missing or too old."""
    try:
        import mujoco
    except ImportError as reason:
        raise OutputError(f"mujoco is not installed; {INSTALL}") from reason
    version = str(mujoco.__version__)
    if int(version.split(".", maxsplit=1)[0]) < OLDEST:
        raise OutputError(
            f"mujoco {version} stretches films with a quarter of their modulus, {OLDEST}.0 does "
            f"not; {INSTALL}"
        )
    return mujoco


def run_model(
    folder: Path, seconds: float, progress: Progress | None = None, limit: float | None = None
) -> MujocoRun:
    """Inflates the model in a folder, for at most ``limit`` s of real time or until Ctrl-C.

    Raises OutputError if the model does not load, or a step is unstable or not solved; the
    sentence says how far the tip was known.
    """
    mujoco = find_mujoco()
    path = folder / MODEL
    with _warnings(mujoco) as warnings:
        try:
            model = mujoco.MjModel.from_xml_path(str(path))
        except ValueError as reason:
            text = " ".join(str(reason).split())
            raise OutputError(f"{path} does not load in MuJoCo: {text}") from reason
        inflation = _Inflation(mujoco, model, json.loads((folder / DATA).read_text("utf-8")))
        steps = round(seconds / model.opt.timestep)
        every = max(1, round(TIP_PERIOD / model.opt.timestep))
        tips = [inflation.tip()]
        stopped: str | None = None
        step = 0
        started = time.monotonic()
        while step < steps and stopped is None:
            try:
                inflation.step()
            except KeyboardInterrupt:
                stopped = "it was interrupted"
                break
            step += 1
            why = inflation.trouble(warnings)
            if why is not None:
                reached_so_far = f"the tip is known to {tips[-1].time:g} s"
                raise OutputError(f"{MODEL} did not run to its end: {why}; {reached_so_far}")
            if limit is not None and time.monotonic() - started > limit and step < steps:
                stopped = f"it was stopped after {limit / 60:g} minutes"
            if step % every == 0 or step == steps or stopped is not None:
                tips.append(inflation.tip())
                if progress is not None:
                    progress("mujoco", step, steps)
    rate = step / max(time.monotonic() - started, 1e-9)
    note = None
    if stopped is not None:
        reached = tips[-1].time
        note = f"{MODEL} ran to {reached:g} of {seconds:g} s: {stopped}; what it reached is kept"
    shape = inflation.stroke(), inflation.volumes()
    return MujocoRun(path, tuple(tips), *shape, step, rate, note)


class _Inflation:
    """The model's state, and the cavities that the pressures act on."""

    def __init__(self, mujoco: Any, model: Any, data: Mapping[str, Any]) -> None:
        import numpy as np

        self.mujoco, self.model, self.told = mujoco, model, data
        self.state = mujoco.MjData(model)
        key = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_KEY, data["start"])
        mujoco.mj_resetDataKeyframe(model, self.state, key)
        self.cavities = {name: np.array(t) for name, t in data["cavities"].items()}
        # The world, body 0, comes before the nodes.
        self.free = model.body_dofnum[1:] > 0
        self.nodes = self._placed()

    def _placed(self) -> Any:
        self.mujoco.mj_kinematics(self.model, self.state)
        return self.state.xpos[1:].copy()

    def step(self) -> None:
        """One time step under the pressures of this time, which follow the films."""
        import numpy as np

        share = min(1.0, (self.state.time + self.model.opt.timestep) / RAMP)
        forces = np.zeros_like(self.nodes)
        for name, triangles in self.cavities.items():
            a, b, c = self.nodes[triangles].transpose(1, 0, 2)
            push = np.cross(b - a, c - a) * (share * self.told["pressures"][name] / 6)
            for corner in triangles.T:
                np.add.at(forces, corner, push)
        self.state.qfrc_applied[:] = forces[self.free].ravel()
        self.mujoco.mj_step(self.model, self.state)
        self.nodes = self._placed()

    def trouble(self, warnings: list[str]) -> str | None:
        """Why the state cannot be believed."""
        import numpy as np

        if warnings:
            return f'MuJoCo says "{" ".join(warnings[0].split())[:200]}"'
        if any(warning.number for warning in self.state.warning):
            return "MuJoCo warns of an unstable step"
        # MuJoCo takes a force that is no number for none, and says nothing.
        if not np.isfinite(self.state.qfrc_smooth).all() or not np.isfinite(self.nodes).all():
            return "a force or a place is no finite number"
        return None

    def tip(self) -> Tip:
        points = [(float(x), float(y), float(z)) for x, y, z in self.nodes[self.told["tip"]]]
        return tip_at(round(float(self.state.time), 9), points)

    def stroke(self) -> float:
        poles, roots = (self.nodes[self.told[end]].mean(axis=0) for end in ("poles", "roots"))
        return float(poles[2] - roots[2])

    def volumes(self) -> tuple[tuple[str, float], ...]:
        import numpy as np

        volumes = []
        for name, triangles in self.cavities.items():
            a, b, c = self.nodes[triangles].transpose(1, 0, 2)
            volumes.append((name, float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6))
        return tuple(volumes)


@contextmanager
def _warnings(mujoco: Any) -> Iterator[list[str]]:
    """Collect MuJoCo's warnings, which it would otherwise write into the current folder."""
    messages: list[str] = []
    mujoco.set_mju_user_warning(messages.append)
    try:
        yield messages
    finally:
        mujoco.set_mju_user_warning(None)


# The interface of a simulator.


USES = ("seconds",)


def why_not(laminate: Laminate) -> str | None:
    """Return why there is no coarse mesh: it is made of rings, so pockets must be round."""
    return why_no_model(laminate)


def export(laminate: Laminate, request: SimulationRequest, folder: Path) -> None:
    """The model and a script that inflates it."""
    refuse_time(SECONDS if request.seconds is None else request.seconds, LEAST_TIME)
    write_model(laminate, folder, _pressures(laminate, request))


def run(laminate: Laminate, request: SimulationRequest, folder: Path, progress: Progress) -> Result:
    """Write the model and inflate it to the end."""
    pressures = _pressures(laminate, request)
    seconds = SECONDS if request.seconds is None else request.seconds
    result = simulate(laminate, folder, pressures, seconds, progress, limit=60 * request.minutes)
    x, y, z = result.last.place
    share = min(1.0, result.last.time / RAMP)
    rows = [(name, share * value, "kPa") for name, value in pressures.items()]
    rows += [("tip x", x, "mm"), ("tip y", y, "mm"), ("tip z", z, "mm")]
    rows += [("tilt", result.last.tilt, "degrees"), ("stroke", result.stroke, "mm")]
    rows += [(f"air {name}", value, "ul") for name, value in result.volumes]
    rows += [("drift in 0.5 s", result.drift, "mm"), ("rate", result.rate, "steps/s")]
    tips = [{"time": tip.time, "place": tip.place, "tilt": tip.tilt} for tip in result.tips]
    figures = {"stroke": result.stroke, "volumes": dict(result.volumes), "tips": tips}
    figures |= {"drift": result.drift, "rate": result.rate}
    return Result(tuple(rows), figures, result.stopped)


def _pressures(laminate: Laminate, request: SimulationRequest) -> dict[str, float]:
    return chamber_pressures([chamber.name for chamber in laminate.chambers], request, PRESSURE)
