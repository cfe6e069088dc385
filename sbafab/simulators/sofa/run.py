"""SOFA: a scene run with runSofa in batch, its tip read back, and the interface of a simulator."""

from __future__ import annotations

import math
import re
import signal
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, cast

from sbafab.errors import DesignError, OutputError
from sbafab.laminate.laminate import Laminate
from sbafab.meshing.surface import Vector
from sbafab.process import Progress
from sbafab.simulators.coarse.rounds import why_not_round
from sbafab.simulators.coarse.shell import PRESSURE, checked
from sbafab.simulators.simulator import (
    Ended,
    Result,
    SimulationRequest,
    Tip,
    chamber_pressures,
    program_path,
    refuse_time,
    run_program,
    tip_at,
)
from sbafab.simulators.sofa.scenes import (
    BEAM_DT,
    BEAM_FILE,
    DT,
    FRAMES_DT,
    FRAMES_FILE,
    SHELL_FILE,
    TIP_FILE,
    TIP_PERIOD,
    VOLUME_FILE,
    why_no_scene,
    write_scenes,
)
from sbafab.simulators.sofa.shell import pocket_radii

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
    """A scene to run, for so many ``seconds`` of simulated time.

    ``limit`` is the most real time in s it may take; ``volumes`` (ul above the start, by chamber)
    are for scene "volume".
    """

    scene: Scene = "shell"
    seconds: float = 8.0
    limit: float | None = None
    volumes: Mapping[str, float] | None = None


USUAL = SofaJob()


@dataclass(frozen=True)
class SofaRun:
    """A valid run: the motion of the tip, steps done, s they took, steps per s.

    ``stopped`` is one sentence if it was stopped early.
    """

    scene: Path
    tips: tuple[Tip, ...]
    steps: int
    seconds: float | None
    rate: float | None
    stopped: str | None = None

    @property
    def last(self) -> Tip:
        return self.tips[-1]

    def before(self, seconds: float) -> Tip:
        """The tip so many s before the end, or at the start."""
        until = self.last.time - seconds
        return next((tip for tip in reversed(self.tips) if tip.time <= until), self.tips[0])


def simulate(
    laminate: Laminate,
    folder: Path,
    pressures: Mapping[str, float] | None = None,
    job: SofaJob = USUAL,
    progress: Progress | None = None,
) -> SofaRun:
    """Writes the scenes of a laminate into a folder and runs one of them.

    ``pressures`` in kPa by chamber, 0 for those left out, or 5 kPa everywhere. Raises DesignError
    where no such scene can be made of the laminate, OutputError where runSofa is missing or what
    it ran cannot be believed.
    """
    name, dt = SCENES[job.scene]
    refuse_time(job.seconds, TIP_PERIOD)
    if folder / name not in write_scenes(laminate, folder, pressures, job.volumes):
        raise DesignError(_no_such_scene(laminate, job.scene))
    program = find_program()
    requested = job.volumes if job.scene == "volume" else pressures
    names = tuple(chamber.name for chamber in laminate.chambers)
    limit = limits(laminate, checked(names, requested, PRESSURE, "pressure", "kPa").values())
    return run_scene(program, folder / name, job.seconds, dt, job.limit, progress, limit)


def _no_such_scene(laminate: Laminate, scene: Scene) -> str:
    reason = why_not_round(laminate)
    if reason is not None:
        return f"scene {scene} is for round pockets of one film: {reason}; take scene shell"
    return (
        f"scene {scene} needs three chambers or more, {laminate.name} has "
        f"{len(laminate.chambers)}; take scene shell"
    )


def find_program() -> str:
    """The path of runSofa. Raises OutputError with what to do where it is not there."""
    return program_path(
        "runSofa",
        "install SOFA 25.06 (https://www.sofa-framework.org) and put the folder that holds runSofa "
        "on PATH",
    )


def run_scene(
    program: str,
    scene: Path,
    seconds: float,
    dt: float,
    limit: float | None = None,
    progress: Progress | None = None,
    can_be: TipLimits | None = None,
) -> SofaRun:
    """Runs a scene for so many s in steps of ``dt``; its log stays beside it in runSofa.log.

    It is stopped after ``limit`` s of real time. Raises OutputError if it ends by itself, is
    killed, logs what makes it void, or ends outside of what ``can_be``; the sentence says how far
    the tip was known.
    """
    folder = scene.parent
    state = folder / TIP_FILE
    state.unlink(missing_ok=True)
    # The tip is written at the beginning of a step: one more step writes the last.
    steps = round(seconds / dt) + 1
    log_path = folder / LOG_FILE
    command = [program, "-g", "batch", "-n", str(steps), scene.name]
    ended = run_program(command, log_path, limit, lambda: _report(state, dt, steps, progress))
    needed = plugins_needed(scene)
    log = read_log(log_path.read_text(encoding="utf-8", errors="replace"), needed)
    tips = read_tips(state)
    if ended.stopped is not None and tips and log.trouble is None:
        stopped = (
            f"{scene.name} ran to {tips[-1].time:g} of {seconds:g} s: {ended.stopped}; what it "
            "reached is kept"
        )
        return SofaRun(scene, tuple(tips), round(tips[-1].time / dt), None, None, stopped)
    why = _trouble(ended, log, tips, seconds)
    if why is not None:
        reached = (
            f"the tip is known to {tips[-1].time:g} s" if tips else "nothing is known of the tip"
        )
        raise OutputError(f"{scene.name} did not run to its end: {why}; {reached} (see {log_path})")
    if can_be is not None and (wrong := impossible(tips, can_be)) is not None:
        raise OutputError(f"{scene.name} ran to its end, but its result cannot be: {wrong}")
    if progress is not None:
        progress("runSofa", steps, steps)
    return SofaRun(scene, tuple(tips), log.steps or steps, log.seconds, log.rate)


def _report(state: Path, dt: float, steps: int, progress: Progress | None) -> None:
    if progress is not None:
        tips = read_tips(state)
        if tips:
            progress("runSofa", min(steps, round(tips[-1].time / dt)), steps)


def _trouble(ended: Ended, log: Log, tips: list[Tip], seconds: float) -> str | None:
    """Why a run cannot be believed."""
    code = ended.code
    if ended.stopped is not None:
        return ended.stopped
    if code < 0:
        return f"runSofa was killed by signal {-code} ({signal.Signals(-code).name})"
    if log.trouble is not None:
        return f'its log says "{log.trouble[:200]}"'
    if code > 0:
        return f"runSofa ended with exit code {code}"
    if not tips:
        return f"it wrote no place of the tip into {TIP_FILE}"
    if tips[-1].time < seconds - 1.5 * TIP_PERIOD:
        return f"the tip's record ends before {seconds:g} s or is no finite number from there on"
    return None


# The files that SOFA wrote: the tip's record, and the log.


TROUBLE = re.compile(r"\[ERROR\]|\bnan\b|Division by zero|Null determinant", re.IGNORECASE)
NO_PLUGIN = re.compile(r"\[ERROR\].*Plugin not found: \"([^\"]*)\"")
NEEDED = re.compile(r'<RequiredPlugin name="([^"]*)"')
DONE = re.compile(r"(\d+) iterations done in (\S+) s \(\s*(\S+) FPS\s*\)")


@dataclass(frozen=True)
class Log:
    """Contents of a log: its first line of trouble, steps done, s taken and steps per s."""

    trouble: str | None
    steps: int | None
    seconds: float | None
    rate: float | None


def read_tips(path: Path) -> list[Tip]:
    """The tip's records in time up to the first that is cut short or is no finite number."""
    return [tip_at(time, points) for time, points in read_points(path)]


def read_points(path: Path) -> list[tuple[float, list[Vector]]]:
    """Time in s and places in mm of the recorded nodes, as far as ``read_tips`` reads them."""
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
    """The plugins that a scene asks for."""
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


# The limits of a possible result: place, height and lean of the tip.


LEAST_RISE = 0.01
"""mm that a tip must stand above its base: no scene starts as low and stays there."""
MOST_LEAN = 1.0
"""Degrees of tilt where all chambers are alike; shells that hold stand within 0.1."""
STRETCH = 1.3
"""Times its flat length that a film may be along its meridian; more has burst it long before."""


@dataclass(frozen=True)
class TipLimits:
    """Limits of a tip: at most ``highest`` mm over its base, and whether it must stand upright."""

    highest: float
    must_stand: bool


def limits(laminate: Laminate, requested: Collection[float]) -> TipLimits | None:
    """Return the limits of a laminate with these pressures or volumes in its chambers.

    A balloon is no higher than its two films are long; equal chambers lift a plate evenly, where
    the mesh has no inlets. None for a laminate on a tube, whose balloons have no common tip.
    """
    if laminate.tube is not None:
        return None
    reach = sum(pocket_radii(laminate)) / len(laminate.chambers)
    return TipLimits(
        2 * STRETCH * reach, len(set(requested)) == 1 and why_not_round(laminate) is None
    )


def impossible(tips: Sequence[Tip], limit: TipLimits) -> str | None:
    """Return what is impossible in the last tip, or None."""
    last = tips[-1]
    z = last.place[2]
    if all(abs(value) < LEAST_RISE for value in last.place):
        return "the tip lies at 0, 0, 0"
    if limit.must_stand and z < LEAST_RISE:
        return f"all chambers are told the same, and the tip has not risen (z {z:.3f} mm)"
    if z > limit.highest:
        return f"the tip is {z:.3f} mm high, and the films reach {limit.highest:.3g} mm at most"
    if limit.must_stand and last.tilt > MOST_LEAN:
        return (
            f"all chambers are told the same, and the tip leans by {last.tilt:.1f} degrees "
            f"(more than {MOST_LEAN:g})"
        )
    return None


# The interface of a simulator.


USES = ("scene", "seconds", "volumes")


def why_not(laminate: Laminate) -> str | None:
    """Return why there can be no scene: a film whose modulus is not known."""
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
    rows = [] if scene == "volume" else [(name, p, "kPa") for name, p in pressures.items()]
    rows += _reached(laminate, result)
    rows += [] if result.rate is None else [("rate", result.rate, "steps/s")]
    tips = [{"time": tip.time, "place": tip.place, "tilt": tip.tilt} for tip in result.tips]
    figures = {"scene": result.scene.name, "tips": tips, "rate": result.rate}
    return Result(tuple(rows), figures, result.stopped)


def _reached(laminate: Laminate, result: SofaRun) -> list[tuple[str, float, str]]:
    """The tip's place and lean, or how far the crowns of balloons lie from their tube's axis."""
    if laminate.tube is not None:
        _, crowns = read_points(result.scene.with_name(TIP_FILE))[-1]
        across = [2 * math.hypot(x, y) for x, y, _ in crowns]
        return [("diameter over the crowns", sum(across) / len(across), "mm")]
    x, y, z = result.last.place
    tip = [("tip x", x, "mm"), ("tip y", y, "mm"), ("tip z", z, "mm")]
    drift = math.dist(result.last.place, result.before(1.0).place)
    return [*tip, ("tilt", result.last.tilt, "degrees"), ("drift in 1 s", drift, "mm")]


def _pressures(laminate: Laminate, request: SimulationRequest) -> dict[str, float]:
    return chamber_pressures([chamber.name for chamber in laminate.chambers], request, PRESSURE)
