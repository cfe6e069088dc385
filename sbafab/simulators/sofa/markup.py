"""SOFA's XML scenes: a tree of nodes and components, written with the plugins that it needs."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Sequence

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
"""The plugin that brings each component; SOFA itself has DefaultAnimationLoop."""


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
    """Nine digits, and no minus before a zero."""
    return f"{value + 0.0:.9g}"


def _flat(values: Iterable[float | Sequence[float]]) -> Iterable[float]:
    for value in values:
        if isinstance(value, int | float):
            yield value
        else:
            yield from value


def document(root: ET.Element, comment: str) -> str:
    """The scene as a file: what it is, the plugins it needs, its nodes."""
    used = {element.tag for element in root.iter()}
    plugins = sorted({PLUGINS[tag] for tag in used if tag in PLUGINS})
    for place, plugin in enumerate(plugins):
        root.insert(place, ET.Element("RequiredPlugin", {"name": plugin}))
    ET.indent(root, " ")
    if "--" in comment:
        raise ValueError("an XML comment cannot hold two hyphens in a row")
    body = ET.tostring(root, encoding="unicode")
    return f'<?xml version="1.0"?>\n<!--\n{comment.strip()}\n-->\n{body}\n'
