"""SOFA: a scene run with runSofa in batch, and the interface of a simulator."""

from __future__ import annotations

import re
from pathlib import Path

from sbafab.errors import DesignError
from sbafab.laminate.laminate import Laminate
from sbafab.runtime import Progress
from sbafab.simulators.shell_model import elastic_of, why_not_round
from sbafab.simulators.simulator import (
    DEFAULT_PRESSURE,
    PERIOD,
    Result,
    SimulationRequest,
    chamber_pressures,
    program_path,
    refuse_time,
    run_model,
)
from sbafab.simulators.sofa.scenes import Scene, scenes_of, write_scenes

RECORDED_SCENE = "recorded.scn"
SECONDS = 8.0
USES = ("scene", "seconds", "volumes")


def why_not(laminate: Laminate) -> str | None:
    """Return why no scene can be made: the modulus of a film is not known."""
    try:
        for layer in laminate.tpe_layers:
            elastic_of(layer.film)
    except DesignError as reason:
        return str(reason)
    return None


def export(laminate: Laminate, request: SimulationRequest, folder: Path) -> dict[str, Scene]:
    """Write all the scenes; return them by name."""
    refuse_time(SECONDS if request.seconds is None else request.seconds, PERIOD)
    names = [chamber.name for chamber in laminate.chambers]
    pressures = chamber_pressures(names, request, DEFAULT_PRESSURE)
    scenes = scenes_of(laminate, pressures, request.volumes or None)
    write_scenes(scenes, folder)
    return scenes


def run(laminate: Laminate, request: SimulationRequest, folder: Path, progress: Progress) -> Result:
    """Write all the scenes and run one of them with runSofa.

    Raises DesignError if the scene cannot be made for the laminate, OutputError if runSofa is
    missing, VoidError if the result is invalid.
    """
    if request.volumes and request.scene != "volume":
        raise DesignError("--volume is for --scene volume; the other scenes are told pressures")
    scenes = export(laminate, request, folder)
    scene = scenes.get(request.scene or "shell")
    if scene is None:
        raise DesignError(_no_such_scene(laminate, str(request.scene)))
    program = program_path(
        "runSofa",
        "install SOFA 25.06 (https://www.sofa-framework.org) and put the folder that holds runSofa "
        "on PATH",
    )
    recorded = folder / RECORDED_SCENE
    text = scene.text(record=True)
    recorded.write_text(text, encoding="utf-8", newline="\n")
    seconds = SECONDS if request.seconds is None else request.seconds
    # Nodes are written at the beginning of a step: one more step writes the last.
    steps = round(seconds / scene.dt) + 1
    plugins = NEEDED.findall(text)
    result = run_model(
        "sofa",
        folder / scene.file,
        [program, "-g", "batch", "-n", str(steps), recorded.name],
        scene.films,
        lambda log: read_log(log, plugins),
        (seconds, request.minutes),
        progress,
    )
    recorded.unlink()
    return result


def _no_such_scene(laminate: Laminate, scene: str) -> str:
    reason = why_not_round(laminate)
    if reason is not None:
        return f"scene {scene} is for round pockets of one film: {reason}; take scene shell"
    return (
        f"scene {scene} needs three chambers or more, {laminate.name} has "
        f"{len(laminate.chambers)}; take scene shell"
    )


# The log of SOFA, whose exit code is 0 even when the numbers have gone.


TROUBLE = re.compile(r"\[ERROR\]|\bnan\b|Division by zero|Null determinant", re.IGNORECASE)
NO_PLUGIN = re.compile(r"\[ERROR\].*Plugin not found: \"([^\"]*)\"")
NEEDED = re.compile(r'<RequiredPlugin name="([^"]*)"')
DONE = re.compile(r"iterations done in \S+ s \(\s*(\S+) FPS\s*\)")


def read_log(text: str, plugins: list[str]) -> tuple[str | None, float | None]:
    """The first error of a run whose scene needs these plugins, and its steps per s.

    Other plugins may be missing.
    """

    def voids(line: str) -> bool:
        missing = NO_PLUGIN.search(line)
        return missing is None or missing[1] in plugins

    lines = (line.strip() for line in text.splitlines() if TROUBLE.search(line))
    done = DONE.search(text)
    return next(filter(voids, lines), None), None if done is None else float(done[1])
