"""Parts that several scenes have: films, pressures, the tip's record."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence

from sbafab.simulators.coarse.actuator import POISSON, CoarseActuator
from sbafab.simulators.coarse.mesh import CoarseMesh
from sbafab.simulators.coarse.web import Triangle
from sbafab.simulators.sofa.markup import add, child, number

NODAL_STIFFNESS = 6.56 / 2304 / 0.02**2
"""mN/mm: nodal mass / dt^2 at which the coarse shell was seen to keep still (7.12)."""
TIP_FILE = "tip.state"
TIP_PERIOD = 0.1
"""s between two records of the tip."""
RAMP = 1.0
"""s in which a pressure rises from 0."""


def scaled_mass(actuator: CoarseActuator, dt: float) -> float:
    """Mass in kg that keeps the shell still at a time step in s: artificial."""
    return NODAL_STIFFNESS * len(actuator.mesh.rest) * dt**2


def film_groups(
    actuator: CoarseActuator, mesh: CoarseMesh
) -> tuple[
    list[tuple[str, tuple[Triangle, ...], float]], list[tuple[str, tuple[Triangle, ...], float]]
]:
    """Membranes with E t (mN/mm), and bending groups with their stiffness (mN mm)."""
    once, twice = actuator.bending(1), actuator.bending(2)
    membranes = [
        ("membrane1", mesh.single, actuator.membrane),
        ("membrane2", mesh.double, 2 * actuator.membrane),
    ]
    bending = [
        ("bend_lower", mesh.lower, once),
        ("bend_upper", mesh.upper, once),
        ("bend_web", mesh.web, twice),
        ("bend_neck", mesh.necks, twice),
    ]
    return membranes, [group for group in bending if group[1]]


def add_films(
    node: ET.Element, actuator: CoarseActuator, mesh: CoarseMesh, share: float = 1.0
) -> None:
    """The films' elasticity, of ``share`` of the true modulus, a child node a group."""
    membranes, bending = film_groups(actuator, mesh)
    for name, triangles, stiffness in membranes:
        film = child(node, name)
        add(film, "TriangleSetTopologyContainer", name="t", triangles=triangles)
        add(
            film,
            "TriangularFEMForceField",
            template="Vec3",
            topology="@t",
            method="large",
            youngModulus=round(stiffness * share, 6),
            poissonRatio=POISSON,
        )
    for name, triangles, stiffness in bending:
        film = child(node, name)
        add(film, "TriangleSetTopologyContainer", name="t", triangles=triangles)
        add(
            film,
            "FastTriangularBendingSprings",
            template="Vec3",
            topology="@t",
            bendingStiffness=float(f"{stiffness * share:.3g}"),
        )


def add_pressure(
    node: ET.Element, name: str, triangles: Sequence[Triangle], pressure: float
) -> None:
    """A chamber's air in kPa: up in one second, then held."""
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


def add_tip(node: ET.Element, mesh: CoarseMesh) -> None:
    """Writes where the tip's nodes are, ten times a second."""
    tip = child(node, "tip")
    add(tip, "MechanicalObject", template="Vec3")
    add(tip, "SubsetMapping", handleTopologyChange="0", indices=mesh.tip)
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
