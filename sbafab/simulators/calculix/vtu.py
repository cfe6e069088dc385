"""The deformed mesh for ParaView, with what the run found at its nodes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from sbafab.meshing.conforming.model import Mesh
from sbafab.meshing.conforming.write_vtu import VTK_TYPES
from sbafab.simulators.calculix.frd import Frame

if TYPE_CHECKING:
    from numpy.typing import NDArray


def write_deformed(mesh: Mesh, frame: Frame, path: Path) -> None:
    """Write the deformed shape: ``displacement`` in mm, ``stress`` and ``von_mises`` in MPa.

    To see the undeformed one, warp by the displacement with a factor of -1.
    """
    count, size = mesh.cells.shape
    lines = [
        '<?xml version="1.0"?>',
        '<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian">',
        f'<UnstructuredGrid><Piece NumberOfPoints="{len(mesh.points)}" NumberOfCells="{count}">',
        "<Points>",
        _array("points", mesh.points + frame.displacement),
        "</Points><Cells>",
        _array("connectivity", mesh.cells),
        _array("offsets", np.arange(size, size * count + 1, size)[:, None]),
        _array("types", np.full((count, 1), VTK_TYPES[mesh.kind])),
        '</Cells><PointData Vectors="displacement" Scalars="von_mises">',
        _array("displacement", frame.displacement),
        _array("von_mises", frame.von_mises[:, None]),
        # VTK's order of a symmetric tensor is that of CalculiX.
        _array("stress", frame.stress),
        "</PointData></Piece></UnstructuredGrid></VTKFile>",
        "",
    ]
    path.write_text("\n".join(lines), encoding="ascii", newline="\n")


def _array(name: str, values: NDArray[np.float64] | NDArray[np.int64]) -> str:
    is_whole = values.dtype.kind == "i"
    pattern = " ".join(["%d" if is_whole else "%.7g"] * values.shape[1])
    text = "\n".join([pattern % tuple(row) for row in values.tolist()])
    width = f' NumberOfComponents="{values.shape[1]}"' if values.shape[1] > 1 else ""
    kind = "Int64" if is_whole else "Float64"
    return f'<DataArray type="{kind}" Name="{name}"{width} format="ascii">\n{text}\n</DataArray>'
