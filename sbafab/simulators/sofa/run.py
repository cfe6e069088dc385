"""Runs a scene with runSofa in batch and reads back what the tip did."""

from __future__ import annotations

import signal
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from sbafab.errors import DesignError, OutputError
from sbafab.laminate.laminate import Laminate
from sbafab.progress import Progress
from sbafab.simulators.coarse.actuator import PRESSURE, checked
from sbafab.simulators.coarse.rounds import why_not_round
from sbafab.simulators.coarse.tip import Tip
from sbafab.simulators.program import Ended, program_path, run_program
from sbafab.simulators.simulator import refuse_time
from sbafab.simulators.sofa.files import BEAM, FRAMES, SHELL, VOLUME, write_scenes
from sbafab.simulators.sofa.frames import BEAM_DT, FRAMES_DT
from sbafab.simulators.sofa.judge import TipLimits, impossible, limits
from sbafab.simulators.sofa.parts import TIP_FILE, TIP_PERIOD
from sbafab.simulators.sofa.shell_scene import DT
from sbafab.simulators.sofa.tip import Log, plugins_needed, read_log, read_tips

Scene = Literal["shell", "frames", "volume", "beam"]

SCENES: dict[Scene, tuple[str, float]] = {
    "shell": (SHELL, DT),
    "frames": (FRAMES, FRAMES_DT),
    "volume": (VOLUME, DT),
    "beam": (BEAM, BEAM_DT),
}
"""File and time step in s of each scene."""

LOG_FILE = "runSofa.log"


@dataclass(frozen=True)
class SofaJob:
    """What is run: a scene, for so many ``seconds`` of simulated time.

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
    """A run that can be believed: what the tip did, steps done, s they took, steps per s.

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
    tell: Progress | None = None,
) -> SofaRun:
    """Writes the scenes of a laminate into a folder and runs one of them.

    ``pressures`` in kPa by chamber, 0 for those left out, or 5 kPa everywhere. Raises DesignError
    where no such scene can be made of the laminate, OutputError where runSofa is missing or what
    it ran cannot be believed.
    """
    name, dt = SCENES[job.scene]
    refuse_time(job.seconds, TIP_PERIOD)
    program = find_program()
    if folder / name not in write_scenes(laminate, folder, pressures, job.volumes):
        raise DesignError(_no_such_scene(laminate, job.scene))
    told = job.volumes if job.scene == "volume" else pressures
    names = tuple(chamber.name for chamber in laminate.chambers)
    limit = limits(laminate, checked(names, told, PRESSURE, "pressure", "kPa").values())
    return run_scene(program, folder / name, job.seconds, dt, job.limit, tell, limit)


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
    tell: Progress | None = None,
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
    ended = run_program(command, log_path, limit, lambda: _report(state, dt, steps, tell))
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
        known = (
            f"the tip is known to {tips[-1].time:g} s" if tips else "nothing is known of the tip"
        )
        raise OutputError(f"{scene.name} did not run to its end: {why}; {known} (see {log_path})")
    if can_be is not None and (wrong := impossible(tips, can_be)) is not None:
        raise OutputError(f"{scene.name} ran to its end, but its result cannot be: {wrong}")
    if tell is not None:
        tell("runSofa", steps, steps)
    return SofaRun(scene, tuple(tips), log.steps or steps, log.seconds, log.rate)


def _report(state: Path, dt: float, steps: int, tell: Progress | None) -> None:
    if tell is not None:
        tips = read_tips(state)
        if tips:
            tell("runSofa", min(steps, round(tips[-1].time / dt)), steps)


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
