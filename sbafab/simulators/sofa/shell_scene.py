"""Scenes A and C: every film as a shell, driven by pressure or by volume."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping

from sbafab.simulators.coarse.actuator import CoarseActuator
from sbafab.simulators.coarse.meridian import partly
from sbafab.simulators.coarse.mesh import CoarseMesh, coarse_mesh
from sbafab.simulators.sofa.markup import add, child, document, root_node
from sbafab.simulators.sofa.notes import shell_note, volume_note
from sbafab.simulators.sofa.parts import add_films, add_pressure, add_tip, scaled_mass

DT = 0.02
VOLUME = 80.0
"""ul above the start in a chamber of 15 balloons of 5 mm."""


def shell_scene(actuator: CoarseActuator) -> str:
    """A: core components only; each chamber under its own pressure."""
    root = root_node(DT)
    add(root, "DefaultAnimationLoop")
    node = _shell(root, actuator, actuator.mesh, constrained=False)
    cavities = dict(actuator.mesh.cavities)
    for name, pressure in actuator.pressures:
        add_pressure(node, name, cavities[name], pressure)
    add_tip(node, actuator.mesh)
    return document(root, shell_note(actuator, DT))


def volume_scene(actuator: CoarseActuator, volumes: Mapping[str, float] | None = None) -> str:
    """C: each chamber told how many ul it holds more than at the start (plugin SoftRobots).

    ``volumes`` by chamber, 0 for those left out. Raises DesignError for an unknown chamber.
    """
    usual = float(f"{VOLUME * actuator.balloons / 15 * actuator.size**3:.3g}")
    told = actuator.volumes(volumes, usual)
    mesh = coarse_mesh(actuator.stack, partly)
    root = root_node(DT)
    add(root, "FreeMotionAnimationLoop")
    add(root, "GenericConstraintSolver", maxIterations=200, tolerance="1e-8")
    node = _shell(root, actuator, mesh, constrained=True)
    for name, triangles in mesh.cavities:
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
            value=told[name],
        )
    add_tip(node, mesh)
    return document(root, volume_note(actuator, mesh, DT, usual))


def _shell(
    root: ET.Element, actuator: CoarseActuator, mesh: CoarseMesh, *, constrained: bool
) -> ET.Element:
    node = child(root, "sba")
    add(node, "EulerImplicitSolver", rayleighStiffness=0.05, rayleighMass=2)
    add(node, "SparseLDLSolver", template="CompressedRowSparseMatrixMat3x3")
    add(
        node,
        "MechanicalObject",
        name="dofs",
        template="Vec3",
        position=mesh.position,
        rest_position=mesh.rest,
    )
    add(node, "UniformMass", totalMass=float(f"{scaled_mass(actuator, DT):.3g}"))
    add(node, "FixedProjectiveConstraint", indices=mesh.fixed)
    if constrained:
        add(node, "LinearSolverConstraintCorrection")
    add_films(node, actuator, mesh)
    return node
