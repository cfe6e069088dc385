"""The sweep: the triangulation swept through every film, bonded faces sharing nodes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from sbafab.errors import OutputError
from sbafab.meshing.conforming.layup import FormedFilm, Layup, MeshedVoid
from sbafab.meshing.conforming.mesh import FACES, TRIANGLE_PARTS, ElementKind
from sbafab.meshing.conforming.plane import Plane

if TYPE_CHECKING:
    from numpy.typing import NDArray

NONE = -1


@dataclass(frozen=True)
class Sweep:
    """Nodes and prisms of the swept films.

    ``prisms`` (m, 18) hold the six nodes of a triangle below, halfway up and above.
    ``lower``, ``middle`` and ``upper`` (plies, plane nodes) number the nodes of each film over
    the plane's, -1 where there are none; ``joints`` those halfway up the bond under each film.
    ``prism_of`` and ``joint_of`` (plies, triangles) number the prisms of films and bonds.
    """

    points: NDArray[np.float64]
    prisms: NDArray[np.int64]
    lower: NDArray[np.int64]
    middle: NDArray[np.int64]
    upper: NDArray[np.int64]
    joints: NDArray[np.int64]
    prism_of: NDArray[np.int64]
    joint_of: NDArray[np.int64]


def sweep(layup: Layup, forms: Sequence[FormedFilm], full_middles: bool) -> Sweep:
    """The films as prisms, bottom to top.

    Where films lie on each other, the nodes in the closure of a bond are one; where gaps are
    kept, wedges join them. ``full_middles`` puts a node halfway up over mid-edge nodes too, as
    tetrahedra need.
    """
    triangles = layup.plane.triangles
    shape = len(layup.plies), len(layup.plane.points)
    lower, middle, upper, joints = (np.full(shape, NONE, dtype=np.int64) for _ in range(4))
    prism_of, joint_of = (np.full((shape[0], len(triangles)), NONE) for _ in range(2))
    points: list[NDArray[np.float64]] = []
    prisms: list[NDArray[np.int64]] = []
    count = made = 0

    def place(
        numbers: NDArray[np.int64], nodes: NDArray[np.int64], at: NDArray[np.float64]
    ) -> None:
        nonlocal count
        numbers[nodes] = np.arange(count, count + len(nodes))
        points.append(at[nodes])
        count += len(nodes)

    def fill(of: NDArray[np.int64], cells: NDArray[np.bool_], *levels: NDArray[np.int64]) -> None:
        nonlocal made
        chosen = np.flatnonzero(cells)
        of[chosen] = np.arange(made, made + len(chosen))
        prisms.append(_prisms(triangles[chosen], *levels))
        made += len(chosen)

    for k, (ply, form) in enumerate(zip(layup.plies, forms, strict=True)):
        covered = np.unique(triangles[ply.cells])
        bonded = np.unique(triangles[ply.bonded])
        if not ply.gap:
            lower[k, bonded] = upper[k - 1, bonded] if k else NONE
        place(lower[k], covered[lower[k, covered] < 0], form.at(0.0))
        if ply.gap:
            below = forms[k - 1].at(layup.plies[k - 1].thickness)
            place(joints[k], _half_up(layup, bonded, full_middles), (below + form.at(0.0)) / 2)
            fill(joint_of[k], ply.bonded, upper[k - 1], joints[k], lower[k])
        place(middle[k], _half_up(layup, covered, full_middles), form.at(ply.thickness / 2))
        place(upper[k], covered, form.at(ply.thickness))
        fill(prism_of[k], ply.cells, lower[k], middle[k], upper[k])
    return Sweep(
        np.concatenate(points),
        np.concatenate(prisms),
        lower,
        middle,
        upper,
        joints,
        prism_of,
        joint_of,
    )


def _half_up(layup: Layup, nodes: NDArray[np.int64], full: bool) -> NDArray[np.int64]:
    return nodes if full else nodes[nodes < layup.plane.corners]


def _prisms(triangles: NDArray[np.int64], *levels: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.hstack([level[triangles] for level in levels])


def wedges(prisms: NDArray[np.int64]) -> NDArray[np.int64]:
    """The prisms as wedges (m, 15) of second order."""
    return prisms[:, [0, 1, 2, 12, 13, 14, 3, 4, 5, 15, 16, 17, 6, 7, 8]]


# Cavities: the faces of a mesh that the air of a chamber presses on, and a closed surface.


BOTTOM, TOP, SIDES = 0, 1, 2
"""Numbers of a wedge's faces; the sides follow the triangle's edges."""


def neighbours(plane: Plane) -> NDArray[np.int64]:
    """The triangle (m, 3) beyond each side of each triangle, -1 where there is none."""
    middles = plane.triangles[:, 3:].ravel()
    order = np.argsort(middles, kind="stable")
    ranked = middles[order]
    twins = np.flatnonzero(ranked[1:] == ranked[:-1])
    beyond = np.full(len(middles), -1)
    beyond[order[twins]] = order[twins + 1] // 3
    beyond[order[twins + 1]] = order[twins] // 3
    return beyond.reshape(-1, 3)


def bordering(
    inside: NDArray[np.bool_], other: NDArray[np.bool_], beyond: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Triangles of ``inside`` and their sides that lie against a triangle of ``other``."""
    # A last entry that is False stands for what lies beyond the plane.
    padded = np.append(other, False)
    cells, sides = np.nonzero(inside[:, None] & padded[beyond])
    return cells, sides


def wetted(
    layup: Layup, swept: Sweep, void: MeshedVoid, beyond: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Prisms and their faces (k, 2) that the air of a void touches."""
    found: list[NDArray[np.int64]] = []

    def add(prisms: NDArray[np.int64], faces: NDArray[np.int64] | int) -> None:
        found.append(np.column_stack([prisms, np.broadcast_to(faces, prisms.shape)]))

    for k, cells in sorted(void.under.items()):
        below, above = layup.plies[k - 1].cells, layup.plies[k].cells
        add(swept.prism_of[k - 1][cells & below], TOP)
        add(swept.prism_of[k][cells & above], BOTTOM)
        if layup.plies[k].gap:
            bond, sides = bordering(layup.plies[k].bonded, cells, beyond)
            add(swept.joint_of[k][bond], SIDES + sides)
    for k, cells in sorted(void.in_films.items()):
        film, sides = bordering(layup.plies[k].cells, cells, beyond)
        add(swept.prism_of[k][film], SIDES + sides)
    return np.concatenate(found)


def mouths(
    layup: Layup, void: MeshedVoid, beyond: NDArray[np.int64]
) -> list[tuple[int, NDArray[np.int64]]]:
    """Where a void ends without a bond: plies above it, and sides (k, 3) of triangles there.

    A side is its first corner, second corner and middle, the void on its left. The sides on a
    symmetry plane are not among them.
    """
    plane = layup.plane
    on_symmetry = np.zeros((0, len(plane.points)), dtype=bool)
    if layup.sector is not None:
        on_symmetry = np.array([on for _, on in layup.sector.on_planes(plane.points)])
    found = []
    for k, cells in sorted(void.under.items()):
        closed = np.append(cells | layup.plies[k].bonded, False)
        triangles, sides = np.nonzero(cells[:, None] & ~closed[beyond])
        nodes = plane.triangles[triangles]
        rows = np.arange(len(nodes))
        edges = np.column_stack(
            [nodes[rows, sides], nodes[rows, (sides + 1) % 3], nodes[rows, 3 + sides]]
        )
        edges = edges[~on_symmetry[:, edges[:, :2]].all(axis=2).any(axis=0)]
        if len(edges):
            found.append((k, edges))
    return found


def mouth_patch(
    layup: Layup, swept: Sweep, ply: int, edges: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Triangles (k, 3) of mesh nodes between the two films at a void's mouth, out of the void."""
    low, high, half = swept.upper[ply - 1], swept.lower[ply], swept.joints[ply]
    triangles = []
    for a, b, m in edges.tolist():
        ring = [low[b], half[b], high[b], high[m], high[a], half[a], low[a]]
        ring = [int(node) for node in ring if node >= 0]
        if min(low[[a, b, m]].min(), high[[a, b, m]].min()) < 0:
            x, y = layup.plane.points[m]
            raise OutputError(
                f"A pocket under layer {layup.plies[ply].layer.index} opens at x {x:.3f}, "
                f"y {y:.3f} where one film only ends; let both films end there."
            )
        for p, q in pairwise(ring):
            if len({int(low[m]), p, q}) == 3:
                triangles.append((int(low[m]), p, q))
    return np.array(triangles, dtype=np.int64).reshape(-1, 3)


SQUARE_PARTS = ((0, 4, 7), (4, 1, 5), (5, 2, 6), (6, 3, 7), (4, 5, 6), (4, 6, 7))


def flat_triangles(
    kind: ElementKind, cells: NDArray[np.int64], faces: NDArray[np.int64]
) -> NDArray[np.int64]:
    """The faces (k, 2: cell and face number) as flat triangles through all of their nodes."""
    found = [np.empty((0, 3), dtype=np.int64)]
    for number, local in enumerate(FACES[kind]):
        nodes = cells[faces[faces[:, 1] == number, 0]][:, list(local)]
        parts = TRIANGLE_PARTS if len(local) == 6 else SQUARE_PARTS
        found += [nodes[:, list(part)] for part in parts]
    return np.concatenate(found)


def faces_of_tetrahedra(
    prisms: NDArray[np.int64], tetrahedra: NDArray[np.int64], faces: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Prism faces (k, 2) as the faces of the three tetrahedra of each prism that lie in them."""
    wedge_corners = [[0, 1, 2], [12, 13, 14], [0, 1, 13, 12], [1, 2, 14, 13], [2, 0, 12, 14]]
    found = []
    for number, local in enumerate(wedge_corners):
        owners = faces[faces[:, 1] == number, 0]
        nodes = prisms[owners][:, local]
        for part in range(3):
            cells = 3 * owners + part
            for face, of_tetra in enumerate(FACES["tetra10"]):
                corners = tetrahedra[cells][:, list(of_tetra[:3])]
                lies_in = (corners[:, :, None] == nodes[:, None, :]).any(axis=2).all(axis=1)
                chosen = cells[lies_in]
                found.append(np.column_stack([chosen, np.full_like(chosen, face)]))
    rows = np.concatenate(found)
    return rows[np.lexsort((rows[:, 1], rows[:, 0]))]


def open_sides(triangles: NDArray[np.int64]) -> int:
    """How many sides of the triangles are not the side of one other, run the other way."""
    size = int(triangles.max(initial=0)) + 1
    heads = np.roll(triangles, -1, axis=1)
    forth = np.sort((triangles * size + heads).ravel())
    back = np.sort((heads * size + triangles).ravel())
    if np.array_equal(forth, back) and np.all(forth[1:] != forth[:-1]):
        return 0
    _, times = np.unique(forth, return_counts=True)
    return int(np.count_nonzero(~np.isin(forth, back)) + np.count_nonzero(times > 1))
