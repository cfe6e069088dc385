"""SOFA: a scene run with runSofa in batch, its tip read back, and the interface of a simulator."""

from __future__ import annotations

import math
import re
import signal
import xml.etree.ElementTree as ET
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, cast

import numpy as np
from numpy.typing import NDArray

from sbafab.errors import DesignError, VoidError
from sbafab.laminate.laminate import Laminate
from sbafab.meshing.surface import Vector
from sbafab.process import Progress
from sbafab.simulators.coarse.rounds import why_not_round
from sbafab.simulators.coarse.shell import PRESSURE, checked
from sbafab.simulators.simulator import (
    Ended,
    Result,
    SimulationRequest,
    State,
    chamber_pressures,
    drift,
    impossible,
    limits,
    overlap,
    program_path,
    refuse_time,
    run_program,
    tilt_of,
)
from sbafab.simulators.sofa.scenes import (
    BEAM_DT,
    BEAM_FILE,
    DT,
    FRAMES_DT,
    FRAMES_FILE,
    RAMP,
    SHELL_FILE,
    TIP_FILE,
    TIP_PERIOD,
    VOLUME_FILE,
    why_no_scene,
    write_scenes,
)

Scene = Literal["shell", "frames", "volume", "beam"]

SCENES: dict[Scene, tuple[str, float]] = {
    "shell": (SHELL_FILE, DT),
    "frames": (FRAMES_FILE, FRAMES_DT),
    "volume": (VOLUME_FILE, DT),
    "beam": (BEAM_FILE, BEAM_DT),
}
"""File and time step in s of each scene."""

LOG_FILE = "runSofa.log"


@dataclass(frozen=True)
class SofaJob:
    """A scene to run for ``seconds`` of simulated time.

    ``limit`` is the maximum real time in s; ``volumes`` (ul above the start, by chamber) apply to
    scene "volume".
    """

    scene: Scene = "shell"
    seconds: float = 8.0
    limit: float | None = None
    volumes: Mapping[str, float] | None = None


USUAL = SofaJob()


@dataclass(frozen=True)
class SofaRun:
    """A valid run: its states, steps done, their duration in s, steps per s.

    ``overlap`` is the volume in ul in which films have passed through each other at the end, None
    if unknown; ``stopped`` is one sentence if it was stopped early.
    """

    scene: Path
    states: tuple[State, ...]
    overlap: float | None
    steps: int
    seconds: float | None
    rate: float | None
    stopped: str | None = None

    @property
    def last(self) -> State:
        return self.states[-1]


def simulate(
    laminate: Laminate,
    folder: Path,
    pressures: Mapping[str, float] | None = None,
    job: SofaJob = USUAL,
    progress: Progress | None = None,
) -> SofaRun:
    """Writes the scenes of a laminate into a folder and runs one of them.

    ``pressures`` in kPa by chamber, 0 for omitted ones, or 5 kPa everywhere. Raises DesignError if
    the scene cannot be made for the laminate, OutputError if runSofa is missing, VoidError if the
    result is invalid.
    """
    name, dt = SCENES[job.scene]
    refuse_time(job.seconds, TIP_PERIOD)
    if folder / name not in write_scenes(laminate, folder, pressures, job.volumes):
        raise DesignError(_no_such_scene(laminate, job.scene))
    program = find_program()
    requested = job.volumes if job.scene == "volume" else pressures
    names = tuple(chamber.name for chamber in laminate.chambers)
    can_be = limits(laminate, checked(names, requested, PRESSURE, "pressure", "kPa").values())
    done = run_scene(program, laminate, folder / name, job.seconds, dt, job.limit, progress)
    wrong = impossible(done.last, can_be, done.overlap or 0.0)
    if wrong is not None:
        raise VoidError(f"{name} ran to {done.last.time:g} s, but its result cannot be: {wrong}")
    return done


def _no_such_scene(laminate: Laminate, scene: Scene) -> str:
    reason = why_not_round(laminate)
    if reason is not None:
        return f"scene {scene} is for round pockets of one film: {reason}; take scene shell"
    return (
        f"scene {scene} needs three chambers or more, {laminate.name} has "
        f"{len(laminate.chambers)}; take scene shell"
    )


def find_program() -> str:
    """The path of runSofa. Raises OutputError with a remedy if it is missing."""
    return program_path(
        "runSofa",
        "install SOFA 25.06 (https://www.sofa-framework.org) and put the folder that holds runSofa "
        "on PATH",
    )


def run_scene(
    program: str,
    laminate: Laminate,
    scene: Path,
    seconds: float,
    dt: float,
    limit: float | None = None,
    progress: Progress | None = None,
) -> SofaRun:
    """Runs a scene for ``seconds`` in steps of ``dt`` s; its log remains beside it in runSofa.log.

    It is stopped after ``limit`` s of real time. Raises VoidError if it ends by itself, is killed
    or logs an error that makes it void; the message says how far the tip was known.
    """
    folder = scene.parent
    state, nodes = folder / TIP_FILE, folder / NODES_FILE
    state.unlink(missing_ok=True)
    films = RecordedFilms(scene)
    recorded = folder / RECORDED_SCENE
    recorded.write_text(films.recording(), encoding="utf-8", newline="\n")
    # The tip is written at the beginning of a step: one more step writes the last.
    steps = round(seconds / dt) + 1
    log_path = folder / LOG_FILE
    command = [program, "-g", "batch", "-n", str(steps), recorded.name]
    ended = run_program(command, log_path, limit, lambda: _report(state, dt, steps, progress))
    log = read_log(log_path.read_text(encoding="utf-8", errors="replace"), plugins_needed(scene))
    tips = read_points(state)
    why = _trouble(ended, log, [time for time, _ in tips], seconds)
    is_cut = bool(tips) and log.trouble is None
    if why is not None and not (ended.stopped and is_cut):
        reached = (
            f"the tip is known to {tips[-1][0]:g} s" if tips else "nothing is known of the tip"
        )
        raise VoidError(f"{scene.name} did not run to its end: {why}; {reached} (see {log_path})")
    places = dict(read_points(nodes))
    depth = films.overlap(places[max(places)]) if places else None
    for extra in (nodes, recorded):
        extra.unlink(missing_ok=True)
    states = tuple(films.state(laminate, time, points, places.get(time)) for time, points in tips)
    if ended.stopped is not None:
        stopped = (
            f"{scene.name} ran to {tips[-1][0]:g} of {seconds:g} s: {ended.stopped.words}; what it "
            "reached is kept"
        )
        return SofaRun(scene, states, depth, round(tips[-1][0] / dt), None, None, stopped)
    if progress is not None:
        progress("runSofa", steps, steps)
    return SofaRun(scene, states, depth, log.steps or steps, log.seconds, log.rate)


def _report(state: Path, dt: float, steps: int, progress: Progress | None) -> None:
    if progress is not None:
        tips = read_points(state)
        if tips:
            progress("runSofa", min(steps, round(tips[-1][0] / dt)), steps)


def _trouble(ended: Ended, log: Log, times: list[float], seconds: float) -> str | None:
    """The reason why a run is invalid, if any."""
    code = ended.code
    if ended.stopped is not None:
        return ended.stopped.words
    if code < 0:
        return f"runSofa was killed by signal {-code} ({signal.Signals(-code).name})"
    if log.trouble is not None:
        return f'its log says "{log.trouble[:200]}"'
    if code > 0:
        return f"runSofa ended with exit code {code}"
    if not times:
        return f"it wrote no place of the tip into {TIP_FILE}"
    if times[-1] < seconds - 1.5 * TIP_PERIOD:
        return f"the tip's record ends before {seconds:g} s or is no finite number from there on"
    return None


# Files written by SOFA: the tip's record, and the log.


TROUBLE = re.compile(r"\[ERROR\]|\bnan\b|Division by zero|Null determinant", re.IGNORECASE)
NO_PLUGIN = re.compile(r"\[ERROR\].*Plugin not found: \"([^\"]*)\"")
NEEDED = re.compile(r'<RequiredPlugin name="([^"]*)"')
DONE = re.compile(r"(\d+) iterations done in (\S+) s \(\s*(\S+) FPS\s*\)")


@dataclass(frozen=True)
class Log:
    """Contents of a log: its first error, steps done, duration in s and steps per s."""

    trouble: str | None
    steps: int | None
    seconds: float | None
    rate: float | None


def read_points(path: Path) -> list[tuple[float, list[Vector]]]:
    """Times in s and places in mm of the recorded nodes.

    They end before the first record that is truncated or not finite.
    """
    if not path.is_file():
        return []
    records: list[tuple[float, list[Vector]]] = []
    time: float | None = None
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines(keepends=True):
        key, _, values = line.strip().partition("=")
        numbers = _numbers(values)
        if numbers is None or not line.endswith("\n"):
            break
        if key == "T" and len(numbers) == 1:
            time = numbers[0]
        elif key == "X" and time is not None:
            if len(numbers) < 9 or len(numbers) % 3:
                break
            records.append((time, list(_points(numbers))))
    return records


def plugins_needed(scene: Path) -> list[str]:
    """The plugins required by a scene."""
    return NEEDED.findall(scene.read_text(encoding="utf-8")) if scene.is_file() else []


def read_log(text: str, plugins: Collection[str] = ()) -> Log:
    """Read the log of a run whose scene needs these plugins; others may be missing."""

    def voids(line: str) -> bool:
        missing = NO_PLUGIN.search(line)
        return missing is None or missing[1] in plugins

    lines = (line.strip() for line in text.splitlines() if TROUBLE.search(line))
    trouble = next(filter(voids, lines), None)
    done = DONE.search(text)
    if done is None:
        return Log(trouble, None, None, None)
    return Log(trouble, int(done[1]), float(done[2]), float(done[3]))


def _numbers(text: str) -> list[float] | None:
    try:
        numbers = [float(word) for word in text.split()]
    except ValueError:
        return None
    return numbers if all(map(math.isfinite, numbers)) else None


def _points(numbers: list[float]) -> Iterator[Vector]:
    for i in range(0, len(numbers), 3):
        yield numbers[i], numbers[i + 1], numbers[i + 2]


# The films of a scene. A run records all of their nodes; the scene itself records only the tip.


NODES_FILE, RECORDED_SCENE = "nodes.state", "recorded.scn"


class RecordedFilms:
    """Nodes, films and chambers of a scene, as read from its file."""

    def __init__(self, scene: Path) -> None:
        self.root = ET.parse(scene).getroot()
        inside = {child: parent for parent in self.root.iter() for child in parent}
        self.tip = self.root.find(".//Node[@name='tip']")
        assert self.tip is not None
        self.body = inside[self.tip]
        self.pressures = {
            inside[air].attrib["name"].removeprefix("air_"): float(air.attrib["pressure"])
            for air in self.root.iter("SurfacePressureForceField")
        }

    def recording(self) -> str:
        """The scene with a record of all nodes of its films, whenever the tip is recorded."""
        assert self.tip is not None
        record = self.tip.find("WriteState")
        assert record is not None
        ET.SubElement(self.body, "WriteState", {**record.attrib, "filename": NODES_FILE})
        return ET.tostring(self.root, encoding="unicode")

    def _triangles(self, name: str) -> Iterator[tuple[str, NDArray[np.int64]]]:
        """Triangles (k, 3) of the containers of a name, with the names of their nodes."""
        for node in self.body.findall("Node"):
            for container in node.findall(f"TriangleSetTopologyContainer[@name='{name}']"):
                numbers = [int(word) for word in container.attrib["triangles"].split()]
                yield node.attrib["name"], np.array(numbers).reshape(-1, 3)

    def overlap(self, places: Sequence[Vector]) -> float | None:
        """The volume in ul in which films have passed through each other.

        None if the scene does not contain the flat shape.
        """
        films = [of for name, of in self._triangles("t") if name.startswith("membrane")]
        flat, start = self._places("rest_position"), self._places("position")
        if flat is None or start is None or not films:
            return None
        return overlap(np.array(places), flat, start, np.concatenate(films))

    def _places(self, name: str) -> NDArray[np.float64] | None:
        """Positions (n, 3) of the films' nodes, as given in the scene."""
        body = self.body.find("MechanicalObject")
        words = None if body is None else body.get(name)
        return None if words is None else np.array(words.split(), dtype=float).reshape(-1, 3)

    def state(
        self,
        laminate: Laminate,
        time: float,
        tip: Sequence[Vector],
        places: Sequence[Vector] | None,
    ) -> State:
        """The state at a time in s, from the positions in mm of the tip's and of all nodes."""
        on = min(1.0, time / RAMP)
        pressures = {name: on * value for name, value in self.pressures.items()}
        volumes = {}
        if places is not None:
            for name, walls in self._triangles("c"):
                a, b, c = np.array(places)[walls].transpose(1, 0, 2)
                volumes[name] = float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6
        if laminate.tube is not None:
            return State(time, pressures, None, None, None, volumes)
        x, y, z = (np.mean(tip, axis=0) - self._flat_tip()).tolist()
        height = sum(layer.film.thickness for layer in laminate.tpe_layers) + z
        return State(time, pressures, height, (x, y, z), tilt_of(tip), volumes)

    def _flat_tip(self) -> NDArray[np.float64]:
        """The middle of the tip's nodes when flat; the axis if the scene has no flat shape."""
        flat = self._places("rest_position")
        assert self.tip is not None
        mapping = self.tip.find("SubsetMapping")
        if flat is None or mapping is None:
            return np.zeros(3)
        nodes = [int(word) for word in mapping.attrib["indices"].split()]
        middle: NDArray[np.float64] = flat[nodes].mean(axis=0)
        return middle


# The interface of a simulator.


USES = ("scene", "seconds", "volumes")


def why_not(laminate: Laminate) -> str | None:
    """Return why no scene can be made: the modulus of a film is not known."""
    return why_no_scene(laminate)


def export(laminate: Laminate, request: SimulationRequest, folder: Path) -> None:
    """Write all the scenes."""
    refuse_time(USUAL.seconds if request.seconds is None else request.seconds, TIP_PERIOD)
    write_scenes(laminate, folder, _pressures(laminate, request), request.volumes or None)


def run(laminate: Laminate, request: SimulationRequest, folder: Path, progress: Progress) -> Result:
    """Write all the scenes and run one of them with runSofa."""
    if request.volumes and request.scene != "volume":
        raise DesignError("--volume is for --scene volume; the other scenes are told pressures")
    pressures = _pressures(laminate, request)
    seconds = USUAL.seconds if request.seconds is None else request.seconds
    scene = cast(Scene, request.scene or USUAL.scene)
    job = SofaJob(scene, seconds, 60 * request.minutes, request.volumes or None)
    result = simulate(laminate, folder, pressures, job, progress)
    figures: dict[str, float] = {}
    if laminate.tube is not None:
        # Distance of the balloons' crowns from their tube's axis.
        _, crowns = read_points(result.scene.with_name(TIP_FILE))[-1]
        across = [2 * math.hypot(x, y) for x, y, _ in crowns]
        figures["diameter"] = sum(across) / len(across)
    else:
        figures["drift"] = drift(result.states)
    figures |= {} if result.overlap is None else {"overlap": result.overlap}
    figures |= {} if result.rate is None else {"rate": result.rate}
    return Result("sofa", result.states, figures, result.stopped)


def _pressures(laminate: Laminate, request: SimulationRequest) -> dict[str, float]:
    return chamber_pressures([chamber.name for chamber in laminate.chambers], request, PRESSURE)
