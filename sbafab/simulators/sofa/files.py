"""The scenes of a design as files."""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path

from sbafab.errors import DesignError
from sbafab.laminate.laminate import Laminate
from sbafab.simulators.coarse.rounds import elastic_of, why_not_round
from sbafab.simulators.sofa.conforming import conforming_shell
from sbafab.simulators.sofa.scenes import (
    FRAMES_START,
    beam_scene,
    frames_scene,
    nodal_stiffness,
    shell_scene,
    volume_scene,
)
from sbafab.simulators.sofa.shell import (
    COARSE_SECTORS,
    FilmGroup,
    Shell,
    half_full,
    round_actuator,
    round_shell,
)

SHELL, FRAMES, VOLUME, BEAM = (
    "actuator.scn",
    "actuator_frames.scn",
    "actuator_volume.scn",
    "actuator_beam.scn",
)
DATA, PYTHON = "actuator.json", "scene.py"
LEAST_LOBES = 3
"""A beam of fewer chambers bends by none, or one way only."""


def why_no_scene(laminate: Laminate) -> str | None:
    """The reason why no scene can be written for a laminate, or None."""
    try:
        for layer in laminate.tpe_layers:
            elastic_of(layer.film)
    except DesignError as reason:
        return str(reason)
    return None


def write_scenes(
    laminate: Laminate,
    folder: Path,
    pressures: Mapping[str, float] | None = None,
    volumes: Mapping[str, float] | None = None,
) -> list[Path]:
    """Writes the scenes of a laminate with all that they load; the files, the default one first.

    ``pressures`` in kPa and ``volumes`` (scene C, above its start) in ul, by chamber; chambers
    left out get 0. By default 5 kPa and some 80 ul in every chamber. Scenes B and C are for round
    pockets of one film, scene D for three chambers of them or more. Raises DesignError where a
    chamber is unknown, and for other pockets where the mesher is not installed.
    """
    texts = {}
    if why_not_round(laminate) is None:
        shell = round_shell(round_actuator(laminate, pressures))
        frames = round_actuator(laminate, pressures, COARSE_SECTORS, FRAMES_START)
        volume = round_actuator(laminate, pressures, COARSE_SECTORS, half_full)
        texts = {SHELL: shell_scene(shell), FRAMES: frames_scene(frames)}
        texts[VOLUME] = volume_scene(volume, volumes)
        if frames.stack.lobes >= LEAST_LOBES:
            texts[BEAM] = beam_scene(frames)
    else:
        shell = conforming_shell(laminate, pressures)
        texts = {SHELL: shell_scene(shell)}
    texts[DATA] = json.dumps(_data(shell), separators=(",", ":")) + "\n"
    texts[PYTHON] = files("sbafab.simulators.sofa").joinpath("scene.py.txt").read_text("utf-8")
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8", newline="\n")
    return [folder / name for name in texts]


def _data(shell: Shell) -> dict[str, object]:
    highest = max(shell.pressures.values())
    return {
        "schema": "sbafab/sofa@1",
        "name": shell.name,
        "units": {"length": "mm", "mass": "kg", "time": "s", "pressure": "kPa", "volume": "ul"},
        "position": shell.position,
        "rest_position": shell.rest,
        "membranes": [_group(group) for group in shell.membranes],
        "bending": [_group(group) for group in shell.bending],
        "cavities": dict(shell.cavities),
        "pressures": dict(shell.pressures),
        "fixed": shell.fixed,
        "tip": shell.tip,
        "true_mass": float(f"{shell.mass:.4g}"),
        "nodal_mass_by_dt2": round(nodal_stiffness(highest, shell.size), 4),
    }


def _group(group: FilmGroup) -> dict[str, object]:
    return {
        "name": group.name,
        "stiffness": float(f"{group.stiffness:.6g}"),
        "poisson": group.poisson,
        "triangles": group.triangles,
    }
