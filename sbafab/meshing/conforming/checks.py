"""What must hold before a mesh is written."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sbafab.errors import OutputError
from sbafab.meshing.conforming.cavities import flat_triangles, open_sides
from sbafab.meshing.conforming.elements import CORNERS, FACES, scaled_jacobians, volumes
from sbafab.meshing.conforming.model import Mesh
from sbafab.meshing.surface import Surface

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

VOLUME_TOLERANCE = 0.001


def check_mesh(mesh: Mesh, expected: Mapping[str, float]) -> None:
    """Raises OutputError where an element is inverted, the skin is not manifold or a volume off.

    ``expected`` gives the exact volume in mm3 of cell sets.
    """
    _check_jacobians(mesh)
    if mesh.kind != "triangle6":
        _check_skin(mesh)
    if expected:
        sizes = volumes(mesh.kind, mesh.points, mesh.cells)
        for name, volume in expected.items():
            found = float(sizes[mesh.cell_sets[name]].sum())
            if not abs(found - volume) <= VOLUME_TOLERANCE * volume:
                raise OutputError(
                    f"The {mesh.name} mesh of {name} holds {found:.5f} mm3 where area x thickness "
                    f"is {volume:.5f} mm3; ask for a smaller h."
                )


def check_cavities(mesh: Mesh) -> None:
    """Raises OutputError where a cavity's surface is not closed."""
    for name, triangles in mesh.cavities.items():
        gaps = open_sides(triangles)
        if gaps:
            raise OutputError(
                f"The cavity {name} of the {mesh.name} mesh is open at {gaps} edges; move apart "
                "profiles that touch in one point."
            )


def _check_jacobians(mesh: Mesh) -> None:
    least = scaled_jacobians(mesh.kind, mesh.points, mesh.cells)
    worst = int(least.argmin())
    if least[worst] <= 0:
        x, y, z = mesh.points[mesh.cells[worst]].mean(axis=0)
        raise OutputError(
            f"{int((least <= 0).sum())} elements of the {mesh.name} mesh are inverted, the worst "
            f"at x {x:.3f}, y {y:.3f}, z {z:.3f}; ask for a smaller h or less fill."
        )


def skin(mesh: Mesh) -> NDArray[np.int64]:
    """The faces (k, 2: cell and face number) that one cell alone has."""
    size = len(mesh.points)
    keys, cells, numbers = [], [], []
    for number, local in enumerate(FACES[mesh.kind]):
        corners = np.sort(mesh.cells[:, [n for n in local if n < CORNERS[mesh.kind]]], axis=1)
        # Three of a square's corners tell it from every other face.
        keys.append((corners[:, 0] * size + corners[:, 1]) * size + corners[:, 2])
        cells.append(np.arange(len(corners)))
        numbers.append(np.full(len(corners), number))
    key = np.concatenate(keys)
    order = np.argsort(key, kind="stable")
    ranked = key[order]
    twin = np.append(False, ranked[1:] == ranked[:-1])
    alone = order[~twin & ~np.append(twin[1:], False)]
    return np.column_stack([np.concatenate(cells)[alone], np.concatenate(numbers)[alone]])


def skin_surface(mesh: Mesh) -> Surface:
    """The skin of a volume mesh, cavities included, as flat triangles through all of its nodes."""
    triangles = flat_triangles(mesh.kind, mesh.cells, skin(mesh))
    nodes, faces = np.unique(triangles, return_inverse=True)
    return Surface(mesh.points[nodes], faces.reshape(-1, 3))


def _check_skin(mesh: Mesh) -> None:
    size = len(mesh.points)
    outer = skin(mesh)
    sides = []
    for number, local in enumerate(FACES[mesh.kind]):
        corners = [n for n in local if n < CORNERS[mesh.kind]]
        nodes = mesh.cells[outer[outer[:, 1] == number, 0]][:, list(local)]
        for place in range(len(corners)):
            a, b = nodes[:, place], nodes[:, (place + 1) % len(corners)]
            # The middle tells apart two sides between the same corners.
            middle = nodes[:, len(corners) + place]
            sides.append(np.column_stack([a * size + b, b * size + a, middle]))
    forth, back, middle = np.concatenate(sides).T
    there = np.lexsort((middle, forth))
    here = np.lexsort((middle, back))
    is_closed = np.array_equal(forth[there], back[here]) and np.array_equal(
        middle[there], middle[here]
    )
    pairs = np.column_stack([forth[there], middle[there]])
    if not is_closed or (len(pairs) > 1 and (pairs[1:] == pairs[:-1]).all(axis=1).any()):
        raise OutputError(
            f"The skin of the {mesh.name} mesh is not closed and manifold; move apart profiles "
            "that touch in one point, or change h."
        )
