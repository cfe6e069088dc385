"""The scenes of a design as files."""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path

from sbafab.laminate.laminate import Laminate
from sbafab.simulators.coarse.actuator import POISSON, CoarseActuator, actuator
from sbafab.simulators.coarse.rounds import why_not_round
from sbafab.simulators.sofa.frames import beam_scene, frames_scene
from sbafab.simulators.sofa.parts import NODAL_STIFFNESS, film_groups
from sbafab.simulators.sofa.shell_scene import shell_scene, volume_scene

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
    others = sorted({layer.film.material for layer in laminate.tpe_layers} - {"TPE"})
    if others:
        return (
            f"the SOFA scenes are of TPE alone; {laminate.name} has films of {', '.join(others)}, "
            "which CalculiX takes, and MuJoCo where all are alike"
        )
    return why_not_round(laminate)


def write_scenes(
    laminate: Laminate,
    folder: Path,
    pressures: Mapping[str, float] | None = None,
    volumes: Mapping[str, float] | None = None,
) -> list[Path]:
    """Writes the scenes of a laminate with all that they load; the files, the default one first.

    ``pressures`` in kPa and ``volumes`` (scene C, above its start) in ul, by chamber; chambers
    left out get 0. By default 5 kPa and some 80 ul in every chamber. Scene D needs three
    chambers. Raises DesignError where the pockets are not round or a chamber is unknown.
    """
    made = actuator(laminate, pressures)
    texts = {
        SHELL: shell_scene(made),
        FRAMES: frames_scene(made),
        VOLUME: volume_scene(made, volumes),
    }
    if made.stack.lobes >= LEAST_LOBES:
        texts[BEAM] = beam_scene(made)
    texts[DATA] = json.dumps(_data(made), separators=(",", ":")) + "\n"
    texts[PYTHON] = files("sbafab.simulators.sofa").joinpath("scene.py.txt").read_text("utf-8")
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8", newline="\n")
    return [folder / name for name in texts]


def _data(made: CoarseActuator) -> dict[str, object]:
    mesh = made.mesh
    membranes, bending = film_groups(made, mesh)
    groups = {
        kind: [
            {"name": name, "stiffness": float(f"{stiffness:.6g}"), "triangles": triangles}
            for name, triangles, stiffness in found
        ]
        for kind, found in (("membranes", membranes), ("bending", bending))
    }
    return {
        "schema": "sbafab/sofa@1",
        "name": made.stack.name,
        "units": {"length": "mm", "mass": "kg", "time": "s", "pressure": "kPa", "volume": "ul"},
        "position": mesh.position,
        "rest_position": mesh.rest,
        **groups,
        "poisson": POISSON,
        "cavities": dict(mesh.cavities),
        "pressures": dict(made.pressures),
        "fixed": mesh.fixed,
        "tip": mesh.tip,
        "true_mass": float(f"{made.mass:.4g}"),
        "nodal_mass_by_dt2": round(NODAL_STIFFNESS, 4),
    }
