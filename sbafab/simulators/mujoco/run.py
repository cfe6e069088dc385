"""MuJoCo: the inflation of a model, the motion of its tip, and the interface of a simulator."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sbafab.errors import OutputError, VoidError
from sbafab.laminate.laminate import Laminate
from sbafab.process import Progress
from sbafab.simulators.coarse.shell import PRESSURE
from sbafab.simulators.mujoco.model import DATA, MODEL, SECTORS, why_no_model, write_model
from sbafab.simulators.simulator import (
    Result,
    SimulationRequest,
    State,
    chamber_pressures,
    drift,
    impossible,
    limits,
    overlap,
    refuse_time,
    tilt_of,
)

SECONDS = 5.0
RAMP = 1.0
"""Duration of the pressure ramp from 0, s."""
LEAST_TIME = 2 * RAMP
TIP_PERIOD = 0.1
"""Recording interval of the tip, s."""
OLDEST = 4
"""Oldest major version: up to 3.17 a flex of dimension 2 stretches at a quarter of its modulus."""
INSTALL = 'install it with: pip install "sbafab[mujoco]"'


@dataclass(frozen=True)
class MujocoRun:
    """A run: its states, and how it ended.

    The tip of a state is taken from the films' centres, relative to the centres at the base.
    ``overlap`` is the volume in ul in which films have passed through each other at the end;
    ``rate`` in steps per s of real time; ``stopped`` is one sentence if it was stopped early.
    """

    model: Path
    states: tuple[State, ...]
    overlap: float
    steps: int
    rate: float
    stopped: str | None = None

    @property
    def last(self) -> State:
        return self.states[-1]


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

    ``pressures`` in kPa by chamber, 0 for omitted ones, or 5 kPa everywhere; ``sectors`` is the
    number of nodes per ring; ``limit`` the maximum real time in s. Raises DesignError if the
    laminate cannot be modelled, OutputError if mujoco is missing, VoidError if the result is
    impossible.
    """
    refuse_time(seconds, LEAST_TIME)
    write_model(laminate, folder, pressures, sectors)
    done = run_model(folder, seconds, progress, limit)
    can_be = limits(laminate, done.last.pressures.values())
    wrong = impossible(done.last, can_be, done.overlap)
    if wrong is not None:
        raise VoidError(f"{MODEL} ran to {done.last.time:g} s, but its result cannot be: {wrong}")
    return done


def find_mujoco() -> Any:
    """The package mujoco. Raises OutputError with a remedy if it is missing or too old."""
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

    Raises OutputError if the model does not load, VoidError if a step is unstable or not solved;
    the message says how far the tip was known.
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
        states = [inflation.state()]
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
                reached_so_far = f"the tip is known to {states[-1].time:g} s"
                raise VoidError(f"{MODEL} did not run to its end: {why}; {reached_so_far}")
            if limit is not None and time.monotonic() - started > limit and step < steps:
                stopped = f"it was stopped after {limit / 60:g} minutes"
            if step % every == 0 or step == steps or stopped is not None:
                states.append(inflation.state())
                if progress is not None:
                    progress("mujoco", step, steps)
    rate = step / max(time.monotonic() - started, 1e-9)
    note = None
    if stopped is not None:
        reached = states[-1].time
        note = f"{MODEL} ran to {reached:g} of {seconds:g} s: {stopped}; what it reached is kept"
    return MujocoRun(path, tuple(states), inflation.overlap(), step, rate, note)


class _Inflation:
    """The model's state, and the cavities that the pressures act on."""

    def __init__(self, mujoco: Any, model: Any, told: Mapping[str, Any]) -> None:
        self.mujoco, self.model, self.told = mujoco, model, told
        self.data = mujoco.MjData(model)
        key = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_KEY, told["start"])
        mujoco.mj_resetDataKeyframe(model, self.data, key)
        self.cavities = {name: np.array(t) for name, t in told["cavities"].items()}
        # The world, body 0, comes before the nodes.
        self.free = model.body_dofnum[1:] > 0
        self.start = self.nodes = self._placed()

    def _placed(self) -> Any:
        self.mujoco.mj_kinematics(self.model, self.data)
        return self.data.xpos[1:] * self.told["length"]

    def step(self) -> None:
        """Take one time step under the current pressures, which follow the films."""
        share = self._share(self.data.time + self.model.opt.timestep)
        forces = np.zeros_like(self.nodes)
        for name, triangles in self.cavities.items():
            a, b, c = self.nodes[triangles].transpose(1, 0, 2)
            push = np.cross(b - a, c - a) * (share * self.told["pressures"][name] / 6)
            for corner in triangles.T:
                np.add.at(forces, corner, push)
        self.data.qfrc_applied[:] = forces[self.free].ravel() / self.told["length"]
        self.mujoco.mj_step(self.model, self.data)
        self.nodes = self._placed()

    def trouble(self, warnings: list[str]) -> str | None:
        """The reason why the state is invalid, if any."""
        if warnings:
            return f'MuJoCo says "{" ".join(warnings[0].split())[:200]}"'
        if any(warning.number for warning in self.data.warning):
            return "MuJoCo warns of an unstable step"
        # MuJoCo silently treats a NaN force as zero.
        if not np.isfinite(self.data.qfrc_smooth).all() or not np.isfinite(self.nodes).all():
            return "a force or a place is no finite number"
        return None

    def _share(self, time: float) -> float:
        """The fraction of the pressures applied at a time in s."""
        return min(1.0, time / RAMP)

    def state(self) -> State:
        """The state in the form shared by all simulators."""
        time = round(float(self.data.time), 9)
        poles, roots = (self.nodes[self.told[end]].mean(axis=0) for end in ("poles", "roots"))
        x, y, z = (float(p - r) for p, r in zip(poles, roots, strict=True))
        rim = [(float(a), float(b), float(c)) for a, b, c in self.nodes[self.told["tip"]]]
        pressures = {n: self._share(time) * p for n, p in self.told["pressures"].items()}
        height = self.told["films"] + z
        return State(time, pressures, height, (x, y, z), tilt_of(rim), self._volumes())

    def _volumes(self) -> dict[str, float]:
        volumes = {}
        for name, triangles in self.cavities.items():
            a, b, c = self.nodes[triangles].transpose(1, 0, 2)
            volumes[name] = float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6
        return volumes

    def overlap(self) -> float:
        """The volume in ul in which films have passed through each other."""
        model, films = self.model, []
        for flex in range(model.nflex):
            nodes = model.flex_vertbodyid[model.flex_vertadr[flex] :] - 1
            first = model.flex_elemdataadr[flex]
            corners = model.flex_elem[first : first + 3 * model.flex_elemnum[flex]]
            films.append(nodes[corners.reshape(-1, 3)])
        flat = model.body_pos[1:] * self.told["length"]
        return overlap(self.nodes, flat, self.start, np.concatenate(films))


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
    """Return why a coarse mesh is impossible: it consists of rings, so pockets must be round."""
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
    figures = {"drift": drift(result.states), "overlap": result.overlap, "rate": result.rate}
    return Result("mujoco", result.states, figures, result.stopped)


def _pressures(laminate: Laminate, request: SimulationRequest) -> dict[str, float]:
    return chamber_pressures([chamber.name for chamber in laminate.chambers], request, PRESSURE)
