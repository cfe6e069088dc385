"""VTU: what ParaView reads, elements of second order with their sets as fields."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from sbafab.meshing.conforming.model import Mesh

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Field = NDArray[np.float64] | NDArray[np.int64] | NDArray[np.int32] | NDArray[np.uint8]

VTK_TYPES = {"triangle": 5, "triangle6": 22, "tetra10": 24, "wedge15": 26}
TYPE_NAMES = {"f8": "Float64", "i8": "Int64", "i4": "Int32", "u1": "UInt8"}
FAST = 1


def write_vtu(mesh: Mesh, path: Path) -> None:
    """Write a mesh.

    The cell field ``part`` counts films and bonds, or a shell's sections, from 1 in their order;
    node sets other than bonds are point fields of 0 and 1, face sets cell fields. The point field
    ``rest`` is where nodes are in the flat laminate, if they are elsewhere.
    """
    of_nodes: dict[str, Field] = {**node_fields(mesh)}
    if mesh.rest is not None:
        of_nodes["rest"] = mesh.rest
    write_fields(path, mesh.kind, mesh.points, mesh.cells, of_nodes, cell_fields(mesh), mesh.notes)


def node_fields(mesh: Mesh) -> dict[str, NDArray[np.uint8]]:
    """Node sets other than bonds, each as 0 or 1 a node."""
    return {
        name: _marked(len(mesh.points), chosen)
        for name, chosen in mesh.node_sets.items()
        if not name.startswith("bond_")
    }


def cell_fields(mesh: Mesh) -> dict[str, NDArray[np.int32] | NDArray[np.uint8]]:
    """``part``, the number of each cell's part from 1, and face sets, each as 0 or 1 a cell."""
    part = np.zeros(len(mesh.cells), dtype=np.int32)
    for number, cells in enumerate(mesh.parts.values(), start=1):
        part[cells] = number
    faces = {
        name: _marked(len(mesh.cells), chosen[:, 0]) for name, chosen in mesh.face_sets.items()
    }
    return {"part": part, **faces}


def write_cavity_vtu(mesh: Mesh, cavity: str, path: Path) -> None:
    """Write a cavity's surface; the point field ``node`` is the mesh's node, from 0."""
    surface, nodes = mesh.cavity(cavity)
    write_fields(path, "triangle", surface.points, surface.faces, {"node": nodes}, {})


def _marked(count: int, chosen: NDArray[np.int64]) -> NDArray[np.uint8]:
    marks = np.zeros(count, dtype=np.uint8)
    marks[chosen] = 1
    return marks


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
    """A data array in one compressed block."""
    content = np.ascontiguousarray(values).astype(values.dtype.newbyteorder("<")).tobytes()
    packed = zlib.compress(content, FAST)
    header = np.array([1, len(content), len(content), len(packed)], dtype="<u8").tobytes()
    is_field = values.ndim > 1 and name != "connectivity"
    width = f' NumberOfComponents="{values.shape[1]}"' if is_field else ""
    kind = TYPE_NAMES[f"{values.dtype.kind}{values.dtype.itemsize}"]
    text = (base64.b64encode(header) + base64.b64encode(packed)).decode("ascii")
    return f'<DataArray type="{kind}" Name="{name}"{width} format="binary">{text}</DataArray>'
