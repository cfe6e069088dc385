"""The films of an actuator for SOFA: nodes, triangles by stiffness, cavities.

Stacks of round pockets use the coarse mesh; drawn pockets, several films and tubes use the
conforming one.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sbafab.laminate.films import density_of
from sbafab.laminate.laminate import Laminate
from sbafab.meshing.conforming.element_mesh import shell_mesh, thin
from sbafab.meshing.conforming.layup import Layup, MeshSettings, flat, layup, narrowest_ring
from sbafab.meshing.conforming.mesh import Mesh, volumes
from sbafab.meshing.surface import Vector
from sbafab.simulators.coarse.rounds import elastic_of, pocket_radii
from sbafab.simulators.coarse.shell import (
    PRESSURE,
    CoarseActuator,
    CoarseMesh,
    Meridian,
    Start,
    Triangle,
    actuator,
    checked,
    holding,
    nearly_flat,
)

Reading = Literal["tip", "crowns"]
"""Meaning of the recorded nodes: a tip and its tilt, or crowns round a tube and their radius."""

SECTORS = 12
"""Nodes per ring in scene A. From 8 to 12 the height grows by 6.6 %, from 12 to 16 by 2.2 %."""
COARSE_SECTORS = 8
"""Nodes per ring in the other scenes."""


class FilmGroup(NamedTuple):
    """Triangles of one stiffness: E t in mN/mm of a membrane, or bending stiffness in mN mm."""

    name: str
    triangles: tuple[Triangle, ...]
    stiffness: float
    poisson: float


@dataclass(frozen=True)
class Shell:
    """Nodes at ``rest`` (flat) and at the start (``position``), and the films attached to them.

    ``membranes`` partition all triangles; in a group of ``bending`` an edge has at most two.
    ``cavities`` are closed surfaces, normals out of the air; ``pressures`` kPa by chamber.
    ``fixed`` nodes do not move, ``tip`` nodes are recorded. ``mass`` is the true mass in kg,
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


def half_full(pocket: float, neck: float) -> Meridian:
    """7.5 ul in a pocket of 5 mm: 80 ul more brings 15 balloons near their volume at 5 kPa."""
    return holding(neck, pocket - neck, 7.5 * (pocket / 2.5) ** 3)


def round_actuator(
    laminate: Laminate,
    pressures: Mapping[str, float] | None = None,
    sectors: int = SECTORS,
    start: Start = nearly_flat,
) -> CoarseActuator:
    """The coarse actuator of a stack of round pockets; its rings have the area of the circles.

    Raises DesignError if the pockets are not round or a chamber is unknown.
    """
    coarse = actuator(laminate, pressures, sectors, start)
    return replace(coarse, is_fair=True)


def round_shell(coarse: CoarseActuator) -> Shell:
    """The shell of a stack of round pockets."""
    mesh = coarse.mesh
    membranes, bending = film_groups(coarse, mesh)
    triangles = len(mesh.single) + len(mesh.double)
    balloon_ul = mesh.volume(coarse.stack.chambers[0]) / coarse.balloons
    return Shell(
        name=coarse.stack.name,
        rest=mesh.rest,
        position=mesh.position,
        membranes=membranes,
        bending=bending,
        cavities=mesh.cavities,
        pressures=dict(coarse.pressures),
        fixed=mesh.fixed,
        tip=mesh.tip,
        mass=coarse.mass,
        size=max(coarse.stack.pockets) / 2.5,
        about=(
            f"{len(mesh.rest)} nodes, {triangles} triangles; rings of {coarse.sectors} corners "
            f"have the area of\nthe circles. It starts {mesh.height:.4g} mm high "
            f"({balloon_ul:.3g} ul a balloon). Inlet tabs and strips are left out."
        ),
    )


def film_groups(
    coarse: CoarseActuator, mesh: CoarseMesh
) -> tuple[tuple[FilmGroup, ...], tuple[FilmGroup, ...]]:
    """Membranes and bending groups of a coarse mesh."""
    once, twice, nu = coarse.bending(1), coarse.bending(2), coarse.poisson
    membranes = (
        FilmGroup("membrane1", mesh.single, coarse.membrane, nu),
        FilmGroup("membrane2", mesh.double, 2 * coarse.membrane, nu),
    )
    bending = (
        FilmGroup("bend_lower", mesh.lower, once, nu),
        FilmGroup("bend_upper", mesh.upper, once, nu),
        FilmGroup("bend_web", mesh.web, twice, nu),
        FilmGroup("bend_neck", mesh.necks, twice, nu),
    )
    return membranes, tuple(group for group in bending if group.triangles)


# The shell of any laminate, from its conforming mesh: drawn pockets, several films, tubes.


STEPS_ACROSS = 3.0
"""Triangle sides across the smallest pocket's radius, unless its bonds are narrower."""
STRETCH, MASS, BENDING, RATIO, LOWEST = range(5)
"""Properties of a cell: E t in mN/mm, kg/mm2, mN mm, Poisson's ratio, its lowest film."""


def conforming_shell(laminate: Laminate, pressures: Mapping[str, float] | None = None) -> Shell:
    """The shell of a laminate, flat at the start; a radial one is wrapped round its tube.

    The mouths of inlets are open and free. Raises DesignError if a chamber is unknown, a film's
    modulus is not known, or the mesher is not installed.
    """
    names = tuple(chamber.name for chamber in laminate.chambers)
    kilopascals = checked(names, pressures, PRESSURE, "pressure", "kPa")
    for layer in laminate.tpe_layers:
        elastic_of(layer.film)
    radii = pocket_radii(laminate)
    side = min(radii) / STEPS_ACROSS
    ring = narrowest_ring(laminate)
    h = side if ring is None else min(side, ring[0])
    stack = thin(layup(laminate, MeshSettings(h, wrapped=False)))
    mesh = shell_mesh(stack, flat(stack))
    number, corners = _linear(mesh)
    cells = _cells(stack, mesh)
    rest = position = _vectors(mesh.points[number >= 0])
    start = "flat"
    if laminate.tube is not None:
        start = f"wrapped round a tube of {laminate.tube:.4g} mm, whose axis is z"
        on_tube = replace(stack, settings=MeshSettings(h))
        position = _vectors(shell_mesh(on_tube, flat(on_tube)).points[number >= 0])
    return Shell(
        name=laminate.name,
        rest=rest,
        position=position,
        membranes=_membranes(corners, cells),
        bending=_bending(corners, cells),
        cavities=tuple((name, _walls(mesh.face_sets[f"cavity_{name}"], corners)) for name in names),
        pressures=kilopascals,
        fixed=tuple(n for n in number[mesh.node_sets["base"]].tolist() if n >= 0),
        tip=tuple(int(number[node]) for node in _marks(stack, mesh, number)),
        mass=float(volumes(mesh.kind, mesh.points, mesh.cells) @ cells[:, MASS]),
        size=max(radii) / 2.5,
        about=(
            f"{len(rest)} nodes, {len(corners)} triangles, inlets and their strips among them.\n"
            f"It starts {start}."
        ),
        reading="tip" if laminate.tube is None else "crowns",
    )


def _vectors(points: NDArray[np.float64]) -> tuple[Vector, ...]:
    """Round to six decimals, without a minus before a zero."""
    return tuple((x, y, z) for x, y, z in (points.round(6) + 0.0).tolist())


def _linear(mesh: Mesh) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The new number of each node, -1 for mid-edge nodes; and the triangles' corners."""
    number = np.full(len(mesh.points), -1)
    used = np.unique(mesh.cells[:, :3])
    number[used] = np.arange(len(used))
    return number, number[mesh.cells[:, :3]]


def _walls(faces: NDArray[np.int64], corners: NDArray[np.int64]) -> tuple[Triangle, ...]:
    """A cavity's walls, normals out of the air."""
    # Face 0 of a triangle faces down, face 1 up, each into the air that touches it.
    walls = corners[faces[:, 0]]
    return _rows(np.where(faces[:, 1:] == 0, walls, walls[:, ::-1]))


def _cells(stack: Layup, mesh: Mesh) -> NDArray[np.float64]:
    """Return the properties of each cell, one row each, for its stack of bonded films."""
    properties = np.zeros((len(mesh.cells), 5))
    thickness = np.zeros(len(mesh.cells))
    properties[:, LOWEST] = -1
    for k, ply in enumerate(stack.plies):
        of_ply = mesh.cell_sets[ply.name]
        young, ratio = elastic_of(ply.layer.film)
        properties[of_ply, STRETCH] += 1000 * young * ply.thickness
        properties[of_ply, MASS] += (
            1e-9 * density_of(ply.layer.film, "a simulation") * ply.thickness
        )
        properties[of_ply, RATIO] += ratio * ply.thickness
        thickness[of_ply] += ply.thickness
        new = of_ply[properties[of_ply, LOWEST] < 0]
        properties[new, LOWEST] = k
    properties[:, RATIO] /= thickness
    properties[:, BENDING] = (
        properties[:, STRETCH] * thickness**2 / (12 * (1 - properties[:, RATIO] ** 2))
    )
    return properties.round(12)


def _membranes(corners: NDArray[np.int64], cells: NDArray[np.float64]) -> tuple[FilmGroup, ...]:
    kinds, kind = np.unique(cells[:, [STRETCH, RATIO]], axis=0, return_inverse=True)
    kind = kind.ravel()
    return tuple(
        FilmGroup(f"membrane{n + 1}", _rows(corners[kind == n]), float(stretch), float(ratio))
        for n, (stretch, ratio) in enumerate(kinds)
    )


def _bending(corners: NDArray[np.int64], cells: NDArray[np.float64]) -> tuple[FilmGroup, ...]:
    """Groups in which no edge has more than two triangles.

    Cells with the same lowest film lie side by side; separate films share a group if they share no
    node.
    """
    bins: list[tuple[float, set[int], list[NDArray[np.int64]]]] = []
    kinds, kind = np.unique(cells[:, [BENDING, LOWEST]], axis=0, return_inverse=True)
    kind = kind.ravel()
    for n, (stiffness, _) in enumerate(kinds):
        of_kind = corners[kind == n]
        nodes = set(np.unique(of_kind).tolist())
        free = (b for b in bins if b[0] == stiffness and not b[1] & nodes)
        place = next(free, None)
        if place is None:
            place = (float(stiffness), set(), [])
            bins.append(place)
        place[1].update(nodes)
        place[2].append(of_kind)
    return tuple(
        FilmGroup(f"bend{n + 1}", _rows(np.concatenate(parts)), stiffness, 0.0)
        for n, (stiffness, _, parts) in enumerate(bins)
    )


def _marks(stack: Layup, mesh: Mesh, number: NDArray[np.int64]) -> tuple[int, ...]:
    """Nodes of the highest film: the axes of three stacks or more, or four round its middle."""
    top = mesh.node_sets["tip"]
    top = top[number[top] >= 0]
    places = mesh.points[top][:, :2]

    def nearest(place: Iterable[float]) -> int:
        away = np.linalg.norm(places - np.array(list(place)), axis=1)
        return int(top[int(np.argmin(away))])

    if len(stack.centres) >= 3:
        return tuple(nearest(centre) for centre in stack.centres)
    middle = np.mean(stack.centres, axis=0)
    reach = float(np.abs(places - middle).max())
    quarters = ((1, 0), (0, 1), (-1, 0), (0, -1))
    return tuple(nearest(middle + reach * np.array(quarter)) for quarter in quarters)


def _rows(triangles: NDArray[np.int64]) -> tuple[Triangle, ...]:
    return tuple((a, b, c) for a, b, c in triangles.tolist())
