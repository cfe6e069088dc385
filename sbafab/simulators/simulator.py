"""The interface of a simulator, its requests and results, the files of its models, and the
processes that run it.
"""

from __future__ import annotations

import math
import os
import shutil
import signal
import subprocess
import time
import xml.etree.ElementTree as ET
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from numbers import Real
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple, Protocol, cast

import numpy as np
from numpy.typing import ArrayLike
from pydantic import ConfigDict, Field

from sbafab import plugins
from sbafab.documents import Document, PlainNumber
from sbafab.errors import DesignError, OutputError, VoidError
from sbafab.laminate.laminate import Laminate
from sbafab.markup import environment
from sbafab.meshing.surface import Floats, Ints
from sbafab.plugins import Plugins
from sbafab.runtime import Progress
from sbafab.simulators.shell_model import Shell, pocket_radii, why_not_round

if TYPE_CHECKING:
    from jinja2 import Environment

SIMULATORS = Plugins(
    plugins.SIMULATORS,
    "simulator",
    ModuleType,
    {name: f"sbafab.simulators.{name}" for name in ("calculix", "sofa", "mujoco")},
)
"""The modules of all simulators by name, each a ``Simulator``."""
NAMES = tuple(SIMULATORS)
LONGEST = 1e5
"""Longest simulated time, s."""
DEFAULT_PRESSURE = 5.0
"""kPa in a chamber, in SOFA and MuJoCo."""
MOST_PRESSURE = 1000.0
"""kPa: nearly three times the burst pressure of the paper's actuators."""
LARGEST_VACUUM = 101.325
"""kPa below the outside air: the limit of any vacuum."""
VACUUM = -6.0
"""Default kPa of a design that works under a vacuum: the size of CalculiX's default pressure."""


CHOICES = {
    "symmetry": ("full", "half", "quarter", "sector"),
    "procedure": ("dynamic", "static"),
    "scene": ("shell", "frames", "volume"),
}
"""Allowed values of a request's settings, by name."""


@dataclass(frozen=True)
class SimulationRequest:
    """Settings of a simulation; None for the simulator's default.

    ``pressure`` in kPa is a gauge pressure (a vacuum is negative) for every chamber that
    ``chambers`` does not name; ``minutes`` is the maximum real time of a run. Each simulator's
    ``USES`` names the other settings that it reads: ``h`` in mm, ``seconds`` of simulated time,
    ``volumes`` in ul above the start by chamber; ``CHOICES`` lists the values of the rest. Raises
    DesignError for any other value, and if a number is not finite.
    """

    pressure: float | None = None
    chambers: Mapping[str, float] = field(default_factory=dict)
    minutes: float = 120.0
    h: float | None = None
    symmetry: str | None = None
    procedure: str | None = None
    scene: str | None = None
    seconds: float | None = None
    volumes: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, words in CHOICES.items():
            word = getattr(self, name)
            if word not in (None, *words):
                raise DesignError(f'{name} = "{word}" must be one of {", ".join(words)}')
        numbers = {name: getattr(self, name) for name in ("pressure", "h", "seconds", "minutes")}
        numbers |= {f"pressure of {name}": value for name, value in self.chambers.items()}
        numbers |= {f"volume in {name}": value for name, value in self.volumes.items()}
        for name, number in numbers.items():
            if number is not None and not isinstance(number, Real):
                raise DesignError(f"{name} = {number!r} must be a number")
        if not 0 < self.minutes < math.inf:
            raise DesignError(f"minutes = {self.minutes:g} must be a finite number above 0")


UNITS = {
    "length": "mm",
    "pressure": "kPa",
    "volume": "ul",
    "stress": "MPa",
    "work": "uJ",
    "angle": "degrees",
    "time": "s",
    "rate": "steps/s",
}
"""Units of the values in ``result.json``."""
FIGURES = {
    "drift": ("drift in the last 0.5 s", "mm"),
    "overlap": ("films through each other", "ul"),
    "diameter": ("diameter over the crowns", "mm"),
    "stress": ("von Mises stress, at most", "MPa"),
    "work": ("work of the air", "uJ"),
    "rate": ("rate", "steps/s"),
}
"""Label and unit of results that only some simulators give."""
DRIFT_SECONDS = 0.5
SAME_TIME = 1e-6
"""s"""


class State(Document):
    """The actuator at one time in s of a run, in the form shared by all simulators.

    Pressures are kPa (a vacuum is negative), empty if volumes are imposed; volumes are ul, empty if
    they were not recorded. Lengths are mm, with films as thick as bought; the tilt is in degrees.
    Height, tip and tilt are None around a tube, and the tilt is also None if the tip has only one
    axis.
    """

    model_config = ConfigDict(frozen=True)

    time: PlainNumber = 0.0
    pressures: Mapping[str, PlainNumber] = {}
    """over the air outside, by chamber"""
    height: PlainNumber | None = None
    """of the tip over the underside of the base"""
    tip: tuple[PlainNumber, PlainNumber, PlainNumber] | None = None
    """displacement of its middle since flat: x, y, z"""
    tilt: PlainNumber | None = None
    volumes: Mapping[str, PlainNumber] = {}
    """of air, by chamber"""
    stress: PlainNumber = 0.0
    """calculix: von Mises, the largest"""
    work: PlainNumber = 0.0
    """calculix: of the air"""

    @property
    def stroke(self) -> float:
        """The increase in height in mm."""
        return 0.0 if self.tip is None else self.tip[2]


class Result(State, schema="sbafab/simulate@2"):
    """The result of a run, and the contents of ``result.json``: the last state, then all
    ``states``.

    ``figures`` are results of only some simulators (mm, ul, MPa, uJ or steps/s). If a run ended
    early, the results up to then are valid, and ``stopped`` is one sentence. Only the units are
    given if nothing has run.
    """

    units: Mapping[str, str]
    folder: str = ""
    simulator: Annotated[str, Field(json_schema_extra={"enum": [*NAMES]})] = "calculix"
    drift: PlainNumber = 0.0
    """sofa, mujoco: mm of the tip in the last 0.5 s"""
    overlap: PlainNumber = 0.0
    """sofa, mujoco: where films passed through each other"""
    diameter: PlainNumber = 0.0
    """sofa, round a tube: mm over the crowns"""
    rate: PlainNumber = 0.0
    """sofa, mujoco"""
    states: Sequence[State] = ()
    """in order of time"""
    stopped: str | None = None
    """why it ended early, if it did"""

    @classmethod
    def of_run(
        cls,
        simulator: str,
        states: Sequence[State],
        figures: Mapping[str, float],
        stopped: str | None = None,
    ) -> Result:
        """Return the result of a run, with ``figures`` by name of ``FIGURES``."""
        last = {name: getattr(states[-1], name) for name in states[-1].model_fields_set}
        run = {"units": UNITS, "simulator": simulator, "states": tuple(states), "stopped": stopped}
        return cls.model_validate({**last, **figures, **run})

    @property
    def last(self) -> State:
        """The final state."""
        return self.states[-1]

    @property
    def figures(self) -> dict[str, float]:
        """The results of this simulator, by name of ``FIGURES``."""
        return {name: getattr(self, name) for name in FIGURES if name in self.model_fields_set}

    @property
    def rows(self) -> list[tuple[str, float, str]]:
        """Label, value and unit of each printed line."""
        rows = [(name, value, "kPa") for name, value in self.pressures.items()]
        rows += [(f"tip {axis}", at, "mm") for axis, at in zip("xyz", self.tip or (), strict=False)]
        rows += [] if self.height is None else [("height", self.height, "mm")]
        rows += [] if self.tilt is None else [("tilt", self.tilt, "degrees")]
        rows += [(f"air {name}", value, "ul") for name, value in self.volumes.items()]
        labels = ((FIGURES[name], value) for name, value in self.figures.items())
        return rows + [(label, value, unit) for (label, unit), value in labels]


class Simulator(Protocol):
    """Interface of a simulator's module."""

    USES: tuple[str, ...]

    def why_not(self, laminate: Laminate) -> str | None:
        """Return the reason why a laminate has no input for it, or None."""

    def export(self, laminate: Laminate, request: SimulationRequest, folder: Path) -> None:
        """Write the simulator's input, and every file that it loads, into a folder that exists."""

    def run(
        self, laminate: Laminate, request: SimulationRequest, folder: Path, progress: Progress
    ) -> Result:
        """Write the input, run it, and read the results back."""


def simulator(name: str) -> Simulator:
    """Return the simulator of that name, with its imports loaded only now. Raises DesignError."""
    if name not in NAMES:
        raise DesignError(f'simulator = "{name}" must be one of {", ".join(NAMES)}')
    return cast(Simulator, SIMULATORS[name])


def refuse_unused(name: str, request: SimulationRequest) -> None:
    """Raise DesignError for an unknown simulator, and for a setting that it does not use."""
    uses = {each_name: simulator(each_name).USES for each_name in dict.fromkeys((name, *NAMES))}
    for setting in sorted({each for used in uses.values() for each in used}):
        if getattr(request, setting) not in (None, {}) and setting not in uses[name]:
            users = [each_name for each_name in NAMES if setting in uses[each_name]]
            raise DesignError(f"{setting} is for {' and '.join(users)}; omit it with {name}")


def under_vacuum(name: str, request: SimulationRequest) -> SimulationRequest:
    """Return the request for a design that works under vacuum, by default one of ``VACUUM``.

    Raises DesignError for a positive pressure, and for a simulator without vacuum.
    """
    if name != "calculix":
        raise DesignError(
            f"the design works under vacuum, which {name} does not support; use calculix"
        )
    pressures = {"pressure": request.pressure or 0.0}
    pressures |= {f"pressure of {chamber}": kpa for chamber, kpa in request.chambers.items()}
    for label, kpa in pressures.items():
        if kpa > 0:
            raise DesignError(
                f"{label} = {kpa:g} kPa is out of range; give {-LARGEST_VACUUM:g} to 0 kPa "
                f"gauge; a vacuum is negative: write {-kpa:g}"
            )
    if request.pressure is None and not request.chambers:
        return replace(request, pressure=VACUUM)
    return request


def chamber_pressures(
    names: Sequence[str], request: SimulationRequest, default: float, least: float = 0.0
) -> dict[str, float]:
    """Return the pressure in kPa of every chamber: by name, otherwise ``request.pressure``.

    Without a request every chamber has the ``default``; if only single chambers are given, the
    others have 0. Raises DesignError for an unknown chamber and a pressure out of range.
    """
    if not names:
        raise DesignError("the design has no chamber to fill; add chambers to it")
    refuse_unknown(names, request.chambers, "pressure")
    in_all = (
        (0.0 if request.chambers else default) if request.pressure is None else request.pressure
    )
    pressures = {name: request.chambers.get(name, in_all) for name in names}
    for name, value in pressures.items():
        if not (math.isfinite(value) and least <= value <= MOST_PRESSURE):
            hint = "; a vacuum is for calculix" if least == 0 > value else ""
            raise DesignError(
                f"pressure of {name} = {value:g} kPa must be from {least:g} to {MOST_PRESSURE:g} "
                f"kPa{hint}"
            )
    if not any(pressures.values()):
        raise DesignError("pressure is 0 kPa in every chamber; increase at least one")
    return pressures


def refuse_time(seconds: float, least: float) -> None:
    """Raise DesignError for a simulated time out of range."""
    if not least <= seconds <= LONGEST:
        raise DesignError(
            f"simulated time = {seconds:g} s must lie between {least:g} and {LONGEST:g} s"
        )


def refuse_unknown(names: Sequence[str], requested: Mapping[str, float], quantity: str) -> None:
    """Raise DesignError for an unknown chamber."""
    unknown = next((name for name in requested if name not in names), None)
    if unknown is not None:
        raise DesignError(
            f"{quantity} names chamber {unknown}, which does not exist; the chambers are "
            f"{', '.join(names)}"
        )


# Physical limits: a result beyond them is void.


STRETCH = 1.3
"""Maximum stretch ratio of a film along its meridian; it would have burst long before."""
MOST_LEAN = 1.0
"""Maximum degrees of tilt with equal chambers; sound shells stay within 0.1."""
LEAST_RISE = 0.01
"""Least rise in mm of a tip with equal chambers: no sound start remains this low."""
NOWHERE = 1e-6
"""mm from 0 in x, y and z: tips never start there, but failing solvers put nodes there."""
NO_AIR = 0.01
"""Limit of a chamber's negative air, as a fraction of the films' volume over its pockets."""
MOST_OVERLAP = 0.2
"""Largest overlap of films without contact, as a fraction of all air. One chamber at 5 kPa in
SOFA's scenes reaches a tenth, and then bends some 10 degrees too far."""


def impossible(
    laminate: Laminate, state: State, requested: Collection[float] = (), passed: float = 0.0
) -> str | None:
    """Return why a state of a laminate is impossible, or None.

    A balloon's height cannot exceed the length of its two films, and a laminate on a tube has no
    common tip. Equal pressures or volumes, if ``requested`` for all chambers, lift a plate evenly
    if the mesh has no inlets. ``passed`` is the ``overlap`` in ul.
    """
    return next(_wrong(laminate, state, requested, passed), None)


def _wrong(
    laminate: Laminate, state: State, requested: Collection[float], passed: float
) -> Iterator[str]:
    tip, tilt, radii = state.tip, state.tilt, pocket_radii(laminate)
    chambers = max(len(laminate.chambers), 1)
    if not all(map(math.isfinite, (*state.volumes.values(), *(tip or ()), tilt or 0.0))):
        yield "a place or a volume is not finite"
    thick = min((layer.film.thickness for layer in laminate.tpe_layers), default=0.0)
    least_air = -NO_AIR * thick * math.pi * sum(radius**2 for radius in radii) / chambers
    for name, air in state.volumes.items():
        if air < least_air:
            yield (
                f"{name} holds {air:.3g} ul of air, less than none: its films have passed through "
                "each other"
            )
    air = sum(state.volumes.values())
    if passed > MOST_OVERLAP * max(air, 0.0):
        yield f"films have passed through each other in {passed:.3g} ul, with {air:.3g} ul of air"
    if tip is None or laminate.tube is not None:
        return
    if max(map(abs, tip)) < NOWHERE and any(state.pressures.values()):
        yield "the tip lies at 0, 0, 0"
    highest = 2 * STRETCH * sum(radii) / chambers
    if tip[2] > highest:
        yield f"the tip is {tip[2]:.3f} mm high, and the films reach {highest:.3g} mm at most"
    if len(set(requested)) == 1 and min(requested) >= 0 and why_not_round(laminate) is None:
        alike = "all chambers are told the same, and the tip"
        if tip[2] < LEAST_RISE:
            yield f"{alike} has not risen (z {tip[2]:.3f} mm)"
        if tilt is not None and tilt > MOST_LEAN:
            yield f"{alike} leans by {tilt:.1f} degrees (more than {MOST_LEAN:g})"


def overlap(points: Floats, flat: Floats, start: Floats, triangles: Ints) -> float:
    """Return the volume in ul in which films have passed through the films on which they lay.

    ``points``, ``flat`` and ``start`` are the positions (n, 3) of nodes at the end, when all films
    lie on each other, and in the order of the films; ``triangles`` (k, 3) are all films. Nodes that
    coincide when flat are compared in pairs along the normal of their films, each weighted by its
    share of the flat film.
    """
    a, b, c = flat[triangles].transpose(1, 0, 2)
    across = np.cross(b - a, c - a)[:, 2]
    turned = np.where((across < 0)[:, None], triangles[:, ::-1], triangles)
    flat_areas = np.abs(across) / 2
    a, b, c = points[turned].transpose(1, 0, 2)
    normals, areas = np.zeros_like(points), np.zeros(len(points))
    for corner in turned.T:
        np.add.at(normals, corner, np.cross(b - a, c - a))
        np.add.at(areas, corner, flat_areas / 3)
    x, y = np.round(flat[:, :2], 6).T
    order = np.lexsort((start[:, 2], y, x))
    lower, upper = order[:-1], order[1:]
    facing = (x[lower] == x[upper]) & (y[lower] == y[upper])
    lower, upper = lower[facing], upper[facing]
    up = normals[lower] + normals[upper]
    up /= np.maximum(np.linalg.norm(up, axis=1), np.finfo(float).tiny)[:, None]
    apart = np.einsum("ij,ij->i", points[upper] - points[lower], up)
    return float(np.maximum(-apart, 0.0) @ areas[upper])


def drift(states: Sequence[State]) -> float:
    """Return the distance in mm that the tip moved in the last half second; small at rest."""
    last = states[-1]
    since = last.time - DRIFT_SECONDS + SAME_TIME
    before = next((state for state in reversed(states) if state.time <= since), states[0])
    return math.dist(before.tip or (), last.tip or ())


# Starting a program, monitoring it, and stopping it on timeout or interrupt.


LOOK_EVERY = 0.1
"""Progress polling interval, s."""
STOP_WITHIN = 10.0
"""Grace period in s before a program is killed."""


class Stop(NamedTuple):
    """The reason why a program ended early: interrupted, timed out, diverged, or failed."""

    kind: Literal["interrupt", "time", "diverged", "failed"]
    words: str


def program_path(name: str, install: str) -> str:
    """The path of an installed program. Raises OutputError with instructions to ``install`` it."""
    path = shutil.which(name)
    if path is None:
        raise OutputError(f"{name} was not found; {install}")
    return path


def run_program(
    command: Sequence[str], log: Path, limit: float | None, look: Callable[[], None]
) -> tuple[int, Stop | None]:
    """Run a command in the folder of its ``log``, which receives its output.

    ``look`` is called while it runs; after ``limit`` seconds it is stopped. Ctrl-C and SIGTERM stop
    the run, not the program that started it, so that partial results can be kept. It uses one
    thread unless OMP_NUM_THREADS is set. Return its exit code, and the reason if it was stopped.
    Raises OutputError if it cannot be started.
    """
    began = time.monotonic()
    stopped: Stop | None = None
    with log.open("wb") as opened:
        try:
            # In a new session, since the command may be a script that starts the real program.
            process = subprocess.Popen(
                command,
                cwd=log.parent,
                stdin=subprocess.DEVNULL,
                stdout=opened,
                stderr=subprocess.STDOUT,
                env={"OMP_NUM_THREADS": "1", **os.environ},
                start_new_session=True,
            )
        except OSError as reason:
            raise OutputError(
                f"{command[0]} could not be started ({reason.strerror}); check that it is a "
                "program for this machine"
            ) from reason
        try:
            while stopped is None:
                try:
                    process.wait(LOOK_EVERY)
                    break
                except subprocess.TimeoutExpired:
                    look()
                if limit is not None and time.monotonic() - began >= limit:
                    stopped = Stop("time", f"it was stopped after {limit / 60:g} minutes")
        except KeyboardInterrupt:
            # Keep the results of hours of computing.
            stopped = Stop("interrupt", "it was interrupted")
        finally:
            _end(process)
    return process.returncode, stopped


def pass_on_interrupt(stopped: Stop | None) -> None:
    """Raise KeyboardInterrupt if a run without results was interrupted: nothing is to be kept."""
    if stopped is not None and stopped.kind == "interrupt":
        raise KeyboardInterrupt


def _end(process: subprocess.Popen[bytes]) -> None:
    """End the program and its child processes."""
    for number in (signal.SIGTERM, getattr(signal, "SIGKILL", signal.SIGTERM)):
        if process.poll() is not None:
            return
        if hasattr(os, "killpg"):
            os.killpg(process.pid, number)
        else:
            process.terminate()
        try:
            process.wait(STOP_WITHIN)
        except subprocess.TimeoutExpired:
            continue


# A model whose nodes are recorded while it runs, and what they say.


NODES_FILE = "nodes.state"
PERIOD = 0.1
"""Recording interval, s."""
RAMP = 1.0
"""Duration of the pressure ramp from 0, s."""


@dataclass(frozen=True, eq=False)
class RecordedFilms:
    """The shell of a laminate with recorded nodes, from which its motion is read."""

    laminate: Laminate
    shell: Shell
    middle: Ints
    pressures: Mapping[str, float]
    requested: Collection[float]

    def state(self, time: float, nodes: Floats) -> State:
        """Return the state at a time in s, with the nodes (n, 3) in mm."""
        on, shell = min(1.0, time / RAMP), self.shell
        pressures = {name: on * value for name, value in self.pressures.items()}
        volumes = {name: shell.volume(name, nodes) for name in shell.cavities}
        if self.laminate.tube is not None:
            return State(
                time=time, pressures=pressures, height=None, tip=None, tilt=None, volumes=volumes
            )
        moved = nodes[self.middle].mean(axis=0) - shell.rest[self.middle].mean(axis=0)
        x, y, z = moved.tolist()
        height = sum(layer.film.thickness for layer in self.laminate.tpe_layers) + z
        return State(
            time=time,
            pressures=pressures,
            height=height,
            tip=(x, y, z),
            tilt=tilt_of(shell.rest[shell.tip], nodes[shell.tip]),
            volumes=volumes,
        )

    def figures(self, states: Sequence[State], nodes: Floats) -> dict[str, float]:
        """Return figures of a run by name of ``FIGURES``, from its states and its last nodes."""
        shell = self.shell
        passed = {"overlap": overlap(nodes, shell.rest, shell.position, shell.triangles)}
        if self.laminate.tube is None:
            return {"drift": drift(states), **passed}
        # Distance of the balloons' crowns from their tube's axis.
        radii = np.linalg.norm(nodes[shell.tip, :2], axis=1)
        return {"diameter": float(2 * radii.mean()), **passed}


def read_nodes(path: Path) -> list[tuple[float, Floats]]:
    """Return times in s and positions (n, 3) in mm of recorded nodes, in the format of SOFA's
    WriteState.

    They end before the first record that is truncated or not finite.
    """
    records: list[tuple[float, Floats]] = []
    lines = path.read_text("utf-8", "replace").splitlines(keepends=True) if path.is_file() else []
    time = math.nan
    for line in lines:
        key, _, values = line.strip().partition("=")
        try:
            numbers = np.array(values.split(), dtype=float)
        except ValueError:
            break
        if not np.isfinite(numbers).all() or not line.endswith("\n"):
            break
        if key == "T" and len(numbers) == 1:
            time = float(numbers[0])
        elif key == "X" and math.isfinite(time):
            if len(numbers) < 9 or len(numbers) % 3:
                break
            records.append((time, numbers.reshape(-1, 3)))
    return records


ReadLog = Callable[[str], tuple[str | None, float | None]]
"""The first trouble in the text of a log, if any, and the steps per s."""


def run_model(
    simulator: str,
    model: Path,
    command: Sequence[str],
    films: RecordedFilms,
    read_log: ReadLog,
    times: tuple[float, float],
    progress: Progress,
) -> Result:
    """Run a model and judge its nodes; ``times`` are simulated seconds, and at most real minutes.

    ``command`` runs it in its folder and records its nodes in ``NODES_FILE`` every ``PERIOD``. Its
    log is kept beside it. Raises VoidError if it ends prematurely, is killed, logs an error or has
    an impossible result; the message states the last known tip.
    """
    folder, name, (seconds, minutes) = model.parent, model.name, times
    program = Path(command[0]).name if simulator == "sofa" else simulator
    record, log = folder / NODES_FILE, folder / f"{program}.log"
    record.unlink(missing_ok=True)
    periods = round(seconds / PERIOD)

    def look() -> None:
        done = record.read_bytes().count(b"T=") if record.is_file() else 0
        if done:
            progress(program, min(done - 1, periods), periods)

    code, stopped = run_program(command, log, 60 * minutes, look)
    trouble, rate = read_log(log.read_text(encoding="utf-8", errors="replace"))
    records = read_nodes(record)
    why = stopped.words if stopped else _why_void(program, code, trouble)
    if not why and not records:
        why = f"it wrote no place of a node into {NODES_FILE}"
    if not why and records[-1][0] < seconds - 1.5 * PERIOD:
        why = f"its record ends before {seconds:g} s or is not finite from there on"
    is_cut_short = stopped is not None and bool(records) and trouble is None
    if why and not is_cut_short:
        pass_on_interrupt(stopped)
        known = f"the tip is known to {records[-1][0]:g} s" if records else "nothing is known of it"
        raise VoidError(f"{name} ended prematurely: {why}; {known} (see {log})")
    states = tuple(films.state(*each) for each in records)
    figures = films.figures(states, records[-1][1])
    last, passed = states[-1], figures.get("overlap", 0.0)
    wrong = impossible(films.laminate, last, films.requested, passed)
    if wrong is not None:
        raise VoidError(f"{name} ran to {last.time:g} s, but its result is impossible: {wrong}")
    record.unlink()
    if stopped is not None:
        reached = f"{name} ran to {last.time:g} of {seconds:g} s: {stopped.words}"
        return Result.of_run(simulator, states, figures, f"{reached}; what it reached is kept")
    progress(program, periods, periods)
    return Result.of_run(simulator, states, figures | ({} if rate is None else {"rate": rate}))


def _why_void(program: str, code: int, trouble: str | None) -> str:
    """Return the reason why a program that was not stopped has failed; empty if it succeeded."""
    if code < 0:
        return f"{program} was killed by signal {-code} ({signal.Signals(-code).name})"
    if trouble is not None:
        return f'its log says "{trouble[:200]}"'
    return f"{program} ended with exit code {code}" if code > 0 else ""


def tilt_of(flat: Floats, points: Floats) -> float | None:
    """Return the angle in degrees by which the plane of points (n, 3) has rotated from ``flat``;
    None for fewer than three.
    """
    if len(points) < 3:
        return None
    x, y, _ = (flat - flat.mean(axis=0)).T
    order = np.arctan2(y, x).argsort()
    start, end = (
        np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)
        for corners in (flat[order], points[order])
    )
    return math.degrees(math.atan2(np.linalg.norm(np.cross(start, end)), start @ end))


# Files of models from templates.


TEMPLATES = Path(__file__).parent / "templates"


def model_file(
    template: str,
    name: str,
    finish: Callable[[ET.Element], None] = lambda root: None,
    **values: object,
) -> str:
    """Return an XML file with a leading comment, from a template and its values.

    ``name`` is the actuator's, in the comment as ``title``; ``finish`` may change the elements.
    """
    # Two hyphens in a row would end the comment.
    title = name.replace("--", "- -")
    text = rendered(template, name=name, title=title, **values)
    head, end, body = text.partition("-->\n")
    root = ET.fromstring(body)
    finish(root)
    ET.indent(root, " ")
    return f"{head}{end}{ET.tostring(root, encoding='unicode')}\n"


def rendered(template: str, **values: object) -> str:
    """Return a template with its values; the filter ``numbers`` is the function of that name."""
    return _environment().get_template(template).render(values)


def template_text(name: str) -> str:
    """Return a file beside the templates, which has no values."""
    return (TEMPLATES / name).read_text("utf-8")


@cache
def _environment() -> Environment:
    templates = environment(TEMPLATES)
    templates.filters |= {"numbers": numbers, "shown": lambda value, digits: f"{value:.{digits}g}"}
    return templates


def numbers(values: ArrayLike) -> str:
    """Return numbers with nine digits, separated by spaces, without a minus sign before zero."""
    return " ".join([f"{value + 0.0:.9g}" for value in np.ravel(values).tolist()])


def write_files(texts: Mapping[str, str], folder: Path) -> list[Path]:
    """Write files by name into a folder; return them in that order."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8", newline="\n")
    return [folder / name for name in texts]
