"""Legacy VTK as text for SOFA's MeshVTKLoader, which has no wedges."""

from __future__ import annotations

from pathlib import Path

from sbafab.meshing.conforming.mesh import Mesh

POINT = "%.10g %.10g %.10g\n"
TRIANGLE, TETRAHEDRON = 5, 10


def write_vtk(mesh: Mesh, path: Path) -> None:
    """Write a mesh as first-order tetrahedra or triangles, from the corner nodes only."""
    points, cells, owner = mesh.linear()
    kind = TETRAHEDRON if cells.shape[1] == 4 else TRIANGLE
    part = [0] * len(mesh.cells)
    for number, chosen in enumerate(mesh.parts.values(), start=1):
        for cell in chosen.tolist():
            part[cell] = number
    pattern = f"{cells.shape[1]}" + " %d" * cells.shape[1] + "\n"
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write(f"# vtk DataFile Version 3.0\n{mesh.name} mesh in mm\nASCII\n")
        file.write(f"DATASET UNSTRUCTURED_GRID\nPOINTS {len(points)} double\n")
        file.write("".join(POINT % tuple(point) for point in points.tolist()))
        file.write(f"CELLS {len(cells)} {cells.size + len(cells)}\n")
        file.write("".join(pattern % tuple(cell) for cell in cells.tolist()))
        file.write(f"CELL_TYPES {len(cells)}\n" + f"{kind}\n" * len(cells))
        file.write(f"CELL_DATA {len(cells)}\nSCALARS part int 1\nLOOKUP_TABLE default\n")
        file.write("".join(f"{part[cell]}\n" for cell in owner.tolist()))
