"""Surfaces read back from STL, 3MF and GLB files, and compared."""

from __future__ import annotations

import json
import re
import struct
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple
from zipfile import BadZipFile, ZipFile

from sbafab.errors import OutputError
from sbafab.meshing.surface import Surface, open_edges

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

NEAR = 2e-5
"""mm by which a point stored in single precision, or to 6 decimals, may be off."""
SHARE = 1e-5
"""Share of a volume by which two triangulations of one solid may differ."""
MOST_BYTES = 500_000_000
MOST_SIZE = 1e5
"""mm from the origin."""
MODEL = "3D/3dmodel.model"
VERTEX = re.compile(r'<vertex x="([^"]*)" y="([^"]*)" z="([^"]*)" */>')
TRIANGLE = re.compile(r'<triangle v1="([^"]*)" v2="([^"]*)" v3="([^"]*)" */>')


class Body(NamedTuple):
    """A surface, and what its file says of it beside points and faces."""

    surface: Surface
    said: str


def mesh_difference(found: Path, meant: Path) -> str:
    """What differs between two mesh files of one format; empty where they hold the same bodies.

    Triangles may lie otherwise, as another version of a library lays them; points, enclosed
    volume, area and watertightness may not differ.
    """
    own, wanted = bodies(found), bodies(meant)
    if len(own) != len(wanted):
        return f"it holds {len(own)} bodies, not {len(wanted)}"
    pairs = zip(own, wanted, strict=True)
    return next(filter(None, (_difference(one, other) for one, other in pairs)), "")


def bodies(path: Path) -> list[Body]:
    """The bodies of a mesh file, in mm. Raises OutputError for what is none."""
    if path.stat().st_size > MOST_BYTES:
        raise OutputError(f"larger than {MOST_BYTES:,} bytes")
    readers = {".stl": _stl, ".3mf": _3mf, ".glb": _glb}
    try:
        return readers[path.suffix](path)
    except (ValueError, LookupError, TypeError, struct.error, BadZipFile) as error:
        raise OutputError(f"no sound mesh: {error}") from error


def _difference(own: Body, wanted: Body) -> str:
    if own.said != wanted.said:
        return "names, materials or scales of its bodies are others"
    surface, meant = own.surface, wanted.surface
    said = _unsound(surface)
    if said:
        return said
    for one, other, what in ((surface, meant, "too many"), (meant, surface, "missing")):
        stray = _stray(one.points, other.points)
        if stray is not None:
            x, y, z = stray
            return f"the point at x {x:.3f}, y {y:.3f}, z {z:.3f} is {what}"
    if abs(surface.volume - meant.volume) > SHARE * abs(meant.volume):
        return f"it encloses {surface.volume:.4f} mm3, not {meant.volume:.4f}"
    if abs(_area(surface) - _area(meant)) > SHARE * _area(meant):
        return f"its surface is {_area(surface):.3f} mm2, not {_area(meant):.3f}"
    return ""


def _unsound(surface: Surface) -> str:
    import numpy as np

    points, faces = surface.points, surface.faces
    if not len(points) or not len(faces):
        return "it is empty"
    if not np.isfinite(points).all() or float(np.abs(points).max()) > MOST_SIZE:
        return "it has a point that is nowhere"
    if int(faces.min()) < 0 or int(faces.max()) >= len(points):
        return "it has a face of a point that is not there"
    return "it is not watertight" if len(open_edges(surface)) else ""


def _area(surface: Surface) -> float:
    import numpy as np

    a, b, c = (surface.points[surface.faces[:, corner]] for corner in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def _stray(points: NDArray[np.float64], others: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """A point with none of the others nearer than NEAR."""
    import numpy as np

    def cells(of: NDArray[np.float64], shift: NDArray[np.float64]) -> NDArray[np.int64]:
        return np.floor(of / (4 * NEAR) + shift).astype(np.int64)

    # A point and its like share a cell of one grid or of another one shifted by half a cell.
    left = np.unique(points, axis=0)
    for shift in np.ndindex(2, 2, 2):
        if not len(left):
            return None
        by = np.array(shift) / 2
        known = {row.tobytes() for row in cells(others, by)}
        own = cells(left, by)
        left = left[[row.tobytes() not in known for row in own]]
    stray: NDArray[np.float64] | None = left[0] if len(left) else None
    return stray


def _stl(path: Path) -> list[Body]:
    import numpy as np

    data = path.read_bytes()
    (count,) = struct.unpack_from("<I", data, 80)
    if len(data) != 84 + 50 * count or not count:
        raise OutputError("its length is not that of its triangles")
    kind = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("spare", "<u2")])
    rows = np.frombuffer(data, kind, offset=84)
    points, faces = np.unique(rows["corners"].reshape(-1, 3), axis=0, return_inverse=True)
    surface = Surface(points.astype(np.float64), faces.reshape(-1, 3).astype(np.int64))
    edges = surface.points[surface.faces]
    normal = np.cross(edges[:, 1] - edges[:, 0], edges[:, 2] - edges[:, 0])
    against = np.einsum("ij,ij->i", normal, rows["normal"].astype(np.float64))
    if (against < 0).any():
        raise OutputError("a triangle's normal points inward")
    return [Body(surface, "")]


def _3mf(path: Path) -> list[Body]:
    import numpy as np

    with ZipFile(path) as archive:
        if sum(info.file_size for info in archive.infolist()) > MOST_BYTES:
            raise OutputError(f"holds more than {MOST_BYTES:,} bytes")
        parts = {name: archive.read(name).decode() for name in sorted(archive.namelist())}
    model = parts.pop(MODEL)
    points = np.array(VERTEX.findall(model), dtype=np.float64).reshape(-1, 3)
    faces = np.array(TRIANGLE.findall(model), dtype=np.int64).reshape(-1, 3)
    frame = TRIANGLE.sub("", VERTEX.sub("", model)).split()
    return [Body(Surface(points, faces), json.dumps([parts, frame]))]


def _glb(path: Path) -> list[Body]:
    import numpy as np

    data = path.read_bytes()
    magic, _, total, size, kind = struct.unpack_from("<4sII I4s", data)
    if magic != b"glTF" or kind != b"JSON" or total != len(data):
        raise OutputError("no binary glTF")
    document: dict[str, Any] = json.loads(data[20 : 20 + size])
    start = 28 + size
    found = []
    for node in document["nodes"]:
        (primitive,) = document["meshes"][node["mesh"]]["primitives"]
        arrays = []
        for number, kind in (
            (primitive["attributes"]["POSITION"], "<f4"),
            (primitive["indices"], "<u4"),
        ):
            accessor = document["accessors"][number]
            view = document["bufferViews"][accessor["bufferView"]]
            begin = start + view.get("byteOffset", 0)
            arrays.append(
                np.frombuffer(data[begin : begin + view["byteLength"]], kind).reshape(-1, 3)
            )
        material = document["materials"][primitive["material"]]
        surface = Surface(arrays[0].astype(np.float64), arrays[1].astype(np.int64))
        own = {key: value for key, value in node.items() if key != "mesh"}
        found.append(Body(surface, json.dumps([own, material, document["scenes"]])))
    return found
