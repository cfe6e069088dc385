"""Scenes A and C: every film as a shell, driven by pressure or by volume."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping

from sbafab.simulators.coarse.actuator import CoarseActuator
from sbafab.simulators.sofa.markup import add, child, document, root_node
from sbafab.simulators.sofa.notes import shell_note, volume_note
from sbafab.simulators.sofa.parts import add_films, add_pressure, add_tip, scaled_mass
from sbafab.simulators.sofa.shell import Shell, round_shell

DT = 0.02
VOLUME = 80.0
"""ul above the start in a chamber of 15 balloons of 5 mm."""
VOLUME_PRESSURE = 10.0
"""kPa that scene C's mass is made for; what its chambers come to is not known beforehand."""
STEPS = 25
"""Of the solver in each time step at most. They do not bring it to its end, the next steps do."""


def shell_scene(shell: Shell) -> str:
    """A: core components only; each chamber under its own pressure."""
    root = root_node(DT)
    add(root, "DefaultAnimationLoop")
    node = child(root, "sba")
    add(node, "EulerImplicitSolver", rayleighStiffness=0.05, rayleighMass=2)
    # Without a matrix: that of the bending springs lacks every fourth node in SOFA 25.06.
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
    """C: each chamber told how many ul it holds more than at the start (plugin SoftRobots).

    ``volumes`` by chamber, 0 for those left out. Raises DesignError for an unknown chamber.
    """
    usual = float(f"{VOLUME * actuator.balloons / 15 * actuator.size**3:.3g}")
    told = actuator.volumes(volumes, usual)
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
            value=told[name],
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
