"""The films of an actuator for SOFA: nodes, triangles by stiffness, cavities.

Stacks of round pockets use the coarse mesh; drawn pockets, several films and tubes use the
conforming one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sbafab.laminate.films import density_of
from sbafab.laminate.laminate import Laminate
from sbafab.meshing.conforming.element_mesh import shell_mesh, thin
from sbafab.meshing.conforming.layup import Layup, MeshSettings, flat, layup, narrowest_ring
from sbafab.meshing.conforming.mesh import Mesh, volumes
from sbafab.simulators.coarse import (
    CoarseActuator,
    Meridian,
    Start,
    Triangles,
    elastic_of,
    holding,
    nearly_flat,
    pocket_radii,
    round_stack,
)

SECTORS = 12
"""Nodes per ring in scene A. From 8 to 12 the height grows by 6.6 %, from 12 to 16 by 2.2 %."""
COARSE_SECTORS = 8
"""Nodes per ring in the other scenes."""


class FilmGroup(NamedTuple):
    """Triangles of one stiffness: E t in mN/mm of a membrane, or bending stiffness in mN mm."""

    name: str
    triangles: Triangles
    stiffness: float
    poisson: float


@dataclass(frozen=True, eq=False)
class Shell:
    """Nodes (n, 3) at ``rest`` (flat) and at the start (``position``), and the films on them.

    ``membranes`` partition all triangles; in a group of ``bending`` an edge has at most two.
    ``cavities`` are closed surfaces, normals out of the air. ``fixed`` nodes do not move, ``tip``
    nodes are recorded. ``mass`` is the true mass in kg, ``size`` the largest pocket radius over
    2.5 mm, ``about`` a sentence on the mesh.
    """

    rest: NDArray[np.float64]
    position: NDArray[np.float64]
    membranes: tuple[FilmGroup, ...]
    bending: tuple[FilmGroup, ...]
    cavities: Mapping[str, Triangles]
    fixed: NDArray[np.int64]
    tip: NDArray[np.int64]
    mass: float
    size: float
    about: str

    @property
    def triangles(self) -> Triangles:
        """All films."""
        return np.concatenate([group.triangles for group in self.membranes])

    @property
    def height(self) -> float:
        """Height at the start in mm."""
        return float(self.position[:, 2].max())


def half_full(pocket: float, neck: float) -> Meridian:
    """7.5 ul in a pocket of 5 mm: 80 ul more brings 15 balloons near their volume at 5 kPa."""
    return holding(neck, pocket - neck, 7.5 * (pocket / 2.5) ** 3)


def round_actuator(
    laminate: Laminate, sectors: int = SECTORS, start: Start = nearly_flat
) -> CoarseActuator:
    """The coarse actuator of a stack of round pockets; its rings have the area of the circles.

    Raises DesignError if the pockets are not round.
    """
    return CoarseActuator(round_stack(laminate), sectors, start, is_fair=True)


def round_shell(coarse: CoarseActuator) -> Shell:
    """The shell of a stack of round pockets."""
    mesh, nu = coarse.mesh, coarse.poisson
    membranes = (
        FilmGroup("membrane1", mesh.single, coarse.membrane, nu),
        FilmGroup("membrane2", mesh.double, 2 * coarse.membrane, nu),
    )
    names = {"lower": "bend_lower", "upper": "bend_upper", "web": "bend_web", "necks": "bend_neck"}
    bending = tuple(
        FilmGroup(names[name], triangles, coarse.bending(films), nu)
        for name, triangles, films in mesh.groups
    )
    balloon_ul = mesh.volume(coarse.stack.chambers[0]) / coarse.balloons
    return Shell(
        rest=mesh.rest,
        position=mesh.position,
        membranes=membranes,
        bending=bending,
        cavities=mesh.cavities,
        fixed=mesh.fixed,
        tip=mesh.tip,
        mass=coarse.mass,
        size=max(coarse.stack.pockets) / 2.5,
        about=(
            f"{len(mesh.rest)} nodes, {len(mesh.single) + len(mesh.double)} triangles; rings of "
            f"{coarse.sectors} corners have the area of\nthe circles. It starts "
            f"{mesh.height:.4g} mm high ({balloon_ul:.3g} ul a balloon). Inlet tabs and strips are "
            "left out."
        ),
    )


# The shell of any laminate, from its conforming mesh: drawn pockets, several films, tubes.


STEPS_ACROSS = 3.0
"""Triangle sides across the smallest pocket's radius, unless its bonds are narrower."""
STRETCH, MASS, BENDING, RATIO, LOWEST = range(5)
"""Properties of a cell: E t in mN/mm, kg/mm2, mN mm, Poisson's ratio, its lowest film."""


def conforming_shell(laminate: Laminate) -> Shell:
    """The shell of a laminate, flat at the start; a radial one is wrapped round its tube.

    The mouths of inlets are open and free. Raises DesignError if a film's modulus is not known, or
    the mesher is not installed.
    """
    for layer in laminate.tpe_layers:
        elastic_of(layer.film)
    radii = pocket_radii(laminate)
    side = min(radii) / STEPS_ACROSS
    ring = narrowest_ring(laminate)
    h = side if ring is None else min(side, ring[0])
    stack = thin(layup(laminate, MeshSettings(h, wrapped=False)))
    mesh = shell_mesh(stack, flat(stack))
    # Mid-edge nodes are left out.
    used, corners = np.unique(mesh.cells[:, :3], return_inverse=True)
    corners = corners.reshape(-1, 3)
    number = np.full(len(mesh.points), -1)
    number[used] = np.arange(len(used))
    cells = _cells(stack, mesh)
    # Adding 0.0 turns a rounded -0.0 into 0.0.
    rest = position = mesh.points[used].round(6) + 0.0
    start = "flat"
    if laminate.tube is not None:
        start = f"wrapped round a tube of {laminate.tube:.4g} mm, whose axis is z"
        on_tube = replace(stack, settings=MeshSettings(h))
        position = shell_mesh(on_tube, flat(on_tube)).points[used].round(6) + 0.0
    base = number[mesh.node_sets["base"]]
    return Shell(
        rest=rest,
        position=position,
        membranes=_membranes(corners, cells),
        bending=_bending(corners, cells),
        cavities={
            chamber.name: _walls(mesh.face_sets[f"cavity_{chamber.name}"], corners)
            for chamber in laminate.chambers
        },
        fixed=base[base >= 0],
        tip=number[_marks(stack, mesh, number)],
        mass=float(volumes(mesh.kind, mesh.points, mesh.cells) @ cells[:, MASS]),
        size=max(radii) / 2.5,
        about=(
            f"{len(rest)} nodes, {len(corners)} triangles, inlets and their strips among them.\n"
            f"It starts {start}."
        ),
    )


def _walls(faces: NDArray[np.int64], corners: Triangles) -> Triangles:
    """A cavity's walls, normals out of the air."""
    # Face 0 of a triangle faces down, face 1 up, each into the air that touches it.
    walls = corners[faces[:, 0]]
    return np.where(faces[:, 1:] == 0, walls, walls[:, ::-1])


def _cells(stack: Layup, mesh: Mesh) -> NDArray[np.float64]:
    """Return the properties of each cell, one row each, for its stack of bonded films."""
    properties = np.zeros((len(mesh.cells), 5))
    thickness = np.zeros(len(mesh.cells))
    properties[:, LOWEST] = -1
    for k, ply in enumerate(stack.plies):
        of_ply = mesh.cell_sets[ply.name]
        young, ratio = elastic_of(ply.layer.film)
        dense = density_of(ply.layer.film, "a simulation")
        properties[of_ply, STRETCH] += 1000 * young * ply.thickness
        properties[of_ply, MASS] += 1e-9 * dense * ply.thickness
        properties[of_ply, RATIO] += ratio * ply.thickness
        thickness[of_ply] += ply.thickness
        properties[of_ply[properties[of_ply, LOWEST] < 0], LOWEST] = k
    properties[:, RATIO] /= thickness
    properties[:, BENDING] = (
        properties[:, STRETCH] * thickness**2 / (12 * (1 - properties[:, RATIO] ** 2))
    )
    return properties.round(12)


def _membranes(corners: Triangles, cells: NDArray[np.float64]) -> tuple[FilmGroup, ...]:
    kinds, kind = np.unique(cells[:, [STRETCH, RATIO]], axis=0, return_inverse=True)
    return tuple(
        FilmGroup(f"membrane{n + 1}", corners[kind.ravel() == n], float(stretch), float(ratio))
        for n, (stretch, ratio) in enumerate(kinds)
    )


def _bending(corners: Triangles, cells: NDArray[np.float64]) -> tuple[FilmGroup, ...]:
    """Groups in which no edge has more than two triangles.

    Cells with the same lowest film lie side by side; separate films share a group if they share no
    node.
    """
    bins: list[tuple[float, Triangles]] = []
    kinds, kind = np.unique(cells[:, [BENDING, LOWEST]], axis=0, return_inverse=True)
    for n, (stiffness, _) in enumerate(kinds.tolist()):
        of_kind = corners[kind.ravel() == n]
        for place, (other, triangles) in enumerate(bins):
            if other == stiffness and not np.isin(of_kind, triangles).any():
                bins[place] = stiffness, np.concatenate([triangles, of_kind])
                break
        else:
            bins.append((stiffness, of_kind))
    return tuple(
        FilmGroup(f"bend{n + 1}", triangles, stiffness, 0.0)
        for n, (stiffness, triangles) in enumerate(bins)
    )


def _marks(stack: Layup, mesh: Mesh, number: NDArray[np.int64]) -> list[int]:
    """Nodes of the highest film: the axes of three stacks or more, or four round its middle."""
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
