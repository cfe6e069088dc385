"""Parts that several scenes have: films, pressures, the tip's record."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Sequence

from sbafab.simulators.coarse.web import Triangle
from sbafab.simulators.sofa.markup import add, child, number
from sbafab.simulators.sofa.shell import FilmGroup, Shell

NODAL_BY_PRESSURE = 3.0
"""mN/mm a kPa: nodal mass / dt^2 in pockets of 5 mm. The stiffness that air pressure lends a film
is not in a step's matrix; a tenth of this holds too, but a long stack then swings for longer."""
LEAST_NODAL = 8.0
"""mN/mm, for low pressures."""
TIP_FILE = "tip.state"
TIP_PERIOD = 0.1
"""s between two records of the tip."""
RAMP = 1.0
"""s in which a pressure rises from 0."""


def nodal_stiffness(highest: float, size: float) -> float:
    """Nodal mass / dt^2 in mN/mm at which a shell under a pressure in kPa keeps still."""
    return max(LEAST_NODAL, NODAL_BY_PRESSURE * highest * size)


def scaled_mass(shell: Shell, dt: float, highest: float | None = None) -> float:
    """Mass in kg that keeps the shell still at a time step in s: artificial.

    ``highest`` is the pressure in kPa to reckon with, by default the highest it is told.
    """
    most = max(shell.pressures.values()) if highest is None else highest
    return nodal_stiffness(most, shell.size) * len(shell.rest) * dt**2


def add_films(
    node: ET.Element,
    membranes: Iterable[FilmGroup],
    bending: Iterable[FilmGroup],
    share: float = 1.0,
) -> None:
    """The films' elasticity, of ``share`` of the true modulus, a child node a group."""
    for group in membranes:
        film = child(node, group.name)
        add(film, "TriangleSetTopologyContainer", name="t", triangles=group.triangles)
        add(
            film,
            "TriangularFEMForceFieldOptim",
            template="Vec3",
            topology="@t",
            youngModulus=round(group.stiffness * share, 6),
            poissonRatio=group.poisson,
        )
    for group in bending:
        film = child(node, group.name)
        add(film, "TriangleSetTopologyContainer", name="t", triangles=group.triangles)
        add(
            film,
            "FastTriangularBendingSprings",
            template="Vec3",
            topology="@t",
            bendingStiffness=float(f"{group.stiffness * share:.3g}"),
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


def add_tip(node: ET.Element, nodes: Sequence[int]) -> None:
    """Writes where the tip's nodes are, ten times a second."""
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
