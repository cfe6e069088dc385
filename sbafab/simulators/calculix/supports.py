"""What holds the actuator: its base, or a lone balloon's ring, and planes of symmetry."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from sbafab.meshing.conforming.model import Mesh

if TYPE_CHECKING:
    from numpy.typing import NDArray

BASE = "base"
RING = "bond_001"
FLAT = 1e-6


def is_lone_balloon(mesh: Mesh) -> bool:
    """Whether the mesh is of two films only: nothing but the bonded ring can hold them."""
    return sum(name.startswith("film_") for name in mesh.cell_sets) == 2


def supports(mesh: Mesh) -> Iterator[str]:
    """The node set ``held``, and lines of ``*BOUNDARY`` and ``*EQUATION``.

    A stack stands on its base. A lone balloon bulges both ways, and its ring may ripple, as in the
    paper's model: a few nodes of the ring hold what a rigid body could do, and nothing else.
    """
    if is_lone_balloon(mesh):
        fixed = list(_fixed_freedoms(mesh))
        nodes = sorted({node for node, _ in fixed})
        yield "*NSET, NSET=held\n" + "".join(f"{node}\n" for node in nodes)
        yield "*BOUNDARY\n" + "".join(f"{node}, {axis}\n" for node, axis in fixed)
    else:
        yield f"*NSET, NSET=held\n{BASE}\n*BOUNDARY\n{BASE}, 1, 3\n"
    for name in _planes(mesh):
        yield from _on_plane(mesh, name)


def _planes(mesh: Mesh) -> list[str]:
    return [name for name in mesh.node_sets if name.startswith("symmetry_")]


def _fixed_freedoms(mesh: Mesh) -> Iterator[tuple[int, int]]:
    """Nodes, from 1, and axes: as many as the planes of symmetry leave a rigid body to do."""
    ring = mesh.node_sets[RING]
    x, y = mesh.points[ring, 0], mesh.points[ring, 1]
    far = float(np.abs(y).max())
    corners = [
        int(ring[np.hypot(x - px, y - py).argmin()]) + 1
        for px, py in ((-far, 0.0), (0.0, far), (0.0, -far))
    ]
    planes = _planes(mesh)
    for node in corners[: 3 - len(planes)]:
        yield node, 3
    in_plane = list(zip(corners, (2, 1, 1), strict=True))
    if planes == ["symmetry_y"]:
        in_plane = in_plane[1:2]
    elif planes:
        in_plane = in_plane[: 2 - len(planes)]
    yield from in_plane


def _on_plane(mesh: Mesh, name: str) -> Iterator[str]:
    """The nodes of one symmetry plane stay on it."""
    nodes = mesh.node_sets[name]
    normal = _normal(mesh.points[nodes, :2])
    if min(abs(normal)) < FLAT:
        yield f"*BOUNDARY\n{name}, {1 if abs(normal[0]) > FLAT else 2}\n"
        return
    held = np.empty(0, dtype=np.int64) if is_lone_balloon(mesh) else mesh.node_sets[BASE]
    on_axis = nodes[np.hypot(*mesh.points[nodes, :2].T) < FLAT]
    for node in np.setdiff1d(on_axis, held):
        yield f"*BOUNDARY\n{node + 1}, 1, 2\n"
    # The first term is the one that is eliminated: that of the larger factor.
    first, second = (1, 2) if abs(normal[0]) >= abs(normal[1]) else (2, 1)
    for node in np.setdiff1d(nodes, np.concatenate([held, on_axis])):
        yield (
            f"*EQUATION\n2\n{node + 1}, {first}, {normal[first - 1]:.12g}, "
            f"{node + 1}, {second}, {normal[second - 1]:.12g}\n"
        )


def _normal(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit normal of the upright plane through the axis and these places."""
    x, y = places[np.hypot(*places.T).argmax()]
    normal: NDArray[np.float64] = np.array([-y, x]) / np.hypot(x, y)
    return normal
