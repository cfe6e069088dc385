"""A mesh as every writer reads it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from sbafab.meshing.conforming.elements import CORNERS, ElementKind
from sbafab.meshing.conforming.sweep import split_wedges
from sbafab.meshing.surface import Surface

if TYPE_CHECKING:
    import meshio
    import numpy as np
    import pyvista
    from numpy.typing import NDArray


@dataclass(frozen=True)
class Mesh:
    """Elements of one kind, and named parts of them.

    ``points`` (n, 3) mm; ``cells`` (m, nodes) indices of points. ``node_sets`` and ``cell_sets``
    hold sorted indices; ``face_sets`` rows of cell and face number, as in ``elements.FACES``.
    ``cavities`` are closed surfaces (k, 3) of flat triangles in this mesh's nodes, counter-
    clockwise seen from outside of the air; inlets are closed by a patch. ``thickness`` is a
    shell's, in mm, a value a cell set. ``notes`` are sentences for whoever reads a file of it.
    ``materials`` names the film that each part of a volume mesh is of; a bond is of what melts.
    ``rest`` (n, 3) is where the points are in the flat laminate, free of stress; None where they
    are there.
    """

    name: str
    kind: ElementKind
    points: NDArray[np.float64]
    cells: NDArray[np.int64]
    node_sets: Mapping[str, NDArray[np.int64]]
    cell_sets: Mapping[str, NDArray[np.int64]]
    face_sets: Mapping[str, NDArray[np.int64]]
    cavities: Mapping[str, NDArray[np.int64]]
    thickness: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    materials: Mapping[str, str] = field(default_factory=dict)
    rest: NDArray[np.float64] | None = None

    @property
    def parts(self) -> dict[str, NDArray[np.int64]]:
        """The cell sets that share the cells out: films and bonds, or a shell's thicknesses."""
        names = self.thickness or self.cell_sets
        return {name: self.cell_sets[name] for name in names}

    def cavity(self, name: str) -> tuple[Surface, NDArray[np.int64]]:
        """A cavity as a surface of its own, and the mesh's node of each of its points."""
        import numpy as np

        nodes, faces = np.unique(self.cavities[name], return_inverse=True)
        return Surface(self.points[nodes], faces.reshape(-1, 3)), nodes

    def meshio(self) -> meshio.Mesh:
        """The mesh for meshio (extra "python"): second-order cells, fields and sets."""
        from sbafab.meshing.conforming.exchange import as_meshio

        return as_meshio(self)

    def pyvista(self) -> pyvista.UnstructuredGrid:
        """The mesh for PyVista (extra "python"), with the fields that a VTU file has."""
        from sbafab.meshing.conforming.exchange import as_pyvista

        return as_pyvista(self)

    def linear(self) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
        """Points, and tetrahedra or triangles of first order through the corners; the cell of each.

        Wedges become three tetrahedra each.
        """
        import numpy as np

        count = CORNERS[self.kind]
        corners = self.cells[:, :count]
        owner = np.arange(len(corners))
        if self.kind == "wedge15":
            corners = split_wedges(corners)
            owner = np.repeat(owner, 3)
        nodes, cells = np.unique(corners, return_inverse=True)
        return self.points[nodes], cells.reshape(corners.shape), owner
