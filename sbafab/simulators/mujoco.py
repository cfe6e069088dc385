"""MuJoCo: the actuator as a model (MJCF), one body per node and one flex per group of films; its
inflation by a script, and the interface of a simulator.
"""

from __future__ import annotations

import json
import math
import re
import sys
from collections.abc import Mapping
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from sbafab.errors import OutputError
from sbafab.laminate.laminate import Laminate
from sbafab.runtime import Progress
from sbafab.simulators.shell_model import (
    FILMS,
    RoundStack,
    Shell,
    coarse_shell,
    fullest,
    nearly_flat,
    node_masses,
    round_stack,
    why_not_round,
)
from sbafab.simulators.simulator import (
    DEFAULT_PRESSURE,
    NODES_FILE,
    RAMP,
    RecordedFilms,
    Result,
    SimulationRequest,
    chamber_pressures,
    model_file,
    refuse_time,
    run_model,
    template_text,
    write_files,
)

MODEL, DATA, PYTHON = "actuator.xml", "actuator.json", "inflate.py"
DT = 0.01
"""Time step, s. The integrator is implicit; a step four times as long works too."""
SOLVER_STEPS = 1000
"""Solver iterations per time step; the default of 100 is too few for long stacks."""
LENGTH = 10.0
"""Model length unit, mm. MuJoCo's film contact keeps films a thousandth of a unit apart and treats
them as at rest below a twentieth of a unit per second: with cm the gap is 0.01 mm, a quarter of a
film; with mm the solver needs forty times the iterations."""
CONTACT_MEMORY = 0.0625
"""MB per triangle and balloon of a stack that films in contact may take, of what MuJoCo reserves
and fills as needed: at 20 kPa in one of three chambers four balloons take half of that, and fifteen
more than 0.25 MB a triangle. By itself it reserves a twentieth."""
START = "inflated"
SECTORS = 16
"""Nodes per ring. Eight, as in SOFA's scenes, take a quarter of the time and rise 13 % less."""
FLEXES = {
    "bend_lower": ("lower", "0.35 0.60 0.85 1"),
    "bend_upper": ("upper", "0.55 0.75 0.95 1"),
    "bend_web": ("web", "0.20 0.35 0.60 1"),
    "bend_neck": ("necks", "0.90 0.60 0.25 1"),
}
"""Names and colours of the flexes, by the group of the shell's triangles."""


def shell_of(stack: RoundStack, pressures: Mapping[str, float], sectors: int = SECTORS) -> Shell:
    """Return the coarse shell of a stack of round pockets."""
    # Films that fall far onto each other need many iterations.
    return coarse_shell(stack, sectors, nearly_flat if has_contact(pressures) else fullest)


def has_contact(pressures: Mapping[str, float]) -> bool:
    """Return True if films touch, as films of chambers with a lower pressure than others do."""
    return len(set(pressures.values())) > 1


def model_text(
    stack: RoundStack, shell: Shell, pressures: Mapping[str, float], sectors: int = SECTORS
) -> str:
    """Return the model as a file: node i is body ``n<i>``, which is flat unless the keyframe is
    loaded.

    The nodes of the base are fixed, or the centre of a lone balloon, so that it bulges both ways,
    as in the CalculiX deck.
    """
    still = shell.roots if stack.balloons == 1 else shell.fixed
    free = np.setdiff1d(np.arange(len(shell.rest)), still)
    flexes = []
    for group in shell.bending:
        # Flexes share bodies where films are bonded. In one an edge has at most two triangles.
        nodes, elements = np.unique(group.triangles, return_inverse=True)
        name, colour = FLEXES[group.name]
        flex = {"name": name, "colour": colour, "nodes": nodes.tolist(), "elements": elements}
        flexes.append({**flex, "thickness": FILMS[group.name] * stack.film.thickness})
    return model_file(
        f"{MODEL}.j2",
        stack.name,
        stack=stack,
        sectors=sectors,
        mass=shell.mass,
        contact=has_contact(pressures),
        places=(shell.rest / LENGTH).round(9),
        moved=((shell.position - shell.rest)[free] / LENGTH).round(9),
        still=set(still.tolist()),
        masses=node_masses(shell, stack.film).tolist(),
        flexes=flexes,
        triangles=len(shell.triangles),
        memory=math.ceil(CONTACT_MEMORY * stack.balloons * len(shell.triangles)),
        height=shell.height,
        length=LENGTH,
        dt=DT,
        solver_steps=SOLVER_STEPS,
        start=START,
    )


# The run.


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
    """Write the model, its cavities, and a script that inflates it; return its films.

    ``sectors`` is the number of nodes per ring. Raises DesignError if the pockets are not round.
    """
    refuse_time(SECONDS if request.seconds is None else request.seconds, LEAST_TIME)
    names = [chamber.name for chamber in laminate.chambers]
    pressures = chamber_pressures(names, request, DEFAULT_PRESSURE)
    stack = round_stack(laminate)
    shell = shell_of(stack, pressures, sectors)
    data = {
        "schema": "sbafab/mujoco@1",
        "name": stack.name,
        "units": {"length": "mm", "mass": "kg", "time": "s", "pressure": "kPa", "volume": "ul"},
        "length": LENGTH,
        "start": START,
        "pressures": dict(pressures),
        "films": 2 * stack.balloons * stack.film.thickness,
        "cavities": {name: walls.tolist() for name, walls in shell.cavities.items()},
        "tip": shell.tip.tolist(),
        "roots": shell.roots.tolist(),
        "poles": shell.poles.tolist(),
    }
    texts = {
        MODEL: model_text(stack, shell, pressures, sectors),
        DATA: json.dumps(data, separators=(",", ":")) + "\n",
        PYTHON: template_text(f"{PYTHON}.txt"),
    }
    write_files(texts, folder)
    return RecordedFilms(laminate, shell, shell.poles, pressures, pressures.values())


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
    """Inflate the model in a folder."""
    seconds = SECONDS if request.seconds is None else request.seconds
    command = [sys.executable, PYTHON, f"--seconds={seconds!r}", f"--record={NODES_FILE}"]
    model, times = folder / MODEL, (seconds, request.minutes)
    result = run_model("mujoco", model, command, films, read_log, times, progress)
    for log in ("mujoco.log", "MUJOCO_LOG.TXT"):
        (folder / log).unlink(missing_ok=True)
    return result


def read_log(text: str) -> tuple[str | None, float | None]:
    """Return MuJoCo's message, or else the last line, of a script that did not finish, and the
    steps per s of one that did.

    A stopped run gives no message.
    """
    ended = ENDED.search(text)
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    fatal = [line for line in lines if line.startswith("mujoco.FatalError")]
    trouble = None if ended is not None or not lines else (fatal or lines)[-1]
    return trouble, None if ended is None else float(ended[1])


def _refuse_missing() -> None:
    """Raise OutputError with a remedy if the package mujoco is missing or too old."""
    if find_spec("mujoco") is None:
        raise OutputError(f"mujoco is not installed; {INSTALL}")
    installed = version("mujoco")
    if int(installed.split(".", maxsplit=1)[0]) < OLDEST:
        raise OutputError(
            f"mujoco {installed} stretches films with a quarter of their modulus; version "
            f"{OLDEST}.0 does not; {INSTALL}"
        )
