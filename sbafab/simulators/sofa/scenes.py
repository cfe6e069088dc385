"""The four scenes of SOFA as text, and the files of a design."""

from __future__ import annotations

import json
import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

from sbafab.errors import DesignError
from sbafab.geometry.edges import Point
from sbafab.laminate.laminate import Laminate
from sbafab.meshing.surface import Vector
from sbafab.simulators.coarse.rounds import elastic_of, why_not_round
from sbafab.simulators.coarse.shell import (
    CoarseActuator,
    CoarseMesh,
    Triangle,
    nearly_flat,
    standing,
)
from sbafab.simulators.sofa.shell import (
    COARSE_SECTORS,
    FilmGroup,
    Shell,
    conforming_shell,
    film_groups,
    half_full,
    round_actuator,
    round_shell,
)

Attribute = str | float | int | Sequence[float] | Sequence[Sequence[float]]

PLUGINS = {
    "AMDOrderingMethod": "Sofa.Component.LinearSolver.Ordering",
    "BeamFEMForceField": "Sofa.Component.SolidMechanics.FEM.Elastic",
    "CGLinearSolver": "Sofa.Component.LinearSolver.Iterative",
    "EulerImplicitSolver": "Sofa.Component.ODESolver.Backward",
    "FastTriangularBendingSprings": "Sofa.Component.SolidMechanics.Spring",
    "FixedProjectiveConstraint": "Sofa.Component.Constraint.Projective",
    "FreeMotionAnimationLoop": "Sofa.Component.AnimationLoop",
    "GenericConstraintSolver": "Sofa.Component.Constraint.Lagrangian.Solver",
    "LinearSolverConstraintCorrection": "Sofa.Component.Constraint.Lagrangian.Correction",
    "MechanicalObject": "Sofa.Component.StateContainer",
    "MeshTopology": "Sofa.Component.Topology.Container.Constant",
    "RigidMapping": "Sofa.Component.Mapping.NonLinear",
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


def root_node(dt: float) -> ET.Element:
    """The root of a scene: no gravity, time step in s."""
    return ET.Element("Node", {"name": "root", "dt": number(dt), "gravity": "0 0 0"})


def child(parent: ET.Element, name: str) -> ET.Element:
    return ET.SubElement(parent, "Node", {"name": name})


def add(parent: ET.Element, component: str, **fields: Attribute) -> None:
    """Adds a component with its data fields, in this order."""
    ET.SubElement(parent, component, {name: text(value) for name, value in fields.items()})


def text(value: Attribute) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, int | float):
        return number(value)
    return " ".join(number(each) for each in _flat(value))


def number(value: float) -> str:
    """Format with nine digits, and no minus before a zero."""
    return f"{value + 0.0:.9g}"


def _flat(values: Iterable[float | Sequence[float]]) -> Iterable[float]:
    for value in values:
        if isinstance(value, int | float):
            yield value
        else:
            yield from value


def document(root: ET.Element, comment: str) -> str:
    """The scene as a file: the comment, the required plugins, its nodes."""
    used = {element.tag for element in root.iter()}
    plugins = sorted({PLUGINS[tag] for tag in used if tag in PLUGINS})
    for place, plugin in enumerate(plugins):
        root.insert(place, ET.Element("RequiredPlugin", {"name": plugin}))
    ET.indent(root, " ")
    if "--" in comment:
        raise ValueError("an XML comment cannot hold two hyphens in a row")
    body = ET.tostring(root, encoding="unicode")
    return f'<?xml version="1.0"?>\n<!--\n{comment.strip()}\n-->\n{body}\n'


# Parts shared by several scenes: films, pressures, the tip's record.


NODAL_BY_PRESSURE = 3.0
"""mN/mm per kPa: nodal mass / dt^2 in pockets of 5 mm. A step's matrix lacks the stiffness from air
pressure; a tenth of this value is stable too, but a long stack then swings for longer."""
LEAST_NODAL = 8.0
"""Least value in mN/mm, for low pressures."""
TIP_FILE = "tip.state"
TIP_PERIOD = 0.1
"""Recording interval of the tip, s."""
RAMP = 1.0
"""Duration of the pressure ramp from 0, s."""


def nodal_stiffness(highest: float, size: float) -> float:
    """Nodal mass / dt^2 in mN/mm at which a shell under a pressure in kPa is stable."""
    return max(LEAST_NODAL, NODAL_BY_PRESSURE * highest * size)


def scaled_mass(shell: Shell, dt: float, highest: float | None = None) -> float:
    """Artificial mass in kg that keeps the shell stable at a time step in s.

    ``highest`` is the design pressure in kPa, by default the highest requested.
    """
    most = max(shell.pressures.values()) if highest is None else highest
    return nodal_stiffness(most, shell.size) * len(shell.rest) * dt**2


def _film(node: ET.Element, group: FilmGroup) -> ET.Element:
    """Return a child node of the scene with the triangles of a group of films."""
    film = child(node, group.name)
    add(film, "TriangleSetTopologyContainer", name="t", triangles=group.triangles)
    return film


def add_films(
    node: ET.Element,
    membranes: Iterable[FilmGroup],
    bending: Iterable[FilmGroup],
    share: float = 1.0,
) -> None:
    """The films' elasticity, with ``share`` of the true modulus, one child node per group."""
    for group in membranes:
        add(
            _film(node, group),
            "TriangularFEMForceFieldOptim",
            template="Vec3",
            topology="@t",
            youngModulus=round(group.stiffness * share, 6),
            poissonRatio=group.poisson,
        )
    for group in bending:
        add(
            _film(node, group),
            "FastTriangularBendingSprings",
            template="Vec3",
            topology="@t",
            bendingStiffness=float(f"{group.stiffness * share:.3g}"),
        )


def add_pressure(
    node: ET.Element, name: str, triangles: Sequence[Triangle], pressure: float
) -> None:
    """A chamber's pressure in kPa: raised within one second, then held."""
    chamber = child(node, name)
    add(chamber, "TriangleSetTopologyContainer", name="c", triangles=triangles)
    ramp = {
        "pulseMode": "1",
        "pressureSpeed": number(pressure / RAMP),
        "pressureLowerBound": number(pressure * (1 - 1e-6)),
    }
    add(
        chamber,
        "SurfacePressureForceField",
        template="Vec3",
        topology="@c",
        pressure=pressure,
        **(ramp if pressure > 0 else {}),
        useTangentStiffness="0",
    )


def add_tip(node: ET.Element, nodes: Sequence[int]) -> None:
    """Records the positions of the tip's nodes ten times a second."""
    tip = child(node, "tip")
    add(tip, "MechanicalObject", template="Vec3")
    add(tip, "SubsetMapping", handleTopologyChange="0", indices=nodes)
    add(
        tip,
        "WriteState",
        filename=TIP_FILE,
        writeX="1",
        writeV="0",
        writeF="0",
        period=TIP_PERIOD,
        time="0",
    )


# The comment at the top of every scene: contents, and the scaled, fitted or artificial values.


UNITS = "Units: mm, kg, s; so force mN, pressure and modulus kPa, volume ul."
HEIGHTS = "Heights are of mid-surfaces: add the films' thickness to compare with a real one."
LEFT_OUT = "Not in it: gravity, contact of films and balloons."
HALT = """\
runSofa ends with exit code 0 even when the numbers have gone. The run is void if the log shows
Null determinant, Division by zero, NaN or [ERROR], or if the tip stands at 0, higher than its
films reach, or aslant where all chambers are alike."""
MEASURED = "What it gives, at how many steps/s, stands in docs/sofa.md of sbafab."


def shell_note(shell: Shell, dt: float) -> str:
    """Head of scene A."""
    return f"""\
{_head(shell.name, "A: the whole actuator as a shell, core components only.")}
{_mesh(shell)}

Pressure: each chamber has its own SurfacePressureForceField; pressure and pressureLowerBound
(just below it) are what it holds, pressureSpeed how fast it gets there in kPa/s.
{_stretch(shell)}
{_mass(shell, dt, max(shell.pressures.values()))}
{LEFT_OUT}
{MEASURED}
{HALT}"""


def frames_note(actuator: CoarseActuator, dt: float, share: float) -> str:
    """Head of scene B."""
    mesh = actuator.mesh
    return f"""\
{_head(actuator.stack.name, "B: nine reference frames that carry the films (as the paper has it).")}
Mesh: {len(mesh.rest)} nodes, {mesh.height:.4g} mm high at the start; rest_position is flat.
{HEIGHTS}

The films move with nine frames of six degrees of freedom through a SkinningMapping with explicit
weights, linear in z. It reads a node's weights up to the first that is 0.
FITTED: nine frames cannot draw the pockets' edges in and are far too stiff with the true modulus.
Here E is {share:g} of the true one, so that 5 kPa in each chamber of the 3-DoF actuator lift it
as high as scene A: E t is {share * actuator.membrane:.4g} instead of {actuator.membrane:g}, and
bending stiffness likewise.
True mass, {actuator.mass:.3g} kg; dt {dt:g} s.
ARTIFICIAL: the solver's Rayleigh damping.
{LEFT_OUT}
Needs calibration against scene A or a measurement: not predictive. {MEASURED}
{HALT}"""


def volume_note(shell: Shell, dt: float, usual: float, pressure: float) -> str:
    """Head of scene C."""
    return f"""\
{_head(shell.name, "C: scene A, coarser, driven by volume. Needs the plugin SoftRobots.")}
Take a release of SoftRobots that matches that of SOFA.
{_mesh(shell)}

value is what the chamber holds above its start, in ul, met exactly and without a ramp; {usual:g}
stands in for 80 ul in 15 balloons of 5 mm. valueType="pressure" would take pressure x dt: 0.1 is
5 kPa at dt 0.02.
{_stretch(shell)}
{_mass(shell, dt, pressure)}
{LEFT_OUT}
{MEASURED}
{HALT}"""


def beam_note(
    actuator: CoarseActuator, height: float, area: float, spring: float, dt: float
) -> str:
    """Head of scene D."""
    return f"""\
{_head(actuator.stack.name, "D: a SURROGATE for control loops: nine frames as a beam.")}
No film bears anything here: it is only shown. Pressure acts on closed prisms, one a chamber,
carried by the frames; the beam has the stiffness of the chambers' springs on their axes.
{HEIGHTS}
FITTED at 5 kPa to scene A, for 15 balloons of 5 mm, and SCALED to this design: area dV/dH
{area:.4g} mm2 and spring k {spring:.4g} mN/mm a chamber, H0 {height:.4g} mm without pressure.
EA = N k H0 and EI = N k R^2 H0 / 2, R the distance of the chambers from the axis.
ARTIFICIAL: 1000 times the true mass of {actuator.mass:.3g} kg keeps it upright at 10 kPa; damping.
dt {dt:g} s.
{LEFT_OUT}
Needs calibration against scene A or a measurement: not predictive. {MEASURED}
{HALT}"""


def _head(name: str, title: str) -> str:
    # Two hyphens in a row would end an XML comment.
    return f"{name.replace('--', '- -')}: SOFA scene {title}\n{UNITS}"


def _mesh(shell: Shell) -> str:
    at_rest = "rest_position is flat, where the film is free of stress."
    return f"Mesh: {shell.about}\n{at_rest}\n{HEIGHTS}"


def _stretch(shell: Shell) -> str:
    values = ", ".join(f"{group.stiffness:.6g}" for group in shell.membranes)
    return f"SCALED: E t stands in for youngModulus (the element has no thickness): {values}."


def _mass(shell: Shell, dt: float, highest: float) -> str:
    mass = scaled_mass(shell, dt, highest)
    return (
        f"ARTIFICIAL: mass. The true one, {shell.mass:.3g} kg, jitters to NaN; totalMass is "
        f"{mass / shell.mass:.3g} times it:\nnodal mass / dt^2 = "
        f"{mass / len(shell.rest) / dt**2:.3g} mN/mm, enough for {highest:g} kPa. Change it with "
        f"pressure and dt ({dt:g} s).\nTransients and settling times are therefore artificial; so "
        "is the damping. Only the\nstate at rest means something."
    )


# Scenes A and C: every film as a shell, driven by pressure or by volume.


DT = 0.02
VOLUME = 80.0
"""Volume in ul above the start in a chamber of 15 balloons of 5 mm."""
VOLUME_PRESSURE = 10.0
"""Design pressure in kPa of scene C's mass; its actual pressures are not known in advance."""
STEPS = 25
"""Maximum solver iterations per time step. The solver converges over several time steps."""


def shell_scene(shell: Shell) -> str:
    """A: core components only; one pressure per chamber."""
    root = root_node(DT)
    add(root, "DefaultAnimationLoop")
    node = child(root, "sba")
    add(node, "EulerImplicitSolver", rayleighStiffness=0.05, rayleighMass=2)
    # Without a matrix: SOFA 25.06 omits every fourth node from the bending springs' matrix.
    add(
        node,
        "CGLinearSolver",
        template="GraphScattered",
        iterations=STEPS,
        tolerance="1e-6",
        threshold="1e-14",
    )
    _add_bodies(node, shell, scaled_mass(shell, DT))
    add_films(node, shell.membranes, shell.bending)
    for name, triangles in shell.cavities:
        add_pressure(node, name, triangles, shell.pressures[name])
    add_tip(node, shell.tip)
    return document(root, shell_note(shell, DT))


def volume_scene(actuator: CoarseActuator, volumes: Mapping[str, float] | None = None) -> str:
    """C: each chamber has a given volume in ul above the start (plugin SoftRobots).

    ``volumes`` by chamber, 0 for omitted ones. Raises DesignError for an unknown chamber.
    """
    usual = float(f"{VOLUME * actuator.balloons / 15 * actuator.size**3:.3g}")
    requested = actuator.volumes(volumes, usual)
    shell = round_shell(actuator)
    root = root_node(DT)
    add(root, "FreeMotionAnimationLoop")
    add(root, "GenericConstraintSolver", maxIterations=200, tolerance="1e-8")
    node = child(root, "sba")
    add(node, "EulerImplicitSolver", rayleighStiffness=0.05, rayleighMass=2)
    add(node, "AMDOrderingMethod", name="order")
    add(
        node,
        "SparseLDLSolver",
        template="CompressedRowSparseMatrixMat3x3",
        orderingMethod="@order",
    )
    _add_bodies(node, shell, scaled_mass(shell, DT, VOLUME_PRESSURE))
    add(node, "LinearSolverConstraintCorrection")
    add_films(node, shell.membranes, shell.bending)
    for name, triangles in shell.cavities:
        chamber = child(node, name)
        add(
            chamber,
            "TriangleSetTopologyContainer",
            name="c",
            position="@../dofs.position",
            triangles=triangles,
        )
        add(
            chamber,
            "SurfacePressureConstraint",
            template="Vec3",
            triangles="@c.triangles",
            valueType="volumeGrowth",
            value=requested[name],
        )
    add_tip(node, shell.tip)
    return document(root, volume_note(shell, DT, usual, VOLUME_PRESSURE))


def _add_bodies(node: ET.Element, shell: Shell, mass: float) -> None:
    add(
        node,
        "MechanicalObject",
        name="dofs",
        template="Vec3",
        position=shell.position,
        rest_position=shell.rest,
    )
    add(node, "UniformMass", totalMass=float(f"{mass:.3g}"))
    add(node, "FixedProjectiveConstraint", indices=shell.fixed)


# Scenes B and D: nine frames on the backbone that carry the films, or replace them.


FRAMES = 9
"""Reference frames on the backbone (paper, Sec. 3.2.2), if the stack has enough balloons."""
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
ALONG_Z = (0.0, -math.sqrt(0.5), 0.0, math.sqrt(0.5))
"""Turns local x, the axis of a beam, upward."""

FRAMES_START = nearly_flat
"""Nine frames cannot draw in a pocket's edge, so the start must not have it drawn in either."""
FRAMES_DT = 0.05
SOFTENING = 0.12
"""Share of the true modulus at which 5 kPa lift 15 balloons as high as in scene A."""

BEAM_DT = 0.02
BEAM_MASS = 1e3
"""Multiple of the true mass that keeps the beam upright at 10 kPa."""


@dataclass(frozen=True)
class Beam:
    """The surrogate of a stack, scaled from the fit for 15 balloons of 5 mm.

    ``height`` (mm) without pressure, effective ``area`` (mm2) and ``spring`` (mN/mm) of a chamber;
    ``radius`` (mm) and ``young`` (kPa) of the beam with the stiffness of the chambers' springs on
    their axes.
    """

    height: float
    area: float
    spring: float
    radius: float
    young: float


def beam_of(actuator: CoarseActuator) -> Beam:
    """EA = N k H0 and EI = N k R^2 H0 / 2 of a round bar: its radius is R times root 2."""
    count, axis = actuator.stack.lobes, actuator.stack.radius
    height = 7.2 * actuator.balloons / 15 * actuator.size
    spring = 7.0 * 15 / actuator.balloons
    radius = axis * math.sqrt(2)
    young = count * spring * height / (math.pi * radius**2)
    return Beam(height, 14.4 * actuator.size**2, spring, radius, young)


def frames_scene(actuator: CoarseActuator) -> str:
    """B: the films move with nine frames, by weights that are linear in z."""
    mesh = actuator.mesh
    root = root_node(FRAMES_DT)
    add(root, "DefaultAnimationLoop")
    frames = frame_count(actuator.balloons)
    node = _frames(root, mesh.height, frames, UPRIGHT, actuator.mass)
    film = child(node, "film")
    add(
        film,
        "MechanicalObject",
        name="dofs",
        template="Vec3",
        position=mesh.position,
        rest_position=mesh.rest,
    )
    _add_skin(film, mesh, frames)
    add_films(film, *film_groups(actuator, mesh), SOFTENING)
    cavities = dict(mesh.cavities)
    for name, pressure in actuator.pressures:
        add_pressure(film, name, cavities[name], pressure)
    add_tip(film, mesh.tip)
    return document(root, frames_note(actuator, FRAMES_DT, SOFTENING))


def beam_scene(actuator: CoarseActuator) -> str:
    """D: nine frames as a beam, each chamber a prism of air; the film is for display only."""
    beam = beam_of(actuator)
    mesh = actuator.mesh_from(standing(beam.height / actuator.balloons))
    root = root_node(BEAM_DT)
    add(root, "DefaultAnimationLoop")
    frames = frame_count(actuator.balloons)
    node = _frames(root, mesh.height, frames, ALONG_Z, actuator.mass * BEAM_MASS)
    links = [index for i in range(frames - 1) for index in (i, i + 1)]
    add(node, "MeshTopology", name="beams", edges=links)
    add(
        node,
        "BeamFEMForceField",
        template="Rigid3d",
        topology="@beams",
        radius=beam.radius,
        youngModulus=beam.young,
        poissonRatio=actuator.poisson,
    )
    for axis, (name, pressure) in zip(actuator.stack.axes, actuator.pressures, strict=True):
        _add_prism(node, name, prism(axis, beam.area, mesh.height, frames), pressure)
    film = child(node, "film")
    add(
        film,
        "MechanicalObject",
        name="dofs",
        template="Vec3",
        position=mesh.position,
        showObject="1",
    )
    _add_skin(film, mesh, frames, mapForces="0", mapConstraints="0", mapMasses="0")
    # The surface that carries a visual model.
    shown = child(film, "surface")
    add(shown, "TriangleSetTopologyContainer", name="t", triangles=mesh.single + mesh.double)
    add_tip(film, mesh.tip)
    return document(root, beam_note(actuator, beam.height, beam.area, beam.spring, BEAM_DT))


def frame_count(balloons: int) -> int:
    """Number of frames on the backbone: at most the number of levels, or a balloon would wave."""
    return min(FRAMES, balloons + 1)


def _frames(
    root: ET.Element, height: float, frames: int, turn: tuple[float, ...], mass: float
) -> ET.Element:
    node = child(root, "frames")
    add(node, "EulerImplicitSolver", rayleighStiffness=0.05, rayleighMass=2)
    add(node, "CGLinearSolver", iterations=100, tolerance="1e-8", threshold="1e-14")
    places = [(0.0, 0.0, height * i / (frames - 1), *turn) for i in range(frames)]
    add(node, "MechanicalObject", name="dofs", template="Rigid3d", position=places)
    add(node, "UniformMass", totalMass=float(f"{mass:.4g}"))
    add(node, "FixedProjectiveConstraint", indices=0)
    return node


def _add_skin(film: ET.Element, mesh: CoarseMesh, frames: int, **off: str) -> None:
    between = [pair_of_frames(z, mesh.height, frames) for _, _, z in mesh.position]
    add(
        film,
        "SkinningMapping",
        input="@../dofs",
        output="@dofs",
        nbRef=2,
        indices=" ".join(f"[{i},{j}]" for (i, j), _ in between),
        weight=" ".join(f"[{number(v)},{number(w)}]" for _, (v, w) in between),
        **off,
    )


def pair_of_frames(
    z: float, height: float, frames: int = FRAMES
) -> tuple[tuple[int, int], tuple[float, float]]:
    """The two frames next to a height and their weights, the nearer one first.

    SkinningMapping reads a node's weights up to the first 0, so a 0 must come last.
    """
    place = z / height * (frames - 1)
    below = min(frames - 2, max(0, math.floor(place)))
    above = round(place - below, 6)
    if above > 0.5:
        return (below + 1, below), (above, round(1 - above, 6))
    return (below, below + 1), (round(1 - above, 6), above)


def _add_prism(
    node: ET.Element,
    name: str,
    surface: tuple[list[Vector], list[Triangle]],
    pressure: float,
) -> None:
    points, triangles = surface
    chamber = child(node, f"air_{name}")
    add(chamber, "MechanicalObject", name="dofs", template="Vec3", position=points)
    add(
        chamber,
        "RigidMapping",
        input="@../dofs",
        output="@dofs",
        rigidIndexPerPoint=[place // 4 for place in range(len(points))],
        globalToLocalCoords="1",
    )
    add_pressure(chamber, name, triangles, pressure)


def prism(
    axis: Point, area: float, height: float, frames: int = FRAMES
) -> tuple[list[Vector], list[Triangle]]:
    """A closed square prism on a chamber's axis, four points per frame, normals outward."""
    half = math.sqrt(area) / 2
    corners = ((half, half), (-half, half), (-half, -half), (half, -half))
    points = [
        (axis[0] + x, axis[1] + y, height * i / (frames - 1))
        for i in range(frames)
        for x, y in corners
    ]
    triangles: list[Triangle] = [(0, 2, 1), (0, 3, 2)]
    for start in range(0, 4 * (frames - 1), 4):
        for i in range(4):
            a, b = start + i, start + (i + 1) % 4
            # Alternate the diagonals: with a single direction air would twist the prism.
            if i % 2:
                triangles += [(a, b, b + 4), (a, b + 4, a + 4)]
            else:
                triangles += [(a, b, a + 4), (b, b + 4, a + 4)]
    top = 4 * (frames - 1)
    return points, [*triangles, (top, top + 1, top + 2), (top, top + 2, top + 3)]


# The scenes of a design as files.


SHELL_FILE, FRAMES_FILE, VOLUME_FILE, BEAM_FILE = (
    "actuator.scn",
    "actuator_frames.scn",
    "actuator_volume.scn",
    "actuator_beam.scn",
)
DATA, PYTHON = "actuator.json", "scene.py"
LEAST_LOBES = 3
"""A beam with fewer chambers cannot bend, or bends in one plane only."""


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
    """Writes the scenes of a laminate and the files they load; returns them, the default one first.

    ``pressures`` in kPa and ``volumes`` (scene C, above its start) in ul, by chamber; omitted
    chambers get 0. The default is 5 kPa and some 80 ul in every chamber. Scenes B and C require
    round pockets of one film, scene D also three chambers or more. Raises DesignError if a chamber
    is unknown, or if other pockets need a mesher that is not installed.
    """
    texts = {}
    if why_not_round(laminate) is None:
        shell = round_shell(round_actuator(laminate, pressures))
        frames = round_actuator(laminate, pressures, COARSE_SECTORS, FRAMES_START)
        volume = round_actuator(laminate, pressures, COARSE_SECTORS, half_full)
        texts = {SHELL_FILE: shell_scene(shell), FRAMES_FILE: frames_scene(frames)}
        texts[VOLUME_FILE] = volume_scene(volume, volumes)
        if frames.stack.lobes >= LEAST_LOBES:
            texts[BEAM_FILE] = beam_scene(frames)
    else:
        shell = conforming_shell(laminate, pressures)
        texts = {SHELL_FILE: shell_scene(shell)}
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
