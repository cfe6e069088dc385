"""Meshes as objects of meshio and PyVista, with the same fields as in a VTU file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sbafab.errors import DesignError
from sbafab.meshing.conforming.elements import CORNERS
from sbafab.meshing.conforming.write_vtu import VTK_TYPES, cell_fields, node_fields

if TYPE_CHECKING:
    import meshio
    import pyvista

    from sbafab.meshing.conforming.model import Mesh


def as_meshio(mesh: Mesh) -> meshio.Mesh:
    """The mesh for meshio, point and cell sets included. Raises DesignError without meshio.

    meshio 5.3 refuses wedges of 15 nodes: they come as wedges of their six corners, and the points
    of their mid-edge nodes belong to no cell. Meshes of tetrahedra keep their second order.
    """
    try:
        import meshio
    except ImportError as error:
        raise _missing("meshio") from error
    wedges = mesh.kind == "wedge15"
    cells = ("wedge", mesh.cells[:, : CORNERS["wedge15"]]) if wedges else (mesh.kind, mesh.cells)
    return meshio.Mesh(
        mesh.points,
        [cells],
        point_data=node_fields(mesh),
        cell_data={name: [values] for name, values in cell_fields(mesh).items()},
        point_sets=dict(mesh.node_sets),
        cell_sets={name: [cells] for name, cells in mesh.cell_sets.items()},
    )


def as_pyvista(mesh: Mesh) -> pyvista.UnstructuredGrid:
    """The mesh for PyVista. Raises DesignError without pyvista."""
    try:
        import pyvista
    except ImportError as error:
        raise _missing("pyvista") from error
    grid = pyvista.UnstructuredGrid({VTK_TYPES[mesh.kind]: mesh.cells}, mesh.points)
    for name, values in node_fields(mesh).items():
        grid.point_data[name] = values
    for name, marks in cell_fields(mesh).items():
        grid.cell_data[name] = marks
    return grid


def _missing(library: str) -> DesignError:
    return DesignError(f'{library} is not installed; add it with pip install "sbafab[python]"')
