"""How large and how good a mesh is."""

from __future__ import annotations

from typing import TypedDict

from sbafab.meshing.conforming.elements import aspects, scaled_jacobians, volumes
from sbafab.meshing.conforming.model import Mesh


class Statistics(TypedDict):
    """How large and how good a mesh is. Aspect is longest edge over shortest."""

    nodes: int
    elements: int
    element: str
    least_scaled_jacobian: float
    worst_aspect: float
    volume_mm3: float
    height_mm: float


def mesh_statistics(mesh: Mesh) -> Statistics:
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
    )
