"""Scenes B and D: nine frames on the backbone that carry the films, or stand in for them."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from dataclasses import dataclass

from sbafab.geometry.edges import Point
from sbafab.meshing.surface import Vector
from sbafab.simulators.coarse.actuator import CoarseActuator
from sbafab.simulators.coarse.meridian import standing
from sbafab.simulators.coarse.mesh import CoarseMesh
from sbafab.simulators.coarse.web import Triangle
from sbafab.simulators.sofa.markup import add, child, document, number, root_node
from sbafab.simulators.sofa.notes import beam_note, frames_note
from sbafab.simulators.sofa.parts import add_films, add_pressure, add_tip
from sbafab.simulators.sofa.shell import film_groups, nearly_flat

FRAMES = 9
"""Reference frames on the backbone (paper, Sec. 3.2.2), where there are balloons enough."""
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
ALONG_Z = (0.0, -math.sqrt(0.5), 0.0, math.sqrt(0.5))
"""Turns local x, a beam's own axis, upward."""

FRAMES_START = nearly_flat
"""Nine frames cannot draw a pocket's edge in: it must not be drawn in at the start either."""
FRAMES_DT = 0.05
SOFTENING = 0.12
"""Share of the true modulus: with it 5 kPa lift 15 balloons as high as in scene A."""

BEAM_DT = 0.02
BEAM_MASS = 1e3
"""Times the true mass: keeps the beam upright at 10 kPa."""


@dataclass(frozen=True)
class Beam:
    """The surrogate of a stack, scaled from what was fitted for 15 balloons of 5 mm.

    ``height`` (mm) without pressure, ``area`` (mm2) a chamber's pressure acts on, ``spring``
    (mN/mm) of a chamber; ``radius`` (mm) and ``young`` (kPa) of the beam that has the stiffness
    of the chambers' springs on their axes.
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
    """D: nine frames as a beam, each chamber a prism of air; the film is only shown."""
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
    # The surface on which to hang a visual model.
    shown = child(film, "surface")
    add(shown, "TriangleSetTopologyContainer", name="t", triangles=mesh.single + mesh.double)
    add_tip(film, mesh.tip)
    return document(root, beam_note(actuator, beam.height, beam.area, beam.spring, BEAM_DT))


def frame_count(balloons: int) -> int:
    """Frames on the backbone: no more than there are levels, or a balloon would wave."""
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

    SkinningMapping reads a node's weights up to the first that is 0: that one must be the last.
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
    """A closed square prism on a chamber's axis, four points a frame, normals outward."""
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
            # Diagonals in turn: with all of one hand air would twist the prism.
            if i % 2:
                triangles += [(a, b, b + 4), (a, b + 4, a + 4)]
            else:
                triangles += [(a, b, a + 4), (b, b + 4, a + 4)]
    top = 4 * (frames - 1)
    return points, [*triangles, (top, top + 1, top + 2), (top, top + 2, top + 3)]
