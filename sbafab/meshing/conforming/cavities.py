"""Cavities: the faces of a mesh that the air of a chamber presses on, and a closed surface."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from sbafab.errors import OutputError
from sbafab.meshing.conforming.elements import FACES, ElementKind
from sbafab.meshing.conforming.layup import Layup, MeshedVoid
from sbafab.meshing.conforming.plane import Plane
from sbafab.meshing.conforming.sweep import Sweep

if TYPE_CHECKING:
    from numpy.typing import NDArray

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


TRIANGLE_PARTS = ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5))
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
