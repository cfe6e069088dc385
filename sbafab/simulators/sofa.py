"""SOFA: the films of an actuator, its three scenes from templates, and their run with runSofa."""

from __future__ import annotations

import json
import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from sbafab.errors import DesignError
from sbafab.laminate.films import density_of
from sbafab.laminate.laminate import Laminate
from sbafab.meshing.conforming.layup import Layup, MeshSettings, layup, narrowest_ring
from sbafab.meshing.conforming.mesh import Mesh, volumes
from sbafab.meshing.conforming.meshes import shell_mesh, thin
from sbafab.meshing.surface import Floats, Ints
from sbafab.runtime import Progress
from sbafab.simulators.shell_model import (
    FilmGroup,
    Meridian,
    RoundStack,
    Shell,
    Start,
    Triangles,
    coarse_shell,
    elastic_of,
    holding,
    nearly_flat,
    pocket_radii,
    round_stack,
    why_not_round,
)
from sbafab.simulators.simulator import (
    DEFAULT_PRESSURE,
    NODES_FILE,
    PERIOD,
    RAMP,
    RecordedFilms,
    Result,
    SimulationRequest,
    chamber_pressures,
    model_file,
    program_path,
    refuse_time,
    refuse_unknown,
    run_model,
    template_text,
    write_files,
)

# Stacks of round pockets use the coarse shell, others the conforming mesh.


SECTORS = 12
"""Nodes per ring in scene A. From 8 to 12 the height grows by 6.6 %, from 12 to 16 by 2.2 %."""
COARSE_SECTORS = 8
"""Nodes per ring in the other scenes."""


def half_full(pocket: float, neck: float) -> Meridian:
    """The shape at 7.5 ul in a pocket of 5 mm; 15 balloons then reach 5 kPa with 80 ul more."""
    return holding(neck, pocket - neck, 7.5 * (pocket / 2.5) ** 3)


def round_shell(stack: RoundStack, sectors: int = SECTORS, start: Start = nearly_flat) -> Shell:
    """Return the shell of a stack of round pockets; its rings have the area of the circles."""
    return coarse_shell(stack, sectors, start, is_fair=True)


# The shell of any laminate, from its conforming mesh: drawn pockets, several films, tubes.


STEPS_ACROSS = 3.0
"""Triangle sides across the smallest pocket's radius, unless its bonds are narrower."""


def conforming_shell(laminate: Laminate) -> Shell:
    """Return the shell of a laminate, initially flat; a radial one is wrapped around its tube.

    The mouths of inlets are open and free. Raises DesignError if a film's modulus is unknown, or
    the mesher is not installed.
    """
    for layer in laminate.tpe_layers:
        elastic_of(layer.film)
    radii = pocket_radii(laminate)
    side = min(radii) / STEPS_ACROSS
    ring = narrowest_ring(laminate)
    h = side if ring is None else min(side, ring[0])
    stack = thin(layup(laminate, MeshSettings(h, wrapped=False)))
    mesh = shell_mesh(stack)
    # Mid-edge nodes are left out.
    used, corners = np.unique(mesh.cells[:, :3], return_inverse=True)
    corners = corners.reshape(-1, 3)
    number = np.full(len(mesh.points), -1)
    number[used] = np.arange(len(used))
    membranes, bending, mass = _films(stack, mesh, corners)
    # Adding 0.0 turns a rounded -0.0 into 0.0.
    rest = position = mesh.points[used].round(6) + 0.0
    start = "flat"
    if laminate.tube is not None:
        start = f"wrapped round a tube of {laminate.tube:.4g} mm, whose axis is z"
        on_tube = replace(stack, settings=MeshSettings(h))
        position = shell_mesh(on_tube).points[used].round(6) + 0.0
    base = number[mesh.node_sets["base"]]
    cavities = {}
    for chamber in laminate.chambers:
        cell, side_of = mesh.face_sets[f"cavity_{chamber.name}"].T
        walls = corners[cell]
        # Face 0 of a triangle faces down, face 1 up, each into the air that touches it; normals of
        # a cavity point out of the air.
        cavities[chamber.name] = np.where(side_of[:, None] == 0, walls, walls[:, ::-1])
    return Shell(
        rest=rest,
        position=position,
        membranes=tuple(membranes),
        bending=tuple(bending),
        cavities=cavities,
        fixed=base[base >= 0],
        tip=number[_marks(stack, mesh, number)],
        mass=mass,
        size=max(radii) / 2.5,
        about=(
            f"{len(rest)} nodes, {len(corners)} triangles, inlets and their strips among them.\n"
            f"It starts {start}."
        ),
        roots=base[:0],
        poles=base[:0],
    )


def _films(
    stack: Layup, mesh: Mesh, corners: Triangles
) -> tuple[list[FilmGroup], list[FilmGroup], float]:
    """Return the membranes and the bending groups of the films, and their mass in kg.

    In a bending group no edge has more than two triangles: cells with the same lowest film lie side
    by side, and separate films share a group if they share no node.
    """
    stretch, mass, ratio, thickness = sums = np.zeros((4, len(corners)))
    lowest = np.zeros(len(corners))
    for k, ply in reversed([*enumerate(stack.plies)]):
        of_ply, t = mesh.cell_sets[ply.name], ply.thickness
        young, poisson = elastic_of(ply.layer.film)
        dense = density_of(ply.layer.film, "a simulation")
        sums[:, of_ply] += np.array([[1000 * young * t], [1e-9 * dense * t], [poisson * t], [t]])
        lowest[of_ply] = k
    ratio = (ratio / thickness).round(12)
    bend = (stretch * thickness**2 / (12 * (1 - ratio**2))).round(12)
    membranes = [
        FilmGroup(f"membrane{n}", triangles, e_t, poisson)
        for n, (triangles, (e_t, poisson)) in enumerate(_kinds(corners, stretch, ratio), start=1)
    ]
    groups: list[FilmGroup] = []
    for triangles, (stiffness, _) in _kinds(corners, bend, lowest):
        for place, (name, others, other, _) in enumerate(groups):
            if other == stiffness and not np.isin(triangles, others).any():
                together = np.concatenate([others, triangles])
                groups[place] = FilmGroup(name, together, stiffness, 0.0)
                break
        else:
            groups.append(FilmGroup(f"bend{len(groups) + 1}", triangles, stiffness, 0.0))
    total = float(volumes(mesh.kind, mesh.points, mesh.cells) @ mass)
    return membranes, groups, total


def _kinds(
    corners: Triangles, *properties: Floats
) -> Iterator[tuple[Triangles, tuple[float, ...]]]:
    """Yield the triangles with equal properties, and these properties."""
    rows = np.column_stack(properties).round(12)
    kinds, kind = np.unique(rows, axis=0, return_inverse=True)
    for n, values in enumerate(kinds.tolist()):
        yield corners[kind.ravel() == n], tuple(values)


def _marks(stack: Layup, mesh: Mesh, number: Ints) -> list[int]:
    """Nodes of the highest film: the axes of three or more stacks, or four around its middle."""
    top = mesh.node_sets["tip"]
    top = top[number[top] >= 0]
    places = mesh.points[top][:, :2]
    marks = np.array(stack.centres)
    if len(marks) < 3:
        middle = marks.mean(axis=0)
        reach = np.abs(places - middle).max()
        marks = middle + reach * np.array([(1, 0), (0, 1), (-1, 0), (0, -1)])
    away = np.linalg.norm(places[:, None] - marks, axis=2)
    return [int(node) for node in top[away.argmin(axis=0)]]


# The files of scenes.


SceneName = Literal["shell", "frames", "volume"]
DATA, PYTHON = "actuator.json", "scene.py"

PLUGINS = {
    "AMDOrderingMethod": "Sofa.Component.LinearSolver.Ordering",
    "CGLinearSolver": "Sofa.Component.LinearSolver.Iterative",
    "EulerImplicitSolver": "Sofa.Component.ODESolver.Backward",
    "FastTriangularBendingSprings": "Sofa.Component.SolidMechanics.Spring",
    "FixedProjectiveConstraint": "Sofa.Component.Constraint.Projective",
    "FreeMotionAnimationLoop": "Sofa.Component.AnimationLoop",
    "GenericConstraintSolver": "Sofa.Component.Constraint.Lagrangian.Solver",
    "LinearSolverConstraintCorrection": "Sofa.Component.Constraint.Lagrangian.Correction",
    "MechanicalObject": "Sofa.Component.StateContainer",
    "SkinningMapping": "Sofa.Component.Mapping.Linear",
    "SparseLDLSolver": "Sofa.Component.LinearSolver.Direct",
    "SubsetMapping": "Sofa.Component.Mapping.Linear",
    "SurfacePressureConstraint": "SoftRobots",
    "SurfacePressureForceField": "Sofa.Component.MechanicalLoad",
    "TriangleSetTopologyContainer": "Sofa.Component.Topology.Container.Dynamic",
    "TriangularFEMForceFieldOptim": "Sofa.Component.SolidMechanics.FEM.Elastic",
    "UniformMass": "Sofa.Component.Mass",
    "WriteState": "Sofa.Component.Playback",
}
"""The plugin that provides each component; DefaultAnimationLoop is built into SOFA."""


@dataclass(frozen=True, eq=False)
class Scene:
    """A scene: its time step ``dt`` in s, and the values of the template of its name."""

    name: SceneName
    dt: float
    films: RecordedFilms
    values: Mapping[str, object]

    @property
    def file(self) -> str:
        return "actuator.scn" if self.name == "shell" else f"actuator_{self.name}.scn"

    def text(self, record: bool = False) -> str:
        """Return the scene as a file, with a record of all nodes of its films if ``record``."""
        films = self.films
        values = {"dt": self.dt, "ramp": RAMP, "period": PERIOD, "nodes_file": NODES_FILE}
        values |= {"shell": films.shell, "pressures": films.pressures, "record": record}
        name = films.laminate.name
        return model_file(f"{self.name}.j2", name, _add_plugins, **values, **self.values)


def _add_plugins(root: ET.Element) -> None:
    plugins = {PLUGINS[each.tag] for each in root.iter() if each.tag in PLUGINS}
    for place, plugin in enumerate(sorted(plugins)):
        root.insert(place, ET.Element("RequiredPlugin", {"name": plugin}))


# Scenes A and C: every film as a shell, driven by pressure or by volume.


DT = 0.02
NODAL_BY_PRESSURE = 3.0
"""mN/mm per kPa: nodal mass / dt^2 in pockets of 5 mm. A step's matrix lacks the stiffness from air
pressure; a tenth of this value is stable too, but a long stack then swings for longer."""
LEAST_NODAL = 8.0
"""Least value in mN/mm, for low pressures."""
VOLUME = 80.0
"""Volume in ul above the start in a chamber of 15 balloons of 5 mm."""
VOLUME_PRESSURE = 10.0
"""Design pressure in kPa of scene C's mass; its actual pressures are not known in advance."""


def nodal_stiffness(highest: float, size: float) -> float:
    """Return nodal mass / dt^2 in mN/mm at which a shell under a pressure in kPa is stable."""
    return max(LEAST_NODAL, NODAL_BY_PRESSURE * highest * size)


def _mass(shell: Shell, highest: float) -> dict[str, float]:
    """The artificial mass in kg that stabilises a shell under the highest pressure in kPa."""
    mass = nodal_stiffness(highest, shell.size) * len(shell.rest) * DT**2
    return {"highest": highest, "mass": mass}


def usual_volume(stack: RoundStack) -> float:
    """Return the default volume in ul above the start of a chamber."""
    return float(f"{VOLUME * stack.balloons / 15 * stack.size**3:.3g}")


def imposed_volumes(stack: RoundStack, volumes: Mapping[str, float] | None) -> dict[str, float]:
    """The volume in ul of each chamber above its start; chambers that are not named have 0."""
    if volumes is None:
        return dict.fromkeys(stack.chambers, usual_volume(stack))
    refuse_unknown(stack.chambers, volumes, "volume")
    for name, value in volumes.items():
        if not 0 <= value < math.inf:
            raise DesignError(
                f"volume of {name} = {value:g} ul must be at least 0; vacuum is untested"
            )
    return {name: volumes.get(name, 0.0) for name in stack.chambers}


# Scene B: nine frames on the backbone that carry the films.


FRAMES = 9
"""Reference frames on the backbone (paper, Sec. 3.2.2), if the stack has enough balloons: at most
as many as levels, or a balloon would wave."""
FRAMES_DT = 0.05
SOFTENING = 0.12
"""Share of the true modulus at which 5 kPa lift 15 balloons as high as in scene A."""


def _framed(stack: RoundStack, shell: Shell) -> dict[str, object]:
    count = min(FRAMES, stack.balloons + 1)
    weights = [pair_of_frames(z, shell.height, count) for z in shell.position[:, 2].tolist()]
    values = {"frames": count, "weights": weights, "poisson": stack.poisson}
    return {**values, "membrane": stack.membrane, "share": SOFTENING}


def pair_of_frames(
    z: float, height: float, frames: int = FRAMES
) -> tuple[tuple[int, int], tuple[float, float]]:
    """Return the two frames next to a height and their weights, the nearer one first.

    SkinningMapping reads a node's weights up to the first 0, so a 0 must come last.
    """
    place = z / height * (frames - 1)
    below = min(frames - 2, max(0, math.floor(place)))
    above = round(place - below, 6)
    if above > 0.5:
        return (below + 1, below), (above, round(1 - above, 6))
    return (below, below + 1), (round(1 - above, 6), above)


# The scenes of a design.


def scenes_of(
    laminate: Laminate, pressures: Mapping[str, float], volumes: Mapping[str, float] | None = None
) -> dict[str, Scene]:
    """Return the scenes of a laminate by name, the default one first.

    ``pressures`` in kPa by chamber; ``volumes`` (scene C, above its start) in ul by chamber, 0 for
    omitted ones, by default about 80 ul in each. Scenes B and C require round pockets of one film.
    Raises DesignError if a chamber is unknown, or if other pockets need a mesher that is not
    installed.
    """
    stack = None if why_not_round(laminate) else round_stack(laminate)
    shell = conforming_shell(laminate) if stack is None else round_shell(stack)

    def films(shell: Shell) -> RecordedFilms:
        return RecordedFilms(laminate, shell, shell.tip, pressures, pressures.values())

    scenes = [Scene("shell", DT, films(shell), _mass(shell, max(pressures.values())))]
    if stack is not None:
        # Nine frames cannot draw in a pocket's edge, so the start must not have it drawn in either.
        framed = round_shell(stack, COARSE_SECTORS, nearly_flat)
        scenes.append(Scene("frames", FRAMES_DT, films(framed), _framed(stack, framed)))
        imposed = imposed_volumes(stack, volumes)
        half = round_shell(stack, COARSE_SECTORS, half_full)
        by_volume = RecordedFilms(laminate, half, half.tip, {}, imposed.values())
        values = {"volumes": imposed, "usual": usual_volume(stack)}
        scenes.append(Scene("volume", DT, by_volume, {**values, **_mass(half, VOLUME_PRESSURE)}))
    return {scene.name: scene for scene in scenes}


def write_scenes(scenes: Mapping[str, Scene], folder: Path) -> list[Path]:
    """Write the scenes of a design and the files they load; return them, the default one first."""
    texts = {scene.file: scene.text() for scene in scenes.values()}
    texts[DATA] = json.dumps(_data(scenes["shell"]), separators=(",", ":")) + "\n"
    texts[PYTHON] = template_text(f"{PYTHON}.txt")
    return write_files(texts, folder)


def _data(scene: Scene) -> dict[str, object]:
    shell, pressures = scene.films.shell, scene.films.pressures
    return {
        "schema": "sbafab/sofa@1",
        "name": scene.films.laminate.name,
        "units": {"length": "mm", "mass": "kg", "time": "s", "pressure": "kPa", "volume": "ul"},
        "position": shell.position.tolist(),
        "rest_position": shell.rest.tolist(),
        "membranes": [_group(group) for group in shell.membranes],
        "bending": [_group(group) for group in shell.bending],
        "cavities": {name: walls.tolist() for name, walls in shell.cavities.items()},
        "pressures": dict(pressures),
        "fixed": shell.fixed.tolist(),
        "tip": shell.tip.tolist(),
        "true_mass": float(f"{shell.mass:.4g}"),
        "nodal_mass_by_dt2": round(nodal_stiffness(max(pressures.values()), shell.size), 4),
    }


def _group(group: FilmGroup) -> dict[str, object]:
    return {
        "name": group.name,
        "stiffness": float(f"{group.stiffness:.6g}"),
        "poisson": group.poisson,
        "triangles": group.triangles.tolist(),
    }


# The interface of a simulator: a scene run with runSofa in batch.


RECORDED_SCENE = "recorded.scn"
SECONDS = 8.0
USES = ("scene", "seconds", "volumes")


def why_not(laminate: Laminate) -> str | None:
    """Return why no scene can be made: the modulus of a film is unknown."""
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
        raise DesignError("--volume is for --scene volume; the other scenes use pressures")
    scenes = export(laminate, request, folder)
    scene = scenes.get(request.scene or "shell")
    if scene is None:
        raise DesignError(
            f"scene {request.scene} is for round pockets of one film: {why_not_round(laminate)}; "
            "use scene shell"
        )
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


# The log of SOFA, whose exit code is 0 even when the numbers have gone.


TROUBLE = re.compile(r"\[ERROR\]|\bnan\b|Division by zero|Null determinant", re.IGNORECASE)
NO_PLUGIN = re.compile(r"\[ERROR\].*Plugin not found: \"([^\"]*)\"")
NEEDED = re.compile(r'<RequiredPlugin name="([^"]*)"')
DONE = re.compile(r"iterations done in \S+ s \(\s*(\S+) FPS\s*\)")


def read_log(text: str, plugins: list[str]) -> tuple[str | None, float | None]:
    """Return the first error of a run whose scene needs these plugins, and its steps per s.

    Other plugins may be missing.
    """

    def voids(line: str) -> bool:
        missing = NO_PLUGIN.search(line)
        return missing is None or missing[1] in plugins

    lines = (line.strip() for line in text.splitlines() if TROUBLE.search(line))
    done = DONE.search(text)
    return next(filter(voids, lines), None), None if done is None else float(done[1])
