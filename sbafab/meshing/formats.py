"""Mesh formats: surfaces for CAD, printing and viewers, elements for solvers; lengths are mm."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, ConfigDict

from sbafab import plugins
from sbafab.documents import Document
from sbafab.errors import OutputError
from sbafab.laminate.laminate import Chamber, Laminate
from sbafab.meshing.conforming.mesh import VTK_TYPES, ElementKind, Mesh
from sbafab.meshing.solid import TubeWrap, cavity, sealed, solid, tube_wrap, wrapped
from sbafab.meshing.surface import Floats, Ints, Surface

Field = Floats | Ints | NDArray[np.int32] | NDArray[np.uint8]

# Surfaces as STL, OBJ and PLY, and as GLB for viewers; trimesh writes them.


LinearRGB = tuple[float, float, float]
FILM: LinearRGB = (0.78, 0.74, 0.65)
"""Linear red, green and blue: the off-white of TPE film."""
UPRIGHT_METRES = ((1e-3, 0, 0, 0), (0, 0, 1e-3, 0), (0, -1e-3, 0, 0), (0, 0, 0, 1))
"""From mm with z up to metres with y up, as GLB requires."""


class Node(NamedTuple):
    """One body of a scene; ``colour`` is linear, not sRGB."""

    name: str
    surface: Surface
    material: str
    colour: LinearRGB


def write_stl(surface: Surface, path: Path, _material: str = "") -> None:
    """Write binary STL in mm; the format cannot store a unit or a material."""
    path.write_bytes(surface.trimesh().export(file_type="stl"))


def write_obj(surface: Surface, path: Path) -> None:
    text = surface.trimesh().export(file_type="obj", header="mm", digits=9)
    path.write_text(text, encoding="ascii", newline="\n")


def write_ply(surface: Surface, path: Path) -> None:
    """Write binary PLY in mm, in single precision."""
    path.write_bytes(surface.trimesh().export(file_type="ply"))


def write_glb(surface: Surface, path: Path, material: str = "TPE") -> None:
    """Write GLB at true size, as a scene of one node."""
    write_scene([Node("solid", surface, material, FILM)], path)


def write_scene(nodes: Sequence[Node], path: Path) -> None:
    """Write GLB at true size, one node per body: coordinates in mm, scaled by the node."""
    from trimesh import Scene
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import PBRMaterial

    scene = Scene()
    for node in nodes:
        body = node.surface.trimesh()
        material = PBRMaterial(
            name=node.material,
            baseColorFactor=[round(255 * part) for part in (*node.colour, 1.0)],
            metallicFactor=0.0,
            roughnessFactor=0.55,
        )
        body.visual = TextureVisuals(material=material)
        scene.add_geometry(body, node.name, node.name, transform=np.array(UPRIGHT_METRES))
    path.write_bytes(scene.export(file_type="glb", include_normals=False))


# 3MF, which states its unit. It is written here, since trimesh's has random ids.


THREE_MF = {
    "[Content_Types].xml": """<?xml version="1.0" encoding="UTF-8"?>
<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">
<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>
<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/>
</Types>
""",
    "_rels/.rels": """<?xml version="1.0" encoding="UTF-8"?>
<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">
<Relationship Target="/3D/3dmodel.model" Id="rel0" \
Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/>
</Relationships>
""",
    "3D/3dmodel.model": """<?xml version="1.0" encoding="UTF-8"?>
<model unit="millimeter" xml:lang="en-US" \
xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">
<resources>
<basematerials id="1"><base name="{material}" displaycolor="#E4DFD2"/></basematerials>
<object id="2" type="model" pid="1" pindex="0"><mesh>
<vertices>
{vertices}</vertices>
<triangles>
{triangles}</triangles>
</mesh></object>
</resources>
<build><item objectid="2"/></build>
</model>
""",
}


def write_3mf(surface: Surface, path: Path, material: str = "TPE") -> None:
    """Write the surface in mm, as one object of one material."""
    vertices = _lines('<vertex x="%.6f" y="%.6f" z="%.6f"/>\n', surface.points)
    triangles = _lines('<triangle v1="%d" v2="%d" v3="%d"/>\n', surface.faces)
    values = {"material": material, "vertices": vertices, "triangles": triangles}
    write_zip(path, {name: text.format(**values).encode() for name, text in THREE_MF.items()})


def _lines(pattern: str, rows: Floats | Ints, first: int | None = None) -> str:
    """Return rows of an array as text, numbered from ``first`` if given."""
    columns = rows.T.tolist()
    numbers = [] if first is None else [range(first, first + len(rows))]
    return "".join([pattern % row for row in zip(*numbers, *columns, strict=True)])


def write_zip(path: Path, parts: Mapping[str, bytes]) -> None:
    """Write an archive that is the same on every machine at any date."""
    from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

    with ZipFile(path, "w") as archive:
        for name, data in parts.items():
            # ZipInfo has a fixed date, whereas a bare name would take the clock's; the creating
            # system must not vary either.
            entry = ZipInfo(name)
            entry.compress_type = ZIP_DEFLATED
            entry.create_system = 3
            archive.writestr(entry, data, compresslevel=1)


# VTU for ParaView: elements of second order, their sets as fields.


TYPE_NAMES = {"f8": "Float64", "i8": "Int64", "i4": "Int32", "u1": "UInt8"}
FAST = 1


def write_vtu(mesh: Mesh, path: Path) -> None:
    """Write a mesh.

    The cell field ``part`` counts films and bonds, or a shell's sections, from 1 in their order;
    node sets other than bonds are point fields of 0 and 1, face sets cell fields. The point field
    ``rest`` gives the flat positions of nodes, if they differ.
    """
    of_nodes: dict[str, Field] = {**mesh.node_fields()}
    if mesh.rest is not None:
        of_nodes["rest"] = mesh.rest
    write_fields(path, mesh.kind, mesh.points, mesh.cells, of_nodes, mesh.cell_fields(), mesh.notes)


def write_cavity_vtu(mesh: Mesh, cavity: str, path: Path) -> None:
    """Write a cavity's surface; the point field ``node`` is the mesh's node number, from 0."""
    surface, nodes = mesh.cavity(cavity)
    write_fields(path, "triangle", surface.points, surface.faces, {"node": nodes}, {})


def write_fields(
    path: Path,
    kind: str,
    points: Floats,
    cells: Ints,
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


# Legacy VTK as text for SOFA's MeshVTKLoader, which has no wedges.


def write_vtk(mesh: Mesh, path: Path) -> None:
    """Write a mesh as first-order tetrahedra or triangles, from the corner nodes only."""
    points, cells, owner = mesh.linear()
    count, size = cells.shape
    part = mesh.cell_fields()["part"][owner]
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write(f"# vtk DataFile Version 3.0\n{mesh.name} mesh in mm\nASCII\n")
        file.write(f"DATASET UNSTRUCTURED_GRID\nPOINTS {len(points)} double\n")
        file.write(_lines("%.10g %.10g %.10g\n", points))
        file.write(f"CELLS {count} {cells.size + count}\n")
        file.write(_lines(f"{size}" + " %d" * size + "\n", cells))
        kind = VTK_TYPES["tetra" if size == 4 else "triangle"]
        file.write(f"CELL_TYPES {count}\n" + f"{kind}\n" * count)
        file.write(f"CELL_DATA {count}\nSCALARS part int 1\nLOOKUP_TABLE default\n")
        file.write("".join(f"{number}\n" for number in part.tolist()))


# MSH 2.2 as text for Gmsh and the solvers around it, sets as physical groups.


POINT, TRIANGLE6, SQUARE8 = 15, 9, 16
MSH_TYPES = {"triangle6": TRIANGLE6, "tetra10": 11, "wedge15": 18}
MSH_ORDER = {
    "triangle6": [0, 1, 2, 3, 4, 5],
    "tetra10": [0, 1, 2, 3, 4, 5, 6, 7, 9, 8],
    "wedge15": [0, 1, 2, 3, 4, 5, 6, 8, 12, 7, 13, 14, 9, 11, 10],
}
"""Our nodes in the order of Gmsh's."""


def write_msh(mesh: Mesh, path: Path) -> None:
    """Write a mesh: films and bonds or sections, cavity walls of a volume, and node sets.

    Bonds of films that touch have no group: their nodes are shared.
    """
    groups: list[tuple[int, str]] = []
    blocks: list[tuple[int, int, Ints]] = []
    """Type, physical group and nodes of elements."""
    dimension = 2 if mesh.kind == "triangle6" else 3
    for name, cells in mesh.parts.items():
        groups.append((dimension, name))
        nodes = mesh.cells[cells][:, MSH_ORDER[mesh.kind]]
        blocks.append((MSH_TYPES[mesh.kind], len(groups), nodes))
    for name, faces in mesh.face_sets.items() if dimension == 3 else ():
        groups.append((2, name))
        for nodes in mesh.nodes_of(faces):
            blocks.append((TRIANGLE6 if nodes.shape[1] == 6 else SQUARE8, len(groups), nodes))
    for name, chosen in mesh.node_sets.items():
        if not name.startswith("bond_"):
            groups.append((0, name))
            blocks.append((POINT, len(groups), chosen[:, None]))
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write(f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n{len(groups)}\n")
        for number, (of_dimension, name) in enumerate(groups, start=1):
            file.write(f'{of_dimension} {number} "{name}"\n')
        file.write(f"$EndPhysicalNames\n$Nodes\n{len(mesh.points)}\n")
        file.write(_lines("%d %.12g %.12g %.12g\n", mesh.points, 1))
        file.write(f"$EndNodes\n$Elements\n{sum(len(nodes) for *_, nodes in blocks)}\n")
        first = 1
        for kind, group, nodes in blocks:
            pattern = f"%d {kind} 2 {group} {group}" + " %d" * nodes.shape[1] + "\n"
            file.write(_lines(pattern, nodes + 1, first))
            first += len(nodes)
        file.write("$EndElements\n")


# INP for Abaqus and CalculiX, every set written out.


INP_TYPES: dict[ElementKind, str] = {
    "wedge15": "C3D15",
    "tetra10": "C3D10",
    "triangle6": "STRI65",
}
"""Abaqus's names, also known to meshio; CalculiX uses them too, except S6 for STRI65."""
SHELL = "CalculiX calls the element STRI65 S6: change that word on the *ELEMENT lines for it."
SIDES = ("SNEG", "SPOS")
PER_LINE = 16


def write_inp(mesh: Mesh, path: Path) -> None:
    """Write nodes, elements, NSET, ELSET and SURFACE; numbering starts at 1, lengths are in mm."""
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.writelines(_inp_lines(mesh))


def _inp_lines(mesh: Mesh) -> Iterator[str]:
    notes = [f"{mesh.name} mesh in mm", *mesh.notes]
    notes += [SHELL] if mesh.kind == "triangle6" else []
    yield "".join(f"** {note}\n" for note in notes)
    yield "*NODE, NSET=all_nodes\n"
    yield _lines("%d, %.10g, %.10g, %.10g\n", mesh.points, 1)
    pattern = ", ".join(["%d"] * (mesh.cells.shape[1] + 1)) + "\n"
    for name, cells in mesh.parts.items():
        yield f"*ELEMENT, TYPE={INP_TYPES[mesh.kind]}, ELSET={name}\n"
        yield _lines(pattern, np.column_stack([cells, mesh.cells[cells]]) + 1)
    for name, cells in mesh.cell_sets.items():
        if name not in mesh.parts:
            yield f"*ELSET, ELSET={name}\n"
            yield from _listed(cells)
    yield "*ELSET, ELSET=all_elements\n"
    yield from (f"{name}\n" for name in mesh.parts)
    for name, nodes_of in mesh.node_sets.items():
        yield f"*NSET, NSET={name}\n"
        yield from _listed(nodes_of)
    for name, faces in mesh.face_sets.items():
        yield f"*SURFACE, NAME={name}, TYPE=ELEMENT\n"
        for cell, face in faces.tolist():
            side = SIDES[face] if mesh.kind == "triangle6" else f"S{face + 1}"
            yield f"{cell + 1}, {side}\n"


def _listed(numbers: Ints) -> Iterable[str]:
    texts = [str(number + 1) for number in numbers.tolist()]
    for first in range(0, len(texts), PER_LINE):
        yield ", ".join(texts[first : first + PER_LINE]) + "\n"


# All formats.


class MeshFormat(NamedTuple):
    """A file suffix, with the writing function for each content that the format supports.

    ``solid``: the flat solid with its film's material named. ``elements``: volume and shell meshes.
    ``surface``: skins and cavities. ``cavity``: a chamber's cavity with the numbers of its nodes in
    the mesh; written instead of ``surface``.
    """

    ending: str
    solid: Callable[[Surface, Path, str], None] | None = None
    elements: Callable[[Mesh, Path], None] | None = None
    surface: Callable[[Surface, Path], None] | None = None
    cavity: Callable[[Mesh, str, Path], None] | None = None


_OWN = (
    MeshFormat("vtu", elements=write_vtu, cavity=write_cavity_vtu),
    MeshFormat("vtk", elements=write_vtk),
    MeshFormat("msh", elements=write_msh),
    MeshFormat("inp", elements=write_inp),
    MeshFormat("stl", solid=write_stl, surface=write_stl),
    MeshFormat("obj", surface=write_obj),
    MeshFormat("ply", surface=write_ply),
    MeshFormat("3mf", solid=write_3mf),
    MeshFormat("glb", solid=write_glb),
)


@cache
def mesh_formats() -> tuple[MeshFormat, ...]:
    """Return all formats in the order of files, other packages' last."""
    own = [row.ending for row in _OWN]
    return _OWN + plugins.added(plugins.MESH_FORMATS, "mesh format", MeshFormat, own)


def conforming_endings() -> tuple[str, ...]:
    """Return the file suffixes selectable by ``sbafab mesh --format``."""
    return tuple(row.ending for row in mesh_formats() if row.elements or row.surface or row.cavity)


# Files of the flat solid and the cavities, each surface verified first.


MeshKind = Literal["solid", "cavity", "volume", "shell", "skin"]


class MeshFile(Document):
    """A mesh as the manifest lists it.

    ``file`` is relative to the output folder; ``chamber`` is None except for cavities; ``elements``
    counts triangles of surfaces, elements of volume and shell meshes. ``fill_ul`` is the air per
    balloon in ul for which the shape was computed.
    """

    model_config = ConfigDict(frozen=True, allow_inf_nan=False)

    file: str
    kind: MeshKind
    chamber: str | None
    fill_ul: float
    volume_mm3: Annotated[float, AfterValidator(lambda volume: round(volume, 6))]
    elements: int


def write_meshes(
    laminate: Laminate, folder: Path, progress: Callable[[int, int], None] | None = None
) -> tuple[list[MeshFile], list[tuple[str, str]]]:
    """Write ``mesh/solid.stl``, ``.3mf``, ``.glb`` and ``mesh/cavity_<chamber>.stl``, all flat.

    A laminate on a tube also gets ``mesh/solid_wrapped.*``, ``mesh/cavity_<chamber>_wrapped.stl``.
    ``folder`` is the output folder. ``progress`` is called with the number of files done and the
    total. Return the written files, and the omitted ones with the reason: an open surface, or a
    volume that is not the sum of area x thickness.
    """
    (folder / "mesh").mkdir(parents=True, exist_ok=True)
    wrap = tube_wrap(laminate)
    written: list[MeshFile] = []
    left_out: list[tuple[str, str]] = []
    solids = {row.ending: row.solid for row in mesh_formats() if row.solid}
    wrappings = [None] if wrap is None else [None, wrap]
    shapes = [(chamber, way) for chamber in (None, *laminate.chambers) for way in wrappings]
    total = sum(len(solids) if chamber is None else 1 for chamber, _ in shapes)
    for chamber, wrapping in shapes:
        name = None if chamber is None else chamber.name
        stem = "solid" if name is None else f"cavity_{name}"
        stem += "" if wrapping is None else "_wrapped"
        writers = solids if name is None else {"stl": write_stl}
        files = {f"mesh/{stem}.{ending}": write for ending, write in writers.items()}
        try:
            surface = _surface(laminate, chamber, wrapping)
        except OutputError as error:
            left_out += [(file, str(error)) for file in files]
            continue
        facts: dict[str, Any] = {
            "chamber": name,
            "volume_mm3": surface.volume,
            "elements": len(surface.faces),
        }
        facts |= {"kind": "solid" if name is None else "cavity", "fill_ul": 0.0}
        for file, write in files.items():
            write(surface, folder / file, laminate.bonded_materials)
            written.append(MeshFile(file=file, **facts))
            if progress is not None:
                progress(len(written), total)
    return written, left_out


def _surface(laminate: Laminate, chamber: Chamber | None, wrap: TubeWrap | None) -> Surface:
    step = 0.0 if wrap is None else wrap.step
    surface = solid(laminate, step=step) if chamber is None else cavity(laminate, chamber, step)
    if wrap is None:
        return surface
    name = "the solid" if chamber is None else f"the cavity of chamber {chamber.name}"
    return sealed(f"{name} round its tube", wrapped(surface, wrap))
