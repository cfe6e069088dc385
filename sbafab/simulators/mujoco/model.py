"""The actuator as a MuJoCo model (MJCF): one body per node, one flex per group of films."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from sbafab.laminate.laminate import Laminate
from sbafab.simulators.coarse import CoarseActuator, nearly_flat, round_stack
from sbafab.simulators.model_files import model_file, write_files
from sbafab.simulators.simulator import RecordedFilms

TEMPLATES = Path(__file__).parent / "templates"
MODEL, DATA, PYTHON = "actuator.xml", "actuator.json", "inflate.py"
DT = 0.01
"""Time step, s. The integrator is implicit; a step four times as long works too."""
SOLVER_STEPS = 1000
"""Solver iterations per time step; the default of 100 is too few for long stacks."""
LENGTH = 10.0
"""Model length unit, mm. MuJoCo's film contact keeps films a thousandth of a unit apart and treats
them as at rest below a twentieth of a unit per second: with cm the gap is 0.01 mm, a quarter of a
film; with mm the solver needs forty times the iterations."""
START = "inflated"
SECTORS = 16
"""Nodes per ring. Eight, as in SOFA's scenes, take a quarter of the time and rise 13 % less."""
COLOURS = {
    "lower": "0.35 0.60 0.85 1",
    "upper": "0.55 0.75 0.95 1",
    "web": "0.20 0.35 0.60 1",
    "necks": "0.90 0.60 0.25 1",
}


def coarse_actuator(
    laminate: Laminate, pressures: Mapping[str, float], sectors: int = SECTORS
) -> CoarseActuator:
    """The coarse actuator of a laminate. Raises DesignError if its pockets are not round."""
    made = CoarseActuator(round_stack(laminate), sectors)
    # Films that fall far onto each other need many iterations.
    return replace(made, start=nearly_flat) if has_contact(pressures) else made


def has_contact(pressures: Mapping[str, float]) -> bool:
    """Return True if films touch: films of chambers with a lower pressure than others do."""
    return len(set(pressures.values())) > 1


def model_text(actuator: CoarseActuator, pressures: Mapping[str, float]) -> str:
    """The model as a file: node i is body ``n<i>``, which is flat unless the keyframe is loaded.

    Fixed are the nodes of the base, or the centre of a lone balloon, so that it bulges both ways,
    as in the CalculiX deck.
    """
    mesh, film = actuator.mesh, actuator.stack.film
    still = mesh.roots if actuator.balloons == 1 else mesh.fixed
    free = np.setdiff1d(np.arange(len(mesh.rest)), still)
    flexes = []
    for name, triangles, films in mesh.groups:
        # Flexes share bodies where films are bonded. In one an edge has at most two triangles.
        nodes, elements = np.unique(triangles, return_inverse=True)
        flex = {"name": name, "colour": COLOURS[name], "nodes": nodes.tolist()}
        flexes.append({**flex, "elements": elements, "thickness": films * film.thickness})
    return model_file(
        TEMPLATES / f"{MODEL}.j2",
        actuator.stack.name,
        actuator=actuator,
        contact=has_contact(pressures),
        places=(mesh.rest / LENGTH).round(9),
        moved=((mesh.position - mesh.rest)[free] / LENGTH).round(9),
        still=set(still.tolist()),
        masses=mesh.masses(film).tolist(),
        flexes=flexes,
        triangles=len(mesh.single) + len(mesh.double),
        height=mesh.height,
        length=LENGTH,
        dt=DT,
        solver_steps=SOLVER_STEPS,
        start=START,
    )


def write_model(
    laminate: Laminate, folder: Path, pressures: Mapping[str, float], sectors: int = SECTORS
) -> RecordedFilms:
    """Write the model, its cavities, and the script that inflates it; return its films.

    ``pressures`` in kPa by chamber; ``sectors`` is the number of nodes per ring. Raises
    DesignError if the pockets are not round.
    """
    coarse = coarse_actuator(laminate, pressures, sectors)
    mesh = coarse.mesh
    data = {
        "schema": "sbafab/mujoco@1",
        "name": coarse.stack.name,
        "units": {"length": "mm", "mass": "kg", "time": "s", "pressure": "kPa", "volume": "ul"},
        "length": LENGTH,
        "start": START,
        "pressures": dict(pressures),
        "films": 2 * coarse.balloons * coarse.stack.film.thickness,
        "cavities": {name: walls.tolist() for name, walls in mesh.cavities.items()},
        "tip": mesh.tip.tolist(),
        "roots": mesh.roots.tolist(),
        "poles": mesh.poles.tolist(),
    }
    texts = {
        MODEL: model_text(coarse, pressures),
        DATA: json.dumps(data, separators=(",", ":")) + "\n",
        PYTHON: (TEMPLATES / f"{PYTHON}.txt").read_text("utf-8"),
    }
    write_files(texts, folder)
    films = np.concatenate([triangles for _, triangles, _ in mesh.groups])
    walls = mesh.cavities
    return RecordedFilms(
        laminate, mesh.rest, mesh.position, films, walls, mesh.tip, mesh.poles, pressures
    )
