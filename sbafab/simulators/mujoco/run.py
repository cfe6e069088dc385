"""MuJoCo: a model inflated by its script, and the interface of a simulator."""

from __future__ import annotations

import re
import sys
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

from sbafab.errors import OutputError
from sbafab.laminate.laminate import Laminate
from sbafab.process import Progress
from sbafab.simulators.coarse import why_not_round
from sbafab.simulators.mujoco.model import MODEL, PYTHON, SECTORS, write_model
from sbafab.simulators.simulator import (
    DEFAULT_PRESSURE,
    NODES_FILE,
    RAMP,
    ModelRun,
    RecordedFilms,
    Result,
    SimulationRequest,
    chamber_pressures,
    refuse_time,
    run_model,
)

USES = ("seconds",)
SECONDS = 5.0
LEAST_TIME = 2 * RAMP
OLDEST = 4
"""Oldest major version: up to 3.17 a flex of dimension 2 stretches at a quarter of its modulus."""
INSTALL = 'install it with: pip install "sbafab[mujoco]"'
ENDED = re.compile(r"^(\S+) steps/s$", re.MULTILINE)


def why_not(laminate: Laminate) -> str | None:
    """Return why a coarse mesh is impossible: it consists of rings, so pockets must be round."""
    return why_not_round(laminate)


def export(
    laminate: Laminate, request: SimulationRequest, folder: Path, sectors: int = SECTORS
) -> RecordedFilms:
    """Write the model, with ``sectors`` nodes per ring, and a script that inflates it."""
    refuse_time(SECONDS if request.seconds is None else request.seconds, LEAST_TIME)
    names = [chamber.name for chamber in laminate.chambers]
    pressures = chamber_pressures(names, request, DEFAULT_PRESSURE)
    return write_model(laminate, folder, pressures, sectors)


def run(
    laminate: Laminate,
    request: SimulationRequest,
    folder: Path,
    progress: Progress,
    sectors: int = SECTORS,
) -> Result:
    """Write the model and inflate it to the end.

    Raises DesignError if the laminate cannot be modelled, OutputError if mujoco is missing,
    VoidError if the result is impossible.
    """
    films = export(laminate, request, folder, sectors)
    _refuse_missing()
    return inflate(films, request, folder, progress)


def inflate(
    films: RecordedFilms, request: SimulationRequest, folder: Path, progress: Progress
) -> Result:
    """Inflate the model that was written into a folder."""
    seconds = SECONDS if request.seconds is None else request.seconds
    command = [sys.executable, PYTHON, f"--seconds={seconds!r}", f"--record={NODES_FILE}"]
    pressures = films.pressures.values()
    run = ModelRun("mujoco", folder / MODEL, command, films, seconds, read_log, pressures)
    result = run_model(run, request.minutes, progress)
    for log in ("mujoco.log", "MUJOCO_LOG.TXT"):
        (folder / log).unlink(missing_ok=True)
    return result


def read_log(text: str) -> tuple[str | None, float | None]:
    """The last words of a script that did not come to its end, and the steps per s of one that did.

    A run that is stopped has said nothing.
    """
    ended = ENDED.search(text)
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    trouble = None if ended is not None or not lines else lines[-1]
    return trouble, None if ended is None else float(ended[1])


def _refuse_missing() -> None:
    """Raises OutputError with a remedy if the package mujoco is missing or too old."""
    if find_spec("mujoco") is None:
        raise OutputError(f"mujoco is not installed; {INSTALL}")
    installed = version("mujoco")
    if int(installed.split(".", maxsplit=1)[0]) < OLDEST:
        raise OutputError(
            f"mujoco {installed} stretches films with a quarter of their modulus, {OLDEST}.0 does "
            f"not; {INSTALL}"
        )
