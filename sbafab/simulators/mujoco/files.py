"""The model of a design as files."""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path

from sbafab.laminate.laminate import Laminate
from sbafab.simulators.coarse.actuator import CoarseActuator, actuator
from sbafab.simulators.coarse.rounds import why_not_round
from sbafab.simulators.mujoco.model import START, model_text

MODEL, DATA, PYTHON = "actuator.xml", "actuator.json", "inflate.py"
SECTORS = 16
"""Nodes of a ring. Eight, as in SOFA's scenes, take a quarter of the time and rise by 13 % less."""


def why_no_model(laminate: Laminate) -> str | None:
    """The reason why no model can be written for a laminate, or None."""
    return why_not_round(laminate)


def write_model(
    laminate: Laminate,
    folder: Path,
    pressures: Mapping[str, float] | None = None,
    sectors: int = SECTORS,
) -> list[Path]:
    """Writes the model, what its pressures act on, and a script to start from; the model first.

    ``pressures`` in kPa by chamber, 0 for those left out, or 5 kPa everywhere; ``sectors`` nodes
    make a ring. Raises DesignError where the pockets are not round or a chamber is unknown.
    """
    made = actuator(laminate, pressures, sectors)
    texts = {
        MODEL: model_text(made),
        DATA: json.dumps(_data(made), separators=(",", ":")) + "\n",
        PYTHON: files("sbafab.simulators.mujoco").joinpath("inflate.py.txt").read_text("utf-8"),
    }
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8", newline="\n")
    return [folder / name for name in texts]


def _data(made: CoarseActuator) -> dict[str, object]:
    mesh = made.mesh
    return {
        "schema": "sbafab/mujoco@1",
        "name": made.stack.name,
        "units": {"length": "mm", "mass": "kg", "time": "s", "pressure": "kPa", "volume": "ul"},
        "start": START,
        "pressures": dict(made.pressures),
        "cavities": dict(mesh.cavities),
        "tip": mesh.tip,
        "roots": mesh.roots,
        "poles": mesh.poles,
    }
