"""The films of an actuator as SOFA takes them: nodes, triangles by stiffness, cavities."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

from sbafab.laminate.laminate import Laminate
from sbafab.meshing.surface import Vector
from sbafab.simulators.coarse.shell import (
    CoarseActuator,
    CoarseMesh,
    Meridian,
    Start,
    Triangle,
    actuator,
    holding,
    standing,
)

Reading = Literal["tip", "crowns"]
"""What the recorded nodes tell: a tip and its tilt, or crowns round a tube and their radius."""

SECTORS = 12
"""Nodes of a ring in scene A. From 8 to 12 the height grows by 6.6 %, from 12 to 16 by 2.2 %."""
COARSE_SECTORS = 8
"""Nodes of a ring in the other scenes."""
RISE = 0.15
"""mm a balloon of 5 mm is high at the start: a dome so flat that the film is nearly at rest."""


class FilmGroup(NamedTuple):
    """Triangles of one stiffness: E t in mN/mm of a membrane, or bending stiffness in mN mm."""

    name: str
    triangles: tuple[Triangle, ...]
    stiffness: float
    poisson: float


@dataclass(frozen=True)
class Shell:
    """Nodes at ``rest`` (flat) and at the start (``position``), and what hangs on them.

    ``membranes`` share out all triangles; in a group of ``bending`` no edge has more than two.
    ``cavities`` are closed surfaces, normals out of the air; ``pressures`` kPa by chamber.
    ``fixed`` nodes stand still, ``tip`` nodes are recorded. ``mass`` is the true one in kg,
    ``size`` the largest pocket radius over 2.5 mm, ``about`` a sentence on the mesh.
    """

    name: str
    rest: tuple[Vector, ...]
    position: tuple[Vector, ...]
    membranes: tuple[FilmGroup, ...]
    bending: tuple[FilmGroup, ...]
    cavities: tuple[tuple[str, tuple[Triangle, ...]], ...]
    pressures: Mapping[str, float]
    fixed: tuple[int, ...]
    tip: tuple[int, ...]
    mass: float
    size: float
    about: str
    reading: Reading = "tip"


def nearly_flat(pocket: float, neck: float) -> Meridian:
    """A balloon that has only just risen."""
    return standing(RISE * pocket / 2.5)(pocket, neck)


def half_full(pocket: float, neck: float) -> Meridian:
    """7.5 ul in a pocket of 5 mm: with 80 ul more 15 balloons come near what 5 kPa hold."""
    return holding(neck, pocket - neck, 7.5 * (pocket / 2.5) ** 3)


def round_actuator(
    laminate: Laminate,
    pressures: Mapping[str, float] | None = None,
    sectors: int = SECTORS,
    start: Start = nearly_flat,
) -> CoarseActuator:
    """The coarse actuator of a stack of round pockets, its rings of the circles' area.

    Raises DesignError where the pockets are not round or a chamber is unknown.
    """
    made = actuator(laminate, pressures, sectors, start)
    return replace(made, is_fair=True)


def round_shell(made: CoarseActuator) -> Shell:
    """The shell of a stack of round pockets."""
    mesh = made.mesh
    membranes, bending = film_groups(made, mesh)
    triangles = len(mesh.single) + len(mesh.double)
    held = mesh.volume(made.stack.chambers[0]) / made.balloons
    return Shell(
        name=made.stack.name,
        rest=mesh.rest,
        position=mesh.position,
        membranes=membranes,
        bending=bending,
        cavities=mesh.cavities,
        pressures=dict(made.pressures),
        fixed=mesh.fixed,
        tip=mesh.tip,
        mass=made.mass,
        size=max(made.stack.pockets) / 2.5,
        about=(
            f"{len(mesh.rest)} nodes, {triangles} triangles; rings of {made.sectors} corners have "
            f"the area of\nthe circles. It starts {mesh.height:.4g} mm high ({held:.3g} ul a "
            "balloon). Inlet tabs and strips are left out."
        ),
    )


def film_groups(
    made: CoarseActuator, mesh: CoarseMesh
) -> tuple[tuple[FilmGroup, ...], tuple[FilmGroup, ...]]:
    """Membranes and bending groups of a coarse mesh."""
    once, twice, nu = made.bending(1), made.bending(2), made.poisson
    membranes = (
        FilmGroup("membrane1", mesh.single, made.membrane, nu),
        FilmGroup("membrane2", mesh.double, 2 * made.membrane, nu),
    )
    bending = (
        FilmGroup("bend_lower", mesh.lower, once, nu),
        FilmGroup("bend_upper", mesh.upper, once, nu),
        FilmGroup("bend_web", mesh.web, twice, nu),
        FilmGroup("bend_neck", mesh.necks, twice, nu),
    )
    return membranes, tuple(group for group in bending if group.triangles)
