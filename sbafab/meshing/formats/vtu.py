"""VTU for ParaView: elements of second order, their sets as fields."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sbafab.meshing.conforming.mesh import VTK_TYPES, Mesh

if TYPE_CHECKING:
    Field = NDArray[np.float64] | NDArray[np.int64] | NDArray[np.int32] | NDArray[np.uint8]

TYPE_NAMES = {"f8": "Float64", "i8": "Int64", "i4": "Int32", "u1": "UInt8"}
FAST = 1


def write_vtu(mesh: Mesh, path: Path) -> None:
    """Write a mesh.

    The cell field ``part`` counts films and bonds, or a shell's sections, from 1 in their order;
    node sets other than bonds are point fields of 0 and 1, face sets cell fields. The point field
    ``rest`` is where nodes are in the flat laminate, if they are elsewhere.
    """
    of_nodes: dict[str, Field] = {**mesh.node_fields()}
    if mesh.rest is not None:
        of_nodes["rest"] = mesh.rest
    write_fields(path, mesh.kind, mesh.points, mesh.cells, of_nodes, mesh.cell_fields(), mesh.notes)


def write_cavity_vtu(mesh: Mesh, cavity: str, path: Path) -> None:
    """Write a cavity's surface; the point field ``node`` is the mesh's node, from 0."""
    surface, nodes = mesh.cavity(cavity)
    write_fields(path, "triangle", surface.points, surface.faces, {"node": nodes}, {})


def write_fields(
    path: Path,
    kind: str,
    points: NDArray[np.float64],
    cells: NDArray[np.int64],
    of_points: Mapping[str, Field],
    of_cells: Mapping[str, Field],
    notes: Sequence[str] = (),
) -> None:
    """Write points, cells of one kind, and a field (n,) or (n, k) of points or cells by name."""
    count, size = cells.shape
    lines = [
        '<?xml version="1.0"?>',
        *(f"<!-- {note} -->" for note in notes),
        '<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" '
        'header_type="UInt64" compressor="vtkZLibDataCompressor">',
        f'<UnstructuredGrid><Piece NumberOfPoints="{len(points)}" NumberOfCells="{count}">',
        "<Points>",
        _array("points", points),
        "</Points><Cells>",
        _array("connectivity", cells.astype(np.int64)),
        _array("offsets", np.arange(size, size * count + 1, size, dtype=np.int64)),
        _array("types", np.full(count, VTK_TYPES[kind], dtype=np.uint8)),
        "</Cells><PointData>",
        *(_array(name, values) for name, values in of_points.items()),
        "</PointData><CellData>",
        *(_array(name, values) for name, values in of_cells.items()),
        "</CellData></Piece></UnstructuredGrid></VTKFile>",
        "",
    ]
    path.write_text("\n".join(lines), encoding="ascii", newline="\n")


def _array(name: str, values: Field) -> str:
    """Return a data array in one compressed block."""
    content = np.ascontiguousarray(values).astype(values.dtype.newbyteorder("<")).tobytes()
    packed = zlib.compress(content, FAST)
    header = np.array([1, len(content), len(content), len(packed)], dtype="<u8").tobytes()
    is_field = values.ndim > 1 and name != "connectivity"
    width = f' NumberOfComponents="{values.shape[1]}"' if is_field else ""
    kind = TYPE_NAMES[f"{values.dtype.kind}{values.dtype.itemsize}"]
    text = (base64.b64encode(header) + base64.b64encode(packed)).decode("ascii")
    return f'<DataArray type="{kind}" Name="{name}"{width} format="binary">{text}</DataArray>'
