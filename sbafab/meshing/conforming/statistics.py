"""How large and how good a mesh is."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, TypedDict

from sbafab.meshing.conforming.elements import aspects, jacobians, scaled_jacobians, volumes
from sbafab.meshing.conforming.model import Mesh

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


class Statistics(TypedDict):
    """How large and how good a mesh is. Aspect is longest edge over shortest.

    ``thinnest_film_mm`` is the least thickness of a film that air has lifted.
    """

    nodes: int
    elements: int
    element: str
    least_scaled_jacobian: float
    worst_aspect: float
    volume_mm3: float
    height_mm: float
    thinnest_film_mm: float


class Thinning(NamedTuple):
    """By what part films over the pockets are larger than flat, in the mean and at most, and how
    thin they are there: no film changes its volume.
    """

    mean: float
    most: float
    thinnest_mm: float


def thinning(shell: Mesh, flat: Mesh) -> Thinning:
    """How much thinner the films of a shell are than in the same shell when flat."""
    import numpy as np

    pockets = np.unique(np.concatenate([faces[:, 0] for faces in shell.face_sets.values()]))
    thickness = np.zeros(len(shell.cells))
    for name, value in shell.thickness.items():
        thickness[shell.cell_sets[name]] = value

    def areas(mesh: Mesh) -> NDArray[np.float64]:
        slopes = jacobians(mesh.kind, mesh.points, mesh.cells[pockets], integration=True)
        found: NDArray[np.float64] = np.linalg.norm(
            np.cross(slopes[..., 0], slopes[..., 1]), axis=2
        )
        return found

    raised, before = areas(shell), areas(flat)
    growth = np.maximum((raised / before).max(axis=1), 1.0)
    return Thinning(
        float(raised.sum() / before.sum()) - 1,
        float(growth.max()) - 1,
        float((thickness[pockets] / growth).min()),
    )


def mesh_statistics(mesh: Mesh, thinnest_film_mm: float) -> Statistics:
    """Counts, quality and volume of a mesh; a shell's volume is area x thickness."""
    sizes = volumes(mesh.kind, mesh.points, mesh.cells)
    for name, thickness in mesh.thickness.items():
        sizes[mesh.cell_sets[name]] *= thickness
    least = scaled_jacobians(mesh.kind, mesh.points, mesh.cells)
    heights = mesh.points[:, 2]
    return Statistics(
        nodes=len(mesh.points),
        elements=len(mesh.cells),
        element=mesh.kind,
        least_scaled_jacobian=float(least.min()),
        worst_aspect=float(aspects(mesh.kind, mesh.points, mesh.cells).max()),
        volume_mm3=float(sizes.sum()),
        height_mm=float(heights.max() - heights.min()),
        thinnest_film_mm=thinnest_film_mm,
    )
